//! Text in pictures, in a font of its own: Roboto (`roboto.ttf`, Apache License 2.0), reduced to ASCII and a few signs.

use std::sync::OnceLock;

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};

use super::Picture;
use super::colour::Rgb;

fn font() -> &'static FontRef<'static> {
    static FONT: OnceLock<FontRef<'static>> = OnceLock::new();
    FONT.get_or_init(|| FontRef::try_from_slice(include_bytes!("roboto.ttf")).expect("the font is sound"))
}

/// Returns the width of a text in pixels.
pub(super) fn width(text: &str, height: f32) -> f32 {
    let font = font().as_scaled(PxScale::from(height));
    text.chars().map(|c| font.h_advance(font.glyph_id(c))).sum()
}

/// Writes a text whose upper left corner is at a place.
pub(super) fn write(picture: &mut Picture, text: &str, [x, y]: [f32; 2], height: f32, colour: Rgb) {
    let font = font().as_scaled(PxScale::from(height));
    let mut at = x;
    for c in text.chars() {
        let id = font.glyph_id(c);
        let glyph = id.with_scale_and_position(height, point(at, y + font.ascent()));
        at += font.h_advance(id);
        if let Some(outline) = font.outline_glyph(glyph) {
            let corner = outline.px_bounds().min;
            outline.draw(|dx, dy, cover| {
                let place = [corner.x as i64 + i64::from(dx), corner.y as i64 + i64::from(dy)];
                picture.mix(place, colour, cover.clamp(0.0, 1.0));
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Statistics;
    use super::*;

    #[test]
    fn text_covers_its_width_and_nothing_outside_the_picture() {
        let blank = Picture::of([60, 20], vec![[0; 3]; 1200], Statistics::default());
        let mut picture = blank.clone();
        write(&mut picture, "12.5", [2.0, 2.0], 14.0, [255; 3]);
        assert_ne!(picture, blank);
        let end = 3 + width("12.5", 14.0) as u32;
        assert!((end..60).all(|x| (0..20).all(|y| picture.pixel(x, y) == Some([0; 3]))));
        write(&mut picture, "outside", [1000.0, -500.0], 14.0, [255; 3]);
    }
}
