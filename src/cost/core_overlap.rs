//! The overlap ratio of the core of a scene.
//!
//! The thesis's ratio ([`overlap`]) is relative to the box of the whole scene, which a sky dome or a far object makes so
//! large that nothing in it seems to overlap. This one sums the same areas relative to the box of the scene's core
//! ([`Core`](crate::scene::Core)). It leaves out placements that hold only objects outside the core: the box of a dome
//! overlaps everything by its nature, and no other layout of the rest changes that. A group that joins an object of the
//! core with one outside it counts, because that overlap could be avoided. If nothing is set apart, both ratios are
//! equal.

use super::{overlap, share};
use crate::layout::{Content, GroupGeometry, Layout, Placement};
use crate::scene::{Bounds, InstanceId, Object, Scene, TriangleRef};

/// Returns the overlap ratio of the placements in the core, given the world box of each placement; at least 0, best 0,
/// no upper limit; 0 if the core's box has no area.
pub fn ratio(scene: &Scene, layout: &Layout, boxes: &[Bounds]) -> f64 {
    let area = scene.core().bounds().area();
    let in_core = layout.placements.iter().zip(boxes).filter(|(placement, _)| !is_apart(scene, layout, placement));
    share(overlap::shared_area(&in_core.map(|(_, &bounds)| bounds).collect::<Vec<_>>()), area)
}

/// Whether a placement holds only objects outside the core.
fn is_apart(scene: &Scene, layout: &Layout, placement: &Placement) -> bool {
    let of_instance = |i: u32, triangle: u32| {
        let geometry = scene.mesh_of(InstanceId(i)).locate(triangle).0 as u32;
        scene.core().sets_apart(Object { instance: i, geometry })
    };
    match (&layout.groups[placement.group as usize].content, placement.instance) {
        (Content::Kept(_), instance) => instance.is_some_and(|i| scene.core().sets_instance_apart(i)),
        (Content::Piece { geometries, .. }, Some(i)) => all(geometries, |t| of_instance(i.0, t.triangle)),
        (Content::Piece { .. }, None) => false,
        (Content::Baked { geometries, .. }, _) => all(geometries, |t| of_instance(t.instance, t.triangle)),
    }
}

fn all(geometries: &[GroupGeometry], holds: impl Fn(&TriangleRef) -> bool) -> bool {
    geometries.iter().flat_map(|geometry| &geometry.triangles).all(holds)
}
