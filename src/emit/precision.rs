//! Frames that keep the rounding of baked positions within a limit.

use glam::{DAffine3, Vec3};
use rayon::prelude::*;

use crate::layout::{Content, Group, GroupGeometry, Layout, Placement};
use crate::scene::{Bounds, InstanceId, Scene};

/// What [`settle`] did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settled {
    /// Groups whose positions are now stored relative to their centre.
    pub centred: usize,
    /// The largest distance between a corner and its stored position, in world units.
    pub error: f64,
    /// Instances whose triangles cannot be written out within the limit.
    pub refused: Vec<InstanceId>,
}

/// Stores each baked group relative to its centre where rounding world positions to single precision would move a
/// vertex farther than `max_error_ratio` of the scene's diagonal, or of the group's own: a small object far from the
/// origin keeps its shape. Names the instances, also those opened into pieces that are stored in frames, that would still exceed the ratio of the scene's diagonal.
pub fn settle(scene: &Scene, layout: &mut Layout, max_error_ratio: f64) -> Settled {
    let limit = max_error_ratio * scene.bounds().diagonal();
    let mut settled = Settled::default();
    for group in &mut layout.groups {
        let Content::Baked { frame, geometries } = &mut group.content else { continue };
        let mut error = largest_error(scene, geometries, *frame);
        if error == 0.0 {
            continue;
        }
        let bounds = bounds(scene, geometries);
        if error > limit.min(max_error_ratio * bounds.diagonal()) {
            frame.translation = bounds.stored_center();
            settled.centred += 1;
            error = largest_error(scene, geometries, *frame);
        }
        settled.error = settled.error.max(error);
        if error > limit {
            settled.refused.extend(geometries.iter().flat_map(|g| g.triangles.iter().map(|t| InstanceId(t.instance))));
        }
    }
    let errors = piece_errors(scene, layout);
    for placement in &layout.placements {
        let error = errors[placement.group as usize] * stretch(placement);
        settled.error = settled.error.max(error);
        settled.refused.extend(placement.instance.filter(|_| error > limit));
    }
    settled.refused.sort_unstable();
    settled.refused.dedup();
    for placement in &mut layout.placements {
        if let Content::Baked { frame, .. } = &layout.groups[placement.group as usize].content {
            placement.transform = *frame;
        }
    }
    settled
}

/// The largest distance, in world units, between a corner and its position stored in `frame`.
fn largest_error(scene: &Scene, geometries: &[GroupGeometry], frame: DAffine3) -> f64 {
    let into = frame.inverse();
    let error = |world_from_mesh: &DAffine3, corner: Vec3| {
        let group_from_mesh = into * *world_from_mesh;
        if group_from_mesh == DAffine3::IDENTITY {
            return 0.0;
        }
        moved(&group_from_mesh, corner)
    };
    geometries
        .par_iter()
        .flat_map(|g| g.triangles.par_iter())
        .map(|&at| {
            let origin = scene.origin(at);
            let corners = scene.meshes[origin.mesh.0 as usize].corners(origin.triangle);
            corners.into_iter().map(|c| error(&origin.transform, c)).fold(0.0, f64::max)
        })
        .reduce(|| 0.0, f64::max)
}

/// For every group the largest distance between a corner and its position stored in the frame of a piece, in units of
/// the group; 0 for what is no piece.
pub(super) fn piece_errors(scene: &Scene, layout: &Layout) -> Vec<f64> {
    let of_group = |group: &Group| match &group.content {
        Content::Piece { mesh, frame, geometries } if *frame != DAffine3::IDENTITY => {
            let (mesh, into) = (&scene.meshes[mesh.0 as usize], frame.inverse());
            let corners = geometries.iter().flat_map(|g| &g.triangles).flat_map(|t| mesh.corners(t.triangle));
            corners.map(|corner| moved(&into, corner)).fold(0.0, f64::max)
        }
        _ => 0.0,
    };
    layout.groups.par_iter().map(of_group).collect()
}

/// By how much a placement lengthens what is in its group, at most: the root of the sum of squares of the coefficients
/// bounds the largest stretch.
pub(super) fn stretch(placement: &Placement) -> f64 {
    let m = placement.transform.matrix3;
    (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt()
}

/// How far rounding moves a corner.
fn moved(into: &DAffine3, corner: Vec3) -> f64 {
    let exact = into.transform_point3(corner.as_dvec3());
    let moved = exact.as_vec3().as_dvec3().distance(exact);
    // A position that overflows single precision is off by more than any limit.
    if moved.is_finite() { moved } else { f64::INFINITY }
}

/// World box of a group's triangles.
fn bounds(scene: &Scene, geometries: &[GroupGeometry]) -> Bounds {
    geometries
        .par_iter()
        .flat_map(|g| g.triangles.par_iter())
        .map(|&at| Bounds::of(scene.world_corners(at)))
        .reduce(|| Bounds::EMPTY, |a, b| a.union(&b))
}
