//! The scene as if all surfaces were glass: the transparent model view of T. Bilák's thesis (2024, section 4.2).
//!
//! There, each of the first 1,024 surfaces on a ray adds its colour, and the sum is divided by N/1024 + 1/32, with N the
//! number of surfaces. With colours that weigh 1/1024 each, that is their mean with the opacity N / (N + 32); the rest is
//! a checkered ground. The thesis steps from hit to hit and so misses surfaces in one place; here all are found at once.

use std::cmp::Ordering;

use glam::Vec3;

use super::colour::encoded;
use super::frame::Frame;
use super::{Picture, Renderer, Statistics, Values};
use crate::verify::Hit;

/// Largest number of surfaces per ray.
const MOST_HITS: usize = 1024;
/// Number of surfaces that are half opaque.
const HALF: f32 = 32.0;
/// Side of a square of the ground in pixels, and the light of its two kinds.
const SQUARE: u32 = 12;
const GROUND: [f32; 2] = [0.92, 0.86];

/// Draws all surfaces on each ray, in the colours of their instances.
pub(super) fn picture(renderer: &Renderer, frame: &Frame, colours: &[Vec3]) -> Picture {
    let tracer = renderer.tracer();
    let of_pixels = frame.each(
        || (tracer.probe(), Vec::new()),
        |(probe, hits), pixel| {
            let (mut sum, mut count, mut seen) = (Vec3::ZERO, 0, 0u32);
            for sample in frame.samples_of(pixel) {
                hits.clear();
                // No hit is accepted, so all are found.
                probe.closest(&sample.ray, |hit| {
                    hits.push(*hit);
                    false
                });
                hits.sort_unstable_by(nearer);
                hits.truncate(MOST_HITS);
                sum += mixed(hits, colours, ground(frame, pixel));
                count += hits.len();
                seen += u32::from(!hits.is_empty());
            }
            (encoded(sum / frame.samples as f32), count, seen)
        },
    );
    let rays = f64::from(frame.samples);
    let seen: u64 = of_pixels.iter().map(|(_, _, seen)| u64::from(*seen)).sum();
    let values = Values::of(of_pixels.iter().map(|(_, count, _)| *count as f64 / rays), MOST_HITS as f64);
    let seen_ratio = seen as f64 / (of_pixels.len() as f64 * rays);
    let statistics = Statistics { seen_ratio, values: Some(values), ..Statistics::default() };
    Picture::of(frame.size, of_pixels.into_iter().map(|(colour, ..)| colour).collect(), statistics)
}

fn nearer(a: &Hit, b: &Hit) -> Ordering {
    a.t.total_cmp(&b.t).then((a.instance, a.triangle).cmp(&(b.instance, b.triangle)))
}

/// Returns the colours of hits over the ground.
fn mixed(hits: &[Hit], colours: &[Vec3], ground: Vec3) -> Vec3 {
    if hits.is_empty() {
        return ground;
    }
    let count = hits.len() as f32;
    let mean = hits.iter().map(|hit| colours[hit.instance as usize]).sum::<Vec3>() / count;
    ground.lerp(mean, count / (count + HALF))
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
        let (colours, ground) = ([Vec3::X, Vec3::Y], Vec3::ZERO);
        assert_eq!(mixed(&[], &colours, Vec3::ONE), Vec3::ONE);
        for count in [1, 32, 1024] {
            let hits: Vec<Hit> = (0..count).map(|i| hit(i as f32, 0)).collect();
            let weighed = count as f32 / 1024.0;
            let expected = weighed / (weighed + 1.0 / 32.0);
            assert!(mixed(&hits, &colours, ground).distance(Vec3::X * expected) < 1e-6, "{count}");
        }
        let both = mixed(&[hit(1.0, 0), hit(2.0, 1)], &colours, ground);
        assert!(both.x == both.y && both.x > 0.0);
    }
}
