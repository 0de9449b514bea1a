//! Pictures in which each instance has one colour, shaded by the angle at which it is seen.

use glam::Vec3;

use super::colour::encoded;
use super::frame::{Frame, Sample};
use super::probe::{Probe, Tracing};
use super::surface::Spot;
use super::{Picture, Renderer, Statistics};
use crate::verify::DeviceError;

/// Light behind the scene.
pub(super) const BACKGROUND: Vec3 = Vec3::splat(0.86);
/// Share of a colour that is left at a grazing angle.
const GRAZING: f32 = 0.35;

/// Draws the first hits in the colours of their instances.
pub(super) fn picture(
    renderer: &Renderer,
    frame: &Frame,
    tracing: &Tracing,
    colours: &[Vec3],
) -> Result<Picture, DeviceError> {
    let scene = renderer.scene;
    let of_sample = |probe: &mut Probe, sample: &Sample| {
        let hit = probe.closest(&sample.ray, |_| true)?;
        let spot = Spot::of(scene, &sample.ray, &hit);
        Some(colours[hit.instance as usize] * facing(&spot, sample.ray.direction))
    };
    let of_pixel = |samples: &mut dyn Iterator<Item = Option<Vec3>>| {
        let (mut sum, mut hits) = (Vec3::ZERO, 0u32);
        for seen in samples {
            sum += seen.unwrap_or(BACKGROUND);
            hits += u32::from(seen.is_some());
        }
        (encoded(sum / frame.samples as f32), hits)
    };
    let of_pixels = frame.each(tracing, of_sample, of_pixel)?;
    let statistics =
        Statistics { seen_ratio: frame.seen_ratio(of_pixels.iter().map(|(_, hits)| *hits)), ..Statistics::default() };
    let pixels = of_pixels.into_iter().map(|(colour, _)| colour).collect();
    Ok(Picture::of(frame.size, pixels, statistics))
}

/// Share of light by the angle between a surface and the ray that sees it.
pub(super) fn facing(spot: &Spot, direction: Vec3) -> f32 {
    GRAZING + (1.0 - GRAZING) * spot.normal.as_vec3().dot(-direction).clamp(0.0, 1.0)
}
