//! The command `batch`: bakes many assets.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::{ArgMatches, Args, ValueEnum};
use raykiln_formats::staging::{Folder, Hold};

use super::args::{CacheArguments, OptionArguments, Output, size};
use super::progress::Counted;
use super::{FAILED, plan, print, print_error, print_for_people};
use crate::cache::Store;
use crate::commands::batch::farm::{Engine, Farm};
use crate::commands::batch::manifest::{BakeWords, Manifest};
use crate::commands::batch::{self, Asset, Job, Mode, Options, Prediction, Settings, jobs, shard};
use crate::commands::cached;
use crate::report;
use crate::report::batch::{Event, Policy, Summary, TimedEvent};

pub(super) const EXAMPLES: &str = "Examples:
  raykiln batch 'assets/**/*.glb' --out baked --cache /shared/raykiln --jobs 8
  raykiln batch --manifest raykiln.toml --max-memory 8GiB --fail-on failed --fail-on slower
  find assets -name '*.obj' | raykiln batch --list - --root assets --out baked --method single

docs/pipeline.md describes manifests, the cache and the summary.";

/// The manifest that is read if nothing else says what to bake.
const MANIFEST: &str = "raykiln.toml";

#[derive(Debug, Args)]
pub(super) struct BatchArguments {
    /// Patterns of assets, such as 'assets/**/*.glb'; the folders below the first wildcard are mirrored
    #[arg(value_name = "PATTERN")]
    inputs: Vec<String>,
    /// Also bake the files that FILE lists, one per line; `-` reads the list from standard input
    #[arg(long, value_name = "FILE")]
    list: Option<PathBuf>,
    /// Rules by pattern: options, names of outputs, budgets [default: raykiln.toml if nothing else says what to bake]
    #[arg(long, value_name = "FILE")]
    manifest: Option<PathBuf>,
    /// Folder whose folders are mirrored [default: for a pattern, the one before its first wildcard; for a list, the current
    /// one]
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    /// Folder of outputs, summary.json and summary.html; it is created if it does not exist
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of bakes at a time [default: one per thread; 1 if a GPU measures]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=512))]
    jobs: Option<u16>,
    /// Memory of all bakes together, such as 8GiB [default: no limit]
    #[arg(long, value_name = "SIZE", value_parser = size)]
    max_memory: Option<u64>,
    /// Also write a report of each asset beside its output; may be repeated
    #[arg(long, value_enum, value_name = "FORMAT")]
    report: Vec<ReportArgument>,
    /// Also write what happens to FILE, one line of JSON per event; `-` writes it to standard output
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    /// Exit with status 1 on `failed` assets, `slower` outputs, findings of a severity (note, warning, error) or rule (such as
    /// RK006), or `never`; may be repeated
    #[arg(long, value_name = "POLICY", default_value = "failed")]
    fail_on: Vec<Policy>,
    /// Print the summary as JSON on standard output
    #[arg(long)]
    json: bool,
    /// Bake only part K of N, such as 3/64, and leave the summary to --collect
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Bake nothing: sum up what was baked, and report what is missing
    #[arg(long, conflicts_with = "shard")]
    collect: bool,
    /// Bake nothing: write a job FILE for the engine of a farm, which runs the batch in parts
    #[arg(long, value_name = "FILE", requires = "engine", conflicts_with_all = ["shard", "collect"])]
    plan: Option<PathBuf>,
    /// --plan: what runs the job
    #[arg(long, value_enum, requires = "plan")]
    engine: Option<EngineArgument>,
    /// --plan: number of parts, balanced by predicted time; ninja divides by asset instead
    #[arg(long, value_name = "N", requires = "plan", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    shards: u32,
    #[command(flatten)]
    cache: CacheArguments,
    /// Options of each bake unless the manifest says otherwise; read from the matches.
    #[command(flatten)]
    _options: OptionArguments,
}

/// What runs a job.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum EngineArgument {
    /// Open Job Description, which AWS Deadline Cloud and `openjd run` take
    Openjd,
    /// A job array of Slurm, for `sbatch`
    Slurm,
    /// A file for Ninja with one bake per asset, which bakes exactly what changed
    Ninja,
}

impl From<EngineArgument> for Engine {
    fn from(argument: EngineArgument) -> Engine {
        match argument {
            EngineArgument::Openjd => Engine::OpenJd,
            EngineArgument::Slurm => Engine::Slurm,
            EngineArgument::Ninja => Engine::Ninja,
        }
    }
}

/// A report of each asset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
enum ReportArgument {
    /// JSON
    Json,
    /// A page with charts
    Html,
    /// Findings as SARIF
    Sarif,
}

impl ReportArgument {
    fn extension(self) -> &'static str {
        match self {
            ReportArgument::Json => "json",
            ReportArgument::Html => "html",
            ReportArgument::Sarif => "sarif",
        }
    }
}

/// A part of the assets.
#[derive(Clone, Copy, Debug)]
struct Shard {
    /// From 0.
    number: usize,
    of: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let numbers = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Shard { number: number - 1, of }),
            _ => Err("must be K/N, with K from 1 to N".into()),
        }
    }
}

/// Runs a batch.
pub(super) fn run(arguments: &BatchArguments, matches: &ArgMatches, output: &Output) -> Result<ExitCode> {
    ensure!(!(arguments.json && is_stream(&arguments.events)), "--json and --events - both write to standard output");
    let given = plan::given(matches.subcommand_matches("batch").context("it is a batch")?);
    let manifest = manifest(arguments)?;
    let out = arguments.out.clone().or_else(|| manifest.out.clone()).context("--out says where the outputs go")?;
    fs::create_dir_all(&out).with_context(|| format!("--out {}", out.display()))?;
    let mut all = Resolver::default();
    let jobs = all.jobs(&assets(arguments, &manifest, &out)?, &manifest, &given, &out)?;
    ensure!(!jobs.is_empty(), "no file is to be baked: no file matches, or rules skip them all");
    jobs::check(&jobs)?;
    if let (Some(file), Some(engine)) = (&arguments.plan, arguments.engine) {
        return write_plan(file, engine.into(), &Farmed { arguments, given: &given, out: &out, jobs: &jobs, output });
    }
    let jobs = of_shard(jobs, arguments.shard);
    let options = options(arguments, out, all.has_gpu)?;
    let mode = if arguments.collect { Mode::Collect } else { Mode::Bake };
    let watcher = Watcher::new(arguments, output.quiet)?;
    let summary = batch::run(&jobs, &options, mode, &|event| watcher.observe(event));
    watcher.finish();
    finish(&summary, &options.out, arguments, output)
}

/// What a job file is made of.
struct Farmed<'a> {
    arguments: &'a BatchArguments,
    given: &'a BakeWords,
    out: &'a Path,
    jobs: &'a [Job],
    output: &'a Output,
}

/// Writes a job file.
fn write_plan(file: &Path, engine: Engine, of: &Farmed) -> Result<ExitCode> {
    let Farmed { arguments, jobs, output, .. } = of;
    ensure!(
        engine != Engine::Ninja || arguments.cache.cache.is_some(),
        "--engine ninja needs --cache: the summary is made of what Ninja baked"
    );
    let shards = arguments.shards as usize;
    let farm = Farm {
        arguments: of.words(false)?,
        collecting: of.words(true)?,
        shards: shards.min(jobs.len()),
        max_memory: arguments.max_memory,
        jobs,
        of_bakes: of.words_of_bakes()?,
    };
    let text = farm.job_file(engine).map_err(|why| anyhow!("--plan {}: {why}", file.display()))?;
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let staged = Folder::new_in(folder).and_then(|hidden| {
        fs::write(hidden.path().join("job"), text)?;
        fs::rename(hidden.path().join("job"), file)
    });
    staged.with_context(|| format!("--plan {}: cannot be written", file.display()))?;
    if !output.quiet {
        print_for_people(&report::batch::planned(jobs.len(), &shard::sums(&predicted(jobs), farm.shards)));
    }
    Ok(ExitCode::SUCCESS)
}

impl Farmed<'_> {
    /// The arguments of `batch` for a task in any folder; `collecting`: for the one that sums up.
    fn words(&self, collecting: bool) -> Result<Vec<String>> {
        let arguments = self.arguments;
        let mut words = Vec::new();
        for pattern in &arguments.inputs {
            words.push(absolute_pattern(pattern)?);
        }
        if let Some(list) = &arguments.list {
            let all = self.jobs.iter().all(|job| job.asset.file.is_absolute());
            ensure!(list.as_os_str() != "-" && all, "--plan with --list needs a file with absolute names");
        }
        let usual = Some(PathBuf::from(MANIFEST)).filter(|_| arguments.inputs.is_empty() && arguments.list.is_none());
        let manifest = arguments.manifest.clone().or(usual);
        let out = Some(self.out.to_owned());
        let folders = [("list", &arguments.list), ("manifest", &manifest), ("root", &arguments.root), ("out", &out)];
        for (option, path) in folders.into_iter().chain([("cache", &arguments.cache.cache)]) {
            words.extend(path.as_deref().map(|path| absolute_option(option, path)).transpose()?);
        }
        words.extend(arguments.report.iter().map(|report| format!("--report={}", report.extension())));
        let sizes = [("cache-size", arguments.cache.cache_size), ("max-memory", arguments.max_memory)];
        words.extend(sizes.iter().filter_map(|(option, size)| Some(format!("--{option}={}", (*size)?))));
        words.extend(arguments.jobs.map(|jobs| format!("--jobs={jobs}")));
        if collecting {
            words.extend(arguments.fail_on.iter().map(|policy| format!("--fail-on={policy}")));
        }
        words.extend(plan::words(self.given)?);
        Ok(words)
    }

    /// The arguments of a bake besides its own options.
    fn words_of_bakes(&self) -> Result<Vec<String>> {
        let cache = self.arguments.cache.cache.as_deref().map(|path| absolute_option("cache", path)).transpose()?;
        let size = self.arguments.cache.cache_size.map(|size| format!("--cache-size={size}"));
        Ok(cache.into_iter().chain(size).collect())
    }
}

fn absolute_option(option: &str, path: &Path) -> Result<String> {
    let path = std::path::absolute(path).with_context(|| format!("--{option} {}", path.display()))?;
    let text = path.to_str().with_context(|| format!("--{option} {}: is not UTF-8", path.display()))?;
    Ok(format!("--{option}={text}"))
}

/// A pattern that means the same in any folder.
fn absolute_pattern(pattern: &str) -> Result<String> {
    if Path::new(pattern).is_absolute() {
        return Ok(pattern.to_owned());
    }
    let here = std::env::current_dir().context("the current folder is unknown")?;
    let here = here.to_str().context("the name of the current folder is not UTF-8")?;
    Ok(format!("{}/{pattern}", glob::Pattern::escape(here)))
}

fn is_stream(file: &Option<PathBuf>) -> bool {
    file.as_ref().is_some_and(|file| file.as_os_str() == "-")
}

/// Reads the manifest: the one that is named, or the usual one if nothing else says what to bake.
fn manifest(arguments: &BatchArguments) -> Result<Manifest> {
    let is_said = !arguments.inputs.is_empty() || arguments.list.is_some();
    let usual = Path::new(MANIFEST);
    let file = match &arguments.manifest {
        Some(file) => file,
        None if is_said => return Ok(Manifest::default()),
        None if usual.is_file() => usual,
        None => bail!("nothing says what to bake: name patterns, --list or --manifest, or write {MANIFEST}"),
    };
    Manifest::read(file, size).map_err(|why| anyhow!("{}: {why}", file.display()))
}

/// Finds the assets, each once.
fn assets(arguments: &BatchArguments, manifest: &Manifest, out: &Path) -> Result<Vec<Asset>> {
    let root = arguments.root.as_deref().or(manifest.root.as_deref());
    let mut assets = Vec::new();
    let of_manifest = manifest.inputs.iter().filter(|_| arguments.inputs.is_empty() && arguments.list.is_none());
    for pattern in arguments.inputs.iter().chain(of_manifest) {
        assets.extend(batch::find(pattern, root, out)?);
    }
    if let Some(file) = &arguments.list {
        let mut text = String::new();
        let read = match is_stream(&arguments.list) {
            true => io::stdin().lock().read_to_string(&mut text),
            false => File::open(file).and_then(|mut file| file.read_to_string(&mut text)),
        };
        read.with_context(|| format!("--list {}: cannot be read", file.display()))?;
        let names = text.lines().map(str::trim).filter(|name| !name.is_empty());
        assets.extend(batch::list(names, root)?);
    }
    assets.sort();
    assets.dedup();
    Ok(assets)
}

/// Makes jobs of assets; settings that many share are made once.
#[derive(Default)]
struct Resolver {
    settings: BTreeMap<BakeWords, Arc<Settings>>,
    devices: BTreeMap<String, String>,
    /// Whether a device other than the CPU traces.
    has_gpu: bool,
}

impl Resolver {
    fn jobs(&mut self, assets: &[Asset], manifest: &Manifest, given: &BakeWords, out: &Path) -> Result<Vec<Job>> {
        let mut jobs = Vec::new();
        for asset in assets {
            let ruled = manifest.ruled(&asset.name, given, size);
            if ruled.skip {
                continue;
            }
            let settings = self.settings(&ruled.options).with_context(|| asset.name.clone())?;
            let output = out.join(&ruled.output);
            jobs.push(Job { asset: asset.clone(), output_name: ruled.output, output, settings, budget: ruled.budget });
        }
        Ok(jobs)
    }

    fn settings(&mut self, options: &BakeWords) -> Result<Arc<Settings>> {
        if let Some(settings) = self.settings.get(options) {
            return Ok(settings.clone());
        }
        let words = plan::words(options)?;
        let (bake, planned) = plan::parsed(&words)?;
        let name = options.get("device").map_or_else(String::new, |device| device.join(" "));
        if !self.devices.contains_key(&name) {
            self.devices.insert(name.clone(), cached::device(&bake.verify.device)?);
        }
        let device = &self.devices[&name];
        self.has_gpu |= device != cached::CPU;
        let device = if cached::is_decided_by_device(&bake) { device.clone() } else { String::new() };
        let obj = bake.load.obj;
        let settings = Arc::new(Settings { words, options: planned, obj, device });
        self.settings.insert(options.clone(), settings.clone());
        Ok(settings)
    }
}

/// The jobs of one shard. All tasks divide alike as long as the files are the same.
fn of_shard(jobs: Vec<Job>, shard: Option<Shard>) -> Vec<Job> {
    let Some(shard) = shard else { return jobs };
    let of = shard::divide(&predicted(&jobs), shard.of);
    jobs.into_iter().zip(of).filter(|(_, of)| *of == shard.number).map(|(job, _)| job).collect()
}

/// The predicted durations of jobs, in seconds.
fn predicted(jobs: &[Job]) -> Vec<f64> {
    use rayon::prelude::*;
    let outline = |job: &Job| raykiln_formats::outline_with(&job.asset.file, &job.settings.obj).unwrap_or_default();
    jobs.par_iter().map(|job| Prediction::of(&outline(job)).seconds).collect()
}

fn options(arguments: &BatchArguments, out: PathBuf, has_gpu: bool) -> Result<Options> {
    let open = |folder: &PathBuf| Store::open(folder).with_context(|| format!("--cache {}", folder.display()));
    let mut reports = arguments.report.clone();
    reports.sort_unstable();
    reports.dedup();
    let threads = rayon::current_num_threads();
    Ok(Options {
        out,
        cache: arguments.cache.cache.as_ref().map(open).transpose()?,
        cache_bytes: arguments.cache.cache_size,
        reports: reports.into_iter().map(|report| report.extension().to_owned()).collect(),
        jobs: arguments.jobs.map_or(if has_gpu { 1 } else { threads }, usize::from),
        threads,
        max_memory: arguments.max_memory,
        program: std::env::current_exe().context("this program cannot be found")?,
    })
}

/// Shows what happens, and writes it down.
struct Watcher {
    start: Instant,
    inner: Mutex<Watched>,
}

struct Watched {
    events: Option<Box<dyn Write + Send>>,
    progress: Counted,
    assets: usize,
    done: usize,
    failed: usize,
}

impl Watcher {
    fn new(arguments: &BatchArguments, quiet: bool) -> Result<Self> {
        let events: Option<Box<dyn Write + Send>> = match &arguments.events {
            None => None,
            Some(_) if is_stream(&arguments.events) => Some(Box::new(io::stdout())),
            Some(file) => {
                let opened = File::create(file).with_context(|| format!("--events {}", file.display()));
                Some(Box::new(opened?))
            }
        };
        let inner = Watched { events, progress: Counted::new(quiet), assets: 0, done: 0, failed: 0 };
        Ok(Watcher { start: Instant::now(), inner: Mutex::new(inner) })
    }

    fn observe(&self, event: &Event) {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let timed = TimedEvent {
            schema: TimedEvent::SCHEMA,
            seconds: self.start.elapsed().as_secs_f64(),
            event: event.clone(),
        };
        if let Some(events) = &mut inner.events {
            // Whoever reads the events may leave before the batch ends.
            let _ = events.write_all(timed.line().as_bytes()).and_then(|()| events.flush());
        }
        match event {
            Event::Begin { assets } => inner.assets = *assets,
            Event::Done { row } => {
                inner.done += 1;
                inner.failed += usize::from(row.status.is_without_result());
            }
            _ => {}
        }
        let message = if inner.failed > 0 { format!("{} failed", inner.failed) } else { String::new() };
        let (done, assets) = (inner.done, inner.assets);
        inner.progress.set(done, assets, message);
    }

    fn finish(&self) {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner).progress.finish();
    }
}

/// Writes the summary, and returns the exit status.
fn finish(summary: &Summary, out: &Path, arguments: &BatchArguments, output: &Output) -> Result<ExitCode> {
    let json = report::json::to_json(summary);
    if arguments.shard.is_none() {
        put_summary(out, &json, &report::html::batch(summary)).context("the summary cannot be written")?;
    }
    if arguments.json {
        print(json.as_bytes())?;
    }
    if !output.quiet {
        print_for_people(&summary.text());
    }
    let failing = summary.failing(&arguments.fail_on).count();
    if failing == 0 {
        return Ok(ExitCode::SUCCESS);
    }
    print_error(format_args!("{failing} of {} assets: see {} (--fail-on)", summary.assets.len(), out.display()));
    Ok(ExitCode::from(FAILED))
}

/// Writes both files of the summary under other names, and renames them.
fn put_summary(out: &Path, json: &str, page: &str) -> io::Result<()> {
    let folder = Folder::new_in(out)?;
    let files = [("summary.json", json), ("summary.html", page)];
    files.iter().try_for_each(|(name, text)| fs::write(folder.path().join(name), text))?;
    let _hold = Hold::new();
    files.iter().try_for_each(|(name, _)| fs::rename(folder.path().join(name), out.join(name)))
}
