//! What alpha-tested materials test: factor, texture and the images behind it.

use std::path::{Path, PathBuf};

pub use bytes::Bytes;
use glam::DAffine2;

/// What an alpha-tested material compares with its cutoff: the alpha of its texture, if it has one, times a factor.
#[derive(Clone, Debug, PartialEq)]
pub struct AlphaTest {
    /// Smallest alpha that counts as a hit.
    pub cutoff: f64,
    /// `baseColorFactor[3]`.
    pub factor: f64,
    /// The base colour texture.
    pub texture: Option<Texture>,
}

/// A texture as a material uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Index into `images`.
    pub image: usize,
    /// The `n` of the attribute `TEXCOORD_n` that places it.
    pub texcoord: usize,
    /// How coordinates beyond 0 to 1 are taken, by axis.
    pub wrap: [Wrap; 2],
    /// `KHR_texture_transform`: what a texture coordinate goes through first.
    pub transform: DAffine2,
}

/// How a texture goes on beyond its ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// From the start.
    #[default]
    Repeat,
    /// With its last texel.
    Clamp,
    /// Backwards, then from the start.
    Mirror,
}

/// An image, encoded as in the file, and not read before it is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Its place in the document and its file, if it is one.
    pub name: String,
    data: Data,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Data {
    Bytes(Bytes),
    /// A file, and where else it may be.
    File(PathBuf, Option<PathBuf>),
    /// Why there is none.
    Broken(String),
}

impl Image {
    /// An image from its encoded bytes.
    pub fn from_bytes(name: String, bytes: Bytes) -> Image {
        Image { name, data: Data::Bytes(bytes) }
    }

    /// An image that cannot be had, and why.
    pub fn broken(name: String, reason: String) -> Image {
        Image { name, data: Data::Broken(reason) }
    }

    pub(crate) fn file(name: String, path: PathBuf) -> Image {
        Image { name, data: Data::File(path, None) }
    }

    /// Has the image looked for in the place it would have if the document, now in `from`, lay in the folder `to`;
    /// to be used where no file is in its own place.
    pub fn also_look(&mut self, from: &Path, to: &Path) {
        if let Data::File(path, elsewhere) = &mut self.data {
            *elsewhere = path.strip_prefix(from).ok().map(|relative| to.join(relative));
        }
    }

    /// The encoded bytes.
    ///
    /// # Errors
    /// Why there are none, in words.
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
