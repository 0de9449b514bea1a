//! The page of the experiments, as HTML and Markdown.

use std::fs;
use std::path::{Path, PathBuf};

use super::QUICK_SIZE;
use super::measured::Measured;
use super::{claims, crowds, figures, tables};
use crate::lab::LabError;
use crate::report::html;
use crate::report::study::{Figure, Section, Study};

/// The folder of the figures, in that of the page.
pub(super) const FIGURES: &str = "figures";

/// Writes all figures and the page; returns the path of the page.
///
/// # Errors
/// Fails if a file cannot be written.
pub(super) fn write(
    measured: &[Measured],
    fragments: Vec<Figure>,
    failures: &[String],
    out: &Path,
) -> Result<PathBuf, LabError> {
    let folder = out.join(FIGURES);
    fs::create_dir_all(&folder).map_err(|e| LabError::file(&folder, e))?;
    let study = study(measured, fragments, failures, &folder)?;
    let page = out.join("thesis.html");
    for (path, text) in
        [(&page, html::study(&study)), (&out.join("thesis.md"), study.to_markdown(&format!("{FIGURES}/")))]
    {
        fs::write(path, text).map_err(|e| LabError::file(path, e))?;
    }
    Ok(page)
}

fn study(measured: &[Measured], fragments: Vec<Figure>, failures: &[String], folder: &Path) -> Result<Study, LabError> {
    let (crowded, fragments): (Vec<Figure>, Vec<Figure>) =
        fragments.into_iter().partition(|figure| figure.file.contains("figure-5-6"));
    let scenes = Section {
        heading: "The scenes".into(),
        tables: vec![tables::scenes(measured)],
        sentences: tables::editions(measured),
        ..Section::default()
    };
    let first = Section {
        heading: "Experiment 1: parameters of bvh".into(),
        sentences: claims::stand_in(measured).into_iter().chain(claims::bvh(measured)).collect(),
        tables: tables::bvh_builds(measured).into_iter().collect(),
        figures: figures::bvh(measured, folder)?.into_iter().chain(fragments).collect(),
    };
    let second = Section {
        heading: "Experiment 2: parameters of the overlap reduction".into(),
        sentences: [claims::skip(measured), claims::som(measured)].concat(),
        tables: vec![tables::skip_thresholds(measured)],
        figures: [figures::skip(measured, folder)?, figures::som(measured, folder)?].concat(),
    };
    let mut compared = crowds::counts(measured);
    let most = compared.pop().unwrap_or_default();
    let third = Section {
        heading: "Experiment 3: instances".into(),
        sentences: claims::crowds(measured, most),
        tables: [tables::crowds(measured, most), tables::motion(measured, &[most])].into_iter().flatten().collect(),
        figures: [
            figures::crowds(measured, most, folder)?,
            figures::motion(measured, most, folder)?,
            figures::upkeep(measured, &[most], folder)?,
            crowded,
        ]
        .concat(),
    };
    let fourth = Section {
        heading: "Experiment 4: all methods".into(),
        sentences: claims::methods(measured),
        tables: [Some(tables::methods(measured, &compared)), tables::motion(measured, &compared)]
            .into_iter()
            .flatten()
            .collect(),
        figures: [figures::methods(measured, &compared, folder)?, figures::upkeep(measured, &compared, folder)?]
            .concat(),
    };
    Ok(Study {
        title: "The experiments of \"Scene optimization for RTX\", repeated".into(),
        sentences: introduction(measured, failures),
        sections: vec![scenes, first, second, third, fourth],
    })
}

fn introduction(measured: &[Measured], failures: &[String]) -> Vec<String> {
    let mut said = vec![
        "T. Bilák's thesis (Czech Technical University in Prague, 2024) compares four ways to distribute a scene over \
         bottom-level acceleration structures. This page repeats its experiments and sets its numbers beside those \
         measured here. The thesis was measured with OptiX 7.6 on an NVIDIA GeForce RTX 3070 Laptop GPU, with shading; \
         here rays are traced with Vulkan or on the CPU, without shading."
            .to_owned(),
    ];
    if let Some((_, row)) = measured.iter().find_map(|scene| scene.trials.first()) {
        let [width, height] = row.size;
        said.push(format!(
            "Rays were traced by {} ({}): pictures of {width} x {height} pixels with {} primary ray per pixel, {} shadow \
             ray per hit and one diffuse ray per hit.",
            row.device, row.device_kind, row.pixel_samples, row.light_samples
        ));
        if row.device_kind != "gpu" {
            said.push("These speeds were not measured on a GPU and do not predict GPU speed.".into());
        }
        if row.size == QUICK_SIZE {
            said.push("This was a quick run: every picture is small and was traced once, so speeds are noise.".into());
        }
    }
    said.extend(failures.iter().map(|why| format!("Not measured: {why}.")));
    said
}
