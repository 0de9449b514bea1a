//! Pictures in which each instance has one colour, shaded by the angle at which it is seen.

use glam::Vec3;

use super::colour::encoded;
use super::frame::Frame;
use super::surface::Spot;
use super::{Picture, Renderer, Statistics};

/// Light behind the scene.
pub(super) const BACKGROUND: Vec3 = Vec3::splat(0.86);
/// Share of a colour that is left at a grazing angle.
const GRAZING: f32 = 0.35;

/// Draws the first hits in the colours of their instances.
pub(super) fn picture(renderer: &Renderer, frame: &Frame, colours: &[Vec3]) -> Picture {
    let tracer = renderer.tracer();
    let of_pixels = frame.each(
        || tracer.probe(),
        |probe, pixel| {
            let (mut sum, mut hits) = (Vec3::ZERO, 0u32);
            for sample in frame.samples_of(pixel) {
                let Some(hit) = probe.closest(&sample.ray, |_| true) else {
                    sum += BACKGROUND;
                    continue;
                };
                let spot = Spot::of(renderer.scene, &sample.ray, &hit);
                hits += 1;
                sum += colours[hit.instance as usize] * facing(&spot, sample.ray.direction);
            }
            (encoded(sum / frame.samples as f32), hits)
        },
    );
    let hits: u64 = of_pixels.iter().map(|(_, hits)| u64::from(*hits)).sum();
    let seen_ratio = hits as f64 / (of_pixels.len() as f64 * f64::from(frame.samples));
    let pixels = of_pixels.into_iter().map(|(colour, _)| colour).collect();
    Picture::of(frame.size, pixels, Statistics { seen_ratio, ..Statistics::default() })
}

/// Share of light by the angle between a surface and the ray that sees it.
pub(super) fn facing(spot: &Spot, direction: Vec3) -> f32 {
    GRAZING + (1.0 - GRAZING) * spot.normal.as_vec3().dot(-direction).clamp(0.0, 1.0)
}
