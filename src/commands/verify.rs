//! Compares two files of one scene: an output with its input, whichever program wrote it.

use std::path::Path;
use std::time::Instant;

use raykiln_formats::Document;

use crate::commands::measure::{measure_with, per_primitive_note};
use crate::commands::{CommandError, fingerprint, rules};
use crate::cost::mesh_trees::MeshTrees;
use crate::report::html::Shown;
use crate::report::notes::EQUAL_FILES;
use crate::report::{self, Input, Speed, VerifyReport};
use crate::scene::{self, LoadOptions, Scene};
use crate::verify::verdict;
use crate::verify::{Exact, Machine, Matching, Sides, VerifyOptions};

/// How to match the triangles of two files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MatchBy {
    /// By place.
    #[default]
    Auto,
    /// Always this way, whatever the files record.
    Always(Matching),
}

/// Verifies the file `after` against the file `before`; `by` replaces `options.matching`.
///
/// # Errors
/// Fails if a file cannot be read, or the selected device cannot trace rays.
pub fn compare(
    before: &Path,
    after: &Path,
    by: MatchBy,
    options: &VerifyOptions,
) -> Result<VerifyReport, CommandError> {
    compare_and_show(before, after, by, options, &LoadOptions::default(), false).map(|(report, _)| report)
}

/// Like [`compare`]; also gathers what a page shows of the scenes, if asked for.
///
/// # Errors
/// Like [`compare`].
pub fn compare_and_show(
    before: &Path,
    after: &Path,
    by: MatchBy,
    options: &VerifyOptions,
    reading: &LoadOptions,
    show: bool,
) -> Result<(VerifyReport, Option<Shown>), CommandError> {
    let start = Instant::now();
    let machine = Machine::open(&options.device)?;
    let Loaded { doc: doc_before, scene: scene_before, warnings: warnings_before, hash } = load(before, reading)?;
    let Loaded { doc: doc_after, scene: scene_after, warnings: warnings_after, hash: hash_after } =
        load(after, reading)?;
    let matching = by.choose();
    let is_same = hash == hash_after;
    let options = if is_same { options.untimed() } else { options.clone() };
    let options = VerifyOptions { matching, ..options };
    let scenes = Sides { before: &scene_before, after: &scene_after };
    let [bytes_before, bytes_after] = [&doc_before, &doc_after].map(Document::file_bytes);
    let exact = Exact::of_files(Sides { before: &doc_before, after: &doc_after }, scenes, None, &options)?;
    let trees_before = MeshTrees::build(&scene_before);
    let trees_after = trees_before.build_for(&scene_before, &scene_after, &[]);
    let trees = Sides { before: &trees_before, after: &trees_after };
    let blas_per = options.build.blas_per;
    let metrics_before = measure_with(&scene_before, &trees_before, blas_per);
    let metrics_after = measure_with(&scene_after, &trees_after, blas_per);
    let mut findings = rules::findings(&doc_before, &scene_before, &trees_before, metrics_before.as_bytes());
    let findings_after = rules::findings(&doc_after, &scene_after, &trees_after, metrics_after.as_bytes());
    report::compare_with_output(&mut findings, &findings_after);
    // Tracing needs the memory.
    drop((doc_before, doc_after));
    let verification = machine.verify_with(scenes, trees, exact.as_ref(), &options)?;
    let profiles = per_primitive_note(blas_per, scenes, Sides { before: &metrics_before, after: &metrics_after });
    let untimed = is_same.then(|| EQUAL_FILES.to_owned());
    let notes = verification.notes.iter().map(ToString::to_string).chain(profiles).chain(untimed).collect();
    let report = VerifyReport {
        schema: VerifyReport::SCHEMA,
        raykiln_version: env!("CARGO_PKG_VERSION"),
        input: Input::of(before.to_owned(), bytes_before, &scene_before),
        output: after.to_owned(),
        output_bytes: bytes_after,
        blas_per,
        before: metrics_before,
        after: metrics_after,
        matched_by: matching,
        verdict: verdict::verdict(&verification, &options, false),
        overall: Speed::of(&verification, &options.weights, machine.name().1),
        notes,
        findings,
        verify: verification,
        seconds: start.elapsed().as_secs_f64(),
        warnings: [warnings_before, warnings_after].concat(),
    };
    let shown = show.then(|| -> Result<Shown, CommandError> {
        // They were dropped, as tracing needs the memory.
        let read = |path| raykiln_formats::read_with(path, &reading.reading());
        let (doc_before, doc_after) = (read(before)?, read(after)?);
        let shown = Shown::of_both(&scene_before, &scene_after);
        let after = (&doc_after, &scene_after, &trees_after);
        Ok(shown.with_pictures((&doc_before, &scene_before, &trees_before), Some(after)))
    });
    Ok((report, shown.transpose()?))
}

/// A file that was read.
struct Loaded {
    doc: Document,
    scene: Scene,
    /// What the reader repaired or omitted.
    warnings: Vec<String>,
    hash: blake3::Hash,
}

/// Reads a file as a document and a scene, with warnings about what the reader repaired or omitted.
#[cfg(feature = "lab")]
pub(crate) fn read_document(path: &Path) -> Result<(Document, Scene, Vec<String>), CommandError> {
    load(path, &LoadOptions::default()).map(|loaded| (loaded.doc, loaded.scene, loaded.warnings))
}

fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, CommandError> {
    let doc = raykiln_formats::read_with(path, &options.reading())?;
    let (scene, warnings) = scene::load(&doc, options)?;
    scene.check().map_err(|e| CommandError::Internal(e.0))?;
    let words = doc.warnings.iter().chain(&warnings).map(|w| format!("{}: {w}", path.display())).collect();
    Ok(Loaded { hash: fingerprint::of_document(&doc), doc, scene, warnings: words })
}

impl MatchBy {
    fn choose(self) -> Matching {
        match self {
            MatchBy::Always(matching) => matching,
            MatchBy::Auto => Matching::Place,
        }
    }
}
