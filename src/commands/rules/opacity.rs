//! RK007: the opaque flag wherever possible, and opaque and alpha-tested triangles apart (NVIDIA, "Best Practices for Using
//! NVIDIA RTX Ray Tracing", updated 2022; Arm): opaque geometry leaves the traversal without a shader.
//!
//! A material is opaque all the same if neither factor, texture nor vertex colours can make its alpha less than 1 or its
//! cutoff. Of textures only the format counts: JPEG, and PNG without alpha; pixels are not decoded.

use std::collections::BTreeMap;

use super::{Subject, area_scale};
use crate::report::{Broken, Finding, Objects};
use crate::scene::{Geometry, Mesh, Opacity};

/// Triangles that are not opaque are reported from this many any-hit calls per ray through the core on.
const LEAST_CALLS: f64 = 0.01;

/// Finds triangles that are not opaque, and materials that are so in truth.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let (mut objects, mut placed, mut not_opaque) = (Objects::default(), 0.0, 0.0);
    let mut materials: BTreeMap<u32, bool> = BTreeMap::new();
    for i in subject.still() {
        let instance = &subject.scene.instances[i.0 as usize];
        let mesh = &subject.scene.meshes[instance.mesh.0 as usize];
        let scale = area_scale(&instance.transform.matrix3);
        let of_mesh = mesh.geometries.iter().zip(subject.shapes.of_mesh(instance.mesh.0 as usize));
        let mut has_any = false;
        for (geometry, areas) in of_mesh {
            placed += areas.area * scale;
            if geometry.opacity != Opacity::Opaque {
                has_any = true;
                not_opaque += areas.area * scale;
                note_material(subject, mesh, geometry, &mut materials);
            }
        }
        if has_any {
            objects.add(|| subject.name(i));
        }
    }
    let opaque_all_the_same: Vec<String> =
        materials.into_iter().filter(|&(_, opaque)| opaque).map(|(material, _)| name(subject, material)).collect();
    let per_ray = subject.share(2.0 * not_opaque);
    if opaque_all_the_same.is_empty() && per_ray < LEAST_CALLS || objects.is_empty() {
        return Vec::new();
    }
    let area_ratio = if placed > 0.0 { not_opaque / placed } else { 0.0 };
    vec![Finding::new(objects, &Broken::NotOpaque { area_ratio, per_ray, opaque_all_the_same })]
}

/// Notes whether a geometry's material is opaque all the same: it is if that holds wherever it is used.
fn note_material(subject: &Subject, mesh: &Mesh, geometry: &Geometry, materials: &mut BTreeMap<u32, bool>) {
    let Some(material) = geometry.material else { return };
    let colours = || {
        let attributes = subject.doc.attributes(mesh.source as usize, geometry.primitive as usize);
        attributes.iter().any(|attribute| attribute.name.starts_with("COLOR_"))
    };
    match materials.get_mut(&material) {
        Some(opaque) => *opaque = *opaque && !colours(),
        None => drop(materials.insert(material, is_opaque(subject, material, geometry.opacity) && !colours())),
    }
}

/// Whether factor and texture let every hit count.
fn is_opaque(subject: &Subject, material: u32, opacity: Opacity) -> bool {
    let Ok(test) = subject.doc.alpha_test(material as usize) else { return false };
    let least = match opacity {
        Opacity::Opaque => return true,
        Opacity::Mask { cutoff } => cutoff,
        Opacity::Blend => 1.0,
    };
    let has_no_alpha = |image: usize| subject.doc.image(image).read().is_ok_and(|bytes| lacks_alpha(&bytes));
    test.factor >= least && test.texture.is_none_or(|texture| has_no_alpha(texture.image))
}

/// Whether an encoded image cannot have alpha: a JPEG, or a PNG of grey or colours without a transparent one (PNG
/// specification, sections 11.2.1 and 11.3.1.1).
fn lacks_alpha(image: &[u8]) -> bool {
    const JPEG: [u8; 3] = [0xff, 0xd8, 0xff];
    const PNG: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
    let colour_type = image.get(25);
    let transparent = || image.windows(4).take_while(|chunk| *chunk != b"IDAT").any(|chunk| chunk == b"tRNS");
    image.starts_with(&JPEG) || image.starts_with(&PNG) && matches!(colour_type, Some(0 | 2)) && !transparent()
}

fn name(subject: &Subject, material: u32) -> String {
    let named = subject.scene.materials[material as usize].name.clone().filter(|name| !name.is_empty());
    named.unwrap_or_else(|| format!("material {material}"))
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_with_triangle;
    use super::*;
    use crate::report::Severity;

    /// A triangle with a material of these properties.
    fn found(material: &str) -> Option<Finding> {
        let rest = format!(
            r#""nodes": [{{"mesh": 0, "name": "leaf"}}], "materials": [{{"name": "green", {material}}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "material": 0}}]}}]"#
        );
        found_with_triangle(&rest, check)
    }

    #[test]
    fn materials_that_are_opaque_all_the_same_are_named() {
        for mode in [r#""alphaMode": "MASK""#, r#""alphaMode": "BLEND""#] {
            let finding = found(mode).expect("a finding");
            assert_eq!((finding.rule.id(), finding.severity), ("RK007", Severity::Warning));
            assert!(finding.message.ends_with("in the material `green`"), "{}", finding.message);
            assert_eq!(finding.cost.per_ray, Some(0.5));
        }
    }

    #[test]
    fn what_is_transparent_is_a_note() {
        let finding = found(r#""alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}"#);
        assert_eq!(finding.map(|f| (f.severity, f.count)), Some((Severity::Note, 1)));
    }

    #[test]
    fn what_is_opaque_is_left_alone() {
        assert_eq!(found(r#""alphaMode": "OPAQUE""#), None);
    }

    #[test]
    fn images_without_alpha_are_told_by_their_heads() {
        let png = |colour: u8, chunk: &[u8]| {
            [&b"\x89PNG\r\n\x1a\n"[..], &[0; 17], &[colour, 0, 0, 0], chunk, b"IDAT"].concat()
        };
        assert!(lacks_alpha(&[0xff, 0xd8, 0xff, 0xe0]) && lacks_alpha(&png(2, b"")));
        assert!(!lacks_alpha(&png(6, b"")) && !lacks_alpha(&png(2, b"tRNS")) && !lacks_alpha(b"webp"));
    }
}
