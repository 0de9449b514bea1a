//! What a verification did otherwise than asked; [`crate::report`] puts it into words.

use super::Side;

/// Something that a verification did otherwise than asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Note {
    /// Rays are traced on the CPU.
    OnCpu(WhyCpu),
    /// The structures of input and output were built and timed one after the other, for this reason of the device's.
    NotInTurns(String),
    /// Materials are matched by their look, because not all of them have names.
    ByLook,
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
    /// A corner lies too far from its place; distances are over the scene's diagonal.
    Moved {
        /// How far.
        position_error_ratio: f64,
        /// How far it may.
        allowed: f64,
    },
    /// Rays see something else.
    Rays {
        /// How many do.
        mismatches: u64,
        /// How many were compared.
        rays: u64,
        /// The first of them.
        examples: Vec<String>,
    },
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
}
