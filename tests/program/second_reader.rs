//! A second reader: the crate `gltf`, which shares no code with this program, finds the same triangles, materials and
//! names in every output as `raykiln-formats`.

use crate::common::{bake, methods, samples};
use glam::{DAffine3, DVec3, Mat4, Quat, Vec3};
use gltf::Gltf;
use gltf::material::AlphaMode;
use gltf::mesh::Mode;
use gltf::scene::Transform;
use raykiln_formats::ReadOptions;
use raykiln_formats::contents::{self, Contents, Opacity};
use std::fmt::Debug;
use std::path::Path;
use tempfile::TempDir;

/// Samples with outputs that the crate cannot read, and why.
const UNREADABLE: [(&str, &str); 1] = [(
    "copies",
    "the crate refuses files that require EXT_mesh_gpu_instancing, as the output does unless it writes the copies out",
)];

#[test]
fn another_reader_finds_the_same_triangles_materials_and_names() {
    let mut refused = Vec::new();
    for sample in samples() {
        for method in methods() {
            let folder = TempDir::new().expect("a temporary folder");
            let output = folder.path().join("out.glb");
            bake(&sample.scene, &output, &["--method", method]);
            match Gltf::open(&output) {
                Ok(other) => assert_same(&format!("{} {method}", sample.name), &output, &other),
                Err(_) => refused.push(sample.name.clone()),
            }
        }
    }
    refused.dedup();
    assert_eq!(refused, UNREADABLE.map(|(name, _)| name));
}

fn assert_same(output: &str, path: &Path, other: &Gltf) {
    let document = raykiln_formats::read(path).unwrap_or_else(|e| panic!("{e}"));
    let contents = document.contents(ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    assert_equal(output, "nodes", &our_nodes(&contents), &their_nodes(other));
    assert_equal(output, "materials", &our_materials(&contents), &their_materials(other));
    let (ours, theirs) = (our_triangles(&contents), their_triangles(other));
    assert!(!ours.is_empty(), "{output}: nothing is shown");
    let stored = |list: &[Triangle]| list.iter().map(|t| t.stored.clone()).collect::<Vec<_>>();
    assert_equal(output, "triangles", &stored(&ours), &stored(&theirs));
    // The crate holds transforms in single precision.
    let largest = ours.iter().flat_map(|t| t.world).map(|p| p.abs().max_element()).fold(0.0, f64::max);
    for (a, b) in ours.iter().zip(&theirs) {
        let apart = (0..3).map(|i| a.world[i].distance(b.world[i])).fold(0.0, f64::max);
        assert!(apart <= 1e-6 * largest, "{output}: {a:?} against {b:?}");
    }
}

/// Asserts that two lists are equal; names the first elements that differ.
fn assert_equal<T: PartialEq + Debug>(output: &str, what: &str, ours: &[T], theirs: &[T]) {
    for (i, (a, b)) in ours.iter().zip(theirs).enumerate() {
        assert!(a == b, "{output}: {what}[{i}]: {a:?} against {b:?}");
    }
    assert_eq!(ours.len(), theirs.len(), "{output}: {what}");
}

/// Name, children and mesh of a node.
type Node = (Option<String>, Vec<usize>, Option<usize>);

fn our_nodes(contents: &Contents) -> Vec<Node> {
    contents.nodes.iter().map(|n| (n.name.clone(), n.children.clone(), n.mesh)).collect()
}

fn their_nodes(other: &Gltf) -> Vec<Node> {
    let node = |n: gltf::Node| (name(n.name()), n.children().map(|c| c.index()).collect(), n.mesh().map(|m| m.index()));
    other.nodes().map(node).collect()
}

fn name(name: Option<&str>) -> Option<String> {
    name.map(str::to_owned)
}

/// The properties of a material, numbers as text with six digits.
#[derive(Debug, PartialEq)]
struct Material {
    name: Option<String>,
    opacity: String,
    double_sided: bool,
    numbers: Vec<String>,
    /// Whether it has textures for base colour, metallic and roughness, normals, occlusion, and emission.
    textures: [bool; 5],
}

fn our_materials(contents: &Contents) -> Vec<Material> {
    let material = |m: &contents::Material| {
        let (factors, look) = ([m.look.metallic, m.look.roughness], m.look);
        let opacity = match m.opacity {
            Opacity::Opaque => "opaque".to_owned(),
            Opacity::Mask { cutoff } => format!("mask {}", six_digits(&cutoff)),
            Opacity::Blend => "blend".to_owned(),
        };
        let numbers = look.base_color.iter().chain(&factors).chain(&look.emissive).map(six_digits).collect();
        Material { name: m.name.clone(), opacity, double_sided: m.double_sided, numbers, textures: look.textures }
    };
    contents.materials.iter().map(material).collect()
}

fn their_materials(other: &Gltf) -> Vec<Material> {
    let material = |m: gltf::Material| {
        let pbr = m.pbr_metallic_roughness();
        let (color, factors, emission) =
            (pbr.base_color_factor(), [pbr.metallic_factor(), pbr.roughness_factor()], m.emissive_factor());
        let opacity = match m.alpha_mode() {
            AlphaMode::Opaque => "opaque".to_owned(),
            AlphaMode::Mask => format!("mask {}", six_digits(&m.alpha_cutoff().unwrap_or(0.5).into())),
            AlphaMode::Blend => "blend".to_owned(),
        };
        let numbers = color.into_iter().chain(factors).chain(emission);
        let textures = [
            pbr.base_color_texture().is_some(),
            pbr.metallic_roughness_texture().is_some(),
            m.normal_texture().is_some(),
            m.occlusion_texture().is_some(),
            m.emissive_texture().is_some(),
        ];
        Material {
            name: name(m.name()),
            opacity,
            double_sided: m.double_sided(),
            numbers: numbers.map(|x| six_digits(&x.into())).collect(),
            textures,
        }
    };
    other.materials().map(material).collect()
}

/// Formats a number with as many digits as single precision keeps.
fn six_digits(x: &f64) -> String {
    format!("{:.5e}", x + 0.0)
}

/// A triangle that the default scene shows.
#[derive(Debug)]
struct Triangle {
    stored: Stored,
    world: [DVec3; 3],
}

/// What must agree bit for bit: node, mesh name, primitive, material, and corners as stored.
type Stored = (usize, Option<String>, usize, Option<usize>, [[u32; 3]; 3]);

impl Triangle {
    fn new(place: (usize, Option<String>, usize, Option<usize>), corners: [[f32; 3]; 3], world: &DAffine3) -> Triangle {
        let (node, mesh, primitive, material) = place;
        let stored = (node, mesh, primitive, material, corners.map(|p| p.map(f32::to_bits)));
        Triangle { stored, world: corners.map(|p| world.transform_point3(Vec3::from(p).as_dvec3())) }
    }
}

/// The triangles of the default scene, depth first, each node before its children.
fn our_triangles(contents: &Contents) -> Vec<Triangle> {
    let mut todo: Vec<(usize, DAffine3)> = contents.roots.iter().rev().map(|&n| (n, DAffine3::IDENTITY)).collect();
    let mut found = Vec::new();
    while let Some((index, parent)) = todo.pop() {
        let node = &contents.nodes[index];
        let world = parent * node.local;
        todo.extend(node.children.iter().rev().map(|&child| (child, world)));
        let Some(mesh) = node.mesh.map(|mesh| &contents.meshes[mesh]) else { continue };
        assert!(node.copies.is_none(), "the crate accepted a file with copies of nodes");
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            for triangle in
                primitive.triangles.iter().flat_map(|t| t.corners.iter().map(|c| c.map(|v| t.positions[v as usize])))
            {
                let place = (index, mesh.name.clone(), number, primitive.material);
                found.push(Triangle::new(place, triangle, &world));
            }
        }
    }
    found
}

/// Like [`our_triangles`].
fn their_triangles(other: &Gltf) -> Vec<Triangle> {
    let scene = other.default_scene().or_else(|| other.scenes().next()).expect("a scene");
    let roots: Vec<gltf::Node> = scene.nodes().collect();
    let mut todo: Vec<(gltf::Node, DAffine3)> = roots.into_iter().rev().map(|n| (n, DAffine3::IDENTITY)).collect();
    let mut found = Vec::new();
    while let Some((node, parent)) = todo.pop() {
        let world = parent * local(&node);
        let children: Vec<gltf::Node> = node.children().collect();
        todo.extend(children.into_iter().rev().map(|child| (child, world)));
        let Some(mesh) = node.mesh() else { continue };
        for primitive in mesh.primitives().filter(|p| p.mode() == Mode::Triangles) {
            let place = (node.index(), name(mesh.name()), primitive.index(), primitive.material().index());
            let corners = corners(other, &primitive);
            found.extend(corners.into_iter().map(|triangle| Triangle::new(place.clone(), triangle, &world)));
        }
    }
    found
}

/// The transform from node to parent.
fn local(node: &gltf::Node) -> DAffine3 {
    match node.transform() {
        Transform::Matrix { matrix } => DAffine3::from_mat4(Mat4::from_cols_array_2d(&matrix).as_dmat4()),
        Transform::Decomposed { translation, rotation, scale } => DAffine3::from_scale_rotation_translation(
            Vec3::from(scale).as_dvec3(),
            Quat::from_array(rotation).as_dquat().normalize(),
            Vec3::from(translation).as_dvec3(),
        ),
    }
}

fn corners(other: &Gltf, primitive: &gltf::Primitive) -> Vec<[[f32; 3]; 3]> {
    let reader = primitive.reader(|_| other.blob.as_deref());
    let positions: Vec<[f32; 3]> = reader.read_positions().expect("positions").collect();
    let vertices: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().collect(),
        None => (0u32..).take(positions.len()).collect(),
    };
    let (triangles, _) = vertices.as_chunks::<3>();
    triangles.iter().map(|t| t.map(|v| positions[v as usize])).collect()
}
