//! The page and the figures from rows that an earlier run wrote: nothing is measured.

use std::fs;
use std::path::Path;

use super::measured::{Crowded, Measured, standing_for};
use super::numbers::{Edition, SAN_MIGUEL, SCENES, SIBENIK};
use super::scenes::{Found, SAMPLE};
use super::trials::Trial;
use super::{ThesisResult, crowds, failures_of, page, pictures};
use crate::lab::LabError;
use crate::lab::bench::{RUN_TABLES, RunRow, read_rows};
use crate::report::study::{Figure, Picture};

/// Writes figures and page again from the rows in a folder. Pictures that are there are kept.
///
/// # Errors
/// Fails if the rows cannot be read or are not of these experiments, or a file cannot be written.
pub fn redraw(out: &Path) -> Result<ThesisResult, LabError> {
    let table = out.join(RUN_TABLES[1]);
    let rows = read_rows(&table)?;
    if rows.is_empty() {
        return Err(LabError::file(&table, "there are no rows to draw"));
    }
    let mut result = ThesisResult { rows: rows.len(), ..ThesisResult::default() };
    let mut measured: Vec<Measured> = Vec::new();
    for row in rows {
        result.failures.extend(failures_of(&row));
        let known = measured.iter().position(|scene| scene.found.name == row.scene);
        let at = known.unwrap_or_else(|| {
            measured.push(Measured { found: found(&row), trials: Vec::new(), crowds: Vec::new() });
            measured.len() - 1
        });
        add(&mut measured[at], row).map_err(|row| {
            LabError::file(&table, format!("`{}` is not a run of the thesis's experiments", row.environment))
        })?;
    }
    let drawn = kept(&measured, &out.join(page::FIGURES))?;
    result.page = page::write(&measured, drawn, &result.failures, out)?;
    Ok(result)
}

/// Returns the scene of a row.
fn found(row: &RunRow) -> Found {
    let of = SCENES.iter().position(|scene| scene.name == row.scene);
    let edition_of =
        |of: usize| SCENES[of].files.iter().find(|(file, _)| *file == row.model).map(|(_, edition)| *edition);
    let edition = of.map_or(SAMPLE, |of| edition_of(of).unwrap_or(Edition::Same));
    Found { of, name: row.scene.clone(), edition, model: row.model.clone(), file: Default::default() }
}

/// Adds a row to those of its scene.
///
/// # Errors
/// Returns a row that is not of these experiments.
fn add(scene: &mut Measured, row: RunRow) -> Result<(), Box<RunRow>> {
    let named = |name: &str| Trial::all().into_iter().find(|trial| trial.name() == name);
    if let Some(trial) = named(&row.environment) {
        scene.trials.push((trial, row));
        return Ok(());
    }
    let of_crowd = row.environment.strip_suffix(&crowds::suffix(row.added_instances as usize)).map(str::to_owned);
    let trial = of_crowd.and_then(|name| if name == crowds::ALONE { Some(None) } else { named(&name).map(Some) });
    match trial {
        Some(trial) => scene.crowds.push(Crowded { instances: row.added_instances as usize, trial, row }),
        None => return Err(Box::new(row)),
    }
    Ok(())
}

/// Returns the pictures of figures 5.2 and 5.6 that a folder has.
fn kept(measured: &[Measured], folder: &Path) -> Result<Vec<Figure>, LabError> {
    let name = |of: usize| standing_for(of, measured).map_or("", |scene| &scene.found.name);
    let fragments = pictures::FRAGMENTS.iter().map(|fragment| fragment.titled(name(SAN_MIGUEL)));
    let crowded = crowds::counts(measured).into_iter().map(|count| pictures::title_of_crowd(name(SIBENIK), count));
    let mut figures = Vec::new();
    for (file, caption) in fragments.chain(crowded) {
        let path = folder.join(&file);
        if path.is_file() {
            let bytes = fs::read(&path).map_err(|e| LabError::file(&path, e))?;
            figures.push(Figure { caption, file, content: Picture::Png(bytes) });
        }
    }
    Ok(figures)
}
