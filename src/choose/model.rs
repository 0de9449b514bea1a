//! Predicts ray costs on a device from what rays traverse on the CPU.
//!
//! SAH models neither occlusion nor the order in which rays meet boxes. Therefore rays of all kinds are traced on the
//! CPU through the two levels of a layout, and what they traverse is counted: TLAS nodes, instances entered, BLAS
//! nodes. Each group of 32 neighbouring rays is charged its largest counts, because a GPU runs them in lockstep. This
//! is accurate enough to rank layouts, but not to decide between close ones: see [`Class::NoRtCores`].

use glam::DVec3;
use serde::Serialize;

use crate::layout::BlasPer;
use crate::verify::PerKind;
use crate::verify::cpu::{CpuTracer, Steps, TwoLevel};
use crate::verify::rays::{Ray, RayKind, Rays};
use crate::verify::weights::Weights;

/// Rays that run in lockstep.
const IN_STEP: usize = 32;

/// Groups of neighbours that are traced first to estimate the work of all rays.
const PROBES: usize = 2;

/// Traversal steps after which no more rays are traced; reached if very many boxes overlap in one place.
const MOST_STEPS: u64 = 1 << 26;

/// Selects `groups` groups of neighbouring rays, at least one, evenly spread over all rays.
fn spread(rays: &[Ray], groups: usize) -> Vec<Ray> {
    let step = rays.len().div_ceil(IN_STEP).div_ceil(groups.max(1)).max(1);
    rays.chunks(IN_STEP).step_by(step).flatten().copied().collect()
}

/// Class of the device that the user's rays run on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Class {
    /// Software traversal on general-purpose cores, as on an NVIDIA H200.
    ///
    /// Prices were fitted there by `raykiln lab` (see docs/lab.md) to 121 layouts of 12 scenes, by non-negative least
    /// squares on relative errors, which are 18 % to 29 % (RMS) depending on the ray kind. With leave-one-scene-out
    /// validation, the logarithms of measured and predicted ratios to one BLAS correlate by 0.84; the layout that the
    /// model picks reaches 0.954 of the best speed on average and 0.786 at worst.
    #[default]
    NoRtCores,
    /// Hardware traversal. Not fitted, because no such device was available. Relative to an entry, node steps are
    /// assumed to cost half as much as in software: a hardware unit steps through nodes, while an entry still fetches a
    /// transform.
    RtCores,
}

/// Prices in picoseconds, per ray and per thing it traverses; each at least 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Prices {
    /// Per ray, whatever it meets.
    pub ray: f64,
    /// Per TLAS node.
    #[serde(rename = "tlas_node")]
    pub top: f64,
    /// Per instance entered.
    pub entry: f64,
    /// Per BLAS node.
    #[serde(rename = "blas_node")]
    pub bottom: f64,
}

/// Predictions for a layout as its consumer builds it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Predicted {
    /// Two-level cost.
    pub two_level_cost: f64,
    /// Bytes of BLASes and TLAS.
    pub as_bytes: u64,
    /// Counts and times per ray kind; zero for kinds that were not traced.
    pub kinds: PerKind<RayCost>,
    /// Picoseconds per ray: weighted mean over ray kinds.
    pub picoseconds: f64,
}

/// Traversal counts of one ray kind in a layout, and the time predicted from them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RayCost {
    /// Mean counts per ray.
    pub counts: Counts,
    /// Picoseconds per ray at the prices of the device class.
    pub picoseconds: f64,
}

/// Mean traversal counts per ray; each of [`IN_STEP`] neighbours is charged the largest count among them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// TLAS nodes.
    pub top: f64,
    /// Instances entered.
    pub entries: f64,
    /// BLAS nodes.
    pub bottom: f64,
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

    /// The prices for each ray kind. `raykiln lab` fits them: see `docs/lab.md`.
    pub fn prices(self) -> PerKind<Prices> {
        let prices = |ray, top, entry, bottom| Prices { ray, top, entry, bottom };
        match self {
            Class::NoRtCores => PerKind::of(|kind| match kind {
                RayKind::Primary => prices(0.0, 5.3, 17.5, 10.2),
                RayKind::Shadow => prices(0.0, 6.4, 19.4, 10.1),
                RayKind::Diffuse => prices(0.0, 10.3, 34.8, 13.4),
                RayKind::Random => prices(8.8, 12.1, 0.0, 13.9),
            }),
            Class::RtCores => {
                Class::NoRtCores.prices().map(|p| Prices { top: 0.5 * p.top, bottom: 0.5 * p.bottom, ..p })
            }
        }
    }
}

/// The rays that the layouts of a scene are ranked by.
pub(super) struct Ranking<'a> {
    pub(super) rays: &'a Rays,
    /// The point in the scene that is the origin for these rays.
    pub(super) vantage: DVec3,
    pub(super) class: Class,
    pub(super) weights: Weights,
    /// Whether ray kinds that weigh 0 are traced too.
    pub(super) all_kinds: bool,
    /// How layouts are built.
    pub(super) blas_per: BlasPer,
}

impl Ranking<'_> {
    /// Returns counts and predicted times through a scene per ray kind; zero for kinds that are not traced.
    pub(super) fn costs(&self, trees: &TwoLevel) -> PerKind<RayCost> {
        let tracer = CpuTracer::new(trees);
        let prices = self.class.prices();
        PerKind::of(|kind: RayKind| {
            if self.weights.0[kind] == 0.0 && !self.all_kinds {
                return RayCost::default();
            }
            let counts = Counts::of(&tracer, &self.rays.kinds[kind], kind);
            RayCost { counts, picoseconds: prices[kind].of(&counts) }
        })
    }
}

impl Counts {
    /// Counts what rays of a kind traverse until they find what they look for.
    pub fn of(tracer: &CpuTracer<'_>, rays: &[Ray], kind: RayKind) -> Counts {
        let steps = |rays: &[Ray]| tracer.steps(rays, kind == RayKind::Shadow);
        let probe = spread(rays, PROBES);
        let met: u64 = steps(&probe).iter().map(Steps::total).sum();
        let affordable = MOST_STEPS * PROBES as u64 / met.max(1);
        match affordable < rays.len().div_ceil(IN_STEP) as u64 {
            true => Counts::in_step(&steps(&spread(rays, affordable as usize))),
            false => Counts::in_step(&steps(rays)),
        }
    }

    fn in_step(steps: &[Steps]) -> Counts {
        let mean = |of: fn(&Steps) -> u32| {
            let largest = |group: &[Steps]| group.iter().map(of).max().unwrap_or(0);
            let sum: f64 = steps.chunks(IN_STEP).map(|g| g.len() as f64 * f64::from(largest(g))).sum();
            sum / steps.len().max(1) as f64
        };
        Counts { top: mean(|s| s.top), entries: mean(|s| s.entries), bottom: mean(|s| s.bottom) }
    }
}

impl Prices {
    /// Picoseconds per ray with the given counts.
    pub fn of(&self, met: &Counts) -> f64 {
        self.ray + self.top * met.top + self.entry * met.entries + self.bottom * met.bottom
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_wait_for_the_slowest_of_them() {
        let prices = Prices { ray: 1.0, top: 10.0, entry: 100.0, bottom: 1000.0 };
        let mut steps = vec![Steps::default(); 64];
        let of = |steps: &[Steps]| prices.of(&Counts::in_step(steps));
        assert_eq!(of(&steps), 1.0);
        (steps[3].top, steps[9].entries, steps[40].bottom) = (1, 2, 1);
        assert_eq!(of(&steps), 1.0 + 0.5 * (10.0 + 200.0) + 0.5 * 1000.0);
        assert_eq!(of(&[]), 1.0);
    }

    #[test]
    fn neighbours_stay_together_when_few_rays_are_looked_at() {
        let ray =
            |i: u16| Ray { origin: glam::Vec3::X * f32::from(i), direction: glam::Vec3::Z, t_min: 0.0, t_max: 1.0 };
        let rays: Vec<Ray> = (0..1000).map(ray).collect();
        let starts = |groups| spread(&rays, groups).iter().map(|ray| ray.origin.x as usize).collect::<Vec<_>>();
        assert_eq!(starts(2), [(0..32).collect::<Vec<_>>(), (512..544).collect()].concat());
        assert_eq!(starts(0), (0..32).collect::<Vec<_>>());
        assert_eq!(starts(1000), (0..1000).collect::<Vec<_>>());
        assert!(spread(&[], 8).is_empty());
    }

    #[test]
    fn every_class_charges_for_every_node() {
        for prices in Class::ALL.iter().flat_map(|class| class.prices().values().copied().collect::<Vec<_>>()) {
            let all = [prices.ray, prices.top, prices.entry, prices.bottom];
            assert!(all.iter().all(|p| *p >= 0.0) && prices.top > 0.0 && prices.bottom > 0.0);
        }
    }
}
