//! Decodes WebP images.

use std::io::Cursor;

use image_webp::{DecodingError, WebPDecoder};

/// Most texels of an image, as all are in memory at once.
const MOST_TEXELS: u64 = 1 << 26;

/// Red, green, blue and alpha of each texel, in rows from the top.
pub(crate) struct Decoded {
    /// Width and height, at least 1 each.
    pub(crate) size: [u32; 2],
    /// One per texel.
    pub(crate) rgba: Vec<[u8; 4]>,
}

/// Whether bytes are a WebP image.
pub(crate) fn is_webp(bytes: &[u8]) -> bool {
    bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP")
}

/// Decodes an image of at most so many texels a side; an animated one up to its first frame.
///
/// # Errors
/// Describes why the image cannot be decoded.
pub(crate) fn decode(bytes: &[u8], most_side: u32) -> Result<Decoded, String> {
    let failed = |e: DecodingError| e.to_string();
    let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(failed)?;
    let (width, height) = decoder.dimensions();
    if width.max(height) > most_side {
        return Err(format!("{width} x {height} texels are more than {most_side} a side"));
    }
    if u64::from(width) * u64::from(height) > MOST_TEXELS {
        return Err(format!("{width} x {height} texels are too many"));
    }
    let mut data = vec![0; decoder.output_buffer_size().ok_or("it is too large")?];
    decoder.read_image(&mut data).map_err(failed)?;
    let rgba = match decoder.has_alpha() {
        true => data.as_chunks().0.to_vec(),
        false => data.as_chunks().0.iter().map(|[r, g, b]| [*r, *g, *b, 255]).collect(),
    };
    Ok(Decoded { size: [width, height], rgba })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use image_webp::{ColorType, WebPEncoder};

    /// A lossless image.
    pub(crate) fn encoded(size: [u32; 2], rgba: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        WebPEncoder::new(&mut bytes).encode(rgba, size[0], size[1], ColorType::Rgba8).expect("sound");
        bytes
    }

    #[test]
    fn texels_are_those_that_were_encoded() {
        let rgba: Vec<u8> = (0..24).map(|i| 255 - 10 * i).collect();
        let image = encoded([3, 2], &rgba);
        assert!(is_webp(&image));
        let decoded = decode(&image, 8).expect("sound");
        assert_eq!((decoded.size, decoded.rgba.as_flattened()), ([3, 2], &rgba[..]));
    }

    #[test]
    fn what_cannot_be_decoded_says_why() {
        let image = encoded([9, 9], &[7; 4 * 81]);
        let reason = |bytes: &[u8], side| decode(bytes, side).err().expect("refused");
        assert_eq!(reason(&image, 8), "9 x 9 texels are more than 8 a side");
        assert!(!reason(&image[..20], 16).is_empty());
        assert!(!is_webp(b"RIFF") && !is_webp(b"RIFF....WAVE"));
    }
}
