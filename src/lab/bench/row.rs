//! The table of runs.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::moving::MotionRun;
use crate::verify::rays::RayKind;

/// One environment on one scene. `docs/lab.md` describes the columns.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunRow {
    /// Identifies the run: equal for equal scenes, settings and versions of the program.
    pub id: String,
    /// The scene's name.
    pub scene: String,
    /// The environment's name.
    pub environment: String,
    /// The swept keys of the environment, with their values.
    pub settings: BTreeMap<String, String>,
    /// The model's path as the scene has it.
    pub model: String,
    /// The method asked for.
    pub method: String,
    /// The layout it came to.
    pub layout: String,
    /// What traced.
    pub tracer: String,
    /// Its device.
    pub device: String,
    /// `gpu`, `software driver` or `cpu`.
    pub device_kind: String,
    /// Triangles placed by the model.
    pub triangles: u64,
    /// Meshes of the layout of the model, as the thesis counts them: BLASes, or objects in one.
    pub meshes: u64,
    /// TLAS entries, with added instances.
    pub instances: u64,
    /// Added instances.
    pub added_instances: u64,
    /// Those of them that are animated.
    pub animated_instances: u64,
    /// Overlap ratio of the layout of the model.
    pub overlap_ratio: f64,
    /// Its SAH cost.
    pub sah_cost: f64,
    /// Its two-level cost.
    pub two_level_cost: f64,
    /// Objects that the method split; of `overlap`.
    pub splits: Option<u64>,
    /// Pairs that the method merged; of `overlap`.
    pub merges: Option<u64>,
    /// Seconds that the method took.
    pub optimise_seconds: f64,
    /// OptiX's build flags.
    pub build_flags: u64,
    /// Milliseconds to build all BLASes; `None` on the CPU.
    pub blas_build_ms: Option<f64>,
    /// Bytes of the BLASes, compacted if they are.
    pub blas_bytes: Option<u64>,
    /// Milliseconds to build the TLAS.
    pub tlas_build_ms: Option<f64>,
    /// Bytes of the TLAS.
    pub tlas_bytes: Option<u64>,
    /// Predicted bytes of BLASes and TLAS of the model.
    pub predicted_bytes: u64,
    /// Width and height of the picture, in pixels.
    pub size: [u32; 2],
    /// Primary rays per pixel.
    pub pixel_samples: u32,
    /// Shadow rays per hit.
    pub light_samples: u32,
    /// By kind of rays, those that were traced.
    pub kinds: BTreeMap<String, KindRun>,
    /// All rays over the seconds that all took.
    pub all_mrays_per_s: f64,
    /// How far off that may be, over it.
    pub all_spread_ratio: Option<f64>,
    /// The frames in which instances move; `None` if none do.
    pub motion: Option<MotionRun>,
    /// Seconds that timing took.
    pub timed_seconds: f64,
    /// Why nothing was timed.
    pub failure: Option<String>,
}

/// Rays of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KindRun {
    /// Rays per pass.
    pub rays: u64,
    /// Number of passes.
    pub passes: u64,
    /// Median seconds of a pass.
    pub seconds: f64,
    /// Million rays per second.
    pub mrays_per_s: f64,
    /// How far off that may be, over it; `None` for fewer than three passes.
    pub spread_ratio: Option<f64>,
}

/// The kinds of rays of a picture.
pub(in crate::lab) const KINDS: [RayKind; 3] = [RayKind::Primary, RayKind::Shadow, RayKind::Diffuse];

impl RunRow {
    /// Its fields as columns: names and values.
    pub(in crate::lab) fn columns(&self) -> Vec<(String, String)> {
        fn some<T: ToString>(value: &Option<T>) -> String {
            value.as_ref().map_or(String::new(), T::to_string)
        }
        let mut columns = Columns(Vec::new());
        columns.add("id", &self.id).add("scene", &self.scene).add("environment", &self.environment);
        for (name, value) in &self.settings {
            columns.add(&format!("setting_{name}"), value);
        }
        columns.add("model", &self.model).add("method", &self.method).add("layout", &self.layout);
        columns.add("tracer", &self.tracer).add("device", &self.device).add("device_kind", &self.device_kind);
        columns.add("triangles", self.triangles).add("meshes", self.meshes).add("instances", self.instances);
        columns.add("added_instances", self.added_instances).add("animated_instances", self.animated_instances);
        columns.add("overlap_ratio", self.overlap_ratio).add("sah_cost", self.sah_cost);
        columns.add("two_level_cost", self.two_level_cost);
        columns.add("splits", some(&self.splits)).add("merges", some(&self.merges));
        columns.add("optimise_seconds", self.optimise_seconds).add("build_flags", self.build_flags);
        columns.add("blas_build_ms", some(&self.blas_build_ms)).add("blas_bytes", some(&self.blas_bytes));
        columns.add("tlas_build_ms", some(&self.tlas_build_ms)).add("tlas_bytes", some(&self.tlas_bytes));
        columns.add("predicted_bytes", self.predicted_bytes);
        columns.add("width", self.size[0]).add("height", self.size[1]);
        columns.add("pixel_samples", self.pixel_samples).add("light_samples", self.light_samples);
        for kind in KINDS.map(RayKind::name) {
            let run = self.kinds.get(kind);
            columns.add(&format!("{kind}_rays"), some(&run.map(|run| run.rays)));
            columns.add(&format!("{kind}_mrays_per_s"), some(&run.map(|run| run.mrays_per_s)));
            columns.add(&format!("{kind}_spread_ratio"), some(&run.and_then(|run| run.spread_ratio)));
        }
        columns.add("all_mrays_per_s", self.all_mrays_per_s).add("all_spread_ratio", some(&self.all_spread_ratio));
        for (name, value) in MotionRun::columns(self.motion.as_ref()) {
            columns.add(name, value);
        }
        columns.add("timed_seconds", self.timed_seconds).add("failure", some(&self.failure));
        columns.0
    }
}

struct Columns(Vec<(String, String)>);

impl Columns {
    fn add(&mut self, name: &str, value: impl ToString) -> &mut Columns {
        self.0.push((name.to_owned(), value.to_string()));
        self
    }
}
