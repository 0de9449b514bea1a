//! Images of textures, decoded.

use std::fmt;
use std::io::Cursor;

use glam::{Vec3, Vec4};
use png::{ColorType, Decoder, Limits, Transformations};
use raykiln_formats::alpha::Wrap;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::colour::decoded;
use crate::scene::webp;

/// Largest width or height of an image, in texels.
const MOST_SIDE: usize = 16_384;
/// Memory that decoding one image may take, in bytes.
const MOST_BYTES: usize = 512 << 20;

/// An image that is drawn as if it were absent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadImage {
    /// Its place in the document, and its file name if it is a file.
    pub image: String,
    /// Why it cannot be read or decoded.
    pub reason: String,
}

impl fmt::Display for BadImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; surfaces with it are drawn without it", self.image, self.reason)
    }
}

/// The texels of an image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Texels {
    size: [usize; 2],
    /// Red, green, blue (sRGB) and alpha, in rows from the top.
    rgba: Vec<[u8; 4]>,
}

/// How texels are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sampler {
    pub(super) wrap: [Wrap; 2],
    /// Whether the nearest texel is taken, instead of the mean of four.
    pub(super) nearest: bool,
}

impl Texels {
    /// Decodes a PNG, JPEG or WebP image, and halves it until it has at most `most` texels.
    ///
    /// # Errors
    /// Describes why the image cannot be decoded.
    pub(super) fn decode(bytes: &[u8], most: usize) -> Result<Texels, String> {
        let mut texels = match () {
            () if bytes.starts_with(b"\x89PNG\r\n\x1A\n") => decode_png(bytes)?,
            () if bytes.starts_with(b"\xFF\xD8\xFF") => decode_jpeg(bytes)?,
            () if webp::is_webp(bytes) => decode_webp(bytes)?,
            () => return Err("it is neither PNG nor JPEG nor WebP".into()),
        };
        while texels.rgba.len() > most.max(1) {
            texels = texels.halved();
        }
        Ok(texels)
    }

    /// Returns the image in half its size; each texel is the mean of up to four.
    fn halved(&self) -> Texels {
        let size = self.size.map(|side| side.div_ceil(2));
        let at = |x: usize, y: usize| self.rgba[y.min(self.size[1] - 1) * self.size[0] + x.min(self.size[0] - 1)];
        let mean = |i: usize| {
            let [x, y] = [2 * (i % size[0]), 2 * (i / size[0])];
            let four = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
            std::array::from_fn(|c| ((four.iter().map(|texel| u16::from(texel[c])).sum::<u16>() + 2) / 4) as u8)
        };
        Texels { size, rgba: (0..size[0] * size[1]).map(mean).collect() }
    }

    /// Returns the linear colour and alpha at a texture coordinate.
    pub(super) fn at(&self, [u, v]: [f64; 2], sampler: Sampler) -> Vec4 {
        let [width, height] = self.size.map(|side| side as f64);
        let place = [u * width - 0.5, v * height - 0.5];
        if sampler.nearest {
            return self.texel(place.map(f64::round), sampler.wrap);
        }
        let [x, y] = place.map(f64::floor);
        let [right, down] = [(place[0] - x) as f32, (place[1] - y) as f32];
        let row = |y: f64| self.texel([x, y], sampler.wrap).lerp(self.texel([x + 1.0, y], sampler.wrap), right);
        row(y).lerp(row(y + 1.0), down)
    }

    fn texel(&self, place: [f64; 2], wrap: [Wrap; 2]) -> Vec4 {
        let [x, y] = std::array::from_fn(|i| wrapped(place[i], self.size[i], wrap[i]));
        let [r, g, b, a] = self.rgba[y * self.size[0] + x];
        Vec3::new(light(r), light(g), light(b)).extend(f32::from(a) / 255.0)
    }
}

/// Returns the light of a channel of an sRGB colour from a table.
fn light(channel: u8) -> f32 {
    static TABLE: std::sync::OnceLock<[f32; 256]> = std::sync::OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| decoded(i as u8)))[channel as usize]
}

/// Returns the texel of a row or column that a whole number stands for.
fn wrapped(at: f64, side: usize, wrap: Wrap) -> usize {
    let count = side as f64;
    let inside = match wrap {
        Wrap::Repeat => at.rem_euclid(count),
        Wrap::Clamp => at.clamp(0.0, count - 1.0),
        Wrap::Mirror => {
            let around = at.rem_euclid(2.0 * count);
            if around < count { around } else { 2.0 * count - 1.0 - around }
        }
    };
    (inside as usize).min(side - 1)
}

fn decode_png(bytes: &[u8]) -> Result<Texels, String> {
    let failed = |e: png::DecodingError| e.to_string();
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: MOST_BYTES });
    decoder.set_transformations(Transformations::EXPAND | Transformations::STRIP_16);
    let mut reader = decoder.read_info().map_err(failed)?;
    let length = reader.output_buffer_size().filter(|length| *length <= MOST_BYTES).ok_or("it is too large")?;
    let mut data = vec![0; length];
    let info = reader.next_frame(&mut data).map_err(failed)?;
    let opaque = |[r, g, b]: [u8; 3]| [r, g, b, 255];
    let rgba = match info.color_type {
        ColorType::Grayscale => data.iter().map(|&g| opaque([g; 3])).collect(),
        ColorType::GrayscaleAlpha => data.chunks_exact(2).map(|c| [c[0], c[0], c[0], c[1]]).collect(),
        ColorType::Rgb | ColorType::Indexed => data.chunks_exact(3).map(|c| opaque([c[0], c[1], c[2]])).collect(),
        ColorType::Rgba => data.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect(),
    };
    sized([info.width as usize, info.height as usize], rgba)
}

fn decode_jpeg(bytes: &[u8]) -> Result<Texels, String> {
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB);
    let options = options.set_max_width(MOST_SIDE).set_max_height(MOST_SIDE);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let failed = |e: zune_jpeg::errors::DecodeErrors| format!("{e:?}");
    decoder.decode_headers().map_err(failed)?;
    let size = decoder.dimensions().ok_or("its size is not known")?;
    if size.0 * size.1 > MOST_BYTES / 4 {
        return Err("it is too large".into());
    }
    let data = decoder.decode().map_err(failed)?;
    sized([size.0, size.1], data.chunks_exact(3).map(|c| [c[0], c[1], c[2], 255]).collect())
}

fn decode_webp(bytes: &[u8]) -> Result<Texels, String> {
    let image = webp::decode(bytes, MOST_SIDE as u32)?;
    sized(image.size.map(|side| side as usize), image.rgba)
}

fn sized(size: [usize; 2], rgba: Vec<[u8; 4]>) -> Result<Texels, String> {
    let is_whole = rgba.len() == size[0] * size[1] && !rgba.is_empty();
    is_whole.then_some(Texels { size, rgba }).ok_or_else(|| "it has fewer texels than it says".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png_of(size: [u32; 2], rgba: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
        encoder.set_color(ColorType::Rgba);
        let mut writer = encoder.write_header().expect("sound");
        writer.write_image_data(rgba).expect("written");
        writer.finish().expect("written");
        bytes
    }

    #[test]
    fn webp_images_are_decoded() {
        let image = webp::tests::encoded([1, 1], &[9, 8, 7, 6]);
        assert_eq!(Texels::decode(&image, 64), Ok(Texels { size: [1, 1], rgba: vec![[9, 8, 7, 6]] }));
    }

    const NEAREST: Sampler = Sampler { wrap: [Wrap::Repeat; 2], nearest: true };

    #[test]
    fn texels_are_found_by_their_coordinates_and_wrapped() {
        let image = Texels::decode(&png_of([2, 1], &[255, 0, 0, 255, 0, 0, 255, 0]), 99).expect("a PNG");
        let (red, blue) = (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 0.0, 1.0, 0.0));
        assert_eq!([0.25, 0.75, 1.25, -0.25].map(|u| image.at([u, 0.5], NEAREST)), [red, blue, red, blue]);
        let with = |wrap| Sampler { wrap: [wrap; 2], nearest: true };
        assert_eq!([-0.3, 1.3].map(|u| image.at([u, 0.5], with(Wrap::Clamp))), [red, blue]);
        assert_eq!([-0.3, 1.3].map(|u| image.at([u, 0.5], with(Wrap::Mirror))), [red, blue]);
        let between = image.at([0.5, 0.5], Sampler { nearest: false, ..NEAREST });
        assert!(between.distance((red + blue) / 2.0) < 1e-6);
    }

    #[test]
    fn large_images_are_halved() {
        let data: Vec<u8> = (0..4 * 3 * 4).map(|i| if i % 4 == 3 { 255 } else { 100 }).collect();
        let image = Texels::decode(&png_of([4, 3], &data), 4).expect("a PNG");
        assert_eq!(image, Texels { size: [2, 2], rgba: vec![[100, 100, 100, 255]; 4] });
        assert_eq!(Texels::decode(&png_of([4, 3], &data), 0).expect("a PNG").size, [1, 1]);
    }

    #[test]
    fn what_cannot_be_decoded_says_why() {
        for bytes in [&b"RIFF....WEBP"[..], b"", b"\x89PNG\r\n\x1A\n....", b"\xFF\xD8\xFF\xE0 and no more"] {
            assert!(Texels::decode(bytes, 9).is_err_and(|reason| !reason.is_empty()));
        }
    }

    #[test]
    fn jpeg_images_have_their_colours() {
        // 8 by 8 texels of one colour: red 200, green 80 and blue 40, as a common encoder writes them.
        let jpeg = include_bytes!("orange.jpg");
        let image = Texels::decode(jpeg, 99).expect("a JPEG");
        assert_eq!(image.size, [8, 8]);
        let [r, g, b, a] = image.rgba[27];
        assert!(r.abs_diff(200) < 4 && g.abs_diff(80) < 4 && b.abs_diff(40) < 4 && a == 255, "{r} {g} {b}");
    }
}
