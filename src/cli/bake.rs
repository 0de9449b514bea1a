//! The command `bake`: from a file, a stream or the cache, to files or a stream.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::env;
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail, ensure};
use clap::ArgMatches;
use raykiln_formats::document::{Placed, Staged};
use raykiln_formats::staging::{Folder, Hold};

use super::args::{BakeArguments, Output, RecordArgument};
use super::cached::JSON;
use super::progress::Progress;
use super::reports::{Format, Reports, StagedReports};
use super::{FAILED, applies, cached, interrupt, memory, plan, print, print_error, print_for_people};
use crate::commands::bake::{self, BakeOptions, Baked};
use crate::commands::source::Source;
use crate::report;
use crate::report::exported::{CandidatesFile, Exported};
use crate::report::plan::PlanFile;
use crate::verify::verdict::Verdict;

/// The name of standard input and standard output.
const STREAM: &str = "-";

/// Bakes a scene, or takes the result from the cache.
pub(super) fn run(arguments: &BakeArguments, matches: &ArgMatches, output: &Output) -> Result<ExitCode> {
    if arguments.end_with_stdin {
        interrupt::end_with_stdin();
    }
    let bake_matches = matches.subcommand_matches("bake").context("it is a bake")?;
    arguments.max_memory.map_or(Ok(()), memory::limit)?;
    let mut options = options(arguments, bake_matches, matches)?;
    let files = Files::check(arguments)?;
    options.show = files.reports.have(Format::Page);
    let export = arguments.export_candidates.as_deref().map(Export::begin).transpose()?;
    options.export = export.as_ref().map(|export| export.folder());
    let planned = plan::options(bake_matches);
    let wanted = files.wanted();
    let cache = cached::Cached::open(arguments, &planned, &options, &wanted)?;
    let done = match cache.as_ref().map(cached::Cached::look_up).transpose()?.flatten() {
        Some(found) => Done::of_hit(found, arguments),
        None => {
            let done = Done::of_bake(arguments, &options, &planned, output)?;
            cache.iter().for_each(|cache| done.keep(cache));
            Done { export, ..done }
        }
    };
    files.finish(done, arguments, cache.as_ref(), output.quiet)
}

/// Returns the options of a bake: those of the command line, or of the plan that is followed.
fn options(arguments: &BakeArguments, bake_matches: &ArgMatches, matches: &ArgMatches) -> Result<BakeOptions> {
    if let Some(file) = &arguments.plan {
        return plan::follow(file, arguments, bake_matches);
    }
    let mut options = arguments.options()?;
    applies::check(&applies::given(matches), &options.choose)?;
    options.recorded = plan::recorded(&plan::options(bake_matches))?;
    Ok(options)
}

fn is_stream(path: &Path) -> bool {
    path.as_os_str() == STREAM
}

/// The files that a bake writes besides the scene.
struct Files<'a> {
    reports: Reports<'a>,
    plans: Reports<'a>,
    depfile: Reports<'a>,
}

impl<'a> Files<'a> {
    /// Rejects files that cannot be written, and streams that cannot be used, before any work is done.
    fn check(arguments: &'a BakeArguments) -> Result<Self> {
        let scenes = [arguments.input.as_path(), &arguments.output];
        let streams = scenes.iter().any(|path| is_stream(path));
        ensure!(!(is_stream(&arguments.output) && arguments.json), "--json and -o - both write to standard output");
        let is_input = |real: PathBuf| fs::canonicalize(&arguments.output).is_ok_and(|output| output == real);
        let replaces = !streams && fs::canonicalize(&arguments.input).is_ok_and(is_input);
        ensure!(arguments.in_place || !replaces, "the output would replace the input: --in-place allows that");
        let beside = arguments.options.record == RecordArgument::Sidecar;
        ensure!(!(is_stream(&arguments.output) && beside), "--record sidecar needs an output file to lie beside");
        let of_files = [
            ("--cache", &arguments.cache.cache),
            ("--depfile", &arguments.depfile),
            ("--export-candidates", &arguments.export_candidates),
        ];
        for (option, file) in of_files {
            ensure!(!streams || file.is_none(), "{option} applies to files, not to standard input and output");
        }
        Ok(Files {
            reports: Reports::check(&arguments.report, &scenes)?,
            plans: Reports::check_plan(&arguments.write_plan, &scenes)?,
            depfile: Reports::check_depfile(&arguments.depfile, &scenes)?,
        })
    }

    /// The reports that are wanted besides JSON.
    fn wanted(&self) -> Vec<&'static str> {
        let formats = [Format::Page, Format::Sarif].into_iter().filter(|format| self.reports.have(*format));
        let plan = self.plans.have(Format::Json).then_some(PLAN);
        formats.map(Format::extension).chain(plan).collect()
    }

    /// Writes all files, prints what is to be printed, and puts everything in place.
    fn finish(
        &self,
        done: Done,
        arguments: &BakeArguments,
        cache: Option<&cached::Cached<'_>>,
        quiet: bool,
    ) -> Result<ExitCode> {
        let text = |name: &str| done.reports.get(name).map_or("", String::as_str);
        if arguments.deny_warnings {
            deny_warnings(&arguments.input, text(JSON))?;
        }
        let reports = self.reports.stage(|format| Cow::from(text(format.extension())))?;
        let plan = done.scene.as_ref().map(|_| self.plans.stage(|_| text(PLAN).into())).transpose()?;
        let depfile = match &done.scene {
            Some(_) => Some(self.depfile.stage_text(&depfile(arguments, cache)?)?),
            None => None,
        };
        // Printed before anything is in place: if it fails, there must be no output.
        if arguments.json {
            print(text(JSON).as_bytes())?;
        }
        emit_report(arguments, text(JSON))?;
        let has_scene = done.scene.is_some();
        match done.scene {
            Some(scene) if is_stream(&arguments.output) => print_scene(&scene)?,
            scene => put_in_place(scene, [Some(reports), plan, depfile].into_iter().flatten())?,
        }
        done.export.filter(|_| has_scene).map(Export::put_in_place).transpose()?;
        if !quiet {
            print_for_people(&done.words);
        }
        Ok(match done.failure {
            Some(failure) => {
                print_error(format_args!("{failure}"));
                ExitCode::from(FAILED)
            }
            None => ExitCode::SUCCESS,
        })
    }
}

/// Prints the warnings of a report.
///
/// # Errors
/// Fails if there are any.
fn deny_warnings(input: &Path, json: &str) -> Result<()> {
    let report: serde_json::Value = serde_json::from_str(json)?;
    let warnings = report["warnings"].as_array().map_or(&[][..], Vec::as_slice);
    for warning in warnings.iter().filter_map(serde_json::Value::as_str) {
        print_for_people(&format!("warning: {warning}\n"));
    }
    let count = report::words::counted(warnings.len(), "warning");
    ensure!(warnings.is_empty(), "{}: {count} (--deny-warnings)", input.display());
    Ok(())
}

/// The name of the plan among the reports.
const PLAN: &str = "plan";

/// A bake that is done, or was done before.
struct Done {
    /// The output, not yet in place; `None` if the verification failed.
    scene: Option<Staged>,
    /// Reports by their extension, and the plan.
    reports: BTreeMap<String, String>,
    /// What is said to people.
    words: String,
    /// Why the verification failed.
    failure: Option<String>,
    /// Candidates that were exported.
    export: Option<Export>,
    /// The folder of an output that becomes a stream; it must live as long as the output.
    _temporary: Option<Folder>,
}

impl Done {
    fn of_hit(found: cached::Found, arguments: &BakeArguments) -> Done {
        let words = report::cached::hit(&found.json, &arguments.input, &arguments.output);
        let reports = found.reports.into_iter().chain([(JSON.to_owned(), found.json)]).collect();
        Done { scene: Some(found.staged), reports, words, failure: None, export: None, _temporary: None }
    }

    fn of_bake(
        arguments: &BakeArguments,
        options: &BakeOptions,
        planned: &BTreeMap<String, Vec<String>>,
        output: &Output,
    ) -> Result<Done> {
        let (to, temporary) = place(&arguments.output)?;
        let source = source(&arguments.input)?;
        let mut progress = Progress::new(output.quiet);
        let baked = bake::bake(source, &to, options, &mut |stage| progress.enter(stage.label()));
        progress.finish();
        let Baked { mut report, output: scene, hashes, device, shown, exported } = baked?;
        report.output.clone_from(&arguments.output);
        let mut reports = BTreeMap::from([(JSON.to_owned(), report::json::to_json(&report))]);
        if let Some(hashes) = hashes.filter(|_| scene.is_some()) {
            let plan = PlanFile::of(&report, &hashes, device, planned.clone());
            if let Some((exported, folder)) = exported.zip(options.export.as_deref()) {
                list(&exported, &plan, folder)?;
            }
            reports.insert(PLAN.to_owned(), report::json::to_json(&plan));
        }
        reports.insert(Format::Sarif.extension().to_owned(), report::to_sarif(&report.input.path, &report.findings));
        if options.show {
            reports.insert(Format::Page.extension().to_owned(), report::html::bake(&report, shown.as_ref()));
        }
        let has_failed = matches!(report.verdict, Verdict::Failed | Verdict::CannotTell);
        let failure = || format!("{}: verification failed: {}", report.output.display(), report.verify);
        Ok(Done {
            scene,
            words: report::text::bake(&report, output.verbose > 0),
            failure: has_failed.then(failure),
            reports,
            export: None,
            _temporary: temporary,
        })
    }

    /// Keeps the result, if there is one. A cache that is full or cannot be written to does not stop a bake.
    fn keep(&self, cache: &cached::Cached<'_>) {
        let Some(scene) = &self.scene else { return };
        if let Err(why) = cache.keep(scene, &self.reports) {
            print_for_people(&format!("warning: the result is not kept in the cache: {why:#}\n"));
        }
    }
}

/// A folder of candidates that is not yet in place.
struct Export {
    hidden: Folder,
    to: PathBuf,
}

impl Export {
    /// Begins a folder.
    ///
    /// # Errors
    /// Fails if something else has its name, or it cannot be made.
    fn begin(to: &Path) -> Result<Export> {
        let name = || format!("--export-candidates {}", to.display());
        let is_older = to.join(CandidatesFile::NAME).is_file();
        ensure!(is_older || !to.exists(), "{}: exists, and is not a folder of candidates", name());
        let parent = to.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let hidden = Folder::new_in(parent).with_context(name)?;
        let export = Export { hidden, to: to.to_owned() };
        fs::create_dir(export.folder()).with_context(name)?;
        Ok(export)
    }

    /// Where candidates are written.
    fn folder(&self) -> PathBuf {
        self.hidden.path().join("candidates")
    }

    /// Renames the folder to its name. Older candidates are removed.
    fn put_in_place(self) -> Result<()> {
        let _hold = Hold::new();
        let name = || format!("--export-candidates {}: cannot be put in place", self.to.display());
        if self.to.exists() {
            fs::rename(&self.to, self.hidden.path().join("older")).with_context(name)?;
        }
        fs::rename(self.folder(), &self.to).with_context(name)
    }
}

/// Writes the list of candidates and their plans into their folder.
fn list(exported: &Exported, plan: &PlanFile, folder: &Path) -> Result<()> {
    let (list, plans) = CandidatesFile::of(exported, plan);
    let plans = list.candidates.iter().zip(&plans);
    let plans = plans.map(|(entry, plan)| (entry.plan.as_str(), report::json::to_json(plan)));
    for (name, text) in plans.chain([(CandidatesFile::NAME, report::json::to_json(&list))]) {
        fs::write(folder.join(name), text)
            .with_context(|| format!("{}: cannot be written", folder.join(name).display()))?;
    }
    Ok(())
}

/// Returns the file to bake to, and the temporary folder it is in if the output is a stream.
fn place(output: &Path) -> Result<(PathBuf, Option<Folder>)> {
    if !is_stream(output) {
        return Ok((output.to_owned(), None));
    }
    let folder = Folder::new_in(&env::temp_dir()).context("the folder for temporary files cannot be written to")?;
    Ok((folder.path().join("stdout.glb"), Some(folder)))
}

/// Returns where the scene is read from. What comes as a stream and does not begin as glTF does is OBJ.
fn source(input: &Path) -> Result<Source> {
    if !is_stream(input) {
        return Ok(input.into());
    }
    let mut bytes = Vec::new();
    io::stdin().lock().read_to_end(&mut bytes).context("standard input cannot be read")?;
    let is_gltf = bytes.starts_with(b"glTF") || bytes.trim_ascii_start().first() == Some(&b'{');
    ensure!(!bytes.is_empty(), "standard input is empty");
    Ok(Source::Bytes { name: if is_gltf { "stdin.glb" } else { "stdin.obj" }.into(), bytes })
}

/// The rule that the output depends on its input files.
fn depfile(arguments: &BakeArguments, cache: Option<&cached::Cached<'_>>) -> Result<String> {
    if arguments.depfile.is_none() {
        return Ok(String::new());
    }
    let outline = match cache {
        Some(cache) => cache.outline.clone(),
        None => raykiln_formats::outline_with(&arguments.input, &arguments.options.obj.options())?,
    };
    let files = outline.files.iter().filter(|file| file.is_file());
    let inputs = [&arguments.input].into_iter().chain(files).chain(&arguments.plan);
    Ok(report::depfile(&arguments.output, inputs.map(PathBuf::as_path)))
}

/// Writes the report to the file descriptor that was named.
#[cfg(unix)]
fn emit_report(arguments: &BakeArguments, json: &str) -> Result<()> {
    let Some(descriptor) = arguments.emit_report_fd else { return Ok(()) };
    let file = fs::File::options().append(true).open(format!("/dev/fd/{descriptor}"));
    let written = file.and_then(|mut file| file.write_all(json.as_bytes()));
    match written {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => written.with_context(|| format!("--emit-report-fd {descriptor}: cannot be written to")),
    }
}

#[cfg(not(unix))]
fn emit_report(_: &BakeArguments, _: &str) -> Result<()> {
    Ok(())
}

/// Writes an output to standard output. Whoever reads it needs all of it, so that a pipe that closes is an error.
fn print_scene(scene: &Staged) -> Result<()> {
    let mut from = fs::File::open(scene.path()).context("the output cannot be read again")?;
    let mut to = io::stdout().lock();
    let written = io::copy(&mut from, &mut to).and_then(|_| to.flush());
    match written {
        Err(e) => bail!("standard output cannot be written to: {e}"),
        Ok(()) => Ok(()),
    }
}

/// Puts all files in place or none, even if a signal arrives.
fn put_in_place(scene: Option<Staged>, mut reports: impl Iterator<Item = StagedReports>) -> Result<()> {
    let _hold = Hold::new();
    let placed = scene.map(Staged::put_in_place).transpose()?;
    let committed = reports.try_for_each(StagedReports::commit);
    committed.inspect_err(|_| placed.into_iter().for_each(Placed::take_back))
}
