//! Compares what two files mean beyond the places of their triangles, without what one records about the other.
//!
//! [`compare`] takes the triangles that lie in the same place ([`Pairs`]) and asks whether they show the same there:
//! the same material by content, the same attributes at every corner, the same variants. Nodes, animations, skins,
//! cameras, lights and the rest are then compared by what they act on. What differs is listed as [`Difference`]s, each
//! of a [`DifferenceKind`] that says how severe it is.

mod animations;
mod attributes;
mod comparison;
pub(crate) mod curve;
mod difference;
mod findings;
mod images;
mod materials;
mod meaning;
mod meetings;
mod nodes;
mod pixels;
mod plan;
mod primitives;
mod property;
mod scenes;
mod strokes;
#[cfg(test)]
mod test_files;
#[cfg(test)]
mod tests_of_attributes;
#[cfg(test)]
mod tests_of_materials;
#[cfg(test)]
mod tests_of_meaning;
mod tolerance;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

pub use difference::{Detail, Difference, DifferenceKind, Severity};
use raykiln_formats::{Document, Error};
use serde::Serialize;
pub use tolerance::Tolerance;

use super::surface::pairs::Pairs;
use super::{Side, Sides};
use crate::scene::{Instance, Scene};
use curve::Allowed;
use findings::Findings;
use images::Images;
use materials::Materials;
use meaning::Meaning;
use meetings::meetings;
use nodes::Nodes;
use plan::{Joints, Planner, Primitives};
use property::Correspondence;
use raykiln_formats::properties::{Property, Skin};

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
    /// Nodes of the input that were found in the output.
    pub nodes: u64,
    /// Animations of the input.
    pub animations: u64,
    /// Scenes of the input besides the default one whose triangles were compared: those that show other meshes.
    pub other_scenes: u64,
    /// Points and lines of the input.
    pub points_and_lines: u64,
}

impl ContentsReport {
    /// Whether a difference is an error.
    pub fn has_errors(&self) -> bool {
        self.differences.iter().any(|difference| difference.severity == Severity::Error)
    }
}

/// Compares two files in all that this folder knows: what the default scenes show, and all else; the triangles
/// of other scenes are paired here.
///
/// # Errors
/// An error of [`Document::contents`] in either file.
pub fn compare(inputs: Inputs<'_>, tolerance: &Tolerance) -> Result<ContentsReport, Error> {
    compare_parts(inputs, tolerance, true)
}

/// Compares only what the triangles of two scenes show: materials, attributes, variants.
fn compare_shown(inputs: Inputs<'_>, tolerance: &Tolerance) -> Result<ContentsReport, Error> {
    compare_parts(inputs, tolerance, false)
}

fn compare_parts(inputs: Inputs<'_>, tolerance: &Tolerance, is_whole: bool) -> Result<ContentsReport, Error> {
    let meetings = meetings(inputs.scenes, inputs.pairs);
    let images = Images::of(&inputs);
    let materials = Materials::of(inputs.documents, &images);
    let hierarchies =
        Sides { before: inputs.documents.before.hierarchy()?, after: inputs.documents.after.hierarchy()? };
    let record = inputs.scenes.before.provenance.record();
    let added = |node: usize| record.is_some_and(|record| record.nodes.get(node) == Some(&None));
    let nodes = Nodes::of(hierarchies, added);
    let skins = inputs.documents.map(Document::skins);
    let mut report = ContentsReport::default();
    report.compared.triangles = meetings.iter().map(|m| m.triangles).sum();
    materials.compare(&inputs, &meetings, &mut report);
    let distance = tolerance.position_ratio * inputs.scenes.before.bounds().diagonal();
    let planner = Planner {
        scenes: inputs.scenes,
        primitives: &Primitives::of(&inputs),
        materials: &materials,
        joints: &joints(&inputs, &nodes, &skins),
        tolerance,
        displacement: distance,
    };
    attributes::compare(&inputs, &planner, &mut report);
    let same = Same { materials: &materials, nodes: &nodes, skins: &skins };
    let mut found = Findings::default();
    primitives::compare(&inputs, &meetings, &same, &mut found);
    if is_whole {
        compare_rest(&inputs, &same, (tolerance, distance), &mut report.compared, &mut found);
    }
    found.report(&mut report);
    if is_whole {
        scenes::compare(&inputs, &nodes, tolerance, &mut report)?;
    }
    report.differences.sort_by_key(|difference| (difference.severity, difference.kind));
    Ok(report)
}

/// Compares nodes, animations, scenes, points and lines, and what the files say of themselves.
fn compare_rest(
    inputs: &Inputs<'_>,
    same: &Same<'_>,
    (tolerance, distance): (&Tolerance, f64),
    compared: &mut Compared,
    found: &mut Findings,
) {
    let nodes = same.nodes;
    let animations = inputs.documents.map(Document::animations);
    let animated = animations::animated(&animations.before, nodes.after.len());
    let meaning = Meaning::of(inputs, nodes, same, same.skins.as_ref().map(Vec::as_slice), distance, animated);
    meaning.compare(found);
    meaning.scenes(found);
    let allowed = Allowed { distance, angle: tolerance.angle, weight: tolerance.weight };
    animations::compare(&animations, nodes, same, allowed, found);
    strokes::compare(inputs, nodes, same, distance, compared, found);
    let told = inputs.documents.map(|doc| Property::Object(doc.root_content()));
    found.properties(DifferenceKind::FileData, None, "", [Some(&told.before), Some(&told.after)], same);
    compared.nodes = nodes.after.iter().flatten().count() as u64;
    compared.animations = animations.before.len() as u64;
}

/// Which images, materials and nodes of two files are the same; and their skins.
struct Same<'a> {
    materials: &'a Materials<'a>,
    nodes: &'a Nodes,
    skins: &'a Sides<Vec<Skin>>,
}

impl Correspondence for Same<'_> {
    fn images(&self, before: usize, after: usize) -> bool {
        self.materials.images(before, after)
    }

    fn materials(&self, before: Option<usize>, after: Option<usize>) -> bool {
        self.materials.are_same(before, after)
    }

    fn nodes(&self, before: usize, after: usize) -> bool {
        self.nodes.are_same(before, after)
    }
}

/// Returns for each instance with a skin which nodes of the input its joints are.
fn joints(inputs: &Inputs<'_>, nodes: &Nodes, skins: &Sides<Vec<Skin>>) -> Sides<Vec<Joints>> {
    let of_side = |side: Side| {
        let number = |joint: usize| match side {
            Side::Before => joint as u32,
            Side::After => nodes.before.get(joint).copied().flatten().map_or(u32::MAX, |node| node as u32),
        };
        let of_skin = |skin: &Skin| -> Arc<[u32]> { skin.joints.iter().map(|&joint| number(joint)).collect() };
        let of_skins: Vec<Arc<[u32]>> = skins[side].iter().map(of_skin).collect();
        let skin = |instance: &Instance| nodes.get(side, instance.node as usize).skin;
        let of_instance = |instance: &Instance| skin(instance).and_then(|skin| of_skins.get(skin).cloned());
        inputs.scenes[side].instances.iter().map(of_instance).collect()
    };
    Sides { before: of_side(Side::Before), after: of_side(Side::After) }
}
