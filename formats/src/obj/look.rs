//! What MTL says of the look of a surface beyond its diffuse colour: mirrors, metals and glass.

use super::library::Definition;
use super::text::words;

/// What `illum`, `Ks` and `Tf` say of a material beyond its diffuse colour.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Look {
    /// The base colour, if it is not `Kd`.
    pub(super) base: Option<[f32; 3]>,
    /// Metalness of a mirror.
    pub(super) metallic: Option<f32>,
    /// The share of light that glass lets through.
    pub(super) transmission: Option<f32>,
    /// Roughness, if it is not that of a Phong highlight.
    pub(super) roughness: Option<f32>,
}

/// Colours below this are black.
const BLACK: f32 = 0.04;

impl Look {
    /// Tells mirrors, metals and glass; only materials that are `textured` use their maps.
    pub(super) fn of(definition: &Definition, textured: bool) -> Look {
        let values = &definition.values;
        let illum = values.illumination_model.unwrap_or(2);
        let has_map = textured && values.diffuse_texture.is_some();
        let (kd, ks) =
            (values.diffuse.map(single).unwrap_or([1.0; 3]), values.specular.map(single).unwrap_or([0.0; 3]));
        let most = |color: [f32; 3]| color.into_iter().fold(0.0, f32::max);
        if let Some(glass) = Look::glass(definition, illum, has_map) {
            return glass;
        }
        let is_mirror = matches!(illum, 3 | 5) && most(ks) > most(kd) && !has_map;
        // Polished metal in the Phong model: nothing but a highlight, which glTF would show black.
        let is_metal = most(kd) < BLACK && most(ks) >= 0.25 && !has_map;
        let sharp = sharp_roughness(values.shininess.map(|exponent| exponent as f32));
        if is_mirror || is_metal {
            // `illum 5` asks for traced reflections, which are perfect whatever the highlight.
            let roughness = match illum {
                5 => Some(0.0),
                3 => Some(sharp),
                _ => None,
            };
            return Look { base: Some(ks), metallic: Some(1.0), roughness, transmission: None };
        }
        // Blender writes the metalness into `Ka` of materials with `illum 3`; other programs write 1, but seldom beside
        // Blender's usual `Ks`.
        let is_metalness = |[r, g, b]: &[f32; 3]| r == g && g == b && *r > 0.0 && (*r < 1.0 || ks == [0.5; 3]);
        let blender = values.ambient.map(single).filter(|ka| illum == 3 && is_metalness(ka));
        let roughness = (illum == 5).then_some(sharp);
        Look { metallic: blender.map(|[metallic, ..]| metallic), roughness, ..Look::default() }
    }

    /// Glass by `illum` 4, 6, 7 and 9, which exporters also write for opaque materials.
    fn glass(definition: &Definition, illum: u8, has_map: bool) -> Option<Look> {
        let values = &definition.values;
        let filter = definition.values.unknown_param.get("Tf").and_then(|text| triple(text));
        let opacity = values.dissolve.map_or(1.0, |d| d as f32);
        let is_filtered = filter.is_some_and(|filter| filter != [1.0; 3] && filter != [0.0; 3]);
        let refracts =
            matches!(illum, 6 | 7) && (filter.is_some() || values.optical_density.is_some_and(|ior| ior > 1.0));
        if !matches!(illum, 4 | 6 | 7 | 9) || !(refracts || is_filtered || opacity < 1.0) {
            return None;
        }
        let most = |color: [f32; 3]| color.into_iter().fold(0.0, f32::max).clamp(0.0, 1.0);
        let filter = filter.filter(|filter| *filter != [0.0; 3]).unwrap_or([1.0; 3]);
        let is_black = values.diffuse.is_some_and(|kd| most(single(kd)) < BLACK);
        // Some exporters write 1 - transparency, as of the spheres of the Cornell boxes. What neither scatters nor lets
        // light through is not glass.
        let filter = if refracts && is_black && most(filter) < 0.5 { filter.map(|c| 1.0 - c) } else { filter };
        let most = most(filter);
        let transmission = if opacity < 1.0 && !refracts && !is_filtered { 1.0 - opacity } else { most };
        let base = (!has_map).then(|| filter.map(|c| (c / filter.into_iter().fold(0.0, f32::max)).clamp(0.0, 1.0)));
        // `illum 7` asks for traced refraction, which is perfect whatever the highlight.
        let roughness = if illum == 7 { 0.0 } else { sharp_roughness(values.shininess.map(|x| x as f32)) };
        Some(Look { base, metallic: None, transmission: Some(transmission), roughness: Some(roughness) })
    }
}

/// Returns a colour in single precision.
pub(super) fn single(color: [f64; 3]) -> [f32; 3] {
    color.map(|c| c as f32)
}

/// Parses three numbers; a single one stands for three.
fn triple(text: &str) -> Option<[f32; 3]> {
    let values: Vec<f32> = words(text).map_while(|word| word.parse().ok()).filter(|x: &f32| x.is_finite()).collect();
    match values[..] {
        [all] => Some([all; 3]),
        [r, g, b, ..] => Some([r, g, b]),
        _ => None,
    }
}

/// Roughness of what reflects rays: `Ns` is 1000 times the square of 1 - roughness, as Blender writes it.
fn sharp_roughness(exponent: Option<f32>) -> f32 {
    exponent.map_or(0.0, |exponent| 1.0 - (exponent.clamp(0.0, 1000.0) / 1000.0).sqrt())
}

/// Converts a Phong exponent to perceptual roughness.
///
/// The Beckmann width of a Phong lobe of exponent n is `sqrt(2 / (n + 2))` (B. Walter, S. Marschner, H. Li,
/// K. Torrance, "Microfacet Models for Refraction through Rough Surfaces", 2007); glTF's roughness is its square root.
pub(super) fn roughness(exponent: f32) -> f32 {
    (2.0 / (exponent.max(0.0) + 2.0)).sqrt().sqrt()
}
