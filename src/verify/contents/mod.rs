//! Compares what two files mean beyond the places of their triangles, without what one records about the other.
//!
//! [`compare`] takes the triangles that lie in the same place ([`Pairs`]) and asks whether they show the same there:
//! the same material by content, the same attributes at every corner, the same variants. Nodes, animations, skins,
//! cameras, lights and the rest are then compared by what they act on. What differs is listed as [`Difference`]s, each
//! of a [`DifferenceKind`] that says how severe it is.

mod attributes;
mod comparison;
mod difference;
mod images;
mod materials;
mod meetings;
mod pixels;
mod plan;
mod property;
#[cfg(test)]
mod test_files;
#[cfg(test)]
mod tests_of_attributes;
#[cfg(test)]
mod tests_of_materials;
mod tolerance;

use std::collections::BTreeMap;
use std::path::Path;

pub use difference::{Detail, Difference, DifferenceKind, Severity};
use raykiln_formats::{Document, Error};
use serde::Serialize;
pub use tolerance::Tolerance;

use super::Sides;
use super::surface::pairs::Pairs;
use crate::scene::Scene;
use images::Images;
use materials::Materials;
use meetings::meetings;
use plan::{Planner, Primitives};

/// Two files, and which of their triangles lie in the same place.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Both files.
    pub documents: Sides<&'a Document>,
    /// What a ray tracer sees of each.
    pub scenes: Sides<&'a Scene>,
    /// The triangles of both that lie in the same place.
    pub pairs: &'a Pairs,
    /// If the output was read from a hidden folder: that folder, and the one that it is meant for. Images that are
    /// missing in the first are searched in the second.
    pub staged: Option<(&'a Path, &'a Path)>,
}

/// What was compared, and what differs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ContentsReport {
    /// How much was compared.
    pub compared: Compared,
    /// What differs, the errors first, each kind in the order of [`DifferenceKind::ALL`].
    pub differences: Vec<Difference>,
}

/// How much was compared.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Compared {
    /// Pairs of triangles.
    pub triangles: u64,
    /// Pairs of different materials, one of the input and one of the output, that show themselves in one place.
    pub materials: u64,
    /// Textures of these materials.
    pub textures: u64,
    /// Corners of the pairs of triangles, by attribute.
    pub corners: BTreeMap<String, u64>,
}

impl ContentsReport {
    /// Whether a difference is an error.
    pub fn has_errors(&self) -> bool {
        self.differences.iter().any(|difference| difference.severity == Severity::Error)
    }
}

/// Compares two files.
///
/// # Errors
/// An error of [`Document::contents`] in either file.
pub fn compare(inputs: Inputs<'_>, tolerance: &Tolerance) -> Result<ContentsReport, Error> {
    let meetings = meetings(inputs.scenes, inputs.pairs);
    let images = Images::of(&inputs);
    let materials = Materials::of(inputs.documents, &images);
    let mut report = ContentsReport::default();
    report.compared.triangles = meetings.iter().map(|m| m.triangles).sum();
    materials.compare(&inputs, &meetings, &mut report);
    let primitives = Primitives::of(&inputs);
    let joints = Sides::default();
    let scenes = inputs.scenes;
    let displacement = tolerance.position_ratio * scenes.before.bounds().diagonal();
    let planner =
        Planner { scenes, primitives: &primitives, materials: &materials, joints: &joints, tolerance, displacement };
    attributes::compare(&inputs, &planner, &mut report);
    report.differences.sort_by_key(|difference| (difference.severity, difference.kind));
    Ok(report)
}
