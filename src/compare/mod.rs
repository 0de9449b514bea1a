//! Two files of one scene, compared: an output against its input, whoever wrote it.

use std::path::Path;
use std::time::Instant;

use crate::bake::{self, BakeError, measure_as_is};
use crate::report::{self, Input, VerifyReport};
use crate::scene::{self, LoadOptions, Scene};
use crate::verify::{Machine, Matching, VerifyOptions};

/// Verifies the file `after` against the file `before`. Triangles are matched by what `after` says about where they
/// come from; if it says nothing, only surfaces are compared.
///
/// # Errors
/// A file that cannot be read; a device named that cannot trace.
pub fn compare(before: &Path, after: &Path, options: &VerifyOptions) -> Result<VerifyReport, BakeError> {
    let start = Instant::now();
    let machine = Machine::open(&options.device)?;
    let (scene_before, warnings_before) = read(before)?;
    let (scene_after, warnings_after) = read(after)?;
    let matching = if names_its_sources(&scene_after) { Matching::Identity } else { Matching::Surface };
    let options = VerifyOptions { matching, ..options.clone() };
    let verification = machine.verify(&scene_before, &scene_after, &options)?;
    Ok(VerifyReport {
        schema: report::SCHEMA,
        raykiln_version: env!("CARGO_PKG_VERSION"),
        input: Input::of(before.to_owned(), &scene_before),
        output: after.to_owned(),
        before: measure_as_is(&scene_before),
        after: measure_as_is(&scene_after),
        matched_by: match matching {
            Matching::Identity => "identity",
            Matching::Surface => "surface",
        },
        verdict: bake::verdict(&verification, false),
        notes: verification.notes.clone(),
        verify: verification,
        seconds: start.elapsed().as_secs_f64(),
        warnings: [warnings_before, warnings_after].concat(),
    })
}

/// A file as a scene, and what the reader mended or left out.
fn read(path: &Path) -> Result<(Scene, Vec<String>), BakeError> {
    let doc = raykiln_formats::read(path)?;
    let (scene, warnings) = scene::load(&doc, &LoadOptions::default())?;
    scene.check().map_err(|e| BakeError::Internal(e.0))?;
    let words = doc.warnings.iter().chain(&warnings).map(|w| format!("{}: {w}", path.display())).collect();
    Ok((scene, words))
}

fn names_its_sources(scene: &Scene) -> bool {
    scene.meshes.iter().flat_map(|m| &m.geometries).any(|g| g.provenance.is_some())
}
