//! The table of frames.

use serde::Serialize;

use crate::motion::frames::{Compared, Frame, RebuildEvery};
use crate::verify::frames::Upkeep;
use crate::verify::rays::RayKind;
use crate::verify::work::{Work, WorkPerRay};
use crate::verify::{MachineKind, PerKind};

/// The names of the tables: of frames, of policies, and of policies for people.
pub(in crate::lab) const NAMES: [&str; 2] = ["frames.csv", "frames.jsonl"];

/// What is the same in all frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Setup {
    /// The scene's path as the configuration has it.
    pub scene: String,
    /// Its layout, or `instances only`.
    pub layout: String,
    /// Copies of the model.
    pub instances: u32,
    /// How many of them move.
    pub animated: u32,
    /// What traced.
    pub device: String,
    /// `gpu`, `software driver` or `cpu`.
    pub device_kind: MachineKind,
}

/// A frame traced by one policy. `docs/lab.md` describes the columns.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MotionRow {
    /// What is the same in all frames.
    #[serde(flatten)]
    pub setup: Setup,
    /// The policy.
    pub rebuild_every: RebuildEvery,
    /// Number of the frame.
    pub frame: u32,
    /// Time of the animation.
    pub seconds: f64,
    /// To compute the matrices on the CPU.
    pub matrices_ms: f64,
    /// To hand them to the tracer.
    pub upload_ms: f64,
    /// To refit or rebuild the BLASes of what deforms.
    pub blas_ms: f64,
    /// To refit the TLAS, if it was refitted.
    pub refit_ms: Option<f64>,
    /// To rebuild the TLAS, if it was rebuilt.
    pub rebuild_ms: Option<f64>,
    /// To trace all rays.
    pub trace_ms: f64,
    /// Steps over those in a TLAS built anew, at the prices of the CPU.
    pub work_over_fresh_ratio: Option<f64>,
    /// Bytes of the BLASes.
    pub blas_bytes: u64,
    /// Bytes of the TLAS.
    pub tlas_bytes: u64,
    /// Bytes allocated on the device.
    pub device_bytes: Option<u64>,
    /// By kind of rays.
    pub kinds: PerKind<MotionKind>,
}

/// The rays of a kind in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MotionKind {
    /// To trace them.
    pub trace_ms: f64,
    /// Rays per second.
    pub mrays_per_s: f64,
    /// Rays per second over those through a TLAS built in this frame.
    pub speed_over_fresh_ratio: Option<f64>,
    /// Steps per ray, if they were counted.
    pub steps: Option<WorkPerRay>,
    /// Steps per ray in a TLAS built in this frame.
    pub fresh_steps: Option<WorkPerRay>,
}

impl Default for MotionRow {
    fn default() -> Self {
        MotionRow {
            setup: Setup::default(),
            rebuild_every: RebuildEvery::Never,
            frame: 0,
            seconds: 0.0,
            matrices_ms: 0.0,
            upload_ms: 0.0,
            blas_ms: 0.0,
            refit_ms: None,
            rebuild_ms: None,
            trace_ms: 0.0,
            work_over_fresh_ratio: None,
            blas_bytes: 0,
            tlas_bytes: 0,
            device_bytes: None,
            kinds: PerKind::default(),
        }
    }
}

impl MotionRow {
    /// Returns the row of a frame.
    pub(in crate::lab) fn of(setup: &Setup, frame: &Frame) -> MotionRow {
        let upkeep = |is: Upkeep| (frame.times.upkeep == is).then_some(frame.times.upkeep_ms);
        let trace = frame.times.trace_ms.unwrap_or_default();
        MotionRow {
            setup: setup.clone(),
            rebuild_every: frame.policy,
            frame: frame.number,
            seconds: frame.time,
            matrices_ms: frame.matrices_ms,
            upload_ms: frame.times.upload_ms,
            blas_ms: frame.blas_ms,
            refit_ms: upkeep(Upkeep::Refit),
            rebuild_ms: upkeep(Upkeep::Rebuild),
            trace_ms: trace.values().sum(),
            work_over_fresh_ratio: frame.work.as_ref().map(Compared::work_ratio),
            blas_bytes: frame.bytes.blas,
            tlas_bytes: frame.bytes.tlas,
            device_bytes: frame.bytes.device,
            kinds: PerKind::of(|kind| MotionKind::of(frame, kind)),
        }
    }

    /// Its fields as columns: names and values.
    pub(super) fn columns(&self) -> Vec<(String, String)> {
        let Setup { scene, layout, instances, animated, device, device_kind } = &self.setup;
        let some = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let mut columns: Vec<(String, String)> = [
            ("scene", scene.clone()),
            ("layout", layout.clone()),
            ("instances", instances.to_string()),
            ("animated", animated.to_string()),
            ("device", device.clone()),
            ("device_kind", device_kind.name().to_owned()),
            ("rebuild_every", self.rebuild_every.to_string()),
            ("frame", self.frame.to_string()),
            ("seconds", self.seconds.to_string()),
            ("matrices_ms", self.matrices_ms.to_string()),
            ("upload_ms", self.upload_ms.to_string()),
            ("blas_ms", self.blas_ms.to_string()),
            ("refit_ms", some(self.refit_ms)),
            ("rebuild_ms", some(self.rebuild_ms)),
            ("trace_ms", self.trace_ms.to_string()),
            ("work_over_fresh_ratio", some(self.work_over_fresh_ratio)),
            ("blas_bytes", self.blas_bytes.to_string()),
            ("tlas_bytes", self.tlas_bytes.to_string()),
            ("device_bytes", self.device_bytes.map_or(String::new(), |bytes| bytes.to_string())),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into();
        columns.extend(self.kinds.iter().flat_map(|(kind, of)| of.columns(kind)));
        columns
    }
}

impl MotionKind {
    fn of(frame: &Frame, kind: RayKind) -> MotionKind {
        let trace_ms = frame.times.trace_ms.map_or(0.0, |times| times[kind]);
        let fresh_ms = frame.fresh_trace_ms.map(|times| times[kind]);
        let per_ray = |of: fn(&Compared) -> &PerKind<Work>| frame.work.as_ref().map(|work| of(work)[kind].per_ray());
        MotionKind {
            trace_ms,
            mrays_per_s: if trace_ms > 0.0 { frame.rays[kind] as f64 / (1e3 * trace_ms) } else { 0.0 },
            speed_over_fresh_ratio: fresh_ms.map(|fresh| fresh / trace_ms).filter(|ratio| ratio.is_finite()),
            steps: per_ray(|work| &work.aged),
            fresh_steps: per_ray(|work| &work.fresh),
        }
    }

    fn columns(&self, kind: RayKind) -> Vec<(String, String)> {
        let some = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let mut columns = vec![
            ("trace_ms".to_owned(), self.trace_ms.to_string()),
            ("mrays_per_s".to_owned(), self.mrays_per_s.to_string()),
            ("speed_over_fresh_ratio".to_owned(), some(self.speed_over_fresh_ratio)),
        ];
        for (prefix, steps) in [("", self.steps), ("fresh_", self.fresh_steps)] {
            columns.extend(counts(steps).map(|(name, count)| (format!("{prefix}{name}"), some(count))));
        }
        columns.into_iter().map(|(name, value)| (format!("{}_{name}", kind.name()), value)).collect()
    }
}

/// The names and numbers of steps per ray.
fn counts(steps: Option<WorkPerRay>) -> [(&'static str, Option<f64>); 4] {
    [
        ("tlas_nodes", steps.map(|s| s.tlas_nodes)),
        ("entries", steps.map(|s| s.entries)),
        ("blas_nodes", steps.map(|s| s.blas_nodes)),
        ("triangle_tests", steps.map(|s| s.triangle_tests)),
    ]
}
