//! Measures layouts: makes them by the code that `bake` uses, builds them, and times the rays of a picture.

use std::collections::BTreeMap;
use std::time::Instant;

use super::moving::MotionRun;
use super::row::{KINDS, KindRun, RunRow};
use super::setup::{PictureSetup, Setup, flags};
use super::subject::Subject;
use crate::choose::{Chosen, Pass, PassId, choose};
use crate::commands::measure::measure_with;
use crate::cost::mesh_trees::MeshTrees;
use crate::cost::{self, Metrics};
use crate::lab::LabError;
use crate::lab::error_vs_time::Tracer;
use crate::lab::thesis_files::SettingsFile;
use crate::layout::{as_built, stored};
use crate::motion::MovingScene;
use crate::motion::frames::{FrameOptions, RebuildEvery};
use crate::render::{CameraChoice, Renderer};
use crate::scene::Scene;
use crate::verify::build::BuildOptions;
use crate::verify::cpu::{ComputingTracer, Precision, Reference, TwoLevel};
use crate::verify::probe::{Probe, Prober, Until};
use crate::verify::rays::shot::{Shot, of_shot};
use crate::verify::rays::{Ray, RayKind};
use crate::verify::speed::{median, spread_of_median};
use crate::verify::view::View;
use crate::verify::{DeviceChoice, Machine, MachineKind, PerKind, VerifyOptions};

/// Up to so many rays of a kind, what they hit first is found in double precision.
const MOST_EXACT: usize = 1 << 16;

/// Rays of a kind in each frame of a scene that moves, at most: they are generated anew in each frame.
const MOST_MOVING: usize = 1 << 17;

/// What measures.
pub(in crate::lab) struct Bench {
    pub(in crate::lab) machine: Machine,
    /// When to stop timing a layout: all kinds of rays together.
    pub(in crate::lab) until: Until,
    /// Seed of the rays.
    pub(in crate::lab) seed: u64,
    /// Frames to trace of scenes with instances that move.
    pub(in crate::lab) frames: u32,
}

impl Bench {
    /// Opens a device.
    ///
    /// # Errors
    /// Fails if the device cannot be used.
    pub(in crate::lab) fn open(device: &DeviceChoice, until: Until, seed: u64) -> Result<Bench, LabError> {
        let machine = Machine::open(device);
        let machine = machine.map_err(|e| LabError::Device(e.to_string().replace("--device", "`device`")))?;
        Ok(Bench { machine, until, seed, frames: 0 })
    }
}

/// A scene on a bench: what its runs share.
pub(in crate::lab) struct Session<'a> {
    bench: &'a Bench,
    pub(in crate::lab) subject: &'a Subject,
    trees: MeshTrees,
    /// Of the input.
    metrics: Metrics,
    views: Vec<View>,
    /// The rays of the last picture.
    rays: Option<(PictureSetup, PerKind<Vec<Ray>>)>,
    /// What builds on the device, by build flags.
    probers: Vec<(BuildOptions, Box<dyn Prober + 'a>)>,
}

/// A layout of a scene, as its consumer builds it.
pub(in crate::lab) struct LaidOut {
    pub(in crate::lab) chosen: Chosen,
    /// The model as it is stored.
    pub(in crate::lab) stored: Scene,
    pub(in crate::lab) metrics: Metrics,
    /// Seconds that the method took.
    pub(in crate::lab) seconds: f64,
}

impl<'a> Session<'a> {
    /// Readies a scene.
    ///
    /// # Errors
    /// Fails if rays cannot hit anything.
    pub(in crate::lab) fn new(bench: &'a Bench, subject: &'a Subject) -> Result<Session<'a>, String> {
        let trees = MeshTrees::build(&subject.scene);
        let metrics = measure_with(&subject.scene, &trees, BuildOptions::default().blas_per);
        let views = match subject.views.is_empty() {
            true => {
                let renderer = Renderer::with_trees(&subject.doc, &subject.scene, &trees).map_err(|e| e.to_string())?;
                let camera = renderer.camera(&CameraChoice::Default).map_err(|e| e.to_string())?;
                vec![camera.view().clone()]
            }
            false => subject.views.clone(),
        };
        Ok(Session { bench, subject, trees, metrics, views, rays: None, probers: Vec::new() })
    }

    /// Returns the first camera.
    pub(in crate::lab) fn view(&self) -> &View {
        &self.views[0]
    }

    /// Runs an environment.
    ///
    /// # Errors
    /// Fails if nothing can be traced. What the device cannot take is a row with the reason.
    pub(in crate::lab) fn run(&mut self, setup: &Setup) -> Result<RunRow, String> {
        let laid = self.lay_out(setup);
        self.run_laid(setup, &laid)
    }

    /// Runs an environment whose layout is made already.
    ///
    /// # Errors
    /// Like [`Session::run`].
    pub(in crate::lab) fn run_laid(&mut self, setup: &Setup, laid: &LaidOut) -> Result<RunRow, String> {
        self.make_rays(&setup.picture)?;
        let mut row = self.row(setup, laid);
        let mut moving = self.subject.moving(&laid.stored);
        row.instances = moving.scene().instances.len() as u64;
        let start = Instant::now();
        match self.trace(moving.scene(), setup, &mut row) {
            Ok(()) => row.timed_seconds = start.elapsed().as_secs_f64(),
            Err(why) => row.failure = Some(why),
        }
        self.trace_motion(&mut moving, setup, &mut row);
        Ok(row)
    }

    /// Traces the frames of a scene that moves, if what traced the row can.
    fn trace_motion(&self, moving: &mut MovingScene, setup: &Setup, row: &mut RunRow) {
        let Bench { machine, frames, seed, .. } = self.bench;
        let is_by_machine = matches!(setup.tracer, None | Some(Tracer::Device)) || machine.name().1 == MachineKind::Cpu;
        if row.failure.is_some() || !self.subject.moves() || *frames == 0 || !is_by_machine {
            return;
        }
        let options = FrameOptions { frames: *frames, seed: *seed, camera: self.subject.orbit, ..frame_options(setup) };
        match MotionRun::of(moving, machine, &options) {
            Ok(motion) => row.motion = Some(motion),
            Err(why) => row.failure = Some(format!("in motion: {why}")),
        }
    }

    /// Runs the instances without the scene, with the rays of both.
    ///
    /// # Errors
    /// Like [`Session::run`].
    pub(in crate::lab) fn run_alone(&mut self, setup: &Setup) -> Result<RunRow, String> {
        self.make_rays(&setup.picture)?;
        let mut moving = self.subject.moving(&Scene::default());
        let mut row = RunRow {
            id: self.id(setup),
            instances: moving.scene().instances.len() as u64,
            added_instances: moving.scene().instances.len() as u64,
            build_flags: flags(&setup.bake.verify.build),
            ..RunRow::begun(self.subject, setup)
        };
        row.failure = self.trace(moving.scene(), setup, &mut row).err();
        self.trace_motion(&mut moving, setup, &mut row);
        Ok(row)
    }

    /// Identifies the run of a setup.
    pub(in crate::lab) fn id(&self, setup: &Setup) -> String {
        let Subject { name, model, views, light, instances, .. } = self.subject;
        let placed = instances.as_ref().map(|of| &of.copies);
        let frames = self.subject.moves().then_some(self.bench.frames);
        let how = (env!("CARGO_PKG_VERSION"), self.bench.until, self.bench.seed, self.bench.machine.name(), frames);
        let text = format!("{name} {model} {views:?} {light:?} {placed:?} {setup:?} {how:?}");
        blake3::hash(text.as_bytes()).to_hex()[..16].to_owned()
    }

    /// Makes the layout of a setup.
    pub(in crate::lab) fn lay_out(&self, setup: &Setup) -> LaidOut {
        let (scene, verify) = (&self.subject.scene, &setup.bake.verify);
        let metrics = [&self.metrics; 2];
        let chosen = choose(scene, &self.trees, metrics, &self.bench.machine, &setup.bake.choose, verify);
        let built = as_built(scene, &chosen.layout, verify.build.blas_per);
        let metrics = cost::measure_with(scene, &built, &self.trees);
        let stored = stored(scene, &built);
        let of_method = |pass: &&Pass| pass.id == PassId::Regroup;
        let seconds = chosen.passes.iter().find(of_method).map_or(0.0, |pass| pass.seconds);
        LaidOut { stored, metrics, seconds, chosen }
    }

    /// Returns the rays of a picture through the input with its instances.
    fn make_rays(&mut self, picture: &PictureSetup) -> Result<(), String> {
        if self.rays.as_ref().is_some_and(|(of, _)| of == picture) {
            return Ok(());
        }
        let scene = self.subject.with_instances(&self.subject.scene);
        let shot = Shot {
            views: self.views.clone(),
            light: self.subject.light,
            size: picture.size,
            samples: picture.samples,
            light_samples: picture.light_samples,
            bounces: picture.secondary_rays,
            seed: self.bench.seed,
        };
        let count = picture.size.map(|side| side as usize).iter().product::<usize>() * picture.samples as usize;
        let on_device = if count > MOST_EXACT { self.prober(BuildOptions::default())? } else { None };
        let rays = match on_device {
            Some(prober) => {
                let probe = prober.probe(&scene)?;
                of_shot(&scene, |rays| probe.closest(rays), &shot)?
            }
            None => {
                let trees = TwoLevel::build(&scene);
                let reference = Reference::new(&trees);
                of_shot(&scene, |rays| Ok::<_, String>(reference.closest(rays)), &shot)?
            }
        };
        self.rays = Some((*picture, rays));
        Ok(())
    }

    /// Returns what builds on the device; `None` where the CPU traces.
    fn prober(&mut self, build: BuildOptions) -> Result<Option<&dyn Prober>, String> {
        let at = match self.probers.iter().position(|(of, _)| *of == build) {
            Some(at) => at,
            None => {
                let options = VerifyOptions { build, ..VerifyOptions::default() };
                let Some(prober) = self.bench.machine.prober(&options) else { return Ok(None) };
                self.probers.push((build, prober?));
                self.probers.len() - 1
            }
        };
        Ok(Some(self.probers[at].1.as_ref()))
    }

    /// Builds a scene and times the rays through it.
    fn trace(&mut self, scene: &Scene, setup: &Setup, row: &mut RunRow) -> Result<(), String> {
        let rays = self.rays.take();
        let traced = self.trace_rays(scene, setup, rays.as_ref().map(|(_, rays)| rays), row);
        self.rays = rays;
        traced
    }

    fn trace_rays(
        &mut self,
        scene: &Scene,
        setup: &Setup,
        rays: Option<&PerKind<Vec<Ray>>>,
        row: &mut RunRow,
    ) -> Result<(), String> {
        let Some(rays) = rays else { return Err("there are no rays".into()) };
        let (until, machine) = (self.bench.until, self.bench.machine.name());
        let (name, kind) = (machine.0.to_owned(), machine.1);
        let prober = self.prober(setup.bake.verify.build)?;
        match (setup.tracer, prober) {
            (None | Some(Tracer::Device), Some(prober)) => {
                let probe = prober.probe(scene)?;
                (row.tracer, row.device, row.device_kind) = ("device".into(), name, kind.name().into());
                if let Some(built) = probe.built() {
                    row.blas_build_ms = Some(built.blas_build_ms);
                    row.blas_bytes = Some(built.blas_bytes_compacted.unwrap_or(built.blas_bytes));
                    (row.tlas_build_ms, row.tlas_bytes) = (Some(built.tlas_build_ms), Some(built.tlas_bytes));
                }
                time(probe.as_ref(), rays, until, row)
            }
            (Some(Tracer::Device), None) => Err("there is no Vulkan device that can trace rays".into()),
            (tracer, _) => {
                let precision =
                    if let Some(Tracer::Cpu(precision)) = tracer { precision } else { Precision::F32Watertight };
                (row.tracer, row.device, row.device_kind) = (precision.name().into(), "CPU".into(), "cpu".into());
                let trees = TwoLevel::build(scene);
                time(&ComputingTracer::new(&trees, precision), rays, until, row)
            }
        }
    }

    /// Returns what is known of a layout without tracing it.
    fn row(&self, setup: &Setup, laid: &LaidOut) -> RunRow {
        let bake = &setup.bake;
        let (subject, LaidOut { chosen, metrics, seconds, .. }) = (self.subject, laid);
        RunRow {
            id: self.id(setup),
            layout: chosen.selection.plan.to_string(),
            triangles: metrics.triangles_placed,
            meshes: metrics.instances,
            added_instances: subject.instances.as_ref().map_or(0, |of| of.copies.positions.len() as u64),
            animated_instances: subject.instances.as_ref().map_or(0, |of| of.copies.animations.len() as u64),
            overlap_ratio: metrics.overlap_ratio,
            sah_cost: metrics.sah_cost,
            two_level_cost: metrics.two_level_cost,
            splits: chosen.layout.rounds.as_ref().map(|rounds| rounds.splits),
            merges: chosen.layout.rounds.as_ref().map(|rounds| rounds.merges),
            optimise_seconds: *seconds,
            build_flags: flags(&bake.verify.build),
            predicted_bytes: metrics.as_bytes(),
            ..RunRow::begun(subject, setup)
        }
    }
}

impl RunRow {
    /// Returns what is known of a run before anything is laid out.
    fn begun(subject: &Subject, setup: &Setup) -> RunRow {
        RunRow { scene: subject.name.clone(), model: subject.model.clone(), ..RunRow::asked(setup) }
    }

    /// Returns what a setup asks for.
    fn asked(setup: &Setup) -> RunRow {
        RunRow {
            environment: setup.name.clone(),
            settings: setup.swept.iter().cloned().collect(),
            method: setup.bake.choose.method.name().to_owned(),
            size: setup.picture.size,
            pixel_samples: setup.picture.samples,
            light_samples: setup.picture.light_samples,
            ..RunRow::default()
        }
    }

    /// Returns the row of a run that failed before anything was traced.
    pub(in crate::lab) fn of_failed(subject: &Subject, setup: &Setup, why: &str) -> RunRow {
        RunRow { failure: Some(why.to_owned()), ..RunRow::begun(subject, setup) }
    }

    /// Returns the row of a run whose scene cannot be read.
    pub(in crate::lab) fn of_unread(scene: &SettingsFile, setup: &Setup, why: &str) -> RunRow {
        let model = scene.in_words("model_file_name").unwrap_or_default();
        let name = scene.in_words("scene_name").unwrap_or_else(|| scene.stem());
        RunRow { scene: name, model, failure: Some(why.to_owned()), ..RunRow::asked(setup) }
    }
}

/// Returns how the frames of an environment are traced.
fn frame_options(setup: &Setup) -> FrameOptions {
    let rays = setup.picture.size.map(|side| side as usize).iter().product::<usize>() * setup.picture.samples as usize;
    FrameOptions {
        policies: vec![match setup.rebuild_interval {
            0 => RebuildEvery::Never,
            frames => RebuildEvery::Frames(frames),
        }],
        rays: rays.min(MOST_MOVING),
        counted_rays: 0,
        camera_frequency: 0.0,
        build: setup.bake.verify.build,
        ..FrameOptions::default()
    }
}

/// Times all kinds of rays, each for its share of the time.
fn time(probe: &dyn Probe, rays: &PerKind<Vec<Ray>>, until: Until, row: &mut RunRow) -> Result<(), String> {
    let kinds: Vec<RayKind> = KINDS.into_iter().filter(|&kind| !rays[kind].is_empty()).collect();
    let until = match until {
        Until::Seconds(seconds) => Until::Seconds(seconds / kinds.len().max(1) as f64),
        passes => passes,
    };
    let mut found: BTreeMap<String, KindRun> = BTreeMap::new();
    for kind in kinds {
        let times = probe.passes(kind, &rays[kind], until)?;
        found.insert(kind.name().to_owned(), KindRun::of(rays[kind].len(), &times));
    }
    let seconds: f64 = found.values().map(|run| run.seconds).sum();
    let count: u64 = found.values().map(|run| run.rays).sum();
    row.all_mrays_per_s = if seconds > 0.0 { count as f64 / 1e6 / seconds } else { 0.0 };
    let spreads: Option<Vec<f64>> = found.values().map(|run| Some(run.spread_ratio? * run.seconds / seconds)).collect();
    // Kinds are timed one after the other: their uncertainties are independent.
    row.all_spread_ratio = spreads.map(|all| all.iter().map(|x| x * x).sum::<f64>().sqrt());
    row.kinds = found;
    Ok(())
}

impl KindRun {
    fn of(rays: usize, times: &[f64]) -> KindRun {
        let seconds = median(times);
        KindRun {
            rays: rays as u64,
            passes: times.len() as u64,
            seconds,
            mrays_per_s: rays as f64 / 1e6 / seconds,
            spread_ratio: spread_of_median(times),
        }
    }
}
