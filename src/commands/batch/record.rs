//! Records of what was done, beside the outputs: one small file per asset, in a hidden folder of the folder of outputs.
//!
//! A record says which key the result has and which bytes its files have. It is written after the files are in place, under
//! another name, and renamed: whatever instant a batch is killed at, a record that is there tells the truth, and an asset
//! without one is baked again or taken from the cache.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use raykiln_formats::staging::{Folder, Hold};
use serde::{Deserialize, Serialize};

use super::{Job, Options};
use crate::cache::{Key, KeyBuilder};
use crate::report::batch::{Row, Status};

/// The hidden folder.
pub(super) const FOLDER: &str = ".raykiln";
const SCHEMA: &str = "raykiln.record/1";

/// What was done with an asset.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Record {
    schema: String,
    key: String,
    /// Files below the folder of outputs, with the hashes of their content.
    files: Vec<(String, String)>,
    pub(super) row: Row,
}

impl Record {
    /// Reads the record of a job, if there is one that can be read.
    pub(super) fn read(job: &Job, options: &Options) -> Option<Record> {
        let text = fs::read(path(job, options)).ok()?;
        serde_json::from_slice(&text).ok().filter(|record: &Record| record.schema == SCHEMA)
    }

    /// Whether it is the record of this result, and all files are in place as they were written.
    pub(super) fn holds(&self, key: &Key, options: &Options) -> bool {
        let is_there =
            |(name, hash): &(String, String)| hash_of(&options.out.join(name)).is_ok_and(|found| found == *hash);
        self.is_of(key) && self.row.status != Status::Failed && self.files.iter().all(is_there)
    }

    /// Whether it is the record of this result.
    pub(super) fn is_of(&self, key: &Key) -> bool {
        self.key == key.to_string()
    }

    /// Writes the record of a result that is in place.
    ///
    /// # Errors
    /// Fails if a file cannot be read, or the record cannot be written.
    pub(super) fn write(job: &Job, options: &Options, key: &Key, row: &Row) -> io::Result<()> {
        let names = if row.status.is_without_result() { Vec::new() } else { files(job, options, row) };
        let hashed = |name: String| Ok((name.clone(), hash_of(&options.out.join(name))?));
        let files = names.into_iter().map(hashed).collect::<io::Result<_>>()?;
        let record = Record { schema: SCHEMA.into(), key: key.to_string(), files, row: row.clone() };
        let path = path(job, options);
        let parent = path.parent().unwrap_or(&options.out);
        fs::create_dir_all(parent)?;
        let hidden = Folder::new_in(parent)?;
        let staged = hidden.path().join("record");
        fs::write(&staged, serde_json::to_vec(&record)?)?;
        let _hold = Hold::new();
        fs::rename(staged, path)
    }
}

fn path(job: &Job, options: &Options) -> PathBuf {
    options.out.join(FOLDER).join(format!("{}.json", job.output_name))
}

fn hash_of(file: &Path) -> io::Result<String> {
    Ok(KeyBuilder::default().add_file(file)?.finish().to_string())
}

/// The files of a result: the output, the files that it refers to in the folder of outputs, and the reports.
fn files(job: &Job, options: &Options, row: &Row) -> Vec<String> {
    let outline = raykiln_formats::outline(&job.output).unwrap_or_default();
    let beside = outline.files.iter().filter(|file| file.is_file());
    let names = beside.filter_map(|file| file.strip_prefix(&options.out).ok()?.to_str().map(str::to_owned));
    [job.output_name.clone()].into_iter().chain(names).chain(row.reports.iter().cloned()).collect()
}
