//! The extensions that are known, one row each.
//!
//! To add one, add a row: `known` with its name, then what is special about it. An extension without specialities refers
//! to nothing that a bake changes, and what carries it may be restructured. Rows whose name ends in `*` hold for all names
//! that begin like it and have no row of their own. Sources: the registry of Khronos
//! (<https://github.com/KhronosGroup/glTF/tree/main/extensions>) if no other is given. `src/emit/tests_of_extensions.rs`
//! bakes an example of each row; add one there, too.

use serde_json::Value;

use super::List::{self, Accessors, Meshes, Nodes, Views};
use super::Owner;
use crate::extension_names::*;

/// What becomes of an object that carries an extension.
#[derive(Clone, Copy)]
pub(super) enum Carried {
    /// Its triangles may be restructured; the extension stays on the object, or goes along with its primitive.
    Free,
    /// It keeps its mesh, because what the extension says would not hold for triangles that are elsewhere.
    Stays,
    /// It stays if its extension object says so.
    If(fn(&Value) -> bool),
}

impl Carried {
    pub(super) fn stays(self, object: &Value) -> bool {
        match self {
            Carried::Free => false,
            Carried::Stays => true,
            Carried::If(stays) => stays(object),
        }
    }
}

/// A row of the table.
#[derive(Clone, Copy)]
pub(crate) struct Extension {
    /// Its name; `*` at the end stands for any text.
    pub(super) name: &'static str,
    /// Whether a file that requires it can be read: it does not change where triangles are, or the reader follows it.
    pub(super) readable: bool,
    /// Whether it compresses data that it also has uncompressed, so that it goes where the data is changed.
    pub(super) compresses: bool,
    pub(super) on_node: Carried,
    pub(super) on_mesh: Carried,
    pub(super) on_primitive: Carried,
    /// Paths to its references (`*` for each element), and the list that each refers to.
    pub(super) refers: &'static [(&'static str, List)],
    /// Whether its references hold on nodes alone: elsewhere they are to something else.
    pub(super) of_nodes: bool,
    /// Whether it is only known in outline, so that its references are guessed from the names of its properties.
    pub(super) guessed: bool,
    /// Paths to lengths in the coordinates of the mesh, of an extension of a material.
    pub(super) mesh_units: &'static [&'static str],
}

const fn known(name: &'static str) -> Extension {
    Extension {
        name,
        readable: true,
        compresses: false,
        on_node: Carried::Free,
        on_mesh: Carried::Free,
        on_primitive: Carried::Free,
        refers: &[],
        of_nodes: false,
        guessed: false,
        mesh_units: &[],
    }
}

impl Extension {
    /// A file that requires it is refused.
    const fn unreadable(self) -> Self {
        Extension { readable: false, ..self }
    }

    /// It compresses data; see `gltf/compressed` and `gltf/read.rs` for what of it is decoded on reading.
    const fn compressing(self) -> Self {
        Extension { compresses: true, readable: false, ..self }
    }

    /// Nodes that carry it keep their mesh, and so do the nodes below them.
    const fn pins_node(self) -> Self {
        Extension { on_node: Carried::Stays, ..self }
    }

    const fn pins_node_if(self, stays: fn(&Value) -> bool) -> Self {
        Extension { on_node: Carried::If(stays), ..self }
    }

    /// Meshes that carry it stay whole.
    const fn pins_mesh(self) -> Self {
        Extension { on_mesh: Carried::Stays, ..self }
    }

    /// Meshes with a primitive that carries it stay whole, such as data in the order of triangles or vertices.
    const fn pins_primitive(self) -> Self {
        Extension { on_primitive: Carried::Stays, ..self }
    }

    const fn pins_primitive_if(self, stays: fn(&Value) -> bool) -> Self {
        Extension { on_primitive: Carried::If(stays), ..self }
    }

    const fn refers(self, refers: &'static [(&'static str, List)]) -> Self {
        Extension { refers, ..self }
    }

    /// On nodes it refers to these; on materials, to materials.
    const fn refers_on_nodes(self, refers: &'static [(&'static str, List)]) -> Self {
        Extension { refers, of_nodes: true, ..self }
    }

    /// Whether the references of the row hold where this object carries the extension.
    pub(super) fn refers_from(&self, owner: Owner) -> bool {
        !self.of_nodes || matches!(owner, Owner::Node(_))
    }

    /// It is known in outline: it does not change where triangles are.
    const fn guessed(self) -> Self {
        Extension { guessed: true, ..self }
    }

    const fn in_mesh_units(self, mesh_units: &'static [&'static str]) -> Self {
        Extension { mesh_units, ..self }
    }
}

/// Finds the row of an extension.
pub(crate) fn find(name: &str) -> Option<&'static Extension> {
    let begins = |row: &&Extension| row.name.strip_suffix('*').is_some_and(|start| name.starts_with(start));
    TABLE.iter().find(|row| row.name == name).or_else(|| TABLE.iter().find(begins))
}

/// Whether a file that requires the extension can be read.
pub(crate) fn is_readable(name: &str) -> bool {
    find(name).is_some_and(|row| row.readable)
}

/// Whether the extension is a compressed form of data that changes with its primitive.
pub(crate) fn compresses(name: &str) -> bool {
    find(name).is_some_and(|row| row.compresses)
}

/// Returns the names of all rows.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    TABLE.iter().map(|row| row.name)
}

#[rustfmt::skip] // one row per extension reads as a table
const TABLE: &[Extension] = &[
    // Materials, textures and images: a bake does not change them. Thickness is measured in the coordinates of the mesh.
    known("KHR_materials_volume").in_mesh_units(&["thicknessFactor"]),
    known("KHR_materials_*"),
    known(ADOBE_MATERIALS_CLEARCOAT_SPECULAR),
    known(ADOBE_MATERIALS_THIN_TRANSPARENCY),
    known("ADOBE_materials_clearcoat_tint"),
    known(EXT_MATERIALS_BUMP),
    known(MSFT_PACKING_NORMAL_ROUGHNESS_METALLIC),
    known(MSFT_PACKING_OCCLUSION_ROUGHNESS_METALLIC),
    known("KHR_texture_*"),
    known("EXT_texture_*"),
    known(MSFT_TEXTURE_DDS),
    known("MPEG_texture_video").refers(&[("accessor", Accessors)]),
    known("NV_materials_mdl").refers(&[("modules.*.bufferView", Views), ("bsdfMeasurements.*.bufferView", Views)]),
    // VRM 1.0 (github.com/vrm-c/vrm-specification): outlines of MToon are in metres or in shares of the screen.
    known("VRMC_materials_*"),
    // On primitives it selects materials for all of the primitive.
    known(KHR_MATERIALS_VARIANTS),

    // Geometry.
    known(KHR_MESH_QUANTIZATION),
    known(KHR_DRACO_MESH_COMPRESSION).compressing().refers(&[("bufferView", Views)]),
    known(EXT_MESHOPT_COMPRESSION).compressing(),
    known(KHR_MESHOPT_COMPRESSION).compressing(),
    // Copies with attributes of their own, such as a colour, stay copies.
    known(EXT_MESH_GPU_INSTANCING).pins_node_if(has_own_attributes).refers(&[("attributes.*", Accessors)]),
    known("EXT_instance_features").pins_node(),
    // github.com/CesiumGS/glTF: an identifier without attribute and texture is the number of the vertex; without a table
    // of properties, identifiers of two primitives have nothing to do with each other.
    known(EXT_MESH_FEATURES).pins_primitive_if(has_own_identifiers),
    known("EXT_structural_metadata").refers(&[
        ("propertyTables.*.properties.*.values", Views),
        ("propertyTables.*.properties.*.arrayOffsets", Views),
        ("propertyTables.*.properties.*.stringOffsets", Views),
    ]),
    known("EXT_mesh_manifold").pins_mesh().refers(&[
        ("manifoldPrimitive.indices", Accessors), ("manifoldPrimitive.attributes.*", Accessors),
        ("mergeIndices", Accessors), ("mergeValues", Accessors),
    ]),
    known("EXT_mesh_primitive_edge_visibility").pins_primitive().refers(&[
        ("visibility", Accessors), ("silhouetteNormals", Accessors), ("lineStrings.*.indices", Accessors),
    ]),
    known("EXT_mesh_primitive_restart").pins_mesh().refers(&[("primitiveGroups.*.indices", Accessors)]),
    known("CESIUM_primitive_outline").pins_primitive().refers(&[("indices", Accessors)]),
    known("EXT_mesh_polygon").pins_primitive().guessed(),
    // The order of triangles says which of them are one polygon.
    known("FB_ngon_encoding").pins_primitive(),
    known(FB_GEOMETRY_METADATA),
    // github.com/NVIDIAGameWorks/Displacement-MicroMap-SDK: one number per triangle.
    known("NV_opacity_micromap").pins_primitive().refers(&[("mapIndices", Accessors)]),
    known("NV_displacement_micromap").pins_primitive().unreadable().refers(&[
        ("mapIndices", Accessors), ("directions", Accessors), ("directionBounds", Accessors),
        ("primitiveFlags", Accessors),
    ]),
    known("NV_micromaps").refers(&[("micromaps.*.bufferView", Views)]),
    known("EXT_mesh_opacity_micromap").pins_primitive().guessed(),
    // Points, which stay in their mesh.
    known("KHR_gaussian_splatting*"),
    known("MPEG_mesh_linking").pins_mesh().unreadable().refers(&[
        ("correspondence", Accessors), ("mesh", Meshes), ("pose", Accessors), ("weights", Accessors),
    ]),
    known("MPEG_accessor_timed").unreadable().refers(&[("bufferView", Views)]),
    known("MPEG_buffer_circular").unreadable(),
    known("MPEG_media"),
    known("MPEG_animation_timing").refers(&[("accessor", Accessors)]),
    known("MPEG_scene_dynamic"),
    known("MPEG_viewport_recommended").refers(&[
        ("viewports.*.translation", Accessors), ("viewports.*.rotation", Accessors),
        ("viewports.*.parameters", Accessors),
    ]),
    known("MPEG_audio_spatial").refers(&[("sources.*.accessors.*", Accessors)]),

    // Nodes.
    known(MSFT_LOD).pins_node().refers_on_nodes(&[("ids.*", Nodes)]),
    known(MSFT_SCREENCOVERAGE).pins_node(),
    known(KHR_NODE_VISIBILITY).pins_node(),
    known(KHR_NODE_SELECTABILITY).pins_node(),
    known(KHR_NODE_HOVERABILITY).pins_node(),
    known(KHR_LIGHTS_PUNCTUAL),
    known("EXT_lights_ies").refers(&[("lights.*.bufferView", Views)]),
    known(EXT_LIGHTS_IMAGE_BASED),
    known(GODOT_SINGLE_ROOT),
    known("AGI_articulations").pins_node(),
    known("AGI_stk_metadata").pins_node(),
    known("GRIFFEL_bim_data").pins_node().refers(&[("bufferView", Views)]),
    // github.com/omigroup/gltf-extensions
    known("KHR_audio_emitter").refers(&[("audio.*.bufferView", Views)]),
    known("KHR_audio").refers(&[("audio.*.bufferView", Views)]),
    known("KHR_implicit_shapes").guessed(),
    known("KHR_collision_shapes").refers(&[("shapes.*.convex.mesh", Meshes), ("shapes.*.trimesh.mesh", Meshes)]),
    known("KHR_physics_rigid_bodies").pins_node().refers(&[
        ("collider.geometry.node", Nodes), ("collider.geometry.mesh", Meshes), ("trigger.geometry.node", Nodes),
        ("trigger.geometry.mesh", Meshes), ("trigger.nodes.*", Nodes), ("joint.connectedNode", Nodes),
    ]),
    known("MSFT_*").pins_node().guessed(),
    known("OMI_*").pins_node().guessed(),

    // Whose it is and what may be done with it: on a mesh it holds for all of the mesh.
    known(KHR_XMP).pins_mesh(),
    known(KHR_XMP_JSON_LD).pins_mesh(),

    // Behaviour. JSON pointers pin what they name.
    known(KHR_ANIMATION_POINTER),
    known("KHR_interactivity").refers(&[("graphs.*.nodes.*.configuration.nodeIndex.value.*", Nodes)]),
    // github.com/vrm-c/vrm-specification
    known("VRM").refers(&[
        ("humanoid.humanBones.*.node", Nodes), ("firstPerson.firstPersonBone", Nodes),
        ("firstPerson.meshAnnotations.*.mesh", Meshes),
        ("blendShapeMaster.blendShapeGroups.*.binds.*.mesh", Meshes),
        ("secondaryAnimation.boneGroups.*.bones.*", Nodes), ("secondaryAnimation.boneGroups.*.center", Nodes),
        ("secondaryAnimation.colliderGroups.*.node", Nodes),
    ]),
    known("VRMC_vrm").refers(&[
        ("humanoid.humanBones.*.node", Nodes), ("firstPerson.meshAnnotations.*.node", Nodes),
        ("expressions.*.*.morphTargetBinds.*.node", Nodes),
    ]),
    known("VRMC_vrm_animation").refers(&[
        ("humanoid.humanBones.*.node", Nodes), ("expressions.*.*.node", Nodes), ("lookAt.node", Nodes),
    ]),
    known("VRMC_springBone").refers(&[
        ("springs.*.joints.*.node", Nodes), ("springs.*.center", Nodes), ("colliders.*.node", Nodes),
    ]),
    known("VRMC_node_constraint").pins_node().refers(&[
        ("constraint.roll.source", Nodes), ("constraint.aim.source", Nodes), ("constraint.rotation.source", Nodes),
    ]),
    known("VRMC_*").pins_node().guessed(),
];

/// `EXT_mesh_gpu_instancing`: whether copies have attributes besides their transform.
fn has_own_attributes(object: &Value) -> bool {
    let names = object.get("attributes").and_then(Value::as_object).into_iter().flat_map(|all| all.keys());
    names.into_iter().any(|name| !["TRANSLATION", "ROTATION", "SCALE"].contains(&name.as_str()))
}

/// `EXT_mesh_features`: whether identifiers mean something in their primitive only.
fn has_own_identifiers(object: &Value) -> bool {
    let sets = object.get("featureIds").and_then(Value::as_array).into_iter().flatten();
    sets.into_iter().any(|ids| {
        let is_implicit = ids.get("attribute").is_none() && ids.get("texture").is_none();
        is_implicit || ids.get("propertyTable").is_none()
    })
}
