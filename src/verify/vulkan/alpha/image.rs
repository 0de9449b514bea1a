//! Decodes the alpha channel of an image.

use std::io::Cursor;

use png::{ColorType, Decoder, InterlaceInfo, Limits, Transformations};

use crate::scene::webp;

/// Largest width or height of an image, in texels.
const MAX_SIDE: u32 = 16_384;
/// Memory that decoding an image may use besides its alpha, in bytes.
const MAX_BYTES: usize = 64 << 20;

/// The alpha channel of an image, one value from 0 to 255 per texel, in rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::verify::vulkan) struct Alpha {
    /// Width and height, at least 1 each.
    pub(in crate::verify::vulkan) size: [u32; 2],
    pub(in crate::verify::vulkan) texels: Vec<u8>,
}

impl Alpha {
    /// Returns the alpha of an image without an alpha channel: a single opaque texel.
    fn opaque() -> Alpha {
        Alpha { size: [1, 1], texels: vec![255] }
    }

    /// Decodes a PNG, WebP or JPEG image. JPEG has no alpha, so no JPEG data is decoded.
    ///
    /// # Errors
    /// Describes why the image cannot be decoded.
    pub(in crate::verify::vulkan) fn decode(bytes: &[u8]) -> Result<Alpha, String> {
        match () {
            () if bytes.starts_with(b"\x89PNG\r\n\x1A\n") => decode_png(bytes),
            () if bytes.starts_with(b"\xFF\xD8\xFF") => Ok(Alpha::opaque()),
            () if webp::is_webp(bytes) => decode_webp(bytes),
            () => Err(unknown(bytes)),
        }
    }
}

/// Says what is known of an image that is not decoded.
fn unknown(bytes: &[u8]) -> String {
    match () {
        () if bytes.starts_with(b"\xABKTX 20\xBB\r\n\x1A\n") => "KTX2 images are not decoded".into(),
        () if bytes.starts_with(b"DDS ") => "DDS images are not decoded".into(),
        () if bytes.get(4..12) == Some(b"ftypavif") => "AVIF images are not decoded".into(),
        () => "neither PNG nor JPEG nor WebP".into(),
    }
}

fn decode_webp(bytes: &[u8]) -> Result<Alpha, String> {
    let image = webp::decode(bytes, MAX_SIDE)?;
    Ok(Alpha { size: image.size, texels: image.rgba.iter().map(|[_, _, _, alpha]| *alpha).collect() })
}

/// Decodes row by row, so that the colours are never all in memory at once.
fn decode_png(bytes: &[u8]) -> Result<Alpha, String> {
    let failed = |e: png::DecodingError| e.to_string();
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: MAX_BYTES });
    decoder.set_transformations(Transformations::EXPAND | Transformations::STRIP_16);
    let mut reader = decoder.read_info().map_err(failed)?;
    let (width, height) = (reader.info().width, reader.info().height);
    if width.max(height) > MAX_SIDE {
        return Err(format!("{width} x {height} texels are more than {MAX_SIDE} a side"));
    }
    let channels = match reader.output_color_type().0 {
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgba => 4,
        ColorType::Grayscale | ColorType::Rgb | ColorType::Indexed => return Ok(Alpha::opaque()),
    };
    let stride = width as usize;
    let mut texels = vec![0; stride * height as usize];
    let mut rows = 0;
    while let Some(row) = reader.next_interlaced_row().map_err(failed)? {
        let alpha = row.data().chunks_exact(channels).map(|texel| texel[channels - 1]);
        match row.interlace() {
            InterlaceInfo::Null(_) => {
                let to = texels.chunks_exact_mut(stride).nth(rows).ok_or("more rows than it says")?;
                to.iter_mut().zip(alpha).for_each(|(to, alpha)| *to = alpha);
                rows += 1;
            }
            InterlaceInfo::Adam7(info) => {
                let alpha: Vec<u8> = alpha.collect();
                png::expand_interlaced_row(&mut texels, stride, &alpha, info, 8);
            }
        }
    }
    Ok(Alpha { size: [width, height], texels })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(color: ColorType, size: [u32; 2], data: &[u8], change: impl FnOnce(&mut png::Info<'_>)) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut info = png::Info::with_size(size[0], size[1]);
        info.color_type = color;
        info.bit_depth = png::BitDepth::Eight;
        change(&mut info);
        let mut writer = png::Encoder::with_info(&mut bytes, info).expect("sound").write_header().expect("written");
        writer.write_image_data(data).expect("written");
        writer.finish().expect("written");
        bytes
    }

    #[test]
    fn alpha_is_taken_from_every_kind_of_png_that_has_it() {
        let rgba = encoded(ColorType::Rgba, [2, 1], &[1, 2, 3, 4, 5, 6, 7, 8], |_| ());
        assert_eq!(Alpha::decode(&rgba), Ok(Alpha { size: [2, 1], texels: vec![4, 8] }));
        let gray = encoded(ColorType::GrayscaleAlpha, [1, 2], &[1, 2, 3, 4], |_| ());
        assert_eq!(Alpha::decode(&gray), Ok(Alpha { size: [1, 2], texels: vec![2, 4] }));
        let deep =
            encoded(ColorType::GrayscaleAlpha, [1, 1], &[1, 2, 200, 4], |i| i.bit_depth = png::BitDepth::Sixteen);
        assert_eq!(Alpha::decode(&deep), Ok(Alpha { size: [1, 1], texels: vec![200] }));
        let palette = encoded(ColorType::Indexed, [3, 1], &[1, 0, 1], |i| {
            i.palette = Some(vec![9, 9, 9, 8, 8, 8].into());
            i.trns = Some(vec![7].into());
        });
        assert_eq!(Alpha::decode(&palette), Ok(Alpha { size: [3, 1], texels: vec![255, 7, 255] }));
    }

    #[test]
    fn alpha_is_taken_from_webp() {
        let image = webp::tests::encoded([2, 1], &[1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(Alpha::decode(&image), Ok(Alpha { size: [2, 1], texels: vec![4, 8] }));
    }

    #[test]
    fn what_has_no_alpha_is_one_opaque_texel() {
        let rgb = encoded(ColorType::Rgb, [2, 1], &[1, 2, 3, 4, 5, 6], |_| ());
        assert_eq!(Alpha::decode(&rgb), Ok(Alpha::opaque()));
        assert_eq!(Alpha::decode(b"\xFF\xD8\xFF\xE0 whatever"), Ok(Alpha::opaque()));
    }

    #[test]
    fn what_cannot_be_decoded_says_why() {
        let reason = |bytes: &[u8]| Alpha::decode(bytes).expect_err("it is broken");
        assert_eq!(reason(b"\xABKTX 20\xBB\r\n\x1A\n"), "KTX2 images are not decoded");
        assert_eq!(reason(b"\0\0\0\x20ftypavif"), "AVIF images are not decoded");
        assert_eq!(reason(b"DDS |"), "DDS images are not decoded");
        assert_eq!(reason(b""), "neither PNG nor JPEG nor WebP");
        let sound = encoded(ColorType::Rgba, [64, 64], &(0..64 * 64 * 4).map(|i| i as u8).collect::<Vec<_>>(), |_| ());
        assert!(!reason(&sound[..sound.len() / 2]).is_empty());
        let mut huge = encoded(ColorType::Rgba, [1, 1], &[0; 4], |_| ());
        // The header holds the width and a checksum.
        huge[16..20].copy_from_slice(&16_385_u32.to_be_bytes());
        let checksum = crc(&huge[12..29]);
        huge[29..33].copy_from_slice(&checksum.to_be_bytes());
        assert_eq!(reason(&huge), "16385 x 1 texels are more than 16384 a side");
    }

    /// Computes the checksum of a chunk (W3C, "Portable Network Graphics Specification", 2003, annex D).
    fn crc(bytes: &[u8]) -> u32 {
        let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
        !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
    }
}
