//! Maps each triangle of the output to its triangle of the input.

use std::ops::Range;

use raykiln_formats::contents::{Provenance, Source};

use crate::scene::{CopyOf, Geometry, Instance, InstanceId, Scene, TriangleRef};

/// Maps the placed triangles of a file (`after`) to those of the file it was made from (`before`).
///
/// The provenance of a geometry determines its sources; a geometry without provenance represents itself: same node,
/// copy, mesh, primitive and triangle. An instance that places a copy names the copied mesh, and the copy's triangles
/// map to that mesh's. Invalid provenance maps to nothing. A file whose provenance all equals its input's is the input:
/// its provenance refers to another, earlier file, and every triangle represents itself.
pub struct Identity<'a> {
    before: &'a Scene,
    after: &'a Scene,
    /// Instances of `before` by node and copy, sorted.
    placed: Vec<(u32, u32, u32)>,
    /// Meshes of `before` by their index in its file, sorted.
    meshes: Vec<(u32, u32)>,
    /// The first triangle of every run, for each mesh of `after` and each of its geometries.
    starts: Vec<Vec<Vec<u64>>>,
    unchanged: bool,
}

/// A primitive of `before` as placed by an instance.
#[derive(Clone, Copy)]
struct Piece<'a> {
    instance: u32,
    geometry: &'a Geometry,
    /// The mesh that the instance copies, if the geometry is part of a copy, and its number of triangles.
    copy: Option<(&'a CopyOf, u32)>,
}

impl<'a> Identity<'a> {
    /// Prepares to look up the triangles of `after`.
    pub fn new(before: &'a Scene, after: &'a Scene) -> Self {
        let mut placed: Vec<_> = (0u32..).zip(&before.instances).map(|(i, at)| (at.node, at.copy, i)).collect();
        placed.sort_unstable();
        let mut meshes: Vec<_> = (0u32..).zip(before.meshes.iter()).map(|(i, mesh)| (mesh.source, i)).collect();
        meshes.sort_unstable();
        let starts = after.meshes.iter().map(|m| m.geometries.iter().map(run_starts).collect()).collect();
        Identity { before, after, placed, meshes, starts, unchanged: is_unchanged(before, after) }
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
        let of = &self.after.meshes[placing.mesh.0 as usize].geometries[geometry];
        let starts = &self.starts[placing.mesh.0 as usize][geometry];
        let whole = self.whole(placing, of);
        // Consecutive triangles usually share their run and its source, so the last ones are kept.
        let (mut run, mut from) = (0, (u32::MAX, None));
        triangles.map(move |triangle| {
            let in_file = of.kept.as_ref().map_or(triangle as u32, |kept| kept[triangle]);
            let Some(Provenance::Runs { sources, runs }) = of.provenance.as_ref().filter(|_| !self.unchanged) else {
                return whole?.triangle(in_file);
            };
            run = run_of(starts, u64::from(in_file), run)?;
            let &[source, first, _] = runs.get(run)?;
            if from.0 != source {
                from = (source, self.run_source(placing, sources.get(source as usize)?));
            }
            from.1?.triangle(u32::try_from(u64::from(first) + u64::from(in_file) - starts[run]).ok()?)
        })
    }

    /// Returns the number of placed triangles of `after` that represent triangles of `before`.
    pub fn known(&self) -> u64 {
        use rayon::prelude::*;
        let of_chunk = |c: &Chunk| self.sources(c.instance, c.geometry, c.triangles.clone()).flatten().count() as u64;
        chunks(self.after).par_iter().map(of_chunk).sum()
    }

    /// Returns the primitive of `before` that a geometry without runs represents.
    fn whole(&self, placing: &'a Instance, of: &Geometry) -> Option<Piece<'a>> {
        let own = (self.after.meshes[placing.mesh.0 as usize].source, of.primitive);
        let (mesh, primitive) = match of.provenance {
            Some(Provenance::Same { mesh, primitive }) if !self.unchanged => (mesh, primitive),
            _ => own,
        };
        self.placed_piece(placing, mesh, primitive)
    }

    /// Returns the primitive of `before` that the runs of a source come from.
    fn run_source(&self, placing: &'a Instance, source: &Source) -> Option<Piece<'a>> {
        match source.node {
            Some(node) => self.piece(node, source.copy, source.mesh, source.primitive),
            None => self.placed_piece(placing, source.mesh, source.primitive),
        }
    }

    /// Returns a primitive of `before` as placed by an instance of `after`, or by a copy of it.
    fn placed_piece(&self, placing: &'a Instance, mesh: u32, primitive: u32) -> Option<Piece<'a>> {
        let (node, copy) = self.stands_for(placing);
        match placing.source_copy.as_ref().filter(|_| !self.unchanged) {
            Some(of) => self.copied_piece(node, copy, of, mesh, primitive),
            None => self.piece(node, copy, mesh, primitive),
        }
    }

    /// Returns a primitive of the mesh of `before` that a placed copy of another mesh was made from.
    fn copied_piece(&self, node: u32, copy: u32, of: &'a CopyOf, mesh: u32, primitive: u32) -> Option<Piece<'a>> {
        let instance = self.instance(node, copy)?;
        let placed = self.before.mesh_of(InstanceId(instance));
        let at = self.meshes.binary_search_by_key(&mesh, |&(source, _)| source).ok()?;
        let model = &self.before.meshes[self.meshes[at].1 as usize];
        let geometry = model.geometries.binary_search_by_key(&primitive, |g| g.primitive).ok()?;
        let copy = Some((of, placed.triangle_count() as u32));
        (placed.source == of.mesh).then_some(Piece { instance, geometry: &model.geometries[geometry], copy })
    }

    /// Returns the instance of `before` for a copy of a node.
    fn instance(&self, node: u32, copy: u32) -> Option<u32> {
        let at = self.placed.binary_search_by_key(&(node, copy), |&(node, copy, _)| (node, copy)).ok()?;
        Some(self.placed[at].2)
    }

    /// Returns the node of `before` that an instance of `after` represents, and the copy within it.
    fn stands_for(&self, placing: &Instance) -> (u32, u32) {
        if self.unchanged { (placing.node, placing.copy) } else { (placing.source_node, placing.source_index) }
    }

    fn piece(&self, node: u32, copy: u32, mesh: u32, primitive: u32) -> Option<Piece<'a>> {
        let instance = self.instance(node, copy)?;
        let of = self.before.mesh_of(InstanceId(instance));
        let geometry = of.geometries.binary_search_by_key(&primitive, |g| g.primitive).ok()?;
        (of.source == mesh).then_some(Piece { instance, geometry: &of.geometries[geometry], copy: None })
    }
}

impl Piece<'_> {
    /// Returns a triangle by its index in the file's primitive.
    fn triangle(&self, in_file: u32) -> Option<TriangleRef> {
        let triangle = match &self.geometry.kept {
            Some(kept) => kept.binary_search(&in_file).ok()? as u32,
            None => in_file,
        };
        if triangle as usize >= self.geometry.triangles.len() {
            return None;
        }
        let triangle = self.geometry.first_triangle + triangle;
        let triangle = match self.copy {
            None => triangle,
            Some((of, count)) => {
                of.order.as_ref().map_or(Some(triangle), |order| order.triangle(triangle)).filter(|&t| t < count)?
            }
        };
        Some(TriangleRef { instance: self.instance, triangle })
    }
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

/// Returns the first triangle of every run of a geometry, by index in its file.
fn run_starts(geometry: &Geometry) -> Vec<u64> {
    let Some(Provenance::Runs { runs, .. }) = &geometry.provenance else { return Vec::new() };
    let mut next = 0;
    let mut starts: Vec<u64> = Vec::with_capacity(runs.len() + 1);
    for [_, _, count] in runs {
        starts.push(next);
        next += u64::from(*count);
    }
    starts.push(next);
    starts
}

/// Returns the run that contains a triangle, trying first the run of the previous triangle.
fn run_of(starts: &[u64], in_file: u64, hint: usize) -> Option<usize> {
    let is_in = |run: usize| starts.get(run..run + 2).is_some_and(|s| (s[0]..s[1]).contains(&in_file));
    [hint, hint + 1]
        .into_iter()
        .find(|&run| is_in(run))
        .or_else(|| starts.partition_point(|&start| start <= in_file).checked_sub(1))
}

/// Whether two files place the same primitives with the same provenance.
fn is_unchanged(before: &Scene, after: &Scene) -> bool {
    let same_instances = before.instances.len() == after.instances.len()
        && before.instances.iter().zip(&after.instances).all(|(a, b)| {
            (a.node, a.source_node, a.copy, a.source_index, a.mesh, &a.source_copy)
                == (b.node, b.source_node, b.copy, b.source_index, b.mesh, &b.source_copy)
        });
    let same_geometry = |(a, b): (&Geometry, &Geometry)| a.primitive == b.primitive && a.provenance == b.provenance;
    same_instances
        && before.meshes.len() == after.meshes.len()
        && before.meshes.iter().zip(after.meshes.iter()).all(|(a, b)| {
            a.source == b.source
                && a.geometries.len() == b.geometries.len()
                && a.geometries.iter().zip(&b.geometries).all(same_geometry)
        })
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
