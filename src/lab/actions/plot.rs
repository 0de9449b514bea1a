//! The action `plot`.

use std::fs;
use std::path::Path;

use super::ActionsResult;
use super::config::{Actions, Listed, Metadata, PlotKeys, PlotType};
use crate::lab::LabError;
use crate::lab::bench::{RunRow, read_rows};
use crate::lab::plot::{Bar, BarChart, Drawing, LineChart};

/// A row as columns.
type Columns = Vec<(String, String)>;

/// Draws the rows of earlier actions and of tables.
///
/// # Errors
/// Fails if a table cannot be read, no row is left, a column is missing, or a file cannot be written.
pub(super) fn plot(
    keys: &PlotKeys,
    action: &Listed,
    config: &Actions,
    result: &mut ActionsResult,
) -> Result<(), LabError> {
    let folder = config.path.parent().unwrap_or(Path::new(""));
    let mut rows = result.rows.clone();
    for log in &keys.logs {
        rows.extend(read_rows(&folder.join(log))?);
    }
    let is_shown = |row: &RunRow| {
        let listed = |names: &[String], name: &String| names.is_empty() || names.contains(name);
        listed(&keys.scenes, &row.scene) && listed(&keys.envs, &row.environment)
    };
    let rows: Vec<Columns> = rows.iter().filter(|row| is_shown(row)).map(RunRow::columns).collect();
    let Metadata { output, value_data, x_data, series_data, .. } = &keys.plot_metadata;
    let columns = [x_data.as_deref().unwrap_or("scene"), series_data.as_deref().unwrap_or("environment"), value_data];
    let table = Table::of(&rows, columns).map_err(|cause| config.error(action, cause))?;
    if output.is_empty() || output.contains(['/', '\\']) {
        return Err(config.error(action, format!("`output` is `{output}`, not the name of a file")));
    }
    fs::create_dir_all(&result.out).map_err(|e| LabError::file(&result.out, e))?;
    match keys.plot_type {
        PlotType::Bar => table.bars(&keys.plot_metadata, columns).write(&result.out, output)?,
        PlotType::Line => table.lines(&keys.plot_metadata, columns).write(&result.out, output)?,
    }
    result.figures.extend(["svg", "png"].map(|end| result.out.join(format!("{output}.{end}"))));
    Ok(())
}

/// Values by place and series.
struct Table {
    places: Vec<String>,
    series: Vec<String>,
    /// For each place and series.
    values: Vec<Vec<Option<f64>>>,
    devices: Vec<String>,
}

impl Table {
    /// Arranges rows by their columns of places, series and values.
    ///
    /// # Errors
    /// Names the column that is missing, or that is not numbers.
    fn of(rows: &[Columns], [place, series, value]: [&str; 3]) -> Result<Table, String> {
        let first = rows.first().ok_or("there are no rows to show")?;
        let cell = |row: &Columns, column: &str| {
            let found = row.iter().find(|(name, _)| name == column || *name == format!("setting_{column}"));
            found.map(|(_, value)| value.clone())
        };
        let is_missing = |column: &&str| rows.iter().all(|row| cell(row, column).is_none());
        if let Some(missing) = [place, series, value].into_iter().find(is_missing) {
            let names: Vec<&str> = first.iter().map(|(name, _)| name.as_str()).collect();
            return Err(format!("there is no column `{missing}`; there are {}", names.join(", ")));
        }
        let of = |column: &str| unique(rows.iter().map(|row| cell(row, column).unwrap_or_default()));
        let (places, all_series) = (of(place), of(series));
        let mut values = vec![vec![None; all_series.len()]; places.len()];
        for row in rows {
            let at = |names: &[String], column| {
                let name = cell(row, column).unwrap_or_default();
                names.iter().position(|known| *known == name)
            };
            let (Some(p), Some(s)) = (at(&places, place), at(&all_series, series)) else { continue };
            let text = cell(row, value).unwrap_or_default();
            values[p][s] = match text.parse::<f64>() {
                Ok(number) => Some(number.max(0.0)),
                Err(_) if text.is_empty() => None,
                Err(_) => return Err(format!("`{value}` holds `{text}`, which is not a number")),
            };
        }
        Ok(Table { places, series: all_series, values, devices: of("device") })
    }

    fn bars(&self, of: &Metadata, [place, series, value]: [&str; 3]) -> BarChart {
        let bar = |value: &Option<f64>| value.map(|value| Bar { value, spread: 0.0 });
        BarChart {
            title: of.title.clone(),
            unit: of.y_label.clone().unwrap_or(value.to_owned()),
            group_axis: of.x_label.clone().unwrap_or(place.to_owned()),
            groups: self.places.clone(),
            heading: series.to_owned(),
            series: self.series.clone(),
            bars: self.values.iter().map(|values| values.iter().map(bar).collect()).collect(),
            notes: self.devices.clone(),
        }
    }

    fn lines(&self, of: &Metadata, [place, series, value]: [&str; 3]) -> LineChart {
        let line = |(s, name): (usize, &String)| (name.clone(), self.values.iter().map(|values| values[s]).collect());
        LineChart {
            title: of.title.clone(),
            unit: of.y_label.clone().unwrap_or(value.to_owned()),
            place_axis: of.x_label.clone().unwrap_or(place.to_owned()),
            places: self.places.clone(),
            heading: series.to_owned(),
            series: self.series.iter().enumerate().map(line).collect(),
            notes: self.devices.clone(),
        }
    }
}

/// Returns each text once, in the order of their first occurrence.
fn unique(texts: impl Iterator<Item = String>) -> Vec<String> {
    let mut all = Vec::new();
    texts.for_each(|text| {
        if !all.contains(&text) {
            all.push(text);
        }
    });
    all
}
