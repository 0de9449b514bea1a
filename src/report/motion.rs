//! Whether what moves can be refitted, in words.

use super::words::counted;
use crate::motion::advice::{Advice, Ageing};

/// Returns a sentence for each structure that an animation changes.
pub(super) fn sentences(advice: &Advice) -> Vec<String> {
    let Advice { animation, seconds, moving_instances, tlas, blases, deforming_instances } = advice;
    let of = |what: &str, count: u64| counted(count as usize, what);
    let mut sentences = vec![format!(
        "`{animation}` ({seconds:.2} s) moves {} and deforms {}; TLAS: {}",
        of("instance", *moving_instances),
        of("instance", *deforming_instances),
        ageing(tlas)
    )];
    sentences.extend(blases.iter().map(|blas| format!("BLAS of `{}`: {}", blas.object, ageing(&blas.ageing))));
    sentences
}

fn ageing(of: &Ageing) -> String {
    let Ageing { box_growth_ratio, cost_over_fresh_ratio: cost, rebuild_after_seconds, flags } = of;
    let advice = match rebuild_after_seconds {
        None => "refitting will do".to_owned(),
        Some(seconds) => format!("rebuild it, at the latest {seconds:.2} s after it was built"),
    };
    format!(
        "{advice}; refitted, it costs up to {cost:.2} of one built anew, and its box grows to {box_growth_ratio:.2} of its \
         surface area; build it with {}",
        flags.name()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::advice::{BlasAgeing, Flags};

    #[test]
    fn each_structure_has_its_sentence() {
        let tlas = Ageing { box_growth_ratio: 1.0, cost_over_fresh_ratio: 1.02, ..Ageing::default() };
        let ageing = Ageing {
            box_growth_ratio: 1.5,
            cost_over_fresh_ratio: 1.4,
            rebuild_after_seconds: Some(0.25),
            flags: Flags::FastBuild,
        };
        let advice = Advice {
            animation: "walk".into(),
            seconds: 2.0,
            moving_instances: 0,
            tlas,
            blases: vec![BlasAgeing { object: "fox".into(), ageing }],
            deforming_instances: 1,
        };
        let expected = [
            "`walk` (2.00 s) moves 0 instances and deforms 1 instance; TLAS: refitting will do; refitted, it costs up to 1.02 of \
             one built anew, and its box grows to 1.00 of its surface area; build it with fast-trace, allow-update",
            "BLAS of `fox`: rebuild it, at the latest 0.25 s after it was built; refitted, it costs up to 1.40 of one built \
             anew, and its box grows to 1.50 of its surface area; build it with fast-build",
        ];
        assert_eq!(sentences(&advice), expected);
    }
}
