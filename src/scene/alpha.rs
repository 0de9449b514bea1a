//! What the geometries of alpha-tested materials test, taken from the document.

use std::path::Path;

use glam::DVec2;
use raykiln_formats::Document;
pub use raykiln_formats::alpha::{Image, Wrap};

use super::{Geometry, Opacity, Scene};

/// What a geometry of an alpha-tested material lets through.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlphaTest {
    /// Smallest alpha that counts as a hit.
    pub cutoff: f32,
    /// Factor on the texture's alpha, or the alpha itself where there is no texture.
    pub factor: f32,
    /// Where the texture's alpha comes from.
    pub texture: Option<AlphaTexture>,
}

/// A texture on a geometry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlphaTexture {
    /// Index into [`Scene::images`].
    pub image: u32,
    /// How it goes on beyond 0 to 1, by axis.
    pub wrap: [Wrap; 2],
    /// For each vertex where it is on the texture, finite; `KHR_texture_transform` is applied. Empty where the
    /// image cannot be had.
    pub texcoords: Vec<[f32; 2]>,
}

/// Attaches alpha tests to the geometries of alpha-tested materials, and their images to the scene. What is wrong
/// with a texture is told by its image when that is read.
pub(super) fn attach(doc: &Document, scene: &mut Scene) {
    let mut images = Images { doc, images: Vec::new(), of_document: Vec::new() };
    for mesh in &mut scene.meshes {
        for geometry in &mut mesh.geometries {
            if let (Opacity::Mask { cutoff }, Some(material)) = (geometry.opacity, geometry.material) {
                geometry.alpha = Some(images.test(mesh.source, geometry, material, cutoff));
            }
        }
    }
    scene.images = images.images;
}

impl Scene {
    /// Has images that are files below the folder `from` looked for below `to` as well; for a document that is read
    /// from another place than the one it is made for.
    pub fn also_look_for_images(&mut self, from: &Path, to: &Path) {
        self.images.iter_mut().for_each(|image| image.also_look(from, to));
    }
}

struct Images<'d> {
    doc: &'d Document,
    images: Vec<Image>,
    /// For images of the document their place in `images`.
    of_document: Vec<Option<u32>>,
}

impl Images<'_> {
    fn test(&mut self, mesh: u32, geometry: &Geometry, material: u32, cutoff: f64) -> AlphaTest {
        let test = match self.doc.alpha_test(material as usize) {
            Ok(test) => test,
            Err(e) => {
                let image = self.add(Image::broken(format!("texture of materials[{material}]"), e.to_string()));
                let texture = AlphaTexture { image, ..AlphaTexture::default() };
                return AlphaTest { cutoff: cutoff as f32, factor: 1.0, texture: Some(texture) };
            }
        };
        let texture = test.texture.map(|texture| {
            let (source, primitive) = (mesh as usize, geometry.primitive as usize);
            let placed = self.doc.texcoords(source, primitive, texture.texcoord);
            match placed.map(|all| all.iter().map(|uv| transformed(*uv, &texture.transform)).collect()) {
                Ok(texcoords) => AlphaTexture { image: self.of(texture.image), wrap: texture.wrap, texcoords },
                Err(e) => {
                    let name = format!("images[{}] on meshes[{source}].primitives[{primitive}]", texture.image);
                    AlphaTexture { image: self.add(Image::broken(name, e.to_string())), ..AlphaTexture::default() }
                }
            }
        });
        AlphaTest { cutoff: test.cutoff as f32, factor: test.factor as f32, texture }
    }

    /// The place of a document's image.
    fn of(&mut self, image: usize) -> u32 {
        if let Some(Some(place)) = self.of_document.get(image) {
            return *place;
        }
        let place = self.add(self.doc.image(image));
        self.of_document.resize(self.of_document.len().max(image + 1), None);
        self.of_document[image] = Some(place);
        place
    }

    fn add(&mut self, image: Image) -> u32 {
        self.images.push(image);
        self.images.len() as u32 - 1
    }
}

/// A texture coordinate as it is looked up; what is no finite number counts as 0.
fn transformed(uv: [f32; 2], transform: &glam::DAffine2) -> [f32; 2] {
    let uv = transform.transform_point2(DVec2::from_array(uv.map(f64::from)));
    uv.to_array().map(|x| if (x as f32).is_finite() { x as f32 } else { 0.0 })
}
