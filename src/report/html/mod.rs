//! Reports as one HTML page that needs no network: its style, scripts, charts and data are in it.
//!
//! `assets/page.html` is the template, a Jinja template with automatic escaping; `assets/page.css` and `assets/page.js`
//! are its style and script, `assets/pane.min.js` is the 3D pane, made from `web/`. This module gathers what the template
//! shows; all sentences are made here and in the other modules of the reports.

mod batch;
mod charts;
mod headline;
mod pictures;
mod preview;
mod rounds;
mod rows;
mod shown;
mod study;
mod svg;
mod text;

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, Output, State, Value, context, escape_formatter};
use serde::Serialize;

pub use self::batch::batch;
use self::charts::Chart;
use self::headline::Headline;
pub use self::pictures::Drawn;
use self::pictures::Pair;
use self::rows::Section;
pub use self::shown::Shown;
pub use self::study::study;
use self::text::{MOST_CHARACTERS, json_for_script, visible};
use super::json::to_json;
use super::words::{bytes, counted, grouped};
use super::{BakeReport, Finding, Input, InspectReport, MethodReport, Pass, VerifyReport};
use crate::verify::{Sides, Verification};

/// A JSON report of more bytes is not embedded, so that the page stays small.
const MOST_JSON: usize = 1 << 20;
/// Maximum number of findings, notes, warnings or candidates listed. The JSON report has all.
const MOST_LISTED: usize = 200;

/// What the template shows.
#[derive(Serialize)]
struct Page {
    /// `bake`, `verify` or `inspect`.
    command: &'static str,
    /// The input and, if there is one, the output.
    files: Vec<String>,
    headline: Headline,
    /// What the input consists of: values and words.
    counts: Vec<(String, String)>,
    /// The same views of both files.
    pictures: Vec<Pair>,
    /// The table of both files, or of one.
    sections: Vec<Section>,
    has_after: bool,
    charts_of_speed: Vec<Chart>,
    charts_of_scene: Vec<Chart>,
    charts_of_layouts: Vec<Chart>,
    charts_of_time: Vec<Chart>,
    /// Why the layout was chosen.
    choice: Option<String>,
    candidates: Listed<Row>,
    applied: Vec<Row>,
    left_out: Vec<Row>,
    findings: Option<Findings>,
    /// Whether what moves can be refitted, in sentences.
    motion: Vec<String>,
    /// How exact the output is, in sentences.
    accuracy: Vec<String>,
    notes: Listed<String>,
    warnings: Listed<String>,
    /// The JSON report, if it is not too large, and its file name.
    json: Option<String>,
    json_name: String,
    /// What the scripts show of the scenes; `None` if nothing was gathered.
    scene: Option<String>,
}

/// A name with what is said about it, and numbers.
#[derive(Serialize)]
struct Row {
    name: String,
    words: String,
    cells: Vec<String>,
}

/// The first of a list, and how many more there are.
#[derive(Serialize)]
struct Listed<T> {
    first: Vec<T>,
    more: usize,
}

#[derive(Serialize)]
struct Findings {
    list: Listed<Finding>,
    /// How many rules were checked; empty if that is not reported.
    checked: String,
}

impl Findings {
    /// The findings about a scene; `checked` rules were checked, 0 if that is not reported.
    fn of(findings: &[Finding], checked: usize) -> Findings {
        let checked = if checked == 0 { String::new() } else { counted(checked, "rule") };
        Findings { list: Listed::of(findings.iter().cloned()), checked }
    }
}

impl<T> Listed<T> {
    fn of(all: impl ExactSizeIterator<Item = T>) -> Listed<T> {
        let more = all.len().saturating_sub(MOST_LISTED);
        Listed { first: all.take(MOST_LISTED).collect(), more }
    }
}

/// Returns a bake's report as a page; `shown` is what was gathered of the scenes.
pub fn bake(report: &BakeReport, shown: Option<&Shown>) -> String {
    let metrics = Sides { before: &report.before, after: &report.after };
    let files = Sides { before: report.input.bytes, after: Some(report.output_bytes) };
    let pass = |p: &Pass| Row { name: p.id.name().to_owned(), words: p.reason.clone(), cells: Vec::new() };
    let passes = |applied: bool| report.passes.iter().filter(|p| p.applied == applied).map(pass).collect();
    let of_rounds = report.overlap_rounds.as_ref().and_then(rounds::chart);
    let page = Page {
        files: vec![report.input.path.display().to_string(), report.output.display().to_string()],
        headline: headline::of_bake(report),
        sections: rows::of_both(metrics, files, &report.verify, &report.overall),
        has_after: true,
        charts_of_speed: charts::speed(&report.verify, &report.overall).into_iter().collect(),
        charts_of_layouts: of_rounds.into_iter().chain(charts::candidates(&report.method)).collect(),
        charts_of_time: vec![charts::seconds(&report.seconds)],
        findings: Some(Findings::of(&report.findings, 0)),
        motion: report.motion.iter().flat_map(super::motion::sentences).map(|s| headline::sentence(&s)).collect(),
        choice: Some(report.method.reason.clone()),
        candidates: candidates(&report.method),
        applied: passes(true),
        left_out: passes(false),
        accuracy: accuracy(&report.verify),
        notes: Listed::of(report.notes.iter().cloned()),
        warnings: Listed::of(report.warnings.iter().cloned()),
        ..Page::of("bake", &report.input, report, shown)
    };
    page.render()
}

/// Returns the report of a comparison as a page; `shown` is what was gathered of the scenes.
pub fn verify(report: &VerifyReport, shown: Option<&Shown>) -> String {
    let metrics = Sides { before: &report.before, after: &report.after };
    let files = Sides { before: report.input.bytes, after: report.output_bytes };
    let page = Page {
        files: vec![report.input.path.display().to_string(), report.output.display().to_string()],
        headline: headline::of_verification(report),
        sections: rows::of_both(metrics, files, &report.verify, &report.overall),
        has_after: true,
        charts_of_speed: charts::speed(&report.verify, &report.overall).into_iter().collect(),
        findings: Some(Findings::of(&report.findings, 0)),
        accuracy: accuracy(&report.verify),
        notes: Listed::of(report.notes.iter().cloned()),
        warnings: Listed::of(report.warnings.iter().cloned()),
        ..Page::of("verify", &report.input, report, shown)
    };
    page.render()
}

/// Returns the report of an inspection as a page; `shown` is what was gathered of the scene.
pub fn inspect(report: &InspectReport, shown: Option<&Shown>) -> String {
    let page = Page {
        headline: headline::of_inspection(report),
        sections: rows::of_one(&report.before, report.input.bytes),
        findings: Some(Findings::of(&report.findings, report.rules_checked.len())),
        motion: report.motion.iter().flat_map(super::motion::sentences).map(|s| headline::sentence(&s)).collect(),
        warnings: Listed::of(report.warnings.iter().cloned()),
        ..Page::of("inspect", &report.input, report, shown)
    };
    page.render()
}

impl Page {
    /// What all pages have in common.
    fn of(command: &'static str, input: &Input, report: &impl Serialize, shown: Option<&Shown>) -> Page {
        let has_after = command != "inspect";
        let of_scene = |shown: &Shown| {
            let overlaps = charts::overlaps(&shown.overlaps, has_after);
            let sizes = charts::sizes(&shown.sizes, has_after);
            overlaps.into_iter().chain([sizes]).chain(charts::precisions(&shown.drawing.precisions)).collect()
        };
        let name = input.path.file_stem().map_or_else(|| command.into(), |stem| stem.to_string_lossy());
        Page {
            command,
            files: vec![input.path.display().to_string()],
            headline: Headline::default(),
            counts: counts(input),
            pictures: shown.map(|shown| shown.drawing.pairs.clone()).unwrap_or_default(),
            sections: Vec::new(),
            has_after,
            charts_of_speed: Vec::new(),
            charts_of_scene: shown.map(of_scene).unwrap_or_default(),
            charts_of_layouts: Vec::new(),
            charts_of_time: Vec::new(),
            choice: None,
            candidates: Listed::of([].into_iter()),
            applied: Vec::new(),
            left_out: Vec::new(),
            findings: None,
            motion: Vec::new(),
            accuracy: Vec::new(),
            notes: Listed::of([].into_iter()),
            warnings: Listed::of([].into_iter()),
            json: Some(to_json(report)).filter(|json| json.len() <= MOST_JSON).map(|json| json_for_script(&json)),
            json_name: format!("{name}.{command}.json"),
            scene: shown.map(|shown| json_for_script(&shown.json())),
        }
    }

    fn render(&self) -> String {
        let environment = environment("page", include_str!("assets/page.html"));
        let template = environment.get_template("page").expect("it was added");
        let asset = |text: &str| Value::from_safe_string(text.to_owned());
        let rendered = template.render(context! {
            version => env!("CARGO_PKG_VERSION"),
            page => Value::from(Serde(self)),
            style => asset(include_str!("assets/page.css")),
            script => asset(include_str!("assets/page.js")),
            pane => asset(include_str!("assets/pane.min.js")),
            licence => asset(include_str!("assets/pane.licence.txt")),
        });
        rendered.expect("the template names what is there")
    }
}

/// Returns a template with the head that all pages share.
fn environment(name: &'static str, template: &'static str) -> Environment<'static> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.set_formatter(write_visible);
    for (name, template) in [("head", include_str!("assets/head.html")), (name, template)] {
        environment.add_template(name, template).expect("the template is sound");
    }
    environment
}

/// Writes a value of the template: as [`escape_formatter`], but strings as they are made visible.
fn write_visible(output: &mut Output, state: &mut State, value: &Value) -> Result<(), minijinja::Error> {
    match value.as_str().filter(|_| !value.is_safe()) {
        Some(text) => escape_formatter(output, state, &Value::from(visible(text, MOST_CHARACTERS).as_ref())),
        None => escape_formatter(output, state, value),
    }
}

fn counts(input: &Input) -> Vec<(String, String)> {
    let counts = [
        (input.triangles, "triangle"),
        (input.objects, "object"),
        (input.materials, "material"),
        (input.instances, "instance"),
        (input.pinned_instances, "pinned instance"),
    ];
    let shown = counts.into_iter().filter(|&(count, what)| count > 0 || what != "pinned instance");
    let mut all: Vec<(String, String)> =
        shown.map(|(count, what)| (grouped(count), super::words::plural(count as usize, what))).collect();
    all.extend(input.bytes.map(|size| (bytes(size), "file".to_owned())));
    all
}

fn candidates(method: &MethodReport) -> Listed<Row> {
    let row = |c: &super::Candidate| Row {
        name: c.id.to_string(),
        words: if c.id == method.chosen_candidate { "chosen".to_owned() } else { c.outcome.clone() },
        cells: vec![
            format!("{:.2}", c.predicted_cost),
            c.sampled_cost.map_or("\u{2013}".into(), super::candidates::significant),
            c.measured_speedup_ratio.map_or("\u{2013}".into(), |ratio| format!("{ratio:.3}")),
            bytes(c.as_bytes),
        ],
    };
    Listed::of(method.candidates.iter().map(row))
}

/// How exact the output is.
fn accuracy(verification: &Verification) -> Vec<String> {
    let mut said = vec![format!(
        "{} rays were traced through both files; {} hit something, {} saw something else in the output.",
        grouped(verification.rays),
        grouped(verification.hits),
        grouped(verification.mismatches)
    )];
    said.extend(super::precision::errors(&verification.errors).lines().map(headline::sentence));
    if verification.seams.rays > 0 {
        let seams = &verification.seams;
        let lost = [seams.before_lost, seams.after_lost].map(grouped);
        let rays = grouped(seams.rays);
        said.push(format!(
            "Of {rays} rays aimed at shared edges and vertices, {} pass through the input and {} through the output.",
            lost[0], lost[1]
        ));
    }
    said
}

#[cfg(test)]
mod tests;
