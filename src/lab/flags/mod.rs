//! Layouts against build flags: what a device makes of each layout with each preference, with and without updates and
//! compaction, as in M. Kacerik, J. Bittner, "On Importance of Scene Structure for Hardware-Accelerated Ray Tracing", Computer
//! Science Research Notes 3301, 2023. `docs/lab.md` describes the configuration and the columns.

mod config;
mod rows;

use std::fmt::Write;
use std::path::Path;

pub(in crate::lab) use config::{Flags, Keys};
pub use rows::FlagsRow;
pub(in crate::lab) use rows::NAMES;
use rows::{FlagsKind, prefer_name};

use super::LabError;
use super::error_vs_time::Pace;
use super::motion::Common;
use super::reading::{self, ReadScene};
use super::tables::Tables;
use crate::choose::{Evaluator, written};
use crate::cost::mesh_trees::MeshTrees;
use crate::scene::Scene;
use crate::verify::build::BuildOptions;
use crate::verify::probe::{Probe, Prober};
use crate::verify::{Machine, PerKind, rays};

/// Results of the experiment.
#[derive(Debug, Default)]
pub(super) struct Measured {
    /// One for each layout of each scene with each set of flags.
    pub(super) rows: Vec<FlagsRow>,
    /// What was omitted, in words.
    pub(super) notes: Vec<String>,
    /// What the readers of the scenes repaired or omitted.
    pub(super) warnings: Vec<String>,
    /// The table as Markdown.
    pub(super) text: String,
}

/// What all measurements have in common.
struct Bench<'a> {
    flags: &'a Flags,
    common: &'a Common<'a>,
    machine: &'a Machine,
    prober: &'a dyn Prober,
}

/// Measures all scenes. Each row is written as soon as it is measured.
///
/// # Errors
/// Fails if there is no device, if a scene cannot be read or built, unless such scenes are to be skipped, or if the folder
/// cannot be written to. Rows written until then stay.
pub(super) fn run(
    flags: &Flags,
    common: &Common<'_>,
    machine: &Machine,
    progress: &mut dyn FnMut(&str),
) -> Result<Measured, LabError> {
    let none = || LabError::Device("`flags`: there is no Vulkan device that can trace rays".into());
    let prober = machine.prober(common.verify).ok_or_else(none)?.map_err(LabError::Device)?;
    let bench = Bench { flags, common, machine, prober: &*prober };
    let mut tables = Tables::create(common.out, NAMES, &FlagsRow::default().columns())?;
    let mut measured = Measured::default();
    for (name, path) in common.scenes {
        progress(name);
        match bench.file(name, path, &mut tables, &mut measured) {
            Err(LabError::Scene(why)) if common.skip_broken => measured.notes.push(format!("left out: {why}")),
            done => done?,
        }
    }
    measured.text = markdown(&measured.rows, machine);
    Ok(measured)
}

impl Bench<'_> {
    /// Measures all layouts of a scene.
    fn file(&self, name: &str, path: &Path, tables: &mut Tables, measured: &mut Measured) -> Result<(), LabError> {
        let failed = |why: String| LabError::Scene(format!("{}: {why}", path.display()));
        let ReadScene { scene, warnings, .. } = reading::read(path).map_err(LabError::Scene)?;
        measured.warnings.extend(warnings);
        let trees = MeshTrees::build(&scene);
        let evaluator = Evaluator {
            trees: &trees,
            two_level_cost: 0.0,
            rays_per_kind: self.flags.rays,
            all_kinds: false,
            class: Default::default(),
            verify: self.common.verify,
        };
        let laid = evaluator.lay_out(&scene, self.common.plans).layouts;
        let scene_of = written(&scene, laid.iter().map(|(_, laid)| laid).collect());
        let pace = self.pace(&scene).map_err(failed)?;
        for (i, (plan, _)) in laid.iter().enumerate() {
            let layout = scene_of(i);
            for &build in &self.flags.builds {
                let row = self.row((name, &plan.id.to_string()), &layout, build, &pace).map_err(failed)?;
                tables.append(&row.columns(), &row).map_err(|e| LabError::file(self.common.out, e))?;
                measured.rows.push(row);
            }
        }
        Ok(())
    }

    /// Builds the input with the default flags, to be timed in turns with everything else.
    fn pace(&self, scene: &Scene) -> Result<Pace<'_>, String> {
        let probe = self.prober.probe_built(scene, BuildOptions::default())?;
        let sampling = self.common.verify.sampling(self.flags.rays, None);
        let rays = rays::generate_by(scene, &|rays| probe.closest(rays), &sampling)?;
        Pace::new(probe, rays.kinds, self.common.verify.repeats)
    }

    /// Builds a layout with a set of flags and traces it.
    fn row(
        &self,
        (scene, layout): (&str, &str),
        stored: &Scene,
        build: BuildOptions,
        pace: &Pace<'_>,
    ) -> Result<FlagsRow, String> {
        let probe = self.prober.probe_built(stored, build)?;
        let times = pace.kinds(&[&*probe as &dyn Probe])?;
        let built = probe.built().unwrap_or_default();
        Ok(FlagsRow {
            scene: scene.to_owned(),
            layout: layout.to_owned(),
            device: self.machine.name().0.to_owned(),
            device_kind: self.machine.name().1,
            prefer: prefer_name(build.prefer),
            allow_update: build.allow_update,
            compact: build.compact,
            blases: built.blases,
            tlas_instances: built.tlas_instances,
            blas_build_ms: built.blas_build_ms,
            tlas_build_ms: built.tlas_build_ms,
            blas_bytes: built.blas_bytes,
            blas_bytes_compacted: built.blas_bytes_compacted,
            tlas_bytes: built.tlas_bytes,
            kinds: PerKind::of(|kind| FlagsKind::of(times[kind][0])),
        })
    }
}

/// Returns the table as Markdown.
fn markdown(rows: &[FlagsRow], machine: &Machine) -> String {
    let (device, kind) = machine.name();
    let mut text = format!(
        "# Layouts against build flags on {device} ({})\n\n| scene | layout | prefer | update | compact | BLAS ms | TLAS ms | BLAS \
         MB | TLAS MB | primary | shadow | diffuse | random Mrays/s |\n| --- | --- | --- | --- | --- | ---: | ---: | ---: | \
         ---: | ---: | ---: | ---: | ---: |\n",
        kind.name()
    );
    for row in rows {
        let speeds: Vec<String> = row.kinds.values().map(|kind| format!("{:.1}", kind.mrays_per_s)).collect();
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {:.3} | {:.3} | {:.2} | {:.3} | {} |",
            row.scene,
            row.layout,
            row.prefer,
            row.allow_update,
            row.compact,
            row.blas_build_ms,
            row.tlas_build_ms,
            row.blas_bytes_compacted.unwrap_or(row.blas_bytes) as f64 * 1e-6,
            row.tlas_bytes as f64 * 1e-6,
            speeds.join(" | ")
        );
    }
    text
}
