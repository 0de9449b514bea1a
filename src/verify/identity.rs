//! Maps each triangle of the output to its triangle of the input.

use std::ops::Range;

use raykiln_formats::record::{Placed, Record};
use rayon::prelude::*;

use crate::scene::{Geometry, InstanceId, Mesh, Scene, TriangleRef};

/// Maps the placed triangles of a file (`after`) to those of the file it was made from (`before`).
///
/// The record of `after` says where each of its triangles comes from in the file that it names. If that is `before`, the
/// record is followed. If `before` has a record that leads to the same file, both are followed, and triangles of both that
/// come from one are the same. Otherwise every triangle represents itself: same node, copy, mesh, primitive and triangle.
pub struct Identity<'a> {
    before: &'a Scene,
    after: &'a Scene,
    /// Instances of `before` by node and copy, sorted.
    placed: Vec<(u32, u32, u32)>,
    way: Way<'a>,
}

/// What leads from a triangle of the output to one of the input.
enum Way<'a> {
    /// Its own numbers.
    Own,
    /// The record of the output.
    Recorded(&'a Record),
    /// The records of both: the triangles of `before` by those of the first input, sorted.
    Common { after: &'a Record, before: Vec<(First, TriangleRef)> },
}

/// A triangle of the first input: node, copy, mesh, primitive, number.
type First = [u32; 5];

/// How the output's record is related to the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// There is no record that can be used.
    NoRecord,
    /// It is a record of another input.
    OtherInput,
    /// It leads to the input, or the input was made from what it leads to.
    Leads,
}

/// Returns how the record of `after` is related to `before`.
pub fn relation(before: &Scene, after: &Scene) -> Relation {
    let Some(record) = after.provenance.record() else { return Relation::NoRecord };
    let of_before = before.provenance.record().is_some_and(|first| first.input == record.input);
    if record.input == before.geometry || of_before { Relation::Leads } else { Relation::OtherInput }
}

impl<'a> Identity<'a> {
    /// Prepares to look up the triangles of `after`.
    pub fn new(before: &'a Scene, after: &'a Scene) -> Self {
        let mut placed: Vec<_> = (0u32..).zip(&before.instances).map(|(i, at)| (at.node, at.copy, i)).collect();
        placed.sort_unstable();
        let way = match (relation(before, after), after.provenance.record()) {
            (Relation::Leads, Some(record)) if record.input == before.geometry => Way::Recorded(record),
            (Relation::Leads, Some(record)) => Way::Common { after: record, before: by_first(before) },
            _ => Way::Own,
        };
        Identity { before, after, placed, way }
    }

    /// Returns the scenes: `before` and `after`.
    pub fn scenes(&self) -> (&'a Scene, &'a Scene) {
        (self.before, self.after)
    }

    /// Returns the triangle of `before` that a placed triangle of `after` represents.
    pub fn source(&self, at: TriangleRef) -> Option<TriangleRef> {
        let mesh = self.after.mesh_of(InstanceId(at.instance));
        let (geometry, triangle) = mesh.locate(at.triangle);
        self.sources(at.instance, geometry, triangle..triangle + 1).next().flatten()
    }

    /// Returns the triangles of `before` for a range of triangles of a geometry of `after`, as placed by an instance.
    pub fn sources(
        &self,
        instance: u32,
        geometry: usize,
        triangles: Range<usize>,
    ) -> impl Iterator<Item = Option<TriangleRef>> + '_ {
        let placing = &self.after.instances[instance as usize];
        let mesh = &self.after.meshes[placing.mesh.0 as usize];
        let of = &mesh.geometries[geometry];
        let recorded = match &self.way {
            Way::Own => None,
            Way::Recorded(record) | Way::Common { after: record, .. } => Some(*record),
        };
        let origins = recorded.and_then(|record| record.origins(placing.node, placing.copy, of.primitive));
        // Consecutive triangles usually share their source, so the last one is kept.
        let mut last = ([u32::MAX; 4], None);
        triangles.map(move |triangle| {
            let in_file = number_in_file(of, triangle);
            let first = match (recorded, origins) {
                (None, _) => [placing.node, placing.copy, mesh.source, of.primitive, in_file],
                (Some(_), origins) => first(origins?, in_file)?,
            };
            if let Way::Common { before, .. } = &self.way {
                return before.binary_search_by_key(&first, |(first, _)| *first).ok().map(|at| before[at].1);
            }
            let [node, copy, mesh, primitive, number] = first;
            let source = [node, copy, mesh, primitive];
            if last.0 != source {
                last = (source, self.piece(source));
            }
            last.1.as_ref()?.triangle(number)
        })
    }

    /// Returns the number of placed triangles of `after` that represent triangles of `before`.
    pub fn known(&self) -> u64 {
        let of_chunk = |c: &Chunk| self.sources(c.instance, c.geometry, c.triangles.clone()).flatten().count() as u64;
        chunks(self.after).par_iter().map(of_chunk).sum()
    }

    /// Returns a primitive of `before` as placed by a copy of a node.
    fn piece(&self, [node, copy, mesh, primitive]: [u32; 4]) -> Option<Piece<'a>> {
        let at = self.placed.binary_search_by_key(&(node, copy), |&(node, copy, _)| (node, copy)).ok()?;
        let instance = self.placed[at].2;
        let of = self.before.mesh_of(InstanceId(instance));
        let geometry = of.geometries.binary_search_by_key(&primitive, |g| g.primitive).ok()?;
        (of.source == mesh).then_some(Piece { instance, geometry: &of.geometries[geometry] })
    }
}

/// A primitive of `before` as placed by an instance.
#[derive(Clone, Copy)]
struct Piece<'a> {
    instance: u32,
    geometry: &'a Geometry,
}

impl Piece<'_> {
    /// Returns a triangle by its index in the file's primitive.
    fn triangle(&self, in_file: u32) -> Option<TriangleRef> {
        let triangle = match &self.geometry.kept {
            Some(kept) => kept.binary_search(&in_file).ok()? as u32,
            None => in_file,
        };
        let is_there = (triangle as usize) < self.geometry.triangles.len();
        is_there.then(|| TriangleRef { instance: self.instance, triangle: self.geometry.first_triangle + triangle })
    }
}

fn number_in_file(geometry: &Geometry, triangle: usize) -> u32 {
    geometry.kept.as_ref().map_or(triangle as u32, |kept| kept[triangle])
}

/// Returns the triangle of the first input that a triangle of a primitive comes from.
fn first((placed, origins): (&Placed, &raykiln_formats::record::Origins), in_file: u32) -> Option<First> {
    let (source, number) = origins.of(in_file)?;
    let (node, copy) = source.node.map(|node| (node, source.copy)).or(placed.input)?;
    Some([node, copy, source.mesh, source.primitive, number])
}

/// Returns the triangles of a scene by those of the first input that its record leads to, sorted.
fn by_first(scene: &Scene) -> Vec<(First, TriangleRef)> {
    let Some(record) = scene.provenance.record() else { return Vec::new() };
    let of_chunk = |chunk: &Chunk| {
        let placing = &scene.instances[chunk.instance as usize];
        let mesh: &Mesh = &scene.meshes[placing.mesh.0 as usize];
        let geometry = &mesh.geometries[chunk.geometry];
        let origins = record.origins(placing.node, placing.copy, geometry.primitive);
        let numbers = chunk.triangles.clone().map(|triangle| number_in_file(geometry, triangle));
        let refs = chunk.refs(scene);
        numbers.zip(refs).filter_map(|(number, at)| Some((first(origins?, number)?, at))).collect::<Vec<_>>()
    };
    let mut all: Vec<(First, TriangleRef)> = chunks(scene).par_iter().flat_map_iter(of_chunk).collect();
    all.par_sort_unstable();
    all
}

/// A range of triangles of one geometry as placed by one instance.
pub(super) struct Chunk {
    pub(super) instance: u32,
    pub(super) geometry: usize,
    /// Indices within the geometry.
    pub(super) triangles: Range<usize>,
}

impl Chunk {
    /// Returns the chunk's triangles, as referred to in the scene.
    pub(super) fn refs(&self, scene: &Scene) -> impl Iterator<Item = TriangleRef> + use<> {
        let instance = self.instance;
        let first = scene.mesh_of(InstanceId(instance)).geometries[self.geometry].first_triangle;
        self.triangles.clone().map(move |t| TriangleRef { instance, triangle: first + t as u32 })
    }
}

/// Number of triangles per chunk.
const CHUNK: usize = 1 << 14;

/// Returns all placed triangles of a scene, in order, in chunks for parallel work.
pub(super) fn chunks(scene: &Scene) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    for (instance, placing) in scene.instances.iter().enumerate() {
        for (geometry, of) in scene.meshes[placing.mesh.0 as usize].geometries.iter().enumerate() {
            let count = of.triangles.len();
            chunks.extend((0..count).step_by(CHUNK).map(|start| Chunk {
                instance: instance as u32,
                geometry,
                triangles: start..count.min(start + CHUNK),
            }));
        }
    }
    chunks
}

/// Describes a placed triangle.
pub(super) fn describe(scene: &Scene, at: TriangleRef) -> String {
    let instance = &scene.instances[at.instance as usize];
    let mesh = scene.mesh_of(InstanceId(at.instance));
    let (geometry, triangle) = mesh.locate(at.triangle);
    let geometry = &mesh.geometries[geometry];
    let in_file = geometry.kept.as_ref().map_or(triangle as u32, |kept| kept[triangle]);
    let copy = if instance.copy > 0 { format!(" (copy {})", instance.copy) } else { String::new() };
    format!(
        "triangle {in_file} of primitive {} of mesh {} `{}` at node {} `{}`{copy}",
        geometry.primitive, mesh.source, mesh.name, instance.node, instance.name
    )
}
