//! What a batch of bakes did: a row per asset, and the summary of all.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::words::{bytes, counted};
use super::{FailOn, NoSuchRule, Rule, Severity};

/// How a batch came by the result of an asset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// It was baked.
    Baked,
    /// It was taken from the cache.
    Cached,
    /// It was in place already.
    Unchanged,
    /// There is none, because the bake failed.
    Failed,
    /// There is none, because nothing baked the asset as it is now.
    Missing,
}

impl Status {
    /// All of them.
    pub const ALL: [Status; 5] = [Status::Baked, Status::Cached, Status::Unchanged, Status::Failed, Status::Missing];

    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Status::Baked => "baked",
            Status::Cached => "cached",
            Status::Unchanged => "unchanged",
            Status::Failed => "failed",
            Status::Missing => "missing",
        }
    }

    /// Whether there is no result.
    pub fn is_without_result(self) -> bool {
        matches!(self, Status::Failed | Status::Missing)
    }
}

/// A finding about an asset, in short.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RowFinding {
    /// The id of the rule.
    pub rule: String,
    /// How much it matters: `note`, `warning` or `error`.
    pub severity: String,
}

/// What a batch did with one asset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Row {
    /// The asset: its path below the folder that is mirrored.
    pub asset: String,
    /// The output: its path below the folder of outputs.
    pub output: String,
    /// How the result was come by.
    pub status: Status,
    /// The verdict of the bake; `None` if it did not get that far.
    pub verdict: Option<String>,
    /// Why: the reason of the verdict, or the error.
    pub reason: String,
    /// The candidate that was written.
    pub method: Option<String>,
    /// Triangles of the input.
    pub triangles: Option<u64>,
    /// Size of the input, in bytes.
    pub input_bytes: Option<u64>,
    /// Size of the output, in bytes.
    pub output_bytes: Option<u64>,
    /// Predicted size of the acceleration structures of the input, in bytes.
    pub as_bytes_before: Option<u64>,
    /// Predicted size of the acceleration structures of the output, in bytes.
    pub as_bytes_after: Option<u64>,
    /// The speed of the output over that of the input, as the bake measured it.
    pub speedup_ratio: Option<f64>,
    /// Uncertainty of `speedup_ratio`.
    pub spread_ratio: Option<f64>,
    /// Duration of the bake that made the result, in seconds.
    pub seconds: Option<f64>,
    /// Peak memory of that bake, in bytes.
    pub peak_memory_bytes: Option<u64>,
    /// The vendor rules that the input breaks.
    pub findings: Vec<RowFinding>,
    /// What the reader repaired or left out.
    pub warnings: Vec<String>,
    /// Reports of this asset: their paths below the folder of outputs.
    pub reports: Vec<String>,
    /// The budgets that are exceeded, in words.
    pub over_budget: Vec<String>,
}

/// What a row takes from the JSON report of a bake.
#[derive(Deserialize)]
struct Reported {
    verdict: String,
    verdict_reason: String,
    method: ReportedMethod,
    input: ReportedInput,
    size: ReportedSize,
    overall: ReportedSpeed,
    seconds: ReportedSeconds,
    peak_memory_bytes: Option<u64>,
    output_bytes: u64,
    findings: Vec<RowFinding>,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
struct ReportedMethod {
    chosen_candidate: String,
}

#[derive(Deserialize)]
struct ReportedInput {
    triangles: u64,
    bytes: Option<u64>,
}

#[derive(Deserialize)]
struct ReportedSize {
    as_bytes: ReportedSides,
}

#[derive(Deserialize)]
struct ReportedSides {
    before: u64,
    after: u64,
}

#[derive(Deserialize)]
struct ReportedSpeed {
    speedup_ratio: Option<f64>,
    spread_ratio: Option<f64>,
}

#[derive(Deserialize)]
struct ReportedSeconds {
    total: f64,
}

impl Row {
    /// A row without a result.
    pub fn without_result(asset: &str, output: &str, status: Status, reason: impl Into<String>) -> Row {
        Row {
            asset: asset.to_owned(),
            output: output.to_owned(),
            status,
            verdict: None,
            reason: reason.into(),
            method: None,
            triangles: None,
            input_bytes: None,
            output_bytes: None,
            as_bytes_before: None,
            as_bytes_after: None,
            speedup_ratio: None,
            spread_ratio: None,
            seconds: None,
            peak_memory_bytes: None,
            findings: Vec::new(),
            warnings: Vec::new(),
            reports: Vec::new(),
            over_budget: Vec::new(),
        }
    }

    /// The row of a bake's JSON report; `None` if it is not one.
    pub fn of_report(asset: &str, output: &str, status: Status, json: &str) -> Option<Row> {
        let report: Reported = serde_json::from_str(json).ok()?;
        Some(Row {
            verdict: Some(report.verdict),
            method: Some(report.method.chosen_candidate),
            triangles: Some(report.input.triangles),
            input_bytes: report.input.bytes,
            output_bytes: Some(report.output_bytes),
            as_bytes_before: Some(report.size.as_bytes.before),
            as_bytes_after: Some(report.size.as_bytes.after),
            speedup_ratio: report.overall.speedup_ratio,
            spread_ratio: report.overall.spread_ratio,
            seconds: Some(report.seconds.total),
            peak_memory_bytes: report.peak_memory_bytes,
            findings: report.findings,
            warnings: report.warnings,
            ..Row::without_result(asset, output, status, report.verdict_reason)
        })
    }

    /// Whether the output is slower than the input by more than the uncertainty.
    pub fn is_slower(&self) -> bool {
        let slower = |speedup: f64| speedup < 1.0 - self.spread_ratio.unwrap_or(f64::INFINITY);
        self.verdict.as_deref() == Some("not faster") && self.speedup_ratio.is_some_and(slower)
    }
}

/// When a batch fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// Never.
    Never,
    /// An asset has no result, or exceeds a budget.
    Failed,
    /// An output is slower than its input by more than the uncertainty.
    Slower,
    /// An input has a finding; of severity `warning` or higher also if its reader warned.
    Finding(FailOn),
}

impl FromStr for Policy {
    type Err = NoSuchPolicy;

    fn from_str(text: &str) -> Result<Policy, NoSuchPolicy> {
        Ok(match text {
            "never" => Policy::Never,
            "failed" => Policy::Failed,
            "slower" => Policy::Slower,
            _ => Policy::Finding(text.parse().map_err(|NoSuchRule| NoSuchPolicy)?),
        })
    }
}

impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Policy::Never => "never",
            Policy::Failed => "failed",
            Policy::Slower => "slower",
            Policy::Finding(FailOn::Rule(rule)) => rule.id(),
            Policy::Finding(FailOn::Severity(severity)) => severity.name(),
        })
    }
}

/// A text is not a [`Policy`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoSuchPolicy;

impl fmt::Display for NoSuchPolicy {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "must be `never`, `failed`, `slower`, or as for `inspect`: it {NoSuchRule}")
    }
}

impl std::error::Error for NoSuchPolicy {}

impl Policy {
    /// Whether a row makes the batch fail.
    pub fn is_met_by(self, row: &Row) -> bool {
        match self {
            Policy::Never => false,
            Policy::Failed => row.status.is_without_result() || !row.over_budget.is_empty(),
            Policy::Slower => row.is_slower(),
            Policy::Finding(FailOn::Rule(rule)) => row.findings.iter().any(|finding| finding.rule == rule.id()),
            Policy::Finding(FailOn::Severity(least)) => {
                let warned = least <= Severity::Warning && !row.warnings.is_empty();
                let severities = Severity::ALL.iter().filter(|severity| **severity >= least);
                let mut names = severities.map(|severity| severity.name());
                warned || names.any(|name| row.findings.iter().any(|finding| finding.severity == name))
            }
        }
    }
}

/// What a batch did.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// [`Summary::SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// Number of assets by [`Status`].
    pub counts: BTreeMap<&'static str, usize>,
    /// Number of assets by verdict.
    pub verdicts: BTreeMap<String, usize>,
    /// Number of assets whose output is slower than the input by more than the uncertainty.
    pub slower: usize,
    /// Number of assets that exceed a budget.
    pub over_budget: usize,
    /// Geometric mean of the speeds of outputs over those of inputs, over the assets that were restructured; `None` without
    /// any.
    pub mean_speedup_ratio: Option<f64>,
    /// Predicted size of the acceleration structures of all inputs, in bytes.
    pub as_bytes_before: u64,
    /// Predicted size of the acceleration structures of all outputs, in bytes.
    pub as_bytes_after: u64,
    /// Number of assets by the vendor rules that their inputs break.
    pub findings: BTreeMap<String, usize>,
    /// Sum of the durations of the bakes that this batch ran, in seconds.
    pub bake_seconds: f64,
    /// Duration of the batch, in seconds.
    pub seconds: f64,
    /// The largest sum of the memory of all processes at one time, as sampled, in bytes; `None` if nothing was baked, or the
    /// system does not report it.
    pub peak_memory_bytes: Option<u64>,
    /// A row per asset, in the order of their names.
    pub assets: Vec<Row>,
}

impl Summary {
    /// The id of its JSON Schema.
    pub const SCHEMA: &'static str = "raykiln.batch/1";

    /// Sums up rows.
    pub fn of(mut assets: Vec<Row>, seconds: f64, peak_memory_bytes: Option<u64>) -> Summary {
        assets.sort_by(|a, b| a.asset.cmp(&b.asset).then_with(|| a.output.cmp(&b.output)));
        let mut findings = BTreeMap::new();
        for row in &assets {
            let mut rules: Vec<&str> = row.findings.iter().map(|finding| finding.rule.as_str()).collect();
            rules.sort_unstable();
            rules.dedup();
            rules.iter().for_each(|rule| *findings.entry((*rule).to_owned()).or_insert(0) += 1);
        }
        let mut verdicts = BTreeMap::new();
        assets
            .iter()
            .filter_map(|row| row.verdict.clone())
            .for_each(|verdict| *verdicts.entry(verdict).or_insert(0) += 1);
        let count = |status: Status| (status.name(), assets.iter().filter(|row| row.status == status).count());
        let baked = assets.iter().filter(|row| row.status == Status::Baked);
        Summary {
            schema: Summary::SCHEMA,
            raykiln_version: env!("CARGO_PKG_VERSION"),
            counts: Status::ALL.into_iter().map(count).collect(),
            verdicts,
            slower: assets.iter().filter(|row| row.is_slower()).count(),
            over_budget: assets.iter().filter(|row| !row.over_budget.is_empty()).count(),
            mean_speedup_ratio: mean_speedup(&assets),
            as_bytes_before: assets.iter().filter_map(|row| row.as_bytes_before).sum(),
            as_bytes_after: assets.iter().filter_map(|row| row.as_bytes_after).sum(),
            findings,
            bake_seconds: baked.filter_map(|row| row.seconds).sum(),
            seconds,
            peak_memory_bytes,
            assets,
        }
    }

    /// The rows that meet a policy.
    pub fn failing<'a>(&'a self, policies: &'a [Policy]) -> impl Iterator<Item = &'a Row> {
        self.assets.iter().filter(|row| policies.iter().any(|policy| policy.is_met_by(row)))
    }

    /// The summary in a few lines; errors are listed in full.
    pub fn text(&self) -> String {
        let counts = Status::ALL.iter().filter_map(|status| {
            let count = self.counts.get(status.name()).copied().filter(|count| *count > 0)?;
            Some(format!("{count} {}", status.name()))
        });
        let counts: Vec<String> = counts.collect();
        let mut text = format!("{}: {}", counted(self.assets.len(), "asset"), counts.join(", "));
        text += &format!("; {:.1} s\n", self.seconds);
        text.extend(self.gains().map(|gains| gains + "\n"));
        for row in &self.assets {
            if row.status.is_without_result() {
                text += &format!("{}: {}: {}\n", row.asset, row.status.name(), row.reason);
            }
            text.extend(row.over_budget.iter().map(|budget| format!("{}: over budget: {budget}\n", row.asset)));
        }
        text
    }

    /// What the batch gained, in a line; nothing if nothing got a verdict.
    pub(crate) fn gains(&self) -> Option<String> {
        let verdicts: Vec<String> = self.verdicts.iter().map(|(verdict, count)| format!("{count} {verdict}")).collect();
        let slower = if self.slower > 0 { format!("; {} slower", self.slower) } else { String::new() };
        let speed =
            self.mean_speedup_ratio.map(|mean| format!("; {mean:.2} times the speed on average if restructured"));
        let (before, after) = (bytes(self.as_bytes_before), bytes(self.as_bytes_after));
        (!verdicts.is_empty()).then(|| {
            format!(
                "{}{slower}{}; acceleration structures of {after}, before {before}, as predicted",
                verdicts.join(", "),
                speed.unwrap_or_default(),
            )
        })
    }
}

/// The geometric mean over the assets that were restructured.
fn mean_speedup(assets: &[Row]) -> Option<f64> {
    let restructured = assets.iter().filter(|row| matches!(row.verdict.as_deref(), Some("faster" | "not faster")));
    let logarithms: Vec<f64> =
        restructured.filter_map(|row| row.speedup_ratio).filter(|ratio| *ratio > 0.0).map(f64::ln).collect();
    (!logarithms.is_empty()).then(|| (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp())
}

/// What happens in a batch, as it happens.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "event", rename_all = "lowercase")]
pub enum Event<'a> {
    /// The assets were found.
    Begin {
        /// Number of assets.
        assets: usize,
    },
    /// A bake was started.
    Start {
        /// The asset.
        asset: &'a str,
        /// Its predicted duration, in seconds.
        predicted_seconds: f64,
        /// Its predicted memory, in bytes.
        predicted_memory_bytes: u64,
    },
    /// A bake was ended and will be started again alone, because the memory of all bakes would have been exceeded.
    Postpone {
        /// The asset.
        asset: &'a str,
    },
    /// An asset is done.
    Done {
        /// What was done.
        row: &'a Row,
    },
    /// All assets are done.
    End {
        /// Number of assets by status.
        counts: &'a BTreeMap<&'static str, usize>,
    },
}

/// An event with its time.
#[derive(Clone, Debug, Serialize)]
pub struct TimedEvent<'a> {
    /// [`TimedEvent::SCHEMA`].
    pub schema: &'static str,
    /// Time since the start of the batch, in seconds.
    pub seconds: f64,
    /// What happened.
    #[serde(flatten)]
    pub event: Event<'a>,
}

impl TimedEvent<'_> {
    /// The id of its JSON Schema.
    pub const SCHEMA: &'static str = "raykiln.event/1";

    /// The event as a line of JSON.
    pub fn line(&self) -> String {
        let mut line = serde_json::to_string(self).expect("events hold no maps with other keys than strings");
        line.push('\n');
        line
    }
}

/// The text for a job file: how well the parts are balanced.
pub fn planned(assets: usize, shards: &[f64]) -> String {
    let (sum, most) = (shards.iter().sum::<f64>(), shards.iter().copied().fold(0.0, f64::max));
    let balance = if most > 0.0 { sum / (most * shards.len() as f64) } else { 1.0 };
    format!(
        "{} in {}; the longest is predicted to take {:.2} times the mean\n",
        counted(assets, "asset"),
        counted(shards.len(), "part"),
        1.0 / balance
    )
}

/// The title of a rule by its id; the id itself if there is no such rule.
pub(crate) fn rule_title(id: &str) -> &str {
    match Rule::by_id(id) {
        Some(rule) => rule.title(),
        None => id,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(verdict: &str, speedup: f64, spread: f64) -> Row {
        Row {
            verdict: Some(verdict.into()),
            speedup_ratio: Some(speedup),
            spread_ratio: Some(spread),
            ..Row::without_result(verdict, "out.glb", Status::Baked, "")
        }
    }

    #[test]
    fn only_a_restructured_output_is_slower() {
        assert!(row("not faster", 0.9, 0.05).is_slower());
        assert!(!row("not faster", 0.9, 0.2).is_slower());
        assert!(!row("left alone", 0.5, 0.0).is_slower());
        assert!(!Row { spread_ratio: None, ..row("not faster", 0.5, 0.0) }.is_slower());
    }

    #[test]
    fn policies_name_what_makes_a_batch_fail() {
        let failed = Row::without_result("a", "b", Status::Failed, "why");
        let large = Row { over_budget: vec!["large".into()], ..row("faster", 2.0, 0.0) };
        let warned = Row { warnings: vec!["odd".into()], ..row("faster", 2.0, 0.0) };
        let finding = RowFinding { rule: "RK006".into(), severity: "note".into() };
        let found = Row { findings: vec![finding], ..row("faster", 2.0, 0.0) };
        let met = |policy: &str, row: &Row| policy.parse::<Policy>().expect(policy).is_met_by(row);
        assert_eq!([&failed, &large, &warned].map(|row| met("failed", row)), [true, true, false]);
        assert_eq!([&failed, &large, &warned].map(|row| met("never", row)), [false; 3]);
        assert_eq!(["warning", "error", "note"].map(|policy| met(policy, &warned)), [true, false, true]);
        assert_eq!(["warning", "note", "RK006", "RK001"].map(|policy| met(policy, &found)), [false, true, true, false]);
        assert!("often".parse::<Policy>().is_err());
        for policy in ["never", "failed", "slower", "warning", "RK006"] {
            assert_eq!(policy.parse::<Policy>().expect(policy).to_string(), policy);
        }
    }

    #[test]
    fn a_summary_counts_and_averages() {
        let rows = vec![row("not faster", 0.5, 0.0), row("faster", 8.0, 0.0), row("left alone", 9.0, 0.0)];
        let summary = Summary::of(rows, 1.0, None);
        assert!(summary.mean_speedup_ratio.is_some_and(|ratio| (ratio - 2.0).abs() < 1e-12), "{summary:?}");
        assert_eq!((summary.slower, summary.counts["baked"], summary.counts["failed"]), (1, 3, 0));
        assert!(
            summary
                .text()
                .starts_with("3 assets: 3 baked; 1.0 s\n1 faster, 1 left alone, 1 not faster; 1 slower; 2.00")
        );
        assert_eq!(Summary::of(Vec::new(), 0.0, None).mean_speedup_ratio, None);
    }
}
