//! Findings as SARIF: OASIS, "Static Analysis Results Interchange Format (SARIF) Version 2.1.0", 2020. Section numbers are
//! those of the standard.

use std::path::Path;

use serde_json::{Value, json};

use super::{Finding, Rule};
use crate::report::json::to_json;

/// The schema that the standard names.
const SCHEMA: &str = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json";

/// Returns findings about a file as a SARIF log of one run, with all rules that were checked.
pub fn to_sarif(input: &Path, findings: &[Finding]) -> String {
    let driver = json!({
        "name": "Raykiln",
        "semanticVersion": env!("CARGO_PKG_VERSION"),
        "rules": Rule::ALL.map(rule),
    });
    let artifact = json!({"location": {"uri": uri(input)}});
    let results: Vec<Value> = findings.iter().map(|finding| result(input, finding)).collect();
    to_json(&json!({
        "$schema": SCHEMA,
        "version": "2.1.0",
        "runs": [{
            "tool": {"driver": driver},
            "artifacts": [artifact],
            "columnKind": "unicodeCodePoints",
            "results": results,
        }],
    }))
}

/// A `reportingDescriptor` (3.49).
fn rule(rule: Rule) -> Value {
    json!({
        "id": rule.id(),
        "shortDescription": {"text": rule.title()},
        "fullDescription": {"text": sentence(rule.asks())},
        "help": {"text": format!("{} Source: {}.", sentence(&format!("By hand: {}", rule.by_hand())), rule.source())},
        "defaultConfiguration": {"level": rule.severity().name()},
    })
}

/// A `result` (3.27). Objects are logical locations in the file.
fn result(input: &Path, finding: &Finding) -> Value {
    let Finding { rule, severity, message, cost, by_hand, by_bake, count, gone_after, .. } = finding;
    let parts =
        [message.clone(), format!("Costs: {}", cost.text), format!("By hand: {by_hand}"), format!("Bake: {by_bake}")];
    let objects: Vec<Value> = finding.objects.iter().map(|name| json!({"name": name, "kind": "object"})).collect();
    let place = json!({"artifactLocation": {"uri": uri(input), "index": 0}});
    let location = match objects.as_slice() {
        [] => json!({"physicalLocation": place}),
        _ => json!({"physicalLocation": place, "logicalLocations": objects}),
    };
    json!({
        "ruleId": rule.id(),
        "ruleIndex": Rule::ALL.iter().position(|one| one == rule),
        "level": severity.name(),
        "message": {"text": parts.map(|part| sentence(&part)).join(" ")},
        "locations": [location],
        "properties": {"count": count, "cost": cost, "byHand": by_hand, "byBake": by_bake,
            "goneAfter": gone_after},
    })
}

/// A text with a capital letter and a full stop, as the standard asks for (3.11.3).
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|letter| letter.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", letters.as_str())
}

/// A path as a URI reference (3.4.3): relative paths stay relative; bytes outside RFC 3986's unreserved characters and the
/// slash are escaped.
fn uri(path: &Path) -> String {
    let text = path.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte);
    let escape = |byte: u8| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") };
    let escaped: String = text.bytes().map(escape).collect();
    if path.is_absolute() { format!("file://{escaped}") } else { escaped }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Broken, Objects};

    #[test]
    fn paths_become_uri_references() {
        assert_eq!(uri(Path::new("my scenes/50%: a#b.glb")), "my%20scenes/50%25%3A%20a%23b.glb");
        assert_eq!(uri(Path::new("/tmp/é.glb")), "file:///tmp/%C3%A9.glb");
    }

    #[test]
    fn a_result_names_rule_level_and_objects() {
        let objects: Objects = ["pin \u{202e}\u{7}<b>"; 3].into_iter().collect();
        let finding = Finding::new(objects, &Broken::Tiny { ratio: 1e-5, bytes: 512 });
        let log: Value = serde_json::from_str(&to_sarif(Path::new("a.glb"), &[finding])).expect("JSON");
        let result = &log["runs"][0]["results"][0];
        assert_eq!(
            (&result["ruleId"], &result["ruleIndex"], &result["level"]),
            (&json!("RK016"), &json!(15), &json!("note"))
        );
        let logical = &result["locations"][0]["logicalLocations"];
        assert_eq!(logical, &json!([{"name": "pin \u{202e}\u{7}<b>", "kind": "object"}]));
        assert_eq!(log["runs"][0]["tool"]["driver"]["rules"].as_array().map(Vec::len), Some(Rule::ALL.len()));
    }
}
