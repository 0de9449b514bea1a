//! Pages of inspections, which need no bake.

use super::*;
use crate::cost::Metrics;
use crate::layout::test_scenes::heaps;
use crate::report::{Broken, Rule};
use crate::scene::Scene;
use crate::verify::sight::DeviceError;

/// The report of a scene in which an object of this name is at fault, this many times.
fn report(scene: &Scene, object: &str, times: usize) -> InspectReport {
    let finding = Finding::new([object].into_iter().collect(), &Broken::Outlier { area_ratio: 9.0 });
    InspectReport {
        schema: InspectReport::SCHEMA,
        raykiln_version: "0",
        input: Input::of("folder/scene.glb".into(), Some(2048), scene),
        before: Metrics::default(),
        worst_pairs: Vec::new(),
        rules_checked: vec![Rule::Outlier],
        findings: vec![finding; times],
        motion: Vec::new(),
        device_error: DeviceError::of(scene),
        warnings: vec![object.to_owned()],
    }
}

#[test]
fn names_are_text_whatever_they_hold() {
    let name = "</script><script>alert(1)</script>\" onload='x' \u{202e}\u{7}{{ 7 * 7 }}";
    let page = inspect(&report(&Scene::default(), name, 1), None);
    assert!(!page.contains("<script>alert") && !page.contains('\u{202e}') && !page.contains('\u{7}'));
    assert!(page.contains("&lt;&#x2f;script&gt;&lt;script&gt;alert(1)") && page.contains("\u{27e8}U+202E\u{27e9}"));
    assert!(page.contains("{{ 7 * 7 }}"), "names are no templates");
}

#[test]
fn a_long_name_is_cut_in_the_page_and_whole_in_its_json() {
    let name = "n".repeat(10_000);
    let page = inspect(&report(&Scene::default(), &name, 1), None);
    let (text, json) = page.split_once("<script type=\"application/json\"").expect("the report is embedded");
    assert!(!text.contains(&"n".repeat(1000)) && json.contains(&name));
}

#[test]
fn only_some_findings_are_listed_and_the_rest_are_counted() {
    let page = inspect(&report(&Scene::default(), "wall", MOST_LISTED + 7), None);
    assert_eq!(page.matches("<li class=\"warning\">").count(), MOST_LISTED);
    assert!(page.contains("7 more findings are in the JSON report."));
}

#[test]
fn a_report_that_is_too_large_is_not_embedded_and_the_page_says_so() {
    let page = inspect(&report(&Scene::default(), &"n".repeat(1000), 1000), None);
    assert!(page.len() < 1 << 20 && page.contains("The JSON report is too large to be embedded"));
    assert!(!page.contains("id=\"report\"") && !page.contains("id=\"download\""));
}

#[test]
fn the_pane_is_in_the_page_only_if_there_is_something_to_show() {
    let scene = heaps(0);
    let report = report(&scene, "low", 1);
    let [without, with] = [None, Some(&Shown::of(&scene))].map(|shown| inspect(&report, shown));
    assert!(!without.contains("raykilnPane=") && !without.contains("id=\"scene-data\""));
    assert!(with.contains("raykilnPane=") && with.contains("id=\"scene-data\""));
    assert!(with.contains("The MIT License"), "the licence of three.js");
}
