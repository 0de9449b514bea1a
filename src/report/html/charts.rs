//! The charts of a page, each with its data as a table.

use serde::Serialize;

use super::svg::{Anchor, Axis, Canvas, Scale, WIDTH, significant};
use crate::report::OverlappingPair;
use crate::report::candidates::significant as three_digits;
use crate::report::words::{bytes, counted, grouped};
use crate::report::{Candidate, MethodReport, Seconds, Speed};
use crate::verify::cpu::Precision;
use crate::verify::precisions::OfPrecision;
use crate::verify::verdict::SpeedBy;
use crate::verify::{Sides, Verification};

/// Width kept free for labels at the left.
const LABELS: f64 = 262.0;
/// Height of a row.
const ROW: f64 = 29.0;
/// Place of the left and right end of charts with numbers at the left.
pub(super) const FRAME: [f64; 2] = [80.0, WIDTH - 20.0];

/// A chart and its data.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Chart {
    /// Identifies it within the page.
    pub(super) id: &'static str,
    pub(super) title: &'static str,
    /// What to look for.
    pub(super) caption: String,
    pub(super) svg: String,
    /// What the classes of marks mean: class and words.
    pub(super) legend: Vec<(&'static str, &'static str)>,
    /// Headings of the table; the first column names the row.
    pub(super) head: Vec<&'static str>,
    pub(super) rows: Vec<Vec<String>>,
}

const BEFORE_AFTER: [(&str, &str); 2] = [("before", "before"), ("after", "after")];

/// A row of a chart of bars or of ratios.
struct Row {
    label: String,
    values: Vec<f64>,
    tip: String,
}

/// How many times as fast rays are after as before, by kind and by view; `None` if none were timed.
pub(super) fn speed(verification: &Verification, overall: &Speed) -> Option<Chart> {
    if verification.speed_by == SpeedBy::Nothing {
        return None;
    }
    let kinds = verification.kinds.iter().filter(|(_, k)| k.before_mrays_per_s > 0.0);
    let kinds = kinds.map(|(kind, k)| (format!("{} rays", kind.name()), k.speedup_ratio, k.spread_ratio));
    let all = [("all kinds, weighted".to_owned(), overall.speedup_ratio, overall.spread_ratio)];
    let views = verification.views.iter().filter_map(|view| {
        let spread = view.spread_ratio.unwrap_or(f64::INFINITY);
        Some((format!("view `{}`", view.name), view.speedup_ratio?, spread))
    });
    let rows: Vec<(String, f64, f64)> = all.into_iter().chain(kinds).chain(views).collect();
    let cells = |(label, ratio, spread): &(String, f64, f64)| vec![label.clone(), ratio_of(*ratio), spread_of(*spread)];
    Some(Chart {
        id: "chart-speed",
        title: "Speed after over speed before, by ray kind and view",
        caption: "Right of the line at 1 the output is faster. The bars show how far repeats and views spread.".into(),
        svg: ratios("chart-speed", &rows),
        legend: Vec::new(),
        head: vec!["rays", "times as fast", "spread"],
        rows: rows.iter().map(cells).collect(),
    })
}

fn ratio_of(ratio: f64) -> String {
    format!("{ratio:.3}")
}

fn spread_of(spread: f64) -> String {
    if spread.is_finite() { format!("\u{b1} {spread:.3}") } else { "too few repeats".to_owned() }
}

/// Dots with the reach of their spreads, and a line at 1.
fn ratios(id: &str, rows: &[(String, f64, f64)]) -> String {
    let bottom = ROW * rows.len() as f64 + 8.0;
    let finite = |spread: f64| if spread.is_finite() { spread } else { 0.0 };
    let reach = rows.iter().flat_map(|(_, ratio, spread)| [ratio - finite(*spread), ratio + finite(*spread)]);
    let axis = Axis::over(Scale::Linear, reach.chain([1.0]), [LABELS, WIDTH - 20.0]);
    let mut canvas = Canvas::new(bottom + 26.0);
    grid(&mut canvas, &axis, [0.0, bottom]);
    canvas.line([axis.place(1.0), 0.0], [axis.place(1.0), bottom], "reference");
    for (i, (label, ratio, spread)) in rows.iter().enumerate() {
        let y = ROW * (i as f64 + 0.5) + 4.0;
        let class = if i == 0 { "label strong" } else { "label" };
        canvas.text([LABELS - 12.0, y + 4.0], class, Anchor::End, label);
        let [from, to] = [ratio - finite(*spread), ratio + finite(*spread)].map(|v| axis.place(v));
        canvas.line([from, y], [to, y], "whisker");
        let tip = format!("{label}: {} {}", ratio_of(*ratio), spread_of(*spread));
        canvas.dot([axis.place(*ratio), y], if i == 0 { 6.5 } else { 4.5 }, "after", &tip);
    }
    canvas.finish(id)
}

/// Vertical lines at the marks of a horizontal axis, with labels below.
fn grid(canvas: &mut Canvas, axis: &Axis, [top, bottom]: [f64; 2]) {
    for (value, label) in axis.marks() {
        let x = axis.place(value);
        canvas.line([x, top], [x, bottom], "grid");
        canvas.text([x, bottom + 18.0], "mark", Anchor::Middle, &label);
    }
}

/// Horizontal lines at the marks of a vertical axis, with labels at the left.
pub(super) fn side_grid(canvas: &mut Canvas, axis: &Axis) {
    for (value, label) in axis.marks() {
        let y = axis.place(value);
        canvas.line([FRAME[0], y], [FRAME[1], y], "grid");
        canvas.text([FRAME[0] - 8.0, y + 4.0], "mark", Anchor::End, &label);
    }
}

/// Horizontal bars, one per value of a row.
fn bars(id: &str, rows: &[Row], classes: &[&'static str]) -> String {
    let bar = if classes.len() > 1 { 12.0 } else { 18.0 };
    let row = bar * classes.len() as f64 + 10.0;
    let bottom = row * rows.len() as f64 + 6.0;
    let axis = Axis::from_zero(rows.iter().flat_map(|r| r.values.iter().copied()), [LABELS, WIDTH - 20.0]);
    let mut canvas = Canvas::new(bottom + 26.0);
    grid(&mut canvas, &axis, [0.0, bottom]);
    for (i, Row { label, values, tip }) in rows.iter().enumerate() {
        let top = row * i as f64 + 8.0;
        canvas.text([LABELS - 12.0, top + 0.5 * (row - 10.0) + 4.0], "label", Anchor::End, label);
        for (k, (value, class)) in values.iter().zip(classes).enumerate() {
            let width = axis.place(*value) - LABELS;
            canvas.rectangle([LABELS, top + bar * k as f64], [width, bar - 1.0], class, tip);
        }
    }
    canvas.finish(id)
}

/// Seconds by stage.
pub(super) fn seconds(seconds: &Seconds) -> Chart {
    let Seconds { read, analyse, optimise, write, verify, .. } = *seconds;
    let stages = [
        ("read the scene", read),
        ("measure the layouts", analyse),
        ("choose a layout", optimise),
        ("write the output", write),
        ("verify the output", verify),
    ];
    let row = |(label, seconds): (&str, f64)| Row {
        label: label.to_owned(),
        values: vec![seconds],
        tip: format!("{label}: {} s", significant(seconds)),
    };
    Chart {
        id: "chart-seconds",
        title: "Seconds by stage",
        caption: format!("The bake took {} s in all.", three_digits(seconds.total)),
        svg: bars("chart-seconds", &stages.map(row), &["neutral"]),
        legend: Vec::new(),
        head: vec!["stage", "seconds"],
        rows: stages.iter().map(|(label, s)| vec![(*label).to_owned(), format!("{s:.3}")]).collect(),
    }
}

/// The pairs of instances that overlap most in the input; `None` if none do. The table has those of the output, too.
pub(super) fn overlaps(overlaps: &Sides<Vec<OverlappingPair>>, has_after: bool) -> Option<Chart> {
    if overlaps.before.is_empty() {
        return None;
    }
    let bar = |p: &OverlappingPair| Row {
        label: format!("{} \u{d7} {}", shortened(&p.a), shortened(&p.b)),
        values: vec![p.overlap_ratio],
        tip: format!("{} and {}: {:.4}", p.a, p.b, p.overlap_ratio),
    };
    let cells = |p: &OverlappingPair, file: &str| {
        vec![p.a.clone(), p.b.clone(), file.to_owned(), format!("{:.4}", p.overlap_ratio)]
    };
    let rows: Vec<Row> = overlaps.before.iter().map(bar).collect();
    let after = overlaps.after.iter().filter(|_| has_after);
    Some(Chart {
        id: "chart-overlaps",
        title: "Worst overlaps in the input",
        caption: format!(
            "A ray that enters a place in two boxes has to search both. Surface area of the intersection of two instance \
             boxes over that of the scene without sky domes and far objects. {}",
            if has_after { worst_after(overlaps.after.first()) } else { String::new() }
        ),
        svg: bars("chart-overlaps", &rows, &["before"]),
        legend: Vec::new(),
        head: vec!["object", "other object", "file", "overlap"],
        rows: overlaps.before.iter().map(|p| cells(p, "before")).chain(after.map(|p| cells(p, "after"))).collect(),
    })
}

fn shortened(name: &str) -> String {
    let most = 10;
    let short: String = name.chars().take(most).collect();
    if name.chars().nth(most).is_some() { format!("{short}\u{2026}") } else { short }
}

fn worst_after(worst: Option<&OverlappingPair>) -> String {
    match worst {
        None => "In the output no two boxes overlap.".to_owned(),
        Some(pair) => format!("In the output the worst pair overlaps by {}.", significant(pair.overlap_ratio)),
    }
}

/// How many groups have how many triangles, by powers of two.
pub(super) fn sizes(sizes: &Sides<Vec<u64>>, has_after: bool) -> Chart {
    let class = |triangles: u64| triangles.max(1).ilog2() as usize;
    let all = || sizes.before.iter().chain(sizes.after.iter().filter(|_| has_after));
    let (first, last) = all().fold((64, 0), |(a, b), &t| (a.min(class(t)), b.max(class(t))));
    let count = |of: &[u64], k: usize| of.iter().filter(|&&t| class(t) == k).count();
    let classes: Vec<usize> = if first <= last { (first..=last).collect() } else { Vec::new() };
    let label =
        |k: usize| if k == 0 { "1".to_owned() } else { format!("{} to {}", grouped(1 << k), grouped((2 << k) - 1)) };
    let row = |&k: &usize| {
        let (before, after) = (count(&sizes.before, k), count(&sizes.after, k));
        let values = if has_after { vec![before as f64, after as f64] } else { vec![before as f64] };
        let tip = if has_after { format!("{before} groups before, {after} after") } else { counted(before, "group") };
        Row { label: label(k), values, tip: format!("{} triangles: {tip}", label(k)) }
    };
    let rows: Vec<Row> = classes.iter().map(row).collect();
    let cells = |row: &Row| [vec![row.label.clone()], row.values.iter().map(|v| format!("{v:.0}")).collect()].concat();
    Chart {
        id: "chart-sizes",
        title: "Triangles per group",
        caption:
            "Number of groups by how many triangles they hold. Many tiny groups cost more to enter than to search."
                .into(),
        svg: bars("chart-sizes", &rows, if has_after { &["before", "after"] } else { &["before"] }),
        legend: if has_after { BEFORE_AFTER.to_vec() } else { Vec::new() },
        head: if has_after { vec!["triangles", "groups before", "groups after"] } else { vec!["triangles", "groups"] },
        rows: rows.iter().map(cells).collect(),
    }
}

/// A point of a scatter chart.
struct Point {
    x: f64,
    y: f64,
    label: String,
    class: &'static str,
}

const OF_CANDIDATES: [(&str, &str); 3] =
    [("chosen", "chosen"), ("input", "the input as it is"), ("other", "considered")];

/// The candidates: speed against bytes, and error against run time; empty if fewer than two can be compared.
pub(super) fn candidates(method: &MethodReport) -> Vec<Chart> {
    let compared: Vec<(&Candidate, f64)> =
        method.candidates.iter().filter_map(|c| Some((c, c.measured_picoseconds.or(c.sampled_cost)?))).collect();
    if compared.len() < 2 {
        return Vec::new();
    }
    let measured = compared.iter().all(|(c, _)| c.measured_picoseconds.is_some());
    let how = if measured { "measured" } else { "measured where a device timed them, else predicted" };
    let how = if compared.iter().all(|(c, _)| c.measured_picoseconds.is_none()) { "predicted" } else { how };
    vec![speed_and_bytes(method, &compared, how), error_and_time(method, &compared, how)]
}

fn class_of(candidate: &Candidate, method: &MethodReport) -> &'static str {
    match candidate.id {
        id if id == method.chosen_candidate => "chosen",
        id if id.is_input() => "input",
        _ => "other",
    }
}

fn speed_and_bytes(method: &MethodReport, compared: &[(&Candidate, f64)], how: &str) -> Chart {
    let input = compared.iter().find(|(c, _)| c.id.is_input()).unwrap_or(&compared[0]).1;
    let points = compared.iter().map(|(c, ps)| {
        let class = class_of(c, method);
        Point { x: c.as_bytes as f64, y: input / ps, label: c.id.to_string(), class }
    });
    let points: Vec<Point> = points.collect();
    let tip = |p: &Point| format!("{}: {} times as fast, {}", p.label, ratio_of(p.y), bytes(p.x as u64));
    let y = Axis::over(Scale::Linear, points.iter().map(|p| p.y).chain([1.0]), [300.0, 16.0]);
    let row = |p: &Point| vec![p.label.clone(), ratio_of(p.y), bytes(p.x as u64), words_of_class(p.class).to_owned()];
    Chart {
        id: "chart-bytes",
        title: "Layouts considered: speed against memory",
        caption: format!(
            "Up is faster, left is smaller. Speed over that of the input, {how}; bytes of acceleration structures, predicted."
        ),
        svg: scatter("chart-bytes", &points, y, &tip, &|v| bytes(v as u64), false),
        legend: OF_CANDIDATES.to_vec(),
        head: vec!["layout", "times as fast", "bytes", ""],
        rows: points.iter().map(row).collect(),
    }
}

fn error_and_time(method: &MethodReport, compared: &[(&Candidate, f64)], how: &str) -> Chart {
    let points = compared.iter().map(|(c, ps)| {
        let class = class_of(c, method);
        Point { x: *ps, y: c.accuracy.p999_relative_distance_error, label: c.id.to_string(), class }
    });
    let points: Vec<Point> = points.collect();
    let tip = |p: &Point| format!("{}: error {:.1e}, {} picoseconds per ray", p.label, p.y, three_digits(p.x));
    let y = Axis::over(Scale::Logarithmic, points.iter().map(|p| p.y), [270.0, 16.0]);
    let front = front(&points);
    let row = |(i, p): (usize, &Point)| {
        let on_front = if front.contains(&i) { "yes" } else { "no" };
        let class = words_of_class(p.class).to_owned();
        vec![p.label.clone(), three_digits(p.x), format!("{:.2e}", p.y), on_front.to_owned(), class]
    };
    Chart {
        id: "chart-error",
        title: "Layouts considered: error against run time",
        caption: format!(
            "Down is more accurate, left is faster. No layout is both faster and more accurate than one on the Pareto \
             front. Time per ray in picoseconds, {how}; relative distance error that 99.9 % of hits do not exceed."
        ),
        svg: scatter("chart-error", &points, y, &tip, &three_digits, true),
        legend: [&OF_CANDIDATES[..], &[("front", "Pareto front")]].concat(),
        head: vec!["layout", "picoseconds per ray", "hit error", "on the Pareto front", ""],
        rows: points.iter().enumerate().map(row).collect(),
    }
}

fn words_of_class(class: &str) -> &str {
    OF_CANDIDATES.iter().find(|(name, _)| *name == class).map_or("", |(_, words)| words)
}

/// The tracers of the CPU: error against run time; `None` if they saw nothing.
pub(super) fn precisions(all: &[OfPrecision]) -> Option<Chart> {
    let points = all.iter().map(|of| {
        let class = if of.precision == Precision::F32Watertight { "chosen" } else { "other" };
        Point { x: of.nanoseconds_per_ray, y: of.errors.p999, label: of.precision.name().to_owned(), class }
    });
    let points: Vec<Point> = points.collect();
    let tip = |p: &Point| format!("{}: error {:.1e}, {} ns per ray", p.label, p.y, three_digits(p.x));
    let y = Axis::over(Scale::Logarithmic, points.iter().map(|p| p.y), [270.0, 16.0]);
    let row = |of: &OfPrecision| {
        vec![
            of.precision.name().to_owned(),
            three_digits(of.nanoseconds_per_ray),
            format!("{:.2e}", of.errors.p999),
            format!("{:.2e}", of.errors.largest),
            format!("{:.0}", of.errors.far_per_million),
        ]
    };
    (!all.is_empty()).then(|| Chart {
        id: "chart-precisions",
        title: "What precision costs: error against run time of tracers",
        caption: "Rays of all kinds through this scene on the CPU, in four arithmetics; GPUs compute about as \
                  f32-watertight does. Nanoseconds per ray; relative distance error that 99.9 % of hits do not exceed."
            .into(),
        svg: scatter("chart-precisions", &points, y, &tip, &|v| format!("{} ns", three_digits(v)), true),
        legend: vec![("chosen", "as verification traces"), ("other", "other tracers"), ("front", "Pareto front")],
        head: vec!["tracer", "ns per ray", "hit error", "largest error", "far hits per million"],
        rows: all.iter().map(row).collect(),
    })
}

/// The points that no other beats in one coordinate without losing in the other, by ascending x.
fn front(points: &[Point]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].x.total_cmp(&points[b].x).then(points[a].y.total_cmp(&points[b].y)));
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let is_better = points[i].y < least;
        least = least.min(points[i].y);
        is_better
    });
    order
}

/// Points over a logarithmic horizontal axis; points of value 0 on a logarithmic vertical axis lie on a line "exact".
fn scatter(
    id: &str,
    points: &[Point],
    y: Axis,
    tip: &dyn Fn(&Point) -> String,
    unit: &dyn Fn(f64) -> String,
    with_front: bool,
) -> String {
    const BOTTOM: f64 = 308.0;
    let x = Axis::over(Scale::Logarithmic, points.iter().map(|p| p.x), FRAME);
    let mut canvas = Canvas::new(BOTTOM + 30.0);
    side_grid(&mut canvas, &y);
    for (value, _) in x.marks() {
        canvas.line([x.place(value), 10.0], [x.place(value), BOTTOM], "grid");
        canvas.text([x.place(value), BOTTOM + 18.0], "mark", Anchor::Middle, &unit(value));
    }
    let place = |p: &Point| [x.place(p.x), if with_front && p.y <= 0.0 { BOTTOM - 14.0 } else { y.place(p.y) }];
    if with_front {
        if points.iter().any(|p| p.y <= 0.0) {
            canvas.text([FRAME[0] - 8.0, BOTTOM - 10.0], "mark", Anchor::End, "exact");
        }
        let front: Vec<[f64; 2]> = front(points).into_iter().map(|i| place(&points[i])).collect();
        canvas.path(&front, "front");
    }
    // The chosen one is drawn last, over the others.
    for class in ["other", "input", "chosen"] {
        for point in points.iter().filter(|p| p.class == class) {
            let at = place(point);
            canvas.dot(at, if class == "other" { 5.0 } else { 7.0 }, class, &tip(point));
            if class != "other" {
                label(&mut canvas, at, &point.label);
            }
        }
    }
    canvas.finish(id)
}

/// Writes a label beside a point, on the side that has room.
fn label(canvas: &mut Canvas, [x, y]: [f64; 2], text: &str) {
    let is_right = x > 0.6 * WIDTH;
    let (x, anchor) = if is_right { (x - 11.0, Anchor::End) } else { (x + 11.0, Anchor::Start) };
    canvas.text([x, y + 4.0], "label", anchor, text);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::DecidedBy;
    use crate::report::tests::method;

    fn point(x: f64, y: f64) -> Point {
        Point { x, y, label: String::new(), class: "other" }
    }

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let points = [point(2.0, 1.0), point(1.0, 3.0), point(3.0, 2.0), point(4.0, 0.0), point(2.0, 2.0)];
        assert_eq!(front(&points), [1, 0, 3]);
    }

    #[test]
    fn candidates_are_charted_with_all_their_data_and_the_chosen_one_marked() {
        let charts = candidates(&method(DecidedBy::Prediction));
        assert_eq!(charts.len(), 2);
        for chart in charts {
            assert_eq!(chart.rows.len(), 2);
            assert!(chart.rows.iter().all(|row| row.len() == chart.head.len()));
            assert_eq!(chart.svg.matches(r#"class="chosen""#).count(), 1, "{}", chart.svg);
            assert_eq!(chart.svg.matches("<circle").count(), 2);
        }
    }

    #[test]
    fn one_candidate_alone_is_not_charted() {
        let mut one = method(DecidedBy::Prediction);
        one.candidates.truncate(1);
        assert!(candidates(&one).is_empty());
    }

    #[test]
    fn groups_are_counted_by_powers_of_two() {
        let chart = sizes(&Sides { before: vec![1, 2, 3, 9], after: vec![15] }, true);
        let expected = [["1", "1", "0"], ["2 to 3", "2", "0"], ["4 to 7", "0", "0"], ["8 to 15", "1", "1"]];
        assert_eq!(chart.rows, expected);
        assert!(sizes(&Sides { before: vec![], after: vec![] }, true).rows.is_empty());
    }

    #[test]
    fn no_overlap_is_no_chart() {
        assert!(overlaps(&Sides { before: vec![], after: vec![] }, true).is_none());
    }
}
