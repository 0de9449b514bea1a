//! Scenes that move: refitting against rebuilding, frame by frame, for layouts, numbers of instances and policies.
//! `docs/lab.md` describes the configuration and the columns, `docs/motion.md` the motion.

mod config;
mod rows;
mod summary;

use std::path::{Path, PathBuf};

pub(in crate::lab) use config::{Keys, Motion};
pub use rows::MotionRow;
pub(in crate::lab) use rows::NAMES;
pub(in crate::lab) use rows::Setup;
pub use summary::PolicySummary;
pub(in crate::lab) use summary::SUMMARIES;
pub(in crate::lab) use summary::Summary;

use super::LabError;
use super::reading::{self, ReadScene, core_bounds};
use super::tables::Tables;
use crate::choose::plans::Plan;
use crate::choose::{Evaluator, written};
use crate::cost::mesh_trees::MeshTrees;
use crate::layout::{Layout, Placement, order_by_tree, stored};
use crate::methods::{self, Method, Options};
use crate::motion::frames::{self, FramesError};
use crate::motion::{MovingScene, PlacedCopies, Rig};
use crate::scene::{Bounds, InstanceId, Scene};
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
    let model = motion.model.as_deref().map(reading::read).transpose().map_err(LabError::Scene)?;
    let (model, warnings) = model.map_or_else(Default::default, |read| (joined(&read.scene), read.warnings));
    let bench = Bench { motion, machine, plans: common.plans, verify: common.verify, model };
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
pub(in crate::lab) fn joined(model: &Scene) -> Scene {
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
        let ReadScene { doc, scene, warnings } = reading::read(path).map_err(LabError::Scene)?;
        let rig = Rig::read(&doc, &scene, self.motion.animation).map_err(|e| LabError::Scene(e.to_string()))?;
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
        for (i, (plan, laid)) in laid.iter().enumerate() {
            let still = scene_of(i);
            let layout = Still {
                name,
                layout: &plan.id.to_string(),
                still: &still,
                rig: rig.as_ref(),
                laid: Some(&laid.layout),
            };
            self.layout(&layout, &scene, output, progress)?;
        }
        if self.motion.alone {
            let (layout, still) = (INSTANCES_ONLY, &Scene::default());
            self.layout(&Still { name, layout, still, rig: None, laid: None }, &scene, output, progress)?;
        }
        Ok(())
    }

    /// Measures a layout of a scene with each number of instances.
    fn layout(
        &self,
        of: &Still<'_>,
        scene: &Scene,
        output: &mut Output,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(), LabError> {
        let bounds = core_bounds(scene);
        for &instances in &self.motion.instances {
            progress(&format!("{}, {}, {instances} instances", of.name, of.layout));
            let copies = self.copies(instances, &bounds);
            let size = self.motion.size_ratio * bounds.diagonal();
            let animated = copies.animations.len() as u32;
            let mut moving = MovingScene::new(of.still, &self.model, size, copies);
            if let Some(rig) = of.rig {
                moving.play(rig.clone(), |instance| of.placement(instance));
            }
            let setup = Setup {
                scene: of.name.to_owned(),
                layout: of.layout.to_owned(),
                instances,
                animated,
                device: self.machine.name().0.to_owned(),
                device_kind: self.machine.name().1,
            };
            self.frames(setup, &mut moving, output)?;
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

/// A layout of a scene, before anything is added or moves.
struct Still<'a> {
    name: &'a str,
    layout: &'a str,
    still: &'a Scene,
    /// What moves of it.
    rig: Option<&'a Rig>,
    /// What it is stored from.
    laid: Option<&'a Layout>,
}

impl Still<'_> {
    /// Returns the instance that places an instance of the scene as it is.
    fn placement(&self, instance: u32) -> Option<u32> {
        let laid = self.laid?;
        let places =
            |p: &Placement| p.instance == Some(InstanceId(instance)) && laid.groups[p.group as usize].content.is_kept();
        laid.placements.iter().position(places).map(|i| i as u32)
    }
}

/// Name of the layout without the scene.
const INSTANCES_ONLY: &str = "instances only";
