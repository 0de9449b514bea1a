//! Dependencies: they conform to `deny.toml`, and none needs a newer Rust than `rust-version`.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// A table of `deny.toml`.
fn deny(table: &str) -> toml::Table {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("deny.toml")).expect("deny.toml");
    let mut all: toml::Table = text.parse().expect("TOML");
    let Some(toml::Value::Table(table)) = all.remove(table) else { panic!("no table {table}") };
    table
}

fn strings(list: &toml::Value) -> Vec<&str> {
    list.as_array().into_iter().flatten().filter_map(toml::Value::as_str).collect()
}

/// All packages of the workspace and their dependencies, as listed by `cargo metadata`.
fn packages() -> Vec<Value> {
    let graph = deny("graph");
    let mut command = Command::new(env!("CARGO"));
    command.args(["metadata", "--offline", "--locked", "--all-features", "--format-version", "1"]);
    command.arg("--manifest-path").arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml"));
    for target in strings(&graph["targets"]) {
        command.args(["--filter-platform", target]);
    }
    let output = command.output().expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let Value::Array(packages) = metadata["packages"].take() else { panic!("no packages") };
    assert!(packages.len() > 20, "{} packages", packages.len());
    packages
}

fn text<'a>(package: &'a Value, key: &str) -> &'a str {
    package[key].as_str().unwrap_or_default()
}

/// Whether the allowed licences satisfy a licence expression without nested parentheses.
fn is_allowed(expression: &str, allowed: &[&str]) -> bool {
    let one_of = |words: &str| {
        let words = words.trim().trim_start_matches('(').trim_end_matches(')');
        words.replace('/', " OR ").split(" OR ").any(|licence| allowed.contains(&licence.trim()))
    };
    expression.split(" AND ").all(one_of)
}

#[test]
fn every_licence_is_on_the_list_and_the_list_is_no_longer_than_needed() {
    let licenses = deny("licenses");
    let allowed = strings(&licenses["allow"]);
    let packages = packages();
    for package in &packages {
        let licence = text(package, "license");
        assert!(is_allowed(licence, &allowed), "{}: `{licence}`", text(package, "name"));
    }
    for licence in &allowed {
        let others: Vec<&str> = allowed.iter().filter(|other| *other != licence).copied().collect();
        assert!(packages.iter().any(|p| !is_allowed(text(p, "license"), &others)), "{licence} is not needed");
    }
}

#[test]
fn no_dependency_has_two_versions_but_those_on_the_list() {
    let bans = deny("bans");
    let skipped = bans["skip"].as_array().into_iter().flatten().filter_map(|entry| entry["crate"].as_str());
    let skipped: Vec<&str> = skipped.collect();
    let mut versions: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    let packages = packages();
    for package in &packages {
        let (name, version) = (text(package, "name"), text(package, "version"));
        versions.entry(name).or_default().push(format!("{name}@{version}"));
    }
    let is_skipped = |version: &String| skipped.contains(&version.as_str());
    for doubled in versions.values().filter(|v| v.len() > 1) {
        assert!(doubled.iter().filter(|v| !is_skipped(v)).count() <= 1, "{doubled:?}");
    }
    for skip in skipped {
        let found = versions.values().any(|v| v.len() > 1 && v.iter().any(|v| v == skip));
        assert!(found, "{skip} is skipped but has no second version");
    }
}

#[test]
fn no_dependency_needs_a_newer_rust() {
    let number = |version: &str| -> Vec<u32> { version.split('.').filter_map(|part| part.parse().ok()).collect() };
    let ours = number(env!("CARGO_PKG_RUST_VERSION"));
    for package in &packages() {
        let theirs = text(package, "rust_version");
        assert!(number(theirs) <= ours, "{} needs Rust {theirs}", text(package, "name"));
    }
}
