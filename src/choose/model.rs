//! What rays cost on a device, predicted from what they meet on the CPU.
//!
//! SAH sees neither occlusion nor the order in which rays meet boxes. So rays of all kinds are traced on the CPU through
//! the two levels of a layout, and what they meet is counted: nodes of the TLAS, instances entered, nodes of BLASes. Of 32
//! neighbouring rays the largest counts hold for all, as a GPU runs them in step. Good enough to rank layouts, not to
//! decide between close ones: see [`Class::NoRtCores`].

use crate::verify::cpu::{CpuTracer, Steps, TwoLevel};
use crate::verify::rays::{RayKind, Rays};
use crate::verify::weights::Weights;

/// Rays that run in step.
const IN_STEP: usize = 32;

/// What kind of device the rays of the user run on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Class {
    /// Traversal in software on ordinary cores, as on an NVIDIA H200.
    ///
    /// Prices fitted there over 97 layouts of 15 real scenes by non-negative least squares on relative errors, with the
    /// scene predicted left out: correlation of the logarithms of measured and predicted ratios to one BLAS 0.61 to 0.81,
    /// RMS error of the ratio 24 % to 36 %; what the model picks is 0.90 to 0.99 of the best, by kind of rays.
    #[default]
    NoRtCores,
    /// Traversal in hardware. Not fitted: no such device was at hand. Node steps are taken to be half as dear against an
    /// entry as in software, since a hardware unit steps through nodes while the entry still fetches a transform.
    RtCores,
}

/// Picoseconds a ray, and for each thing it meets.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Prices {
    ray: f64,
    top: f64,
    entry: f64,
    bottom: f64,
}

impl Class {
    /// All classes.
    pub const ALL: [Class; 2] = [Class::NoRtCores, Class::RtCores];

    /// The name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Class::NoRtCores => "no-rt-cores",
            Class::RtCores => "rt-cores",
        }
    }

    /// The table of prices, in the order of [`RayKind::ALL`].
    fn prices(self) -> [Prices; 4] {
        let prices = |ray, top, entry, bottom| Prices { ray, top, entry, bottom };
        match self {
            Class::NoRtCores => [
                prices(38.0, 2.5, 24.1, 3.3),
                prices(38.0, 2.5, 24.1, 3.3),
                prices(50.0, 5.8, 23.7, 5.4),
                prices(61.0, 1.6, 27.7, 4.9),
            ],
            Class::RtCores => {
                Class::NoRtCores.prices().map(|p| Prices { top: 0.5 * p.top, bottom: 0.5 * p.bottom, ..p })
            }
        }
    }
}

/// The rays by which layouts of a scene are ranked.
pub(super) struct Ranking<'a> {
    pub(super) rays: &'a Rays,
    pub(super) class: Class,
    pub(super) weights: Weights,
}

impl Ranking<'_> {
    /// Picoseconds a ray through a scene, in the weighted mean over the kinds of rays.
    pub(super) fn picoseconds(&self, trees: &TwoLevel) -> f64 {
        let tracer = CpuTracer::new(trees);
        let prices = self.class.prices();
        let of_kind = |i: usize| match self.weights.0[i] {
            0.0 => 0.0,
            _ => prices[i].of(&tracer.steps(&self.rays.kinds[i], RayKind::ALL[i] == RayKind::Shadow)),
        };
        self.weights.mean([0, 1, 2, 3].map(of_kind))
    }
}

impl Prices {
    /// The mean over rays that met what is given, groups of neighbours in step.
    fn of(&self, steps: &[Steps]) -> f64 {
        let largest = |group: &[Steps], of: fn(&Steps) -> u32| f64::from(group.iter().map(of).max().unwrap_or(0));
        let group = |group: &[Steps]| {
            let met = self.top * largest(group, |s| s.top)
                + self.entry * largest(group, |s| s.entries)
                + self.bottom * largest(group, |s| s.bottom);
            group.len() as f64 * met
        };
        let sum: f64 = steps.chunks(IN_STEP).map(group).sum();
        self.ray + sum / steps.len().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_wait_for_the_slowest_of_them() {
        let prices = Prices { ray: 1.0, top: 10.0, entry: 100.0, bottom: 1000.0 };
        let mut steps = vec![Steps::default(); 64];
        assert_eq!(prices.of(&steps), 1.0);
        (steps[3].top, steps[9].entries, steps[40].bottom) = (1, 2, 1);
        assert_eq!(prices.of(&steps), 1.0 + 0.5 * (10.0 + 200.0) + 0.5 * 1000.0);
        assert_eq!(prices.of(&[]), 1.0);
    }

    #[test]
    fn every_class_charges_for_everything() {
        for prices in Class::ALL.map(Class::prices).concat() {
            assert!([prices.ray, prices.top, prices.entry, prices.bottom].iter().all(|p| *p > 0.0));
        }
    }
}
