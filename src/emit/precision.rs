//! Frames that keep the rounding of baked positions within a limit.

use glam::{DAffine3, Vec3};
use rayon::prelude::*;

use crate::layout::{Content, Group, GroupGeometry, Layout, Placement};
use crate::scene::{Bounds, InstanceId, Scene, TriangleRef};

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

/// What must stay as it is where rounding moves a corner too far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refuse {
    /// The instance of that corner.
    Instances,
    /// All instances of its group.
    Groups,
}

/// Rounding must not move a corner farther than this share of the diagonal of its own instance: in a wide scene the limit
/// for the scene is larger than small objects are.
const OF_OWN_SIZE: f64 = 1e-4;

/// Stores each baked group relative to its centre where rounding world positions to single precision would move a
/// vertex farther than `max_error_ratio` of the scene's diagonal, or of the group's own, or than a ten-thousandth of its
/// instance's own: a small object far from the origin keeps its shape. Names the instances, also those opened into pieces
/// that are stored in frames, that would still exceed the ratio of the scene's diagonal, or a ten-thousandth of their own.
pub fn settle(scene: &Scene, layout: &mut Layout, max_error_ratio: f64, refuse: Refuse) -> Settled {
    let boxes = scene.instance_boxes();
    let limit = max_error_ratio * boxes.iter().fold(Bounds::EMPTY, |all, own| all.union(own)).diagonal();
    let limits: Vec<f64> = boxes.iter().map(|own| limit.min(own_limit(own))).collect();
    let mut settled = Settled::default();
    for group in &mut layout.groups {
        let Content::Baked { frame, geometries } = &mut group.content else { continue };
        let mut rounded = rounded(scene, geometries, *frame, &limits);
        if rounded.error == 0.0 {
            continue;
        }
        let bounds = bounds(scene, geometries);
        if rounded.error > max_error_ratio * bounds.diagonal() || !rounded.refused.is_empty() {
            frame.translation = bounds.stored_center();
            settled.centred += 1;
            rounded = self::rounded(scene, geometries, *frame, &limits);
        }
        settled.error = settled.error.max(rounded.error);
        match refuse {
            Refuse::Groups if !rounded.refused.is_empty() => {
                let triangles = geometries.iter().flat_map(|g| &g.triangles);
                settled.refused.extend(triangles.map(|t| InstanceId(t.instance)));
            }
            _ => settled.refused.extend(rounded.refused),
        }
    }
    let errors = piece_errors(scene, layout);
    for placement in &layout.placements {
        let error = errors[placement.group as usize] * stretch(placement);
        settled.error = settled.error.max(error);
        settled.refused.extend(placement.instance.filter(|i| error > limits[i.0 as usize]));
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

/// How far a corner of an instance within a box may move; any distance where the box is a point and has no shape to keep.
fn own_limit(own: &Bounds) -> f64 {
    if own.diagonal() > 0.0 { OF_OWN_SIZE * own.diagonal() } else { f64::INFINITY }
}

/// What rounding does to the triangles of a group.
#[derive(Default)]
struct Rounded {
    /// The largest distance, in world units, between a corner and its stored position.
    error: f64,
    /// Instances with a corner beyond their limit, some of them repeatedly.
    refused: Vec<InstanceId>,
}

impl Rounded {
    fn with(mut self, instance: InstanceId, error: f64, limit: f64) -> Rounded {
        self.error = self.error.max(error);
        if error > limit && self.refused.last() != Some(&instance) {
            self.refused.push(instance);
        }
        self
    }

    fn and(mut self, other: Rounded) -> Rounded {
        self.error = self.error.max(other.error);
        self.refused.extend(other.refused);
        self
    }
}

/// What storing a group in `frame` comes to; `limits` are those of the scene's instances, in world units.
fn rounded(scene: &Scene, geometries: &[GroupGeometry], frame: DAffine3, limits: &[f64]) -> Rounded {
    let into = frame.inverse();
    let error = |world_from_mesh: &DAffine3, corner: Vec3| {
        let group_from_mesh = into * *world_from_mesh;
        if group_from_mesh == DAffine3::IDENTITY {
            return 0.0;
        }
        moved(&group_from_mesh, corner)
    };
    let of_triangle = |all: Rounded, &at: &TriangleRef| {
        let origin = scene.origin(at);
        let corners = scene.meshes[origin.mesh.0 as usize].corners(origin.triangle);
        let error = corners.into_iter().map(|c| error(&origin.transform, c)).fold(0.0, f64::max);
        all.with(InstanceId(at.instance), error, limits[at.instance as usize])
    };
    let triangles = geometries.par_iter().flat_map(|g| g.triangles.par_iter());
    triangles.fold(Rounded::default, of_triangle).reduce(Rounded::default, Rounded::and)
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
