//! What a picture shows, for people.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::render::{Camera, Picture, Statistics, View};

/// Data of a picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RenderReport {
    /// The schema of the report.
    pub schema: &'static str,
    /// The version of the program.
    pub raykiln_version: &'static str,
    /// The file that is shown.
    pub input: PathBuf,
    /// What is shown.
    pub view: &'static str,
    /// Description of the camera.
    pub camera: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// What was measured while the picture was drawn.
    pub statistics: Statistics,
    /// What the reader repaired or omitted, and images that could not be decoded.
    pub warnings: Vec<String>,
}

impl RenderReport {
    /// Schema of this version.
    pub const SCHEMA: &'static str = "raykiln.render/1";

    /// Returns the report of a picture.
    pub fn of(input: &Path, view: View, camera: &Camera, picture: &Picture, warnings: Vec<String>) -> RenderReport {
        RenderReport {
            schema: RenderReport::SCHEMA,
            raykiln_version: env!("CARGO_PKG_VERSION"),
            input: input.to_owned(),
            view: view.name(),
            camera: camera.name().to_owned(),
            size: [picture.width, picture.height],
            statistics: picture.statistics.clone(),
            warnings,
        }
    }

    /// Returns the report as text.
    pub fn text(&self) -> String {
        let Statistics { seen_ratio, values, steps } = &self.statistics;
        let [width, height] = self.size;
        let mut text = format!("{}, {width}x{height} pixels, {}\n", self.view, self.camera);
        if let Some(steps) = steps {
            let (tlas, entries) = (steps.tlas_nodes, steps.entries);
            let _ = writeln!(
                text,
                "per ray: {tlas:.1} TLAS nodes, {entries:.1} entries, {:.1} BLAS nodes, {:.1} triangle tests",
                steps.blas_nodes, steps.triangle_tests
            );
        }
        if let Some(values) = values {
            let _ = writeln!(text, "mean {:.2}, largest {:.0}, scale 0 to {}", values.mean, values.max, values.scale);
        }
        if *seen_ratio == 0.0 {
            text += "warning: the camera sees nothing of the scene\n";
        }
        self.warnings.iter().for_each(|warning| text += &format!("warning: {warning}\n"));
        text
    }
}
