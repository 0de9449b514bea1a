//! What a picture shows, for people.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::words::grouped;
use crate::render::{Camera, Cause, Differences, Picture, Statistics, Unit};
use crate::verify::{Note, WhyCpu};

/// Data of a picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RenderReport {
    /// The schema of the report.
    pub schema: &'static str,
    /// The version of the program.
    pub raykiln_version: &'static str,
    /// The file that is shown.
    #[serde(serialize_with = "super::paths::serialize")]
    pub input: PathBuf,
    /// The file that it is compared with.
    #[serde(serialize_with = "super::paths::serialize_some")]
    pub after: Option<PathBuf>,
    /// What is shown.
    pub view: &'static str,
    /// Description of the camera.
    pub camera: String,
    /// Name of the device that traced the rays.
    pub device: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// What was measured while the picture was drawn.
    pub statistics: Statistics,
    /// What was done otherwise than asked.
    pub notes: Vec<String>,
    /// What the reader repaired or omitted, and images that could not be decoded.
    pub warnings: Vec<String>,
}

impl RenderReport {
    /// Schema of this version.
    pub const SCHEMA: &'static str = "raykiln.render/1";

    /// Name of the view that compares two scenes.
    pub const DIFFERENCE: &'static str = "difference";

    /// Returns the report of a picture.
    pub fn of(
        input: &Path,
        view: &'static str,
        camera: &Camera,
        picture: &Picture,
        warnings: Vec<String>,
    ) -> RenderReport {
        RenderReport {
            schema: RenderReport::SCHEMA,
            raykiln_version: env!("CARGO_PKG_VERSION"),
            input: input.to_owned(),
            after: None,
            view,
            camera: camera.name().to_owned(),
            device: "CPU".to_owned(),
            size: [picture.width, picture.height],
            statistics: picture.statistics.clone(),
            notes: Vec::new(),
            warnings,
        }
    }

    /// The same, compared with another file.
    pub fn against(self, after: &Path) -> RenderReport {
        RenderReport { after: Some(after.to_owned()), ..self }
    }

    /// The same, with rays traced by a device, or by the CPU if it is `None`. That there is no GPU is not noted, since the
    /// CPU is the default; that one failed is.
    pub fn traced_on(self, device: Option<String>, notes: &[Note]) -> RenderReport {
        let failed = notes.iter().filter(|note| matches!(note, Note::OnCpu(WhyCpu::Failed(_))));
        let mut notes: Vec<String> = failed.map(Note::to_string).collect();
        let has_steps = self.statistics.values.is_some_and(|values| values.unit == Unit::Steps);
        notes.extend(device.as_ref().filter(|_| has_steps).map(|device| {
            format!("{device} has no clock for shaders (VK_KHR_shader_clock): the heat map shows steps on the CPU")
        }));
        RenderReport { device: device.unwrap_or(self.device), notes, ..self }
    }

    /// Returns the report as text.
    pub fn text(&self) -> String {
        let Statistics { seen_ratio, values, steps, boxes, differences } = &self.statistics;
        let [width, height] = self.size;
        let mut text = format!("{}, {width}x{height} pixels, {}, traced on {}\n", self.view, self.camera, self.device);
        if let Some(steps) = steps {
            let (tlas, entries) = (steps.tlas_nodes, steps.entries);
            let _ = writeln!(
                text,
                "per ray: {tlas:.1} TLAS nodes, {entries:.1} entries, {:.1} BLAS nodes, {:.1} triangle tests",
                steps.blas_nodes, steps.triangle_tests
            );
        }
        if let Some(values) = values {
            let (mean, max, unit) = (values.mean, values.max, values.unit.name());
            let _ = writeln!(text, "{unit}: mean {mean:.2}, largest {max:.0}, scale 0 to {}", values.scale);
        }
        boxes.iter().for_each(|&count| text += &format!("boxes: {}\n", grouped(count)));
        differences.iter().for_each(|differences| text += &self.differences(differences));
        if *seen_ratio == 0.0 && boxes.is_none() {
            text += "warning: the camera sees nothing of the scene\n";
        }
        self.notes.iter().for_each(|note| text += &format!("note: {note}\n"));
        self.warnings.iter().for_each(|warning| text += &format!("warning: {warning}\n"));
        text
    }

    fn differences(&self, differences: &Differences) -> String {
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        let differ: u64 = Cause::ALL.iter().map(|cause| differences.pixels(*cause)).sum();
        let causes = Cause::ALL.map(|cause| format!("{} {}", cause.name(), grouped(differences.pixels(cause))));
        format!(
            "mean absolute difference {:.4} of 255, largest {}; {} of {} pixels differ: {}\n",
            differences.mean_absolute,
            differences.largest,
            grouped(differ),
            grouped(pixels),
            causes.join(", ")
        )
    }
}
