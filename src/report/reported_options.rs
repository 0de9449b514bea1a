//! What a bake was told, and the speed that its verdict goes by.

use serde::Serialize;

use crate::verify::weights::{Overall, Weights};
use crate::verify::{MachineKind, PerKind, Verification};

/// What a bake was told, as far as it decides what is written and how that is judged.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReportedOptions {
    /// How many candidates `auto` looks at, from 0 to 6.
    pub effort: u8,
    /// What kind of device rays are predicted for.
    pub device_class: &'static str,
    /// What each kind of rays counts for.
    pub weights: PerKind<f64>,
    /// Seed of the rays.
    pub seed: u64,
    /// Rays of each kind that are compared.
    pub rays: u32,
    /// How often each kind is timed.
    pub repeats: u32,
    /// Largest distance a vertex may move, over the scene's diagonal.
    pub max_position_error_ratio: f64,
    /// Predicted bytes of acceleration structures allowed over the input's, also where that is `auto`'s own limit; none: any.
    pub max_bytes_ratio: Option<f64>,
    /// Most triangles of a group; none: any.
    pub max_group_triangles: Option<u32>,
    /// Longest side of a group's box over that of the scene's; none: any.
    pub max_group_extent_ratio: Option<f64>,
    /// Groups of their own for what encloses the rest or lies far outside; none: where it pays.
    pub isolate: Option<bool>,
    /// Groups of their own for triangles that are not opaque; none: where it pays.
    pub split_opacity: Option<bool>,
    /// Whether groups may be stored in frames of their own.
    pub frames: bool,
    /// Instances that stay as they are by their names.
    pub keep: Vec<String>,
}

/// The speed over all kinds of rays, each counted as it is weighted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Speed {
    /// What it was measured on: `gpu`, `software driver` or `cpu`. Only the first tells of the devices of users.
    pub measured_on: MachineKind,
    /// Million rays a second through the input; 0 without rays.
    pub before_mrays_per_s: f64,
    /// The same through the output.
    pub after_mrays_per_s: f64,
    /// The time of the input over that of the output; 1 without rays.
    pub speedup_ratio: f64,
    /// How far off it may be; infinite (`null` in JSON) for too few repeats.
    pub spread_ratio: f64,
}

impl Speed {
    /// What a verification measured; `kind` is what it was to be measured on.
    pub fn of(verification: &Verification, weights: &Weights, kind: MachineKind) -> Speed {
        // Where the device cannot take a scene, the CPU does.
        let kind = if verification.structures.is_none() { MachineKind::Cpu } else { kind };
        let Overall { before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio } =
            weights.overall(&verification.kinds);
        Speed { measured_on: kind, before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio }
    }

    /// Whether the output is faster than the input, by more than what may be off.
    pub fn is_faster(&self) -> bool {
        self.speedup_ratio > 1.0 + self.spread_ratio
    }

    /// Whether it is slower, by more than what may be off.
    pub fn is_slower(&self) -> bool {
        self.speedup_ratio < 1.0 - self.spread_ratio
    }
}
