//! Reports that come from a cache, and what is said about it.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use super::json::to_json;
use super::words::{bytes, counted};
use crate::cache::Contents;

/// What a report in a cache says.
#[derive(Debug, Deserialize)]
struct Known {
    verdict: String,
    verdict_reason: String,
}

/// Returns a JSON report that was stored by another bake of the same content, with the names of the files of this bake;
/// `None` if it is not a report.
pub fn renamed(report: &str, input: &Path, output: &Path) -> Option<String> {
    let mut report: Value = serde_json::from_str(report).ok()?;
    *report.get_mut("input")?.get_mut("path")? = input.to_string_lossy().into();
    *report.get_mut("output")? = output.to_string_lossy().into();
    Some(to_json(&report))
}

/// The text for a bake whose result was in the cache.
pub fn hit(report: &str, input: &Path, output: &Path) -> String {
    let known =
        serde_json::from_str::<Known>(report).map(|known| format!("{}: {}", known.verdict, known.verdict_reason));
    let verdict = known.unwrap_or_else(|_| "not reported".into());
    format!("{} -> {}\nfrom the cache\n\nverdict: {verdict}\n", input.display(), output.display())
}

/// What a cache holds.
pub fn contents(contents: &Contents) -> String {
    format!("{}, {}", counted(contents.entries, "result"), bytes(contents.bytes))
}

/// The text of `cache verify`.
pub fn verified(left: &Contents, damaged: &[PathBuf]) -> String {
    let list: String = damaged.iter().map(|file| format!("removed, as it is damaged: {}\n", file.display())).collect();
    format!("{list}{} as they were stored\n", contents(left))
}

/// The text of `cache clean`.
pub fn cleaned(removed: &Contents, left: &Contents) -> String {
    format!("removed {}; left {}\n", contents(removed), contents(left))
}
