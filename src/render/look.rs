//! What a scene looks like: materials, decoded textures, and attributes of vertices.

use std::collections::{BTreeSet, HashMap};

use glam::{DMat3, DVec2, DVec3, Vec3, Vec4};
use raykiln_formats::Document;
use raykiln_formats::document::Attribute;
use rayon::prelude::*;

use super::material::{Material, Texture, of_geometries};
use super::surface::Spot;
use super::texture::{BadImage, Texels};
use crate::scene::{Geometry, Mesh, Opacity, Scene};

/// Texels of all images together: they take four bytes each.
const MOST_TEXELS: usize = 1 << 27;
/// Texels of one image.
const MOST_TEXELS_PER_IMAGE: usize = 1 << 22;

/// What the surfaces of a scene look like.
pub(super) struct Looks<'a> {
    materials: HashMap<Option<u32>, Material>,
    /// By image of the document.
    images: HashMap<usize, Texels>,
    bad_images: Vec<BadImage>,
    /// By mesh and geometry.
    attributes: Vec<Vec<Attributes<'a>>>,
    /// By instance, what turns normals into the world.
    normals_to_world: Vec<DMat3>,
}

/// The attributes of a geometry's vertices.
struct Attributes<'a> {
    normal: Option<Attribute<'a>>,
    colour: Option<Attribute<'a>>,
    /// By the number of `TEXCOORD_n`.
    coordinates: Vec<(usize, Attribute<'a>)>,
}

/// How a point of a surface looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Look {
    /// Linear base colour.
    pub(super) base: Vec3,
    /// Share of the surface that is there: 1 unless the material is blended.
    pub(super) alpha: f32,
    pub(super) metallic: f32,
    pub(super) roughness: f32,
    pub(super) emission: Vec3,
    pub(super) transmission: f32,
    pub(super) is_unlit: bool,
    /// Unit normal for shading, on the side that the ray comes from.
    pub(super) normal: Vec3,
}

impl<'a> Looks<'a> {
    /// Reads what the surfaces of a scene look like. Images that cannot be read are listed. Meshes of no document are white.
    pub(super) fn of(doc: &'a Document, scene: &Scene) -> Looks<'a> {
        let of_document = scene.meshes.iter().filter(|mesh| mesh.source != Mesh::ELSEWHERE);
        let geometries = of_document.flat_map(|mesh| &mesh.geometries);
        let materials = of_geometries(doc, geometries.map(|g| (g.material, &g.opacity)));
        let wanted: BTreeSet<usize> = materials.values().flat_map(Material::textures).map(|t| t.image).collect();
        let most = (MOST_TEXELS / wanted.len().max(1)).min(MOST_TEXELS_PER_IMAGE);
        let read = |image: usize| {
            let encoded = doc.image(image);
            let decoded = encoded.read().and_then(|bytes| Texels::decode(&bytes, most));
            (image, decoded.map_err(|reason| BadImage { image: encoded.name, reason }))
        };
        let decoded: Vec<_> = wanted.into_par_iter().map(read).collect();
        let mut looks = Looks {
            attributes: scene.meshes.iter().map(|mesh| of_mesh(doc, mesh, &materials)).collect(),
            materials,
            images: HashMap::new(),
            bad_images: Vec::new(),
            normals_to_world: scene.instances.iter().map(|i| i.transform.matrix3.inverse().transpose()).collect(),
        };
        for (image, decoded) in decoded {
            match decoded {
                Ok(texels) => drop(looks.images.insert(image, texels)),
                Err(bad) => looks.bad_images.push(bad),
            }
        }
        looks
    }

    pub(super) fn bad_images(&self) -> &[BadImage] {
        &self.bad_images
    }

    /// Whether rays pass through some points of a geometry.
    pub(super) fn lets_through(&self, geometry: &Geometry) -> bool {
        geometry.opacity != Opacity::Opaque
            || self.materials.get(&geometry.material).is_some_and(|material| material.transmission > 0.0)
    }

    /// Returns base colour and alpha of a point; an alpha test makes the alpha 0 or 1.
    pub(super) fn base(&self, spot: &Spot) -> Vec4 {
        let Some(material) = self.materials.get(&spot.geometry.material) else { return Vec4::ONE };
        let attributes = &self.attributes[spot.mesh as usize][spot.index];
        let mut base = Vec4::from_array(material.base) * attributes.colour_at(spot);
        if let Some(texel) = self.texel(&material.base_texture, attributes, spot) {
            base *= texel;
        }
        base.w = match material.opacity {
            Opacity::Opaque => 1.0,
            Opacity::Mask { cutoff } => f32::from(u8::from(f64::from(base.w) >= cutoff)),
            Opacity::Blend => base.w.clamp(0.0, 1.0),
        };
        base
    }

    /// Returns how a point looks.
    pub(super) fn at(&self, spot: &Spot) -> Look {
        let base = self.base(spot);
        let normal = self.shading_normal(spot);
        let plain = Look {
            base: base.truncate().clamp(Vec3::ZERO, Vec3::ONE),
            alpha: base.w,
            metallic: 0.0,
            roughness: 1.0,
            emission: Vec3::ZERO,
            transmission: 0.0,
            is_unlit: false,
            normal,
        };
        let Some(material) = self.materials.get(&spot.geometry.material) else { return plain };
        let attributes = &self.attributes[spot.mesh as usize][spot.index];
        let surface = self.encoded_texel(&material.surface_texture, attributes, spot).unwrap_or(Vec3::ONE);
        let emitted = self.texel(&material.emission_texture, attributes, spot).unwrap_or(Vec4::ONE).truncate();
        Look {
            metallic: (material.metallic * surface.z).clamp(0.0, 1.0),
            roughness: (material.roughness * surface.y).clamp(0.0, 1.0),
            emission: (material.emission * emitted).max(Vec3::ZERO),
            transmission: material.transmission.clamp(0.0, 1.0),
            is_unlit: material.is_unlit,
            ..plain
        }
    }

    /// Returns the normal that the file states for a point, in world coordinates, on whichever side; `None` if it states
    /// none.
    pub(super) fn stated_normal(&self, spot: &Spot) -> Option<DVec3> {
        let normals = self.attributes[spot.mesh as usize][spot.index].normal.as_ref()?;
        let mean = spot.mean(|v| vector(normals.numbers(v)).truncate());
        (self.normals_to_world[spot.instance as usize] * mean.as_dvec3()).try_normalize().filter(|n| n.is_finite())
    }

    fn shading_normal(&self, spot: &Spot) -> Vec3 {
        let stated = self.stated_normal(spot).unwrap_or(spot.normal);
        if stated.dot(spot.normal) < 0.0 { -stated.as_vec3() } else { stated.as_vec3() }
    }

    fn texel(&self, texture: &Option<Texture>, attributes: &Attributes, spot: &Spot) -> Option<Vec4> {
        let texture = texture.as_ref()?;
        let image = self.images.get(&texture.image)?;
        let (_, coordinates) = attributes.coordinates.iter().find(|(set, _)| *set == texture.set)?;
        let corner = |v: u32| DVec2::from_slice(&coordinates.numbers(v)[..2]);
        let [a, b, c] = spot.vertices.map(corner);
        let mean = a * spot.weights[0] + b * spot.weights[1] + c * spot.weights[2];
        let place = texture.transform.transform_point2(mean);
        place.is_finite().then(|| image.at(place.to_array(), texture.sampler))
    }

    /// Returns the channels of a texture that holds numbers, not colours.
    fn encoded_texel(&self, texture: &Option<Texture>, attributes: &Attributes, spot: &Spot) -> Option<Vec3> {
        let light = self.texel(texture, attributes, spot)?.truncate();
        Some(light.map(|x| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }))
    }
}

impl Attributes<'_> {
    /// Returns the mean colour of the vertices; white without colours.
    fn colour_at(&self, spot: &Spot) -> Vec4 {
        let Some(colour) = &self.colour else { return Vec4::ONE };
        let [a, b, c] = spot.vertices.map(|v| vector(colour.numbers(v)));
        let mean = a * spot.weights[0] as f32 + b * spot.weights[1] as f32 + c * spot.weights[2] as f32;
        if mean.is_finite() { mean } else { Vec4::ONE }
    }
}

fn vector(numbers: [f64; 4]) -> Vec4 {
    Vec4::from_array(numbers.map(|x| x as f32))
}

fn of_mesh<'a>(doc: &'a Document, mesh: &Mesh, materials: &HashMap<Option<u32>, Material>) -> Vec<Attributes<'a>> {
    let of_geometry = |geometry: &Geometry| {
        let used = materials.get(&geometry.material).into_iter().flat_map(Material::textures);
        let sets: BTreeSet<usize> = used.map(|texture| texture.set).collect();
        let mut attributes = Attributes { normal: None, colour: None, coordinates: Vec::new() };
        let is_known = mesh.source != Mesh::ELSEWHERE;
        let all = is_known.then(|| doc.attributes(mesh.source as usize, geometry.primitive as usize));
        for attribute in all.into_iter().flatten() {
            let components = attribute.element.components;
            match attribute.name.as_str() {
                "NORMAL" if components == 3 => attributes.normal = Some(attribute),
                "COLOR_0" if components >= 3 => attributes.colour = Some(attribute),
                name if components == 2 => {
                    let set = name.strip_prefix("TEXCOORD_").and_then(|n| n.parse().ok());
                    let set = set.filter(|set| sets.contains(set));
                    attributes.coordinates.extend(set.map(|set| (set, attribute)));
                }
                _ => {}
            }
        }
        attributes
    };
    mesh.geometries.iter().map(of_geometry).collect()
}
