//! Whether two encoded images hold the same pixels.

use std::io::Cursor;

use png::{ColorType, Decoder, Limits, Transformations};

/// Memory that decoding an image may take, in bytes.
const MAX_BYTES: usize = 512 << 20;

/// Whether two encoded images hold the same pixels. PNG images are decoded; JPEG images are the same if they are
/// equal but for metadata. Other formats are the same only if all bytes are.
pub(super) fn are_same(before: &[u8], after: &[u8]) -> bool {
    let are = |magic: &[u8]| before.starts_with(magic) && after.starts_with(magic);
    if before == after {
        return true;
    }
    if are(b"\x89PNG\r\n\x1A\n") {
        return matches!((decode(before), decode(after)), (Some(b), Some(a)) if b == a);
    }
    are(b"\xFF\xD8") && matches!((essence(before), essence(after)), (Some(b), Some(a)) if b == a)
}

/// The pixels of an image.
#[derive(PartialEq)]
struct Pixels {
    size: [u32; 2],
    /// Red, green, blue and alpha, from 0 to 65535.
    values: Vec<[u16; 4]>,
}

/// Decodes a PNG image; `None` if it is damaged or too large.
fn decode(bytes: &[u8]) -> Option<Pixels> {
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: MAX_BYTES });
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().ok()?;
    let length = reader.output_buffer_size().filter(|length| *length <= MAX_BYTES)?;
    let mut data = vec![0; length];
    let info = reader.next_frame(&mut data).ok()?;
    let samples: Vec<u16> = match info.bit_depth {
        png::BitDepth::Sixteen => data.chunks_exact(2).map(|c| u16::from_be_bytes([c[0], c[1]])).collect(),
        _ => data.iter().map(|&b| u16::from(b) * 257).collect(),
    };
    let most = u16::MAX;
    let values = match info.color_type {
        ColorType::Grayscale => samples.iter().map(|&g| [g, g, g, most]).collect(),
        ColorType::GrayscaleAlpha => samples.chunks_exact(2).map(|c| [c[0], c[0], c[0], c[1]]).collect(),
        ColorType::Rgb => samples.chunks_exact(3).map(|c| [c[0], c[1], c[2], most]).collect(),
        ColorType::Rgba => samples.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect(),
        ColorType::Indexed => return None,
    };
    Some(Pixels { size: [info.width, info.height], values })
}

/// Returns a JPEG image without comments and application segments, except Adobe's, which says how colours are coded
/// (ITU-T T.81, annex B). `None` if it is damaged.
fn essence(bytes: &[u8]) -> Option<Vec<u8>> {
    const START_OF_SCAN: u8 = 0xDA;
    let is_metadata = |marker: u8| marker == 0xFE || (0xE0..=0xEF).contains(&marker) && marker != 0xEE;
    let mut kept = Vec::with_capacity(bytes.len());
    let mut rest = bytes.get(2..)?;
    loop {
        let [0xFF, marker, high, low, ..] = *rest else { return None };
        if marker == 0xFF {
            rest = &rest[1..];
            continue;
        }
        let (segment, after) = rest.split_at_checked(2 + usize::from(u16::from_be_bytes([high, low])))?;
        if marker == START_OF_SCAN {
            kept.extend_from_slice(rest);
            return Some(kept);
        }
        if !is_metadata(marker) {
            kept.extend_from_slice(segment);
        }
        rest = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png_of(color: ColorType, data: &[u8], compression: png::Compression) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(color);
        encoder.set_compression(compression);
        if color == ColorType::Indexed {
            encoder.set_palette(&[1, 2, 3, 4, 5, 6][..]);
        }
        let mut writer = encoder.write_header().expect("sound");
        writer.write_image_data(data).expect("written");
        writer.finish().expect("written");
        bytes
    }

    #[test]
    fn png_images_are_the_same_by_pixels() {
        let rgb = png_of(ColorType::Rgb, &[1, 2, 3, 4, 5, 6], png::Compression::High);
        let rgba = png_of(ColorType::Rgba, &[1, 2, 3, 255, 4, 5, 6, 255], png::Compression::Fast);
        let indexed = png_of(ColorType::Indexed, &[0, 1], png::Compression::Fast);
        assert!(are_same(&rgb, &rgba) && are_same(&rgb, &indexed) && are_same(&rgb, &rgb));
        let other = png_of(ColorType::Rgba, &[1, 2, 3, 254, 4, 5, 6, 255], png::Compression::Fast);
        assert!(!are_same(&rgb, &other));
        assert!(!are_same(&rgb, &rgb[..rgb.len() - 20]), "a damaged image is no other");
    }

    #[test]
    fn jpeg_images_are_the_same_but_for_metadata() {
        let jpeg = |comment: &[u8], table: u8| {
            let mut bytes = vec![0xFF, 0xD8, 0xFF, 0xFE, 0, 2 + comment.len() as u8];
            bytes.extend_from_slice(comment);
            bytes.extend_from_slice(&[0xFF, 0xDB, 0, 3, table, 0xFF, 0xDA, 0, 2, 1, 2, 3, 0xFF, 0xD9]);
            bytes
        };
        assert!(are_same(&jpeg(b"one", 7), &jpeg(b"another", 7)));
        assert!(!are_same(&jpeg(b"one", 7), &jpeg(b"one", 8)));
        assert!(!are_same(&jpeg(b"one", 7), b"\xFF\xD8\xFF"));
    }
}
