//! Inputs of the alpha test of a material: factor, texture and image.

use std::path::{Path, PathBuf};

pub use bytes::Bytes;
use glam::DAffine2;

/// The alpha that a material compares with its cutoff: that of its texture, if it has one, times a factor.
#[derive(Clone, Debug, PartialEq)]
pub struct AlphaTest {
    /// Smallest alpha that counts as a hit.
    pub cutoff: f64,
    /// `baseColorFactor[3]`.
    pub factor: f64,
    /// The base colour texture.
    pub texture: Option<Texture>,
}

/// A texture as used by a material.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Index into `images`.
    pub image: usize,
    /// The `n` of the attribute `TEXCOORD_n` that places it.
    pub texcoord: usize,
    /// Treatment of coordinates outside 0 to 1, per axis.
    pub wrap: [Wrap; 2],
    /// `KHR_texture_transform`: the transform applied to texture coordinates.
    pub transform: DAffine2,
}

/// Continuation of a texture outside 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Repeats the texture.
    #[default]
    Repeat,
    /// Repeats the last texel.
    Clamp,
    /// Repeats the texture, mirrored every other time.
    Mirror,
}

/// An image, encoded as in the file, and read only on request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Its place in the document, and its file name if it is a file.
    pub name: String,
    data: Data,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Data {
    Bytes(Bytes),
    /// A file, and an alternative path.
    File(PathBuf, Option<PathBuf>),
    /// No image; holds the reason.
    Broken(String),
}

impl Image {
    /// Creates an image from its encoded bytes.
    pub fn from_bytes(name: String, bytes: Bytes) -> Image {
        Image { name, data: Data::Bytes(bytes) }
    }

    /// Creates an image that cannot be read, with the reason.
    pub fn broken(name: String, reason: String) -> Image {
        Image { name, data: Data::Broken(reason) }
    }

    pub(crate) fn file(name: String, path: PathBuf) -> Image {
        Image { name, data: Data::File(path, None) }
    }

    /// Adds an alternative path, used if the file does not exist: the one it would have if the document, now in `from`,
    /// were in the folder `to`.
    pub fn also_look(&mut self, from: &Path, to: &Path) {
        if let Data::File(path, elsewhere) = &mut self.data {
            *elsewhere = path.strip_prefix(from).ok().map(|relative| to.join(relative));
        }
    }

    /// Returns the encoded bytes.
    ///
    /// # Errors
    /// Describes why the image cannot be read.
    pub fn read(&self) -> Result<Bytes, String> {
        match &self.data {
            Data::Bytes(bytes) => Ok(bytes.clone()),
            Data::Broken(reason) => Err(reason.clone()),
            Data::File(path, elsewhere) => {
                let file = elsewhere.as_ref().filter(|_| !path.exists()).unwrap_or(path);
                crate::gltf::read::read_regular(file).map_err(|e| format!("{} cannot be read: {e}", file.display()))
            }
        }
    }
}
