//! Looks an asset up: in place, in the cache, or to be baked.

use std::fs;
use std::path::Path;

use raykiln_formats::document::Staged;

use super::record::Record;
use super::{Job, Mode, Options, Prediction, failed};
use crate::cache::Key;
use crate::commands::cached::{self, Hit};
use crate::report::batch::{Row, Status};
use crate::report::cached::renamed;

/// What was found.
pub(super) enum Looked {
    /// The asset is done.
    Row(Box<Row>),
    /// It is to be baked.
    Miss(Miss),
}

/// An asset that is to be baked.
pub(super) struct Miss {
    /// The key of its result; `None` if its files cannot be read, which the bake reports.
    pub(super) key: Option<Key>,
    pub(super) prediction: Prediction,
}

impl Looked {
    fn row(row: Row) -> Looked {
        Looked::Row(Box::new(row))
    }

    /// Calls a function with the row, if there is one.
    pub(super) fn inspect(self, observe: impl FnOnce(&Row)) -> Looked {
        if let Looked::Row(row) = &self {
            observe(row);
        }
        self
    }
}

/// Looks a job up; what is in the cache is put in place.
pub(super) fn look_up(job: &Job, options: &Options, mode: Mode) -> Looked {
    let wanted: Vec<&str> = options.reports.iter().map(String::as_str).filter(|report| *report != "json").collect();
    let record = Record::read(job, options);
    let (key, outline) = match job.decides(&wanted).key() {
        Ok(found) => found,
        Err(why) if mode == Mode::Collect => return Looked::row(failed(job, why.to_string())),
        Err(_) => return Looked::Miss(Miss { key: None, prediction: Prediction::of(&Default::default()) }),
    };
    let holds = |record: &&Record| record.holds(&key, options) && has_reports(&record.row, job, options);
    if let Some(record) = record.as_ref().filter(holds) {
        return Looked::row(over_budget(Row { status: Status::Unchanged, ..record.row.clone() }, job));
    }
    if mode == Mode::Collect {
        return Looked::row(uncollected(job, &key, record));
    }
    if let Some(row) = from_cache(job, options, &key) {
        return Looked::row(over_budget(row, job));
    }
    let row = record.map(|record| record.row);
    let measured = (row.as_ref().and_then(|row| row.seconds), row.as_ref().and_then(|row| row.peak_memory_bytes));
    Looked::Miss(Miss { key: Some(key), prediction: Prediction::of(&outline).or_measured(measured.0, measured.1) })
}

fn has_reports(row: &Row, job: &Job, options: &Options) -> bool {
    options.reports.iter().all(|extension| row.reports.contains(&job.report_name(extension)))
}

/// The row of an asset that is not in place: why it failed, or that nothing baked it.
fn uncollected(job: &Job, key: &Key, record: Option<Record>) -> Row {
    match record.filter(|record| record.is_of(key) && record.row.status == Status::Failed) {
        Some(record) => record.row,
        None => {
            let reason = "nothing has baked it as it is now";
            Row::without_result(&job.asset.name, &job.output_name, Status::Missing, reason)
        }
    }
}

/// Puts a result from the cache in place, if there is one. If that fails, the bake reports why.
fn from_cache(job: &Job, options: &Options, key: &Key) -> Option<Row> {
    let store = options.cache.as_ref()?;
    fs::create_dir_all(job.output.parent()?).ok()?;
    let Hit { staged, reports } = cached::look_up(store, key, &job.output).ok()??;
    let json = renamed(reports.get("json")?, &job.asset.file, &job.output)?;
    let mut row = Row::of_report(&job.asset.name, &job.output_name, Status::Cached, &json)?;
    let text = |extension: &str| if extension == "json" { Some(&json) } else { reports.get(extension) };
    for extension in &options.reports {
        let name = job.report_name(extension);
        put(&options.out.join(&name), text(extension)?).ok()?;
        row.reports.push(name);
    }
    Staged::commit(staged).ok()?;
    // Without a record, the next batch finds the result in the cache again.
    let _ = Record::write(job, options, key, &row);
    Some(row)
}

/// Writes a report under another name, and renames it.
fn put(file: &Path, text: &str) -> std::io::Result<()> {
    let hidden = raykiln_formats::staging::Folder::new_in(file.parent().unwrap_or(Path::new(".")))?;
    let staged = hidden.path().join("report");
    fs::write(&staged, text)?;
    fs::rename(staged, file)
}

/// Adds the budgets that a result exceeds.
pub(super) fn over_budget(mut row: Row, job: &Job) -> Row {
    let bytes = row.output_bytes.zip(job.budget.output_bytes).filter(|(bytes, most)| bytes > most);
    row.over_budget =
        bytes.map(|(bytes, most)| format!("the output has {bytes} bytes, {most} are allowed")).into_iter().collect();
    row
}
