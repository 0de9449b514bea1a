//! Chooses frames that keep the rounding of baked positions within a limit.

use rayon::prelude::*;

use crate::layout::store::{Store, rounding_error};
use crate::layout::{Content, Group, GroupGeometry, Layout, Placement};
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::{Bounds, InstanceId, Scene, TriangleRef};

/// The result of [`settle`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settled {
    /// Number of groups whose positions are now stored relative to their centre.
    pub centred: usize,
    /// The largest distance between a corner and its stored position, in world units.
    pub error: f64,
    /// Instances whose triangles cannot be written out within the limit.
    pub refused: Vec<InstanceId>,
}

/// What must stay unchanged if rounding moves a corner too far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refuse {
    /// The instance of that corner.
    Instances,
    /// All instances of its group.
    Groups,
}

/// Rounding must not move a corner farther than this share of the diagonal of its own instance: in a large scene, the
/// limit for the scene exceeds the size of small objects.
const OF_OWN_SIZE: f64 = 1e-4;

/// Stores each baked group relative to its centre if rounding world positions to single precision would move a vertex
/// farther than `max_error_ratio` of the diagonal of the scene or of the group, or than a ten-thousandth of that of its
/// instance: a small object far from the origin keeps its shape. Returns the instances, including those opened into
/// pieces stored in frames, that would still exceed the ratio of the scene's diagonal or a ten-thousandth of their own.
pub fn settle(scene: &Scene, layout: &mut Layout, max_error_ratio: f64, refuse: Refuse) -> Settled {
    let boxes = scene.instance_boxes();
    let limit = max_error_ratio * scene.bounds().diagonal();
    let limits: Vec<f64> = boxes.iter().map(|own| limit.min(own_limit(own))).collect();
    let mut settled = Settled::default();
    for group in &mut layout.groups {
        let (is_centred, rounded) = settle_group(scene, &mut group.content, &limits, max_error_ratio);
        settled.centred += usize::from(is_centred);
        settled.error = settled.error.max(rounded.error);
        match (&group.content, refuse) {
            (Content::Baked { geometries, .. }, Refuse::Groups) if !rounded.refused.is_empty() => {
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

/// Stores a baked group relative to its centre if rounding would otherwise move a vertex too far; returns whether it
/// does, and the resulting rounding errors.
fn settle_group(scene: &Scene, content: &mut Content, limits: &[f64], max_error_ratio: f64) -> (bool, Rounded) {
    let at_origin = rounded(scene, content, limits);
    let Content::Baked { frame, geometries } = content else { return (false, at_origin) };
    if at_origin.error == 0.0 {
        return (false, at_origin);
    }
    let bounds = bounds(scene, geometries);
    let is_too_far = at_origin.error > max_error_ratio * bounds.diagonal() || !at_origin.refused.is_empty();
    if !is_too_far {
        return (false, at_origin);
    }
    frame.translation = bounds.stored_center();
    (true, rounded(scene, content, limits))
}

/// Returns how far a corner of an instance with this box may move; infinite if the box is a point, which has no shape
/// to keep.
fn own_limit(own: &Bounds) -> f64 {
    if own.diagonal() > 0.0 { OF_OWN_SIZE * own.diagonal() } else { f64::INFINITY }
}

/// Rounding errors of the triangles of a group.
#[derive(Default)]
struct Rounded {
    /// The largest distance between a corner and its stored position, in world units.
    error: f64,
    /// Instances with a corner beyond their limit, possibly with duplicates.
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

/// Returns the rounding errors of storing a baked group; `limits` are those of the scene's instances, in world units.
fn rounded(scene: &Scene, content: &Content, limits: &[f64]) -> Rounded {
    let Content::Baked { geometries, .. } = content else { return Rounded::default() };
    let store = Store::new(scene, content);
    let of_triangle = |all: Rounded, &at: &TriangleRef| {
        let error = store.corners_of(at).into_iter().map(rounding_error).fold(0.0, f64::max);
        all.with(InstanceId(at.instance), error, limits[at.instance as usize])
    };
    let triangles = geometries.par_iter().flat_map(|g| g.triangles.par_iter().with_min_len(CHEAP_ELEMENTS));
    triangles.fold(Rounded::default, of_triangle).reduce(Rounded::default, Rounded::and)
}

/// Returns, for each group, the largest distance between a corner and its position stored in the frame of a piece, in
/// units of the group; 0 for groups that are not pieces.
fn piece_errors(scene: &Scene, layout: &Layout) -> Vec<f64> {
    let of_group = |group: &Group| {
        let store = Store::new(scene, &group.content);
        if matches!(group.content, Content::Baked { .. }) || store.is_exact() {
            return 0.0;
        }
        (0..store.len()).flat_map(|t| store.corners(t)).map(rounding_error).fold(0.0, f64::max)
    };
    layout.groups.par_iter().map(of_group).collect()
}

/// Returns an upper bound on the factor by which a placement lengthens vectors of its group: the square root of the sum
/// of the squared coefficients.
pub(super) fn stretch(placement: &Placement) -> f64 {
    let m = placement.transform.matrix3;
    (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt()
}

/// Returns the world box of a group's triangles.
fn bounds(scene: &Scene, geometries: &[GroupGeometry]) -> Bounds {
    geometries
        .par_iter()
        .flat_map(|g| g.triangles.par_iter().with_min_len(CHEAP_ELEMENTS))
        .map(|&at| Bounds::of(scene.world_corners(at)))
        .reduce(|| Bounds::EMPTY, |a, b| a.union(&b))
}
