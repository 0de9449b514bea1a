//! Candidates that are timed elsewhere: written by a machine without a device, timed by one that has one.

use super::NotTimed;
use super::bounds::Bounds;
use super::candidate::Candidate;
use super::decide::{self, Timed};
use super::passes;
use crate::layout::{Layout, PlacedTrees};
use crate::methods::PlanId;
use crate::scene::{Overlay, Scene};
use crate::verify::weights::Overall;
use crate::verify::{Machine, Timing, VerifyOptions};

/// A candidate that is worth timing, ready to be written.
pub struct Contender {
    /// Its plan.
    pub plan: PlanId,
    /// Its layout.
    pub layout: Layout,
    /// The pins that it was laid out with.
    pub overlay: Overlay,
    /// Predicted picoseconds per ray.
    pub sampled_cost: f64,
    /// Predicted bytes of acceleration structures.
    pub as_bytes: u64,
}

/// Returns some candidates as they would be written, without those that exceed the bounds.
pub(super) fn contenders(
    scene: &Scene,
    candidates: &[Candidate],
    contenders: &[usize],
    placed: &PlacedTrees,
    bounds: &Bounds,
) -> Vec<Contender> {
    let allowed = bounds.allow(candidates);
    let of = |&i: &usize| {
        let Candidate { plan, laid, predicted, .. } = &candidates[i];
        let mut layout = Layout::clone(&laid.layout);
        passes::order(&scene.overlaid(&laid.overlay), &mut layout, placed);
        let (sampled_cost, as_bytes) = (predicted.picoseconds, predicted.as_bytes);
        Contender { plan: plan.id, layout, overlay: laid.overlay.clone(), sampled_cost, as_bytes }
    };
    contenders.iter().filter(|&&i| allowed[i]).map(of).collect()
}

/// How contenders did on a device.
#[derive(Clone, Debug, Default)]
pub struct RacedContenders {
    /// The speed of each over the input's in the views that choose, or why the device could not take it.
    pub speeds: Vec<Result<Overall, String>>,
    /// Its speed in the views that judge, if it was the fastest in those that choose.
    pub judged: Vec<Option<Overall>>,
    /// The one that wins; `None`: the input.
    pub winner: Option<usize>,
}

/// Times contenders and decides between them as `auto` does. `scene_of` gives the scene of the contender of a number,
/// `as_bytes` their predicted bytes; `must_change`: the input itself may not win, because it exceeds a bound.
///
/// # Errors
/// Fails if there is no device, or it cannot take the input.
pub fn race_contenders(
    input: &Scene,
    scene_of: impl Fn(usize) -> Scene + Sync,
    as_bytes: &[u64],
    must_change: bool,
    machine: &Machine,
    options: &VerifyOptions,
) -> Result<RacedContenders, NotTimed> {
    let race = |of: &[usize], care| -> Result<Vec<Result<Overall, String>>, NotTimed> {
        let laps = machine.race(input, of.len(), |i| scene_of(of[i]), care, options).ok_or(NotTimed::NoDevice)?;
        let overall = laps.map_err(NotTimed::Failed)?.into_iter().map(|lap| Ok(lap?.views.overall(&options.weights)));
        Ok(overall.collect())
    };
    let all: Vec<usize> = (0..as_bytes.len()).collect();
    let mut raced = RacedContenders { speeds: race(&all, Timing::Full)?, judged: vec![None; all.len()], winner: None };
    loop {
        let timed: Vec<Timed> = all.iter().filter_map(|&i| raced.timed(i, as_bytes[i])).collect();
        raced.winner = decide::fastest(&timed, must_change, options.least_view_ratio).map(|best| best.id);
        let Some(winner) = raced.winner.filter(|&i| !must_change && raced.judged[i].is_none()) else {
            return Ok(raced);
        };
        match race(&[winner], Timing::Judging)?.pop() {
            Some(Ok(judged)) => raced.judged[winner] = Some(judged),
            Some(Err(why)) => raced.speeds[winner] = Err(why),
            None => return Ok(raced),
        }
    }
}

impl RacedContenders {
    fn timed(&self, id: usize, as_bytes: u64) -> Option<Timed> {
        let speed = *self.speeds[id].as_ref().ok()?;
        Some(Timed { id, speed, judged: self.judged[id], as_bytes })
    }
}
