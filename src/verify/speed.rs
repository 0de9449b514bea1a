//! Measures how fast both scenes are traced.
//!
//! Input and output are timed in turns, beginning and ending with the input, so that each time of the output has one of
//! the input before and after it. The mean of those two over it is one *paired ratio*: a drift of the machine's speed
//! cancels, and a disturbed time affects at most two ratios. The speedup is the median of these ratios. Its uncertainty
//! has the form of the notches of R. McGill, J. W. Tukey, W. A. Larsen, "Variations of Box Plots", The American
//! Statistician 32(1), 1978: a robust width over the root of the number. The width is not the distance of quartiles,
//! but the distance from the median that two thirds of the ratios stay within, which tolerates two bad ratios of seven.

use serde::Serialize;

use super::rays::RayKind;
use super::{Sides, Tracer};

/// Largest number of repeats; more add no information.
pub const MOST_REPEATS: u32 = 1000;

/// Speed of one kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct KindSpeed {
    /// Million rays per second through the input, median over the repeats; 0 without rays.
    pub before_mrays_per_s: f64,
    /// Million rays per second through the output.
    pub after_mrays_per_s: f64,
    /// After over before, the median of paired ratios; 1 without rays.
    pub speedup_ratio: f64,
    /// Uncertainty of `speedup_ratio`: half the width of its confidence interval of about 95 % (86 % at four repeats).
    /// 0 if all repeats are equal; infinite (`null` in JSON) for fewer than three, which do not determine it. If input
    /// and output were not timed in turns, the sum of the uncertainties of their medians.
    pub spread_ratio: f64,
}

impl KindSpeed {
    /// Computes the speed of `count` rays from seconds through the input and, in between, the output: see [`times`].
    pub fn in_turns(count: usize, seconds: &Sides<Vec<f64>>) -> KindSpeed {
        let Sides { before, after } = seconds;
        let around = before.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        let ratios: Vec<f64> = around.zip(after).map(|(around, between)| around / between).collect();
        if count == 0 || ratios.is_empty() {
            return KindSpeed::default();
        }
        let speedup_ratio = median(&ratios);
        KindSpeed {
            speedup_ratio,
            spread_ratio: half_confidence_interval(&ratios),
            ..KindSpeed::medians(count, before, after)
        }
    }

    /// Like [`KindSpeed::in_turns`], for times taken one after the other: nothing cancels a drift between the two, so
    /// the uncertainties of both medians add up.
    pub fn one_after_the_other(count: usize, seconds: &Sides<Vec<f64>>) -> KindSpeed {
        let Sides { before, after } = seconds;
        if count == 0 || before.is_empty() || after.is_empty() {
            return KindSpeed::default();
        }
        let medians = KindSpeed::medians(count, before, after);
        let relative =
            half_confidence_interval(before) / median(before) + half_confidence_interval(after) / median(after);
        KindSpeed { spread_ratio: medians.speedup_ratio * relative, ..medians }
    }

    fn medians(count: usize, before: &[f64], after: &[f64]) -> KindSpeed {
        let mrays_per_s = |seconds: &[f64]| count as f64 / 1e6 / median(seconds);
        let [before_mrays_per_s, after_mrays_per_s] = [mrays_per_s(before), mrays_per_s(after)];
        let speedup_ratio = after_mrays_per_s / before_mrays_per_s;
        KindSpeed { before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio: 0.0 }
    }

    /// Whether the speeds differ by more than the spread.
    pub fn differs(&self) -> bool {
        (self.speedup_ratio - 1.0).abs() > self.spread_ratio
    }
}

impl Default for KindSpeed {
    fn default() -> Self {
        KindSpeed { before_mrays_per_s: 0.0, after_mrays_per_s: 0.0, speedup_ratio: 1.0, spread_ratio: 0.0 }
    }
}

/// Times have settled when successive ones differ by less than this share.
const SETTLED_RATIO: f64 = 0.01;

/// With fewer numbers than this, the uncertainty of their median is unknown.
const FEWEST: usize = 3;

/// Factor from [`deviation`] over the root of the number of ratios to half the width of the confidence interval. Found
/// by simulating normal, Laplace and heavy-tailed errors of single times: the interval contains the true ratio in 94 %
/// to 96 % of all series of 3, 5 or 7, in 86 % of 4, in 97 % or more of 6 and of more than 7.
const CONFIDENCE: f64 = 4.0;

/// Returns the seconds that tracers take for the same rays, in turns, so that a drift of the machine's speed affects
/// all alike: the first tracer begins and ends. Each tracer gets a list of `repeats` times, the first one of one more.
///
/// # Errors
/// Returns the errors of the tracers.
pub fn times<T: Tracer, const N: usize>(
    kind: RayKind,
    rays: &T::Rays<'_>,
    tracers: [&T; N],
    repeats: u32,
) -> Result<[Vec<f64>; N], T::Error> {
    warm_up(kind, rays, tracers)?;
    // A clock that did not advance counts as one nanosecond.
    let time = |tracer: &T| Ok(tracer.seconds(kind, rays)?.max(1e-9));
    let mut times = [const { Vec::new() }; N];
    for round in 0..=repeats.max(1) {
        for (at, tracer) in tracers.into_iter().enumerate().skip(usize::from(round > 0)) {
            if at > 0 && round > 0 {
                times[at].push(time(tracer)?);
            }
        }
        if let (Some(first), Some(times)) = (tracers.first(), times.first_mut()) {
            times.push(time(first)?);
        }
    }
    Ok(times)
}

/// Traces until all times settle, or as often as the tracers need at most.
fn warm_up<T: Tracer, const N: usize>(kind: RayKind, rays: &T::Rays<'_>, tracers: [&T; N]) -> Result<(), T::Error> {
    let mut last = [0.0; N];
    for _ in 0..tracers.first().map_or(0, |t| t.pace().most_warm_ups) {
        let mut now = [0.0; N];
        for (tracer, now) in tracers.into_iter().zip(&mut now) {
            *now = tracer.seconds(kind, rays)?;
        }
        if (0..N).all(|i| (now[i] - last[i]).abs() < SETTLED_RATIO * now[i]) {
            break;
        }
        last = now;
    }
    Ok(())
}

/// Returns the median of numbers, of which there is at least one.
pub(crate) fn median(numbers: &[f64]) -> f64 {
    let sorted = sorted(numbers.iter().copied());
    0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2])
}

/// Returns the uncertainty of the median of numbers.
fn half_confidence_interval(numbers: &[f64]) -> f64 {
    match numbers.len() {
        n if n < FEWEST => f64::INFINITY,
        n => CONFIDENCE * deviation(numbers, median(numbers)) / (n as f64).sqrt(),
    }
}

/// Distance from the middle that two thirds of the numbers stay within: about the standard deviation of normal ones.
fn deviation(numbers: &[f64], middle: f64) -> f64 {
    let sorted = sorted(numbers.iter().map(|x| (x - middle).abs()));
    sorted[(2 * (sorted.len() - 1)).div_ceil(3)]
}

fn sorted(numbers: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}

#[cfg(test)]
mod tests {
    use super::super::random::Random;
    use super::*;

    /// Returns times of a million rays, in turns, on a machine that slows down by the given share each time.
    fn drifting(repeats: usize, speedup: f64, drift: f64) -> [Vec<f64>; 2] {
        let clock = |i: usize| 1.0 + drift * i as f64;
        [(0..=repeats).map(|i| clock(2 * i)).collect(), (0..repeats).map(|i| clock(2 * i + 1) / speedup).collect()]
    }

    fn of(times: &[Vec<f64>; 2]) -> KindSpeed {
        KindSpeed::in_turns(1_000_000, &times.clone().into())
    }

    /// Returns an approximately normal number: the sum of twelve uniform ones (Irwin and Hall).
    fn normal(random: &mut Random) -> f64 {
        (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
    }

    #[test]
    fn equal_repeats_leave_no_spread() {
        let found = of(&drifting(7, 2.0, 0.0));
        assert_eq!([found.speedup_ratio, found.spread_ratio], [2.0, 0.0]);
        assert_eq!([found.before_mrays_per_s, found.after_mrays_per_s], [1.0, 2.0]);
        assert!(found.differs() && !of(&drifting(7, 1.0, 0.0)).differs());
    }

    #[test]
    fn a_drift_common_to_both_cancels() {
        for drift in [0.1, -0.05] {
            let found = of(&drifting(7, 1.05, drift));
            assert!((found.speedup_ratio - 1.05).abs() < 1e-12 && found.spread_ratio < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn an_outlier_does_not_matter() {
        for side in 0..2 {
            for at in 0..7 {
                let mut times = drifting(7, 1.05, 0.001);
                times[side][at] *= 10.0;
                let found = of(&times);
                assert!((found.speedup_ratio - 1.05).abs() < 1e-5 && found.spread_ratio < 1e-5, "{found:?}");
            }
        }
    }

    #[test]
    fn two_levels_of_speed_leave_a_spread() {
        let mut times = drifting(7, 1.0, 0.0);
        times[1][4..].fill(0.8);
        let found = of(&times);
        assert!(found.speedup_ratio == 1.0 && found.spread_ratio > 0.25, "{found:?}");
    }

    #[test]
    fn fewer_than_three_repeats_are_no_evidence() {
        for repeats in [1, 2] {
            let found = of(&drifting(repeats, 5.0, 0.0));
            assert!((found.speedup_ratio - 5.0).abs() < 1e-12 && !found.differs(), "{found:?}");
        }
    }

    #[test]
    fn noise_stays_within_the_spread_in_about_95_of_100_series() {
        for (repeats, least) in [(3, 0.93), (5, 0.92), (7, 0.92), (15, 0.95)] {
            let series = 2000;
            let within = |i: &usize| {
                let mut random = Random::at(1, repeats as u64, *i);
                let times = drifting(repeats, 1.2, 0.002);
                let noisy = times.map(|side| side.iter().map(|t| t * (1.0 + 0.03 * normal(&mut random))).collect());
                let found = of(&noisy);
                (found.speedup_ratio - 1.2).abs() <= found.spread_ratio
            };
            let share = (0..series).filter(within).count() as f64 / f64::from(series as u32);
            assert!((least..0.995).contains(&share), "{share} of {repeats} repeats");
        }
    }

    #[test]
    fn what_lies_within_the_spread_is_no_difference() {
        let kind = |speedup_ratio| KindSpeed { speedup_ratio, spread_ratio: 0.05, ..KindSpeed::default() };
        assert!(!kind(1.04).differs() && !kind(0.96).differs());
        assert!(kind(1.06).differs() && kind(0.94).differs());
    }

    #[test]
    fn without_turns_the_spreads_add_up() {
        let apart = KindSpeed::one_after_the_other(1_000_000, &[vec![1.0, 1.25, 1.0], vec![0.5, 0.5, 0.5]].into());
        assert_eq!((apart.before_mrays_per_s, apart.after_mrays_per_s, apart.speedup_ratio), (1.0, 2.0, 2.0));
        assert_eq!(apart.spread_ratio, 2.0 * half_confidence_interval(&[1.0, 1.25, 1.0]));
        let both = KindSpeed::one_after_the_other(1_000_000, &[vec![1.0, 1.25, 1.25], vec![1.0, 1.25, 1.25]].into());
        assert!((both.spread_ratio - 2.0 * half_confidence_interval(&[1.0, 1.25, 1.25]) / 1.25).abs() < 1e-12);
        assert!(!KindSpeed::one_after_the_other(1, &[vec![9.0; 2], vec![1.0; 2]].into()).differs());
    }

    #[test]
    fn no_rays_have_no_speed() {
        assert_eq!(KindSpeed::in_turns(0, &[vec![0.0; 2], vec![0.0]].into()), KindSpeed::default());
        assert_eq!(KindSpeed::in_turns(7, &[Vec::new(), vec![1.0]].into()), KindSpeed::default());
        assert_eq!(KindSpeed::one_after_the_other(7, &[vec![1.0], Vec::new()].into()), KindSpeed::default());
    }

    #[test]
    fn the_median_of_an_even_number_is_between_the_middle_two() {
        assert_eq!([median(&[4.0, 1.0, 2.0, 10.0]), median(&[5.0])], [3.0, 5.0]);
    }
}
