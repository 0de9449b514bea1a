//! The command `cache`: checks and cleans the folder in which `--cache` keeps results.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Subcommand;

use super::args::size;
use super::{FAILED, print};
use crate::cache::Store;
use crate::report::cached;

#[derive(Debug, Subcommand)]
pub(super) enum CacheCommand {
    /// Read all results, and remove those that are damaged; exit status 1 if there are any
    Verify {
        /// Folder of the cache
        dir: PathBuf,
    },
    /// Remove results, and what processes left behind that were killed over a day ago
    Clean {
        /// Folder of the cache
        dir: PathBuf,
        /// Keep the results that were used last, up to this size, such as 20GiB [default: keep none]
        #[arg(long, value_name = "SIZE", value_parser = size)]
        cache_size: Option<u64>,
    },
}

/// Runs the command.
pub(super) fn run(command: &CacheCommand) -> Result<ExitCode> {
    let (CacheCommand::Verify { dir } | CacheCommand::Clean { dir, .. }) = command;
    let place = || dir.display().to_string();
    let store = Store::existing(dir).with_context(place)?;
    match command {
        CacheCommand::Verify { .. } => {
            let (left, damaged) = store.verify().with_context(place)?;
            print(cached::verified(&left, &damaged).as_bytes())?;
            Ok(if damaged.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(FAILED) })
        }
        CacheCommand::Clean { cache_size, .. } => {
            let removed = store.trim(cache_size.unwrap_or(0)).with_context(place)?;
            let left = store.contents().with_context(place)?;
            print(cached::cleaned(&removed, &left).as_bytes())
        }
    }
}
