//! Charts, as SVG and PNG: log-log charts of points, bars and lines. With a font of its own: Roboto (`src/render/roboto.ttf`, Apache License 2.0),
//! reduced to the characters used.

mod axis;
mod bars;
mod labels;
mod linear;
mod lines;

use std::fs;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontTransform, register_font};

use self::axis::Axis;
pub(super) use self::bars::{Bar, BarChart};
use self::labels::{Area, Label, NEAR};
pub(super) use self::lines::LineChart;
use super::LabError;

/// Width and height of a picture, in pixels.
const SIZE: [i32; 2] = [1200, 800];

/// The frame: left, top, right, bottom.
const FRAME: [i32; 4] = [110, 64, 930, 710];

/// Height kept free at the bottom of the frame if errors of zero are shown.
const EXACT_BAND: i32 = 64;

/// Distance of the line of exact points from the bottom of the frame.
const EXACT_LINE: i32 = 28;

/// The colours of M. Okabe, K. Ito, "Color Universal Design", 2008, without yellow, and grey.
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(90, 90, 90),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// Radius of markers.
const MARKER: i32 = 6;

/// A point of a chart.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Point {
    /// Horizontal; above 0.
    pub(super) x: f64,
    /// Vertical; 0 lies on the line "exact".
    pub(super) y: f64,
    /// Number of the colour.
    pub(super) colour: usize,
    /// Number of the marker, less than five.
    pub(super) marker: usize,
    /// Shown if there is room.
    pub(super) label: String,
}

/// A chart.
#[derive(Clone, Debug, Default)]
pub(super) struct Chart {
    pub(super) title: String,
    /// Names of the axes, with units.
    pub(super) axes: [&'static str; 2],
    /// Labels of the first points are placed first.
    pub(super) points: Vec<Point>,
    /// Lines through points, by their indices: colour and points. Without a colour the line is the front.
    pub(super) lines: Vec<(Option<usize>, Vec<usize>)>,
    /// Headings of the legend: of colours and of markers.
    pub(super) headings: [&'static str; 2],
    /// Colours and what they mean.
    pub(super) colours: Vec<(usize, String)>,
    /// Markers and what they mean.
    pub(super) markers: Vec<(usize, String)>,
    /// Further lines of the legend.
    pub(super) notes: Vec<String>,
}

type Drawn<DB> = Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;
type Canvas<DB> = DrawingArea<DB, Shift>;

/// Something that is drawn on any canvas.
pub(super) trait Drawing {
    /// Draws it.
    ///
    /// # Errors
    /// Those of the canvas.
    fn draw<DB: DrawingBackend>(&self, canvas: &Canvas<DB>) -> Drawn<DB>;

    /// Writes `name.svg` and `name.png` to a folder.
    ///
    /// # Errors
    /// Fails if a file cannot be written.
    fn write(&self, folder: &Path, name: &str) -> Result<(), LabError> {
        let place = |end: &str| folder.join(format!("{name}.{end}"));
        fs::write(place("svg"), self.svg()).map_err(|e| LabError::file(&place("svg"), e))?;
        self.png(&place("png"))
    }

    /// Returns it as SVG.
    fn svg(&self) -> String {
        load_font();
        let mut text = String::new();
        let canvas = SVGBackend::with_string(&mut text, size()).into_drawing_area();
        self.draw(&canvas).expect("a string takes everything");
        drop(canvas);
        text
    }

    /// Writes it as PNG.
    ///
    /// # Errors
    /// Fails if the file cannot be written.
    fn png(&self, path: &Path) -> Result<(), LabError> {
        load_font();
        let (width, height) = size();
        let mut pixels = vec![0; (3 * width * height) as usize];
        let canvas = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
        self.draw(&canvas).expect("a buffer takes everything");
        drop(canvas);
        let file = fs::File::create(path).map_err(|e| LabError::file(path, e))?;
        let mut encoder = png::Encoder::new(BufWriter::new(file), width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&pixels));
        written.map_err(|e| LabError::file(path, e))
    }
}

impl Drawing for Chart {
    fn draw<DB: DrawingBackend>(&self, canvas: &Canvas<DB>) -> Drawn<DB> {
        canvas.fill(&WHITE)?;
        let [left, top, right, bottom] = FRAME;
        let has_exact = self.points.iter().any(|point| point.y <= 0.0);
        let lowest = bottom - if has_exact { EXACT_BAND } else { 0 };
        let x = Axis::of(self.points.iter().map(|p| p.x), [left, right]);
        let y = Axis::of(self.points.iter().map(|p| p.y), [lowest, top]);
        let exact = bottom - EXACT_LINE;
        self.draw_axes(canvas, &x, &y)?;
        if has_exact {
            let dashes = (left..right).step_by(12).map(|x| [(x, exact), ((x + 6).min(right), exact)]);
            dashes.into_iter().try_for_each(|dash| canvas.draw(&PathElement::new(dash.to_vec(), BLACK.mix(0.5))))?;
            write_text(canvas, "exact", [left - 10, exact], 16, HPos::Right)?;
        }
        let place = |p: &Point| [x.pixel(p.x), if p.y > 0.0 { y.pixel(p.y) } else { exact }];
        let places: Vec<[i32; 2]> = self.points.iter().map(place).collect();
        self.draw_lines(canvas, &places)?;
        self.draw_labels(canvas, &places)?;
        for (point, at) in self.points.iter().zip(&places).rev() {
            draw_marker(canvas, *at, point.marker, COLOURS[point.colour % COLOURS.len()])?;
        }
        self.draw_legend(canvas)
    }
}

impl Chart {
    fn draw_axes<DB: DrawingBackend>(&self, canvas: &Canvas<DB>, x: &Axis, y: &Axis) -> Drawn<DB> {
        let [left, top, right, bottom] = FRAME;
        let grid = BLACK.mix(0.12);
        for tick in x.ticks() {
            let at = x.pixel(tick);
            canvas.draw(&PathElement::new(vec![(at, top), (at, bottom)], grid))?;
            write_text(canvas, &axis::name(tick), [at, bottom + 18], 16, HPos::Center)?;
        }
        for tick in y.ticks() {
            let at = y.pixel(tick);
            canvas.draw(&PathElement::new(vec![(left, at), (right, at)], grid))?;
            write_text(canvas, &axis::name(tick), [left - 10, at], 16, HPos::Right)?;
        }
        canvas.draw(&Rectangle::new([(left, top), (right, bottom)], BLACK.mix(0.6)))?;
        write_text(canvas, &self.title, [left, 32], 22, HPos::Left)?;
        write_text(canvas, self.axes[0], [(left + right) / 2, bottom + 52], 18, HPos::Center)?;
        let font = ("sans-serif", 18).into_font().transform(FontTransform::Rotate270);
        let style = font.color(&BLACK).pos(Pos::new(HPos::Center, VPos::Center));
        canvas.draw(&Text::new(self.axes[1].to_owned(), (32, (top + bottom) / 2), style))
    }

    fn draw_lines<DB: DrawingBackend>(&self, canvas: &Canvas<DB>, places: &[[i32; 2]]) -> Drawn<DB> {
        for (colour, line) in &self.lines {
            let points: Vec<(i32, i32)> = line.iter().map(|&i| (places[i][0], places[i][1])).collect();
            let style = match colour {
                Some(colour) => COLOURS[colour % COLOURS.len()].mix(0.7).stroke_width(2),
                None => BLACK.mix(0.35).stroke_width(3),
            };
            canvas.draw(&PathElement::new(points, style))?;
        }
        Ok(())
    }

    fn draw_labels<DB: DrawingBackend>(&self, canvas: &Canvas<DB>, places: &[[i32; 2]]) -> Drawn<DB> {
        let [left, top, right, bottom] = FRAME;
        let frame = Area([left + 4, top + 4, right - 4, bottom - 4]);
        let mut taken: Vec<Area> = places.iter().map(|&at| Area::around(at, MARKER + 2)).collect();
        taken.extend(self.lines.iter().flat_map(|(_, line)| line.windows(2)).flat_map(|ends| {
            let [from, to] = [places[ends[0]], places[ends[1]]];
            along(from, to).map(|at| Area::around(at, 2))
        }));
        let texts = self.texts(places);
        let label = |(i, text): &(usize, String)| Label { at: places[*i], size: extent(text, 14) };
        let labels: Vec<Label> = texts.iter().map(label).collect();
        for ((i, text), place) in texts.iter().zip(labels::place(&labels, &frame, taken)) {
            let Some((Area([x, y, right, bottom]), distance)) = place else { continue };
            let ([px, py], middle) = (places[*i], (y + bottom) / 2);
            if distance > NEAR {
                let end = (px.clamp(x, right), py.clamp(y, bottom));
                canvas.draw(&PathElement::new(vec![(px, py), end], BLACK.mix(0.4)))?;
            }
            write_text(canvas, text, [x, middle], 14, HPos::Left)?;
        }
        Ok(())
    }

    /// Returns the label of each place that has one, with the index of its first point. Of several labels, the first is
    /// shown with the number of others.
    fn texts(&self, places: &[[i32; 2]]) -> Vec<(usize, String)> {
        let mut found: Vec<(usize, Vec<&str>)> = Vec::new();
        for (i, point) in self.points.iter().enumerate().filter(|(_, point)| !point.label.is_empty()) {
            match found.iter_mut().find(|(j, _)| places[*j] == places[i]) {
                Some((_, labels)) if labels.contains(&point.label.as_str()) => {}
                Some((_, labels)) => labels.push(&point.label),
                None => found.push((i, vec![&point.label])),
            }
        }
        let text = |labels: &[&str]| match labels.len() {
            1 => labels[0].to_owned(),
            n => format!("{} (+{})", labels[0], n - 1),
        };
        found.into_iter().map(|(i, labels)| (i, text(&labels))).collect()
    }

    fn draw_legend<DB: DrawingBackend>(&self, canvas: &Canvas<DB>) -> Drawn<DB> {
        let (left, mut y) = (FRAME[2] + 28, FRAME[1] + 10);
        let mut line = |by: i32| {
            y += by;
            y
        };
        write_text(canvas, self.headings[0], [left, line(0)], 16, HPos::Left)?;
        for (colour, name) in &self.colours {
            let at = line(26);
            let colour = COLOURS[colour % COLOURS.len()];
            canvas.draw(&Rectangle::new([(left, at - 6), (left + 14, at + 6)], colour.filled()))?;
            write_text(canvas, name, [left + 24, at], 16, HPos::Left)?;
        }
        write_text(canvas, self.headings[1], [left, line(44)], 16, HPos::Left)?;
        for (marker, name) in &self.markers {
            let at = line(26);
            draw_marker(canvas, [left + 7, at], *marker, RGBColor(70, 70, 70))?;
            write_text(canvas, name, [left + 24, at], 16, HPos::Left)?;
        }
        line(18);
        if self.lines.iter().any(|(colour, _)| colour.is_none()) {
            let at = line(26);
            canvas.draw(&PathElement::new(vec![(left, at), (left + 16, at)], BLACK.mix(0.35).stroke_width(3)))?;
            write_text(canvas, "Pareto front", [left + 24, at], 16, HPos::Left)?;
        }
        self.notes.iter().try_for_each(|note| write_text(canvas, note, [left, line(26)], 14, HPos::Left))
    }
}

fn size() -> (u32, u32) {
    (SIZE[0] as u32, SIZE[1] as u32)
}

/// Makes the font known to the drawing library.
fn load_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let known = register_font("sans-serif", FontStyle::Normal, include_bytes!("../../render/roboto.ttf"));
        assert!(known.is_ok(), "the font is sound");
    });
}

/// Returns points of a line, about ten pixels apart.
fn along([x, y]: [i32; 2], [to_x, to_y]: [i32; 2]) -> impl Iterator<Item = [i32; 2]> {
    let steps = ((to_x - x).abs().max((to_y - y).abs()) / 10).max(1);
    (0..=steps).map(move |i| [x + (to_x - x) * i / steps, y + (to_y - y) * i / steps])
}

/// Width and height of a text.
fn extent(text: &str, size: i32) -> [i32; 2] {
    let (width, _) = ("sans-serif", size).into_font().box_size(text).unwrap_or((8 * text.len() as u32, 0));
    [width as i32 + 4, size + 4]
}

/// Writes text whose left end, middle or right end is at a place.
fn write_text<DB: DrawingBackend>(canvas: &Canvas<DB>, text: &str, at: [i32; 2], size: i32, h: HPos) -> Drawn<DB> {
    let style = ("sans-serif", size).into_font().color(&BLACK).pos(Pos::new(h, VPos::Center));
    canvas.draw(&Text::new(text.to_owned(), (at[0], at[1]), style))
}

fn draw_marker<DB: DrawingBackend>(
    canvas: &Canvas<DB>,
    [x, y]: [i32; 2],
    marker: usize,
    colour: RGBColor,
) -> Drawn<DB> {
    let r = MARKER;
    let polygon: &[(i32, i32)] = match marker {
        0 => &[(0, -7), (7, 6), (-7, 6)],
        1 => return canvas.draw(&Circle::new((x, y), r, colour.filled())),
        2 => &[(-5, -5), (5, -5), (5, 5), (-5, 5)],
        3 => &[(0, -8), (7, 0), (0, 8), (-7, 0)],
        _ => &[
            (-7, -2),
            (-2, -2),
            (-2, -7),
            (2, -7),
            (2, -2),
            (7, -2),
            (7, 2),
            (2, 2),
            (2, 7),
            (-2, 7),
            (-2, 2),
            (-7, 2),
        ],
    };
    let corners: Vec<(i32, i32)> = polygon.iter().map(|(dx, dy)| (x + dx, y + dy)).collect();
    canvas.draw(&Polygon::new(corners, colour.filled()))
}
