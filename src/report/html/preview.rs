//! A preview of a scene's surface: at most a number of triangles, quantised.
//!
//! Vertices are clustered on a grid (J. Rossignac, P. Borrel, "Multi-resolution 3D approximations for rendering complex
//! scenes", 1993): all vertices in a cell become the first of them, and triangles with two corners in one cell are
//! dropped. The grid is made coarser until few enough triangles are left. Surfaces stay closed, which a choice of some
//! triangles would not do. Unlike there, the vertex that represents a cell is not weighted. Where that leaves next to
//! nothing, as of leaves and other small separate pieces, every n-th triangle is shown instead.

use glam::DVec3;
use rustc_hash::{FxHashMap, FxHashSet};
use serde::Serialize;

use super::text::packed;
use crate::scene::{Bounds, InstanceId, Scene, TriangleRef};

/// Maximum number of triangles of a preview.
const MOST_TRIANGLES: usize = 20_000;
/// If clustering leaves fewer triangles, it destroys more than it saves.
const LEAST_LEFT: usize = MOST_TRIANGLES / 4;
/// Cells along each side of the finest grid.
const FINEST: u32 = 512;
/// Steps of a quantised coordinate.
const STEPS: f64 = 65_535.0;

/// A triangle with quantised corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
struct Quantised {
    instance: u32,
    corners: [[u16; 3]; 3],
}

/// The triangles of a preview.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Preview {
    /// Nine unsigned 16-bit numbers per triangle, in base 64: its corners, as shares of the frame's sides.
    corners: String,
    /// One unsigned 32-bit number per triangle, in base 64: the scene's instance that places it.
    instances: String,
    /// Number of triangles shown.
    shown: usize,
    /// Number of triangles of the scene.
    placed: u64,
}

impl Preview {
    /// Makes a preview of what lies in `frame`: the triangles with all corners in it.
    pub(super) fn of(scene: &Scene, frame: &Bounds) -> Preview {
        let triangles = few(quantised(scene, frame));
        let corners: Vec<u16> = triangles.iter().flat_map(|t| t.corners).flatten().collect();
        let instances: Vec<u32> = triangles.iter().map(|t| t.instance).collect();
        let (shown, placed) = (triangles.len(), scene.triangles_placed());
        Preview { corners: packed(&corners), instances: packed(&instances), shown, placed }
    }
}

fn quantised(scene: &Scene, frame: &Bounds) -> Vec<Quantised> {
    let size = (frame.max - frame.min).max(DVec3::splat(f64::MIN_POSITIVE));
    let slack = 1e-6 * size;
    let place = |p: DVec3| ((p - frame.min) / size * STEPS).to_array().map(|share| share.round() as u16);
    let is_inside = |p: &DVec3| p.cmpge(frame.min - slack).all() && p.cmple(frame.max + slack).all();
    let instances = 0..scene.instances.len() as u32;
    let all = instances.flat_map(|instance| {
        let count = scene.mesh_of(InstanceId(instance)).triangle_count() as u32;
        (0..count).map(move |triangle| TriangleRef { instance, triangle })
    });
    all.filter_map(|at| {
        let corners = scene.world_corners(at);
        let placed = Quantised { instance: at.instance, corners: corners.map(place) };
        corners.iter().all(is_inside).then_some(placed)
    })
    .collect()
}

/// Returns at most [`MOST_TRIANGLES`] triangles.
fn few(mut triangles: Vec<Quantised>) -> Vec<Quantised> {
    let mut cells = FINEST;
    while triangles.len() > MOST_TRIANGLES {
        let left = if cells > 1 { clustered(&triangles, cells) } else { Vec::new() };
        if left.len() < LEAST_LEFT {
            let nth = triangles.len().div_ceil(MOST_TRIANGLES);
            return triangles.into_iter().step_by(nth).collect();
        }
        triangles = left;
        cells /= 2;
    }
    triangles
}

/// Moves all corners in one cell of a grid to the first of them, and drops triangles that become lines, points or equal.
fn clustered(triangles: &[Quantised], cells: u32) -> Vec<Quantised> {
    let mut first: FxHashMap<[u16; 3], [u16; 3]> = FxHashMap::default();
    let mut seen = FxHashSet::default();
    let side = 65_536 / cells;
    let mut moved = |corner: [u16; 3]| *first.entry(corner.map(|c| (u32::from(c) / side) as u16)).or_insert(corner);
    let all = triangles.iter().map(|t| Quantised { corners: t.corners.map(&mut moved), ..*t });
    all.filter(|Quantised { corners: [a, b, c], .. }| a != b && b != c && c != a).filter(|t| seen.insert(*t)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::{SceneBuilder, row};
    use glam::Vec3;

    /// A field of triangles.
    fn field(rows: u32, length: u32) -> Scene {
        let mut builder = SceneBuilder::default();
        (0..rows).for_each(|i| builder.object("row", 0, row(Vec3::new(0.0, i as f32, 0.0), length as usize)));
        builder.scene()
    }

    #[test]
    fn few_triangles_are_all_shown() {
        let scene = field(3, 20);
        let preview = Preview::of(&scene, &scene.bounds());
        assert_eq!((preview.shown as u64, preview.placed), (scene.triangles_placed(), scene.triangles_placed()));
    }

    #[test]
    fn many_triangles_become_few_but_not_none() {
        let scene = field(300, 200);
        let preview = Preview::of(&scene, &scene.bounds());
        assert!(scene.triangles_placed() > MOST_TRIANGLES as u64);
        assert!((LEAST_LEFT..=MOST_TRIANGLES).contains(&preview.shown), "{}", preview.shown);
    }

    #[test]
    fn what_lies_outside_the_frame_is_left_out() {
        let scene = field(3, 20);
        let elsewhere = Bounds { min: DVec3::splat(1e6), max: DVec3::splat(2e6) };
        assert_eq!(Preview::of(&scene, &elsewhere).shown, 0);
        assert_eq!(Preview::of(&Scene::default(), &Bounds::EMPTY).shown, 0);
    }
}
