//! [`Property`]: properties of glTF objects by what they mean, so that two files can be compared whose indices differ.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use bytes::Bytes;
use glam::{DAffine2, DQuat, DVec3};

use crate::contents::Node;
use crate::document::Attribute;
use crate::{Document, Error};

/// A property of a glTF object with its references followed: a texture stands as what it samples and how, a light as
/// its colour and intensity, an accessor as its numbers. Properties equal to their default are left out.
#[derive(Clone, Debug, PartialEq)]
pub enum Property {
    /// `null`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
    /// A list.
    List(Vec<Property>),
    /// An object, by key.
    Object(BTreeMap<String, Property>),
    /// The elements of an accessor, one after the other; normalised integers as numbers from -1 to 1.
    Numbers(Vec<f64>),
    /// The bytes of a buffer view.
    Bytes(Bytes),
    /// An image of the file.
    Image(usize),
    /// A material of the file; `None` is glTF's default material.
    Material(Option<usize>),
    /// A node of the file.
    Node(usize),
}

/// Longest text of a value, in characters; longer ones are cut.
const LONGEST: usize = 60;

impl Property {
    /// Returns a property of an object.
    pub fn get(&self, key: &str) -> Option<&Property> {
        match self {
            Property::Object(map) => map.get(key),
            _ => None,
        }
    }

    /// Whether this is an object or a list without elements.
    pub fn is_empty(&self) -> bool {
        match self {
            Property::Object(map) => map.is_empty(),
            Property::List(list) => list.is_empty(),
            _ => false,
        }
    }

    /// Returns the value as it would stand in JSON, cut after some characters.
    pub fn short(&self) -> String {
        let text = self.to_string();
        match text.char_indices().nth(LONGEST) {
            Some((end, _)) => format!("{}…", &text[..end]),
            None => text,
        }
    }
}

impl fmt::Display for Property {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Property::Null => f.write_str("null"),
            Property::Bool(value) => write!(f, "{value}"),
            Property::Number(value) => write!(f, "{value}"),
            Property::Text(text) => write!(f, "{text:?}"),
            Property::List(list) => f.debug_list().entries(list.iter().map(Shown)).finish(),
            Property::Object(map) => f.debug_map().entries(map.iter().map(|(k, v)| (k, Shown(v)))).finish(),
            Property::Numbers(numbers) => write!(f, "{} numbers", numbers.len()),
            Property::Bytes(bytes) => write!(f, "{} bytes", bytes.len()),
            Property::Image(image) => write!(f, "images[{image}]"),
            Property::Material(Some(material)) => write!(f, "materials[{material}]"),
            Property::Material(None) => f.write_str("the default material"),
            Property::Node(node) => write!(f, "nodes[{node}]"),
        }
    }
}

/// Prints a property the same way within lists and objects.
struct Shown<'a>(&'a Property);

impl fmt::Debug for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// What a material shows.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialContent {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// `extras`, if the file has any.
    pub extras: Option<Property>,
    /// All other properties, extensions included. Textures stand without what [`TextureUse`] holds.
    pub properties: Property,
    /// Its textures, in order of their places.
    pub textures: Vec<TextureUse>,
}

/// How a material places a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureUse {
    /// The property that refers to it, such as `pbrMetallicRoughness.baseColorTexture`.
    pub place: String,
    /// The `n` of the attribute `TEXCOORD_n` that places it.
    pub texcoord: usize,
    /// `KHR_texture_transform`: the transform applied to texture coordinates.
    pub transform: DAffine2,
}

/// The nodes and scenes of a file.
#[derive(Clone, Debug, Default)]
pub struct Hierarchy {
    /// All nodes, as in [`Contents`](crate::Contents), except that `animated` and `in_other_scene` are not set.
    pub nodes: Vec<Node>,
    /// All scenes; one of all nodes without a parent if the file has none.
    pub scenes: Vec<SceneContent>,
    /// Index of the default scene.
    pub default: usize,
}

/// Where a node stands in its parent, in the parts that animations change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestPose {
    /// Translation.
    pub translation: DVec3,
    /// Rotation, of length one.
    pub rotation: DQuat,
    /// Scale.
    pub scale: DVec3,
}

/// A scene of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneContent {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// Its root nodes.
    pub roots: Vec<usize>,
    /// Its `extras` and `extensions`.
    pub more: BTreeMap<String, Property>,
}

/// What a node says and refers to besides its place and its mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeContent {
    /// `extras` without what the program records there.
    pub extras: Option<Property>,
    /// `extensions`, without those that place copies. A light stands as the light itself.
    pub extensions: BTreeMap<String, Property>,
    /// The camera.
    pub camera: Option<Property>,
    /// The morph weights, of the node or else of its mesh.
    pub weights: Option<Vec<f64>>,
    /// `extras.raykiln.mesh`: name and extras of the mesh that it placed.
    pub placed_mesh: Option<Property>,
}

/// A skin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// The nodes that are its joints.
    pub joints: Vec<usize>,
    /// The node above its joints.
    pub skeleton: Option<usize>,
    /// Sixteen numbers per joint, column by column; empty if all are identities.
    pub inverse_bind_matrices: Arc<[f64]>,
}

/// What a mesh or primitive says besides its geometry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshContent {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// `extras` without what the program records there.
    pub extras: Option<Property>,
    /// `extensions` without compression. Variants stand as the material by the name of the variant.
    pub extensions: BTreeMap<String, Property>,
}

/// An animation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// Its channels, in file order.
    pub channels: Vec<Channel>,
    /// Its `extras` and `extensions`.
    pub more: BTreeMap<String, Property>,
}

/// What an animation changes, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The node, or else the first part of a pointer (`KHR_animation_pointer`).
    pub target: Property,
    /// The path, or else the rest of the pointer.
    pub path: String,
    /// `LINEAR`, `STEP` or `CUBICSPLINE`.
    pub interpolation: String,
    /// The times of its keys in seconds.
    pub times: Arc<[f64]>,
    /// The values at its keys.
    pub values: Arc<[f64]>,
}

/// A primitive of points or lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Strokes {
    /// Index of the primitive in its mesh.
    pub primitive: usize,
    /// Its material.
    pub material: Option<usize>,
    /// Corners per element: 1 for points, 2 for lines; strips and loops are unrolled.
    pub corners: usize,
    /// Vertices of all elements.
    pub vertices: Vec<u32>,
    /// Positions of the vertices as stored.
    pub positions: Arc<[[f64; 3]]>,
}

/// The document must have passed [`Document::contents`] for all of these; what is malformed in places that it does not
/// check counts as absent.
impl Document {
    /// Returns what a material shows; `None` is glTF's default material.
    pub fn material_content(&self, material: Option<usize>) -> MaterialContent {
        crate::gltf::properties::material(self, material)
    }

    /// Returns the number of images.
    pub fn image_count(&self) -> usize {
        crate::gltf::properties::count(self, "images")
    }

    /// Returns the number of materials.
    pub fn material_count(&self) -> usize {
        crate::gltf::properties::count(self, "materials")
    }

    /// Returns all nodes and scenes.
    ///
    /// # Errors
    /// See [`Document::contents`].
    pub fn hierarchy(&self) -> Result<Hierarchy, Error> {
        crate::gltf::properties::hierarchy(self)
    }

    /// Returns the rest poses of all nodes. A matrix is taken apart, which loses shear.
    ///
    /// # Errors
    /// See [`Document::contents`].
    pub fn rest_poses(&self) -> Result<Vec<RestPose>, Error> {
        crate::gltf::properties::rest_poses(self)
    }

    /// Returns what a node says and refers to.
    pub fn node_content(&self, node: usize) -> NodeContent {
        crate::gltf::properties::node(self, node)
    }

    /// Returns all skins.
    pub fn skins(&self) -> Vec<Skin> {
        crate::gltf::properties::skins(self)
    }

    /// Returns the document with another scene as the default one; it shares all buffers.
    pub fn showing(&self, scene: usize) -> Document {
        let mut other = self.clone();
        other.json["scene"] = scene.into();
        other
    }

    /// Returns what a mesh says.
    pub fn mesh_content(&self, mesh: usize) -> MeshContent {
        crate::gltf::properties::mesh(self, mesh)
    }

    /// Returns what a primitive says.
    pub fn primitive_content(&self, mesh: usize, primitive: usize) -> MeshContent {
        crate::gltf::properties::primitive(self, mesh, primitive)
    }

    /// Returns the morph targets of a primitive, each with its attributes in file order.
    pub fn morph_targets(&self, mesh: usize, primitive: usize) -> Vec<Vec<Attribute<'_>>> {
        crate::gltf::attributes::targets(self, mesh, primitive)
    }

    /// Returns all animations.
    pub fn animations(&self) -> Vec<Animation> {
        crate::gltf::properties::animations(self)
    }

    /// Returns what the file says of itself: `copyright`, `extras` and `extensions` of `asset`, and `extras` and
    /// `extensions` of the root. Lights are left out: their nodes have them. Variants stand as their names.
    pub fn root_content(&self) -> BTreeMap<String, Property> {
        crate::gltf::properties::root(self)
    }

    /// Returns the points and lines of all meshes, by mesh; primitives that refer to one accessor share its positions.
    pub fn strokes(&self) -> Vec<Vec<Strokes>> {
        crate::gltf::properties::strokes(self)
    }
}
