//! The pipeline of a bake: read, analyse, choose, write, verify, keep the file, report.

mod clock;
mod copies;
mod export;
mod turned;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub use clock::Stage;
pub use copies::FindCopies;

use raykiln_formats::document::{self, Compression, Staged};
use raykiln_formats::edit::RecordPlace;
use raykiln_formats::{Document, Warning};

use crate::choose::{self, Choice, ChooseOptions, Chosen};
use crate::commands::measure::{measure_with, per_primitive_note};
use crate::commands::source::Source;
use crate::commands::{CommandError, PlanError, fingerprint, rules};
use crate::cost::Metrics;
use crate::cost::mesh_trees::MeshTrees;
use crate::emit::{self, Copied, Instancing};
use crate::layout::Layout;
use crate::motion::advice::{self, Advice};
use crate::report::exported::Exported;
use crate::report::html::Shown;
use crate::report::plan::{Hashes, PlannedDevice};
use crate::report::{
    self, BakeReport, Finding, Input, MethodReport, OutputCompression, Pass, ReportedOptions, Seconds, Size, Speed,
};
use crate::scene::{self, LoadOptions, Scene};
use crate::verify::verdict::{Verdict, verdict};
use crate::verify::{Exact, Machine, MachineKind, Matching, Sides, Verification, VerifyOptions};
use clock::Clock;
use copies::SharedScene;

/// Options of a bake.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct BakeOptions {
    /// How the layout is chosen.
    pub choose: ChooseOptions,
    /// Whether meshes that are copies of others become instances of them.
    pub copies: FindCopies,
    /// How the input is read.
    pub load: LoadOptions,
    /// Drop empty nodes that nothing refers to.
    pub prune: bool,
    /// Write instances of one mesh as copies of one node if that keeps within the largest position error allowed.
    pub copy_instances: bool,
    /// How the output is compressed. One that has the input's layout is compressed only if that makes it smaller than the
    /// input.
    pub compression: Compression,
    /// Where the record of provenance is written.
    pub record: RecordPlace,
    /// How the output is verified.
    pub verify: VerifyOptions,
    /// Whether a plan is written or followed; one that is followed has its decision in `choose`.
    pub plan: PlanUse,
    /// Whether to gather what a page shows of the scenes ([`Baked::shown`]).
    pub show: bool,
    /// The folder to which to write the input and the candidates that are worth timing, if `auto` chooses among them; also
    /// takes [`PlanUse::Write`] and [`ChooseOptions::export`].
    pub export: Option<PathBuf>,
    /// Options to record in the output beside the version, by name, with their values; they decide nothing.
    pub recorded: BTreeMap<String, Vec<String>>,
}

/// Whether a bake writes a plan or follows one.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum PlanUse {
    /// Neither.
    #[default]
    Neither,
    /// Input and output are hashed for a plan.
    Write,
    /// Input and output must have these hashes.
    Follow(Hashes),
}

impl BakeOptions {
    /// Options for making documents.
    fn emit(&self) -> emit::Options {
        let max_position_error_ratio = self.verify.max_position_error_ratio;
        let instancing = match self.copy_instances {
            true => Instancing::Extension { max_position_error_ratio },
            false => Instancing::Nodes,
        };
        emit::Options { prune: self.prune, instancing, record: self.record }
    }

    /// The options echoed in the report.
    fn reported(&self) -> ReportedOptions {
        let (choose, layout, verify) = (&self.choose, &self.choose.layout, &self.verify);
        let if_set = |asked: bool, forbidden: bool| match (asked, forbidden, choose.method) {
            (false, false, Choice::Auto) => None,
            _ => Some(asked && !forbidden),
        };
        ReportedOptions {
            effort: choose.effort.level(),
            device_class: choose.class.name(),
            weights: verify.weights.0,
            views: verify.views,
            seed: verify.seed,
            rays: verify.rays_per_kind,
            repeats: verify.repeats,
            least_view_ratio: verify.least_view_ratio,
            max_position_error_ratio: verify.max_position_error_ratio,
            max_bytes_ratio: choose.max_bytes_ratio(),
            max_group_triangles: layout.cluster.max_group_triangles,
            max_group_extent_ratio: layout.cluster.max_group_extent_ratio,
            isolate: if_set(layout.parts.isolate, choose.forbidden.isolate),
            split_opacity: if_set(layout.parts.split_opacity, choose.forbidden.split_opacity),
            frames: layout.instances.frames,
            keep: self.load.keep.clone(),
        }
    }
}

/// The result of a bake.
#[derive(Debug)]
pub struct Baked {
    /// What was done, and its result.
    pub report: BakeReport,
    /// The output, not yet in place; `None` if the verification failed.
    pub output: Option<Staged>,
    /// The hashes for a plan, if one is written or followed.
    pub hashes: Option<Hashes>,
    /// The device that rays were traced on.
    pub device: PlannedDevice,
    /// What a page shows of the scenes, if asked for.
    pub shown: Option<Shown>,
    /// The candidates that were exported, if asked for.
    pub exported: Option<Exported>,
}

/// Bakes `input`; the result replaces `output` once it is committed. If the verification fails, the report says so and
/// there is no output.
///
/// # Errors
/// Fails if the input cannot be read, the output cannot be written, or the selected device cannot trace rays.
pub fn bake(
    input: Source,
    output: &Path,
    options: &BakeOptions,
    progress: &mut dyn FnMut(Stage),
) -> Result<Baked, CommandError> {
    document::check_output(output)?;
    let mut clock = Clock::start(progress);
    clock.enter(Stage::Verify);
    let machine = Machine::open(&options.verify.device)?;
    clock.enter(Stage::Read);
    let source = options.show.then(|| input.clone());
    let (doc, input_hash) = read(input, options)?;
    let (scene, scene_warnings) = scene::load(&doc, &options.load)?;
    scene.check().map_err(|e| CommandError::Internal(e.0))?;

    clock.enter(Stage::Analyse);
    let blas_per = options.verify.build.blas_per;
    let trees = MeshTrees::build(&scene);
    let before = measure_with(&scene, &trees, blas_per);
    let mut findings = rules::findings(&doc, &scene, &trees, before.as_bytes());
    let motion = advice::advise(&doc, &scene)?;
    clock.enter(Stage::Optimise);
    let optimising = Instant::now();
    let SharedScene { scene: staged, metrics: shared, sharing } = copies::share(&doc, &scene, &trees, &before, options);
    let metrics = [&before, &shared];
    let chosen = choose::choose_or_replay(&staged, &trees, metrics, &machine, &options.choose, &options.verify);
    let chosen = chosen.ok_or_else(|| no_candidate(options))?;
    let seconds = optimising.elapsed().as_secs_f64();
    let copies_are_placed = copies::are_placed(&staged, &chosen.layout);
    let (path, bytes, warnings) = (doc.path.clone(), doc.file_bytes(), [scene_warnings, doc.warnings.clone()].concat());
    let exported = options.export.as_deref().map(|folder| {
        clock.enter(Stage::Write);
        let to = export::To { folder, output };
        export::write_all(&doc, (&scene, before.as_bytes()), &staged, &chosen, to, options)
    });
    let exported = exported.transpose()?;
    let given = Given { doc, scene: &scene, staged, trees: &trees, metrics: &before };
    let (chosen, tried) = Tried::or_left_alone(given, chosen, output, &machine, options, &mut clock)?;
    let findings_after = tried.findings.clone().unwrap_or_else(|| findings.clone());
    report::compare_with_output(&mut findings, &findings_after);
    let copies = sharing.map(|(sharing, seconds)| {
        Pass::find_copies(&copies::as_written(sharing, tried.written.unchanged, copies_are_placed), seconds)
    });
    let hashes = input_hash.map(|input| planned(input, &tried.written.staged, &options.plan)).transpose()?;
    let input = Input::of(path, bytes, &scene);
    let shown = source.map(|source| {
        clock.enter(Stage::Show);
        tried.shown(source.read(&options.load)?, (&scene, &trees), output)
    });
    let shown = shown.transpose()?;
    let of_input = OfInput { before, findings, motion };
    let done = Done { input, output, scene: &scene, warnings, of_input, copies, chosen, seconds, tried, options };
    let (name, kind) = machine.name();
    let (mut report, staged) = done.report(kind);
    report.seconds = clock.stop();
    report.peak_memory_bytes = clock::peak_memory_bytes();
    let output = (report.verdict != Verdict::Failed).then_some(staged);
    let device = PlannedDevice::new(name, kind, machine.driver());
    Ok(Baked { report, output, hashes, device, shown, exported })
}

/// What is known of the input.
struct OfInput {
    before: Metrics,
    findings: Vec<Finding>,
    motion: Vec<Advice>,
}

/// What a bake did, of which its report is made.
struct Done<'a> {
    input: Input,
    output: &'a Path,
    scene: &'a Scene,
    warnings: Vec<Warning>,
    of_input: OfInput,
    copies: Option<Pass>,
    chosen: Chosen,
    /// Time to choose, in seconds.
    seconds: f64,
    tried: Tried,
    options: &'a BakeOptions,
}

impl Done<'_> {
    /// Returns the report, but for the times of the stages and the memory, and the output.
    fn report(self, device: MachineKind) -> (BakeReport, Staged) {
        let Done { input, output, scene, warnings, of_input, copies, chosen, seconds, tried, options } = self;
        let OfInput { before, findings, motion } = of_input;
        let Tried { written, after: scene_after, metrics: after, verification, verdict, .. } = tried;
        let blas_per = options.verify.build.blas_per;
        let overall = Speed::of(&verification, &options.verify.weights, device);
        let method = MethodReport::from(chosen.selection).with_written(&after, &verification, seconds);
        let profiles = per_primitive_note(
            blas_per,
            Sides { before: scene, after: &scene_after },
            Sides { before: &before, after: &after },
        );
        let of_choice = [words_of(&chosen.layout.notes), words_of(&chosen.notes)].concat();
        let notes = [of_choice, written.notes(), words_of(&verification.notes), profiles].concat();
        let reason = report::verdict::words(verdict, &overall, &verification, &method, options.choose.class);
        let size = Size::of(&before, &after);
        let report = BakeReport {
            schema: BakeReport::SCHEMA,
            raykiln_version: env!("CARGO_PKG_VERSION"),
            input,
            output: output.to_owned(),
            verdict_reason: [reason].into_iter().chain(size.words(written.unchanged)).collect::<Vec<_>>().join("; "),
            options: options.reported(),
            blas_per,
            before,
            overall,
            verdict,
            method,
            after,
            size,
            findings,
            motion,
            passes: copies
                .into_iter()
                .chain(chosen.passes.into_iter().map(Pass::from))
                .chain(written.passes())
                .collect(),
            notes,
            overlap_rounds: chosen.layout.rounds,
            verify: verification,
            seconds: Seconds::default(),
            peak_memory_bytes: None,
            output_bytes: written.staged.bytes(),
            output_compression: written.compression,
            copied: written.copied,
            warnings: words_of(&[warnings, written.staged.warnings.clone()].concat()),
        };
        (report, written.staged)
    }
}

/// Reads the input, and hashes it if a plan is written or followed.
fn read(input: Source, options: &BakeOptions) -> Result<(Document, Option<String>), CommandError> {
    if options.plan == PlanUse::Neither {
        return Ok((input.read(&options.load)?, None));
    }
    let doc = input.clone().read(&options.load)?;
    let found = fingerprint::of_source(&input, &doc)?.to_string();
    match &options.plan {
        PlanUse::Follow(Hashes { input, .. }) if *input != found => {
            Err(PlanError::Input { planned: input.clone(), found }.into())
        }
        _ => Ok((doc, Some(found))),
    }
}

/// Returns the hashes of input and output, which must be those of a plan that is followed.
fn planned(input: String, staged: &Staged, plan: &PlanUse) -> Result<Hashes, CommandError> {
    let found = fingerprint::of_output(staged)?.to_string();
    match plan {
        PlanUse::Follow(Hashes { output, .. }) if *output != found => {
            Err(PlanError::Output { planned: output.clone(), found }.into())
        }
        _ => Ok(Hashes { input, output: found }),
    }
}

fn no_candidate(options: &BakeOptions) -> PlanError {
    PlanError::NoCandidate(options.choose.decided.as_ref().map_or_else(String::new, |decided| decided.plan.clone()))
}

fn words_of(all: &[impl ToString]) -> Vec<String> {
    all.iter().map(ToString::to_string).collect()
}

/// The input.
struct Given<'a> {
    doc: Document,
    scene: &'a Scene,
    /// The scene that was laid out, in which models may replace copies.
    staged: Cow<'a, Scene>,
    /// The trees of `scene`'s meshes.
    trees: &'a MeshTrees,
    /// The metrics of `scene`.
    metrics: &'a Metrics,
}

/// A layout that was written, staged and verified.
struct Tried {
    written: Written,
    /// The scene that was read back.
    after: Scene,
    /// The trees of its meshes.
    trees: MeshTrees,
    /// The metrics of `after`.
    metrics: Metrics,
    /// What rules `after` breaks; `None` if the output is the input.
    findings: Option<Vec<Finding>>,
    verification: Verification,
    verdict: Verdict,
}

impl Tried {
    /// Gathers what a page shows. The documents, which have the textures, are read again, as tracing needed their memory.
    fn shown(
        &self,
        doc: Document,
        (scene, trees): (&Scene, &MeshTrees),
        output: &Path,
    ) -> Result<Shown, raykiln_formats::Error> {
        if self.written.unchanged {
            return Ok(Shown::of(scene).with_pictures((&doc, scene, trees), None));
        }
        let mut doc_after = raykiln_formats::read(self.written.staged.path())?;
        if doc.path.parent() == output.parent() {
            // Its images stay where they are, beside the place of the output.
            doc_after.path = output.to_owned();
        }
        let shown = Shown::of_both(scene, &self.after);
        Ok(shown.with_pictures((&doc, scene, trees), Some((&doc_after, &self.after, &self.trees))))
    }

    /// Tries a layout; falls back to the unchanged input if the layout was chosen for its speed but turns out not to be
    /// faster, unless it is only smaller.
    fn or_left_alone(
        given: Given,
        chosen: Chosen,
        output: &Path,
        machine: &Machine,
        options: &BakeOptions,
        clock: &mut Clock,
    ) -> Result<(Chosen, Tried), CommandError> {
        let Given { doc, scene, staged, trees, metrics } = given;
        clock.enter(Stage::Write);
        let written = write(&doc, &staged.overlaid(&chosen.overlay), &chosen.layout, output, options)?;
        drop(staged);
        clock.enter(Stage::Verify);
        let input = (scene, trees, metrics);
        let read_back = ReadBack::new(&doc, input, &written, &chosen, output, options)?;
        // Tracing needs the memory of what will not be written again.
        let doc = can_be_left_alone(&chosen).then_some(doc);
        let tried = Tried::new(input, written, read_back, machine, options)?;
        let gains = tried.verdict != Verdict::NotFaster || tried.is_smaller_and_not_slower(metrics, &options.verify);
        let Some(doc) = doc.filter(|_| !gains) else { return Ok((chosen, tried)) };
        drop(tried);
        let chosen = chosen.left_alone(scene);
        clock.enter(Stage::Write);
        let written = write(&doc, &scene.overlaid(&chosen.overlay), &chosen.layout, output, options)?;
        clock.enter(Stage::Verify);
        let read_back = ReadBack::new(&doc, input, &written, &chosen, output, options)?;
        drop(doc);
        let tried = Tried::new(input, written, read_back, machine, options)?;
        Ok((chosen, tried))
    }

    /// Verifies what was written against the input as it was read, before models replaced copies.
    fn new(
        (scene, trees_before, _): Measured,
        written: Written,
        read_back: ReadBack,
        machine: &Machine,
        options: &BakeOptions,
    ) -> Result<Tried, CommandError> {
        let ReadBack { after, exact, trees, metrics, findings } = read_back;
        let scenes = Sides { before: scene, after: &after };
        let trees_of_both = Sides { before: trees_before, after: &trees };
        let mut verify = if written.same_layout { options.verify.untimed() } else { options.verify.clone() };
        if after.provenance.record().is_none() && verify.matching == Matching::Identity {
            // There is nothing recorded that could be right.
            verify.matching = Matching::Place;
        }
        let verification = machine.verify_with(scenes, trees_of_both, exact.as_ref(), &verify)?;
        let verdict = verdict(&verification, &options.verify, written.same_layout);
        Ok(Tried { written, after, trees, metrics, findings, verification, verdict })
    }

    /// Whether the acceleration structures are predicted to be smaller than the input's, and rays are not slower beyond
    /// the uncertainty on average, or in a view beyond what is allowed.
    fn is_smaller_and_not_slower(&self, before: &Metrics, options: &VerifyOptions) -> bool {
        let overall = self.verification.overall(&options.weights);
        let is_slower = overall.speedup_ratio + overall.spread_ratio < 1.0;
        let is_slow_in_a_view = overall.least_view_ratio < options.least_view_ratio;
        self.metrics.as_bytes() < before.as_bytes() && !is_slower && !is_slow_in_a_view
    }
}

/// Whether the input may be written instead of this layout after it was verified.
fn can_be_left_alone(chosen: &Chosen) -> bool {
    chosen.may_be_left_alone && !emit::is_unchanged(&chosen.layout)
}

struct Written {
    staged: Staged,
    /// Whether the output is the input.
    unchanged: bool,
    /// Whether it is the input but for its compression.
    same_layout: bool,
    compression: OutputCompression,
    /// Instances that became copies of one node; `None` if that was not requested.
    copied: Option<Copied>,
    /// Number of nodes dropped; `None` if that was not requested.
    pruned: Option<usize>,
    notes: Vec<emit::Note>,
    /// Time to make the document, in seconds.
    seconds: f64,
}

impl Written {
    fn passes(&self) -> Vec<Pass> {
        let copied = self.copied.map(|copied| Pass::instancing_extension(&copied, self.seconds));
        copied.into_iter().chain(self.pruned.map(|nodes| Pass::prune(nodes, self.seconds))).collect()
    }

    fn notes(&self) -> Vec<String> {
        self.copied.iter().map(ToString::to_string).chain(words_of(&self.notes)).collect()
    }
}

/// Writes the output, staged; a byte-for-byte copy of the input if nothing changes.
fn write(
    doc: &Document,
    scene: &Scene,
    layout: &Layout,
    output: &Path,
    options: &BakeOptions,
) -> Result<Written, raykiln_formats::Error> {
    let start = Instant::now();
    let (options, compression, recorded) = (options.emit(), options.compression, &options.recorded);
    let regrouped = !emit::is_input(scene, layout);
    let as_copies = options.instancing != Instancing::Nodes;
    let emitted = (regrouped || options.prune || as_copies).then(|| emit::emit(doc, scene, layout, &options));
    let (pruned, copied) = emitted.as_ref().map_or((0, Copied::default()), |e| (e.pruned_nodes, e.copied));
    let seconds = start.elapsed().as_secs_f64();
    let (copied_if_asked, pruned_if_asked) = (as_copies.then_some(copied), options.prune.then_some(pruned));
    let changed = emitted.filter(|_| regrouped || pruned > 0 || copied.nodes > 0);
    let same_layout = changed.is_none();
    let (staged, compression, notes) = match changed {
        Some(mut e) => {
            e.document.record_bake(env!("CARGO_PKG_VERSION"), recorded);
            (e.document.stage_with(output, compression)?, reported(compression), e.notes)
        }
        None => {
            let (staged, compression) = stage_input(doc, output, compression)?;
            (staged, compression, Vec::new())
        }
    };
    let unchanged = same_layout && compression != OutputCompression::Meshopt;
    let (copied, pruned) = (copied_if_asked, pruned_if_asked);
    Ok(Written { staged, unchanged, same_layout, compression, copied, pruned, notes, seconds })
}

/// Stages the input: its bytes, or compressed if that is smaller.
fn stage_input(
    doc: &Document,
    output: &Path,
    compression: Compression,
) -> Result<(Staged, OutputCompression), raykiln_formats::Error> {
    if compression != Compression::None {
        let staged = doc.stage_with(output, compression)?;
        if doc.file_bytes().is_none_or(|bytes| staged.bytes() < bytes) {
            return Ok((staged, reported(compression)));
        }
    }
    let staged = doc.stage_unchanged(output)?;
    let compression = if staged.is_input { OutputCompression::Input } else { OutputCompression::None };
    Ok((staged, compression))
}

fn reported(compression: Compression) -> OutputCompression {
    match compression {
        Compression::Meshopt => OutputCompression::Meshopt,
        _ => OutputCompression::None,
    }
}

/// What was read back, and how it compares with the input before any ray is traced.
struct ReadBack {
    after: Scene,
    exact: Option<Exact>,
    /// The trees of `after`'s meshes.
    trees: MeshTrees,
    metrics: Metrics,
    /// What rules it breaks; `None` if it is the input.
    findings: Option<Vec<Finding>>,
}

/// The input with the trees of its meshes and its metrics.
type Measured<'a> = (&'a Scene, &'a MeshTrees, &'a Metrics);

impl ReadBack {
    /// Reads the staged file back, and compares it with the input.
    fn new(
        doc: &Document,
        (scene, trees, before): Measured,
        written: &Written,
        chosen: &Chosen,
        output: &Path,
        options: &BakeOptions,
    ) -> Result<ReadBack, raykiln_formats::Error> {
        let staged = written.staged.path();
        let doc_after = raykiln_formats::read(staged)?;
        let (mut after, _) = scene::load(&doc_after, &LoadOptions::default())?;
        let folders = staged.parent().zip(output.parent());
        if let Some((hidden, folder)) = folders {
            after.also_look_for_images(hidden, folder);
        }
        let scenes = Sides { before: scene, after: &after };
        let documents = Sides { before: doc, after: &doc_after };
        let exact = match written.unchanged {
            // Equal bytes mean the same.
            true => Exact::of_scenes(scenes, &options.verify),
            false => Exact::of_files(documents, scenes, folders, &options.verify)?,
        };
        let trees = trees.build_for(scene, &after, &chosen.trees);
        let (metrics, findings) = match written.unchanged {
            true => (before.clone(), None),
            false => {
                let metrics = measure_with(&after, &trees, options.verify.build.blas_per);
                let findings = rules::findings(&doc_after, &after, &trees, metrics.as_bytes());
                (metrics, Some(findings))
            }
        };
        Ok(ReadBack { after, exact, trees, metrics, findings })
    }
}
