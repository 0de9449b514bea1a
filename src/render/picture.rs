//! [`Picture`]: pixels, what was measured while they were drawn, and their PNG.

use serde::Serialize;

use super::colour::Rgb;
use super::{Differences, MeanSteps};

/// A picture with 8 bits per channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Red, green and blue (sRGB) of each pixel, in rows from the top.
    pub pixels: Vec<u8>,
    /// What was measured.
    pub statistics: Statistics,
}

/// What was measured while a picture was drawn.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Share of the primary rays that hit something, 0 to 1.
    pub seen_ratio: f64,
    /// The values that the colours stand for.
    pub values: Option<Values>,
    /// Heat map: mean steps per primary ray.
    pub steps: Option<MeanSteps>,
    /// Boxes: their number.
    pub boxes: Option<u64>,
    /// Difference: how two scenes differ.
    pub differences: Option<Differences>,
}

/// Values over the pixels of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Values {
    /// Mean over all pixels.
    pub mean: f64,
    /// Largest value of a pixel.
    pub max: f64,
    /// The value with the last colour of the scale; larger ones have it too.
    pub scale: f64,
    /// What is counted.
    pub unit: Unit,
}

/// What the values of a picture count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Traversal steps: nodes, entries and triangle tests.
    #[default]
    Steps,
    /// Ticks of a device's clock.
    Ticks,
    /// Surfaces on a ray.
    Surfaces,
    /// Boxes of instances around a point.
    Boxes,
}

impl Unit {
    /// Returns the name in legends.
    pub fn name(self) -> &'static str {
        match self {
            Unit::Steps => "nodes, entries and triangle tests",
            Unit::Ticks => "ticks of the device's clock",
            Unit::Surfaces => "surfaces",
            Unit::Boxes => "instance boxes around the surface",
        }
    }
}

impl Picture {
    /// Creates a picture of pixels in rows from the top.
    pub(super) fn of(size: [u32; 2], pixels: Vec<Rgb>, statistics: Statistics) -> Picture {
        Picture { width: size[0], height: size[1], pixels: pixels.into_flattened(), statistics }
    }

    /// Encodes the picture as a PNG file.
    ///
    /// # Panics
    /// If `pixels` does not hold three bytes per pixel.
    pub fn png(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        let written = encoder.write_header().and_then(|mut writer| {
            writer.write_image_data(&self.pixels)?;
            writer.finish()
        });
        assert!(written.is_ok(), "memory can be written to, and there are three bytes per pixel: {written:?}");
        bytes
    }

    /// Returns the colour of a pixel; `None` outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 3]> {
        let at = 3 * (y as usize * self.width as usize + x as usize);
        (x < self.width && y < self.height).then(|| [self.pixels[at], self.pixels[at + 1], self.pixels[at + 2]])
    }

    /// Mixes a colour into a pixel; `cover` is its share, 0 to 1. Outside the picture nothing happens.
    pub(super) fn mix(&mut self, [x, y]: [i64; 2], colour: Rgb, cover: f32) {
        if (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y) {
            let at = 3 * (y as usize * self.width as usize + x as usize);
            for (to, of) in self.pixels[at..at + 3].iter_mut().zip(colour) {
                *to = (f32::from(*to) + (f32::from(of) - f32::from(*to)) * cover).round() as u8;
            }
        }
    }
}

impl Values {
    /// Returns the values of pixels, with the end of their scale and their unit.
    pub(super) fn of(values: impl Iterator<Item = f64>, scale: f64, unit: Unit) -> Values {
        let (mut sum, mut max, mut count) = (0.0, 0.0, 0u64);
        for value in values {
            (sum, max, count) = (sum + value, f64::max(max, value), count + 1);
        }
        Values { mean: sum / count.max(1) as f64, max, scale, unit }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_png_holds_the_pixels() {
        let pixels = vec![[1, 2, 3], [4, 5, 6], [7, 8, 9], [250, 251, 252], [0, 0, 0], [255, 255, 255]];
        let picture = Picture::of([3, 2], pixels, Statistics::default());
        let mut reader = png::Decoder::new(std::io::Cursor::new(picture.png())).read_info().expect("a PNG");
        let mut data = vec![0; 18];
        let info = reader.next_frame(&mut data).expect("whole");
        assert_eq!((info.width, info.height, info.color_type), (3, 2, png::ColorType::Rgb));
        assert_eq!(data, picture.pixels);
        assert_eq!(
            [picture.pixel(0, 1), picture.pixel(3, 0), picture.pixel(0, 2)],
            [Some([250, 251, 252]), None, None]
        );
    }
}
