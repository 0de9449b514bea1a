//! Draws a picture of a scene.

use crate::commands::CommandError;
use crate::commands::source::Source;
use crate::render::{CameraChoice, RenderError, RenderOptions, Renderer, View};
use crate::report::render::RenderReport;
use crate::scene::{self, LoadOptions};

/// A stage of drawing a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reads the files.
    Read,
    /// Builds the trees.
    Build,
    /// Traces the rays of the picture.
    Draw,
}

impl Stage {
    /// Returns what is being done, for a progress line.
    pub fn label(self) -> &'static str {
        match self {
            Stage::Read => "reading",
            Stage::Build => "building trees",
            Stage::Draw => "drawing",
        }
    }
}

/// A picture that was drawn.
#[derive(Debug)]
pub struct Rendered {
    /// The picture, encoded as a PNG file.
    pub png: Vec<u8>,
    /// What it shows and what was measured.
    pub report: RenderReport,
}

/// Draws a picture of a file. `enter` is told of each stage.
///
/// # Errors
/// Fails if the file cannot be read, there is no such camera, or an option is out of range.
pub fn render(
    source: Source,
    view: View,
    camera: &CameraChoice,
    options: &RenderOptions,
    enter: &mut dyn FnMut(Stage),
) -> Result<Rendered, CommandError> {
    options.check(view)?;
    enter(Stage::Read);
    let doc = source.read()?;
    let (scene, warnings) = scene::load(&doc, &LoadOptions::default())?;
    enter(Stage::Build);
    let renderer = Renderer::new(&doc, &scene)?;
    let camera = renderer.camera(camera).map_err(RenderError::from)?;
    enter(Stage::Draw);
    let picture = renderer.picture(view, &camera, options)?;
    let warnings = doc.warnings.iter().chain(&warnings).map(ToString::to_string);
    let images = renderer.bad_images().iter().map(ToString::to_string);
    let warnings = warnings.chain(images).collect();
    let report = RenderReport::of(&doc.path, view, &camera, &picture, warnings);
    Ok(Rendered { png: picture.png(), report })
}
