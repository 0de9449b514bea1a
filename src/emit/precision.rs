//! Frames that keep the rounding of baked positions within a limit.

use rayon::prelude::*;

use crate::layout::store::{Store, rounding_error};
use crate::layout::{Content, Group, GroupGeometry, Layout, Placement};
use crate::parallel::CHEAP_ELEMENTS;
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

/// Stores a baked group relative to its centre if rounding moves a vertex too far otherwise; gives whether it does, and
/// what rounding comes to then.
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

/// What storing a baked group comes to; `limits` are those of the scene's instances, in world units.
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

/// For every group the largest distance between a corner and its position stored in the frame of a piece, in units of
/// the group; 0 for what is no piece.
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

/// By how much a placement lengthens what is in its group, at most: the root of the sum of squares of the coefficients
/// bounds the largest stretch.
pub(super) fn stretch(placement: &Placement) -> f64 {
    let m = placement.transform.matrix3;
    (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt()
}

/// World box of a group's triangles.
fn bounds(scene: &Scene, geometries: &[GroupGeometry]) -> Bounds {
    geometries
        .par_iter()
        .flat_map(|g| g.triangles.par_iter().with_min_len(CHEAP_ELEMENTS))
        .map(|&at| Bounds::of(scene.world_corners(at)))
        .reduce(|| Bounds::EMPTY, |a, b| a.union(&b))
}
