//! Tables that are written row by row, as CSV and as JSON lines.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

use super::LabError;

/// The files of a table. Each row is in both files before the next one is measured.
pub(super) struct Tables {
    csv: File,
    lines: File,
}

impl Tables {
    /// Creates the files `names`, CSV first, which replace those of an earlier run, and writes the header: the names of the
    /// columns of a row.
    ///
    /// # Errors
    /// Fails if a file cannot be written.
    pub(super) fn create(
        out: &Path,
        names: [&str; 2],
        columns: &[(impl AsRef<str>, String)],
    ) -> Result<Tables, LabError> {
        fs::create_dir_all(out).map_err(|e| LabError::file(out, e))?;
        let [csv, lines] = names.map(|name| {
            let path = out.join(name);
            File::create(&path).map_err(|e| LabError::file(&path, e))
        });
        let mut tables = Tables { csv: csv?, lines: lines? };
        let header = record(columns.iter().map(|(name, _)| name.as_ref()));
        header.and_then(|header| tables.csv.write_all(&header)).map_err(|e| LabError::file(&out.join(names[0]), e))?;
        Ok(tables)
    }

    /// Appends a row to both files, each in one piece.
    ///
    /// # Errors
    /// Fails if a file cannot be written.
    pub(super) fn append(&mut self, columns: &[(impl AsRef<str>, String)], row: &impl Serialize) -> io::Result<()> {
        self.csv.write_all(&record(columns.iter().map(|(_, value)| value.as_str()))?)?;
        self.lines.write_all(format!("{}\n", serde_json::to_string(row)?).as_bytes())
    }
}

/// Returns a record of a CSV file.
fn record<'a>(values: impl Iterator<Item = &'a str>) -> io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(values)?;
    writer.into_inner().map_err(|e| e.into_error())
}
