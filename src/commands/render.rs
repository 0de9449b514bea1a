//! Draws a picture of a scene.

use raykiln_formats::{Document, Warning};

use crate::commands::CommandError;
use crate::commands::source::Source;
use crate::render::{CameraChoice, Picture, RenderError, RenderOptions, Renderer, View};
use crate::report::render::RenderReport;
use crate::scene::{self, LoadOptions, Scene};
use crate::verify::batch::BatchTracer;
use crate::verify::{DeviceChoice, Machine, Note};

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

/// Draws a picture of a file, with rays traced by the chosen device. `enter` is told of each stage.
///
/// # Errors
/// Fails if the device cannot be used, the file cannot be read, there is no such camera, or an option is out of range.
pub fn render(
    source: Source,
    view: View,
    camera: &CameraChoice,
    options: &RenderOptions,
    device: &DeviceChoice,
    enter: &mut dyn FnMut(Stage),
) -> Result<Rendered, CommandError> {
    options.check(view)?;
    let machine = Machine::open(device)?;
    enter(Stage::Read);
    let read = Read::of(source, &options.load)?;
    enter(Stage::Build);
    let renderer = Renderer::new(&read.doc, &read.scene)?;
    let camera = renderer.camera(camera).map_err(RenderError::from)?;
    enter(Stage::Draw);
    let drawn = Drawn::with(&machine, &[&read.scene], |devices| match devices {
        [device, ..] => renderer.picture_on(*device, view, &camera, options),
        [] => renderer.picture(view, &camera, options),
    })?;
    let report = RenderReport::of(&read.doc.path, view.name(), &camera, &drawn.picture, read.warnings(&renderer));
    Ok(drawn.rendered(report))
}

/// Draws where two files differ, seen by a camera of the first. `enter` is told of each stage.
///
/// # Errors
/// Like [`render`].
pub fn difference(
    before: Source,
    after: Source,
    camera: &CameraChoice,
    options: &RenderOptions,
    device: &DeviceChoice,
    enter: &mut dyn FnMut(Stage),
) -> Result<Rendered, CommandError> {
    options.check(View::Shaded)?;
    let machine = Machine::open(device)?;
    enter(Stage::Read);
    let (before, after) = (Read::of(before, &options.load)?, Read::of(after, &options.load)?);
    enter(Stage::Build);
    let renderers = [Renderer::new(&before.doc, &before.scene)?, Renderer::new(&after.doc, &after.scene)?];
    let camera = renderers[0].camera(camera).map_err(RenderError::from)?;
    enter(Stage::Draw);
    let drawn = Drawn::with(&machine, &[&before.scene, &after.scene], |devices| match devices {
        &[first, second, ..] => renderers[0].difference_on([first, second], &renderers[1], &camera, options),
        _ => renderers[0].difference(&renderers[1], &camera, options),
    })?;
    let warnings = [before.warnings(&renderers[0]), after.warnings(&renderers[1])].concat();
    let report = RenderReport::of(&before.doc.path, RenderReport::DIFFERENCE, &camera, &drawn.picture, warnings);
    Ok(drawn.rendered(report.against(&after.doc.path)))
}

/// A picture and what traced its rays.
struct Drawn {
    picture: Picture,
    /// Name of the device; `None` if the CPU did.
    device: Option<String>,
    notes: Vec<Note>,
}

impl Drawn {
    /// Draws with a machine's tracers of some scenes, or with none on the CPU.
    fn with(
        machine: &Machine,
        scenes: &[&Scene],
        draw: impl Fn(&[&dyn BatchTracer]) -> Result<Picture, RenderError>,
    ) -> Result<Drawn, CommandError> {
        let ((picture, device), notes) = machine.draw_with(scenes, |devices| {
            let device = devices.first().map(|device| device.device().to_owned());
            match draw(devices) {
                // The machine decides whether the CPU takes over.
                Err(RenderError::Device(error)) => Err(error),
                picture => Ok((picture, device)),
            }
        })?;
        Ok(Drawn { picture: picture?, device, notes })
    }

    fn rendered(self, report: RenderReport) -> Rendered {
        Rendered { png: self.picture.png(), report: report.traced_on(self.device, &self.notes) }
    }
}

/// A file that was read.
struct Read {
    doc: Document,
    scene: Scene,
    warnings: Vec<Warning>,
}

impl Read {
    fn of(source: Source, load: &LoadOptions) -> Result<Read, CommandError> {
        let doc = source.read(load)?;
        let (scene, warnings) = scene::load(&doc, load)?;
        scene.check().map_err(|e| CommandError::Internal(e.0))?;
        Ok(Read { doc, scene, warnings })
    }

    /// Returns what the reader repaired or omitted, and the images that could not be decoded.
    fn warnings(&self, renderer: &Renderer) -> Vec<String> {
        let file = self.doc.path.display();
        let read = self.doc.warnings.iter().chain(&self.warnings).map(|warning| format!("{file}: {warning}"));
        let images = renderer.bad_images().iter().map(|bad| format!("{file}: {bad}"));
        read.chain(images).collect()
    }
}
