//! [`Difference`]: something that the output says otherwise than the input.

use serde::{Serialize, Serializer};

/// Something that the output says otherwise than the input.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Whether it fails the file.
    pub severity: Severity,
    /// What differs.
    pub kind: DifferenceKind,
    /// How many times: triangles for materials, corners for attributes, otherwise objects.
    pub count: u64,
    /// The first object of the input that shows it, by name.
    pub object: Option<String>,
    /// What it was and what it is.
    pub detail: Option<Detail>,
}

/// Whether a difference fails the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// It fails the file.
    Error,
    /// It does not, but is said.
    Note,
}

/// What a property was and what it is.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Detail {
    /// A property.
    Property {
        /// What has the property, as the input names it.
        of: Option<String>,
        /// Its path.
        property: String,
        /// The value in the input; `None` if it is absent or has its default.
        before: Option<String>,
        /// The value in the output; `None` if it is absent or has its default.
        after: Option<String>,
    },
    /// An attribute of a corner.
    Attribute {
        /// The attribute's semantic.
        attribute: String,
        /// The largest deviation found; an angle in radians for directions.
        deviation: f64,
        /// The largest deviation allowed.
        allowed: f64,
    },
}

impl Difference {
    /// Returns a difference with the severity of its kind.
    pub fn new(kind: DifferenceKind, count: u64, object: Option<String>, detail: Option<Detail>) -> Difference {
        Difference { severity: kind.severity(), kind, count, object, detail }
    }
}

/// Defines the enum, `ALL` and one row of the table for each kind.
macro_rules! kinds {
    ($($(#[doc = $doc:literal])+ $kind:ident = $name:literal, $severity:ident;)+) => {
        /// What can differ.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum DifferenceKind {
            $($(#[doc = $doc])+ $kind,)+
        }

        impl DifferenceKind {
            /// All kinds, in the order of reports.
            pub const ALL: &[DifferenceKind] = &[$(DifferenceKind::$kind),+];

            /// Returns its name in reports.
            pub fn name(self) -> &'static str {
                match self { $(DifferenceKind::$kind => $name,)+ }
            }

            /// Whether it fails the file.
            pub fn severity(self) -> Severity {
                match self { $(DifferenceKind::$kind => Severity::$severity,)+ }
            }

            /// Returns what differs, as a phrase.
            pub fn meaning(self) -> &'static str {
                match self { $(DifferenceKind::$kind => concat!($($doc),+).trim_ascii(),)+ }
            }
        }
    };
}

kinds! {
    /// A factor of the material, such as its base color.
    MaterialFactor = "material-factor", Error;
    /// The alpha mode or the alpha cutoff.
    AlphaMode = "alpha-mode", Error;
    /// Whether the material is double-sided.
    DoubleSided = "double-sided", Error;
    /// A property of an extension of the material.
    MaterialExtension = "material-extension", Error;
    /// A texture that only one of the materials has.
    TextureMissing = "texture-missing", Error;
    /// The image of a texture.
    TextureImage = "texture-image", Error;
    /// How a texture is filtered or wrapped.
    TextureSampler = "texture-sampler", Error;
    /// The extras of the material.
    MaterialExtras = "material-extras", Error;
    /// The name of the material; materials are matched by content.
    MaterialName = "material-name", Note;
    /// The normal at a corner.
    Normal = "normal", Error;
    /// The tangent at a corner, or its handedness.
    Tangent = "tangent", Error;
    /// A texture coordinate at a corner.
    TextureCoordinates = "texture-coordinates", Error;
    /// Where a texture lies at a corner, because its set of coordinates or its transform differs.
    TextureTransform = "texture-transform", Error;
    /// The color at a corner.
    Color = "color", Error;
    /// The weight of a joint at a corner.
    SkinWeights = "skin-weights", Error;
    /// A displacement at a corner by a morph target.
    MorphTarget = "morph-target", Error;
    /// A custom attribute at a corner, bit for bit.
    CustomAttribute = "custom-attribute", Error;
    /// An attribute that only the input has.
    AttributeMissing = "attribute-missing", Error;
    /// An attribute that only the output has.
    AttributeAdded = "attribute-added", Error;
    /// An attribute that only one file has and that its material does not use.
    UnusedAttribute = "unused-attribute", Note;
    /// The material that a variant shows.
    Variant = "variant", Error;
    /// The extras of a primitive.
    PrimitiveExtras = "primitive-extras", Error;
    /// An extension of a primitive.
    PrimitiveExtension = "primitive-extension", Error;
    /// The extras of a mesh, which may be recorded at the node that placed it.
    MeshExtras = "mesh-extras", Error;
    /// An extension of a mesh.
    MeshExtension = "mesh-extension", Error;
    /// The name of a node that has the same number.
    NodeRenamed = "node-renamed", Error;
    /// Where a node is in the world, if it carries more than a mesh.
    NodeMoved = "node-moved", Error;
    /// What a node is below, if numbers are kept or something animated is above it.
    NodeReparented = "node-reparented", Error;
    /// The extras of a node.
    NodeExtras = "node-extras", Error;
    /// An extension of a node.
    NodeExtension = "node-extension", Error;
    /// A missing node that has an extension or a skin, or that an animation moves.
    NodeLost = "node-lost", Error;
    /// The weights of morph targets.
    MorphWeights = "morph-weights", Error;
    /// The skin of a node: its joints, their matrices or its skeleton.
    Skin = "skin", Error;
    /// A camera that is missing, differs, or is in another place.
    Camera = "camera", Error;
    /// A light that is missing, differs, or is in another place.
    Light = "light", Error;
    /// A light that only the output has.
    LightAdded = "light-added", Error;
    /// An animation that is missing.
    AnimationMissing = "animation-missing", Error;
    /// An animation that only the output has.
    AnimationAdded = "animation-added", Error;
    /// Something that an animation of the input moves and that of the output does not.
    ChannelMissing = "channel-missing", Error;
    /// Something that an animation of the output moves and that of the input does not.
    ChannelAdded = "channel-added", Error;
    /// The keys of an animation: interpolation, times or values.
    AnimationKeys = "animation-keys", Error;
    /// Extras or an extension of an animation.
    AnimationData = "animation-data", Error;
    /// The name of an animation.
    AnimationName = "animation-name", Error;
    /// A scene that is missing.
    SceneMissing = "scene-missing", Error;
    /// Triangles of a scene other than the default one: missing, repeated, unknown, flipped or moved.
    SceneTriangles = "scene-triangles", Error;
    /// A node that a scene shows in only one file.
    SceneNodes = "scene-nodes", Error;
    /// Which scene is the default.
    DefaultScene = "default-scene", Error;
    /// The name of a scene.
    SceneName = "scene-name", Error;
    /// Extras or an extension of a scene.
    SceneData = "scene-data", Error;
    /// Extras or an extension of the file, the names of its variants, or its copyright.
    FileData = "file-data", Error;
    /// A point or line that is missing.
    StrokeMissing = "stroke-missing", Error;
    /// A point or line that only the output has.
    StrokeAdded = "stroke-added", Error;
    /// The material of a point or line.
    StrokeMaterial = "stroke-material", Error;
    /// Points and lines that are too many to be sought by place.
    StrokesNotCompared = "strokes-not-compared", Note;
    /// A camera that only the output has.
    CameraAdded = "camera-added", Note;
    /// The planes of a camera before and beyond which nothing is shown; rays have none.
    CameraClipping = "camera-clipping", Note;
    /// The keys of an animation that moves its target alike nevertheless.
    AnimationResampled = "animation-resampled", Note;
    /// The name of a mesh.
    MeshName = "mesh-name", Note;
    /// A missing node that carries nothing but extras, as `--prune` and other tools drop; its triangles are compared for
    /// themselves.
    NodeGoneWithExtras = "node-gone-with-extras", Note;
    /// A missing node that carries nothing; its triangles are compared for themselves.
    NodeGone = "node-gone", Note;
    /// What a node is below, if it stays in its place.
    NodeRegrouped = "node-regrouped", Note;
    /// Where a node is in the world, if it carries a mesh alone; its triangles are compared for themselves.
    NodeRescaled = "node-rescaled", Note;
    /// The name of a node that has none now, if the output leaves out more than a fifth of them.
    NamesGone = "names-gone", Note;
    /// The name of a node, up to a number that tells equal names apart.
    NameNumbered = "name-numbered", Note;
    /// An image that cannot be read in either file, so that only its name was compared.
    ImageUnreadable = "image-unreadable", Note;
}

impl Serialize for DifferenceKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_in_kebab_case() {
        let mut names: Vec<&str> = DifferenceKind::ALL.iter().map(|kind| kind.name()).collect();
        assert!(names.iter().all(|name| name.chars().all(|c| c == '-' || c.is_ascii_lowercase())), "{names:?}");
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), DifferenceKind::ALL.len());
        assert!(DifferenceKind::ALL.iter().all(|kind| kind.meaning().ends_with('.')));
    }
}
