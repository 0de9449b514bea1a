//! Figures of an experiment.

use std::path::Path;

use super::placed::Placement;
use super::rows::ErrorRow;
use crate::choose::Choice;
use crate::lab::LabError;
use crate::lab::error_vs_time::config::Tracer;
use crate::lab::plot::{Chart, Drawing, Point};
use crate::methods::Method;

/// Names of the axes.
const AXES: [&str; 2] = ["nanoseconds per ray", "relative distance error that 1 hit in 1000 exceeds"];

/// Writes the figure of a scene at one place: each layout by each tracer.
///
/// # Errors
/// Fails if a file cannot be written.
pub(super) fn scene(rows: &[ErrorRow], folder: &Path) -> Result<(), LabError> {
    let Some(first) = rows.first() else { return Ok(()) };
    let (methods, tracers) = (methods(), Tracer::ALL.map(Tracer::name));
    let point = |row: &ErrorRow| Point {
        x: row.nanoseconds_per_ray,
        y: row.p999_distance_error,
        colour: index(&methods, row.method),
        marker: index(&tracers, row.tracer),
        label: [row.method.to_owned(), row.settings_in_words()].join(" ").trim_end().to_owned(),
    };
    let mut points: Vec<Point> = rows.iter().filter(|row| row.nanoseconds_per_ray > 0.0).map(point).collect();
    let front = front_first(&mut points);
    let chart = Chart {
        title: format!("{} ({}): error against time", first.scene, words(first.placement)),
        axes: AXES,
        points,
        lines: vec![(None, (0..front).collect())],
        headings: ["method", "tracer"],
        colours: named(methods, |name| rows.iter().any(|row| row.method == name)),
        markers: named(tracers, |name| rows.iter().any(|row| row.tracer == name)),
        notes: devices(rows.iter()),
    };
    chart.write(folder, &file_name(&[&first.scene, first.placement]))
}

/// Writes, for each scene with several places, what precision costs: the tracers of one method at each place.
///
/// # Errors
/// Fails if a file cannot be written.
pub(super) fn precision(rows: &[ErrorRow], folder: &Path) -> Result<(), LabError> {
    let mut scenes: Vec<&str> = rows.iter().map(|row| row.scene.as_str()).collect();
    scenes.dedup();
    for scene in scenes {
        let of_scene: Vec<&ErrorRow> = rows.iter().filter(|row| row.scene == scene).collect();
        let is_input = of_scene.iter().any(|row| row.method == Method::Keep.name());
        let method = if is_input { Method::Keep.name() } else { of_scene[0].method };
        let mut first: Vec<&ErrorRow> = Vec::new();
        for row in of_scene.into_iter().filter(|row| row.method == method && row.nanoseconds_per_ray > 0.0) {
            if first.iter().all(|known| (known.placement, known.tracer) != (row.placement, row.tracer)) {
                first.push(row);
            }
        }
        if first.iter().any(|row| row.placement != first[0].placement) {
            precision_chart(&first, scene, method).write(folder, &file_name(&["precision", scene]))?;
        }
    }
    Ok(())
}

fn precision_chart(rows: &[&ErrorRow], scene: &str, method: &str) -> Chart {
    let placements = Placement::ALL.map(Placement::name);
    let tracers = Tracer::ALL.map(Tracer::name);
    let point = |row: &&ErrorRow| Point {
        x: row.nanoseconds_per_ray,
        y: row.p999_distance_error,
        colour: index(&placements, row.placement),
        marker: index(&tracers, row.tracer),
        label: row.tracer.to_owned(),
    };
    let line = |colour: usize| {
        let mut line: Vec<usize> = (0..rows.len()).filter(|&i| rows[i].placement == placements[colour]).collect();
        line.sort_by_key(|&i| index(&tracers, rows[i].tracer));
        (Some(colour), line)
    };
    Chart {
        title: format!("What precision costs: {scene}, {method}"),
        axes: AXES,
        points: rows.iter().map(point).collect(),
        lines: (0..placements.len()).map(line).collect(),
        headings: ["place of the scene", "tracer"],
        colours: named(placements.map(words), |name| rows.iter().any(|row| words(row.placement) == name)),
        markers: named(tracers, |name| rows.iter().any(|row| row.tracer == name)),
        notes: devices(rows.iter().copied()),
    }
}

/// A place in words.
fn words(placement: &str) -> &'static str {
    match placement {
        "far" => "1000 diagonals away",
        "stretched" => "stretched 1e6 : 1",
        _ => "as in its file",
    }
}

/// Moves the points that no other point beats in both directions to the front, fastest first, and returns their number.
fn front_first(points: &mut Vec<Point>) -> usize {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut least = f64::INFINITY;
    let (mut front, mut rest) = (Vec::new(), Vec::new());
    for point in points.drain(..) {
        let is_better = point.y < least;
        least = least.min(point.y);
        if is_better { front.push(point) } else { rest.push(point) }
    }
    let count = front.len();
    *points = front;
    points.extend(rest);
    count
}

fn methods() -> [&'static str; 7] {
    let [a, b, c, d, e, f] = Method::ALL.map(Method::name);
    [Choice::Auto.name(), a, b, c, d, e, f]
}

/// Returns those of a set of names that occur, with their numbers.
fn named<const N: usize>(all: [&str; N], occurs: impl Fn(&str) -> bool) -> Vec<(usize, String)> {
    all.into_iter().enumerate().filter(|(_, name)| occurs(name)).map(|(i, name)| (i, name.to_owned())).collect()
}

fn index(names: &[&str], name: &str) -> usize {
    names.iter().position(|of| *of == name).unwrap_or(0)
}

/// What traced, once each.
fn devices<'r>(rows: impl Iterator<Item = &'r ErrorRow>) -> Vec<String> {
    let mut devices: Vec<String> = rows.map(|row| row.device.clone()).collect();
    devices.sort();
    devices.dedup();
    devices
}

/// Returns a name for a file: letters, digits, dots and hyphens.
fn file_name(words: &[&str]) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    let name: String = words.join("-").chars().map(plain).collect();
    name.trim_start_matches('-').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &'static str, nanoseconds_per_ray: f64, p999_distance_error: f64) -> ErrorRow {
        ErrorRow {
            scene: "a/b.glb".into(),
            placement: "as-is",
            method,
            tracer: "f64",
            nanoseconds_per_ray,
            p999_distance_error,
            ..ErrorRow::default()
        }
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let point = |x: f64, y: f64| Point { x, y, colour: 0, marker: 0, label: String::new() };
        let mut points = vec![point(3.0, 0.0), point(1.0, 5.0), point(2.0, 6.0), point(2.5, 1.0), point(4.0, 0.0)];
        assert_eq!(front_first(&mut points), 3);
        assert_eq!(points.iter().map(|p| p.x).collect::<Vec<_>>(), [1.0, 2.5, 3.0, 2.0, 4.0]);
    }

    #[test]
    fn figures_show_every_label_that_fits_and_the_exact_line() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        scene(&[row("keep", 100.0, 1e-7), row("cluster", 50.0, 0.0)], folder.path()).expect("written");
        let text = std::fs::read_to_string(folder.path().join("a-b.glb-as-is.svg")).expect("a figure");
        for word in ["keep", "cluster", "exact", "Pareto front", "nanoseconds per ray", "f64"] {
            assert!(text.contains(word), "{word}");
        }
        let png = std::fs::read(folder.path().join("a-b.glb-as-is.png")).expect("a figure");
        assert!(png.starts_with(b"\x89PNG"));
    }

    #[test]
    fn what_precision_costs_is_drawn_for_scenes_with_several_places() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let far = ErrorRow { placement: "far", ..row("keep", 120.0, 1e-3) };
        precision(&[row("keep", 100.0, 1e-7), far], folder.path()).expect("written");
        let other = ErrorRow { scene: "c".into(), ..row("keep", 100.0, 1e-7) };
        precision(&[other], folder.path()).expect("nothing to write");
        let mut names: Vec<_> =
            std::fs::read_dir(folder.path()).expect("a folder").map(|e| e.expect("an entry").file_name()).collect();
        names.sort();
        assert_eq!(names, ["precision-a-b.glb.png", "precision-a-b.glb.svg"]);
    }
}
