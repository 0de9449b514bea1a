//! Colours: scales for values, palettes for groups, and the conversion between light and sRGB.

use glam::Vec3;

/// Red, green and blue, sRGB.
pub(super) type Rgb = [u8; 3];

/// Colours from small to large values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ColourMap {
    /// Blue, cyan, yellow, red: the thesis's first scheme. Its brightness does not grow with the value.
    Jet,
    /// Dark blue to yellow, alike for people with and without colour blindness: the thesis's second scheme.
    Cividis,
    /// Dark violet to yellow, of evenly growing brightness.
    #[default]
    Viridis,
}

impl ColourMap {
    /// All of them, in the order of their declaration.
    pub const ALL: [ColourMap; 3] = [ColourMap::Jet, ColourMap::Cividis, ColourMap::Viridis];

    /// Returns the name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            ColourMap::Jet => "jet",
            ColourMap::Cividis => "cividis",
            ColourMap::Viridis => "viridis",
        }
    }

    /// Returns the colour of a value from 0 to 1; others count as the nearer end, NaN as 0.
    pub fn at(self, value: f64) -> [u8; 3] {
        let t = if value > 0.0 { value.min(1.0) } else { 0.0 };
        match self {
            ColourMap::Jet => [3.0, 2.0, 1.0].map(|middle| byte(1.5 - (4.0 * t - middle).abs())),
            ColourMap::Cividis => CIVIDIS.map(|terms| byte(polynomial(&terms, t) / 255.0)),
            ColourMap::Viridis => VIRIDIS.map(|terms| byte(polynomial(&terms, t))),
        }
    }
}

/// J. Nuñez, C. Anderton, R. Renslow, "Optimizing colormaps with consideration for color vision deficiency to enable
/// accurate interpretation of scientific data", PLOS ONE 13(7), 2018; polynomials for red, green and blue as in
/// d3-scale-chromatic.
const CIVIDIS: [[f64; 7]; 3] = [
    [-4.54, -35.34, 2381.73, -6402.7, 7024.72, -2710.57, 0.0],
    [32.49, 170.73, 52.82, -131.46, 176.58, -67.37, 0.0],
    [81.24, 442.36, -2482.43, 6167.24, -6614.94, 2475.67, 0.0],
];

/// S. van der Walt, N. Smith, "A Better Default Colormap for Matplotlib", 2015; polynomials fitted by M. Zucker.
const VIRIDIS: [[f64; 7]; 3] = [
    [0.277_727, 0.105_093, -0.330_862, -4.634_230, 6.228_270, 4.776_385, -5.435_456],
    [0.005_407, 1.404_614, 0.214_848, -5.799_101, 14.179_933, -13.745_145, 4.645_853],
    [0.334_100, 1.384_590, 0.095_095, -19.332_441, 56.690_553, -65.353_033, 26.312_435],
];

fn polynomial(terms: &[f64], t: f64) -> f64 {
    terms.iter().rev().fold(0.0, |sum, term| sum * t + term)
}

fn byte(x: f64) -> u8 {
    (255.0 * x.clamp(0.0, 1.0)).round() as u8
}

/// Returns the sRGB colour of a light, after IEC 61966-2-1. Above 0.8 it approaches white without reaching it.
pub(super) fn encoded(light: Vec3) -> Rgb {
    light.to_array().map(|x| {
        let x = if x > 0.8 { 0.8 + 0.2 * (1.0 - (-(x - 0.8) / 0.2).exp()) } else { x.max(0.0) };
        let curve = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        (255.0 * curve).round() as u8
    })
}

/// Returns the light of a channel of an sRGB colour, 0 to 1.
pub(super) fn decoded(channel: u8) -> f32 {
    let x = f32::from(channel) / 255.0;
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// Returns the light of a colour by lightness (0 to 1), chroma and hue (in turns), after B. Ottosson, "A perceptual
/// color space for image processing", 2020.
pub(super) fn of_hue(lightness: f32, chroma: f32, hue: f32) -> Vec3 {
    let (sin, cos) = (std::f32::consts::TAU * hue).sin_cos();
    let (a, b) = (chroma * cos, chroma * sin);
    let cubed = |x: f32| x * x * x;
    let l = cubed(lightness + 0.396_337_78 * a + 0.215_803_76 * b);
    let m = cubed(lightness - 0.105_561_346 * a - 0.063_854_17 * b);
    let s = cubed(lightness - 0.089_484_18 * a - 1.291_485_5 * b);
    let light = Vec3::new(
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_93 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_4 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    );
    light.clamp(Vec3::ZERO, Vec3::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_begin_and_end_with_their_published_colours() {
        let near = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 4);
        for (map, first, last) in [
            (ColourMap::Jet, [0, 0, 128], [128, 0, 0]),
            (ColourMap::Cividis, [0, 32, 81], [254, 232, 69]),
            (ColourMap::Viridis, [68, 1, 84], [253, 231, 37]),
        ] {
            assert!(near(map.at(0.0), first) && near(map.at(1.0), last), "{map:?} {:?} {:?}", map.at(0.0), map.at(1.0));
            assert_eq!([map.at(-1.0), map.at(2.0), map.at(f64::NAN)], [map.at(0.0), map.at(1.0), map.at(0.0)]);
        }
    }

    #[test]
    fn light_is_encoded_as_it_is_decoded() {
        for channel in [0, 1, 10, 60, 128, 200] {
            let light = Vec3::splat(decoded(channel));
            assert_eq!(encoded(light), [channel; 3]);
        }
        assert_eq!(encoded(Vec3::new(-1.0, 100.0, f32::NAN)), [0, 255, 0]);
    }

    #[test]
    fn hues_without_chroma_are_grey() {
        let grey = encoded(of_hue(0.7, 0.0, 0.3));
        assert!(grey[0].abs_diff(grey[1]) <= 1 && grey[1].abs_diff(grey[2]) <= 1, "{grey:?}");
        assert_ne!(encoded(of_hue(0.7, 0.12, 0.0)), encoded(of_hue(0.7, 0.12, 0.5)));
    }
}
