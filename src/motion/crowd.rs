//! Copies of a model at random places, some of them animated.
//!
//! Normal deviates: G. E. P. Box, M. E. Muller, "A Note on the Generation of Random Normal Deviates", The Annals of
//! Mathematical Statistics 29(2), 1958.

use std::f64::consts::TAU;

use glam::DVec3;

use super::Animation;
use crate::scene::Bounds;
use crate::verify::random::Random;

/// A number that differs from copy to copy: normally distributed, and 0 where that would be negative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviating {
    /// The mean.
    pub base: f64,
    /// The standard deviation; at least 0.
    pub deviation: f64,
}

/// How to place and animate copies of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crowd {
    /// Number of copies.
    pub copies: usize,
    /// How many of them, the first ones, are animated; at most all.
    pub animated: usize,
    /// Speeds, in scene units per second.
    pub speed: Deviating,
    /// Distances from home to the point of return, in scene units.
    pub distance: Deviating,
    /// Turns per second about the direction of motion; every other copy turns the other way.
    pub turns: Deviating,
    /// Seed of all random numbers. A larger crowd of the same seed begins with the smaller one.
    pub seed: u64,
}

/// Where copies are, and how they move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlacedCopies {
    /// The home of each copy's centre, in scene units.
    pub positions: Vec<DVec3>,
    /// The motion of the first copies; there are at most as many as positions.
    pub animations: Vec<Animation>,
}

/// Streams of random numbers.
mod stream {
    pub(super) const PLACE: u64 = 300;
    pub(super) const MOTION: u64 = 301;
}

impl Crowd {
    /// Places the copies uniformly in a box; none in an empty box. Directions are uniform over the sphere, phases over a
    /// round trip.
    pub fn place(&self, bounds: &Bounds) -> PlacedCopies {
        if bounds.is_empty() {
            return PlacedCopies::default();
        }
        let position = |copy| {
            let mut random = Random::at(self.seed, stream::PLACE, copy);
            bounds.min + bounds.size() * DVec3::new(random.unit(), random.unit(), random.unit())
        };
        PlacedCopies {
            positions: (0..self.copies).map(position).collect(),
            animations: (0..self.animated.min(self.copies)).map(|copy| self.animation(copy)).collect(),
        }
    }

    fn animation(&self, copy: usize) -> Animation {
        let mut random = Random::at(self.seed, stream::MOTION, copy);
        let direction = random.direction();
        let phase = random.unit();
        let [speed, distance, turns] = [self.speed, self.distance, self.turns].map(|number| number.draw(&mut random));
        let turns = if copy.is_multiple_of(2) { turns } else { -turns };
        Animation { direction, speed, distance, phase, turns }
    }
}

impl Deviating {
    fn draw(&self, random: &mut Random) -> f64 {
        // The logarithm of 0 is avoided: a unit number is below 1.
        let radius = (-2.0 * (1.0 - random.unit()).ln()).sqrt();
        let normal = radius * (TAU * random.unit()).cos();
        (self.base + self.deviation * normal).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CROWD: Crowd = Crowd {
        copies: 2000,
        animated: 1500,
        speed: Deviating { base: 2.0, deviation: 0.5 },
        distance: Deviating { base: 0.5, deviation: 1.0 },
        turns: Deviating { base: 0.25, deviation: 0.0 },
        seed: 7,
    };

    fn bounds() -> Bounds {
        Bounds { min: DVec3::new(-1.0, 0.0, 10.0), max: DVec3::new(1.0, 4.0, 30.0) }
    }

    #[test]
    fn copies_fill_the_box_evenly() {
        let placed = CROWD.place(&bounds());
        assert_eq!((placed.positions.len(), placed.animations.len()), (2000, 1500));
        assert!(placed.positions.iter().all(|p| bounds().contains(&Bounds { min: *p, max: *p })));
        let mean = placed.positions.iter().sum::<DVec3>() / 2000.0;
        assert!(((mean - bounds().center()) / bounds().size()).abs().max_element() < 0.03, "{mean}");
    }

    #[test]
    fn speeds_and_distances_have_their_mean_and_deviation_and_are_never_negative() {
        let animations = CROWD.place(&bounds()).animations;
        let speeds: Vec<f64> = animations.iter().map(|a| a.speed).collect();
        let mean = speeds.iter().sum::<f64>() / 1500.0;
        let deviation = (speeds.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 1500.0).sqrt();
        assert!((mean - 2.0).abs() < 0.05 && (deviation - 0.5).abs() < 0.05, "{mean} {deviation}");
        // A normal number is below half a deviation under its mean with a probability of 31 %.
        let at_home = animations.iter().filter(|a| a.distance == 0.0).count();
        assert!((400..530).contains(&at_home), "{at_home}");
        assert!(animations.iter().all(|a| Animation::from_numbers(a.to_numbers()) == Ok(*a)));
        assert_eq!(animations.iter().map(|a| a.turns).sum::<f64>(), 0.0);
    }

    #[test]
    fn a_larger_crowd_begins_with_the_smaller_and_another_seed_gives_another() {
        let small = Crowd { copies: 10, animated: 10, ..CROWD }.place(&bounds());
        let large = CROWD.place(&bounds());
        assert_eq!(small.positions, large.positions[..10]);
        assert_eq!(small.animations, large.animations[..10]);
        assert_ne!(Crowd { seed: 8, ..CROWD }.place(&bounds()).positions[0], large.positions[0]);
    }

    #[test]
    fn nothing_is_placed_in_nothing() {
        assert_eq!(CROWD.place(&Bounds::EMPTY), PlacedCopies::default());
        let more_animated = Crowd { copies: 3, animated: 5, ..CROWD }.place(&bounds());
        assert_eq!(more_animated.animations.len(), 3);
    }
}
