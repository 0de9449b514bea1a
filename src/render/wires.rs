//! Lines in space, drawn over a picture.
//!
//! Each step along a line's longer axis covers the two pixels beside it, as in X. Wu, "An Efficient Antialiasing
//! Technique", SIGGRAPH 1991.

use glam::{DVec2, DVec3};

use super::Picture;
use super::colour::Rgb;
use crate::verify::view::View as Sight;

/// A line between two points of the world.
pub(super) struct Wire {
    pub(super) ends: [DVec3; 2],
    pub(super) colour: Rgb,
}

/// A picture to draw on.
pub(super) struct Canvas<'a> {
    pub(super) sight: &'a Sight,
    pub(super) picture: &'a mut Picture,
    /// For each pixel, how far in front of the camera its surface is.
    pub(super) depths: &'a [f32],
}

/// A point of a picture in pixels, and how far in front of the camera it is: inverted for a camera with perspective, so
/// that it varies evenly along a line.
#[derive(Clone, Copy)]
struct Place {
    at: DVec2,
    depth: f64,
}

/// Least distance in front of the camera, over the distance of the line's other end.
const NEAREST: f64 = 1e-5;
/// A wire this much behind a surface still counts as on it, over its distance.
const ON_SURFACE: f64 = 4e-3;
/// Share of a wire's colour before and behind a surface.
const BEFORE: f32 = 0.95;
const BEHIND: f32 = 0.16;

impl Canvas<'_> {
    /// Draws a line, as far as it is in front of the camera and in the picture.
    pub(super) fn draw(&mut self, wire: &Wire) {
        let to_camera = self.sight.to_camera();
        let Some(ends) = in_front(wire.ends.map(|end| to_camera.transform_point3(end))) else { return };
        let places = ends.map(|end| self.place(end));
        let Some([from, to]) = self.clipped(places) else { return };
        let way = to.at - from.at;
        let along = usize::from(way.y.abs() > way.x.abs());
        let steps = way[along].abs().ceil().max(1.0);
        for step in 0..=steps as u32 {
            let share = f64::from(step) / steps;
            let depth = from.depth + share * (to.depth - from.depth);
            self.dot(from.at + share * way, along, depth, wire.colour);
        }
    }

    fn place(&self, point: DVec3) -> Place {
        let [x, y] = self.sight.project(point);
        let size = DVec2::new(f64::from(self.picture.width), f64::from(self.picture.height));
        let at = DVec2::new(0.5 + 0.5 * x, 0.5 - 0.5 * y) * size - 0.5;
        Place { at, depth: if self.sight.is_perspective() { -1.0 / point.z } else { -point.z } }
    }

    /// Returns the part of a line in the picture, after Y.-D. Liang, B. Barsky, "A New Concept and Method for Line
    /// Clipping", ACM Transactions on Graphics 3(1), 1984.
    fn clipped(&self, [from, to]: [Place; 2]) -> Option<[Place; 2]> {
        let way = to.at - from.at;
        let most = [f64::from(self.picture.width), f64::from(self.picture.height)];
        let (mut enter, mut leave) = (0.0, 1.0);
        for axis in 0..2 {
            let crossed = [-1.0 - from.at[axis], most[axis] - from.at[axis]].map(|side| side / way[axis]);
            if way[axis] == 0.0 {
                if !(-1.0..=most[axis]).contains(&from.at[axis]) {
                    return None;
                }
                continue;
            }
            enter = f64::max(enter, crossed[0].min(crossed[1]));
            leave = f64::min(leave, crossed[0].max(crossed[1]));
        }
        let at = |share: f64| Place { at: from.at + share * way, depth: from.depth + share * (to.depth - from.depth) };
        (enter <= leave && from.at.is_finite() && to.at.is_finite()).then(|| [at(enter), at(leave)])
    }

    /// Draws a point of a line whose longer axis is `along`.
    fn dot(&mut self, at: DVec2, along: usize, depth: f64, colour: Rgb) {
        let across = 1 - along;
        let low = at[across].floor();
        let share = (at[across] - low) as f32;
        for (offset, cover) in [(0.0, 1.0 - share), (1.0, share)] {
            let mut pixel = [0; 2];
            pixel[along] = at[along].round() as i64;
            pixel[across] = (low + offset) as i64;
            let cover = cover * if self.is_before(pixel, depth) { BEFORE } else { BEHIND };
            self.picture.mix(pixel, colour, cover);
        }
    }

    fn is_before(&self, [x, y]: [i64; 2], depth: f64) -> bool {
        let width = i64::from(self.picture.width);
        let inside = (0..width).contains(&x) && y >= 0;
        let surface = if inside { self.depths.get((y * width + x) as usize) } else { None };
        let depth = if self.sight.is_perspective() { 1.0 / depth } else { depth };
        surface.is_none_or(|&surface| depth <= f64::from(surface) * (1.0 + ON_SURFACE))
    }
}

/// Returns the part of a line in front of the camera, in its coordinates.
fn in_front(ends: [DVec3; 2]) -> Option<[DVec3; 2]> {
    let [a, b] = ends;
    let near = -NEAREST * a.length().max(b.length());
    let cut = |inside: DVec3, outside: DVec3| inside.lerp(outside, (near - inside.z) / (outside.z - inside.z));
    match (a.z <= near, b.z <= near) {
        (true, true) => Some(ends),
        (true, false) => Some([a, cut(a, b)]),
        (false, true) => Some([cut(b, a), b]),
        (false, false) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Statistics;
    use super::*;

    /// Draws a line in front of a camera that looks along -z, over a surface at distance 10; returns the pixels covered.
    fn drawn(ends: [DVec3; 2]) -> (usize, Picture) {
        let sight = Sight::toward("ahead".into(), DVec3::ZERO, DVec3::NEG_Z, 1.0).expect("sound").fitted(1.0);
        let mut picture = Picture::of([32, 32], vec![[0; 3]; 1024], Statistics::default());
        let mut canvas = Canvas { sight: &sight, picture: &mut picture, depths: &[10.0; 1024] };
        canvas.draw(&Wire { ends, colour: [255; 3] });
        (picture.pixels.chunks(3).filter(|p| p[0] > 0).count(), picture)
    }

    #[test]
    fn a_line_crosses_the_picture_and_is_faint_behind_a_surface() {
        let line = |z: f64| drawn([DVec3::new(-99.0, 0.01, z), DVec3::new(99.0, 0.01, z)]);
        let (count, before) = line(-5.0);
        assert!((32..=64).contains(&count), "{count}");
        let (_, behind) = line(-50.0);
        let brightest = |picture: &Picture| picture.pixels.iter().copied().max();
        assert!(brightest(&before) > Some(100) && brightest(&behind) < Some(60));
    }

    #[test]
    fn what_is_behind_the_camera_or_beside_the_picture_is_not_drawn() {
        assert_eq!(drawn([DVec3::new(-1.0, 0.0, 5.0), DVec3::new(1.0, 0.0, 5.0)]).0, 0);
        assert_eq!(drawn([DVec3::new(-9.0, 90.0, -5.0), DVec3::new(9.0, 90.0, -5.0)]).0, 0);
        assert!(drawn([DVec3::new(0.1, 0.1, 5.0), DVec3::new(0.1, 0.1, -5.0)]).0 > 0, "the part in front is drawn");
        assert_eq!(drawn([DVec3::splat(f64::NAN), DVec3::NEG_Z]).0, 0);
    }
}
