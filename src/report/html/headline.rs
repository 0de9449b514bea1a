//! The verdict of a page: one sentence that anybody understands, and how certain it is.

use serde::Serialize;

use crate::report::words::{counted, grouped, plural};
use crate::report::{BakeReport, InspectReport, Severity, Speed, VerifyReport};
use crate::verify::verdict::{SpeedBy, Verdict};
use crate::verify::{MachineKind, Verification};

/// What stands at the top of a page.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct Headline {
    /// The verdict in one or two words.
    badge: String,
    /// `good`, `bad` or `neutral`.
    tone: &'static str,
    /// One sentence.
    sentence: String,
    /// How certain that is, and what it is based on.
    certainty: Vec<String>,
}

/// The verdict of a bake.
pub(super) fn of_bake(report: &BakeReport) -> Headline {
    let name = "the baked scene";
    let mut headline = of_verdict(report.verdict, &report.overall, &report.verify, name);
    match report.verdict {
        Verdict::LeftAlone => {
            headline.sentence = "The scene stays as it is: nothing that was tried makes it faster.".to_owned();
            headline.certainty = vec![sentence(&report.method.reason)];
        }
        Verdict::Failed | Verdict::CannotTell => headline.certainty.push("No file was written.".to_owned()),
        Verdict::Faster | Verdict::NotFaster => {}
    }
    headline
}

/// The verdict of a comparison of two files.
pub(super) fn of_verification(report: &VerifyReport) -> Headline {
    let mut headline = of_verdict(report.verdict, &report.overall, &report.verify, "the second file");
    if report.verify.speed_by == SpeedBy::Nothing && report.verify.passed() {
        headline = Headline {
            badge: "the same".to_owned(),
            tone: "neutral",
            sentence: "Both files show the same; their speeds were not compared.".to_owned(),
            certainty: vec![agreement(&report.verify)],
        };
    }
    headline
}

/// The verdict of an inspection.
pub(super) fn of_inspection(report: &InspectReport) -> Headline {
    let count = |severity| report.findings.iter().filter(|f| f.severity == severity).count();
    let [errors, warnings, notes] = [Severity::Error, Severity::Warning, Severity::Note].map(count);
    let checked = counted(report.rules_checked.len(), "rule");
    let parts = [(errors, "error"), (warnings, "warning"), (notes, "note")];
    let parts: Vec<String> = parts.into_iter().filter(|(n, _)| *n > 0).map(|(n, what)| counted(n, what)).collect();
    let (badge, tone, sentence) = match errors + warnings {
        0 => ("nothing wrong".to_owned(), "good", "Nothing was found that costs speed or memory.".to_owned()),
        n => {
            let thing = plural(n, "thing");
            let verb = if n == 1 { "costs" } else { "cost" };
            let sentence = format!("{} {thing} in this scene {verb} speed or memory.", grouped(n as u64));
            (parts.join(", "), "bad", sentence)
        }
    };
    let found = if parts.is_empty() { "nothing".to_owned() } else { parts.join(", ") };
    let boxes = report.before.boxes_per_point_mean;
    let certainty = vec![
        format!("{checked} checked; found: {found}."),
        format!("A point of a surface lies in {boxes:.2} instance boxes on average; 1 is best."),
    ];
    Headline { badge, tone, sentence, certainty }
}

fn of_verdict(verdict: Verdict, overall: &Speed, verification: &Verification, name: &str) -> Headline {
    let ratio = overall.speedup_ratio;
    let speed = [reach(overall, verification), source(overall, verification), agreement(verification)];
    let (badge, tone, sentence, certainty) = match verdict {
        Verdict::Faster => {
            ("faster", "good", format!("Rays are traced {ratio:.2} times as fast through {name}."), speed.to_vec())
        }
        Verdict::NotFaster => ("not faster", "neutral", not_faster(overall, name), speed.to_vec()),
        Verdict::LeftAlone => {
            ("left alone", "neutral", "Both files are the same.".to_owned(), vec![agreement(verification)])
        }
        Verdict::Failed => {
            let sentence = format!("{} does not show the same as the input.", capitalised(name));
            ("failed", "bad", sentence, vec![self::sentence(&verification.to_string())])
        }
        Verdict::CannotTell => {
            let sentence = format!("It cannot be told whether {name} shows the same as the input.");
            ("cannot tell", "bad", sentence, vec![self::sentence(&verification.to_string())])
        }
    };
    Headline { badge: badge.to_owned(), tone, sentence, certainty }
}

fn not_faster(overall: &Speed, name: &str) -> String {
    let ratio = overall.speedup_ratio;
    if overall.is_faster() {
        format!("{} is {ratio:.2} times as fast on average, but slower from some viewpoint.", capitalised(name))
    } else if overall.is_slower() {
        format!("{} is slower: rays are traced {ratio:.2} times as fast as before.", capitalised(name))
    } else {
        format!("{} is as fast as before: any difference is too small to measure.", capitalised(name))
    }
}

/// How far the speed may be off, and over what it was found.
fn reach(overall: &Speed, verification: &Verification) -> String {
    let Speed { speedup_ratio: ratio, spread_ratio: spread, least_view_ratio: least, most_view_ratio: most, .. } =
        *overall;
    if !spread.is_finite() {
        return "It was measured too few times to say how certain that is.".to_owned();
    }
    let views = verification.views.iter().filter(|view| view.speedup_ratio.is_some()).count();
    let [low, high] = [ratio - spread, ratio + spread];
    let over = if views > 1 {
        format!("; over {} it ranges from {least:.2} to {most:.2}", counted(views, "viewpoint"))
    } else {
        String::new()
    };
    format!("The true factor lies between {low:.2} and {high:.2}, by the spread of repeats and viewpoints{over}.")
}

/// What was measured, and what that says about other devices.
fn source(overall: &Speed, verification: &Verification) -> String {
    match (overall.measured_on, verification.speed_by) {
        (MachineKind::Gpu, _) => format!("Measured on {}.", verification.device),
        (MachineKind::SoftwareDriver, _) => {
            format!("Measured on {}, a software driver: a GPU may differ.", verification.device)
        }
        (MachineKind::Cpu, SpeedBy::Steps) => {
            "Counted as the steps of rays on the CPU, which are the same in every run. No GPU was available: its gain may be \
             larger or smaller."
                .to_owned()
        }
        (MachineKind::Cpu, _) => "Measured on the CPU: a GPU may differ.".to_owned(),
    }
}

/// That both files show the same, as verified.
fn agreement(verification: &Verification) -> String {
    format!("Both files show the same: {verification}.")
}

/// Makes a sentence of a phrase.
pub(super) fn sentence(phrase: &str) -> String {
    let phrase = capitalised(phrase);
    if phrase.ends_with('.') { phrase } else { format!("{phrase}.") }
}

fn capitalised(phrase: &str) -> String {
    let mut characters = phrase.chars();
    characters.next().map(|first| first.to_uppercase().chain(characters).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::tests::{speed, verification};

    fn headline(verdict: Verdict, speedup_ratio: f64, spread_ratio: f64, measured_on: MachineKind) -> Headline {
        let overall = speed(measured_on, speedup_ratio, spread_ratio);
        of_verdict(verdict, &overall, &verification(), "the baked scene")
    }

    #[test]
    fn a_gain_is_said_with_its_certainty_and_device() {
        let Headline { sentence, certainty, tone, .. } = headline(Verdict::Faster, 1.5, 0.1, MachineKind::Gpu);
        assert_eq!((sentence.as_str(), tone), ("Rays are traced 1.50 times as fast through the baked scene.", "good"));
        assert!(certainty[0].contains("between 1.40 and 1.60"), "{certainty:?}");
        assert_eq!(certainty[1], "Measured on a device.");
    }

    #[test]
    fn slower_and_no_difference_are_told_apart() {
        let said = |ratio| headline(Verdict::NotFaster, ratio, 0.05, MachineKind::Cpu).sentence;
        assert!(said(0.8).contains("is slower") && said(1.01).contains("as fast as before"));
        assert!(said(1.2).contains("slower from some viewpoint"));
    }

    #[test]
    fn a_failed_verification_says_so_with_its_reason() {
        let Headline { sentence, certainty, tone, .. } = headline(Verdict::Failed, 1.0, 0.1, MachineKind::Cpu);
        assert_eq!((sentence.as_str(), tone), ("The baked scene does not show the same as the input.", "bad"));
        assert_eq!(certainty.len(), 1, "no speed is claimed");
    }

    #[test]
    fn too_few_repeats_are_said() {
        let certainty = headline(Verdict::Faster, 1.5, f64::INFINITY, MachineKind::Gpu).certainty;
        assert!(certainty[0].contains("too few times"), "{certainty:?}");
    }
}
