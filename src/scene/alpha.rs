//! Alpha tests of geometries, taken from the document.

use std::path::Path;

use glam::DVec2;
use raykiln_formats::Document;
pub use raykiln_formats::alpha::{Image, Wrap};

use super::{Geometry, Opacity, Scene};

/// The alpha test of a geometry with an alpha-tested material.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlphaTest {
    /// Smallest alpha that counts as a hit.
    pub cutoff: f32,
    /// Factor applied to the texture's alpha, or the alpha itself if there is no texture.
    pub factor: f32,
    /// The texture that the alpha comes from.
    pub texture: Option<AlphaTexture>,
}

/// A texture on a geometry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlphaTexture {
    /// Index into [`Scene::images`].
    pub image: u32,
    /// Wrapping mode outside 0 to 1, per axis.
    pub wrap: [Wrap; 2],
    /// Texture coordinates of each vertex, finite, with `KHR_texture_transform` applied. Empty if the image is
    /// unavailable.
    pub texcoords: Vec<[f32; 2]>,
}

/// Attaches alpha tests to the geometries of alpha-tested materials, and their images to the scene. Faults of a texture
/// are reported when its image is read.
pub(super) fn attach(doc: &Document, scene: &mut Scene) {
    let mut images = Images { doc, images: Vec::new(), of_document: Vec::new() };
    for mesh in scene.meshes.iter_mut() {
        for geometry in &mut mesh.geometries {
            if let (Opacity::Mask { cutoff }, Some(material)) = (geometry.opacity, geometry.material) {
                geometry.alpha = Some(images.test(mesh.source, geometry, material, cutoff));
            }
        }
    }
    scene.images = images.images;
}

impl Scene {
    /// Searches for images stored as files below the folder `from` also below `to`, for a document that is read from a
    /// different place than the one it is meant for.
    pub fn also_look_for_images(&mut self, from: &Path, to: &Path) {
        self.images.iter_mut().for_each(|image| image.also_look(from, to));
    }
}

struct Images<'d> {
    doc: &'d Document,
    images: Vec<Image>,
    /// For each image of the document, its index in `images`.
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

    /// Returns the index of an image of the document.
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

/// Transforms a texture coordinate for lookup; components that are not finite become 0.
fn transformed(uv: [f32; 2], transform: &glam::DAffine2) -> [f32; 2] {
    let uv = transform.transform_point2(DVec2::from_array(uv.map(f64::from)));
    uv.to_array().map(|x| if (x as f32).is_finite() { x as f32 } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use serde_json::{Value, json};

    use super::super::{LoadOptions, load};
    use super::*;

    /// The textured sample with a change to its JSON.
    fn sample(change: impl FnOnce(&mut Value)) -> (Document, Scene) {
        let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("samples/textured/scene.gltf");
        let mut doc = raykiln_formats::read(&file).expect("the sample is read");
        change(&mut doc.json);
        let (scene, _) = load(&doc, &LoadOptions::default()).expect("the sample is sound");
        assert_eq!(scene.check(), Ok(()));
        (doc, scene)
    }

    fn mask(json: &mut Value) {
        json["materials"][0]["alphaMode"] = "MASK".into();
    }

    fn texture(scene: &Scene) -> &AlphaTexture {
        let alpha = scene.meshes[0].geometries[0].alpha.as_ref().expect("it is alpha-tested");
        alpha.texture.as_ref().expect("it is textured")
    }

    #[test]
    fn only_alpha_tested_geometries_carry_a_test() {
        for mode in ["OPAQUE", "BLEND"] {
            let (_, scene) = sample(|json| json["materials"][0]["alphaMode"] = mode.into());
            assert!(scene.images.is_empty());
            assert!(scene.meshes.iter().flat_map(|m| &m.geometries).all(|g| g.alpha.is_none()), "{mode}");
        }
        let (doc, scene) = sample(mask);
        assert_eq!(scene.images.len(), 1, "one image for all geometries");
        let alpha = scene.meshes[0].geometries[0].alpha.as_ref().expect("it is alpha-tested");
        assert_eq!((alpha.cutoff, alpha.factor), (0.5, 1.0));
        assert_eq!(Ok(&texture(&scene).texcoords), doc.texcoords(0, 0, 0).as_ref().map_err(|_| ()));
        let bytes = scene.images[0].read().expect("the file is there");
        assert!(bytes.starts_with(b"\x89PNG") && scene.images[0].name == "images[0] `brick wall.png`");
    }

    #[test]
    fn coordinates_are_transformed_and_finite() {
        let (plain, _) = sample(mask);
        let (_, scene) = sample(|json| {
            mask(json);
            json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = json!({
                "KHR_texture_transform": {"offset": [0.25, -0.5], "scale": [2, 3], "rotation": std::f64::consts::FRAC_PI_2}
            });
        });
        let plain = plain.texcoords(0, 0, 0).expect("it has some");
        for (uv, [u, v]) in texture(&scene).texcoords.iter().zip(plain) {
            // A counter-clockwise quarter turn with v pointing down maps (u, v) to (v, -u).
            let expected = [3.0 * v + 0.25, -2.0 * u - 0.5];
            assert!((uv[0] - expected[0]).abs() < 1e-6 && (uv[1] - expected[1]).abs() < 1e-6, "{uv:?} {expected:?}");
        }
        let identity = glam::DAffine2::IDENTITY;
        assert_eq!(transformed([f32::NAN, f32::INFINITY], &identity), [0.0, 0.0]);
        assert_eq!(transformed([1e30, -1e-30], &identity), [1e30, -1e-30]);
    }

    #[test]
    fn what_is_wrong_with_a_texture_is_told_when_it_is_read() {
        let reason = |change: &dyn Fn(&mut Value)| {
            let (_, scene) = sample(|json| {
                mask(json);
                change(json);
            });
            texture(&scene);
            scene.images[0].read().expect_err("it is broken")
        };
        let uri = reason(&|json| json["images"][0]["uri"] = "lost.png".into());
        assert!(uri.contains("lost.png cannot be read"), "{uri}");
        let scheme = reason(&|json| json["images"][0]["uri"] = "https://example.com/a.png".into());
        assert!(scheme.contains("scheme https"), "{scheme}");
        let texture = reason(&|json| json["textures"] = json!([]));
        assert!(texture.contains("textures[0] does not exist"), "{texture}");
        let info = json!({"index": 0, "texCoord": 7});
        let set = reason(&|json| json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = info.clone());
        assert!(set.contains("TEXCOORD_7"), "{set}");
        let sampler = reason(&|json| json["samplers"][0]["wrapT"] = 7.into());
        assert!(sampler.contains("no wrapping mode 7"), "{sampler}");
    }

    #[test]
    fn images_beside_the_final_place_are_found() {
        let (from, to) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
        let mut doc = sample(mask).0;
        doc.path = from.path().join("scene.gltf");
        let (mut scene, _) = load(&doc, &LoadOptions::default()).expect("the sample is sound");
        std::fs::write(to.path().join("brick wall.png"), "there").expect("writable");
        assert!(scene.images[0].read().is_err());
        scene.also_look_for_images(from.path(), to.path());
        assert_eq!(scene.images[0].read().as_deref(), Ok(&b"there"[..]));
        std::fs::write(from.path().join("brick wall.png"), "here").expect("writable");
        assert_eq!(scene.images[0].read().as_deref(), Ok(&b"here"[..]));
    }
}
