//! How one instance moves: there and back along a direction, while it turns about that direction.

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec3};

/// The motion of one instance. As seven numbers, in this order: direction x, y, z, speed, distance, phase, turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Animation {
    /// Direction in which the instance leaves its home, and axis about which it turns; its length does not matter. It may
    /// be zero only if distance and turns are.
    pub direction: DVec3,
    /// Speed along the way, in scene units per second; at least 0.
    pub speed: f64,
    /// Distance between home and the point of return, in scene units; at least 0.
    pub distance: f64,
    /// Share of a round trip that is done at time 0; at least 0 and below 1.
    pub phase: f64,
    /// Turns about the direction per second, counter-clockwise seen against it; negative for the other way.
    pub turns: f64,
}

/// A number of an animation is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{number} of an animation is {value}, and must be {allowed}")]
pub struct BadAnimation {
    /// Which of the numbers.
    pub number: &'static str,
    /// Its value.
    pub value: f64,
    /// The values that it may have.
    pub allowed: &'static str,
}

impl Animation {
    /// Reads the seven numbers.
    ///
    /// # Errors
    /// Fails if a number is not finite or out of its range.
    pub fn from_numbers(numbers: [f64; 7]) -> Result<Animation, BadAnimation> {
        let [x, y, z, speed, distance, phase, turns] = numbers;
        let check = |number, value: f64, is_allowed: bool, allowed| match is_allowed && value.is_finite() {
            true => Ok(()),
            false => Err(BadAnimation { number, value, allowed }),
        };
        for (number, value) in [("direction x", x), ("direction y", y), ("direction z", z), ("turns", turns)] {
            check(number, value, true, "finite")?;
        }
        check("speed", speed, speed >= 0.0, "at least 0")?;
        check("distance", distance, distance >= 0.0, "at least 0")?;
        check("phase", phase, (0.0..1.0).contains(&phase), "at least 0 and below 1")?;
        let direction = DVec3::new(x, y, z);
        let needs_direction = distance > 0.0 || turns != 0.0;
        let length = direction.abs().max_element();
        check("direction", length, length > 0.0 || !needs_direction, "other than zero if anything moves")?;
        Ok(Animation { direction, speed, distance, phase, turns })
    }

    /// Returns the seven numbers.
    pub fn to_numbers(&self) -> [f64; 7] {
        let [x, y, z] = self.direction.to_array();
        [x, y, z, self.speed, self.distance, self.phase, self.turns]
    }

    /// Returns the motion away from home at a time in seconds: a turn about the direction, then the way along it.
    pub fn motion(&self, time: f64) -> DAffine3 {
        let direction = self.direction.normalize_or_zero();
        if direction == DVec3::ZERO {
            return DAffine3::IDENTITY;
        }
        let turned = DQuat::from_axis_angle(direction, TAU * (self.turns * time).fract());
        DAffine3::from_rotation_translation(turned, self.way(time) * direction)
    }

    /// Returns the distance from home at a time: a triangle wave between 0 and [`Animation::distance`].
    fn way(&self, time: f64) -> f64 {
        let trips = if self.distance > 0.0 { self.speed * time / (2.0 * self.distance) } else { 0.0 };
        let done = (self.phase + trips).rem_euclid(1.0);
        self.distance * (1.0 - (1.0 - 2.0 * done).abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLIDE: Animation =
        Animation { direction: DVec3::new(0.0, 3.0, 0.0), speed: 2.0, distance: 4.0, phase: 0.0, turns: 0.0 };

    #[test]
    fn an_instance_goes_there_and_back_at_its_speed() {
        let height = |animation: &Animation, time| animation.motion(time).translation.y;
        let times = [0.0, 1.0, 2.0, 3.0, 4.0, 6.0];
        assert_eq!(times.map(|t| height(&SLIDE, t)), [0.0, 2.0, 4.0, 2.0, 0.0, 4.0]);
        let ahead = Animation { phase: 0.25, ..SLIDE };
        assert_eq!([0.0, 1.0, 3.0].map(|t| height(&ahead, t)), [2.0, 4.0, 0.0]);
        assert_eq!(height(&SLIDE, -1.0), 2.0);
    }

    #[test]
    fn it_turns_counter_clockwise_about_its_direction() {
        let turning = Animation { turns: 0.25, distance: 0.0, ..SLIDE };
        let at = |time| turning.motion(time).transform_point3(DVec3::Z);
        assert!(at(1.0).distance(DVec3::X) < 1e-12 && at(4.0).distance(DVec3::Z) < 1e-12);
        assert!(at(-1.0).distance(DVec3::NEG_X) < 1e-12);
    }

    #[test]
    fn what_does_not_move_needs_no_direction() {
        let still = Animation::from_numbers([0.0, 0.0, 0.0, 5.0, 0.0, 0.5, 0.0]).expect("allowed");
        assert_eq!(still.motion(7.0), DAffine3::IDENTITY);
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let good = SLIDE.to_numbers();
        assert_eq!(Animation::from_numbers(good), Ok(SLIDE));
        let with = |index: usize, value: f64| {
            let mut numbers = good;
            numbers[index] = value;
            Animation::from_numbers(numbers).expect_err("out of range").number
        };
        let bad = [(0, f64::NAN), (3, -1.0), (4, f64::INFINITY), (5, 1.0), (6, f64::NAN), (1, 0.0)];
        let named = ["direction x", "speed", "distance", "phase", "turns", "direction"];
        assert_eq!(bad.map(|(index, value)| with(index, value)), named);
        let error = Animation::from_numbers([0.0, 1.0, 0.0, -2.0, 1.0, 0.0, 0.0]).expect_err("a negative speed");
        assert_eq!(error.to_string(), "speed of an animation is -2, and must be at least 0");
    }
}
