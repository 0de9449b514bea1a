//! The table of candidates as text.

use std::fmt::Write;

use super::text::{padded, wrapped};
use super::words::bytes;
use super::{Candidate, MethodReport};
use crate::methods::PlanId;

/// Maximum characters per line.
pub(super) const WIDTH: usize = 140;

/// Maximum characters of a candidate's name per line.
const NAME: usize = 38;

/// Minimum characters of an outcome per line.
const OUTCOME: usize = 30;

/// A column of numbers: its heading and the text of a cell.
type Column = (&'static str, fn(&Candidate) -> String);

const ALWAYS: [Column; 7] = [
    ("cost", |c| format!("{:.2}", c.predicted_cost)),
    ("ps a ray", |c| c.sampled_cost.map_or("-".into(), significant)),
    ("bytes", |c| bytes(c.as_bytes)),
    ("error", |c| c.position_error_ratio.map_or("-".into(), power)),
    ("hit error", |c| power(c.accuracy.p999_relative_distance_error)),
    ("lost/M", |c| significant_count(c.accuracy.lost_per_million)),
    ("seconds", |c| format!("{:.2}", c.seconds)),
];

const MEASURED: [Column; 2] = [
    ("Mrays/s", |c| c.measured_mrays_per_s.map_or("-".into(), significant)),
    ("speedup", |c| c.measured_speedup_ratio.map_or("-".into(), |ratio| speedup(ratio, c.measured_spread_ratio))),
];

/// Formats an error by its order of magnitude.
fn power(error: f64) -> String {
    if error == 0.0 { "0".into() } else { format!("{error:.0e}") }
}

/// Formats a number of rays of a million.
fn significant_count(count: f64) -> String {
    format!("{:.0}", count)
}

/// Formats a number with at least three digits, but at most two decimal places.
pub(super) fn significant(value: f64) -> String {
    match value.abs() {
        v if v < 9.995 => format!("{value:.2}"),
        v if v < 99.95 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

fn speedup(ratio: f64, spread: Option<f64>) -> String {
    match spread {
        Some(0.0) => format!("{ratio:.3}"),
        Some(spread) if spread.is_finite() => format!("{ratio:.3} +- {spread:.3}"),
        _ => format!("{ratio:.3} +- ?"),
    }
}

/// The candidates as a table with lines of about 140 characters; omits those that were timed only briefly, unless `all`
/// is set.
pub(super) fn table(method: &MethodReport, all: bool) -> String {
    let (listed, brief): (Vec<&Candidate>, Vec<&Candidate>) = method.candidates.iter().partition(|c| all || !c.brief);
    let measured = listed.iter().any(|c| c.measured_speedup_ratio.is_some());
    let columns: Vec<Column> = match measured {
        true => ALWAYS[..2].iter().chain(&MEASURED).chain(&ALWAYS[2..]).copied().collect(),
        false => ALWAYS.to_vec(),
    };
    let mut text = rows(&listed, &columns, method.chosen_candidate);
    match brief.len() {
        0 => {}
        1 => text += "1 more, timed briefly along other axes, was slower than the best of its kind (-v lists it)\n",
        n => {
            let _ = writeln!(
                text,
                "{n} more, timed briefly along other axes, were slower than the best of their kind (-v lists them)"
            );
        }
    }
    format!("\n{text}")
}

fn rows(candidates: &[&Candidate], columns: &[Column], chosen: PlanId) -> String {
    let cells: Vec<Vec<String>> = candidates.iter().map(|c| columns.iter().map(|(_, of)| of(c)).collect()).collect();
    let width_of = |column: usize| {
        let widths = cells.iter().map(|row| row[column].chars().count());
        widths.chain([columns[column].0.len()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns.len()).map(width_of).collect();
    let longest = candidates.iter().map(|c| c.id.to_string().chars().count()).max().unwrap_or(0);
    let name = longest.clamp("candidate".len(), NAME);
    let numbers: usize = widths.iter().map(|width| width + 2).sum();
    let outcome = WIDTH.saturating_sub(name + numbers + 2).max(OUTCOME);
    let line = |name_part: &str, numbers: &dyn Fn(usize) -> String, outcome_part: &str| {
        let mut line = padded(name_part, name, false);
        (0..columns.len()).for_each(|column| line += &format!("  {}", padded(&numbers(column), widths[column], true)));
        format!("{}\n", format!("{line}  {outcome_part}").trim_end())
    };
    let mut text = line("candidate", &|column| columns[column].0.to_owned(), "outcome");
    for (candidate, cells) in candidates.iter().zip(&cells) {
        let names = wrapped(&candidate.id.to_string(), name);
        // The paragraph above the table gives the reason.
        let words = if candidate.id == chosen { "chosen" } else { &candidate.outcome };
        let outcomes = wrapped(words, outcome);
        for i in 0..names.len().max(outcomes.len()) {
            let part = |of: &[String]| of.get(i).cloned().unwrap_or_default();
            text += &line(
                &part(&names),
                &|column| if i == 0 { cells[column].clone() } else { String::new() },
                &part(&outcomes),
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::DecidedBy;
    use super::super::tests::{candidate, method};
    use super::*;
    use crate::methods::Method;

    #[test]
    fn small_speeds_are_not_rounded_to_nothing() {
        assert_eq!([0.6, 9.99, 9.996, 99.94, 1234.5].map(significant), ["0.60", "9.99", "10.0", "99.9", "1234"]);
    }

    #[test]
    fn lines_are_short_and_nothing_of_names_and_outcomes_is_lost() {
        let mut method = method(DecidedBy::Measurement);
        let plan = PlanId::new(Method::Cluster, "cluster by rays, entry 16, at most 65,536 triangles");
        let id = plan.refined(13.91).along(21);
        method.candidates.push(super::Candidate {
            measured_mrays_per_s: Some(0.6),
            measured_speedup_ratio: Some(1.234),
            measured_spread_ratio: Some(0.01),
            position_error_ratio: Some(1.3e-8),
            ..candidate(id, 123_456.0)
        });
        let text = table(&method, true);
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        let squeezed = |text: &str| text.chars().filter(|c| !c.is_whitespace()).collect::<String>();
        let first = |line: &str| line.chars().take(NAME).collect::<String>();
        let names: String = text.lines().map(first).collect();
        assert!(squeezed(&names).contains(&squeezed(&id.to_string())), "{text}");
        for words in ["0.60", "1.234 +- 0.010", "1e-8", "speedup", "error"] {
            assert!(text.contains(words), "{words} is missing in\n{text}");
        }
    }

    #[test]
    fn columns_of_what_was_not_measured_are_left_out() {
        let text = table(&method(DecidedBy::Prediction), false);
        assert!(!text.contains("Mrays/s") && text.contains("ps a ray"), "{text}");
        let chosen = text.lines().find(|line| line.starts_with("single")).expect("a line");
        assert!(chosen.ends_with("chosen"), "{chosen}");
    }

    #[test]
    fn candidates_timed_briefly_are_counted() {
        let mut method = method(DecidedBy::Measurement);
        method
            .candidates
            .push(super::Candidate { brief: true, ..candidate(PlanId::from(Method::Single).along(3), 1.0) });
        assert!(table(&method, false).contains("1 more, timed briefly along other axes, was slower"));
        assert!(table(&method, true).contains("single, axes 3"));
    }
}
