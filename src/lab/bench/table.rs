//! The table of runs, written row by row.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::row::RunRow;
use crate::lab::LabError;
use crate::lab::tables::Tables;

/// The names of the tables.
pub(in crate::lab) const NAMES: [&str; 2] = ["runs.csv", "runs.jsonl"];

/// The files of the table. Each row is in both files before the next run begins.
pub(in crate::lab) struct RunTable {
    folder: PathBuf,
    tables: Tables,
    /// Swept keys: columns of every row.
    settings: Vec<String>,
    /// Rows of an earlier run that is resumed, by their ids.
    known: BTreeMap<String, RunRow>,
}

impl RunTable {
    /// Creates the files in a folder, which is created if it does not exist. Rows of an earlier run are kept if it is to
    /// be resumed, unless they failed, and replaced if not.
    ///
    /// # Errors
    /// Fails if a file cannot be read or written.
    pub(in crate::lab) fn create(folder: &Path, settings: &[String], resume: bool) -> Result<RunTable, LabError> {
        let known = if resume { read(&folder.join(NAMES[1]))? } else { Vec::new() };
        let columns = completed(&RunRow::default(), settings).columns();
        let mut table = RunTable {
            folder: folder.to_owned(),
            tables: Tables::create(folder, NAMES, &columns)?,
            settings: settings.to_vec(),
            known: BTreeMap::new(),
        };
        for row in known.into_iter().filter(|row| row.failure.is_none()) {
            table.append(&row)?;
            table.known.insert(row.id.clone(), row);
        }
        Ok(table)
    }

    /// Returns the row of a run that was done before.
    pub(in crate::lab) fn known(&self, id: &str) -> Option<&RunRow> {
        self.known.get(id)
    }

    /// Appends a row to both files, each in one piece.
    ///
    /// # Errors
    /// Fails if a file cannot be written.
    pub(in crate::lab) fn append(&mut self, row: &RunRow) -> Result<(), LabError> {
        let columns = completed(row, &self.settings).columns();
        self.tables.append(&columns, row).map_err(|e| LabError::file(&self.folder, e))
    }
}

/// Returns a row with a column for every swept key.
fn completed(row: &RunRow, settings: &[String]) -> RunRow {
    let mut row = row.clone();
    for name in settings {
        row.settings.entry(name.clone()).or_default();
    }
    row.settings.retain(|name, _| settings.contains(name));
    row
}

/// Reads the rows of a table; a last line that was not finished is left out.
pub(in crate::lab) fn read(lines: &Path) -> Result<Vec<RunRow>, LabError> {
    let text = match fs::read_to_string(lines) {
        Ok(text) => text,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(e) => return Err(LabError::file(lines, e)),
    };
    let mut rows = Vec::new();
    for (number, line) in (1..).zip(text.split_inclusive('\n')) {
        match serde_json::from_str(line) {
            Ok(row) => rows.push(row),
            Err(_) if !line.ends_with('\n') => break,
            Err(e) => return Err(LabError::Config { file: lines.to_owned(), line: number, cause: e.to_string() }),
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(id: &str) -> RunRow {
        RunRow { id: id.into(), scene: format!("scene, of {id}"), ..RunRow::default() }
    }

    #[test]
    fn a_run_that_was_cut_off_is_resumed_after_its_last_whole_row() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut table = RunTable::create(folder.path(), &["som_threshold".into()], false).expect("created");
        table.append(&row("a")).expect("written");
        table.append(&row("b")).expect("written");
        let lines = folder.path().join(NAMES[1]);
        let text = fs::read_to_string(&lines).expect("text");
        fs::write(&lines, &text[..text.len() - 9]).expect("writable");
        let table = RunTable::create(folder.path(), &["som_threshold".into()], true).expect("resumed");
        assert_eq!((table.known("a").cloned(), table.known("b")), (Some(row("a")), None));
        let csv = fs::read_to_string(folder.path().join(NAMES[0])).expect("text");
        assert_eq!(csv.lines().count(), 2, "{csv}");
        assert!(csv.starts_with("id,scene,environment,setting_som_threshold,"), "{csv}");
        let table = RunTable::create(folder.path(), &[], false).expect("created");
        assert!(table.known("a").is_none());
    }

    #[test]
    fn a_broken_row_is_refused_with_its_line() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join(NAMES[1]), "{}\n").expect("writable");
        let error = RunTable::create(folder.path(), &[], true).err().expect("an error").to_string();
        assert!(error.contains("runs.jsonl:1: missing field"), "{error}");
    }
}
