//! Meshes that are copies of others: finds them, and makes them instances of these.
//!
//! Exporters often write out repeated objects with the transform baked into the vertices, so that what is really one
//! mesh is stored and built many times. A mesh is a *copy* of another, its *model*, if it has the same triangles up to
//! the order of triangles and vertices, after a *motion*: a rotation, a translation, a uniform scale and possibly a
//! mirroring. The following must agree: the material, vertex format, extensions and extras of each triangle's
//! primitive; which side is the front; each vertex attribute, bit by bit; normals and tangents after the motion, bit by
//! bit if it does not rotate, else within [`TURNED`]; positions within [`Options::max_position_error_ratio`].
//!
//! Helps if an exporter flattened its scene; otherwise the signatures differ and nothing more is examined.
//!
//! Near-linear: meshes are sorted by a signature that no motion changes ([`signature`]), and only those within its
//! error bars of a model are aligned with it ([`align`]). If very many meshes differ by little more than the tolerance,
//! comparing signatures takes longer. A mesh that resembles [`MOST_ATTEMPTS`] models without being a copy of any is
//! then tested only for exact copies.

mod align;
mod anchors;
mod fit;
mod grid;
mod shape;
mod sharing;
mod signature;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DAffine3;
use raykiln_formats::Document;
use rayon::prelude::*;

use crate::cost::bytes;
use crate::layout::seams;
use crate::parallel;
use crate::scene::{Instance, MeshId, Overlay, Scene, StandIn, TriangleOrder};
use align::Alignment;
use shape::Shape;
pub use sharing::{Count, Looser, Saved, Sharing};
use signature::Signature;

/// Maximum difference between the components of a rotated normal or tangent, of unit length, and the copy's: text
/// formats often store only four digits. Components stored as integers may differ by two more steps.
pub const TURNED: f64 = 5e-4;

/// Number of models that a mesh is aligned with in vain before it counts as a model itself.
pub const MOST_ATTEMPTS: u32 = 16;

/// Share of the input's predicted bytes of acceleration structures that sharing copies must save to be worth it.
pub const LEAST_SAVED_RATIO: f64 = 0.05;

/// Bytes that `auto` must save besides: what devices allocate at least at a time (rule RK009 of `inspect`).
pub const LEAST_SAVED_BYTES: u64 = 64 << 10;

/// Whether the materials of a copy matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Materials {
    /// They must be those of its model.
    #[default]
    Same,
    /// They may differ, with the properties of the primitive: the meshes have the same shape. Such copies cannot stand in
    /// for each other.
    Any,
}

/// Which copies to search for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Likeness {
    /// Those with the same coordinates; triangles and vertices may be in a different order.
    Exact,
    /// Also rotated, translated, uniformly scaled or mirrored ones.
    #[default]
    Rigid,
}

/// Options of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Which copies to search for.
    pub likeness: Likeness,
    /// Whether materials matter.
    pub materials: Materials,
    /// How far a vertex may move, relative to the diagonal of the scene. Never more than a ten-thousandth of the mesh's
    /// own size or, if coordinates are so large that single precision is coarser, than this ratio of them, up to a
    /// hundredth of its size.
    pub max_position_error_ratio: f64,
    /// Predicted bytes of BLASes that copies must be able to save for a search to start; 0 to always search.
    pub least_saved_bytes: u64,
}

/// A mesh that is a copy of another.
#[derive(Clone, Debug)]
pub struct CopiedMesh {
    /// The copy.
    pub mesh: MeshId,
    /// Its model, which is not itself a copy.
    pub model: MeshId,
    /// Copy from model; each coefficient is exactly a 32-bit float.
    pub motion: DAffine3,
    /// For each triangle of the model, that of the copy; `None` if both have the same order.
    pub order: Option<Arc<TriangleOrder>>,
}

impl CopiedMesh {
    /// Whether boxes around the model are as tight as those around the copy: the motion rotates by quarter turns, or
    /// not at all.
    pub fn keeps_boxes(&self) -> bool {
        let columns = self.motion.matrix3.to_cols_array_2d();
        columns.iter().all(|column| column.iter().filter(|c| **c != 0.0).count() <= 1)
    }
}

/// The copies of a scene, in the order of its meshes.
#[derive(Clone, Debug, Default)]
pub struct Copies {
    /// Each mesh occurs at most once.
    pub list: Vec<CopiedMesh>,
    /// Predicted bytes of BLASes that all possible copies could save, if that is too little to start the search.
    pub most_saved_bytes: Option<u64>,
}

impl Copies {
    /// Returns an overlay in which the models stand in for their copies wherever `scene` places these.
    pub fn overlay(&self, scene: &Scene) -> Overlay {
        if self.list.is_empty() {
            return Overlay::default();
        }
        let mut of_mesh: Vec<Option<&CopiedMesh>> = vec![None; scene.meshes.len()];
        self.list.iter().for_each(|copy| of_mesh[copy.mesh.0 as usize] = Some(copy));
        let stand_in = |instance: &Instance| {
            let CopiedMesh { mesh, model, motion, ref order } = *of_mesh[instance.mesh.0 as usize]?;
            Some(StandIn { model, copy: mesh, motion, transform: instance.transform, order: order.clone() })
        };
        Overlay::of_stand_ins(scene.instances.iter().map(stand_in).collect())
    }
}

/// Finds the meshes that are copies of others. Meshes placed by a pinned instance are models, never copies; those with
/// points, lines, morph targets or dropped triangles are neither. The model of a class is the mesh nearest to its
/// origin, which is stored most precisely; the first in the file wins ties.
pub fn find(doc: &Document, scene: &Scene, options: &Options) -> Copies {
    find_as(doc, scene, &roles(doc, scene), options)
}

/// Finds exact copies among the meshes in `left_out`, which were found to be copies but are not shared, and their
/// models, which stay models.
pub fn find_exact_among(
    doc: &Document,
    scene: &Scene,
    left_out: &[CopiedMesh],
    max_position_error_ratio: f64,
) -> Copies {
    let mut narrowed = vec![Role::None; scene.meshes.len()];
    left_out.iter().for_each(|copy| narrowed[copy.model.0 as usize] = Role::Model);
    let roles = roles(doc, scene);
    left_out.iter().map(|copy| copy.mesh.0 as usize).for_each(|mesh| narrowed[mesh] = roles[mesh]);
    let materials = Materials::Same;
    let options = Options { likeness: Likeness::Exact, materials, max_position_error_ratio, least_saved_bytes: 0 };
    find_as(doc, scene, &narrowed, &options)
}

fn find_as(doc: &Document, scene: &Scene, roles: &[Role], options: &Options) -> Copies {
    let too_few = |most: u64| (most < options.least_saved_bytes).then_some(most);
    let none = |most_saved_bytes| Copies { list: Vec::new(), most_saved_bytes };
    let alike = alike(scene, roles, options.materials);
    if let most @ Some(_) = too_few(alike.iter().map(|meshes| most_saved(scene, meshes)).sum()) {
        return none(most);
    }
    let candidates: Vec<MeshId> = alike.into_iter().flatten().collect();
    let signatures = signature::of_all(doc, scene, &candidates, options);
    let groups: BTreeMap<u64, Vec<Signature>> = by_key(signatures);
    if let most @ Some(_) = too_few(groups.par_iter().map(|(_, group)| most_saved(scene, &resembling(group))).sum()) {
        return none(most);
    }
    let connected = if options.likeness == Likeness::Rigid { connected(scene) } else { vec![false; roles.len()] };
    let search = Search { doc, scene, options, roles, connected };
    let found: Vec<Found> = groups.into_par_iter().map(|(_, group)| search.group(group)).collect();
    let given_up = found.iter().any(|found| found.given_up);
    let mut list: Vec<CopiedMesh> = found.into_iter().flat_map(|found| found.copies).collect();
    if given_up && options.likeness == Likeness::Rigid {
        let exact = exact_among_the_rest(doc, scene, roles, &list, options);
        list.extend(exact);
    }
    list.sort_unstable_by_key(|c| c.mesh);
    Copies { list, most_saved_bytes: None }
}

/// Finds the exact copies among the meshes that are not yet copies: if many resemble each other, not all were compared.
fn exact_among_the_rest(
    doc: &Document,
    scene: &Scene,
    roles: &[Role],
    list: &[CopiedMesh],
    options: &Options,
) -> Vec<CopiedMesh> {
    let mut rest = roles.to_vec();
    for copy in list {
        rest[copy.mesh.0 as usize] = Role::None;
        rest[copy.model.0 as usize] = Role::Model;
    }
    let options = Options { likeness: Likeness::Exact, least_saved_bytes: 0, ..*options };
    find_as(doc, scene, &rest, &options).list
}

/// The roles that a mesh may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// Neither copy nor model.
    None,
    /// A model only.
    Model,
    /// A copy if the motion is the identity, else a model: copies by `EXT_mesh_gpu_instancing` are placed in mesh
    /// coordinates.
    InPlace,
    /// Either.
    Any,
}

fn roles(doc: &Document, scene: &Scene) -> Vec<Role> {
    let mut roles: Vec<Role> = scene
        .meshes
        .iter()
        .map(|mesh| {
            let source = mesh.source as usize;
            let whole = doc.primitive_count(source) == mesh.geometries.len() && !doc.is_morphed(source);
            if whole && !mesh.dropped { Role::Any } else { Role::None }
        })
        .collect();
    for instance in &scene.instances {
        let role = &mut roles[instance.mesh.0 as usize];
        *role = match *role {
            Role::None => Role::None,
            _ if instance.pinned.is_some() => Role::Model,
            Role::Any if scene.is_copied(instance.node) => Role::InPlace,
            role => role,
        };
    }
    roles
}

/// Returns for each mesh whether an instance of it shares corners with a neighbour: turned or moved, it would part from it.
fn connected(scene: &Scene) -> Vec<bool> {
    let mut connected = vec![false; scene.meshes.len()];
    for (instance, touches) in scene.instances.iter().zip(seams::touching(scene)) {
        connected[instance.mesh.0 as usize] |= touches;
    }
    connected
}

/// Groups meshes with equal numbers of triangles of each material and kind; omits groups of one.
fn alike(scene: &Scene, roles: &[Role], materials: Materials) -> Vec<Vec<MeshId>> {
    let mut counts: BTreeMap<u64, Vec<MeshId>> = BTreeMap::new();
    for (i, mesh) in (0u32..).zip(scene.meshes.iter()).filter(|(i, _)| roles[*i as usize] != Role::None) {
        counts.entry(signature::coarse_key(mesh, materials)).or_default().push(MeshId(i));
    }
    counts.into_values().filter(|meshes| meshes.len() > 1).collect()
}

/// Predicts the bytes of BLASes saved if one of some meshes with equal triangle counts stands in for all others.
fn most_saved(scene: &Scene, meshes: &[MeshId]) -> u64 {
    let bytes = |mesh: &MeshId| bytes::blas(scene.meshes[mesh.0 as usize].triangle_count() as u64);
    meshes.iter().skip(1).map(bytes).fold(0, u64::saturating_add)
}

/// Returns the meshes whose signatures resemble that of another.
fn resembling(group: &[Signature]) -> Vec<MeshId> {
    let buckets = signature::Buckets::new(group);
    let mut resembles = vec![false; group.len()];
    for at in 0..group.len() {
        if !resembles[at] {
            let are_alike = |a: usize, b: usize| group[a].resembles(&group[b]) || group[b].resembles(&group[a]);
            let near = buckets.near(&group[at], |other| other != at && are_alike(at, other));
            resembles[at] = !near.is_empty();
            near.into_iter().for_each(|other| resembles[other] = true);
        }
    }
    group.iter().zip(resembles).filter(|(_, resembles)| *resembles).map(|(signature, _)| signature.mesh).collect()
}

fn by_key(signatures: Vec<Signature>) -> BTreeMap<u64, Vec<Signature>> {
    let mut groups: BTreeMap<u64, Vec<Signature>> = BTreeMap::new();
    signatures.into_iter().for_each(|s| groups.entry(s.key).or_default().push(s));
    groups
}

/// The result for a group.
struct Found {
    copies: Vec<CopiedMesh>,
    /// Whether a mesh resembles more models than it was compared with.
    given_up: bool,
}

struct Search<'a> {
    doc: &'a Document,
    scene: &'a Scene,
    options: &'a Options,
    roles: &'a [Role],
    /// See [`connected`]; not known unless meshes may move.
    connected: Vec<bool>,
}

impl Search<'_> {
    /// Returns the copies among meshes whose signatures have the same key.
    fn group(&self, mut group: Vec<Signature>) -> Found {
        group.sort_by(|a, b| {
            // Reaches that differ little are stored alike: the first in the file is the model.
            let preference = |s: &Signature| (self.roles[s.mesh.0 as usize] != Role::Model, s.reach.log2().floor());
            let (a_key, b_key) = (preference(a), preference(b));
            a_key.0.cmp(&b_key.0).then(a_key.1.total_cmp(&b_key.1)).then(a.mesh.cmp(&b.mesh))
        });
        let buckets = signature::Buckets::new(&group);
        let mut is_copy = vec![false; group.len()];
        let mut attempts = vec![0; group.len()];
        let mut copies = Vec::new();
        for at in 0..group.len() {
            if is_copy[at] {
                continue;
            }
            let wanted = |other: usize| {
                let free = other > at && !is_copy[other] && attempts[other] < MOST_ATTEMPTS;
                free && self.may_be_copy(&group[at], &group[other])
            };
            let alike = buckets.near(&group[at], wanted);
            if alike.is_empty() {
                continue;
            }
            let model = Shape::new(self.doc, self.scene, group[at].mesh, self.options.materials);
            let distances = model.distances();
            let found: Vec<Option<CopiedMesh>> =
                parallel::map_each(&alike, &|&other| self.copy((&model, &distances), &group[at], &group[other]));
            for (&other, found) in alike.iter().zip(found) {
                is_copy[other] = found.is_some();
                attempts[other] += 1;
                copies.extend(found);
            }
        }
        let given_up = attempts.iter().zip(is_copy).any(|(&attempts, is_copy)| attempts >= MOST_ATTEMPTS && !is_copy);
        Found { copies, given_up }
    }

    fn may_be_copy(&self, model: &Signature, other: &Signature) -> bool {
        self.roles[other.mesh.0 as usize] != Role::Model && model.resembles(other)
    }

    fn copy(&self, (model, distances): (&Shape, &[f64]), of: &Signature, other: &Signature) -> Option<CopiedMesh> {
        let shape = Shape::new(self.doc, self.scene, other.mesh, self.options.materials);
        let at = other.mesh.0 as usize;
        let may_move = self.roles[at] == Role::Any && !self.connected[at];
        let moves = self.options.likeness == Likeness::Rigid && may_move;
        let Alignment { motion, triangles } = align::align(model, distances, &shape, other.tolerance, moves)?;
        let order = TriangleOrder::of(&triangles).map(Arc::new);
        Some(CopiedMesh { mesh: other.mesh, model: of.mesh, motion, order })
    }
}
