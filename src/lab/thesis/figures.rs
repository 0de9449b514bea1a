//! Figures 5.1, 5.3, 5.4 and 5.7 to 5.12 as charts.

use super::measured::{Measured, standing_for};
use super::numbers::{CHOSEN, NODE_RATIOS, SAN_MIGUEL, SCENES, SKIP_THRESHOLDS, SOM_THRESHOLDS};
use super::trials::Trial;
use crate::lab::LabError;
use crate::lab::bench::MotionRun;
use crate::lab::plot::{Bar, BarChart, Drawing, LineChart};
use crate::report::study::{Figure, Picture};
use std::path::Path;

/// The unit of all charts.
const UNIT: &str = "million rays per second, all kinds";

/// What the charts of the last experiment are numbered from.
const FIRST_OF_SCENES: usize = 7;

/// Places of a line chart that can be told apart.
const MOST_PLACES: usize = 16;

/// A setup of instances, of which the charts have a group each.
const STATIC: &str = "static";

/// Writes a chart to a folder and returns it as a figure.
///
/// # Errors
/// Fails if a file cannot be written.
fn figure(chart: &impl Drawing, folder: &Path, name: &str, caption: String) -> Result<Figure, LabError> {
    chart.write(folder, name)?;
    Ok(Figure { caption, file: format!("{name}.svg"), content: Picture::Svg(chart.svg()) })
}

/// Figure 5.1, and the same for all scenes.
pub(super) fn bvh(measured: &[Measured], folder: &Path) -> Result<Vec<Figure>, LabError> {
    let Some(scene) = standing_for(SAN_MIGUEL, measured) else { return Ok(Vec::new()) };
    let trials = NODE_RATIOS.map(Trial::Bvh);
    let name = &scene.found.name;
    let one = bars(&[scene], &trials, format!("bvh on {name}, by the ratio of nodes to triangles"));
    let all = bars(&measured.iter().collect::<Vec<_>>(), &trials, "bvh, by the ratio of nodes to triangles".into());
    let caption = |what: &str| format!("Figure 5.1: speed of bvh {what}, by the ratio of nodes to triangles.");
    Ok(vec![
        figure(&one, folder, "figure-5-1", caption(&format!("on {name}")))?,
        figure(&all, folder, "figure-5-1-all-scenes", caption("on all scenes"))?,
    ])
}

/// Figure 5.3: the first three scenes of table 5.1 and the others.
pub(super) fn skip(measured: &[Measured], folder: &Path) -> Result<Vec<Figure>, LabError> {
    let trials = SKIP_THRESHOLDS.map(|skip| Trial::Overlap { skip, som: CHOSEN.2 });
    let is_first = |scene: &&Measured| scene.found.of.is_none_or(|of| of < SCENES.len() / 2);
    let (first, others): (Vec<&Measured>, Vec<&Measured>) = measured.iter().partition(is_first);
    let mut figures = Vec::new();
    for (scenes, part) in [(first, "top"), (others, "bottom")] {
        if !scenes.is_empty() {
            let mut chart = bars(&scenes, &trials, "overlap reduction, by skip threshold".into());
            chart.heading = "skip threshold".into();
            chart.series = SKIP_THRESHOLDS.map(|skip| skip.to_string()).to_vec();
            let caption = format!("Figure 5.3, {part}: speed of the overlap reduction by skip threshold, SoM 0.5.");
            figures.push(figure(&chart, folder, &format!("figure-5-3-{part}"), caption)?);
        }
    }
    Ok(figures)
}

/// Figure 5.4, and the same for all scenes over the fastest of each.
pub(super) fn som(measured: &[Measured], folder: &Path) -> Result<Vec<Figure>, LabError> {
    let Some(scene) = standing_for(SAN_MIGUEL, measured) else { return Ok(Vec::new()) };
    let trials = SOM_THRESHOLDS.map(|som| Trial::Overlap { skip: CHOSEN.1, som });
    let speeds = |scene: &Measured| trials.map(|trial| scene.speed(trial).map(|speed| speed.0)).to_vec();
    let over_best = |scene: &Measured| {
        let speeds = speeds(scene);
        let best = speeds.iter().flatten().copied().fold(0.0, f64::max);
        speeds.into_iter().map(|speed| speed.map(|speed| speed / best)).collect::<Vec<_>>()
    };
    let one = LineChart {
        title: format!("overlap reduction on {}, by SoM threshold", scene.found.name),
        unit: UNIT.into(),
        place_axis: "SoM threshold (pairs with a larger overlap ratio merge)".into(),
        places: SOM_THRESHOLDS.map(|som| som.to_string()).to_vec(),
        heading: "setup".into(),
        series: vec![(STATIC.into(), speeds(scene))],
        notes: devices([scene]),
    };
    let all = LineChart {
        title: "overlap reduction, by SoM threshold".into(),
        unit: "speed over that of the scene's best threshold".into(),
        heading: "scene".into(),
        series: measured.iter().map(|scene| (scene.found.name.clone(), over_best(scene))).collect(),
        notes: devices(measured),
        ..one.clone()
    };
    let caption =
        |what: &str| format!("Figure 5.4: speed of the overlap reduction {what} by SoM threshold, skip 0.005.");
    Ok(vec![
        figure(&one, folder, "figure-5-4", caption(&format!("on {}", scene.found.name)))?,
        figure(&all, folder, "figure-5-4-all-scenes", caption("on all scenes"))?,
    ])
}

/// Figure 5.5: every scene with many instances, beside the instances alone.
pub(super) fn crowds(measured: &[Measured], instances: usize, folder: &Path) -> Result<Vec<Figure>, LabError> {
    let scenes: Vec<&Measured> = measured.iter().filter(|scene| !scene.crowds.is_empty()).collect();
    if scenes.is_empty() {
        return Ok(Vec::new());
    }
    let bar = |(value, spread)| Bar { value, spread };
    let of =
        |scene: &&Measured| [Some(Trial::Single), None].map(|trial| scene.crowd(instances, trial).map(bar)).to_vec();
    let chart = BarChart {
        title: format!("{instances} instances with each scene and alone"),
        heading: "what is traced".into(),
        series: ["scene and instances", "instances only"].map(String::from).to_vec(),
        bars: scenes.iter().map(of).collect(),
        ..bars(&scenes, &[], String::new())
    };
    let caption = format!("Figure 5.5: speed of every scene with {instances} instances, and of the instances alone.");
    Ok(vec![figure(&chart, folder, "figure-5-5", caption)?])
}

/// Every scene with many instances while they move. The thesis has no such figure.
pub(super) fn motion(measured: &[Measured], instances: usize, folder: &Path) -> Result<Vec<Figure>, LabError> {
    let series = |scene: &Measured| {
        let motion = scene.motion(instances, Some(Trial::Single))?;
        Some((scene.found.name.clone(), motion.series.clone()))
    };
    let all: Vec<(String, Vec<f64>)> = measured.iter().filter_map(series).collect();
    let frames = all.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
    let step = frames.div_ceil(MOST_PLACES).max(1);
    let places: Vec<usize> = (0..frames).step_by(step).collect();
    if places.is_empty() {
        return Ok(Vec::new());
    }
    let at_places = |values: &[f64]| places.iter().map(|&frame| values.get(frame).copied()).collect();
    let chart = LineChart {
        title: format!("{instances} instances in motion with each scene, single BLAS"),
        unit: UNIT.into(),
        place_axis: "frame".into(),
        places: places.iter().map(usize::to_string).collect(),
        heading: "scene".into(),
        series: all.iter().map(|(name, values)| (name.clone(), at_places(values))).collect(),
        notes: devices(measured),
    };
    let caption = format!("Speed of every scene with {instances} instances while they move; not in the thesis.");
    Ok(vec![figure(&chart, folder, "motion", caption)?])
}

/// What a frame takes besides tracing in which instances move, with each scene as a single BLAS. The thesis has no such
/// figure.
pub(super) fn upkeep(measured: &[Measured], instances: &[usize], folder: &Path) -> Result<Vec<Figure>, LabError> {
    instances.iter().filter_map(|&count| upkeep_of(measured, count, folder).transpose()).collect()
}

fn upkeep_of(measured: &[Measured], instances: usize, folder: &Path) -> Result<Option<Figure>, LabError> {
    let moved: Vec<(&Measured, &MotionRun)> =
        measured.iter().filter_map(|scene| Some((scene, scene.motion(instances, Some(Trial::Single))?))).collect();
    if moved.is_empty() {
        return Ok(None);
    }
    let bar = |value: f64| Bar { value, spread: 0.0 };
    let of = |motion: &MotionRun| {
        [Some(motion.matrices_ms + motion.upload_ms), motion.refit_ms, motion.rebuild_ms].map(|ms| ms.map(bar)).to_vec()
    };
    let scenes: Vec<&Measured> = moved.iter().map(|(scene, _)| *scene).collect();
    let chart = BarChart {
        title: format!("{instances} instances in motion, single BLAS"),
        unit: "milliseconds".into(),
        heading: "what is done".into(),
        series: ["update of matrices", "refit of the TLAS", "rebuild of the TLAS"].map(String::from).to_vec(),
        bars: moved.iter().map(|(_, motion)| of(motion)).collect(),
        ..bars(&scenes, &[], String::new())
    };
    let caption = format!(
        "Time to update the matrices of {instances} instances, and to refit or rebuild the TLAS; not in the thesis."
    );
    figure(&chart, folder, &format!("upkeep-{instances}"), caption).map(Some)
}

/// Figures 5.7 to 5.12: all methods on each scene, without instances and with numbers of them.
pub(super) fn methods(measured: &[Measured], instances: &[usize], folder: &Path) -> Result<Vec<Figure>, LabError> {
    let mut figures = Vec::new();
    for scene in measured {
        let name = &scene.found.name;
        let mut chart = bars(&[scene], &Trial::COMPARED, format!("all methods on {name}"));
        (chart.groups, chart.group_axis) = (vec![STATIC.into()], "setup".into());
        for &instances in instances.iter().filter(|_| !scene.crowds.is_empty()) {
            let bar = |trial| scene.crowd(instances, Some(trial)).map(|(value, spread)| Bar { value, spread });
            chart.groups.push(format!("{instances} instances"));
            chart.bars.push(Trial::COMPARED.map(bar).to_vec());
        }
        let (number, file) = match scene.found.of {
            Some(of) => (format!("Figure 5.{}", FIRST_OF_SCENES + of), format!("figure-5-{}", FIRST_OF_SCENES + of)),
            None => ("As figures 5.7 to 5.12".to_owned(), format!("figure-5-7-{}", plain(name))),
        };
        figures.push(figure(&chart, folder, &file, format!("{number}: speed of all methods on {name}."))?);
    }
    Ok(figures)
}

/// Returns a chart with a group for each scene and a bar for each trial.
fn bars(scenes: &[&Measured], trials: &[Trial], title: String) -> BarChart {
    let bar = |scene: &Measured, trial: Trial| scene.speed(trial).map(|(value, spread)| Bar { value, spread });
    BarChart {
        title,
        unit: UNIT.into(),
        group_axis: "scene".into(),
        groups: scenes.iter().map(|scene| scene.found.name.clone()).collect(),
        heading: "method".into(),
        series: trials.iter().map(|trial| trial.name()).collect(),
        bars: scenes.iter().map(|scene| trials.iter().map(|trial| bar(scene, *trial)).collect()).collect(),
        notes: devices(scenes.iter().copied()),
    }
}

/// Returns what traced, once each.
fn devices<'m>(scenes: impl IntoIterator<Item = &'m Measured>) -> Vec<String> {
    let rows = scenes.into_iter().flat_map(|scene| &scene.trials);
    let mut devices: Vec<String> = rows.map(|(_, row)| row.device.clone()).filter(|name| !name.is_empty()).collect();
    devices.sort();
    devices.dedup();
    devices
}

/// Returns a name for a file.
pub(super) fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}
