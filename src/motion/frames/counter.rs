//! Counts the steps of rays through trees that have aged as those of a policy.

use std::collections::BTreeMap;

use super::{Compared, FrameOptions};
use crate::motion::MovingScene;
use crate::scene::Scene;
use crate::verify::PerKind;
use crate::verify::cpu::{Bottoms, CpuTracer, MovingTop};
use crate::verify::frames::Upkeep;
use crate::verify::rays::{Ray, RayKind};
use crate::verify::work::Work;

/// Trees of the CPU, made only for frames that are counted: built as of the frame of the policy's last rebuild, then
/// refitted to the present one.
pub(super) struct Counter<'a> {
    options: &'a FrameOptions,
    bottoms: Bottoms,
    /// By the frame in which they were built; several policies can share one.
    tops: BTreeMap<u32, MovingTop>,
}

impl<'a> Counter<'a> {
    pub(super) fn new(scene: &Scene, options: &'a FrameOptions) -> Counter<'a> {
        Counter { options, bottoms: Bottoms::build(scene), tops: BTreeMap::new() }
    }

    /// Returns the steps of rays in the present frame, by policy. The scene is left at the time of the frame.
    pub(super) fn count(&mut self, frame: u32, moving: &mut MovingScene, rays: &PerKind<Vec<Ray>>) -> Vec<Compared> {
        let built: Vec<u32> = self.options.policies.iter().map(|policy| policy.last_rebuild(frame)).collect();
        self.tops.retain(|number, _| built.contains(number));
        for &number in &built {
            if !self.tops.contains_key(&number) {
                self.advance(moving, number);
                self.tops.insert(number, MovingTop::build(&self.bottoms, moving.scene()));
            }
        }
        self.advance(moving, frame);
        let mut by_age: BTreeMap<u32, PerKind<Work>> = BTreeMap::new();
        for (number, top) in &mut self.tops {
            top.refit(&self.bottoms, moving.scene());
            by_age.insert(*number, work(top, rays));
        }
        let fresh = match by_age.get(&frame) {
            Some(fresh) => *fresh,
            None => work(&MovingTop::build(&self.bottoms, moving.scene()), rays),
        };
        built.iter().map(|number| Compared { aged: by_age[number], fresh }).collect()
    }
}

impl Counter<'_> {
    /// Moves everything to where it is in a frame, with the trees of what deforms.
    fn advance(&mut self, moving: &mut MovingScene, frame: u32) {
        moving.advance(self.options.time(frame));
        match self.options.blas_upkeep {
            Upkeep::Refit => self.bottoms.refit(moving.scene(), moving.deforming()),
            Upkeep::Rebuild => self.bottoms.rebuild(moving.scene(), moving.deforming()),
        }
    }
}

fn work(top: &MovingTop, rays: &PerKind<Vec<Ray>>) -> PerKind<Work> {
    let tracer = CpuTracer::new(top.trees());
    PerKind::of(|kind| tracer.steps(&rays[kind], kind == RayKind::Shadow).iter().collect())
}

impl Compared {
    /// Returns the seconds that the steps of all kinds cost on a CPU, over those through new trees; 1 if there are none.
    pub fn work_ratio(&self) -> f64 {
        let seconds = |work: &PerKind<Work>| work.values().map(Work::seconds).sum::<f64>();
        let ratio = seconds(&self.aged) / seconds(&self.fresh);
        if ratio.is_finite() { ratio } else { 1.0 }
    }
}
