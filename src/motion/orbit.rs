//! A camera that revolves about a point of interest.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use crate::verify::view::{Stage, View};

/// Vertical field of view, in radians.
const FIELD: f64 = 60.0 * std::f64::consts::PI / 180.0;
/// Aspect ratio (width over height) of its pictures.
const ASPECT_RATIO: f64 = 16.0 / 9.0;

/// A camera that looks at a point and revolves about the vertical axis through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Place of the camera at time 0.
    pub position: DVec3,
    /// The point of interest.
    pub interest: DVec3,
    /// Revolutions per second, counter-clockwise seen from above; 0 for a camera that stands still.
    pub frequency: f64,
}

impl Orbit {
    /// Returns an orbit that suits a scene: from outside as the automatic camera sees it; in an interior, around its
    /// centre at a quarter of the shorter horizontal side.
    pub fn automatic(stage: &Stage, frequency: f64) -> Orbit {
        let size = stage.bounds.size();
        let position = if stage.enclosed {
            let reach = [0.25 * size.x.min(size.z), 0.25 * stage.radius].into_iter().find(|&r| r > 0.0).unwrap_or(1.0);
            stage.center + reach * DVec3::Z
        } else {
            View::automatic(stage).ray([0.0, 0.0]).0
        };
        Orbit { position, interest: stage.center, frequency }
    }

    /// Returns the view at a time in seconds; `None` if the camera is at the point of interest or a number is not finite.
    pub fn view(&self, time: f64) -> Option<View> {
        let turned = DQuat::from_rotation_y(TAU * (self.frequency * time).fract());
        let position = self.interest + turned * (self.position - self.interest);
        View::toward("orbit".into(), position, self.interest, FIELD).map(|view| view.fitted(ASPECT_RATIO))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Bounds;

    #[test]
    fn a_revolution_takes_the_inverse_of_the_frequency() {
        let orbit = Orbit { position: DVec3::new(3.0, 1.0, 0.0), interest: DVec3::new(1.0, 0.0, 0.0), frequency: 0.5 };
        let at = |time| orbit.view(time).expect("a view").ray([0.0, 0.0]).0;
        let expected =
            [(0.0, [3.0, 1.0, 0.0]), (0.5, [1.0, 1.0, -2.0]), (1.0, [-1.0, 1.0, 0.0]), (2.0, [3.0, 1.0, 0.0])];
        for (time, place) in expected {
            assert!(at(time).distance(DVec3::from_array(place)) < 1e-12, "{time}: {}", at(time));
        }
        assert!(orbit.view(f64::NAN).is_none());
        assert!(Orbit { position: orbit.interest, ..orbit }.view(0.0).is_none());
    }

    #[test]
    fn the_automatic_orbit_stays_inside_an_interior_and_outside_of_anything_else() {
        let bounds = Bounds { min: DVec3::ZERO, max: DVec3::new(4.0, 2.0, 8.0) };
        for enclosed in [false, true] {
            let orbit = Orbit::automatic(&Stage { enclosed, ..Stage::new(bounds) }, 0.1);
            for time in [0.0, 1.0, 4.0] {
                let at = orbit.view(time).expect("a view").ray([0.0, 0.0]).0;
                assert_eq!(bounds.contains(&Bounds { min: at, max: at }), enclosed, "{at}");
            }
        }
    }
}
