//! How fast both scenes are traced.

use serde::Serialize;

use super::Tracer;
use super::rays::{Ray, RayKind};

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

/// Times rays through both scenes, in turns, so that a drift of the machine's speed meets both alike. The rays should
/// have been traced once before.
pub fn measure(kind: RayKind, rays: &[Ray], tracers: [&dyn Tracer; 2], repeats: u32) -> KindSpeed {
    if rays.is_empty() {
        return KindSpeed::default();
    }
    let mut speeds = [Vec::new(), Vec::new()];
    for _ in 0..repeats.max(1) {
        for (tracer, speeds) in tracers.into_iter().zip(&mut speeds) {
            // A clock that did not advance counts as one nanosecond.
            speeds.push(rays.len() as f64 / tracer.seconds(kind, rays).max(1e-9) / 1e6);
        }
    }
    let [(before, spread_before), (after, spread_after)] = speeds.map(median_and_spread);
    KindSpeed {
        before_mrays_per_s: before,
        after_mrays_per_s: after,
        speedup_ratio: after / before,
        spread_ratio: spread_before.max(spread_after),
    }
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
    fn the_median_of_an_even_number_is_between_the_middle_two() {
        assert_eq!(median_and_spread(vec![4.0, 1.0, 2.0, 10.0]), (3.0, 3.0));
        assert_eq!(median_and_spread(vec![5.0]), (5.0, 0.0));
    }
}
