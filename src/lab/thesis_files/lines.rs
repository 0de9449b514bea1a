//! `.scn` and `.env` files: one variable per line, `KEY=VALUE`; then a line of three numbers for the position of each
//! instance, and one of seven for the animation of each instance that moves. Empty lines and lines that begin with `#`
//! say nothing.

use std::fmt::Write;
use std::path::Path;

use super::keys::{Key, Value, numbers};
use super::{Entry, SettingsFile, Sort, keys_of};
use crate::lab::LabError;
use crate::motion::Animation;

/// Reads a file; also returns the number of comments.
pub(super) fn parse(sort: Sort, path: &Path, text: &str) -> Result<(SettingsFile, usize), LabError> {
    let mut file = SettingsFile::new(sort, path, 1);
    let mut comments = 0;
    for (line, text) in (1..).zip(text.trim_start_matches('\u{feff}').lines().map(str::trim)) {
        match text {
            "" => {}
            _ if text.starts_with('#') => comments += 1,
            _ => match text.split_once('=') {
                Some((name, value)) => add(&mut file, name.trim(), value.trim(), line)?,
                None => add_numbers(&mut file, text).map_err(|cause| file.error(line, cause))?,
            },
        }
    }
    Ok((file.checked()?, comments))
}

fn add(file: &mut SettingsFile, name: &str, text: &str, line: usize) -> Result<(), LabError> {
    let Some(key) = Key::named(file.sort, name) else {
        return Err(file.error(line, unknown(file.sort, name)));
    };
    let value = key.parse(text).map_err(|cause| file.error(line, cause))?;
    file.add(Entry { key, values: vec![value], line })
}

fn unknown(sort: Sort, name: &str) -> String {
    let names: Vec<String> = keys_of(sort).iter().map(|key| format!("`{}`", key.name)).collect();
    format!("there is no key `{name}` in .{} files; there are {}", sort.extension(), names.join(", "))
}

fn add_numbers(file: &mut SettingsFile, text: &str) -> Result<(), String> {
    if let Some(position) = numbers::<3>(text) {
        file.positions.push(position);
    } else if let Some(animation) = numbers::<7>(text) {
        file.animations.push(Animation::from_numbers(animation).map_err(|e| e.to_string())?);
    } else {
        return Err(format!("`{text}` is neither `KEY=VALUE` nor three numbers (a position) nor seven (an animation)"));
    }
    Ok(())
}

/// Writes a file as text.
///
/// # Errors
/// Names what only TOML can state.
pub(super) fn write(file: &SettingsFile) -> Result<String, LabError> {
    if let Some((name, _, line)) = file.options.first() {
        return Err(file.error(*line, format!("`{name}` cannot be stated in .{} files", file.sort.extension())));
    }
    let mut text = String::new();
    for entry in &file.entries {
        let [value] = entry.values.as_slice() else {
            let cause = format!("`{}` has several values, which .env files cannot state", entry.key.name);
            return Err(file.error(entry.line, cause));
        };
        if matches!(value, Value::Text(text) if text.contains(['\n', '\r']) || text.trim() != text) {
            let cause = format!("`{}` has line ends or blanks that a line cannot state", entry.key.name);
            return Err(file.error(entry.line, cause));
        }
        let _ = writeln!(text, "{}={value}", entry.key.name);
    }
    file.positions.iter().for_each(|numbers| add_line(&mut text, numbers));
    file.animations.iter().for_each(|animation| add_line(&mut text, &animation.to_numbers()));
    Ok(text)
}

fn add_line(text: &mut String, numbers: &[f64]) {
    let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
    let _ = writeln!(text, "{}", words.join(" "));
}
