//! Measures how fast both scenes are traced.
//!
//! Input and output are timed in *pairs*, which begin with the input and with the output in turns. The logarithm of the
//! input's time over the output's is one *paired ratio*: exchanging the two files changes its sign and nothing else, so
//! noise of any shape, however skewed, makes neither file seem faster. (The mean of two times of the input over one of
//! the output, for example, has a median above 1 under skewed noise.) A drift of the machine's speed shifts the ratios
//! that begin with the input one way and the others the other way. The speedup is the median of the means of all couples
//! of one ratio of each order, so that the drift cancels: the estimator of J. L. Hodges, E. L. Lehmann, "Estimates of
//! Location Based on Rank Tests", The Annals of Mathematical Statistics 34(2), 1963, for two samples.
//!
//! Its uncertainty has the form of the notches of R. McGill, J. W. Tukey, W. A. Larsen, "Variations of Box Plots", The
//! American Statistician 32(1), 1978: a robust width over the root of the number. The width is not the distance of
//! quartiles, but the distance from the middle that two thirds of the ratios stay within, which tolerates two bad ratios
//! of seven.

use serde::Serialize;

use super::rays::RayKind;
use super::{Side, Sides, Tracer};

/// Largest number of repeats; more add no information.
pub const MOST_REPEATS: u32 = 1000;

/// Speed of one kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct KindSpeed {
    /// Million rays per second through the input; 0 without rays. With `after_mrays_per_s`, it has the median time of
    /// both files and the ratio `speedup_ratio`.
    pub before_mrays_per_s: f64,
    /// Million rays per second through the output.
    pub after_mrays_per_s: f64,
    /// After over before, from paired ratios; 1 without rays.
    pub speedup_ratio: f64,
    /// Uncertainty of `speedup_ratio`: half the width of its confidence interval of at least 93 %.
    /// 0 if all repeats are equal; infinite (`null` in JSON) for fewer than three, which do not determine it. If input
    /// and output were not timed in pairs, the sum of the uncertainties of their medians.
    pub spread_ratio: f64,
}

impl KindSpeed {
    /// Computes the speed of `count` rays from seconds in pairs: see [`pairs`].
    pub fn in_pairs(count: usize, seconds: &Sides<Vec<f64>>) -> KindSpeed {
        let logs = seconds.as_ref().map(|of| of.iter().map(|seconds| seconds.ln()).collect::<Vec<f64>>());
        let both = || logs.before.iter().zip(&logs.after);
        let ratios: Vec<f64> = both().map(|(before, after)| before - after).collect();
        if count == 0 || ratios.is_empty() {
            return KindSpeed::default();
        }
        let (ratio, spread) = location(&ratios);
        let middle = median(&both().map(|(before, after)| 0.5 * (before + after)).collect::<Vec<f64>>());
        KindSpeed { spread_ratio: ratio.exp() * spread, ..KindSpeed::about(count, middle, ratio) }
    }

    /// Like [`KindSpeed::in_pairs`], for times taken one after the other: nothing cancels a drift between the two, so
    /// the uncertainties of both medians add up.
    pub fn one_after_the_other(count: usize, seconds: &Sides<Vec<f64>>) -> KindSpeed {
        if count == 0 || seconds.before.is_empty() || seconds.after.is_empty() {
            return KindSpeed::default();
        }
        let logs = seconds.as_ref().map(|of| of.iter().map(|seconds| seconds.ln()).collect::<Vec<f64>>());
        let medians = logs.as_ref().map(|logs| median(logs));
        let spread = half_confidence_interval(&logs.before) + half_confidence_interval(&logs.after);
        let ratio = medians.before - medians.after;
        let speed = KindSpeed::about(count, 0.5 * (medians.before + medians.after), ratio);
        KindSpeed { spread_ratio: ratio.exp() * spread, ..speed }
    }

    /// The speed of `count` rays whose times are exact.
    pub fn exact(count: usize, seconds: Sides<f64>) -> KindSpeed {
        if count == 0 || seconds.before <= 0.0 || seconds.after <= 0.0 {
            return KindSpeed::default();
        }
        let logs = seconds.map(f64::ln);
        KindSpeed::about(count, 0.5 * (logs.before + logs.after), logs.before - logs.after)
    }

    /// The speed of `count` rays, from the mean of the logarithms of both times and the logarithm of their ratio.
    fn about(count: usize, middle: f64, ratio: f64) -> KindSpeed {
        let before_mrays_per_s = count as f64 / 1e6 / (middle + 0.5 * ratio).exp();
        let speedup_ratio = ratio.exp();
        let after_mrays_per_s = before_mrays_per_s * speedup_ratio;
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

/// With fewer ratios than this, a drift is not estimated from them but counts as noise.
const FEWEST_FOR_DRIFT: usize = 6;

/// Factor from [`deviation`] over the root of the number of ratios to half the width of the confidence interval. Found
/// by simulating normal, Laplace, exponential and spiked errors of single times, with and without a drift: the interval
/// contains the true ratio in 95 % or more of all series of 3 or more, but for 93 % at 6.
const CONFIDENCE: f64 = 4.5;

/// Returns the seconds that two tracers take for the same rays, in `repeats` pairs that begin with the first and with the
/// second tracer in turns.
///
/// # Errors
/// Returns the errors of the tracers.
pub fn pairs<T: Tracer>(
    kind: RayKind,
    rays: &T::Rays<'_>,
    tracers: Sides<&T>,
    repeats: u32,
) -> Result<Sides<Vec<f64>>, T::Error> {
    warm_up(kind, rays, [tracers.before, tracers.after])?;
    let mut times = Sides::<Vec<f64>>::default();
    for i in 0..repeats.max(1) {
        let order = if i % 2 == 0 { Side::BOTH } else { [Side::After, Side::Before] };
        for side in order {
            times[side].push(time(kind, rays, tracers[side])?);
        }
    }
    Ok(times)
}

/// Returns the seconds that a tracer takes for rays, as often as asked.
///
/// # Errors
/// Returns the errors of the tracer.
pub fn alone<T: Tracer>(kind: RayKind, rays: &T::Rays<'_>, tracer: &T, repeats: u32) -> Result<Vec<f64>, T::Error> {
    warm_up(kind, rays, [tracer])?;
    (0..repeats.max(1)).map(|_| time(kind, rays, tracer)).collect()
}

/// Returns the seconds that a tracer takes for rays; a clock that did not advance counts as one nanosecond.
fn time<T: Tracer>(kind: RayKind, rays: &T::Rays<'_>, tracer: &T) -> Result<f64, T::Error> {
    Ok(tracer.seconds(kind, rays)?.max(1e-9))
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

/// Returns the uncertainty of the median of seconds, over it; `None` for fewer than three.
#[cfg(feature = "lab")]
pub(crate) fn spread_of_median(seconds: &[f64]) -> Option<f64> {
    let logs: Vec<f64> = seconds.iter().map(|seconds| seconds.ln()).collect();
    Some(half_confidence_interval(&logs)).filter(|spread| spread.is_finite())
}

/// Returns the middle of paired ratios, which begin with either file in turns, and its uncertainty.
fn location(ratios: &[f64]) -> (f64, f64) {
    let of_order = |first: usize| ratios.iter().copied().skip(first).step_by(2);
    if ratios.len() < 2 {
        return (median(ratios), f64::INFINITY);
    }
    let couples = |sign: f64| -> Vec<f64> {
        of_order(0).flat_map(|before_first| of_order(1).map(move |other| 0.5 * (before_first + sign * other))).collect()
    };
    let middle = median(&couples(1.0));
    let drift = if ratios.len() < FEWEST_FOR_DRIFT { 0.0 } else { median(&couples(-1.0)) };
    let turned = |(i, ratio): (usize, &f64)| if i % 2 == 0 { ratio - drift } else { ratio + drift };
    let steady: Vec<f64> = ratios.iter().enumerate().map(turned).collect();
    (middle, half_confidence_interval_about(&steady, middle))
}

/// Returns the uncertainty of the median of numbers.
fn half_confidence_interval(numbers: &[f64]) -> f64 {
    half_confidence_interval_about(numbers, median(numbers))
}

fn half_confidence_interval_about(numbers: &[f64], middle: f64) -> f64 {
    match numbers.len() {
        n if n < FEWEST => f64::INFINITY,
        n => CONFIDENCE * deviation(numbers, middle) / (n as f64).sqrt(),
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
    use super::super::view_speeds::ViewSpeeds;
    use super::super::weights::Weights;
    use super::*;

    /// Returns times of a million rays, in pairs, on a machine that slows down by the given share each time.
    fn drifting(repeats: usize, speedup: f64, drift: f64) -> [Vec<f64>; 2] {
        let clock = |i: usize| (drift * i as f64).exp();
        let at = |i: usize, side: usize| clock(2 * i + (side + i) % 2);
        [0, 1].map(|side| (0..repeats).map(|i| at(i, side) / if side == 1 { speedup } else { 1.0 }).collect())
    }

    fn of(times: &[Vec<f64>; 2]) -> KindSpeed {
        KindSpeed::in_pairs(1_000_000, &times.clone().into())
    }

    /// Returns an approximately normal number: the sum of twelve uniform ones (Irwin and Hall).
    fn normal(random: &mut Random) -> f64 {
        (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
    }

    #[test]
    fn equal_repeats_leave_no_spread() {
        let found = of(&drifting(7, 2.0, 0.0));
        assert_eq!([found.speedup_ratio, found.spread_ratio], [2.0, 0.0]);
        assert!((found.before_mrays_per_s - 1.0).abs() < 1e-12 && (found.after_mrays_per_s - 2.0).abs() < 1e-12);
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
                assert!((found.speedup_ratio - 1.05).abs() < 1e-9 && found.spread_ratio < 1e-9, "{found:?}");
            }
        }
    }

    #[test]
    fn two_levels_of_speed_leave_a_spread() {
        let mut times = drifting(7, 1.0, 0.0);
        times[1][4..].fill(0.8);
        let found = of(&times);
        assert!(found.speedup_ratio < 1.2 && found.spread_ratio > 0.15 && !found.differs(), "{found:?}");
    }

    #[test]
    fn fewer_than_three_repeats_are_no_evidence() {
        for repeats in [1, 2] {
            let found = of(&drifting(repeats, 5.0, 0.0));
            assert!((found.speedup_ratio - 5.0).abs() < 1e-12 && !found.differs(), "{found:?}");
        }
    }

    /// Errors of single times: normal, skewed, and mostly small with a few large delays.
    const NOISE: [fn(&mut Random) -> f64; 3] = [
        |random| 0.03 * normal(random),
        |random| -0.05 * (1.0 - random.unit()).ln(),
        |random| 0.005 * normal(random) - if random.unit() < 0.1 { 0.5 * (1.0 - random.unit()).ln() } else { 0.0 },
    ];

    /// Results of series of repeats with noise.
    fn noisy(series: usize, repeats: usize, speedup: f64, noise: fn(&mut Random) -> f64) -> Vec<KindSpeed> {
        let one = |i: usize| {
            let mut random = Random::at(1, repeats as u64, i);
            let times = drifting(repeats, speedup, 0.002);
            of(&times.map(|side| side.iter().map(|t| t * (1.0 + noise(&mut random))).collect()))
        };
        (0..series).map(one).collect()
    }

    #[test]
    fn noise_stays_within_the_spread_in_about_95_of_100_series() {
        for (repeats, least) in [(3, 0.94), (5, 0.95), (6, 0.92), (7, 0.94), (15, 0.98)] {
            for noise in NOISE {
                let series = noisy(2000, repeats, 1.2, noise);
                let within =
                    series.iter().filter(|found| (found.speedup_ratio - 1.2).abs() <= found.spread_ratio).count();
                let share = within as f64 / 2000.0;
                assert!(share >= least, "{share} of {repeats} repeats");
            }
        }
    }

    /// What `verify FILE FILE` measures: no noise, however skewed, makes the one file seem faster than the other.
    #[test]
    fn a_file_is_as_fast_as_itself() {
        for noise in NOISE {
            let series = noisy(20_000, 7, 1.0, noise);
            let ratios: Vec<f64> = series.iter().map(|found| found.speedup_ratio).collect();
            assert!((median(&ratios) - 1.0).abs() < 0.002, "{}", median(&ratios));
            // As views and kinds are put together, over which the claim of a report is made.
            let reports = series.chunks(12).map(|cells| {
                let views = cells.chunks(3).map(|of| [of[0], of[1], of[2], KindSpeed::default()].into());
                ViewSpeeds(views.collect()).overall(&Weights::default())
            });
            let claims = reports.take(200).filter(|all| (all.speedup_ratio - 1.0).abs() > all.spread_ratio).count();
            assert!(claims <= 10, "{claims} of 200 reports claim a difference");
        }
    }

    #[test]
    fn exchanging_the_files_turns_the_speedup_into_its_reciprocal() {
        let [before, after] = drifting(7, 1.3, 0.0);
        let mut random = Random::at(3, 0, 0);
        let [before, after] =
            [before, after].map(|of| of.iter().map(|t| t * (1.0 + random.unit())).collect::<Vec<f64>>());
        let (here, there) = (of(&[before.clone(), after.clone()]), of(&[after, before]));
        assert!((here.speedup_ratio * there.speedup_ratio - 1.0).abs() < 1e-12, "{here:?} {there:?}");
        let [a, b] = [here, there].map(|speed| speed.spread_ratio / speed.speedup_ratio);
        assert!((a - b).abs() < 1e-12);
    }

    #[test]
    fn what_lies_within_the_spread_is_no_difference() {
        let kind = |speedup_ratio| KindSpeed { speedup_ratio, spread_ratio: 0.05, ..KindSpeed::default() };
        assert!(!kind(1.04).differs() && !kind(0.96).differs());
        assert!(kind(1.06).differs() && kind(0.94).differs());
    }

    #[test]
    fn without_pairs_the_spreads_add_up() {
        let times = [1.0, 1.25, 1.0];
        let apart = KindSpeed::one_after_the_other(1_000_000, &[times.to_vec(), vec![0.5, 0.5, 0.5]].into());
        assert!((apart.before_mrays_per_s - 1.0).abs() < 1e-12 && (apart.speedup_ratio - 2.0).abs() < 1e-12);
        let spread = half_confidence_interval(&times.map(f64::ln));
        assert!((apart.spread_ratio - 2.0 * spread).abs() < 1e-12);
        let both = KindSpeed::one_after_the_other(1_000_000, &[times.to_vec(), times.to_vec()].into());
        assert!((both.spread_ratio - 2.0 * spread).abs() < 1e-12);
        assert!(!KindSpeed::one_after_the_other(1, &[vec![9.0; 2], vec![1.0; 2]].into()).differs());
    }

    #[test]
    fn exact_times_have_no_spread() {
        let found = KindSpeed::exact(3_000_000, Sides { before: 2.0, after: 1.0 });
        assert!((found.speedup_ratio - 2.0).abs() < 1e-12 && (found.after_mrays_per_s - 3.0).abs() < 1e-12);
        assert_eq!(found.spread_ratio, 0.0);
        assert_eq!(KindSpeed::exact(3, Sides { before: 0.0, after: 0.0 }), KindSpeed::default());
    }

    #[test]
    fn no_rays_have_no_speed() {
        assert_eq!(KindSpeed::in_pairs(0, &[vec![0.0], vec![0.0]].into()), KindSpeed::default());
        assert_eq!(KindSpeed::in_pairs(7, &[Vec::new(), vec![1.0]].into()), KindSpeed::default());
        assert_eq!(KindSpeed::one_after_the_other(7, &[vec![1.0], Vec::new()].into()), KindSpeed::default());
    }

    #[test]
    fn the_median_of_an_even_number_is_between_the_middle_two() {
        assert_eq!([median(&[4.0, 1.0, 2.0, 10.0]), median(&[5.0])], [3.0, 5.0]);
    }
}
