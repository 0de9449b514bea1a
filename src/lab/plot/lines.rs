//! Line charts over named places, as SVG and PNG.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::bars::{draw_legend, draw_vertical};
use super::linear::LinearAxis;
use super::{COLOURS, Canvas, Drawing, Drawn, FRAME, draw_marker, write_text};

/// Series of values at the same places, joined by lines.
#[derive(Clone, Debug, Default)]
pub(in crate::lab) struct LineChart {
    pub(in crate::lab) title: String,
    /// Name of the vertical axis, with its unit.
    pub(in crate::lab) unit: String,
    /// Name of the horizontal axis, with its unit.
    pub(in crate::lab) place_axis: String,
    /// Names of the places, which are equally far apart.
    pub(in crate::lab) places: Vec<String>,
    /// Heading of the legend, and the series with a value for each place, if there is one.
    pub(in crate::lab) heading: String,
    pub(in crate::lab) series: Vec<(String, Vec<Option<f64>>)>,
    /// Further lines of the legend.
    pub(in crate::lab) notes: Vec<String>,
}

impl Drawing for LineChart {
    fn draw<DB: DrawingBackend>(&self, canvas: &Canvas<DB>) -> Drawn<DB> {
        canvas.fill(&WHITE)?;
        let [left, top, right, bottom] = FRAME;
        let y =
            LinearAxis::of(self.series.iter().flat_map(|(_, values)| values.iter().flatten().copied()), [bottom, top]);
        draw_vertical(canvas, &y, &self.title, &self.unit)?;
        let width = f64::from(right - left) / self.places.len().max(1) as f64;
        let x = |i: usize| (f64::from(left) + (i as f64 + 0.5) * width).round() as i32;
        for (i, name) in self.places.iter().enumerate() {
            canvas.draw(&PathElement::new(vec![(x(i), top), (x(i), bottom)], BLACK.mix(0.08)))?;
            write_text(canvas, name, [x(i), bottom + 18], 16, HPos::Center)?;
        }
        for (s, (_, values)) in self.series.iter().enumerate() {
            let colour = COLOURS[s % COLOURS.len()];
            let at = |(i, value): (usize, &Option<f64>)| value.map(|value| (x(i), y.pixel(value)));
            let points: Vec<(i32, i32)> = values.iter().enumerate().filter_map(at).collect();
            canvas.draw(&PathElement::new(points.clone(), colour.stroke_width(2)))?;
            points.iter().try_for_each(|&(x, y)| draw_marker(canvas, [x, y], 1 + s % 4, colour))?;
        }
        canvas.draw(&Rectangle::new([(left, top), (right, bottom)], BLACK.mix(0.6)))?;
        write_text(canvas, &self.place_axis, [(left + right) / 2, bottom + 52], 18, HPos::Center)?;
        let names: Vec<String> = self.series.iter().map(|(name, _)| name.clone()).collect();
        draw_legend(canvas, &self.heading, &names, &self.notes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_join_what_is_known() {
        let chart = LineChart {
            title: "Thresholds".into(),
            unit: "million rays per second".into(),
            place_axis: "SoM threshold".into(),
            places: ["0.2", "0.3", "0.4"].map(String::from).to_vec(),
            heading: "setup".into(),
            series: vec![("static".into(), vec![Some(1.0), None, Some(2.0)])],
            notes: Vec::new(),
        };
        let text = chart.svg();
        assert!(["Thresholds", "SoM threshold", "0.3", "static"].iter().all(|word| text.contains(word)));
        assert_eq!(text.matches("<circle").count(), 2);
    }
}
