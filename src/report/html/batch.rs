//! The page of a batch: all assets, with links to their outputs and pages.

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, Value, context};
use serde::Serialize;

use super::write_visible;
use crate::report::batch::{Row, Status, Summary, rule_title};
use crate::report::words::{bytes, counted, grouped};

/// The most rows of the table of all assets. The JSON summary has all.
const MOST_ROWS: usize = 5000;
/// The most rows of a table of the slowest or largest.
const MOST_EXTREMES: usize = 10;

#[derive(Serialize)]
struct Table<'a> {
    id: &'static str,
    title: &'static str,
    words: String,
    rows: Vec<Shown<'a>>,
}

/// A row as it is shown.
#[derive(Serialize)]
struct Shown<'a> {
    asset: &'a str,
    /// The address of the output; `None` if there is none.
    link: Option<String>,
    /// The address of the page, if one was written.
    page: Option<String>,
    status: &'static str,
    verdict: &'a str,
    class: &'static str,
    reason: &'a str,
    speedup: String,
    structures: String,
    output: String,
    seconds: String,
    memory: String,
    findings: String,
}

/// Returns the summary of a batch as a page, which stands in the folder of outputs.
pub fn batch(summary: &Summary) -> String {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.set_formatter(write_visible);
    environment.add_template("batch", include_str!("assets/batch.html")).expect("the template is sound");
    let template = environment.get_template("batch").expect("it was added");
    let mut findings: Vec<(&str, &str, usize)> =
        summary.findings.iter().map(|(rule, count)| (rule.as_str(), rule_title(rule), *count)).collect();
    findings.sort_by_key(|(rule, _, count)| (std::cmp::Reverse(*count), *rule));
    let rendered = template.render(context! {
        version => summary.raykiln_version,
        headline => headline(summary),
        gains => summary.gains(),
        facts => facts(summary),
        tables => Value::from(Serde(&tables(summary))),
        findings => Value::from(Serde(&findings)),
        style => Value::from_safe_string(include_str!("assets/page.css").to_owned()),
        has_failed => summary.assets.iter().any(is_bad),
    });
    rendered.expect("the template names what is there")
}

fn is_bad(row: &Row) -> bool {
    row.status.is_without_result() || !row.over_budget.is_empty()
}

fn headline(summary: &Summary) -> String {
    let bad = summary.assets.iter().filter(|row| is_bad(row)).count();
    match bad {
        0 => format!("{} are baked", counted(summary.assets.len(), "asset")),
        _ => format!("{} of {} failed", grouped(bad as u64), counted(summary.assets.len(), "asset")),
    }
}

/// How many assets were done how, and what the batch took.
fn facts(summary: &Summary) -> Vec<(String, String)> {
    let counts = Status::ALL.iter().map(|status| (*status, summary.counts.get(status.name()).copied().unwrap_or(0)));
    let counts = counts.filter(|(_, count)| *count > 0);
    let counts = counts.map(|(status, count)| (grouped(count as u64), status.name().to_owned()));
    let took = (format!("{:.1} s", summary.seconds), "duration".to_owned());
    let memory = summary.peak_memory_bytes.map(|peak| (bytes(peak), "memory of all bakes at most".to_owned()));
    counts.chain([took]).chain(memory).collect()
}

fn tables(summary: &Summary) -> Vec<Table<'_>> {
    let largest_first = |key: fn(&Row) -> f64| {
        let mut rows: Vec<&Row> = summary.assets.iter().filter(|row| key(row) > 0.0).collect();
        rows.sort_by(|a, b| key(b).total_cmp(&key(a)));
        rows.truncate(MOST_EXTREMES);
        rows
    };
    let bad: Vec<&Row> = summary.assets.iter().filter(|row| is_bad(row)).collect();
    let slower: Vec<&Row> = summary.assets.iter().filter(|row| row.is_slower()).collect();
    let all: Vec<&Row> = summary.assets.iter().take(MOST_ROWS).collect();
    let more = summary.assets.len().saturating_sub(MOST_ROWS);
    let words = if more > 0 { format!("{} more are in summary.json.", grouped(more as u64)) } else { String::new() };
    let none = String::new;
    [
        ("failed", "Failed", none(), bad),
        ("slower", "Slower than before", none(), slower),
        ("slowest", "Longest bakes", none(), largest_first(|row| row.seconds.unwrap_or(0.0))),
        ("largest", "Largest outputs", none(), largest_first(|row| row.output_bytes.unwrap_or(0) as f64)),
        ("all", "All assets", words, all),
    ]
    .into_iter()
    .filter(|(.., rows)| !rows.is_empty())
    .map(|(id, title, words, rows)| Table { id, title, words, rows: rows.into_iter().map(shown).collect() })
    .collect()
}

fn shown(row: &Row) -> Shown<'_> {
    let number =
        |value: Option<f64>, digits: usize| value.map_or_else(String::new, |value| format!("{value:.digits$}"));
    let size = |value: Option<u64>| value.map_or_else(String::new, bytes);
    let is_there = !row.status.is_without_result();
    let speedup = row.speedup_ratio.filter(|_| matches!(row.verdict.as_deref(), Some("faster" | "not faster")));
    let structures = match (row.as_bytes_before, row.as_bytes_after) {
        (Some(before), Some(after)) if before > 0 => format!("{:.2}", after as f64 / before as f64),
        _ => String::new(),
    };
    let mut rules: Vec<&str> = row.findings.iter().map(|finding| finding.rule.as_str()).collect();
    rules.dedup();
    Shown {
        asset: &row.asset,
        link: is_there.then(|| address(&row.output)),
        page: row.reports.iter().find(|report| report.ends_with(".html")).map(|report| address(report)),
        status: row.status.name(),
        verdict: row.verdict.as_deref().unwrap_or_default(),
        class: match row.verdict.as_deref() {
            _ if is_bad(row) || row.is_slower() => "bad",
            Some("faster") => "good",
            _ => "plain",
        },
        reason: row.over_budget.first().map_or(&row.reason, |budget| budget),
        speedup: number(speedup, 2),
        structures,
        output: size(row.output_bytes),
        seconds: number(row.seconds, 2),
        memory: size(row.peak_memory_bytes),
        findings: rules.join(", "),
    }
}

/// The address of a file below the folder of the page, with everything escaped that has a meaning in an address or in HTML.
fn address(name: &str) -> String {
    let mut out = String::from("./");
    for byte in name.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' | b'/' => out.push(byte.into()),
            _ => out += &format!("%{byte:02X}"),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_shown_as_text_and_addresses_are_escaped() {
        let row = Row::without_result("<b>x</b>", "a b/<x>:\".glb", Status::Baked, "javascript:alert(1)");
        let failed = Row::without_result("y", "y.glb", Status::Failed, "<script>alert(2)</script>");
        // The template escapes slashes too.
        let page = batch(&Summary::of(vec![row, failed], 1.0, None)).replace("&#x2f;", "/");
        assert!(page.contains("href=\"./a%20b/%3Cx%3E%3A%22.glb\""), "{page}");
        assert!(page.contains("1 of 2 assets failed"));
        assert!(!page.contains("<b>x") && !page.contains("<script>alert"));
    }

    #[test]
    fn a_page_of_nothing_is_a_page() {
        assert!(batch(&Summary::of(Vec::new(), 0.0, None)).contains("0 assets are baked"));
    }
}
