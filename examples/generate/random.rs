//! Seeded random numbers and rotations.

use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::TAU;

/// The SplitMix64 generator (G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number Generators", 2014).
pub(crate) struct Random(u64);

impl Random {
    /// Streams of different seeds are unrelated.
    pub(crate) fn new(seed: u64) -> Self {
        Random(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in `low..high`.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in a cube around the origin with edges of length 2 `half`.
    pub(crate) fn in_cube(&mut self, half: f64) -> DVec3 {
        dvec3(self.between(-half, half), self.between(-half, half), self.between(-half, half))
    }

    /// A uniformly distributed rotation (K. Shoemake, "Uniform Random Rotations", Graphics Gems III, 1992).
    pub(crate) fn rotation(&mut self) -> DQuat {
        let (u, a, b) = (self.between(0.0, 1.0), self.between(0.0, TAU), self.between(0.0, TAU));
        let (s, c) = ((1.0 - u).sqrt(), u.sqrt());
        DQuat::from_xyzw(s * a.sin(), s * a.cos(), c * b.sin(), c * b.cos())
    }
}
