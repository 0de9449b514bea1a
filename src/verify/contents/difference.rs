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
