//! Reports as JSON.

use serde::Serialize;

/// Returns a report as indented JSON with a final newline. Numbers that are not finite become `null`.
pub fn to_json(report: &impl Serialize) -> String {
    let mut json = serde_json::to_string_pretty(report).expect("reports hold no maps with other keys than strings");
    json.push('\n');
    json
}
