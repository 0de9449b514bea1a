//! What was measured of a scene.

use super::scenes::Found;
use super::trials::Trial;
use crate::lab::bench::RunRow;

/// A scene with its trials.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub(super) found: Found,
    pub(super) trials: Vec<(Trial, RunRow)>,
}

impl Measured {
    /// Returns the row of a trial.
    pub(super) fn row(&self, trial: Trial) -> Option<&RunRow> {
        self.trials.iter().find(|(of, _)| *of == trial).map(|(_, row)| row)
    }

    /// Returns the speed of a trial with all kinds of rays and its uncertainty, in million rays per second.
    pub(super) fn speed(&self, trial: Trial) -> Option<(f64, f64)> {
        let row = self.row(trial).filter(|row| row.all_mrays_per_s > 0.0)?;
        Some((row.all_mrays_per_s, row.all_mrays_per_s * row.all_spread_ratio.unwrap_or(0.0)))
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
