//! Vendor guidance as rules. Each file checks one rule, or a few that need the same numbers, and names rule and source;
//! docs/inspect.md lists them all.
//!
//! Shares of the scene are relative to its core, so that a sky dome or a far object hides nothing, and lengths to the
//! scene's own size. What moves by design is not held against a scene: animated, skinned and morphed instances take no
//! part in rules about boxes. Each check takes time near-linear in triangles stored and instances.

mod copies;
mod degenerate;
mod empty_space;
mod far_from_origin;
mod limits;
mod loose_boxes;
mod moving_parts;
mod needles;
mod nesting;
mod opacity;
mod overlap;
mod set_apart;
mod shapes;
mod small;
#[cfg(test)]
mod test_subject;
mod tiny;

use raykiln_formats::Document;

use crate::cost::mesh_trees::MeshTrees;
use crate::report::Finding;
use crate::scene::{Bounds, InstanceId, Mesh, Pinned, Scene};
use shapes::Shapes;

/// The checks, in the order of their rules.
const CHECKS: [fn(&Subject) -> Vec<Finding>; 15] = [
    overlap::check,
    empty_space::check,
    copies::check,
    moving_parts::check,
    set_apart::shells,
    needles::check,
    opacity::check,
    degenerate::check,
    small::check,
    limits::check,
    loose_boxes::check,
    set_apart::outliers,
    far_from_origin::check,
    tiny::check,
    nesting::check,
];

/// Returns all findings about a scene, ordered by rule. `trees` are those of its meshes, `as_bytes` are the predicted
/// bytes of its acceleration structures.
pub(crate) fn findings(doc: &Document, scene: &Scene, trees: &MeshTrees, as_bytes: u64) -> Vec<Finding> {
    let subject = Subject::new(doc, scene, trees, as_bytes);
    CHECKS.iter().flat_map(|check| check(&subject)).collect()
}

/// The scene that is checked, with what several rules need to know about it.
struct Subject<'a> {
    doc: &'a Document,
    scene: &'a Scene,
    trees: &'a MeshTrees,
    as_bytes: u64,
    /// World boxes of the instances; empty for those that move by design or are outside the core.
    boxes: Vec<Bounds>,
    /// Surface area of the core's box.
    core_area: f64,
    shapes: Shapes,
}

impl<'a> Subject<'a> {
    fn new(doc: &'a Document, scene: &'a Scene, trees: &'a MeshTrees, as_bytes: u64) -> Subject<'a> {
        let mut boxes = scene.core().instance_boxes(scene);
        let moving = boxes.iter_mut().zip(&scene.instances).filter(|(_, instance)| moves(instance.pinned));
        moving.for_each(|(bounds, _)| *bounds = Bounds::EMPTY);
        let core_area = scene.core().bounds().area();
        Subject { doc, scene, trees, as_bytes, boxes, core_area, shapes: Shapes::of(scene) }
    }

    /// A share of the core's surface area; 0 if that has none.
    fn share(&self, area: f64) -> f64 {
        if self.core_area > 0.0 && area.is_finite() { area / self.core_area } else { 0.0 }
    }

    /// The instances in the core that do not move by design.
    fn still(&self) -> impl Iterator<Item = InstanceId> + '_ {
        let still = self.boxes.iter().enumerate().filter(|(_, bounds)| !bounds.is_empty());
        still.map(|(i, _)| InstanceId(i as u32))
    }

    fn name(&self, instance: InstanceId) -> String {
        self.scene.instances[instance.0 as usize].display_name()
    }
}

/// Whether an instance moves by design.
fn moves(pinned: Option<Pinned>) -> bool {
    matches!(pinned, Some(Pinned::Animated | Pinned::Skinned | Pinned::Morphed))
}

/// The name of a mesh, or its number in the file.
fn mesh_name(mesh: &Mesh) -> String {
    if mesh.name.is_empty() { format!("mesh {}", mesh.source) } else { mesh.name.clone() }
}

/// By how much a transform scales areas, averaged over directions: exact for rotations and uniform scales.
fn area_scale(linear: &glam::DMat3) -> f64 {
    linear.determinant().abs().cbrt().powi(2)
}
