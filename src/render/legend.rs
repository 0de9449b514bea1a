//! The legend of a picture whose colours stand for values.

use super::colour::Rgb;
use super::text::{width, write};
use super::{ColourMap, Picture};

/// Height of the text in pixels.
const TEXT: f32 = 13.0;
/// Space around everything, in pixels.
const MARGIN: f32 = 8.0;
/// Width and height of the bar of colours, in pixels.
const BAR: [f32; 2] = [220.0, 10.0];
const INK: Rgb = [240, 240, 240];
const GROUND: Rgb = [16, 16, 20];
/// Share of the ground in the pixels behind the legend.
const COVER: f32 = 0.78;

/// Draws the legend into the lower left corner: the colours from 0 to `scale`, three numbers, and what they count. A
/// picture too small for it stays as it is.
pub(super) fn draw(picture: &mut Picture, colours: ColourMap, scale: f64, unit: &str) {
    let inner = width(unit, TEXT).max(BAR[0]);
    let size = [inner + 2.0 * MARGIN, 2.0 * TEXT + BAR[1] + 3.5 * MARGIN];
    if size[0] > picture.width as f32 || 3.0 * size[1] > picture.height as f32 {
        return;
    }
    let top = picture.height as f32 - size[1];
    fill(picture, [0.0, top], size, |_| GROUND, COVER);
    write(picture, unit, [MARGIN, top + MARGIN], TEXT, INK);
    let bar = [MARGIN, top + TEXT + 1.75 * MARGIN];
    fill(picture, bar, BAR, |x| colours.at(f64::from(x / (BAR[0] - 1.0))), 1.0);
    for share in [0.0, 0.5, 1.0] {
        let text = number(share * scale);
        let x = bar[0] + share as f32 * (BAR[0] - width(&text, TEXT));
        write(picture, &text, [x, bar[1] + BAR[1] + 0.5 * MARGIN], TEXT, INK);
    }
}

/// Draws a key into the lower left corner: what each colour means. A picture too small for it stays as it is.
pub(super) fn key(picture: &mut Picture, entries: &[(Rgb, &str)]) {
    let swatch = TEXT - 3.0;
    let widths: Vec<f32> = entries.iter().map(|(_, text)| swatch + 1.75 * MARGIN + width(text, TEXT)).collect();
    let size = [widths.iter().sum::<f32>() + MARGIN, TEXT + 2.0 * MARGIN];
    if size[0] > picture.width as f32 || 3.0 * size[1] > picture.height as f32 {
        return;
    }
    let top = picture.height as f32 - size[1];
    fill(picture, [0.0, top], size, |_| GROUND, COVER);
    let mut left = MARGIN;
    for ((colour, text), width) in entries.iter().zip(widths) {
        fill(picture, [left, top + MARGIN + 2.0], [swatch; 2], |_| *colour, 1.0);
        write(picture, text, [left + swatch + 0.75 * MARGIN, top + MARGIN], TEXT, INK);
        left += width;
    }
}

/// Fills a rectangle; `colour` takes the distance from its left side.
fn fill(picture: &mut Picture, [left, top]: [f32; 2], size: [f32; 2], colour: impl Fn(f32) -> Rgb, cover: f32) {
    let [width, height] = size.map(|side| side.round() as i64);
    for y in 0..height {
        for x in 0..width {
            picture.mix([left.round() as i64 + x, top.round() as i64 + y], colour(x as f32), cover);
        }
    }
}

/// Returns a number in as few digits as tell it.
fn number(x: f64) -> String {
    if x >= 10.0 || x.fract() == 0.0 { format!("{x:.0}") } else { format!("{x:.1}") }
}

/// Returns the least of the numbers 1, 1.5, 2, 3, 5 and 7 times a power of ten that is at least `x`; 1 if `x` is not
/// above 0.
pub(super) fn rounded_up(x: f64) -> f64 {
    if !(x > 0.0 && x.is_finite()) {
        return 1.0;
    }
    let power = 10f64.powf(x.log10().floor());
    let steps = [1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0];
    // The last step covers a logarithm that was rounded down.
    steps.into_iter().map(|step| step * power).find(|&end| end >= x).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::super::Statistics;
    use super::*;

    #[test]
    fn ends_of_scales_are_round() {
        for (x, end) in [(0.0, 1.0), (1.0, 1.0), (1.01, 1.5), (87.0, 100.0), (412.0, 500.0), (0.04, 0.05)] {
            assert!((rounded_up(x) - end).abs() < 1e-9, "{x} {}", rounded_up(x));
        }
        assert_eq!([f64::NAN, f64::INFINITY, -3.0].map(rounded_up), [1.0; 3]);
        assert_eq!([0.0, 2.5, 250.0].map(number), ["0", "2.5", "250"]);
    }

    #[test]
    fn a_legend_is_drawn_where_there_is_room() {
        let blank = |width: u32| Picture::of([width, 240], vec![[9; 3]; 240 * width as usize], Statistics::default());
        let mut large = blank(320);
        draw(&mut large, ColourMap::Jet, 100.0, "steps per ray");
        assert_ne!(large, blank(320));
        assert_eq!(large.pixel(319, 0), Some([9; 3]));
        let mut small = blank(60);
        draw(&mut small, ColourMap::Jet, 100.0, "steps per ray");
        assert_eq!(small, blank(60));
    }
}
