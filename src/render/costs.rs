//! The heat map: traversal steps per pixel.

use rayon::prelude::*;
use serde::Serialize;

use super::frame::Frame;
use super::legend;
use super::{ColourMap, Picture, Renderer, Statistics, Values};
use crate::verify::cpu::Steps;

/// What the legend says.
const UNIT: &str = "nodes, entries and triangle tests per ray";
/// Share of the pixels whose values the automatic scale shows apart.
const SHOWN: f64 = 0.998;

/// Traversal steps of the primary rays of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Costs {
    size: [u32; 2],
    /// Rays per pixel.
    samples: u32,
    /// The sum over the rays of each pixel.
    steps: Vec<Steps>,
    seen_ratio: f64,
}

/// Mean steps per primary ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeanSteps {
    /// Inner nodes of the TLAS.
    pub tlas_nodes: f64,
    /// Instances entered.
    pub entries: f64,
    /// Inner nodes of BLASes.
    pub blas_nodes: f64,
    /// Triangles tested.
    pub triangle_tests: f64,
}

/// Counts the steps of all primary rays.
pub(super) fn count(renderer: &Renderer, frame: &Frame) -> Costs {
    let tracer = renderer.tracer();
    let of_pixels = frame.each(
        || tracer.probe(),
        |probe, pixel| {
            let (mut sum, mut hits) = (Steps::default(), 0u32);
            for sample in frame.samples_of(pixel) {
                hits += u32::from(probe.closest(&sample.ray, |_| true).is_some());
                sum = added(sum, probe.steps());
            }
            (sum, hits)
        },
    );
    let hits: u64 = of_pixels.iter().map(|(_, hits)| u64::from(*hits)).sum();
    let rays = of_pixels.len() as u64 * u64::from(frame.samples);
    Costs {
        size: frame.size,
        samples: frame.samples,
        steps: of_pixels.into_iter().map(|(steps, _)| steps).collect(),
        seen_ratio: hits as f64 / rays as f64,
    }
}

fn added(a: Steps, b: Steps) -> Steps {
    let add = u32::saturating_add;
    Steps {
        top: add(a.top, b.top),
        entries: add(a.entries, b.entries),
        bottom: add(a.bottom, b.bottom),
        tests: add(a.tests, b.tests),
    }
}

impl Costs {
    /// Returns the end of a scale for one heat map or for several side by side: a round number that at most 0.2 % of the
    /// pixels exceed.
    pub fn scale(costs: &[&Costs]) -> f64 {
        let of_map = |costs: &Costs| {
            let mut values: Vec<f64> = costs.values().collect();
            let at = ((values.len() - 1) as f64 * SHOWN) as usize;
            *values.select_nth_unstable_by(at, f64::total_cmp).1
        };
        legend::rounded_up(costs.iter().map(|costs| of_map(costs)).fold(0.0, f64::max))
    }

    /// Draws the heat map with a legend; `scale` is the value with the last colour.
    pub fn picture(&self, colours: ColourMap, scale: f64) -> Picture {
        let of_pixel = |steps: &Steps| colours.at(self.value(steps) / scale);
        let pixels = self.steps.par_iter().map(of_pixel).collect();
        let values = Some(Values::of(self.values(), scale));
        let statistics =
            Statistics { seen_ratio: self.seen_ratio, values, steps: Some(self.mean()), ..Statistics::default() };
        let mut picture = Picture::of(self.size, pixels, statistics);
        legend::draw(&mut picture, colours, scale, UNIT);
        picture
    }

    /// Returns the mean steps per ray.
    pub fn mean(&self) -> MeanSteps {
        let rays = self.steps.len() as f64 * f64::from(self.samples);
        let mean = |of: fn(&Steps) -> u32| self.steps.iter().map(|s| u64::from(of(s))).sum::<u64>() as f64 / rays;
        MeanSteps {
            tlas_nodes: mean(|s| s.top),
            entries: mean(|s| s.entries),
            blas_nodes: mean(|s| s.bottom),
            triangle_tests: mean(|s| s.tests),
        }
    }

    /// Returns the steps per ray of each pixel, triangle tests included, in rows from the top.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.steps.iter().map(|steps| self.value(steps))
    }

    fn value(&self, steps: &Steps) -> f64 {
        (steps.total() + u64::from(steps.tests)) as f64 / f64::from(self.samples)
    }
}
