//! RK002: a BLAS with much empty space in its box should be divided (NVIDIA, "Best Practices for Using NVIDIA RTX Ray
//! Tracing", updated 2022; Arm's Lumen guide, chapter 6: four far pillars in one mesh).
//!
//! The tree of the mesh shows how it divides: from the root on, the node with the largest box is replaced by its children,
//! and the division whose boxes have the least surface area in all counts. Surfaces that enclose space, such as the walls of
//! a room, do not divide: the boxes of their parts have no less surface area than that of the whole.

use rayon::prelude::*;

use super::{Subject, mesh_name};
use crate::report::{Broken, Finding, Objects};
use crate::scene::{Bounds, Mesh, MeshId};
use crate::tree::Tree;

/// A mesh is reported if its parts fill less of its box, by surface area.
const LEAST_FILLED: f64 = 0.5;

/// Number of parts to divide a mesh into.
const MOST_PARTS: usize = 64;

/// A mesh is reported if the empty space in the boxes of its instances is entered by this many rays through the core.
const LEAST_PER_RAY: f64 = 0.005;

/// Parts that a mesh divides into.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Division {
    parts: usize,
    /// The sum of the surface areas of their boxes over that of the mesh's box.
    filled: f64,
}

/// Finds meshes that consist of parts far apart; the one whose empty space most rays enter is named first.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let mut shares = vec![0.0; subject.scene.meshes.len()];
    for i in subject.still() {
        let mesh = subject.scene.instances[i.0 as usize].mesh.0 as usize;
        shares[mesh] += subject.share(subject.boxes[i.0 as usize].area());
    }
    let empty = |(i, mesh): (usize, &Mesh)| {
        let tree = subject.trees.get(MeshId(i as u32)).filter(|_| shares[i] > LEAST_PER_RAY)?;
        let division = divide(mesh, tree);
        let per_ray = shares[i] * (1.0 - division.filled);
        (division.filled < LEAST_FILLED && per_ray > LEAST_PER_RAY).then_some((per_ray, i, division))
    };
    let mut found: Vec<(f64, usize, Division)> =
        subject.scene.meshes.par_iter().enumerate().filter_map(empty).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let Some(&(_, _, Division { parts, filled })) = found.first() else { return Vec::new() };
    let objects: Objects = found.iter().map(|&(_, i, _)| mesh_name(&subject.scene.meshes[i])).collect();
    let per_ray = found.iter().map(|(per_ray, ..)| per_ray).sum();
    vec![Finding::new(objects, &Broken::EmptySpace { filled, parts, per_ray })]
}

/// Returns the division with the least surface area, of those with 1 to [`MOST_PARTS`] parts.
fn divide(mesh: &Mesh, tree: &Tree) -> Division {
    let of_triangle = |t: u32| Bounds::of(mesh.corners(t).map(|p| p.as_dvec3()));
    let around = |items: &[u32]| items.iter().fold(Bounds::EMPTY, |all, &t| all.union(&of_triangle(t)));
    let areas: Vec<f64> = tree.refit(around, Bounds::union).iter().map(Bounds::area).collect();
    let whole = areas.first().copied().unwrap_or(0.0);
    let mut parts = vec![0_usize];
    let mut best = Division { parts: 1, filled: 1.0 };
    while parts.len() < MOST_PARTS && whole > 0.0 {
        let inner = (0..parts.len()).filter(|&p| !tree.nodes[parts[p]].is_leaf());
        let Some(largest) = inner.max_by(|&a, &b| areas[parts[a]].total_cmp(&areas[parts[b]]).then(b.cmp(&a))) else {
            break;
        };
        let first = tree.nodes[parts.swap_remove(largest)].first as usize;
        parts.extend([first, first + 1]);
        let filled = parts.iter().map(|&p| areas[p]).sum::<f64>() / whole;
        if filled < best.filled {
            best = Division { parts: parts.len(), filled };
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_in;
    use crate::layout::test_scenes::*;
    use crate::scene::{Pinned, Scene};
    use glam::Vec3;

    /// A mesh of four patches of triangles, `gap` apart along a diagonal.
    fn islands(gap: f32, moving: bool) -> Scene {
        let mut builder = SceneBuilder::default();
        let patch = |i: i32| (0..5).flat_map(move |y| row(Vec3::splat(gap * i as f32) + Vec3::Y * y as f32, 5));
        let mesh = builder.mesh("islands", vec![(0, (0..4).flat_map(patch).collect())]);
        builder.place(mesh, "islands", at(0.0, 0.0, 0.0)).pinned = moving.then_some(Pinned::Animated);
        builder.scene()
    }

    #[test]
    fn a_mesh_of_islands_far_apart_should_be_divided() {
        let finding = found_in(&islands(100.0, false), super::check).expect("a finding");
        assert_eq!((finding.rule.id(), finding.count, finding.object.as_str()), ("RK002", 1, "islands"));
        assert!(finding.cost.per_ray.is_some_and(|per_ray| per_ray > 0.9 && per_ray < 1.0), "{:?}", finding.cost);
    }

    #[test]
    fn a_mesh_of_neighbours_is_left_alone_and_so_is_what_moves() {
        assert_eq!(found_in(&islands(0.5, false), super::check), None);
        assert_eq!(found_in(&islands(100.0, true), super::check), None);
    }

    #[test]
    fn the_walls_of_a_room_do_not_divide() {
        let [low, high] = [Vec3::ZERO, Vec3::splat(10.0)];
        let wall = |a: Vec3, b: Vec3, c: Vec3| vec![[a, b, c], [c, b, b + c - a]];
        let floor = wall(low, Vec3::X * 10.0, Vec3::Y * 10.0);
        let side = wall(low, Vec3::X * 10.0, Vec3::Z * 10.0);
        let other = wall(high, high - Vec3::X * 10.0, high - Vec3::Z * 10.0);
        let mut builder = SceneBuilder::default();
        builder.object("room", 0, [floor, side, other].concat());
        assert_eq!(found_in(&builder.scene(), super::check), None);
    }
}
