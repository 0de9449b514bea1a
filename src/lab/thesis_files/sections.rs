//! Scenes and environments as sections `[[scene]]` and `[[env]]` of TOML: the keys in small letters, flags as `true` and
//! `false`, and lists `positions` and `animations`. An environment may have options of methods and tracers besides, and
//! lists of values, which are swept.

use std::collections::BTreeMap;
use std::path::Path;

use toml::Spanned;

use super::keys::{Key, to_toml, vector};
use super::{Entry, SettingsFile, Sort};
use crate::lab::LabError;
use crate::lab::config::Source;
use crate::lab::error_vs_time::{Setting, Value as OptionValue};
use crate::motion::Animation;

/// A section as it is written.
pub(in crate::lab) type Section = BTreeMap<String, Spanned<toml::Value>>;

/// Options of an environment that say what is laid out and what traces, beside those that the lab sweeps elsewhere.
pub(in crate::lab) const TRACING: [&str; 4] = ["method", "tracer", "device", "blas_per"];

/// Reads the sections of a sort.
///
/// # Errors
/// Fails on the first key that is wrong; the error names file, line and cause.
pub(in crate::lab) fn read_sections(
    source: &Source<'_>,
    path: &Path,
    sort: Sort,
    sections: &[Spanned<Section>],
) -> Result<Vec<SettingsFile>, LabError> {
    sections.iter().map(|section| read_section(source, path, sort, section)).collect()
}

fn read_section(
    source: &Source<'_>,
    path: &Path,
    sort: Sort,
    section: &Spanned<Section>,
) -> Result<SettingsFile, LabError> {
    let mut file = SettingsFile::new(sort, path, source.line(Some(section.span())));
    for (name, value) in section.get_ref() {
        let line = source.line(Some(value.span()));
        let at = |cause: String| source.error(Some(value.span()), cause);
        match (name.as_str(), sort) {
            ("positions", _) => file.positions = rows(name, value.get_ref()).map_err(at)?,
            ("animations", _) => {
                let rows: Vec<[f64; 7]> = rows(name, value.get_ref()).map_err(at)?;
                file.animations = rows
                    .into_iter()
                    .map(Animation::from_numbers)
                    .collect::<Result<_, _>>()
                    .map_err(|e| at(e.to_string()))?;
            }
            _ => match Key::named(sort, &name.to_ascii_uppercase()).filter(|_| *name == name.to_ascii_lowercase()) {
                Some(key) => file.add(Entry { key, values: values(key, sort, value.get_ref()).map_err(at)?, line })?,
                None => file.options.push((name.clone(), options(name, sort, value.get_ref()).map_err(at)?, line)),
            },
        }
    }
    file.checked()
}

/// Returns the values of a key: of environments also a list.
fn values(key: &Key, sort: Sort, value: &toml::Value) -> Result<Vec<super::Value>, String> {
    match value {
        toml::Value::Array(list) if sort == Sort::Environment => match list.is_empty() {
            true => Err(format!("`{}` is an empty list", key.in_toml())),
            false => list.iter().map(|value| key.of_toml(value)).collect(),
        },
        _ => Ok(vec![key.of_toml(value)?]),
    }
}

/// Returns the values of an option that the thesis's files do not have.
fn options(name: &str, sort: Sort, value: &toml::Value) -> Result<Vec<OptionValue>, String> {
    let setting = Setting::named(name);
    if sort == Sort::Scene || setting.is_none() && !TRACING.contains(&name) {
        return Err(format!("unknown key `{name}` in `{}`", sort.section()));
    }
    let list = value.as_array().map_or(std::slice::from_ref(value), Vec::as_slice);
    let values: Option<Vec<OptionValue>> = list.iter().map(OptionValue::of).collect();
    let values = values.filter(|values| !values.is_empty());
    let values = values.ok_or_else(|| format!("`{name}` is not a value or a list of them"))?;
    match setting.and_then(|setting| values.iter().find_map(|value| setting.refusal(value))) {
        Some(why) => Err(why),
        None => Ok(values),
    }
}

fn rows<const N: usize>(name: &str, value: &toml::Value) -> Result<Vec<[f64; N]>, String> {
    let rows = value.as_array().and_then(|rows| rows.iter().map(|row| vector(row.as_array()?)).collect());
    rows.ok_or_else(|| format!("`{name}` is not a list of lists of {N} numbers"))
}

/// Writes files as sections.
pub(super) fn write(files: &[SettingsFile]) -> String {
    files.iter().map(section).collect::<Vec<_>>().join("\n")
}

fn section(file: &SettingsFile) -> String {
    let mut text = format!("[[{}]]\n", file.sort.section());
    let one = |mut values: Vec<toml::Value>| match values.len() {
        1 => values.remove(0),
        _ => toml::Value::Array(values),
    };
    for entry in &file.entries {
        let values = entry.values.iter().map(to_toml).collect();
        text += &format!("{} = {}\n", entry.key.in_toml(), one(values));
    }
    for (name, values, _) in &file.options {
        text += &format!("{name} = {}\n", one(values.iter().map(OptionValue::to_toml).collect()));
    }
    let positions = file.positions.iter().map(|row| row.as_slice().to_vec());
    let animations = file.animations.iter().map(|animation| animation.to_numbers().to_vec());
    text += &list("positions", positions.collect());
    text + &list("animations", animations.collect())
}

fn list(name: &str, rows: Vec<Vec<f64>>) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let float = |x: &f64| toml::Value::Float(*x).to_string();
    let row = |row: &Vec<f64>| format!("  [{}],\n", row.iter().map(float).collect::<Vec<_>>().join(", "));
    format!("{name} = [\n{}]\n", rows.iter().map(row).collect::<String>())
}
