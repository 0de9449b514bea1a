//! What a verification did otherwise than asked; [`crate::report`] puts it into words.

use super::Side;
use super::contents::Difference;
use super::rays::RayKind;
use super::regrouped::Regrouped;
use super::seams::Seams;
use super::sight::CannotTell;

/// Something that a verification did otherwise than asked.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// Rays are traced on the CPU.
    OnCpu(WhyCpu),
    /// The structures of input and output were built and timed one after the other, for this reason of the device's.
    NotInTurns(String),
    /// Materials are matched by their look, because not all of them have names.
    ByLook,
    /// Rays cannot tell some objects; the exact comparison can.
    CannotTell(CannotTell),
    /// Triangles are there, but the output records that they are others: how many, and the first.
    RecordedElsewhere(u64, String),
    /// The record of the output leads to another input.
    RecordOfAnotherInput,
    /// The record of the output is of other geometry.
    StaleRecord,
    /// The record of the output cannot be read, and why.
    DamagedRecord(&'static str),
    /// More rays are lost at edges and vertices than in the input, but corners may be that far off.
    Seams(Seams),
    /// Something beyond the places of triangles differs, without harm.
    Differs(Difference),
    /// Triangles without area that only one of the files has: how many, and the first.
    Degenerate(Side, u64, String),
    /// On the way through one of the files some textures count as opaque.
    OpaqueTextures(Side, OpaqueTextures),
}

/// Why rays are traced on the CPU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WhyCpu {
    /// The device failed; its reason.
    Failed(String),
    /// No Vulkan device can trace rays.
    NoDevice,
    /// Only these software drivers can.
    OnlySoftware(Vec<String>),
}

/// Textures of alpha-tested materials that timed rays take for opaque, because they could not be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpaqueTextures {
    /// The first few, each with its cause.
    pub named: Vec<String>,
    /// How many more there are.
    pub more: usize,
}

/// Why a file fails.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// Triangles with a kind of fault.
    Triangles {
        /// What is wrong with them.
        fault: FaultKind,
        /// How many there are.
        count: u64,
        /// The first of them.
        first: Option<String>,
    },
    /// Corners lie too far from their place.
    Moved {
        /// The number of triangles.
        count: u64,
        /// The triangle that is farthest off.
        farthest: Option<String>,
        /// How far, in world units.
        distance: f64,
        /// The ratio with which the files would be the same, if there is one.
        suggested_max_position_error_ratio: Option<f64>,
    },
    /// Something beyond the places of triangles differs.
    Differs(Difference),
    /// BLAS groups are merged or split, though they must not be.
    Regrouped(Regrouped),
    /// Rays see something else.
    Rays {
        /// How many do.
        mismatches: u64,
        /// How many were compared.
        rays: u64,
        /// The first of them.
        examples: Vec<Mismatch>,
    },
    /// More rays are lost at edges and vertices than in the input.
    Seams(Seams),
    /// Rays cannot tell whether some objects are there, and nothing else was compared.
    CannotTell(CannotTell),
    /// No ray hits anything in either file, and nothing else was compared.
    NothingHit,
    /// Too many rays continue to another surface, and nothing else was compared.
    FarHits {
        /// How many do.
        far_hits: u64,
        /// How many were compared.
        rays: u64,
    },
    /// Rays touched too small a share of the input's area, and nothing else was compared.
    Untouched {
        /// The share.
        touched_area_ratio: f64,
    },
}

impl Failure {
    /// Whether it says that the files may be the same, or not.
    pub(crate) fn is_unclear(&self) -> bool {
        use Failure::{CannotTell, FarHits, NothingHit, Untouched};
        matches!(self, CannotTell(_) | NothingHit | FarHits { .. } | Untouched { .. })
    }
}

/// What can be wrong with a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// The output lacks it.
    Missing,
    /// The output has it more than once.
    Repeated,
    /// It is none of the input's.
    Unknown,
    /// It has another material.
    WrongMaterial,
    /// It faces the other way.
    Flipped,
    /// It lies elsewhere.
    Moved,
    /// It is there, but the output records that it is another one.
    Elsewhere,
}

/// A ray that hits something else in the output than in the input.
#[derive(Clone, Debug, PartialEq)]
pub struct Mismatch {
    /// The kind of ray.
    pub kind: RayKind,
    /// Its index among the rays of its kind.
    pub ray: usize,
    /// What is wrong with its hit.
    pub wrong: Wrong,
    /// What it hits in the output; `None` if nothing, or a triangle that the input does not have.
    pub shown: Option<Target>,
    /// What it hits in the input.
    pub truth: Option<Target>,
}

/// What a ray hits.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// A triangle, by its place in the input file.
    Triangle(String),
    /// A surface whose triangle is not known.
    Surface {
        /// The name of its material.
        material: String,
        /// Distance from the ray's origin, in world units.
        distance: f64,
    },
}

/// What can be wrong with a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    /// Nothing is hit.
    Nothing,
    /// The triangle is not one of the input's.
    UnknownTriangle,
    /// The triangle lies elsewhere in the input.
    MovedTriangle,
    /// The triangle is hit from its other side.
    BackOfTriangle,
    /// The triangle hit in the input is missing in the output.
    LostTriangle,
    /// The triangle lies behind the one hit in the input.
    TriangleBehind,
    /// The input has no such surface at this distance.
    MovedSurface,
    /// The surface is hit from its other side.
    BackOfSurface,
    /// The surface lies behind the one hit in the input.
    SurfaceBehind,
    /// It has another material.
    Material,
    /// It has another material than the triangle of the input in the same place.
    MaterialInPlace,
}
