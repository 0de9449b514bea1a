//! Pictures of a scene: how it looks, which triangles share a group, and what it costs to trace.
//!
//! A [`Renderer`] is built once per scene and draws any number of pictures of it. Rays are traced on the CPU or on a device;
//! shading is the same code either way. A [`Camera`] belongs to no scene, so the input and the output of a bake can be seen by the same one. Each pixel depends on its position, the
//! seed and the options alone: pictures have the same bytes for any number of threads.
//!
//! ```
//! use raykiln::render::{CameraChoice, Costs, RenderOptions, Renderer, View};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let document = raykiln_formats::read(std::path::Path::new("samples/overlapping/scene.glb"))?;
//! let (scene, _) = raykiln::scene::load(&document, &Default::default())?;
//! let renderer = Renderer::new(&document, &scene)?;
//! let camera = renderer.camera(&CameraChoice::Default)?;
//! let options = RenderOptions { size: [64, 36], ..RenderOptions::default() };
//! let picture = renderer.picture(View::Groups, &camera, &options)?;
//! assert_eq!(picture.pixels.len(), 3 * 64 * 36);
//! assert!(picture.png().starts_with(b"\x89PNG"));
//!
//! // Two heat maps on one scale.
//! let costs = [renderer.costs(&camera, &options)?, renderer.costs(&camera, &options)?];
//! let scale = Costs::scale(&[&costs[0], &costs[1]]);
//! let pictures = costs.map(|costs| costs.picture(options.colours, scale));
//! # assert_eq!(pictures[0].pixels, pictures[1].pixels);
//! # Ok(())
//! # }
//! ```

mod boxes;
mod camera;
mod colour;
mod costs;
mod difference;
mod draws;
mod error;
mod flat;
mod frame;
mod legend;
mod look;
mod material;
mod options;
mod overlap;
mod palette;
mod picture;
mod probe;
mod shade;
mod surface;
#[cfg(test)]
mod tests;
mod text;
mod texture;
mod transparent;
mod wires;

pub use boxes::{MOST_BOXES, Masks};
pub use camera::{BadCamera, Camera, CameraChoice};
pub use colour::ColourMap;
pub use costs::{Costs, MeanSteps};
pub use difference::{Cause, Differences};
pub use error::RenderError;
pub use options::{Light, MOST_PIXELS, MOST_SAMPLES, MOST_SIDE, RenderOptions};
pub use picture::{Picture, Statistics, Unit, Values};
pub use texture::BadImage;

use std::sync::OnceLock;

use raykiln_formats::Document;

use crate::cost::mesh_trees::MeshTrees;
use crate::scene::{Bounds, Scene};
use crate::verify::batch::BatchTracer;
use crate::verify::cpu::{CpuTracer, Reference, TwoLevel};
use crate::verify::rays::{self, Ray};
use crate::verify::view::Stage;
use frame::Frame;
use look::Looks;
use probe::Tracing;

/// What a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum View {
    /// The surfaces with their materials in the light of an area light, with one diffuse bounce.
    #[default]
    Shaded,
    /// The mesh groups, each in a colour of its own; neighbours differ.
    Groups,
    /// The instances, each in a colour of its own; neighbours differ.
    Instances,
    /// The number of traversal steps per primary ray.
    Heatmap,
    /// All surfaces on each ray, as if they were glass.
    Transparent,
    /// Boxes of the instances, or of a level of the tree, as wires.
    Boxes,
    /// The number of instance boxes around the first hit.
    Overlap,
}

impl View {
    /// All views of one scene, in the order of their declaration.
    pub const ALL: [View; 7] =
        [View::Shaded, View::Groups, View::Instances, View::Heatmap, View::Transparent, View::Boxes, View::Overlap];

    /// Returns the name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            View::Shaded => "shaded",
            View::Groups => "groups",
            View::Instances => "instances",
            View::Heatmap => "heatmap",
            View::Transparent => "transparent",
            View::Boxes => "boxes",
            View::Overlap => "overlap",
        }
    }

    /// Returns what it shows, in a few words.
    pub fn description(self) -> &'static str {
        match self {
            View::Shaded => "Materials in the light of an area light, with one diffuse bounce",
            View::Groups => "One colour per mesh group; neighbours differ",
            View::Instances => "One colour per instance; neighbours differ",
            View::Heatmap => "Cost of the primary rays: ticks of the device's clock, or traversal steps on the CPU",
            View::Transparent => "All surfaces on each ray, as if they were glass",
            View::Boxes => "Boxes of the instances, or of a level of the tree, as wires",
            View::Overlap => "Number of instance boxes around the first hit",
        }
    }

    /// Returns the default number of samples per pixel.
    pub fn default_samples(self) -> u32 {
        match self {
            View::Shaded => 16,
            View::Groups | View::Instances | View::Transparent | View::Boxes => 4,
            View::Heatmap | View::Overlap => 1,
        }
    }
}

/// Draws pictures of a scene.
pub struct Renderer<'a> {
    doc: &'a Document,
    scene: &'a Scene,
    accel: TwoLevel,
    stage: Stage,
    /// Loaded when the first picture needs them.
    looks: OnceLock<Looks<'a>>,
}

impl<'a> Renderer<'a> {
    /// Builds the trees of a scene that was loaded from a document.
    ///
    /// # Errors
    /// [`RenderError::Empty`] if no ray can hit anything.
    pub fn new(doc: &'a Document, scene: &'a Scene) -> Result<Renderer<'a>, RenderError> {
        Renderer::with_trees(doc, scene, &MeshTrees::default())
    }

    /// Like [`Renderer::new`], with trees of the scene's meshes that are known already.
    ///
    /// # Errors
    /// See [`Renderer::new`].
    pub fn with_trees(doc: &'a Document, scene: &'a Scene, trees: &MeshTrees) -> Result<Renderer<'a>, RenderError> {
        let core = scene.core().bounds();
        let bounds = if core.is_empty() { scene.bounds() } else { core };
        if bounds.is_empty() {
            return Err(RenderError::Empty);
        }
        let accel = TwoLevel::build_with(scene, trees);
        let stage = stage(&accel, bounds);
        Ok(Renderer { doc, scene, accel, stage, looks: OnceLock::new() })
    }

    /// Shades pictures in the light of another scene. Light and sky depend on the core of a scene, which may be another
    /// one if the same surfaces are grouped in another way.
    #[must_use]
    pub fn lit_as(self, other: &Renderer) -> Self {
        Renderer { stage: other.stage, ..self }
    }

    /// Returns the trees that rays are traced through.
    pub(crate) fn accel(&self) -> &TwoLevel {
        &self.accel
    }

    /// Draws a picture.
    ///
    /// # Errors
    /// Options out of range, or too many boxes, see [`RenderError`].
    pub fn picture(&self, view: View, camera: &Camera, options: &RenderOptions) -> Result<Picture, RenderError> {
        self.draw(&self.on_cpu(), view, camera, options)
    }

    /// Like [`Renderer::picture`], with rays traced by a device through the same scene. The heat map shows the device's
    /// clock if it has one, and otherwise the steps on the CPU.
    ///
    /// # Errors
    /// See [`Renderer::picture`]; and [`RenderError::Device`] if the device fails.
    pub fn picture_on(
        &self,
        device: &dyn BatchTracer,
        view: View,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Picture, RenderError> {
        self.draw(&Tracing::Device(device), view, camera, options)
    }

    fn draw(
        &self,
        tracing: &Tracing,
        view: View,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Picture, RenderError> {
        let frame = Frame::new(view, camera, options)?;
        Ok(match view {
            View::Shaded => shade::picture(self, self.stage, &frame, tracing)?,
            View::Groups => flat::picture(self, &frame, tracing, &palette::of_groups(self.scene))?,
            View::Instances => flat::picture(self, &frame, tracing, &palette::of_instances(self.scene))?,
            View::Heatmap => {
                let costs = costs::measured(self, &frame, tracing)?;
                let scale = options.scale.unwrap_or_else(|| Costs::scale(&[&costs]));
                costs.picture(options.colours, scale)
            }
            View::Transparent => transparent::picture(&frame, tracing, &palette::of_groups(self.scene))?,
            View::Boxes => boxes::picture(self, &frame, tracing, options)?,
            View::Overlap => overlap::picture(self, &frame, tracing, options)?,
        })
    }

    /// Counts the traversal steps of the primary rays of each pixel: the data of [`View::Heatmap`].
    ///
    /// # Errors
    /// See [`Renderer::picture`].
    pub fn costs(&self, camera: &Camera, options: &RenderOptions) -> Result<Costs, RenderError> {
        Ok(costs::counted(self, &Frame::new(View::Heatmap, camera, options)?))
    }

    /// Returns the images that could not be read or decoded when a picture needed them; surfaces with them are drawn as
    /// if they had none.
    pub fn bad_images(&self) -> &[BadImage] {
        self.looks.get().map_or(&[], Looks::bad_images)
    }

    fn on_cpu(&self) -> Tracing<'_> {
        Tracing::Cpu(CpuTracer::new(&self.accel))
    }

    fn looks(&self) -> &Looks<'a> {
        self.looks.get_or_init(|| Looks::of(self.doc, self.scene))
    }
}

/// Seed of what does not depend on [`RenderOptions::seed`]: whether the scene is an interior, and automatic cameras.
const SEED: u64 = 1;

fn stage(accel: &TwoLevel, bounds: Bounds) -> Stage {
    let reference = Reference::new(accel);
    let closest = |rays: &[Ray]| Ok::<_, std::convert::Infallible>(reference.closest(rays));
    let Ok(stage) = rays::stage(bounds, &closest, SEED);
    stage
}
