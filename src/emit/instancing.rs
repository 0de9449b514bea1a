//! `--instancing extension`: several instances of one mesh placed by a single node with `EXT_mesh_gpu_instancing`.
//!
//! The extension gives a node a list of copies, each with a translation, a rotation and a scale in single precision.
//! Everything else stays with the node that a copy represents: that node is emptied, and keeps its name, extras,
//! children and place. The record of provenance says which node each copy represents.
//!
//! Excluded are pinned instances, those of nodes that already use the extension (whose copies may have attributes of
//! their own, such as `_ID`), and those whose transform cannot be represented this way within the position error allowed, such as shears.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};
use raykiln_formats::Document;
use raykiln_formats::document::{Component, Element};
use raykiln_formats::edit::{CopyAttributes, NewAccessor, NewNode, Target};
use rayon::prelude::*;

use super::hierarchy::Hierarchy;
use super::origins::ShownBy;
use crate::layout::store::Store;
use crate::layout::{Content, Layout, Placement};
use crate::parallel;
use crate::scene::{Bounds, InstanceId, Scene, most_stretch};

/// How several instances of a mesh are written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Instancing {
    /// Each as a node.
    #[default]
    Nodes,
    /// As copies of one node, if its corners then move by at most this share of the scene's diagonal.
    Extension {
        /// Maximum distance between a corner and its position in the copy, relative to the scene's diagonal.
        max_position_error_ratio: f64,
    },
}

/// Statistics on copies of nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Copied {
    /// Number of nodes that place a mesh several times.
    pub nodes: usize,
    /// Number of instances that they place.
    pub copies: usize,
    /// Number of instances of the same meshes that stay nodes, because a translation, a rotation and a scale in single
    /// precision do not represent their transforms within the position error allowed.
    pub stay: usize,
}

/// Instances of one group that become copies of one node.
pub(super) struct Batch {
    pub(super) group: u32,
    /// Indices into the layout's placements, in ascending order.
    placements: Vec<usize>,
    copies: Vec<Copy>,
    /// Position of the node.
    center: DVec3,
    /// Upper bound on the movement of a corner.
    error: f64,
}

/// One copy as the extension stores it.
struct Copy {
    translation: [f32; 3],
    rotation: [f32; 4],
    scale: [f32; 3],
    /// Upper bound on the distance between a corner of the mesh and its position in the instance.
    error: f64,
}

/// All batches of a layout, in the order of their first instances.
#[derive(Default)]
pub(super) struct Batches {
    pub(super) list: Vec<Batch>,
    pub(super) copied: Copied,
    /// Upper bound on the movement of any corner.
    pub(super) error: f64,
}

impl Batches {
    /// Finds instances that can be written as copies of a node. `errors` holds the position errors of the stored
    /// groups, in their own units.
    pub(super) fn of(
        document: &Document,
        scene: &Scene,
        layout: &Layout,
        errors: &[f64],
        instancing: Instancing,
    ) -> Batches {
        let Instancing::Extension { max_position_error_ratio } = instancing else { return Batches::default() };
        let most_error = max_position_error_ratio * scene.bounds().diagonal() + scene.largest_unavoidable_error();
        let candidates = candidates(document, scene, layout);
        let batch = |(group, placements): (u32, Vec<usize>)| -> (Option<Batch>, usize) {
            let all = placements.len();
            let batch = Batch::of(scene, layout, group, placements, [errors[group as usize], most_error]);
            let stay = all - batch.as_ref().map_or(0, |b| b.copies.len());
            (batch, stay)
        };
        let found: Vec<_> = candidates.into_par_iter().map(batch).collect();
        let mut batches = Batches { list: Vec::new(), copied: Copied::default(), error: 0.0 };
        for (batch, stay) in found {
            batches.copied.stay += stay;
            if let Some(batch) = batch {
                batches.copied.copies += batch.copies.len();
                batches.error = batches.error.max(batch.error);
                batches.list.push(batch);
            }
        }
        batches.copied.nodes = batches.list.len();
        batches.list.sort_by_key(|b| (b.placements[0], b.group));
        batches
    }

    /// Adds the nodes to the document; returns, for each placement of the layout, the node that has it as a copy.
    pub(super) fn write(
        &self,
        document: &mut Document,
        scene: &Scene,
        layout: &Layout,
        meshes: &[usize],
        hierarchy: &Hierarchy,
    ) -> Vec<Option<ShownBy>> {
        let mut shown_by = vec![None; layout.placements.len()];
        let mut accessors = Accessors::default();
        for batch in &self.list {
            let node = batch.write(document, scene, layout, meshes, hierarchy, &mut accessors);
            (0..).zip(&batch.placements).for_each(|(copy, &at)| shown_by[at] = Some(ShownBy { node, copy }));
        }
        shown_by
    }
}

/// A group, and whether its copies are mirrored.
type Alike = (u32, bool);

/// Returns groups with at least two placements that may become copies of one node. Mirrored ones are grouped separately,
/// because no graphics interface turns the winding of some instances of a draw.
fn candidates(document: &Document, scene: &Scene, layout: &Layout) -> Vec<(u32, Vec<usize>)> {
    let mut lists: BTreeMap<Alike, Vec<usize>> = BTreeMap::new();
    for (at, placement) in layout.placements.iter().enumerate() {
        let content = &layout.groups[placement.group as usize].content;
        let may_move = |&i: &InstanceId| may_move(scene, i) && !(has_more(document, scene, content));
        if placement.instance.filter(may_move).is_none() {
            continue;
        }
        let is_mirrored = placement.transform.matrix3.determinant() < 0.0;
        lists.entry((placement.group, is_mirrored)).or_default().push(at);
    }
    lists.into_iter().filter(|(_, list)| list.len() > 1).map(|((group, _), list)| (group, list)).collect()
}

/// Whether the node of an instance can do without its mesh.
fn may_move(scene: &Scene, instance: InstanceId) -> bool {
    let instance = &scene.instances[instance.0 as usize];
    instance.pinned.is_none() && !scene.is_copied(instance.node)
}

/// Whether a kept mesh has points or lines, whose error is not known.
fn has_more(document: &Document, scene: &Scene, content: &Content) -> bool {
    let Content::Kept(mesh) = content else { return false };
    let mesh = &scene.meshes[mesh.0 as usize];
    document.primitive_count(mesh.source as usize) != mesh.geometries.len()
}

impl Batch {
    /// Creates the batch of those placements that copies represent within the error; `None` if there are fewer than
    /// two.
    fn of(
        scene: &Scene,
        layout: &Layout,
        group: u32,
        placements: Vec<usize>,
        [stored, most]: [f64; 2],
    ) -> Option<Batch> {
        let bounds = Store::new(scene, &layout.groups[group as usize].content).bounds();
        let copies_around = |center: DVec3| -> Vec<Option<Copy>> {
            let copy = |&at: &usize| Copy::of(&layout.placements[at], &bounds, center, stored);
            parallel::map_each(&placements, &|at| copy(at).filter(|c| c.error <= most))
        };
        let count = |copies: &[Option<Copy>]| copies.iter().flatten().count();
        let (mut center, mut copies) = (DVec3::ZERO, copies_around(DVec3::ZERO));
        if count(&copies) < placements.len() {
            // Single precision is coarse far from the origin.
            let around = Bounds::of(placements.iter().map(|&at| layout.placements[at].transform.translation));
            let centred = copies_around(around.stored_center());
            if count(&centred) > count(&copies) {
                (center, copies) = (around.stored_center(), centred);
            }
        }
        let (placements, copies): (Vec<usize>, Vec<Copy>) =
            placements.into_iter().zip(copies).filter_map(|(at, copy)| Some((at, copy?))).unzip();
        let error = copies.iter().map(|c| c.error).fold(0.0, f64::max);
        (copies.len() > 1).then_some(Batch { group, placements, copies, center, error })
    }

    /// Adds the node; returns its index.
    fn write(
        &self,
        document: &mut Document,
        scene: &Scene,
        layout: &Layout,
        meshes: &[usize],
        hierarchy: &Hierarchy,
        accessors: &mut Accessors,
    ) -> usize {
        let is_turned = self.copies.iter().any(|c| c.rotation != NO_ROTATION);
        let is_scaled = self.copies.iter().any(|c| c.scale != NO_SCALE);
        let mut floats = |components, data| accessors.floats(document, components, data);
        let copies = CopyAttributes {
            translation: floats(3, bytes(&self.copies, |c| c.translation)),
            rotation: is_turned.then(|| floats(4, bytes(&self.copies, |c| c.rotation))),
            scale: is_scaled.then(|| floats(3, bytes(&self.copies, |c| c.scale))),
        };
        let instances = self.placements.iter().filter_map(|&at| layout.placements[at].instance);
        let nodes = instances.map(|i| scene.instances[i.0 as usize].node as usize);
        let below = hierarchy.below_common_ancestor(nodes, &DAffine3::from_translation(self.center));
        let new = NewNode {
            name: &layout.groups[self.group as usize].name,
            mesh: meshes[self.group as usize],
            transform: below.local,
        };
        let node = document.add_node(below.parent, &new);
        document.set_copies(node, &copies);
        node
    }
}

const NO_ROTATION: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
const NO_SCALE: [f32; 3] = [1.0; 3];

impl Copy {
    /// Returns the translation, rotation and scale closest to a placement's transform, relative to a node at `center`;
    /// `None` if there are none or single precision overflows.
    fn of(placement: &Placement, bounds: &Bounds, center: DVec3, stored_error: f64) -> Option<Copy> {
        let (exact, middle) = (placement.transform, bounds.center());
        let (scale, rotation, _) = exact.to_scale_rotation_translation();
        let (scale, rotation) = (scale.as_vec3(), (if rotation.w < 0.0 { -rotation } else { rotation }).as_quat());
        let turned =
            DAffine3::from_scale_rotation_translation(scale.as_dvec3(), rotation.as_dquat().normalize(), DVec3::ZERO);
        // The middle of the mesh stays in place, whatever rounding does to the axes.
        let shift = exact.transform_point3(middle) - turned.transform_point3(middle) - center;
        let translation = shift.as_vec3();
        let stored = DAffine3 { translation: translation.as_dvec3() + center, ..turned };
        // The distance between two affine images of a point is convex, so over a box it is largest at a corner.
        let moved = |corner: DVec3| exact.transform_point3(corner).distance(stored.transform_point3(corner));
        // NaN, caused by overflow, counts as the largest.
        let error = corners(bounds).map(moved).into_iter().fold(0.0, |most: f64, e| if e <= most { most } else { e })
            + stored_error * most_stretch(&placement.transform);
        let copy =
            Copy { translation: translation.to_array(), rotation: rotation.to_array(), scale: scale.to_array(), error };
        error.is_finite().then_some(copy)
    }
}

fn corners(of: &Bounds) -> [DVec3; 8] {
    std::array::from_fn(|i| DVec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), of.min, of.max))
}

/// Accessors of copies' attributes: equal lists are stored once, such as those of all pieces of an opened mesh.
#[derive(Default)]
struct Accessors(BTreeMap<(Element, Vec<u8>), usize>);

impl Accessors {
    /// Returns an accessor of vectors of floats.
    fn floats(&mut self, document: &mut Document, components: usize, data: Vec<u8>) -> usize {
        self.of(document, Element { component: Component::F32, components, normalized: false }, data)
    }

    fn of(&mut self, document: &mut Document, element: Element, data: Vec<u8>) -> usize {
        let new = NewAccessor { data: data.clone(), element, target: Target::Other, bounds: false };
        *self.0.entry((element, data)).or_insert_with(|| document.add_accessor(new))
    }
}

fn bytes<const N: usize>(copies: &[Copy], of: impl Fn(&Copy) -> [f32; N]) -> Vec<u8> {
    copies.iter().flat_map(of).flat_map(f32::to_le_bytes).collect()
}
