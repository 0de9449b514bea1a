//! What the frames of each policy come to.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde::Serialize;

use super::rows::{MotionRow, Setup};
use crate::lab::LabError;
use crate::motion::frames::{LastHits, RebuildEvery};
use crate::verify::check_hits::CheckedHits;
use crate::verify::{Machine, MachineKind};

/// The names of the tables of policies.
pub(in crate::lab) const SUMMARIES: [&str; 2] = ["motion.jsonl", "motion.md"];

/// All frames of one policy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PolicySummary {
    /// What was traced.
    #[serde(flatten)]
    pub setup: Setup,
    /// The policy.
    pub rebuild_every: RebuildEvery,
    /// Number of frames.
    pub frames: u32,
    /// Frames in which the TLAS was built anew.
    pub rebuilds: u32,
    /// Median of the milliseconds to compute the matrices on the CPU.
    pub matrices_ms: f64,
    /// Mean of the milliseconds to hand them to the tracer.
    pub upload_ms: f64,
    /// Median of the milliseconds of a refit; `None` if there was none.
    pub refit_ms: Option<f64>,
    /// Median of the milliseconds of a rebuild.
    pub rebuild_ms: Option<f64>,
    /// Mean of the milliseconds to refit or rebuild the BLASes of what deforms.
    pub blas_ms: f64,
    /// Mean of the milliseconds of refits and rebuilds.
    pub upkeep_ms: f64,
    /// Mean of the milliseconds to trace all rays of a frame.
    pub trace_ms: f64,
    /// Sum of `upload_ms`, `blas_ms`, `upkeep_ms` and `trace_ms`.
    pub frame_ms: f64,
    /// Whether no policy of the same setup takes less per frame.
    pub is_fastest: bool,
    /// Speed over that through a TLAS built in each frame: geometric mean over frames and kinds of rays.
    pub speed_over_fresh_ratio: Option<f64>,
    /// The same over the last eighth of the frames.
    pub last_speed_over_fresh_ratio: Option<f64>,
    /// Steps over those in a TLAS built anew, in the last frame.
    pub last_work_over_fresh_ratio: Option<f64>,
    /// Largest bytes of the TLAS.
    pub tlas_bytes: u64,
    /// Bytes allocated on the device after the first frame and after the last one.
    pub device_bytes: Option<[u64; 2]>,
    /// The hits of the last frame, held against the true ones.
    pub hits: CheckedHits,
}

/// Collects the frames of a setup.
pub(in crate::lab) struct Summary {
    policies: Vec<(RebuildEvery, Vec<MotionRow>)>,
}

impl Summary {
    pub(in crate::lab) fn new(policies: &[RebuildEvery]) -> Summary {
        Summary { policies: policies.iter().map(|policy| (*policy, Vec::new())).collect() }
    }

    pub(in crate::lab) fn add(&mut self, row: &MotionRow) {
        let of_policy = self.policies.iter_mut().find(|(policy, _)| *policy == row.rebuild_every);
        of_policy.into_iter().for_each(|(_, rows)| rows.push(row.clone()));
    }

    /// Returns the summaries in the order of the policies.
    pub(in crate::lab) fn finish(&self, last: &[LastHits]) -> Vec<PolicySummary> {
        let hits = |policy| last.iter().find(|last| last.policy == policy).map_or_else(Default::default, |l| l.hits);
        let of = |(policy, rows): &(RebuildEvery, Vec<MotionRow>)| {
            rows.first().map(|first| summarise(*policy, &first.setup, rows, hits(*policy)))
        };
        let mut summaries: Vec<PolicySummary> = self.policies.iter().filter_map(of).collect();
        let least = summaries.iter().map(|s| s.frame_ms).fold(f64::INFINITY, f64::min);
        summaries.iter_mut().for_each(|s| s.is_fastest = s.frame_ms <= least);
        summaries
    }
}

fn summarise(policy: RebuildEvery, setup: &Setup, rows: &[MotionRow], hits: CheckedHits) -> PolicySummary {
    let mean = |of: &dyn Fn(&MotionRow) -> f64| rows.iter().map(of).sum::<f64>() / rows.len() as f64;
    let upkeep = |row: &MotionRow| row.refit_ms.or(row.rebuild_ms).unwrap_or(0.0);
    let late = &rows[rows.len() - rows.len().div_ceil(8)..];
    let bytes = |row: &MotionRow| row.device_bytes;
    PolicySummary {
        setup: setup.clone(),
        rebuild_every: policy,
        frames: rows.len() as u32,
        rebuilds: rows.iter().filter(|row| row.rebuild_ms.is_some()).count() as u32,
        matrices_ms: median(rows.iter().map(|row| row.matrices_ms)).unwrap_or(0.0),
        upload_ms: mean(&|row| row.upload_ms),
        refit_ms: median(rows.iter().filter_map(|row| row.refit_ms)),
        rebuild_ms: median(rows.iter().filter_map(|row| row.rebuild_ms)),
        blas_ms: mean(&|row| row.blas_ms),
        upkeep_ms: mean(&upkeep),
        trace_ms: mean(&|row| row.trace_ms),
        frame_ms: mean(&|row| row.upload_ms + row.blas_ms + upkeep(row) + row.trace_ms),
        is_fastest: false,
        speed_over_fresh_ratio: speed_ratio(rows),
        last_speed_over_fresh_ratio: speed_ratio(late),
        last_work_over_fresh_ratio: rows.last().and_then(|row| row.work_over_fresh_ratio),
        tlas_bytes: rows.iter().map(|row| row.tlas_bytes).max().unwrap_or(0),
        device_bytes: rows.first().and_then(bytes).zip(rows.last().and_then(bytes)).map(<[u64; 2]>::from),
        hits,
    }
}

/// Returns the geometric mean of speeds over those through a TLAS built anew.
fn speed_ratio(rows: &[MotionRow]) -> Option<f64> {
    let ratios = rows.iter().flat_map(|row| row.kinds.values()).filter_map(|kind| kind.speed_over_fresh_ratio);
    let logarithms: Vec<f64> = ratios.filter(|ratio| *ratio > 0.0).map(f64::ln).collect();
    (!logarithms.is_empty()).then(|| (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp())
}

fn median(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() % 2 {
        _ if sorted.is_empty() => None,
        0 => Some(0.5 * (sorted[middle - 1] + sorted[middle])),
        _ => Some(sorted[middle]),
    }
}

impl PolicySummary {
    /// Returns what is wrong with the hits, in words.
    pub(super) fn fault(&self) -> Option<String> {
        let Setup { scene, layout, instances, .. } = &self.setup;
        (self.hits.wrong > 0).then(|| {
            format!(
                "{scene}, {layout}, {instances} instances, rebuilt every {}: {} of {} rays of the last frame hit \
                 something else than they should",
                self.rebuild_every, self.hits.wrong, self.hits.rays
            )
        })
    }
}

/// Returns the table of policies as Markdown.
pub(super) fn markdown(summaries: &[PolicySummary], machine: &Machine) -> String {
    let (device, kind) = machine.name();
    let mut text = format!("# Refitting against rebuilding on {device} ({})\n\n", kind.name());
    if kind != MachineKind::Gpu {
        text += "These were not timed on a GPU and say nothing of one.\n\n";
    }
    text += "Milliseconds per frame; refit and rebuild are medians, the rest means. The fastest policy of each setup is \
             bold. `speed` is that of tracing over the speed through a TLAS built in each frame: over all frames, and over \
             the last eighth of them; `work` is the work of rays over that in a TLAS built anew, in the last frame.\n\n\
             | scene | layout | instances | rebuilt every | upload | BLAS | refit | rebuild | upkeep | trace | frame | speed | \
             late speed | late work | TLAS MB | wrong hits |\n\
             | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";
    summaries.iter().for_each(|summary| line(&mut text, summary));
    text
}

fn line(text: &mut String, of: &PolicySummary) {
    let Setup { scene, layout, instances, .. } = &of.setup;
    let (bold, some) =
        (if of.is_fastest { "**" } else { "" }, |x: Option<f64>| x.map_or("–".into(), |x| format!("{x:.3}")));
    let _ = writeln!(
        text,
        "| {scene} | {layout} | {instances} | {bold}{}{bold} | {:.3} | {:.3} | {} | {} | {:.3} | {:.3} | {bold}{:.3}{bold} | {} | {} | \
         {} | {:.2} | {} |",
        of.rebuild_every,
        of.upload_ms,
        of.blas_ms,
        some(of.refit_ms),
        some(of.rebuild_ms),
        of.upkeep_ms,
        of.trace_ms,
        of.frame_ms,
        some(of.speed_over_fresh_ratio),
        some(of.last_speed_over_fresh_ratio),
        some(of.last_work_over_fresh_ratio),
        of.tlas_bytes as f64 * 1e-6,
        of.hits.wrong,
    );
}

/// Writes the tables of policies.
pub(super) fn write(out: &Path, summaries: &[PolicySummary], text: &str) -> Result<(), LabError> {
    let failed = |name: &str, e: &dyn std::fmt::Display| LabError::file(&out.join(name), e.to_string());
    let [lines, markdown] = SUMMARIES;
    let json: Result<Vec<String>, _> = summaries.iter().map(serde_json::to_string).collect();
    let json = json.map_err(|e| failed(lines, &e))?;
    let json: String = json.into_iter().map(|line| line + "\n").collect();
    fs::write(out.join(lines), json).map_err(|e| failed(lines, &e))?;
    fs::write(out.join(markdown), text).map_err(|e| failed(markdown, &e))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(policy: RebuildEvery, frame: u32, [upkeep, trace]: [f64; 2]) -> MotionRow {
        let refit = policy != RebuildEvery::Frames(1) && frame > 0;
        MotionRow {
            rebuild_every: policy,
            frame,
            upload_ms: 1.0,
            refit_ms: refit.then_some(upkeep),
            rebuild_ms: (!refit).then_some(upkeep),
            trace_ms: trace,
            ..MotionRow::default()
        }
    }

    #[test]
    fn the_fastest_policy_takes_least_per_frame() {
        let policies = [RebuildEvery::Frames(1), RebuildEvery::Never];
        let mut summary = Summary::new(&policies);
        for (frame, times) in [(0, [8.0, 5.0]), (1, [8.0, 5.0]), (2, [6.0, 5.0])] {
            summary.add(&row(policies[0], frame, times));
        }
        for (frame, times) in [(0, [8.0, 5.0]), (1, [1.0, 6.0]), (2, [2.0, 7.0])] {
            summary.add(&row(policies[1], frame, times));
        }
        let hits = CheckedHits { rays: 10, wrong: 2, ..CheckedHits::default() };
        let [fresh, never] = &summary.finish(&[LastHits { policy: RebuildEvery::Never, hits }])[..] else {
            panic!("two policies");
        };
        assert_eq!((fresh.refit_ms, fresh.rebuild_ms, fresh.upload_ms), (None, Some(8.0), 1.0));
        assert!((fresh.frame_ms - (1.0 + 22.0 / 3.0 + 5.0)).abs() < 1e-12);
        assert_eq!((never.refit_ms, never.rebuild_ms, never.upkeep_ms), (Some(1.5), Some(8.0), 11.0 / 3.0));
        assert!(never.is_fastest && !fresh.is_fastest);
        assert_eq!(fresh.fault(), None);
        assert!(
            never
                .fault()
                .expect("a fault")
                .ends_with("2 of 10 rays of the last frame hit something else than they should")
        );
    }
}
