//! Random numbers by position: the numbers of ray `i` depend only on the seed and `i`, so that rays are the same for
//! any number of threads.

use glam::{DVec2, DVec3};

/// SplitMix64 of G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014.
pub(crate) struct Random(u64);

/// Increment of the paper's sequence, derived from the golden ratio.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Random {
    /// Returns the sequence of a position in a stream.
    pub(crate) fn at(seed: u64, stream: u64, index: usize) -> Random {
        let stream = mixed(seed.wrapping_add(STEP)) ^ mixed(stream.wrapping_mul(STEP));
        Random(mixed(stream.wrapping_add((index as u64).wrapping_mul(STEP))))
    }

    /// Returns 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(STEP);
        mixed(self.0)
    }

    /// Returns a number in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns an integer below `bound`, which must not be 0 (biased by less than bound / 2^53).
    pub(super) fn below(&mut self, bound: u64) -> u64 {
        ((self.unit() * bound as f64) as u64).min(bound - 1)
    }

    /// Returns a uniformly distributed direction.
    pub(crate) fn direction(&mut self) -> DVec3 {
        direction([self.unit(), self.unit()])
    }

    /// Returns a uniformly distributed point of the unit disc.
    pub(super) fn in_disc(&mut self) -> DVec2 {
        let r = self.unit().sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.unit()).sin_cos();
        DVec2::new(r * cos, r * sin)
    }
}

/// Returns the direction of two numbers in [0, 1): uniformly distributed if they are.
pub(crate) fn direction([z, turn]: [f64; 2]) -> DVec3 {
    let z = 1.0 - 2.0 * z;
    let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(r * cos, r * sin, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_published_one() {
        // First outputs of the reference implementation for the state 1234567.
        let mut random = Random(1_234_567);
        assert_eq!([random.bits(), random.bits()], [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }

    #[test]
    fn positions_differ_and_numbers_lie_in_range() {
        let mut firsts: Vec<u64> = (0..1000).map(|i| Random::at(7, 1, i).bits()).collect();
        firsts.sort_unstable();
        firsts.dedup();
        assert_eq!(firsts.len(), 1000);
        let mut random = Random::at(0, 0, 0);
        for _ in 0..1000 {
            assert!((0.0..1.0).contains(&random.unit()) && random.below(3) < 3);
            assert!((random.direction().length() - 1.0).abs() < 1e-12 && random.in_disc().length() <= 1.0);
        }
    }
}
