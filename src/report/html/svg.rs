//! Charts as inline SVG. Colours and fonts are those of the page (`assets/page.css`), so that charts follow its theme.

use std::fmt::{Display, Write};

use minijinja::HtmlEscape;

use super::text::visible;

/// Width of every chart, in the units of its view box.
pub(super) const WIDTH: f64 = 720.0;
/// Maximum characters of a label within a chart. Its table and its tooltip have more.
const MOST_LABEL: usize = 26;
/// Number of marks on an axis to aim for.
const MARKS: f64 = 6.0;

/// The elements of a chart as they are drawn.
pub(super) struct Canvas {
    height: f64,
    body: String,
}

/// The end of a text that lies at its place.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Canvas {
    pub(super) fn new(height: f64) -> Canvas {
        Canvas { height, body: String::new() }
    }

    /// Writes a text whose base line starts, is centred or ends at a place.
    pub(super) fn text(&mut self, [x, y]: [f64; 2], class: &str, anchor: Anchor, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = escaped(&visible(text, MOST_LABEL));
        self.add(format_args!(r#"<text x="{x:.1}" y="{y:.1}" class="{class}" text-anchor="{anchor}">{text}</text>"#));
    }

    pub(super) fn line(&mut self, [x, y]: [f64; 2], [to_x, to_y]: [f64; 2], class: &str) {
        self.add(format_args!(r#"<line x1="{x:.1}" y1="{y:.1}" x2="{to_x:.1}" y2="{to_y:.1}" class="{class}"/>"#));
    }

    /// Draws a rectangle with a tooltip.
    pub(super) fn rectangle(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], class: &str, tip: &str) {
        let (width, height) = (width.max(0.0), height.max(0.0));
        self.add(format_args!(
            r#"<rect x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}" class="{class}">{}</rect>"#,
            title(tip)
        ));
    }

    /// Draws a dot with a tooltip.
    pub(super) fn dot(&mut self, [x, y]: [f64; 2], radius: f64, class: &str, tip: &str) {
        self.add(format_args!(
            r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius:.1}" class="{class}">{}</circle>"#,
            title(tip)
        ));
    }

    /// Draws a line through places.
    pub(super) fn path(&mut self, places: &[[f64; 2]], class: &str) {
        let places: Vec<String> = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        self.add(format_args!(r#"<polyline points="{}" class="{class}"/>"#, places.join(" ")));
    }

    /// Returns the chart, named by the element with an id.
    pub(super) fn finish(self, labelled_by: &str) -> String {
        let Canvas { height, body } = self;
        format!(r#"<svg viewBox="0 0 {WIDTH} {height:.0}" role="img" aria-labelledby="{labelled_by}">{body}</svg>"#)
    }

    fn add(&mut self, element: impl Display) {
        let _ = write!(self.body, "{element}");
    }
}

fn escaped(text: &str) -> String {
    HtmlEscape(text).to_string()
}

fn title(tip: &str) -> String {
    format!("<title>{}</title>", escaped(&visible(tip, super::text::MOST_CHARACTERS)))
}

/// How the values of an axis are placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scale {
    Linear,
    /// Only values above 0.
    Logarithmic,
}

/// An axis from one end of a chart to the other.
pub(super) struct Axis {
    scale: Scale,
    /// The values at both ends.
    ends: [f64; 2],
    /// The places of both ends.
    places: [f64; 2],
}

impl Axis {
    /// Makes an axis between two places that holds all values that can be placed, with room around them.
    pub(super) fn over(scale: Scale, values: impl Iterator<Item = f64>, places: [f64; 2]) -> Axis {
        let placed = values.filter(|&v| v.is_finite() && (scale == Scale::Linear || v > 0.0)).map(|v| of(scale, v));
        let [least, most] = placed.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        let (least, most) = if least <= most { (least, most) } else { (0.0, 1.0) };
        let room = if most > least { 0.08 * (most - least) } else { 0.5 * least.abs().max(0.5) };
        Axis { scale, ends: [least - room, most + room], places }
    }

    /// Makes a linear axis from 0 to the largest value.
    pub(super) fn from_zero(values: impl Iterator<Item = f64>, places: [f64; 2]) -> Axis {
        let most = values.filter(|v| v.is_finite()).fold(0.0, f64::max);
        Axis { scale: Scale::Linear, ends: [0.0, if most > 0.0 { 1.05 * most } else { 1.0 }], places }
    }

    /// Returns the place of a value.
    pub(super) fn place(&self, value: f64) -> f64 {
        let [least, most] = self.ends;
        let share = (of(self.scale, value) - least) / (most - least);
        self.places[0] + share.clamp(0.0, 1.0) * (self.places[1] - self.places[0])
    }

    /// Returns the values to mark, with their labels.
    pub(super) fn marks(&self) -> Vec<(f64, String)> {
        let [least, most] = self.ends;
        match self.scale {
            Scale::Linear => steps(least, most, MARKS),
            Scale::Logarithmic if most - least < 0.5 => steps(10f64.powf(least), 10f64.powf(most), MARKS),
            Scale::Logarithmic => powers(least, most),
        }
    }
}

/// Multiples of a round number between two values.
fn steps(least: f64, most: f64, count: f64) -> Vec<(f64, String)> {
    let step = round_step((most - least) / count);
    let first = (least / step).ceil() as i64;
    let marks = (first..first + 40).map(|i| i as f64 * step).take_while(|&v| v <= most);
    marks.map(|v| (v, decimal(v, step))).collect()
}

/// Powers of ten between two exponents; if there are few, also their multiples by 2 and 5.
fn powers(least: f64, most: f64) -> Vec<(f64, String)> {
    let multiples: &[f64] = if most - least < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let every = ((most - least) / MARKS).ceil().max(1.0) as i32;
    let exponents = (least.floor() as i32..=most.ceil() as i32).filter(|e| e.rem_euclid(every) == 0);
    let values = exponents.flat_map(|e| multiples.iter().map(move |m| m * 10f64.powi(e)));
    values.filter(|v| (least..=most).contains(&v.log10())).map(|v| (v, significant(v))).collect()
}

/// The coordinate of a value on a scale.
fn of(scale: Scale, value: f64) -> f64 {
    match scale {
        Scale::Linear => value,
        Scale::Logarithmic => value.log10(),
    }
}

/// Returns 1, 2, 2.5 or 5 times a power of ten, at least the given step.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    [1.0, 2.0, 2.5, 5.0, 10.0].into_iter().map(|factor| factor * power).find(|&s| s >= step).unwrap_or(10.0 * power)
}

/// Formats a multiple of a step with the digits that it needs.
fn decimal(value: f64, step: f64) -> String {
    let digits = (0..9).find(|&d| ((step * 10f64.powi(d)).round() / 10f64.powi(d) - step).abs() < 1e-9 * step);
    format!("{:.*}", digits.unwrap_or(9) as usize, value + 0.0)
}

/// Formats a number with two significant digits at most; very small and large ones as powers of ten.
pub(super) fn significant(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        v if !(1e-3..1e6).contains(&v) => format!("{value:.0e}"),
        v if v >= 9.95 => format!("{value:.0}"),
        v => {
            let text = format!("{value:.*}", (1.0 - v.log10().floor()) as usize);
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.marks().into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn marks_are_round_numbers_within_the_axis() {
        let linear = |values: [f64; 2]| labels(&Axis::over(Scale::Linear, values.into_iter(), [0.0, 100.0]));
        let logarithmic = |values: [f64; 2]| labels(&Axis::over(Scale::Logarithmic, values.into_iter(), [0.0, 100.0]));
        assert_eq!(labels(&Axis::from_zero([37.0].into_iter(), [0.0, 100.0])), ["0", "10", "20", "30"]);
        assert_eq!(linear([0.96, 1.27]), ["1.0", "1.1", "1.2"]);
        assert_eq!(logarithmic([1e-6, 1e-2]), ["1e-6", "1e-5", "1e-4", "0.001", "0.01"]);
        assert_eq!(logarithmic([3.0, 60.0]), ["5", "10", "20", "50"]);
        assert_eq!(logarithmic([250.0, 400.0]), ["250", "300", "350", "400"]);
    }

    #[test]
    fn values_lie_between_the_ends_in_their_order() {
        let axis = Axis::over(Scale::Logarithmic, [1.0, 10.0, 100.0, 0.0, f64::NAN].into_iter(), [0.0, 116.0]);
        let places = [1.0, 10.0, 100.0].map(|v| axis.place(v));
        assert!((places[1] - 58.0).abs() < 1e-9 && places.is_sorted() && places[0] > 0.0, "{places:?}");
        assert_eq!(axis.place(1e9), 116.0);
    }

    #[test]
    fn an_axis_without_values_or_with_one_is_an_axis() {
        for values in [&[][..], &[5.0], &[0.0]] {
            for scale in [Scale::Linear, Scale::Logarithmic] {
                let axis = Axis::over(scale, values.iter().copied(), [0.0, 1.0]);
                assert!(!axis.marks().is_empty() && axis.place(5.0).is_finite(), "{values:?} {scale:?}");
            }
        }
    }

    #[test]
    fn labels_and_tips_are_escaped() {
        let mut canvas = Canvas::new(10.0);
        canvas.text([0.0; 2], "label", Anchor::Start, "<script>\"&\u{202e}");
        canvas.dot([0.0; 2], 1.0, "dot", "</title><script>");
        let svg = canvas.finish("id");
        assert!(svg.contains("&lt;script&gt;&quot;&amp;\u{27e8}U+202E\u{27e9}") && !svg.contains("<script"), "{svg}");
    }
}
