//! Compares what scenes other than the default one show.

use std::collections::BTreeSet;

use raykiln_formats::{Document, Error};

use super::super::identity::Identity;
use super::super::structure::Structure;
use super::super::{FaultKind, Side, Sides, surface};
use super::nodes::Nodes;
use super::{ContentsReport, Detail, Difference, DifferenceKind, Inputs, Tolerance, compare_shown};
use crate::scene::{LoadOptions, Scene, load};

/// Compares the triangles of each scene that shows meshes which the default one does not.
pub(super) fn compare(
    inputs: &Inputs<'_>,
    nodes: &Nodes,
    tolerance: &Tolerance,
    report: &mut ContentsReport,
) -> Result<(), Error> {
    let numbers = nodes.hierarchies.as_ref().map(|hierarchy| hierarchy.scenes.len());
    for scene in 0..numbers.before.min(numbers.after) {
        if Side::BOTH.iter().any(|&side| shows_more(nodes, side, scene)) {
            let name = nodes.hierarchies.before.scenes[scene].name.clone();
            let name = name.unwrap_or_else(|| format!("scene {scene}"));
            compare_scene(inputs, tolerance, scene, name, report)?;
            report.compared.other_scenes += 1;
        }
    }
    Ok(())
}

/// Whether a scene places meshes by nodes that the default one does not show.
fn shows_more(nodes: &Nodes, side: Side, scene: usize) -> bool {
    let hierarchy = &nodes.hierarchies[side];
    if scene == hierarchy.default {
        return false;
    }
    let shown = |scene: usize| -> BTreeSet<usize> {
        let roots = hierarchy.scenes.get(scene).map(|scene| scene.roots.clone()).unwrap_or_default();
        nodes.below(side, roots).filter(|&node| nodes.get(side, node).mesh.is_some()).collect()
    };
    !shown(scene).is_subset(&shown(hierarchy.default))
}

fn compare_scene(
    inputs: &Inputs<'_>,
    tolerance: &Tolerance,
    scene: usize,
    name: String,
    report: &mut ContentsReport,
) -> Result<(), Error> {
    let documents = inputs.documents.map(|doc| doc.showing(scene));
    let scenes = Sides { before: triangles(&documents.before)?, after: triangles(&documents.after)? };
    let (Some(before), Some(after)) = (&scenes.before, &scenes.after) else {
        if scenes.before.is_some() || scenes.after.is_some() {
            report.differences.push(Difference::new(DifferenceKind::SceneTriangles, 1, Some(name), None));
        }
        return Ok(());
    };
    let (structure, pairs) = surface::compare(&Identity::new(before, after), tolerance.position_ratio);
    report.differences.extend(faults(&structure).into_iter().map(|(kind, count, first)| {
        let detail = Detail::Property { of: first, property: kind, before: None, after: None };
        Difference::new(DifferenceKind::SceneTriangles, count, Some(name.clone()), Some(detail))
    }));
    let shown = Inputs { documents: documents.as_ref(), scenes: Sides { before, after }, pairs: &pairs, ..*inputs };
    report.differences.extend(compare_shown(shown, tolerance)?.differences);
    Ok(())
}

/// Returns what a scene shows; `None` without triangles.
fn triangles(doc: &Document) -> Result<Option<Scene>, Error> {
    doc.hierarchy()?;
    // All else was found when the default scene was read.
    Ok(load(doc, &LoadOptions::default()).ok().map(|(scene, _)| scene))
}

/// Returns what is wrong with triangles, other than their materials: kind, number and the first.
fn faults(structure: &Structure) -> Vec<(String, u64, Option<String>)> {
    let all =
        structure.faults().into_iter().filter(|(kind, fault)| fault.count > 0 && *kind != FaultKind::WrongMaterial);
    all.map(|(kind, fault)| (format!("{kind:?}").to_lowercase(), fault.count, fault.first.clone())).collect()
}
