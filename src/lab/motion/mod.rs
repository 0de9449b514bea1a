//! Scenes that move: refitting against rebuilding, frame by frame, for layouts, numbers of instances and policies.
//! `docs/lab.md` describes the configuration and the columns, `docs/motion.md` the motion.

mod config;
mod rows;
mod summary;

use std::path::{Path, PathBuf};

pub(in crate::lab) use config::{Keys, Motion};
pub use rows::MotionRow;
pub(in crate::lab) use rows::NAMES;
use rows::Setup;
pub use summary::PolicySummary;
pub(in crate::lab) use summary::SUMMARIES;
use summary::Summary;

use super::LabError;
use super::tables::Tables;
use crate::choose::plans::Plan;
use crate::choose::{Evaluator, written};
use crate::commands::verify;
use crate::cost::mesh_trees::MeshTrees;
use crate::layout::{order_by_tree, stored};
use crate::methods::{self, Method, Options};
use crate::motion::frames::{self, FramesError};
use crate::motion::{MovingScene, PlacedCopies};
use crate::scene::{Bounds, Scene};
use crate::verify::{Machine, VerifyOptions};

/// Results of the experiment.
#[derive(Debug, Default)]
pub(super) struct Measured {
    /// One for each policy of each layout and number of instances.
    pub(super) summaries: Vec<PolicySummary>,
    /// What was omitted, in words.
    pub(super) notes: Vec<String>,
    /// What the readers of the scenes repaired or omitted.
    pub(super) warnings: Vec<String>,
    /// Hits that rounding does not explain, in words.
    pub(super) faults: Vec<String>,
    /// The summary as Markdown.
    pub(super) text: String,
}

/// What all measurements have in common.
struct Bench<'a> {
    motion: &'a Motion,
    machine: &'a Machine,
    plans: &'a [Plan],
    verify: &'a VerifyOptions,
    model: Scene,
}

/// Where an experiment writes to.
struct Output<'a> {
    folder: &'a Path,
    tables: Tables,
    measured: Measured,
}

/// What the other keys of the configuration say.
pub(super) struct Common<'a> {
    /// The scenes, with their names.
    pub(super) scenes: &'a [(String, PathBuf)],
    /// The layouts of each scene.
    pub(super) plans: &'a [Plan],
    /// How structures are built, and the seed.
    pub(super) verify: &'a VerifyOptions,
    /// The folder for the tables.
    pub(super) out: &'a Path,
    /// Whether scenes that cannot be read or built are left out.
    pub(super) skip_broken: bool,
}

/// Measures all scenes. Each row is written as soon as its frame is traced.
///
/// # Errors
/// Fails if the model or a scene cannot be read or traced, unless such scenes are to be skipped, or if the folder cannot be
/// written to. Rows written until then stay.
pub(super) fn run(
    motion: &Motion,
    common: &Common<'_>,
    machine: &Machine,
    progress: &mut dyn FnMut(&str),
) -> Result<Measured, LabError> {
    let (model, warnings) = verify::read(&motion.model).map_err(|e| LabError::Scene(e.to_string()))?;
    if model.triangles_placed() == 0 {
        return Err(LabError::Scene(format!("{}: there are no triangles to trace", motion.model.display())));
    }
    let bench = Bench { motion, machine, plans: common.plans, verify: common.verify, model: joined(&model) };
    let tables = Tables::create(common.out, NAMES, &MotionRow::default().columns())?;
    let mut output = Output { folder: common.out, tables, measured: Measured { warnings, ..Measured::default() } };
    for (name, path) in common.scenes {
        match bench.file(name, path, &mut output, progress) {
            Err(LabError::Scene(why)) if common.skip_broken => output.measured.notes.push(format!("left out: {why}")),
            done => done?,
        }
    }
    let mut measured = output.measured;
    measured.text = summary::markdown(&measured.summaries, machine);
    summary::write(common.out, &measured.summaries, &measured.text)?;
    Ok(measured)
}

/// Returns a scene with all that may be joined in one mesh, as the copies of a crowd place it.
fn joined(model: &Scene) -> Scene {
    let mut single = methods::run(Method::Single, model, &Options::default());
    order_by_tree(model, &mut single);
    stored(model, &single)
}

impl Bench<'_> {
    /// Measures a scene in each layout, and the instances alone.
    fn file(
        &self,
        name: &str,
        path: &Path,
        output: &mut Output,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(), LabError> {
        let (scene, warnings) = verify::read(path).map_err(|e| LabError::Scene(e.to_string()))?;
        if scene.triangles_placed() == 0 {
            return Err(LabError::Scene(format!("{}: there are no triangles to trace", path.display())));
        }
        output.measured.warnings.extend(warnings);
        let trees = MeshTrees::build(&scene);
        let evaluator = Evaluator {
            trees: &trees,
            two_level_cost: 0.0,
            rays_per_kind: self.motion.frames.counted_rays,
            all_kinds: false,
            class: Default::default(),
            verify: self.verify,
        };
        let laid = evaluator.lay_out(&scene, self.plans).layouts;
        let scene_of = written(&scene, laid.iter().map(|(_, laid)| laid).collect());
        for (i, (plan, _)) in laid.iter().enumerate() {
            self.layout((name, &plan.id.to_string()), &scene_of(i), &scene, output, progress)?;
        }
        if self.motion.alone {
            self.layout((name, INSTANCES_ONLY), &Scene::default(), &scene, output, progress)?;
        }
        Ok(())
    }

    /// Measures a layout of a scene with each number of instances.
    fn layout(
        &self,
        (name, layout): (&str, &str),
        still: &Scene,
        scene: &Scene,
        output: &mut Output,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(), LabError> {
        let bounds = core_bounds(scene);
        for &instances in &self.motion.instances {
            progress(&format!("{name}, {layout}, {instances} instances"));
            let copies = self.copies(instances, &bounds);
            let setup = Setup {
                scene: name.to_owned(),
                layout: layout.to_owned(),
                instances,
                animated: copies.animations.len() as u32,
                device: self.machine.name().0.to_owned(),
                device_kind: self.machine.name().1,
            };
            let size = self.motion.size_ratio * bounds.diagonal();
            self.frames(setup, &mut MovingScene::new(still, &self.model, size, copies), output)?;
        }
        Ok(())
    }

    /// Traces all frames of a scene.
    fn frames(&self, setup: Setup, moving: &mut MovingScene, output: &mut Output) -> Result<(), LabError> {
        let mut summary = Summary::new(&self.motion.frames.policies);
        let (tables, folder) = (&mut output.tables, output.folder);
        let ran = frames::run(moving, self.machine, &self.motion.frames, &mut |frame| {
            let row = MotionRow::of(&setup, frame);
            summary.add(&row);
            tables.append(&row.columns(), &row).map_err(|e| LabError::file(folder, e))
        });
        let last = ran.map_err(|e| match e {
            FramesError::Tracer(why) => LabError::Scene(format!("{}: {why}", setup.scene)),
            FramesError::Receiver(error) => error,
        })?;
        let summaries = summary.finish(&last);
        output.measured.faults.extend(summaries.iter().filter_map(PolicySummary::fault));
        output.measured.summaries.extend(summaries);
        Ok(())
    }

    /// Places the copies of the model in the box of a scene.
    fn copies(&self, instances: u32, bounds: &Bounds) -> PlacedCopies {
        self.motion.crowd(instances, bounds.diagonal(), self.verify.seed).place(bounds)
    }
}

/// Name of the layout without the scene.
const INSTANCES_ONLY: &str = "instances only";

/// Returns the box of a scene without sky domes and far objects.
fn core_bounds(scene: &Scene) -> Bounds {
    let core = scene.core().bounds();
    if core.is_empty() { scene.bounds() } else { core }
}
