//! [`Structure`]: what the exhaustive comparison of all triangles finds.

use serde::Serialize;

use super::{FaultKind, Sides};
use crate::scene::{InstanceId, Scene};

/// Triangles with one kind of fault.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Fault {
    /// Number of triangles.
    pub count: u64,
    /// Description of the first of them.
    pub first: Option<String>,
}

/// Results of comparing two scenes triangle by triangle.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Structure {
    /// Number of triangles placed by the input's instances.
    pub triangles_before: u64,
    /// Number of triangles placed by the output's instances.
    pub triangles_after: u64,
    /// Triangles of the input that are not in the output.
    pub missing: Fault,
    /// Triangles of the output in the place of a triangle of the input that another one shows already.
    pub repeated: Fault,
    /// Other triangles of the output that the input does not have.
    pub unknown: Fault,
    /// Triangles with another material than in the input.
    pub wrong_material: Fault,
    /// Triangles in their place that face the other way.
    pub flipped: Fault,
    /// Triangles with a corner farther from its place than allowed, but by no more than half the size of their object;
    /// the farthest one is named.
    pub moved: Fault,
    /// Distance of that triangle's farthest corner from its place, in world units.
    pub farthest_moved: f64,
    /// Triangles without area that only one of the files has. They are no fault, as no ray sees them.
    pub degenerate: Sides<Fault>,
    /// The smallest `max_position_error_ratio` with which the files would be the same, if there is one above the given.
    pub suggested_max_position_error_ratio: Option<f64>,
    /// What the output records about its triangles, held against their places.
    pub record: Record,
    /// What was compared, and what would have been seen.
    pub power: Power,
    /// Largest distance of a corner from its place, in world units.
    pub max_position_error: f64,
    /// The same over the diagonal of the input's box (for a single point, over its distance from the origin).
    pub position_error_ratio: f64,
    /// The object of the input with the largest distance over the diagonal of its own box, and that ratio.
    #[serde(skip)]
    pub worst_object: Option<(InstanceId, f64)>,
    /// The largest distance of a corner of each instance of the output, in world units.
    #[serde(skip)]
    pub of_instances: Vec<f64>,
}

/// What the output records about where its triangles come from. A file without record is taken to number its triangles
/// as the input does.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Record {
    /// Number of triangles that lie where the output records them.
    pub confirmed: u64,
    /// Triangles that are in the input, but elsewhere than recorded.
    pub elsewhere: Fault,
}

/// What a comparison looked at, and what it would have seen.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Power {
    /// Area of the compared triangles, in world units.
    pub area: f64,
    /// A corner that is farther off is seen, in every object: in world units.
    pub smallest_displacement_seen: f64,
    /// The largest distance by which a corner of an object may be off unseen, over the object's size.
    pub smallest_displacement_seen_ratio_of_object: f64,
    /// The name of that object.
    pub object: Option<String>,
}

impl Structure {
    /// The faults, each with its kind.
    pub fn faults(&self) -> [(FaultKind, &Fault); 6] {
        [
            (FaultKind::Missing, &self.missing),
            (FaultKind::Repeated, &self.repeated),
            (FaultKind::Unknown, &self.unknown),
            (FaultKind::WrongMaterial, &self.wrong_material),
            (FaultKind::Flipped, &self.flipped),
            (FaultKind::Moved, &self.moved),
        ]
    }

    /// Whether there are no faults.
    pub fn is_clean(&self) -> bool {
        self.faults().iter().all(|(_, fault)| fault.count == 0)
    }
}

/// Returns the length that position errors are relative to: the diagonal of the scene's box, or its replacement.
pub fn reference_length(scene: &Scene) -> f64 {
    let bounds = scene.bounds();
    let from_origin = bounds.center().length();
    [bounds.diagonal(), from_origin].into_iter().find(|&length| length > 0.0).unwrap_or(1.0)
}

/// Returns how far a corner may lie from where the input's file has it, in world units. What the input itself stores
/// otherwise, no output can avoid.
pub fn allowed_error(before: &Scene, max_position_error_ratio: f64) -> f64 {
    max_position_error_ratio * reference_length(before) + before.largest_unavoidable_error()
}
