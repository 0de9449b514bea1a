//! Error against run time: how exactly and how fast each layout of each scene is traced, for swept settings and several
//! tracers. `docs/lab.md` describes the configuration and the columns.

mod config;
mod errors;
mod figures;
mod made;
mod placed;
mod rows;
mod settings;
mod timing;

use std::path::{Path, PathBuf};

pub(in crate::lab) use config::{ErrorVsTime, Keys, Tracer};
pub use rows::ErrorRow;
pub(in crate::lab) use rows::NAMES;
pub use settings::Value;
pub(in crate::lab) use settings::{Bake, Setting};

use super::LabError;
use super::reading;
use super::tables::Tables;
use crate::layout::stored;
use crate::scene::Scene;
use crate::verify::cpu::{ComputingTracer, Precision, Reference, TwoLevel};
use crate::verify::probe::{Probe, Prober};
use crate::verify::{Machine, MachineKind, rays};
use errors::{RayErrors, Truth};
use made::{Made, make_all};
use placed::Placement;
pub(in crate::lab) use timing::Pace;

/// Results of the experiment.
#[derive(Debug, Default)]
pub(super) struct Measured {
    pub(super) rows: Vec<ErrorRow>,
    /// What was omitted, in words.
    pub(super) notes: Vec<String>,
    /// What the readers of the scenes repaired or omitted.
    pub(super) warnings: Vec<String>,
}

/// What an experiment measures with.
struct Bench<'a> {
    experiment: &'a ErrorVsTime,
    machine: &'a Machine,
    /// Traces on the device, if the experiment has that tracer and there is one.
    prober: Option<Box<dyn Prober + 'a>>,
    /// The CPU's tracers.
    precisions: Vec<Precision>,
}

/// Where an experiment writes to.
struct Output<'a> {
    folder: &'a Path,
    tables: Tables,
    rows: Vec<ErrorRow>,
}

/// Measures all scenes; `scenes` are files with their names. Each row is written as soon as it is measured, and the
/// figure of a scene once its last row is.
///
/// # Errors
/// Fails if a scene cannot be read or traced, unless such scenes are to be skipped, if there is no device for the only
/// tracer asked for, or if the folder cannot be written to. Rows written until then stay.
pub(super) fn run(
    experiment: &ErrorVsTime,
    scenes: &[(String, PathBuf)],
    folder: &Path,
    machine: &Machine,
    skip_broken: bool,
    progress: &mut dyn FnMut(&str),
) -> Result<Measured, LabError> {
    let mut measured = Measured::default();
    let bench = Bench::new(experiment, machine, &mut measured.notes)?;
    let mut output = Output {
        folder,
        tables: Tables::create(folder, NAMES, &ErrorRow::of_settings(&experiment.sweep.names()).columns())?,
        rows: Vec::new(),
    };
    for generated in &experiment.generated {
        bench.placements(generated.name(), &generated.scene(), &mut output, progress)?;
    }
    for (name, path) in scenes {
        let done = reading::read(path).map_err(LabError::Scene).and_then(|read| {
            measured.warnings.extend(read.warnings);
            bench.placements(name, &read.scene, &mut output, progress)
        });
        match done {
            Err(LabError::Scene(why)) if skip_broken => measured.notes.push(format!("left out: {why}")),
            done => done?,
        }
    }
    figures::precision(&output.rows, folder)?;
    Ok(Measured { rows: output.rows, ..measured })
}

impl<'a> Bench<'a> {
    fn new(experiment: &'a ErrorVsTime, machine: &'a Machine, notes: &mut Vec<String>) -> Result<Self, LabError> {
        let of_cpu = |tracer: &Tracer| if let Tracer::Cpu(precision) = tracer { Some(*precision) } else { None };
        let precisions: Vec<Precision> = experiment.tracers.iter().filter_map(of_cpu).collect();
        let on_device = experiment.tracers.contains(&Tracer::Device);
        let prober = on_device.then(|| machine.prober(&experiment.bake.verify)).flatten();
        let prober = prober.transpose().map_err(LabError::Device)?;
        let missing = on_device && prober.is_none();
        if missing && precisions.is_empty() {
            return Err(LabError::Device("`tracers`: there is no Vulkan device that can trace rays".into()));
        }
        if missing {
            notes.push("nothing was traced by `device`: there is no Vulkan device that can trace rays".into());
        }
        Ok(Bench { experiment, machine, prober, precisions })
    }

    /// Measures a scene at each of its places.
    fn placements(
        &self,
        name: &str,
        scene: &Scene,
        output: &mut Output,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(), LabError> {
        for &placement in &self.experiment.placements {
            progress(&format!("{name} ({})", placement.name()));
            let first = output.rows.len();
            self.scene((name, placement), &placement.place(scene), output)?;
            figures::scene(&output.rows[first..], output.folder)?;
        }
        Ok(())
    }

    /// Makes all layouts of a scene, then traces one after the other.
    fn scene(&self, name: (&str, Placement), scene: &Scene, output: &mut Output) -> Result<(), LabError> {
        let failed = |why: String| LabError::Scene(format!("{}: {why}", name.0));
        let made = make_all(scene, self.experiment, self.machine);
        let displacement = made.iter().map(|made| made.positions.ratio).fold(0.0, f64::max);
        let best = made.iter().map(|made| made.two_level_cost).fold(f64::INFINITY, f64::min);
        let trees = TwoLevel::build(scene);
        let verify = &self.experiment.bake.verify;
        let truth = Truth::new(scene, &trees, displacement * scene.bounds().diagonal(), verify);
        let paces = self.paces(scene, &trees).map_err(failed)?;
        let mut traced: Vec<Vec<Traced>> = Vec::new();
        for layout in &made {
            traced.push(match &layout.layout {
                Some(_) => self.trace(scene, layout, &truth, &paces).map_err(failed)?,
                None => traced[layout.same_as].clone(),
            });
            for of in &traced[traced.len() - 1] {
                let row = self.row(name, layout, of, best);
                output.tables.append(&row.columns(), &row).map_err(|e| LabError::file(output.folder, e))?;
                output.rows.push(row);
            }
        }
        Ok(())
    }

    /// Times the input on the CPU and on the device, as far as they trace.
    fn paces<'p>(&'p self, scene: &Scene, trees: &'p TwoLevel) -> Result<Paces<'p>, String> {
        let verify = &self.experiment.bake.verify;
        let pace = |probe: Box<dyn Probe + 'p>| {
            let count = probe.timed(verify) as usize;
            let sampling = verify.sampling(count, None);
            let rays = match count <= MOST_EXACT {
                true => rays::generate(scene, &Reference::new(trees), &sampling),
                false => rays::generate_by(scene, &|rays| probe.closest(rays), &sampling)?,
            };
            Pace::new(probe, rays.kinds, verify.repeats)
        };
        let on_cpu = |_: &Precision| pace(Box::new(ComputingTracer::new(trees, Precision::F32Watertight)));
        Ok(Paces {
            cpu: self.precisions.first().map(on_cpu).transpose()?,
            device: self.prober.as_ref().map(|prober| prober.probe(scene).and_then(pace)).transpose()?,
        })
    }

    /// Traces a layout by all tracers.
    fn trace(&self, scene: &Scene, made: &Made, truth: &Truth, paces: &Paces) -> Result<Vec<Traced>, String> {
        let Some(layout) = &made.layout else { return Ok(Vec::new()) };
        let stored = stored(scene, layout);
        let trees = TwoLevel::build(&stored);
        let on_cpu = |precision: &Precision| ComputingTracer::new(&trees, *precision);
        let of_cpu: Vec<ComputingTracer> = self.precisions.iter().map(on_cpu).collect();
        let cpu: Vec<&dyn Probe> = of_cpu.iter().map(|probe| probe as &dyn Probe).collect();
        let device = self.prober.as_ref().map(|prober| prober.probe(&stored)).transpose()?;
        let device: Vec<&dyn Probe> = device.iter().map(Box::as_ref).collect();
        let named: Vec<Tracer> = self.precisions.iter().map(|precision| Tracer::Cpu(*precision)).collect();
        let mut traced = Vec::new();
        for (pace, probes, tracers) in
            [(&paces.cpu, cpu, named.as_slice()), (&paces.device, device, &[Tracer::Device][..])]
        {
            let Some(pace) = pace else { continue };
            let times = pace.nanoseconds(&probes, &self.experiment.bake.verify.weights)?;
            for ((probe, tracer), nanoseconds) in probes.iter().zip(tracers).zip(times) {
                let errors = truth.errors(*probe, layout)?;
                let counts = [stored.meshes.len() as u64, stored.instances.len() as u64, stored.triangles_placed()];
                traced.push(Traced { tracer: *tracer, errors, nanoseconds, counts });
            }
        }
        Ok(traced)
    }

    fn row(&self, (scene, placement): (&str, Placement), made: &Made, traced: &Traced, best: f64) -> ErrorRow {
        let Traced { tracer, errors, nanoseconds, counts: [groups, instances, triangles] } = *traced;
        let (device, device_kind) = match tracer {
            Tracer::Cpu(_) => (cpu(), MachineKind::Cpu),
            Tracer::Device => (self.machine.name().0.to_owned(), self.machine.name().1),
        };
        ErrorRow {
            scene: scene.to_owned(),
            placement: placement.name(),
            method: made.method,
            layout: made.name.clone(),
            settings: self.experiment.sweep.names().into_iter().zip(made.values.iter().cloned()).collect(),
            tracer: tracer.name(),
            device,
            device_kind,
            triangles,
            groups,
            instances,
            position_error_ratio: made.positions.ratio,
            object_position_error_ratio: made.positions.object_ratio,
            largest_distance_error: errors.distances.largest,
            p999_distance_error: errors.distances.p999,
            rms_distance_error: errors.distances.rms,
            far_hits_per_million: errors.distances.far_per_million,
            lost_per_million: errors.lost_per_million,
            two_level_cost: made.two_level_cost,
            cost_over_best_ratio: if best > 0.0 { made.two_level_cost / best } else { 1.0 },
            layout_seconds: made.seconds,
            nanoseconds_per_ray: nanoseconds,
        }
    }
}

/// Up to so many rays of each kind, what they hit first is found in double precision.
const MOST_EXACT: usize = 1 << 16;

/// The input, as each kind of tracer is timed with.
struct Paces<'p> {
    cpu: Option<Pace<'p>>,
    device: Option<Pace<'p>>,
}

/// What a tracer did with a layout.
#[derive(Clone, Copy)]
struct Traced {
    tracer: Tracer,
    errors: RayErrors,
    nanoseconds: f64,
    /// Groups, instances and triangles placed.
    counts: [u64; 3],
}

/// Returns the name of the CPU's tracers.
fn cpu() -> String {
    match rayon::current_num_threads() {
        1 => "CPU, 1 thread".into(),
        n => format!("CPU, {n} threads"),
    }
}
