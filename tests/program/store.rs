//! The bytes that are timed are the bytes that are written.

use std::path::Path;

use crate::common::samples;
use raykiln::copies::{self, Likeness, Materials};
use raykiln::emit::{self, Refuse};
use raykiln::layout::{Layout, order_by_tree, stored};
use raykiln::methods::{self, Instances, Method};
use raykiln::scene::{self, LoadOptions, Mesh, Scene};
use raykiln_formats::Document;
use tempfile::TempDir;

/// How far a vertex may move, over the diagonal of the scene.
const MAX_ERROR_RATIO: f64 = 1e-6;

fn load(file: &Path) -> (Document, Scene) {
    let document = raykiln_formats::read(file).expect("it is read");
    let (scene, _) = scene::load(&document, &LoadOptions::default()).expect("it has triangles");
    (document, scene)
}

/// The layouts of a scene by every method, with names.
fn layouts(scene: &Scene) -> Vec<(String, Layout)> {
    let mut layouts = Vec::new();
    for method in Method::ALL {
        for instances in [Instances::BakeOrKeep, Instances::Choose] {
            let mut options = methods::Options::default();
            options.instances.shared = instances;
            let mut layout = methods::run(method, scene, &options);
            emit::settle(scene, &mut layout, MAX_ERROR_RATIO, Refuse::Instances);
            order_by_tree(scene, &mut layout);
            layouts.push((format!("{} {instances:?}", method.name()), layout));
        }
    }
    layouts
}

/// The bits of a geometry's positions, and its triangles.
type GeometryBits<'a> = (Vec<[u32; 3]>, &'a [[u32; 3]]);

/// For each geometry of a mesh, its positions bit for bit and its triangles.
fn content(mesh: &Mesh) -> Vec<GeometryBits<'_>> {
    let bits = |g: &scene::Geometry| g.positions.iter().map(|p| p.to_array().map(f32::to_bits)).collect();
    mesh.geometries.iter().map(|g| (bits(g), g.triangles.as_slice())).collect()
}

/// The meshes of a layout in the order of its file: first the input's, then the rewritten ones.
fn in_file_order<'a>(scene: &Scene, layout: &Layout, raced: &'a Scene) -> Vec<&'a Mesh> {
    let source = |group: usize| match layout.groups[group].content {
        raykiln::layout::Content::Kept(mesh) => scene.meshes[mesh.0 as usize].source,
        _ => u32::MAX,
    };
    let mut groups: Vec<usize> = (0..layout.groups.len()).collect();
    groups.sort_by_key(|&group| source(group));
    groups.into_iter().map(|group| &raced.meshes[group]).collect()
}

fn assert_raced_as_written(document: &Document, scene: &Scene, sample: &str) {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("out.glb");
    for (name, layout) in layouts(scene) {
        let emitted = emit::emit(document, scene, &layout, &emit::Options::default());
        emitted.document.stage(&file).expect("it is staged").commit().expect("it is written");
        let (_, written) = load(&file);
        let raced = stored(scene, &layout);
        let raced: Vec<_> = in_file_order(scene, &layout, &raced).into_iter().map(content).collect();
        let written: Vec<_> = written.meshes.iter().map(content).collect();
        assert!(raced == written, "{sample}, {name}: the timed bytes are not the written bytes");
    }
}

#[test]
fn what_is_raced_is_what_is_written() {
    let options = copies::Options {
        likeness: Likeness::Rigid,
        materials: Materials::Same,
        max_position_error_ratio: MAX_ERROR_RATIO,
        least_saved_bytes: 0,
    };
    for sample in samples() {
        let (document, scene) = load(&sample.scene);
        assert_raced_as_written(&document, &scene, &sample.name);
        let found = copies::find(&document, &scene, &options);
        if !found.list.is_empty() {
            let shared = scene.overlaid(&found.overlay(&scene));
            assert_raced_as_written(&document, &shared, &format!("copies of {}", sample.name));
        }
    }
}
