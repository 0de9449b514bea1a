//! Puts the verdict of a bake into words.

use super::{DecidedBy, MethodReport, Speed};
use crate::choose::model::Class;
use crate::methods::{Method, PlanId};
use crate::verify::verdict::{SpeedBy, Verdict};
use crate::verify::{MachineKind, Verification};

/// States the verdict and what it is based on: what was measured, on which device, and, if the choice was made by
/// prediction, what was predicted for a device class.
pub fn words(
    verdict: Verdict,
    overall: &Speed,
    verification: &Verification,
    method: &MethodReport,
    class: Class,
) -> String {
    match verdict {
        Verdict::Failed | Verdict::CannotTell => format!("no file was written: {verification}"),
        Verdict::LeftAlone => "the output is the input as it is".to_owned(),
        Verdict::Faster | Verdict::NotFaster => {
            let measured = Some(measured(verdict, overall, verification));
            let parts = [measured, caution(overall), predicted(method, class), repeatable(method.decided_by)];
            parts.into_iter().flatten().collect::<Vec<String>>().join("; ")
        }
    }
}

/// The speed of the output, and the device, in words.
pub(super) fn measured(verdict: Verdict, overall: &Speed, verification: &Verification) -> String {
    let Speed { speedup_ratio: ratio, spread_ratio: spread, least_view_ratio: least, .. } = *overall;
    let on = match (verification.speed_by, overall.measured_on) {
        (SpeedBy::Nothing, _) => return "no rays were timed".to_owned(),
        (SpeedBy::Steps, _) => "the CPU tracer, by the steps of its rays",
        (SpeedBy::Seconds, MachineKind::Cpu) => "the CPU tracer",
        (SpeedBy::Seconds, MachineKind::SoftwareDriver | MachineKind::Gpu) => &verification.device,
    };
    if spread.is_infinite() {
        return format!("{ratio:.2} times the input's speed on {on}, by too few repeats to tell anything");
    }
    let speed = format!("{ratio:.2} +- {spread:.2} times the input's speed, weighted over ray kinds");
    let speed = format!("{speed}; at least {least:.3} in each view that judges");
    if overall.is_faster() && verdict == Verdict::NotFaster {
        format!("faster on average, but TOO SLOW in a view on {on}: {speed}")
    } else if overall.is_faster() {
        format!("faster on {on}: {speed}")
    } else if overall.is_slower() {
        format!("SLOWER on {on}: {speed}")
    } else {
        format!("no difference beyond the spread on {on}: {speed}")
    }
}

/// Warns about speeds that were not measured on a GPU.
fn caution(overall: &Speed) -> Option<String> {
    let what = match overall.measured_on {
        MachineKind::Cpu => "CPU speeds tell",
        MachineKind::SoftwareDriver => "speeds of a software driver tell",
        MachineKind::Gpu => return None,
    };
    Some(format!("{what} nothing of a device"))
}

/// The predicted speed, if the choice was made by prediction alone.
fn predicted(method: &MethodReport, class: Class) -> Option<String> {
    let cost = |id: PlanId| method.candidates.iter().find(|c| c.id == id)?.sampled_cost;
    let chosen = method.chosen_candidate;
    let (before, after) = (cost(Method::Keep.into())?, cost(chosen)?);
    (method.decided_by == DecidedBy::Prediction && !chosen.is_input() && after > 0.0).then(|| {
        format!(
            "chosen by prediction alone: {:.2} times the input's speed on a device of class {}",
            before / after,
            class.name()
        )
    })
}

/// Warns about decisions that may differ from run to run.
fn repeatable(decided_by: DecidedBy) -> Option<String> {
    let words = "decided by measurement, which may differ from run to run; a plan (--write-plan) does not";
    (decided_by == DecidedBy::Measurement).then(|| words.to_owned())
}

#[cfg(test)]
mod tests {
    use super::super::Candidate;
    use super::super::tests::{method, speed, verification};
    use super::*;

    fn said(verdict: Verdict, overall: Speed, decided_by: DecidedBy) -> String {
        let speed_by = if overall.measured_on == MachineKind::Cpu { SpeedBy::Steps } else { SpeedBy::Seconds };
        let verification = Verification { speed_by, ..verification() };
        words(verdict, &overall, &verification, &method(decided_by), Class::NoRtCores)
    }

    #[test]
    fn slower_on_the_cpu_is_said_with_what_that_tells_and_what_was_predicted() {
        let text = said(Verdict::NotFaster, speed(MachineKind::Cpu, 0.75, 0.04), DecidedBy::Prediction);
        for words in
            ["SLOWER on the CPU tracer", "0.75 +- 0.04", "tell nothing of a device", "by prediction alone: 2.00 times"]
        {
            assert!(text.contains(words), "{words} is missing in: {text}");
        }
    }

    #[test]
    fn what_was_measured_on_a_gpu_needs_no_caution() {
        let text = said(Verdict::Faster, speed(MachineKind::Gpu, 1.25, 0.01), DecidedBy::Measurement);
        let speed = "faster on a device: 1.25 +- 0.01 times the input's speed, weighted over ray kinds";
        let decided = "decided by measurement, which may differ from run to run; a plan (--write-plan) does not";
        assert_eq!(text, format!("{speed}; at least 1.250 in each view that judges; {decided}"));
    }

    #[test]
    fn a_view_that_is_too_slow_is_said() {
        let text = said(Verdict::NotFaster, speed(MachineKind::Gpu, 1.25, 0.01), DecidedBy::Measurement);
        assert!(text.starts_with("faster on average, but TOO SLOW in a view on a device: 1.25"), "{text}");
    }

    #[test]
    fn a_difference_within_the_spread_is_none() {
        let text = said(Verdict::NotFaster, speed(MachineKind::Cpu, 0.97, 0.04), DecidedBy::Request);
        assert!(text.starts_with("no difference beyond the spread on the CPU tracer") && !text.contains("prediction"));
        let text = said(Verdict::NotFaster, speed(MachineKind::Cpu, 0.5, f64::INFINITY), DecidedBy::Request);
        assert!(text.contains("too few repeats"), "{text}");
    }

    #[test]
    fn what_is_left_alone_claims_no_speed() {
        let text = said(Verdict::LeftAlone, speed(MachineKind::Cpu, 1.5, 0.0), DecidedBy::Prediction);
        assert_eq!(text, "the output is the input as it is");
    }

    #[test]
    fn nothing_is_predicted_without_a_price() {
        let mut unpriced = method(DecidedBy::Prediction);
        unpriced.candidates.iter_mut().for_each(|c: &mut Candidate| c.sampled_cost = Some(0.0));
        assert_eq!(predicted(&unpriced, Class::NoRtCores), None);
    }
}
