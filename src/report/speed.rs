//! The speeds of both files as text.

use super::Speed;
use super::text::table;
use super::words::counted;
use crate::verify::speed::KindSpeed;
use crate::verify::verdict::SpeedBy;
use crate::verify::views::ViewReport;
use crate::verify::{PerKind, Verification};

/// The speeds by ray kind and over all of them, and how much they depend on the view.
pub(super) fn rays(verify: &Verification, overall: &Speed) -> String {
    let heading = match verify.speed_by {
        SpeedBy::Nothing => return format!("rays were compared on {}; none were timed\n", verify.device),
        SpeedBy::Seconds => format!("Mrays/s on {}", verify.device),
        SpeedBy::Steps => "Mrays/s per CPU core, by steps".to_owned(),
    };
    let Speed { before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio, .. } = *overall;
    let overall_line = KindSpeed { before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio };
    let kinds = verify.kinds.iter().map(|(kind, speed)| (kind.name(), *speed));
    let rows: Vec<Vec<String>> = kinds.chain([("weighted over ray kinds", overall_line)]).map(row).collect();
    let measured = verify.measured_kinds.as_ref().map(|kinds| measured(kinds, &verify.device));
    let lines = views(overall, &verify.views).into_iter().chain(measured);
    table(&[&heading, "before", "after", "ratio"], &rows) + &lines.collect::<String>()
}

fn row((name, k): (&str, KindSpeed)) -> Vec<String> {
    let [before, after] = [k.before_mrays_per_s, k.after_mrays_per_s].map(|speed| format!("{speed:.2}"));
    vec![name.into(), before, after, ratio(&k)]
}

fn ratio(k: &KindSpeed) -> String {
    match k.differs() {
        true => format!("{:.2} +- {:.2}", k.speedup_ratio, k.spread_ratio),
        false if k.spread_ratio.is_infinite() => format!("{:.2}, too few repeats", k.speedup_ratio),
        false => format!("no difference (+- {:.2})", k.spread_ratio),
    }
}

/// The speedups of the views that judge: least, most and spread.
fn views(overall: &Speed, views: &[ViewReport]) -> Option<String> {
    let judging = || views.iter().filter_map(|view| Some((view.speedup_ratio?, view.name.as_str())));
    let (least, slowest) = judging().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (most, fastest) = judging().max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(format!(
        "judged by {}: from {least:.3} (`{slowest}`) to {most:.3} (`{fastest}`); spread over repeats {:.3}, over views \
         {:.3}\n",
        counted(judging().count(), "view"),
        overall.repeats_spread_ratio,
        overall.views_spread_ratio
    ))
}

/// The seconds that were measured beside the steps that count.
fn measured(kinds: &PerKind<KindSpeed>, device: &str) -> String {
    let kinds = kinds.iter().filter(|(_, speed)| speed.before_mrays_per_s > 0.0);
    let kinds: Vec<String> = kinds.map(|(kind, speed)| format!("{} {}", kind.name(), ratio(speed))).collect();
    format!("measured in seconds on {device}, which decides nothing: {}\n", kinds.join("; "))
}
