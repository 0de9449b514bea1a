//! Loads a [`Scene`] from a document.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DAffine3, DMat3, Vec3};
use globset::{Glob, GlobSet, GlobSetBuilder};
use raykiln_formats::contents::{self, Contents};
use raykiln_formats::{Document, Error, ObjOptions, ReadOptions, Warning};

use super::alpha;
use super::{Geometry, Instance, Known, Mesh, MeshId, Pinned, PlacedCamera, Scene};

/// How to read a scene.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LoadOptions {
    /// Reject non-finite positions and damaged faces, which are otherwise dropped with a warning.
    pub strict: bool,
    /// Glob patterns of node and mesh names: matching nodes, and all nodes below them, are pinned.
    pub keep: Vec<String>,
    /// How an OBJ file is read.
    pub obj: ObjOptions,
}

impl LoadOptions {
    /// Options for reading the document.
    pub fn reading(&self) -> ObjOptions {
        self.obj.clone().with_strict(self.strict || self.obj.strict)
    }
}

/// Loads what a ray tracer sees of the document's default scene. Also returns warnings about patterns that match
/// nothing and about skipped content.
///
/// # Errors
/// Any error of [`Document::contents`]; an invalid glob pattern; a transform that overflows; a scene without triangles.
pub fn load(doc: &Document, options: &LoadOptions) -> Result<(Scene, Vec<Warning>), Error> {
    let keep = patterns(&options.keep).map_err(|e| Error::whole(&doc.path, format!("--keep: {e}")))?;
    let mut contents = doc.contents(ReadOptions::default().with_strict(options.strict))?;
    let shown = walk(&contents, &keep);
    let mut warnings = unmatched(&contents, &shown, &options.keep, &keep);
    warnings.append(&mut contents.warnings);
    let (meshes, mesh_ids) = meshes(&mut contents, &shown);
    let mut scene = Scene {
        instances: instances(doc, &contents, &shown, &meshes, &mesh_ids)?,
        cameras: cameras(&contents, &shown),
        nodes: contents.nodes.len(),
        provenance: contents.provenance,
        geometry: contents.geometry,
        copied_nodes: (0u32..).zip(&contents.nodes).filter(|(_, n)| n.copies.is_some()).map(|(i, _)| i).collect(),
        materials: contents.materials,
        images: Vec::new(),
        meshes: meshes.into(),
        stand_ins: Arc::default(),
        boxes: Known::default(),
        core: Known::default(),
    };
    pin_whole_nodes(&mut scene.instances);
    alpha::attach(doc, &mut scene);
    if scene.instances.is_empty() {
        return Err(Error::whole(&doc.path, "the default scene holds no triangles"));
    }
    Ok((scene, warnings))
}

fn patterns(globs: &[String]) -> Result<GlobSet, globset::Error> {
    let mut set = GlobSetBuilder::new();
    for glob in globs {
        set.add(Glob::new(glob)?);
    }
    set.build()
}

/// Returns a warning for each pattern that matches nothing and so protects nothing.
fn unmatched(contents: &Contents, shown: &[Shown], globs: &[String], keep: &GlobSet) -> Vec<Warning> {
    let mut matched = vec![false; globs.len()];
    for node in shown.iter().map(|s| &contents.nodes[s.node]).filter(|_| !globs.is_empty()) {
        let mesh = node.mesh.map(|m| &contents.meshes[m]);
        for name in [node.name.as_deref(), mesh.and_then(|m| m.name.as_deref())].into_iter().flatten() {
            keep.matches(name).into_iter().for_each(|glob| matched[glob] = true);
        }
    }
    let unmatched = globs.iter().zip(matched).filter(|(_, matched)| !matched);
    let message = |glob| format!("`{glob}` matches no node and no mesh of the default scene: it protects nothing");
    unmatched.map(|(glob, _)| Warning { place: "--keep".into(), message: message(glob) }).collect()
}

/// A node of the default scene.
struct Shown {
    node: usize,
    /// World from node.
    transform: DAffine3,
    /// Why the node is pinned, by itself or through an ancestor.
    pinned: Option<Pinned>,
}

/// Returns the nodes that the default scene shows, in depth-first order, children in file order.
fn walk(contents: &Contents, keep: &GlobSet) -> Vec<Shown> {
    let mut shown = Vec::with_capacity(contents.nodes.len());
    let mut stack: Vec<(usize, DAffine3, Option<Pinned>)> =
        contents.roots.iter().rev().map(|&root| (root, DAffine3::IDENTITY, None)).collect();
    while let Some((at, parent, inherited)) = stack.pop() {
        let node = &contents.nodes[at];
        if node.hidden {
            continue;
        }
        let transform = parent * node.local;
        let pinned = inherited.or_else(|| node_pin(contents, node, keep));
        stack.extend(node.children.iter().rev().map(|&child| (child, transform, pinned)));
        shown.push(Shown { node: at, transform, pinned });
    }
    shown
}

/// Returns why a node and all nodes below it are pinned.
fn node_pin(contents: &Contents, node: &contents::Node, keep: &GlobSet) -> Option<Pinned> {
    let mesh_name = node.mesh.and_then(|m| contents.meshes[m].name.as_deref());
    let matches = |name: Option<&str>| name.is_some_and(|n| keep.is_match(n));
    if matches(node.name.as_deref()) || matches(mesh_name) {
        Some(Pinned::Protected)
    } else if node.animated {
        Some(Pinned::Animated)
    } else {
        node.hold.map(Pinned::Held)
    }
}

/// Returns why a node alone is pinned.
fn instance_pin(contents: &Contents, node: &contents::Node, mesh: usize) -> Option<Pinned> {
    if node.skin.is_some() {
        Some(Pinned::Skinned)
    } else if contents.meshes[mesh].primitives.iter().any(|p| p.morphed) {
        Some(Pinned::Morphed)
    } else if node.in_other_scene {
        Some(Pinned::OtherScene)
    } else {
        contents.meshes[mesh].hold.map(Pinned::Held)
    }
}

/// Returns the meshes that the shown nodes place, in file order, and for each mesh of the document its index among
/// them.
fn meshes(contents: &mut Contents, shown: &[Shown]) -> (Vec<Mesh>, Vec<Option<MeshId>>) {
    let mut placed = vec![false; contents.meshes.len()];
    for s in shown {
        if let Some(mesh) = contents.nodes[s.node].mesh {
            placed[mesh] = true;
        }
    }
    let mut classes = HashMap::new();
    let mut meshes = Vec::new();
    let mut ids = vec![None; contents.meshes.len()];
    for (source, mesh) in contents.meshes.iter_mut().enumerate().filter(|(source, _)| placed[*source]) {
        let loaded = load_mesh(source as u32, mesh, &contents.materials, &mut classes);
        if !loaded.geometries.is_empty() {
            ids[source] = Some(MeshId(meshes.len() as u32));
            meshes.push(loaded);
        }
    }
    (meshes, ids)
}

fn load_mesh(
    source: u32,
    mesh: &mut contents::Mesh,
    materials: &[contents::Material],
    classes: &mut HashMap<String, u32>,
) -> Mesh {
    let mut loaded = Mesh { name: mesh.name.clone().unwrap_or_default(), source, ..Mesh::default() };
    let mut first_triangle = 0;
    for (primitive, p) in mesh.primitives.iter_mut().enumerate() {
        let Some(triangles) = p.triangles.take() else { continue };
        loaded.dropped |= triangles.kept.is_some();
        if triangles.corners.is_empty() {
            continue;
        }
        let next_class = classes.len() as u32;
        let count = triangles.corners.len() as u32;
        loaded.geometries.push(Geometry {
            primitive: primitive as u32,
            material: p.material.map(|m| m as u32),
            opacity: p.material.map(|m| materials[m].opacity).unwrap_or_default(),
            alpha: None,
            merge_class: *classes.entry(std::mem::take(&mut p.merge_key)).or_insert(next_class),
            first_triangle,
            positions: bytemuck::allocation::cast_slice_arc::<[f32; 3], Vec3>(triangles.positions),
            residuals: triangles.residuals,
            triangles: triangles.corners,
            kept: triangles.kept,
        });
        first_triangle += count;
    }
    loaded
}

fn instances(
    doc: &Document,
    contents: &Contents,
    shown: &[Shown],
    meshes: &[Mesh],
    mesh_ids: &[Option<MeshId>],
) -> Result<Vec<Instance>, Error> {
    let mut instances = Vec::new();
    for s in shown {
        let node = &contents.nodes[s.node];
        let Some((source, mesh)) = node.mesh.and_then(|m| Some((m, mesh_ids[m]?))) else { continue };
        let name = node.name.as_ref().unwrap_or(&meshes[mesh.0 as usize].name);
        let in_mesh_units = contents.meshes[source].primitives.iter().any(|p| p.in_mesh_units);
        let alone = [DAffine3::IDENTITY];
        for (copy, local) in node.copies.as_deref().unwrap_or(&alone).iter().enumerate() {
            let transform = s.transform * *local;
            if !transform.is_finite() {
                let place = format!("nodes[{}]", s.node);
                return Err(Error::at(&doc.path, place, "the transform into the world overflows"));
            }
            let singular = is_singular(&transform).then_some(Pinned::Singular);
            let scaled = (in_mesh_units && !is_rigid(&transform)).then_some(Pinned::MeshUnits);
            instances.push(Instance {
                name: name.clone(),
                node: s.node as u32,
                copy: copy as u32,
                mesh,
                transform,
                pinned: s.pinned.or_else(|| instance_pin(contents, node, source)).or(singular).or(scaled),
            });
        }
    }
    Ok(instances)
}

/// Whether a transform preserves lengths, but for what single precision rounds.
fn is_rigid(transform: &DAffine3) -> bool {
    let m = transform.matrix3;
    (m.transpose() * m).abs_diff_eq(DMat3::IDENTITY, 1e-6)
}

/// Whether a device, which inverts the transform in single precision, cannot trace into the instance: the axes span no
/// volume, or one so flat that rounding decides its orientation.
fn is_singular(transform: &DAffine3) -> bool {
    let m = transform.matrix3;
    let spanned = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    let flatness = m.determinant().abs() / spanned;
    let inverse = transform.inverse();
    let invertible = inverse.to_cols_array().iter().all(|c| (*c as f32).is_finite());
    // NaN, from axes of length zero or an overflow, counts as flat.
    flatness.is_nan() || flatness <= 1e-9 || !invertible
}

/// Pins all copies of a node if one of them is pinned.
pub(super) fn pin_whole_nodes(instances: &mut [Instance]) {
    for copies in instances.chunk_by_mut(|a, b| a.node == b.node) {
        let pinned = copies.iter().find_map(|i| i.pinned);
        copies.iter_mut().for_each(|i| i.pinned = i.pinned.or(pinned));
    }
}

fn cameras(contents: &Contents, shown: &[Shown]) -> Vec<PlacedCamera> {
    shown
        .iter()
        .filter(|s| s.transform.is_finite())
        .filter_map(|s| {
            let node = &contents.nodes[s.node];
            let camera = contents.cameras[node.camera?];
            Some(PlacedCamera { name: node.name.clone().unwrap_or_default(), camera, transform: s.transform })
        })
        .collect()
}
