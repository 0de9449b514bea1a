//! Bar charts: groups of bars of several series, as SVG and PNG.

use plotters::prelude::*;
use plotters::style::FontTransform;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::linear::LinearAxis;
use super::{COLOURS, Canvas, Drawing, Drawn, FRAME, axis, extent, write_text};

/// Share of a group's width that its bars take.
const FILLED: f64 = 0.8;

/// A bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::lab) struct Bar {
    /// Its height; at least 0.
    pub(in crate::lab) value: f64,
    /// How far off that may be, in the same unit; 0 if it is unknown.
    pub(in crate::lab) spread: f64,
}

/// Groups of bars.
#[derive(Clone, Debug, Default)]
pub(in crate::lab) struct BarChart {
    pub(in crate::lab) title: String,
    /// Name of the vertical axis, with its unit.
    pub(in crate::lab) unit: String,
    /// Name of what the groups are.
    pub(in crate::lab) group_axis: String,
    pub(in crate::lab) groups: Vec<String>,
    /// Heading of the legend, and the series.
    pub(in crate::lab) heading: String,
    pub(in crate::lab) series: Vec<String>,
    /// For each group, a bar of each series, if there is one.
    pub(in crate::lab) bars: Vec<Vec<Option<Bar>>>,
    /// Further lines of the legend.
    pub(in crate::lab) notes: Vec<String>,
}

impl Drawing for BarChart {
    fn draw<DB: DrawingBackend>(&self, canvas: &Canvas<DB>) -> Drawn<DB> {
        canvas.fill(&WHITE)?;
        let [left, top, right, bottom] = FRAME;
        let tops = self.bars.iter().flatten().flatten().map(|bar| bar.value + bar.spread);
        let y = LinearAxis::of(tops, [bottom, top]);
        draw_vertical(canvas, &y, &self.title, &self.unit)?;
        let width = f64::from(right - left) / self.groups.len().max(1) as f64;
        for (g, (name, bars)) in self.groups.iter().zip(&self.bars).enumerate() {
            let from = f64::from(left) + (g as f64 + 0.5 * (1.0 - FILLED)) * width;
            let each = FILLED * width / self.series.len().max(1) as f64;
            for (s, bar) in bars.iter().enumerate() {
                let [start, end] = [s, s + 1].map(|s| (from + s as f64 * each).round() as i32);
                if let Some(bar) = bar {
                    draw_bar(canvas, &y, [start, end], bar, COLOURS[s % COLOURS.len()])?;
                }
            }
            write_fitting(canvas, name, (f64::from(left) + (g as f64 + 0.5) * width) as i32, width as i32)?;
        }
        canvas.draw(&Rectangle::new([(left, top), (right, bottom)], BLACK.mix(0.6)))?;
        write_text(canvas, &self.group_axis, [(left + right) / 2, bottom + 52], 18, HPos::Center)?;
        draw_legend(canvas, &self.heading, &self.series, &self.notes)
    }
}

/// Draws the grid, the title and the name of the vertical axis.
pub(super) fn draw_vertical<DB: DrawingBackend>(
    canvas: &Canvas<DB>,
    y: &LinearAxis,
    title: &str,
    unit: &str,
) -> Drawn<DB> {
    let [left, top, right, bottom] = FRAME;
    for tick in y.ticks() {
        let at = y.pixel(tick);
        canvas.draw(&PathElement::new(vec![(left, at), (right, at)], BLACK.mix(0.12)))?;
        write_text(canvas, &axis::name(tick), [left - 10, at], 16, HPos::Right)?;
    }
    write_text(canvas, title, [left, 32], 22, HPos::Left)?;
    let font = ("sans-serif", 18).into_font().transform(FontTransform::Rotate270);
    let style = font.color(&BLACK).pos(Pos::new(HPos::Center, VPos::Center));
    canvas.draw(&Text::new(unit.to_owned(), (32, (top + bottom) / 2), style))
}

/// Draws what the colours mean, to the right of the frame.
pub(super) fn draw_legend<DB: DrawingBackend>(
    canvas: &Canvas<DB>,
    heading: &str,
    series: &[String],
    notes: &[String],
) -> Drawn<DB> {
    let (left, mut y) = (FRAME[2] + 28, FRAME[1] + 10);
    write_text(canvas, heading, [left, y], 16, HPos::Left)?;
    for (s, name) in series.iter().enumerate() {
        y += 26;
        canvas.draw(&Rectangle::new([(left, y - 6), (left + 14, y + 6)], COLOURS[s % COLOURS.len()].filled()))?;
        write_text(canvas, name, [left + 24, y], 16, HPos::Left)?;
    }
    y += 18;
    notes.iter().try_for_each(|note| {
        y += 24;
        write_text(canvas, note, [left, y], 14, HPos::Left)
    })
}

fn draw_bar<DB: DrawingBackend>(
    canvas: &Canvas<DB>,
    y: &LinearAxis,
    [start, end]: [i32; 2],
    bar: &Bar,
    colour: RGBColor,
) -> Drawn<DB> {
    let gap = i32::from(end - start > 4);
    let corners = [(start + gap, y.pixel(bar.value)), ((end - gap).max(start + 1), FRAME[3])];
    canvas.draw(&Rectangle::new(corners, colour.filled()))?;
    if bar.spread <= 0.0 {
        return Ok(());
    }
    let middle = (start + end) / 2;
    let ends = [bar.value - bar.spread, bar.value + bar.spread].map(|x| (middle, y.pixel(x.max(0.0))));
    canvas.draw(&PathElement::new(ends.to_vec(), BLACK.mix(0.8)))
}

/// Writes the name of a group below the frame, in smaller letters or two lines if it is too long.
fn write_fitting<DB: DrawingBackend>(canvas: &Canvas<DB>, name: &str, middle: i32, width: i32) -> Drawn<DB> {
    let y = FRAME[3] + 18;
    let fits = |text: &str, size: i32| extent(text, size)[0] <= width;
    if let Some(size) = [16, 14, 12].into_iter().find(|size| fits(name, *size)) {
        return write_text(canvas, name, [middle, y], size, HPos::Center);
    }
    let blanks = name.char_indices().filter(|(_, c)| [' ', '_', '-'].contains(c)).map(|(i, _)| i);
    let half = blanks.min_by_key(|i| i.abs_diff(name.len() / 2)).unwrap_or(name.len());
    let (first, second) = name.split_at(half);
    write_text(canvas, first, [middle, y], 12, HPos::Center)?;
    write_text(canvas, second.trim_start(), [middle, y + 15], 12, HPos::Center)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_group_series_and_note_is_named_and_missing_bars_are_left_out() {
        let bar = |value| Some(Bar { value, spread: 0.5 });
        let chart = BarChart {
            title: "Speeds".into(),
            unit: "million rays per second".into(),
            group_axis: "scene".into(),
            groups: vec!["conference".into(), "a very long name_of a scene that needs two lines or more".into()],
            heading: "method".into(),
            series: vec!["single".into(), "per-object".into()],
            bars: vec![vec![bar(10.0), bar(4.0)], vec![None, bar(3.0)]],
            notes: vec!["CPU".into()],
        };
        let text = chart.svg();
        for word in ["Speeds", "million rays per second", "scene", "conference", "single", "per-object", "CPU"] {
            assert!(text.contains(word), "{word}");
        }
        let colours = |colour: &str| text.matches(&format!("fill=\"{colour}\"")).count();
        assert_eq!((colours("#0072B2"), colours("#5A5A5A")), (2, 3), "bars and their place in the legend");
    }
}
