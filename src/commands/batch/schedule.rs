//! Bakes assets in processes, as many at a time as jobs and memory allow.
//!
//! The bakes that take longest start first. A bake starts when the predicted memory of all fits; what was predicted too low is
//! found by sampling: when the memory of all comes near the limit, the bake that started last is ended and later started again
//! alone. Only a bake that needs more than the limit by itself fails.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use raykiln_formats::staging::Folder;

use super::look_up::{Miss, over_budget};
use super::memory::resident_bytes;
use super::record::Record;
use super::{Job, Options, Prediction, failed};
use crate::report::batch::{Event, Row, Status};

/// Time from one look at the processes to the next.
const INTERVAL: Duration = Duration::from_millis(5);
/// Share of the memory that processes may take before one is ended: they grow from one look to the next.
const ALARM: f64 = 15.0 / 16.0;
/// Time that a process gets to remove its files when it is ended.
const PATIENCE: Duration = Duration::from_secs(2);

/// An asset that waits.
struct Waiting<'a> {
    job: &'a Job,
    miss: Miss,
    /// Whether it was ended before, and must run alone.
    alone: bool,
}

/// An asset that is being baked.
struct Running<'a> {
    of: Waiting<'a>,
    child: Child,
    started: Instant,
    /// Holds what the process prints.
    folder: Folder,
    memory_bytes: u64,
}

/// Why a process was ended.
enum Stop {
    Seconds(f64),
    Memory(u64),
    Postponed,
}

/// The state of a schedule.
struct Schedule<'a> {
    options: &'a Options,
    observe: &'a (dyn Fn(&Event) + Sync),
    /// The next one last.
    waiting: Vec<Waiting<'a>>,
    running: Vec<Running<'a>>,
    rows: Vec<Row>,
    peak: Option<u64>,
}

/// Bakes assets. Returns their rows, and the largest memory of all processes at one time.
pub(super) fn bake<'a>(
    misses: Vec<(&'a Job, Miss)>,
    options: &'a Options,
    observe: &'a (dyn Fn(&Event) + Sync),
) -> (Vec<Row>, Option<u64>) {
    let mut waiting: Vec<Waiting> = misses.into_iter().map(|(job, miss)| Waiting { job, miss, alone: false }).collect();
    waiting.sort_by(|a, b| {
        let seconds = |of: &Waiting| of.miss.prediction.seconds;
        seconds(a).total_cmp(&seconds(b)).then_with(|| b.job.asset.name.cmp(&a.job.asset.name))
    });
    let mut schedule = Schedule { options, observe, waiting, running: Vec::new(), rows: Vec::new(), peak: None };
    while !(schedule.waiting.is_empty() && schedule.running.is_empty()) {
        schedule.start_all();
        schedule.collect();
        schedule.watch();
        thread::sleep(INTERVAL);
    }
    (schedule.rows, schedule.peak)
}

impl<'a> Schedule<'a> {
    /// Starts what fits.
    fn start_all(&mut self) {
        while self.running.len() < self.options.jobs {
            let Some(next) = self.waiting.iter().rposition(|of| self.fits(of)) else { return };
            let next = self.waiting.remove(next);
            self.start(next);
        }
    }

    /// Whether a bake may start now. One always may if there is no other.
    fn fits(&self, next: &Waiting) -> bool {
        let Some(first) = self.running.first() else { return true };
        if next.alone || first.of.alone {
            return false;
        }
        let taken = |running: &Running| running.of.miss.prediction.memory_bytes.max(running.memory_bytes);
        let sum: u64 = self.running.iter().map(taken).sum();
        let needed = sum.saturating_add(next.miss.prediction.memory_bytes);
        self.options.max_memory.is_none_or(|most| needed as f64 <= most as f64 * ALARM - own_bytes() as f64)
    }

    fn start(&mut self, of: Waiting<'a>) {
        let Prediction { seconds: predicted_seconds, memory_bytes: predicted_memory_bytes } = of.miss.prediction;
        let asset = of.job.asset.name.as_str();
        (self.observe)(&Event::Start { asset, predicted_seconds, predicted_memory_bytes });
        let share = self.options.jobs.min(self.running.len() + 1 + self.waiting.len()).max(1);
        let threads = if of.alone { self.options.threads } else { self.options.threads / share }.max(1);
        match spawn(of.job, self.options, threads) {
            Ok((child, folder)) => {
                self.running.push(Running { of, child, started: Instant::now(), folder, memory_bytes: 0 });
            }
            Err(why) => self.done(of.job, None, failed(of.job, format!("cannot be started: {why}"))),
        }
    }

    /// Takes up what has ended.
    fn collect(&mut self) {
        let mut i = 0;
        while i < self.running.len() {
            match self.running[i].child.try_wait() {
                Ok(None) => i += 1,
                status => {
                    let ended = self.running.remove(i);
                    let row = row_of(&ended, self.options, status.ok().flatten());
                    self.done(ended.of.job, Some(&ended.of.miss), row);
                }
            }
        }
    }

    /// Records a row. Without a record, the next batch bakes the asset again.
    fn done(&mut self, job: &Job, miss: Option<&Miss>, row: Row) {
        if let Some(key) = miss.and_then(|miss| miss.key.as_ref()) {
            // The files may have changed while they were baked; the record must be of what was baked.
            let wanted: Vec<&str> = self.options.reports.iter().map(String::as_str).filter(|r| *r != "json").collect();
            if job.decides(&wanted).key().is_ok_and(|(now, _)| now == *key) {
                let _ = Record::write(job, self.options, key, &row);
            }
        }
        let row = over_budget(row, job);
        (self.observe)(&Event::Done { row: &row });
        self.rows.push(row);
    }

    /// Ends what takes too long or too much memory.
    fn watch(&mut self) {
        for running in &mut self.running {
            running.memory_bytes = resident_bytes(running.child.id()).unwrap_or(running.memory_bytes);
        }
        let sum = own_bytes() + self.running.iter().map(|running| running.memory_bytes).sum::<u64>();
        if !self.running.is_empty() {
            self.peak = self.peak.max(Some(sum));
        }
        let alarm = self.options.max_memory.is_some_and(|most| sum as f64 > most as f64 * ALARM);
        let stopped = |running: &Running| over_own_budget(running).is_some();
        if let Some(i) = self.running.iter().position(stopped) {
            let stop = over_own_budget(&self.running[i]);
            self.stop(i, stop.unwrap_or(Stop::Postponed));
        } else if alarm && self.running.len() > 1 {
            self.stop(self.running.len() - 1, Stop::Postponed);
        } else if alarm && self.running.len() == 1 {
            self.stop(0, Stop::Memory(self.options.max_memory.unwrap_or(sum)));
        }
    }

    /// Ends a process.
    fn stop(&mut self, i: usize, stop: Stop) {
        let mut ended = self.running.remove(i);
        end(&mut ended.child);
        let reason = match stop {
            Stop::Postponed => {
                (self.observe)(&Event::Postpone { asset: &ended.of.job.asset.name });
                self.waiting.insert(0, Waiting { alone: true, ..ended.of });
                return;
            }
            Stop::Seconds(most) => format!("took longer than {most} seconds (max-seconds)"),
            Stop::Memory(most) => format!("needs more than {most} bytes of memory (max-memory)"),
        };
        self.done(ended.of.job, Some(&ended.of.miss), failed(ended.of.job, reason));
    }
}

/// The memory of this process.
fn own_bytes() -> u64 {
    resident_bytes(std::process::id()).unwrap_or(0)
}

/// The budget of its own that a process exceeds.
fn over_own_budget(running: &Running) -> Option<Stop> {
    let budget = &running.of.job.budget;
    let seconds = budget.seconds.filter(|most| running.started.elapsed().as_secs_f64() > *most).map(Stop::Seconds);
    seconds.or_else(|| budget.memory.filter(|most| running.memory_bytes > *most).map(Stop::Memory))
}

/// Starts a bake. What it prints goes into a hidden folder.
fn spawn(job: &Job, options: &Options, threads: usize) -> io::Result<(Child, Folder)> {
    fs::create_dir_all(job.output.parent().unwrap_or(Path::new(".")))?;
    let folder = Folder::new_in(&options.out)?;
    let mut command = Command::new(&options.program);
    command.arg("bake").arg("--output").arg(&job.output).args(&job.settings.words);
    command.args(["--json", "--quiet", "--end-with-stdin", "--threads"]).arg(threads.to_string());
    if let Some(store) = &options.cache {
        command.arg("--cache").arg(store.folder());
    }
    for extension in &options.reports {
        command.arg("--report").arg(options.out.join(job.report_name(extension)));
    }
    command.arg("--").arg(&job.asset.file);
    // The process ends when this one does, however it ends, because its standard input is then closed.
    command.stdin(Stdio::piped());
    command.stdout(File::create(folder.path().join("stdout"))?).stderr(File::create(folder.path().join("stderr"))?);
    Ok((command.spawn()?, folder))
}

/// Ends a process: first by closing its standard input, so that it removes its files.
fn end(child: &mut Child) {
    drop(child.stdin.take());
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        if !matches!(child.try_wait(), Ok(None)) {
            return;
        }
        thread::sleep(INTERVAL);
    }
    let _ = child.kill();
    let _ = child.wait();
}

/// The row of a bake that has ended.
fn row_of(ended: &Running, options: &Options, status: Option<ExitStatus>) -> Row {
    let job = ended.of.job;
    let read = |name: &str| fs::read_to_string(ended.folder.path().join(name)).unwrap_or_default();
    let row = Row::of_report(&job.asset.name, &job.output_name, Status::Baked, &read("stdout"));
    let is_done = status.is_some_and(|status| status.success());
    match row {
        Some(row) if is_done => {
            let reports = options.reports.iter().map(|extension| job.report_name(extension)).collect();
            Row { reports, ..row }
        }
        row => Row {
            status: Status::Failed,
            reason: reason(&read("stderr"), status),
            ..row.unwrap_or_else(|| failed(job, ""))
        },
    }
}

/// Why a bake failed: what it said, or how it ended.
fn reason(stderr: &str, status: Option<ExitStatus>) -> String {
    let said = stderr.trim();
    let error = said.lines().find_map(|line| line.strip_prefix("error: "));
    let how = || status.map_or_else(|| "cannot be waited for".to_owned(), |status| format!("ended by {status}"));
    match (error, said) {
        (Some(error), _) => error.to_owned(),
        (None, "") => how(),
        (None, said) => format!("{}: {}", how(), said.lines().last().unwrap_or_default()),
    }
}
