//! How fast both scenes are traced.

use serde::Serialize;

use super::Tracer;
use super::rays::RayKind;

/// Speed of one kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct KindSpeed {
    /// Million rays a second through the input, median over the repeats; 0 without rays.
    pub before_mrays_per_s: f64,
    /// The same through the output.
    pub after_mrays_per_s: f64,
    /// After over before; 1 without rays.
    pub speedup_ratio: f64,
    /// Largest less smallest speed over the median, of before or after, whichever is more.
    pub spread_ratio: f64,
}

impl KindSpeed {
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

/// Speed by kind of rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Kinds {
    /// [`RayKind::Primary`].
    pub primary: KindSpeed,
    /// [`RayKind::Shadow`].
    pub shadow: KindSpeed,
    /// [`RayKind::Diffuse`].
    pub diffuse: KindSpeed,
    /// [`RayKind::Random`].
    pub random: KindSpeed,
}

impl Kinds {
    /// The entry of a kind.
    pub fn of(&mut self, kind: RayKind) -> &mut KindSpeed {
        match kind {
            RayKind::Primary => &mut self.primary,
            RayKind::Shadow => &mut self.shadow,
            RayKind::Diffuse => &mut self.diffuse,
            RayKind::Random => &mut self.random,
        }
    }

    /// All kinds with their names.
    pub fn named(&self) -> [(&'static str, KindSpeed); 4] {
        [("primary", self.primary), ("shadow", self.shadow), ("diffuse", self.diffuse), ("random", self.random)]
    }

    /// The kinds that light a picture: all but random lines.
    pub fn lighting(&self) -> [KindSpeed; 3] {
        [self.primary, self.shadow, self.diffuse]
    }
}

/// Successive times that differ by less than this share have settled.
const SETTLED_RATIO: f64 = 0.01;

/// Times `count` rays through both scenes, in turns, so that a drift of the machine's speed meets both alike.
///
/// # Errors
/// Those of the tracers.
pub fn measure<T: Tracer>(
    kind: RayKind,
    count: usize,
    rays: &T::Rays<'_>,
    tracers: [&T; 2],
    repeats: u32,
) -> Result<KindSpeed, T::Error> {
    if count == 0 {
        return Ok(KindSpeed::default());
    }
    warm_up(kind, rays, tracers)?;
    let mut speeds = [Vec::new(), Vec::new()];
    for _ in 0..repeats.max(1) {
        for (tracer, speeds) in tracers.into_iter().zip(&mut speeds) {
            // A clock that did not advance counts as one nanosecond.
            speeds.push(count as f64 / tracer.seconds(kind, rays)?.max(1e-9) / 1e6);
        }
    }
    let [(before, spread_before), (after, spread_after)] = speeds.map(median_and_spread);
    Ok(KindSpeed {
        before_mrays_per_s: before,
        after_mrays_per_s: after,
        speedup_ratio: after / before,
        spread_ratio: spread_before.max(spread_after),
    })
}

/// Traces until both times settle, or as often as the tracer needs at most.
fn warm_up<T: Tracer>(kind: RayKind, rays: &T::Rays<'_>, tracers: [&T; 2]) -> Result<(), T::Error> {
    let mut last = [0.0; 2];
    for _ in 0..tracers[0].pace().most_warm_ups {
        let now = [tracers[0].seconds(kind, rays)?, tracers[1].seconds(kind, rays)?];
        if (0..2).all(|i| (now[i] - last[i]).abs() < SETTLED_RATIO * now[i]) {
            break;
        }
        last = now;
    }
    Ok(())
}

/// The median of some positive numbers, and the range they span over the median.
fn median_and_spread(mut numbers: Vec<f64>) -> (f64, f64) {
    numbers.sort_by(f64::total_cmp);
    let (low, high) = (numbers[(numbers.len() - 1) / 2], numbers[numbers.len() / 2]);
    let median = 0.5 * (low + high);
    (median, (numbers[numbers.len() - 1] - numbers[0]) / median)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_within_the_spread_is_no_difference() {
        let kind = |speedup_ratio| KindSpeed { speedup_ratio, spread_ratio: 0.05, ..KindSpeed::default() };
        assert!(!kind(1.04).differs() && !kind(0.96).differs());
        assert!(kind(1.06).differs() && kind(0.94).differs());
    }

    #[test]
    fn the_median_of_an_even_number_is_between_the_middle_two() {
        assert_eq!(median_and_spread(vec![4.0, 1.0, 2.0, 10.0]), (3.0, 3.0));
        assert_eq!(median_and_spread(vec![5.0]), (5.0, 0.0));
    }
}
