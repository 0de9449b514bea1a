//! Seeded random numbers and rotations.

use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::TAU;

/// A stream of random numbers.
pub(crate) struct Random(fastrand::Rng);

impl Random {
    /// Streams of different seeds are independent.
    pub(crate) fn new(seed: u64) -> Self {
        Random(fastrand::Rng::with_seed(seed))
    }

    /// Uniform in `low..high`.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    /// Uniform in a cube around the origin with edges of length 2 * `half`.
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
