//! What was measured of a scene.

use super::scenes::Found;
use super::trials::Trial;
use crate::lab::bench::{MotionRun, RunRow};

/// A scene with its trials.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub(super) found: Found,
    /// Without instances.
    pub(super) trials: Vec<(Trial, RunRow)>,
    /// With numbers of instances.
    pub(super) crowds: Vec<Crowded>,
}

/// A scene with instances.
#[derive(Clone, Debug)]
pub(super) struct Crowded {
    /// Number of instances.
    pub(super) instances: usize,
    /// `None` for the instances without the scene.
    pub(super) trial: Option<Trial>,
    pub(super) row: RunRow,
}

/// Returns the speed of a row with all kinds of rays and its uncertainty, in million rays per second.
fn speed_of(row: &RunRow) -> Option<(f64, f64)> {
    let speed = row.all_mrays_per_s;
    (speed > 0.0).then(|| (speed, speed * row.all_spread_ratio.unwrap_or(0.0)))
}

impl Measured {
    /// Returns the row of a trial.
    pub(super) fn row(&self, trial: Trial) -> Option<&RunRow> {
        self.trials.iter().find(|(of, _)| *of == trial).map(|(_, row)| row)
    }

    /// Returns the speed of a trial with all kinds of rays and its uncertainty, in million rays per second.
    pub(super) fn speed(&self, trial: Trial) -> Option<(f64, f64)> {
        self.row(trial).and_then(speed_of)
    }

    /// Returns the speed with a number of instances, of the instances alone without a trial.
    pub(super) fn crowd(&self, instances: usize, trial: Option<Trial>) -> Option<(f64, f64)> {
        self.crowd_row(instances, trial).and_then(speed_of)
    }

    /// Returns the frames in which a number of instances move, of the instances alone without a trial.
    pub(super) fn motion(&self, instances: usize, trial: Option<Trial>) -> Option<&MotionRun> {
        self.crowd_row(instances, trial)?.motion.as_ref()
    }

    fn crowd_row(&self, instances: usize, trial: Option<Trial>) -> Option<&RunRow> {
        let is_it = |of: &&Crowded| of.instances == instances && of.trial == trial;
        self.crowds.iter().find(is_it).map(|of| &of.row)
    }

    /// Returns the fastest of some trials.
    pub(super) fn fastest(&self, trials: &[Trial]) -> Option<Trial> {
        let timed = trials.iter().filter_map(|&trial| Some((trial, self.speed(trial)?.0)));
        timed.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(trial, _)| trial)
    }

    /// Whether the speeds of two trials differ by no more than their uncertainties.
    pub(super) fn are_alike(&self, a: Trial, b: Trial) -> bool {
        match (self.speed(a), self.speed(b)) {
            (Some(a), Some(b)) => (a.0 - b.0).abs() <= a.1 + b.1,
            _ => false,
        }
    }
}

/// Returns the scene that stands for one of table 5.1: itself or, if it is not at hand, the one with the most triangles.
pub(super) fn standing_for(of: usize, scenes: &[Measured]) -> Option<&Measured> {
    let triangles = |scene: &&Measured| scene.trials.first().map_or(0, |(_, row)| row.triangles);
    scenes.iter().find(|scene| scene.found.of == Some(of)).or_else(|| scenes.iter().max_by_key(triangles))
}
