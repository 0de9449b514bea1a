//! Images of MTL files: decoded, converted to PNG, merged and packed.

use std::path::Path;

use image::{DynamicImage, GenericImageView, ImageFormat, ImageReader, Limits};

/// Largest number of bytes that a decoded image may take.
const MOST_BYTES: u64 = 1 << 30;

/// Decodes an image by its content, or else by its extension.
///
/// # Errors
/// Says why the image cannot be read.
pub(super) fn read(file: &Path) -> Result<DynamicImage, String> {
    let mut reader = ImageReader::open(file).and_then(ImageReader::with_guessed_format).map_err(|e| e.to_string())?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    reader.decode().map_err(|e| e.to_string())
}

/// Encodes an image as PNG: 8 or 16 bits per channel, with the channels that it has.
///
/// # Errors
/// Says why the image cannot be encoded.
pub(super) fn png(image: &DynamicImage) -> Result<Vec<u8>, String> {
    let deep = match image {
        DynamicImage::ImageRgb32F(_) => Some(DynamicImage::from(image.to_rgb16())),
        DynamicImage::ImageRgba32F(_) => Some(DynamicImage::from(image.to_rgba16())),
        _ => None,
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    deep.as_ref().unwrap_or(image).write_to(&mut bytes, ImageFormat::Png).map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

/// A channel of an image that a statement of one number selects (`-imfchan`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Channel {
    /// Alpha if the image is not opaque everywhere, otherwise luminance.
    #[default]
    Usual,
    Red,
    Green,
    Blue,
    Alpha,
    Luminance,
}

/// One number per pixel.
#[derive(Clone, Debug)]
pub(super) struct Grey {
    pub(super) size: (u32, u32),
    pub(super) values: Vec<u8>,
}

impl Grey {
    /// Returns a channel of an image.
    pub(super) fn of(image: &DynamicImage, channel: Channel) -> Grey {
        let size = image.dimensions();
        let rgba = || image.to_rgba8().into_raw();
        let pick = |at: usize| rgba().iter().skip(at).step_by(4).copied().collect();
        let has_alpha = || image.color().has_alpha() && rgba().iter().skip(3).step_by(4).any(|&alpha| alpha < 255);
        let values = match channel {
            Channel::Red => pick(0),
            Channel::Green => pick(1),
            Channel::Blue => pick(2),
            Channel::Alpha => pick(3),
            Channel::Usual if has_alpha() => pick(3),
            Channel::Usual | Channel::Luminance => image.to_luma8().into_raw(),
        };
        Grey { size, values }
    }

    /// The value at the pixel of another size that lies there.
    fn at(&self, x: u32, y: u32, size: (u32, u32)) -> u8 {
        let scaled = |at: u32, from: u32, to: u32| (u64::from(at) * u64::from(to) / u64::from(from)) as usize;
        let (x, y) = (scaled(x, size.0, self.size.0), scaled(y, size.1, self.size.1));
        self.values[y * self.size.0 as usize + x]
    }

    /// Returns the values converted.
    pub(super) fn map(mut self, convert: impl Fn(u8) -> u8) -> Grey {
        self.values.iter_mut().for_each(|value| *value = convert(*value));
        self
    }

    /// Whether less than half of the values lie between black and white.
    pub(super) fn is_cut_out(&self) -> bool {
        self.values.iter().filter(|value| (32..224).contains(*value)).count() * 2 < self.values.len()
    }
}

/// The larger of two sizes, along each side.
fn larger(a: (u32, u32), b: (u32, u32)) -> (u32, u32) {
    (a.0.max(b.0), a.1.max(b.1))
}

/// Returns an image with another alpha; white if there is none. The smaller of both is enlarged.
pub(super) fn with_alpha(color: Option<&DynamicImage>, alpha: &Grey) -> DynamicImage {
    let size = color.map_or(alpha.size, |color| larger(color.dimensions(), alpha.size));
    let pixel = |x: u32, y: u32| {
        let [r, g, b] = color.map_or([255; 3], |color| {
            let from = color.dimensions();
            let scaled = |at: u32, side: u32, of: u32| (u64::from(at) * u64::from(of) / u64::from(side)) as u32;
            let image::Rgba([r, g, b, _]) = color.get_pixel(scaled(x, size.0, from.0), scaled(y, size.1, from.1));
            [r, g, b]
        });
        image::Rgba([r, g, b, alpha.at(x, y, size)])
    };
    DynamicImage::from(image::RgbaImage::from_fn(size.0, size.1, pixel))
}

/// Returns an image of 8 bits per channel whose colours are `base` plus `gain` times those of another.
pub(super) fn with_levels(image: &DynamicImage, [base, gain]: [f64; 2]) -> DynamicImage {
    let mut out = image.to_rgba16();
    for pixel in out.pixels_mut() {
        for value in &mut pixel.0[..3] {
            let level = base + gain * f64::from(*value) / f64::from(u16::MAX);
            *value = (level.clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16;
        }
    }
    let out = DynamicImage::from(out);
    if image.color().has_alpha() { out.to_rgba8().into() } else { out.to_rgb8().into() }
}

/// Packs roughness and metalness into the green and blue channel, where glTF has them; 1 for a missing one.
pub(super) fn packed(rough: Option<&Grey>, metal: Option<&Grey>) -> DynamicImage {
    let size = larger(rough.map_or((1, 1), |grey| grey.size), metal.map_or((1, 1), |grey| grey.size));
    let value = |grey: Option<&Grey>, x: u32, y: u32| grey.map_or(255, |grey| grey.at(x, y, size));
    let pixel = |x: u32, y: u32| image::Rgb([255, value(rough, x, y), value(metal, x, y)]);
    DynamicImage::from(image::RgbImage::from_fn(size.0, size.1, pixel))
}

/// Whether the colours are those of a normal map in tangent space: unit vectors, most of which point outward.
pub(super) fn is_normal_map(image: &DynamicImage) -> bool {
    /// Number of pixels to look at.
    const SAMPLE: usize = 1 << 14;
    let pixels = image.to_rgb8();
    let step = (pixels.len() / 3 / SAMPLE).max(1);
    let (mut count, mut unit, mut outward) = (0usize, 0usize, 0usize);
    for pixel in pixels.pixels().step_by(step) {
        let [x, y, z] = pixel.0.map(|c| f64::from(c) / 127.5 - 1.0);
        count += 1;
        unit += usize::from(((x * x + y * y + z * z).sqrt() - 1.0).abs() < 0.2);
        outward += usize::from(z > 0.3 && z > x.abs().max(y.abs()) * 0.7);
    }
    count > 0 && unit * 10 >= count * 8 && outward * 10 >= count * 8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: &[[u8; 3]]) -> DynamicImage {
        image::RgbImage::from_raw(pixels.len() as u32, 1, pixels.concat()).map(DynamicImage::from).expect("a row")
    }

    #[test]
    fn normal_maps_are_told_from_heights_by_their_colours() {
        assert!(is_normal_map(&image(&[[128, 128, 255], [160, 120, 240], [128, 128, 255]])));
        for heights in [[[255; 3], [200; 3], [0; 3]], [[90, 90, 200], [10, 10, 60], [0, 0, 255]]] {
            assert!(!is_normal_map(&image(&heights)), "{heights:?}");
        }
    }

    #[test]
    fn smaller_image_is_enlarged() {
        let grey = |values: &[u8]| Grey { size: (values.len() as u32, 1), values: values.to_vec() };
        let both = packed(Some(&grey(&[10, 20, 30, 40])), Some(&grey(&[1, 2]))).to_rgb8().into_raw();
        assert_eq!(both, [255, 10, 1, 255, 20, 1, 255, 30, 2, 255, 40, 2]);
        assert_eq!(packed(None, Some(&grey(&[7]))).to_rgb8().into_raw(), [255, 255, 7]);
        let cut = with_alpha(Some(&image(&[[1, 2, 3]])), &grey(&[0, 255])).to_rgba8().into_raw();
        assert_eq!(cut, [1, 2, 3, 0, 1, 2, 3, 255]);
    }
}
