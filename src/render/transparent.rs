//! The scene as if all surfaces were glass: the transparent model view of T. Bilák's thesis (2024, section 4.2).
//!
//! There, each of the first 1,024 surfaces on a ray adds its colour, and the sum is divided by N/1024 + 1/32, with N the
//! number of surfaces. With colours that weigh 1/1024 each, that is their mean with the opacity N / (N + 32). Opacities are
//! multiplied by what makes the densest pixels opaque; the rest is a checkered ground. The thesis steps from hit to hit and so misses surfaces in one place; here all are found at once.

use glam::{Vec3, Vec4};

use super::colour::encoded;
use super::frame::{Frame, Sample};
use super::probe::{Probe, Tracing};
use super::{Picture, Statistics, Unit, Values};
use crate::verify::{DeviceError, Hit};

/// Largest number of surfaces per ray.
const MOST_HITS: usize = 1024;
/// Number of surfaces that are half opaque.
const HALF: f32 = 32.0;
/// Share of the pixels that may be denser than what is drawn opaque.
const FEW: f64 = 0.005;
/// Side of a square of the ground in pixels, and the light of its two kinds.
const SQUARE: u32 = 12;
const GROUND: [f32; 2] = [0.92, 0.86];

/// Draws all surfaces on each ray, in the colours of their instances.
pub(super) fn picture(frame: &Frame, tracing: &Tracing, colours: &[Vec3]) -> Result<Picture, DeviceError> {
    let of_sample = |probe: &mut Probe, sample: &Sample| {
        let mut hits = Vec::new();
        probe.all(&sample.ray, &mut hits);
        hits.truncate(MOST_HITS);
        (weighed(&hits, colours), hits.len())
    };
    let of_pixel = |samples: &mut dyn Iterator<Item = (Vec4, usize)>| {
        let (mut sum, mut count, mut seen) = (Vec4::ZERO, 0, 0u32);
        for (colour, hits) in samples {
            (sum, count, seen) = (sum + colour, count + hits, seen + u32::from(hits > 0));
        }
        (sum / frame.samples as f32, count, seen)
    };
    let of_pixels = frame.each(tracing, of_sample, of_pixel)?;
    let rays = f64::from(frame.samples);
    let values =
        Values::of(of_pixels.iter().map(|(_, count, _)| *count as f64 / rays), MOST_HITS as f64, Unit::Surfaces);
    let seen_ratio = frame.seen_ratio(of_pixels.iter().map(|(.., seen)| *seen));
    let statistics = Statistics { seen_ratio, values: Some(values), ..Statistics::default() };
    let densest = densest(of_pixels.iter().map(|(colour, ..)| colour.w).collect());
    let over_ground = |(pixel, (colour, ..)): (usize, &(Vec4, usize, u32))| {
        let opacity = (colour.w / densest).min(1.0);
        let mean = if colour.w > 0.0 { colour.truncate() / colour.w } else { Vec3::ZERO };
        encoded(ground(frame, pixel).lerp(mean, opacity))
    };
    Ok(Picture::of(frame.size, of_pixels.iter().enumerate().map(over_ground).collect(), statistics))
}

/// Returns the opacity that few pixels exceed; 1 if none has any.
fn densest(mut opacities: Vec<f32>) -> f32 {
    opacities.sort_unstable_by(f32::total_cmp);
    let few = (FEW * opacities.len() as f64) as usize;
    let densest = opacities.iter().rev().nth(few).copied().unwrap_or(0.0);
    if densest > 0.0 { densest } else { 1.0 }
}

/// Returns the mean colour of hits times their opacity, and the opacity.
fn weighed(hits: &[Hit], colours: &[Vec3]) -> Vec4 {
    if hits.is_empty() {
        return Vec4::ZERO;
    }
    let count = hits.len() as f32;
    let mean = hits.iter().map(|hit| colours[hit.instance as usize]).sum::<Vec3>() / count;
    mean.extend(1.0) * (count / (count + HALF))
}

fn ground(frame: &Frame, pixel: usize) -> Vec3 {
    let [x, y] = [pixel as u32 % frame.size[0], pixel as u32 / frame.size[0]];
    Vec3::splat(GROUND[((x / SQUARE + y / SQUARE) % 2) as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f32, instance: u32) -> Hit {
        Hit { t, instance, triangle: 0, front: true }
    }

    #[test]
    fn opacity_follows_the_formula_of_the_thesis() {
        let colours = [Vec3::X, Vec3::Y];
        assert_eq!(weighed(&[], &colours), Vec4::ZERO);
        for count in [1, 32, 1024] {
            let hits: Vec<Hit> = (0..count).map(|i| hit(i as f32, 0)).collect();
            let of_thesis = count as f32 / 1024.0;
            let expected = of_thesis / (of_thesis + 1.0 / 32.0);
            assert!(weighed(&hits, &colours).distance(Vec4::new(expected, 0.0, 0.0, expected)) < 1e-6, "{count}");
        }
        let both = weighed(&[hit(1.0, 0), hit(2.0, 1)], &colours);
        assert!(both.x == both.y && both.x > 0.0);
    }

    #[test]
    fn few_pixels_are_denser_than_opaque() {
        assert_eq!(densest(vec![0.0; 4]), 1.0);
        let rising: Vec<f32> = (0..1000).map(|i| i as f32).collect();
        assert_eq!(densest(rising), 994.0);
    }
}
