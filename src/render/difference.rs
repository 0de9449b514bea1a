//! Two scenes seen by one camera: which pixels differ, and by what.
//!
//! A flipped normal need not change how a surface is lit, and a texture may look like another one. Therefore not only the
//! shaded pictures are compared, but also what the ray through the middle of each pixel hits.

use std::ops::Range;

use glam::{DVec3, Vec3};
use serde::Serialize;

use super::colour::Rgb;
use super::frame::{Frame, Sample};
use super::legend;
use super::look::Look;
use super::probe::{Probe, Tracing};
use super::shade::{self, Shader};
use super::{Camera, Picture, RenderError, RenderOptions, Renderer, Statistics, View};
use crate::verify::DeviceError;
use crate::verify::batch::BatchTracer;
use crate::verify::rays::Ray;
use crate::verify::view::Stage;

/// By what a pixel differs; the first of these that applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// One ray hits nothing, or the surfaces are not at the same distance.
    Surface,
    /// The surface faces the other way, or its stated normals differ by more than a degree.
    Normal,
    /// Base colour, emission, metalness, roughness or transmission differ.
    Material,
    /// Only the light on the surface differs.
    Light,
}

impl Cause {
    /// All causes, in the order of their declaration.
    pub const ALL: [Cause; 4] = [Cause::Surface, Cause::Normal, Cause::Material, Cause::Light];

    /// Returns the name in legends and reports.
    pub fn name(self) -> &'static str {
        match self {
            Cause::Surface => "surface",
            Cause::Normal => "normal",
            Cause::Material => "material",
            Cause::Light => "light",
        }
    }

    fn colour(self) -> Rgb {
        match self {
            Cause::Surface => [255, 60, 40],
            Cause::Normal => [255, 70, 230],
            Cause::Material => [255, 190, 0],
            Cause::Light => [60, 150, 255],
        }
    }
}

/// How two pictures differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Differences {
    /// Mean absolute difference of the shaded pictures, over all pixels and channels, from 0 to 255.
    pub mean_absolute: f64,
    /// Largest difference of a channel, from 0 to 255.
    pub largest: u8,
    /// Number of pixels that differ in their surface.
    pub surface_pixels: u64,
    /// Number of pixels that differ in their normal.
    pub normal_pixels: u64,
    /// Number of pixels that differ in their material.
    pub material_pixels: u64,
    /// Number of pixels that differ only in their light.
    pub light_pixels: u64,
}

/// Distances are equal if they differ by no more than this, over the distance and the radius of the scene.
const SAME_DISTANCE: f64 = 1e-4;
/// Cosine of a degree.
const SAME_NORMAL: f64 = 0.999_85;
/// Numbers of a material are equal if they differ by no more than this.
const SAME_LOOK: f32 = 0.02;
/// Channels of the pictures are equal if they differ by no more than this.
const SAME_LIGHT: u8 = 2;
/// Number of pixels whose facts are kept at a time.
const AT_ONCE: usize = 1 << 18;
/// Share of the first picture, in grey, that is left in the result.
const GREY: f32 = 0.4;

impl Differences {
    /// Returns the number of pixels that differ by a cause.
    pub fn pixels(&self, cause: Cause) -> u64 {
        match cause {
            Cause::Surface => self.surface_pixels,
            Cause::Normal => self.normal_pixels,
            Cause::Material => self.material_pixels,
            Cause::Light => self.light_pixels,
        }
    }

    fn count(&mut self, cause: Cause) {
        *match cause {
            Cause::Surface => &mut self.surface_pixels,
            Cause::Normal => &mut self.normal_pixels,
            Cause::Material => &mut self.material_pixels,
            Cause::Light => &mut self.light_pixels,
        } += 1;
    }
}

impl Renderer<'_> {
    /// Draws both scenes as [`View::Shaded`] and shows where they differ: the first picture in grey, and over it each
    /// pixel that differs in the colour of its [`Cause`].
    ///
    /// # Errors
    /// See [`Renderer::picture`].
    pub fn difference(
        &self,
        after: &Renderer,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Picture, RenderError> {
        self.compare([&self.on_cpu(), &after.on_cpu()], after, camera, options)
    }

    /// Like [`Renderer::difference`], with rays through either scene traced by a device.
    ///
    /// # Errors
    /// See [`Renderer::picture_on`].
    pub fn difference_on(
        &self,
        devices: [&dyn BatchTracer; 2],
        after: &Renderer,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Picture, RenderError> {
        let [before, other] = devices.map(Tracing::Device);
        self.compare([&before, &other], after, camera, options)
    }

    fn compare(
        &self,
        tracings: [&Tracing; 2],
        after: &Renderer,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Picture, RenderError> {
        let frame = Frame::new(View::Shaded, camera, options)?;
        let before = Seeing { renderer: self, stage: self.stage, tracing: tracings[0] };
        let after = Seeing { renderer: after, stage: self.stage, tracing: tracings[1] };
        let pictures = [before.shaded(&frame)?, after.shaded(&frame)?];
        Ok(compared(&before, &after, &frame, &pictures)?)
    }
}

/// A scene and what traces the rays through it.
struct Seeing<'s, 'a> {
    renderer: &'s Renderer<'a>,
    /// The light, that of the first scene.
    stage: Stage,
    tracing: &'s Tracing<'s>,
}

impl Seeing<'_, '_> {
    fn shaded(&self, frame: &Frame) -> Result<Picture, DeviceError> {
        shade::picture(self.renderer, self.stage, frame, self.tracing)
    }

    /// Returns what the rays through the middles of some pixels hit.
    fn facts(&self, frame: &Frame, pixels: Range<usize>) -> Result<Vec<Option<Facts>>, DeviceError> {
        let shader = Shader::of(self.renderer, self.stage);
        let of_sample = |probe: &mut Probe, sample: &Sample| facts(&shader, probe, &sample.ray);
        frame.middles().each_within(pixels, self.tracing, of_sample, |samples| samples.next().flatten())
    }
}

/// Shows where two shaded pictures differ.
fn compared(before: &Seeing, after: &Seeing, frame: &Frame, pictures: &[Picture; 2]) -> Result<Picture, DeviceError> {
    let radius = before.stage.radius;
    let mut found: Vec<(Option<Cause>, u8)> = Vec::with_capacity(frame.pixels());
    for first in (0..frame.pixels()).step_by(AT_ONCE) {
        let some = first..(first + AT_ONCE).min(frame.pixels());
        let seen = before.facts(frame, some.clone())?.into_iter().zip(after.facts(frame, some.clone())?);
        for (pixel, seen) in some.zip(seen) {
            let [a, b] = pictures.each_ref().map(|picture| &picture.pixels[3 * pixel..3 * pixel + 3]);
            let light = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
            found.push((cause(&[seen.0, seen.1], light, radius), light));
        }
    }
    let differences = summed(&found, pictures);
    let colour = |(pixel, (cause, light)): (usize, &(Option<Cause>, u8))| coloured(pictures, pixel, *cause, *light);
    let pixels = found.iter().enumerate().map(colour).collect();
    let seen_ratio = pictures[0].statistics.seen_ratio;
    let statistics = Statistics { seen_ratio, differences: Some(differences), ..Statistics::default() };
    let mut picture = Picture::of(frame.size, pixels, statistics);
    legend::key(&mut picture, &Cause::ALL.map(|cause| (cause.colour(), cause.name())));
    Ok(picture)
}

/// What a ray hits.
struct Facts {
    distance: f64,
    front: bool,
    /// The normal that the file states.
    normal: Option<DVec3>,
    look: Look,
}

fn facts(shader: &Shader, probe: &mut Probe, ray: &Ray) -> Option<Facts> {
    let (spot, look) = shader.meet(probe, ray)?;
    Some(Facts { distance: spot.distance, front: spot.front, normal: shader.stated_normal(&spot), look })
}

/// Returns by what a pixel differs, given the largest difference of a channel.
fn cause(seen: &[Option<Facts>; 2], light: u8, radius: f64) -> Option<Cause> {
    let only_light = (light > SAME_LIGHT).then_some(Cause::Light);
    let [Some(a), Some(b)] = seen else {
        return if seen[0].is_none() && seen[1].is_none() { only_light } else { Some(Cause::Surface) };
    };
    let same_normal = match (a.normal, b.normal) {
        (Some(a), Some(b)) => a.dot(b) >= SAME_NORMAL,
        (a, b) => a.is_none() && b.is_none(),
    };
    match () {
        () if (a.distance - b.distance).abs() > SAME_DISTANCE * (a.distance + radius) => Some(Cause::Surface),
        () if a.front != b.front || !same_normal => Some(Cause::Normal),
        () if !same_look(&a.look, &b.look) => Some(Cause::Material),
        () => only_light,
    }
}

fn same_look(a: &Look, b: &Look) -> bool {
    let colours = [(a.base, b.base), (a.emission, b.emission)];
    let numbers =
        [(a.alpha, b.alpha), (a.metallic, b.metallic), (a.roughness, b.roughness), (a.transmission, b.transmission)];
    colours.iter().all(|(a, b)| (*a - *b).abs().max_element() <= SAME_LOOK)
        && numbers.iter().all(|(a, b)| (a - b).abs() <= SAME_LOOK)
        && a.is_unlit == b.is_unlit
}

fn summed(found: &[(Option<Cause>, u8)], pictures: &[Picture; 2]) -> Differences {
    let [a, b] = pictures.each_ref().map(|picture| &picture.pixels);
    let sum: u64 = a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    let mut differences = Differences {
        mean_absolute: sum as f64 / a.len() as f64,
        largest: found.iter().map(|(_, light)| *light).max().unwrap_or(0),
        ..Differences::default()
    };
    found.iter().filter_map(|(cause, _)| *cause).for_each(|cause| differences.count(cause));
    differences
}

/// Returns the colour of a pixel of the result; the more it differs, the stronger.
fn coloured(pictures: &[Picture; 2], pixel: usize, cause: Option<Cause>, light: u8) -> Rgb {
    let shown = &pictures[0].pixels[3 * pixel..3 * pixel + 3];
    let luminance = shown.iter().zip([0.2126, 0.7152, 0.0722]).map(|(c, share)| f32::from(*c) * share).sum::<f32>();
    let grey = Vec3::splat(GREY * luminance);
    let Some(cause) = cause else { return grey.to_array().map(|c| c.round() as u8) };
    let strength = 0.55 + 0.45 * (f32::from(light) / 64.0).min(1.0);
    let colour = Vec3::from_array(cause.colour().map(f32::from));
    grey.lerp(colour, strength).to_array().map(|c| c.round() as u8)
}
