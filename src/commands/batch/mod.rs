//! Bakes many assets: finds them, takes what was baked before, and bakes the rest in processes of this program.
//!
//! Assets are looked up in this process, in parallel: hashing and copying files is all that a hit costs. Each bake is a
//! process of its own, so that an asset that is refused memory, breaks the program or takes too long ends alone, its memory
//! can be read from outside, and nothing of it remains when it ends. Starting a process takes milliseconds; the smallest
//! bake takes longer.
//!
//! What is done is recorded beside the outputs ([`record`]). A batch that was killed therefore goes on where it was, and tasks
//! of a farm that share the folder need no other means to tell what they did.

pub mod farm;
mod find;
pub mod jobs;
mod look_up;
pub mod manifest;
pub mod memory;
mod predict;
mod record;
mod schedule;
pub mod shard;

use std::path::PathBuf;
use std::time::Instant;

use rayon::prelude::*;

use crate::cache::Store;
use crate::report::batch::{Event, Row, Status, Summary};

pub use find::{Asset, FindError, find, list};
pub use jobs::{Job, Settings};
use look_up::Looked;
pub use predict::Prediction;

/// How a batch is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// The folder of outputs.
    pub out: PathBuf,
    /// Where results are kept besides.
    pub cache: Option<Store>,
    /// Results that were not used for the longest time leave the cache beyond this size, in bytes.
    pub cache_bytes: Option<u64>,
    /// Extensions of the reports that are written beside each output.
    pub reports: Vec<String>,
    /// Number of bakes at a time, at least 1.
    pub jobs: usize,
    /// Number of threads of all bakes together.
    pub threads: usize,
    /// Memory of all bakes together, in bytes; `None` for no limit.
    pub max_memory: Option<u64>,
    /// This program.
    pub program: PathBuf,
}

/// Whether to bake, or only to sum up what was baked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Bake what is missing.
    Bake,
    /// Bake nothing.
    Collect,
}

/// Runs a batch. `observe` is told what happens, from any thread.
pub fn run(jobs: &[Job], options: &Options, mode: Mode, observe: &(dyn Fn(&Event) + Sync)) -> Summary {
    let start = Instant::now();
    observe(&Event::Begin { assets: jobs.len() });
    let looked: Vec<Looked> = jobs
        .par_iter()
        .map(|job| look_up::look_up(job, options, mode).inspect(|row| observe(&Event::Done { row })))
        .collect();
    let (mut rows, mut misses) = (Vec::new(), Vec::new());
    for (job, looked) in jobs.iter().zip(looked) {
        match looked {
            Looked::Row(row) => rows.push(*row),
            Looked::Miss(miss) => misses.push((job, miss)),
        }
    }
    let (baked, peak_memory_bytes) = schedule::bake(misses, options, observe);
    rows.extend(baked);
    if let (Some(store), Some(most)) = (&options.cache, options.cache_bytes) {
        // What cannot be removed now is removed by the next batch.
        let _ = store.trim(most);
    }
    let summary = Summary::of(rows, start.elapsed().as_secs_f64(), peak_memory_bytes);
    observe(&Event::End { counts: &summary.counts });
    summary
}

/// A row for an asset that has no result.
fn failed(job: &Job, reason: impl Into<String>) -> Row {
    Row::without_result(&job.asset.name, &job.output_name, Status::Failed, reason)
}
