//! The table of both files: structure, costs, memory and speed.

use serde::Serialize;

use crate::cost::Metrics;
use crate::report::Speed;
use crate::report::words::{bytes, grouped};
use crate::verify::speed::KindSpeed;
use crate::verify::verdict::SpeedBy;
use crate::verify::{Sides, Verification};

/// A change below this share is not shown as better or worse.
const NOTHING: f64 = 0.005;

/// A row of the table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Row {
    name: String,
    /// What it means, for readers who do not know it.
    help: &'static str,
    before: String,
    after: String,
    /// The change in words, such as `-30 %`.
    change: String,
    /// `better`, `worse` or empty.
    tone: &'static str,
}

/// Rows under a heading.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Section {
    heading: String,
    rows: Vec<Row>,
}

/// Which change is an improvement.
#[derive(Clone, Copy, PartialEq)]
enum Best {
    Less,
    More,
    Neither,
}

/// A metric of a layout: name, meaning, value, what is best, and how the value is written.
type Metric = (&'static str, &'static str, fn(&Metrics) -> f64, Best, fn(f64) -> String);

const STRUCTURE: [Metric; 5] = [
    ("groups (BLAS)", "sets of triangles that are searched as one", |m| m.mesh_groups as f64, Best::Neither, count),
    ("instances (TLAS)", "placements of groups in the scene", |m| m.instances as f64, Best::Neither, count),
    ("geometries", "parts of groups with one material each", |m| m.geometries as f64, Best::Neither, count),
    ("triangles stored", "each group counted once", |m| m.triangles_stored as f64, Best::Neither, count),
    ("triangles placed", "each instance counted", |m| m.triangles_placed as f64, Best::Neither, count),
];

const COSTS: [Metric; 5] = [
    (
        "overlap ratio",
        "how much instance boxes overlap, over the size of the scene",
        |m| m.overlap_ratio,
        Best::Less,
        three,
    ),
    (
        "overlap ratio of the core",
        "the same without sky domes and far objects",
        |m| m.core_overlap_ratio,
        Best::Less,
        three,
    ),
    (
        "boxes per surface point",
        "instance boxes around a point of a surface; 1 is best",
        |m| m.boxes_per_point_mean,
        Best::Less,
        two,
    ),
    ("SAH cost", "expected work of a ray within groups", |m| m.sah_cost, Best::Less, two),
    ("two-level cost", "the same with the work of finding the groups", |m| m.two_level_cost, Best::Less, two),
];

/// The sections of the table for both files; `files` are their sizes in bytes.
pub(super) fn of_both(
    metrics: Sides<&Metrics>,
    files: Sides<Option<u64>>,
    verification: &Verification,
    overall: &Speed,
) -> Vec<Section> {
    let speeds = Section { heading: heading_of_speed(verification), rows: speeds(verification, overall) };
    let sections = of_layouts(metrics, files, verification).into_iter().chain([speeds]);
    sections.filter(|section| !section.rows.is_empty()).collect()
}

/// The sections of the table for one file, of which both columns are the same.
pub(super) fn of_one(metrics: &Metrics, file: Option<u64>) -> Vec<Section> {
    let both = Sides { before: metrics, after: metrics };
    of_layouts(both, Sides { before: file, after: file }, &Verification::default())
}

fn of_layouts(metrics: Sides<&Metrics>, files: Sides<Option<u64>>, verification: &Verification) -> Vec<Section> {
    let row = |m: &Metric| of_metric(m, metrics);
    let is_shown = |m: &&Metric| has_core(metrics) || m.0 != "overlap ratio of the core";
    vec![
        Section { heading: "Structure".into(), rows: STRUCTURE.iter().map(row).collect() },
        Section {
            heading: "Cost of tracing, predicted".into(),
            rows: COSTS.iter().filter(is_shown).map(row).collect(),
        },
        Section { heading: "Memory".into(), rows: memory(metrics, files, verification) },
    ]
}

/// Whether the core differs from the scene in either file.
fn has_core(metrics: Sides<&Metrics>) -> bool {
    [metrics.before, metrics.after].iter().any(|m| m.core_overlap_ratio != m.overlap_ratio)
}

fn of_metric(&(name, help, value, best, written): &Metric, metrics: Sides<&Metrics>) -> Row {
    compared(name, help, metrics.map(value), best, written)
}

fn compared(
    name: impl Into<String>,
    help: &'static str,
    Sides { before, after }: Sides<f64>,
    best: Best,
    written: fn(f64) -> String,
) -> Row {
    let change = if before > 0.0 { after / before - 1.0 } else { 0.0 };
    let tone = match best {
        _ if change.abs() < NOTHING => "",
        Best::Neither => "",
        Best::Less => {
            if change < 0.0 {
                "better"
            } else {
                "worse"
            }
        }
        Best::More => {
            if change > 0.0 {
                "better"
            } else {
                "worse"
            }
        }
    };
    let [before, after] = [before, after].map(written);
    // What looks the same is no change.
    let (change, tone) = if before == after { (String::new(), "") } else { (percent(change), tone) };
    Row { name: name.into(), help, before, after, change, tone }
}

/// Formats a relative change, such as `+12 %`; more than doubling as a factor; empty if there is none.
pub(super) fn percent(change: f64) -> String {
    match change {
        c if c.abs() < NOTHING => String::new(),
        c if c >= 1.0 => format!("\u{d7} {:.1}", 1.0 + c),
        c => format!("{}{:.0} %", if c > 0.0 { "+" } else { "\u{2212}" }, 100.0 * c.abs()),
    }
}

fn memory(metrics: Sides<&Metrics>, files: Sides<Option<u64>>, verification: &Verification) -> Vec<Row> {
    let size = |name: &str, help, of: Sides<u64>| compared(name, help, of.map(|b| b as f64), Best::Less, size);
    let predicted = metrics.map(Metrics::as_bytes);
    let mut rows = vec![size("acceleration structures, predicted", "memory on the device that traces rays", predicted)];
    if let Some(s) = &verification.structures {
        let of = |sizes: Sides<u64>| size("BLASes as built", "measured on the device", sizes);
        rows.push(of(s.blas_bytes));
        let compacted = |sizes| size("BLASes compacted", "measured on the device", sizes);
        rows.extend(s.blas_bytes_compacted.map(compacted));
        rows.push(size("TLAS", "measured on the device", s.tlas_bytes));
        let ms = |name: &str, of| compared(name, "measured on the device", of, Best::Less, milliseconds);
        rows.extend([ms("time to build BLASes", s.blas_build_ms), ms("time to build the TLAS", s.tlas_build_ms)]);
    }
    let both = files.before.zip(files.after).map(|(before, after)| Sides { before, after });
    rows.extend(both.map(|both| size("file", "with its buffers, without images in files of their own", both)));
    rows
}

fn heading_of_speed(verification: &Verification) -> String {
    match verification.speed_by {
        SpeedBy::Steps => "Speed of a CPU core by the steps of rays, million rays per second".to_owned(),
        _ => format!("Speed on {}, million rays per second", verification.device),
    }
}

fn speeds(verification: &Verification, overall: &Speed) -> Vec<Row> {
    if verification.speed_by == SpeedBy::Nothing {
        return Vec::new();
    }
    let Speed { before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio, .. } = *overall;
    let all = KindSpeed { before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio };
    let kinds = verification.kinds.iter().filter(|(_, k)| k.before_mrays_per_s > 0.0);
    let kinds = kinds.map(|(kind, speed)| (format!("{} rays", kind.name()), *speed));
    kinds.chain([("weighted over ray kinds".to_owned(), all)]).map(speed).collect()
}

fn speed((name, k): (String, KindSpeed)) -> Row {
    let spread = if k.spread_ratio.is_finite() { format!("{:.2}", k.spread_ratio) } else { "?".into() };
    let tone = match k.differs() {
        false => "",
        true if k.speedup_ratio > 1.0 => "better",
        true => "worse",
    };
    let sides = Sides { before: k.before_mrays_per_s, after: k.after_mrays_per_s };
    let change = format!("\u{d7} {:.2} \u{b1} {spread}", k.speedup_ratio);
    Row { change, tone, ..compared(name, "", sides, Best::More, two) }
}

fn count(value: f64) -> String {
    grouped(value as u64)
}

fn size(value: f64) -> String {
    bytes(value as u64)
}

fn two(value: f64) -> String {
    format!("{value:.2}")
}

fn three(value: f64) -> String {
    format!("{value:.3}")
}

fn milliseconds(value: f64) -> String {
    format!("{value:.2} ms")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn less_cost_is_better_and_a_change_within_half_a_percent_is_none() {
        let row = |before, after| compared("cost", "", Sides { before, after }, Best::Less, two);
        assert_eq!((row(10.0, 7.0).tone, row(10.0, 7.0).change.as_str()), ("better", "\u{2212}30 %"));
        assert_eq!((row(10.0, 30.0).tone, row(10.0, 30.0).change.as_str()), ("worse", "\u{d7} 3.0"));
        assert_eq!((row(10.0, 10.01).tone, row(10.0, 10.01).change.as_str()), ("", ""));
        assert_eq!((row(0.0, 5.0).tone, row(0.0, 5.0).change.as_str()), ("", ""));
    }

    #[test]
    fn the_core_has_a_row_only_if_it_differs() {
        let plain = Metrics { overlap_ratio: 2.0, core_overlap_ratio: 2.0, ..Metrics::default() };
        let dome = Metrics { core_overlap_ratio: 9.0, ..plain.clone() };
        let names = |m: &Metrics| {
            let sections = of_one(m, None);
            sections.iter().flat_map(|s| &s.rows).map(|r| r.name.clone()).collect::<Vec<_>>()
        };
        let core = "overlap ratio of the core".to_owned();
        assert!(!names(&plain).contains(&core) && names(&dome).contains(&core));
    }

    #[test]
    fn sizes_of_files_are_shown_if_both_are_known() {
        let metrics = Metrics::default();
        let rows = |before| {
            memory(
                Sides { before: &metrics, after: &metrics },
                Sides { before, after: Some(4096) },
                &Verification::default(),
            )
        };
        assert_eq!(rows(Some(2048)).last().map(|r| r.after.clone()), Some("4.0 KiB".to_owned()));
        assert_eq!(rows(None).len(), 1);
    }
}
