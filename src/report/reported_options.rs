//! The options of a bake, and the speed that its verdict is based on.

use serde::Serialize;

use crate::verify::weights::Weights;
use crate::verify::{MachineKind, PerKind, Verification};

/// The options of a bake that determine what is written and how it is judged.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReportedOptions {
    /// How many candidates `auto` considers, from 0 to 6.
    pub effort: u8,
    /// The device class that costs are predicted for.
    pub device_class: &'static str,
    /// Weight of each ray kind.
    pub weights: PerKind<f64>,
    /// Number of views that rays come from.
    pub views: u32,
    /// Seed of the views and rays.
    pub seed: u64,
    /// Number of rays of each kind that are compared.
    pub rays: u32,
    /// Number of timing repeats per ray kind and view.
    pub repeats: u32,
    /// Least speedup of any judging view with which the output counts as faster.
    pub least_view_ratio: f64,
    /// Largest distance a vertex may move, over the scene's diagonal.
    pub max_position_error_ratio: f64,
    /// Predicted bytes of acceleration structures allowed over the input's, including `auto`'s own limit; `None`: no
    /// limit.
    pub max_bytes_ratio: Option<f64>,
    /// Maximum number of triangles per group; `None`: no limit.
    pub max_group_triangles: Option<u32>,
    /// Longest side of a group's box over that of the scene; `None`: no limit.
    pub max_group_extent_ratio: Option<f64>,
    /// Whether what encloses the rest or lies far outside gets groups of its own; `None`: if it pays.
    pub isolate: Option<bool>,
    /// Whether triangles that are not opaque get groups of their own; `None`: if it pays.
    pub split_opacity: Option<bool>,
    /// Whether groups may be stored in frames of their own.
    pub frames: bool,
    /// Names of instances that stay as they are.
    pub keep: Vec<String>,
}

/// The speed, weighted over ray kinds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Speed {
    /// What it was measured on: `gpu`, `software driver` or `cpu`. Only `gpu` is representative of users' devices.
    pub measured_on: MachineKind,
    /// Million rays per second through the input; 0 without rays.
    pub before_mrays_per_s: f64,
    /// Million rays per second through the output.
    pub after_mrays_per_s: f64,
    /// The input's time over the output's; 1 without rays.
    pub speedup_ratio: f64,
    /// Uncertainty of `speedup_ratio`, over repeats and views; infinite (`null` in JSON) if there are too few repeats.
    pub spread_ratio: f64,
    /// Uncertainty over repeats alone.
    pub repeats_spread_ratio: f64,
    /// Uncertainty over views alone: the standard error of the mean of their speedups.
    pub views_spread_ratio: f64,
    /// The least speedup of any view that judges.
    pub least_view_ratio: f64,
    /// The largest speedup of any view that judges.
    pub most_view_ratio: f64,
}

impl Speed {
    /// Returns what a verification measured; `kind` is what it should be measured on.
    pub fn of(verification: &Verification, weights: &Weights, kind: MachineKind) -> Speed {
        // If the device cannot take a scene, the CPU traces instead.
        let kind = if verification.structures.is_none() { MachineKind::Cpu } else { kind };
        let all = verification.overall(weights);
        Speed {
            measured_on: kind,
            before_mrays_per_s: all.before_mrays_per_s,
            after_mrays_per_s: all.after_mrays_per_s,
            speedup_ratio: all.speedup_ratio,
            spread_ratio: all.spread_ratio,
            repeats_spread_ratio: all.repeats_spread_ratio,
            views_spread_ratio: all.views_spread_ratio,
            least_view_ratio: all.least_view_ratio,
            most_view_ratio: all.most_view_ratio,
        }
    }

    /// Whether the output is faster than the input by more than the uncertainty.
    pub fn is_faster(&self) -> bool {
        self.speedup_ratio > 1.0 + self.spread_ratio
    }

    /// Whether the output is slower than the input by more than the uncertainty.
    pub fn is_slower(&self) -> bool {
        self.speedup_ratio < 1.0 - self.spread_ratio
    }
}
