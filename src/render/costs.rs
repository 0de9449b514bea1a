//! The heat map: what the rays of each pixel cost, in steps on the CPU or in ticks of a device's clock.

use serde::Serialize;

use super::frame::{Frame, each_pixel};
use super::legend;
use super::probe::Tracing;
use super::{ColourMap, Picture, Renderer, Statistics, Unit, Values};
use crate::verify::DeviceError;
use crate::verify::batch::{BatchTracer, Ticks};
use crate::verify::cpu::{CpuTracer, Steps};
use crate::verify::rays::Ray;

/// Number of rays that a device times at once.
const RAYS_AT_ONCE: usize = 1 << 20;
/// Times that a device times a ray.
const REPEATS: usize = 3;
/// Share of the pixels whose values the automatic scale shows apart.
const SHOWN: f64 = 0.998;

/// What the primary rays of each pixel cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Costs {
    size: [u32; 2],
    /// Rays per pixel.
    samples: u32,
    of_pixels: OfPixels,
    seen_ratio: f64,
}

/// The sum over the rays of each pixel.
#[derive(Clone, Debug, PartialEq)]
enum OfPixels {
    /// Traversal steps on the CPU.
    Steps(Vec<Steps>),
    /// Ticks of the clock of a device.
    Ticks(Vec<u64>),
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

/// Measures what all primary rays cost: by the device's clock if there is one, otherwise in steps on the CPU.
///
/// # Errors
/// Fails if the device does.
pub(super) fn measured(renderer: &Renderer, frame: &Frame, tracing: &Tracing) -> Result<Costs, DeviceError> {
    match tracing {
        Tracing::Device(device) if device.has_clock() => clocked(*device, frame),
        _ => Ok(counted(renderer, frame)),
    }
}

/// Counts the steps of all primary rays.
pub(super) fn counted(renderer: &Renderer, frame: &Frame) -> Costs {
    let tracer = CpuTracer::new(&renderer.accel);
    let of_pixels = each_pixel(
        0..frame.pixels(),
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
    let seen_ratio = frame.seen_ratio(of_pixels.iter().map(|(_, hits)| *hits));
    let of_pixels = OfPixels::Steps(of_pixels.into_iter().map(|(steps, _)| steps).collect());
    Costs { size: frame.size, samples: frame.samples, of_pixels, seen_ratio }
}

/// Measures the time of all primary rays.
fn clocked(device: &dyn BatchTracer, frame: &Frame) -> Result<Costs, DeviceError> {
    let (mut ticks, mut hits) = (Vec::with_capacity(frame.pixels()), Vec::with_capacity(frame.pixels()));
    let samples = frame.samples as usize;
    let step = (RAYS_AT_ONCE / samples).max(1);
    for first in (0..frame.pixels()).step_by(step) {
        let some = first..(first + step).min(frame.pixels());
        let rays: Vec<Ray> = some.flat_map(|pixel| frame.samples_of(pixel)).map(|sample| sample.ray).collect();
        for of_pixel in least_ticks(device, &rays)?.chunks(samples) {
            ticks.push(of_pixel.iter().map(|ray| u64::from(ray.ticks)).sum());
            hits.push(of_pixel.iter().map(|ray| u32::from(ray.is_hit)).sum());
        }
    }
    let seen_ratio = frame.seen_ratio(hits.into_iter());
    Ok(Costs { size: frame.size, samples: frame.samples, of_pixels: OfPixels::Ticks(ticks), seen_ratio })
}

/// Times rays repeatedly and returns the least time of each: whatever interrupts a ray only adds to its time.
fn least_ticks(device: &dyn BatchTracer, rays: &[Ray]) -> Result<Vec<Ticks>, DeviceError> {
    let mut least = device.ticks(rays)?;
    for _ in 1..REPEATS {
        let again = device.ticks(rays)?;
        least.iter_mut().zip(again).for_each(|(least, again)| least.ticks = least.ticks.min(again.ticks));
    }
    Ok(least)
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
        let pixels = self.values().map(|value| colours.at(value / scale)).collect();
        let values = Some(Values::of(self.values(), scale, self.unit()));
        let statistics =
            Statistics { seen_ratio: self.seen_ratio, values, steps: self.mean(), ..Statistics::default() };
        let mut picture = Picture::of(self.size, pixels, statistics);
        legend::draw(&mut picture, colours, scale, &format!("{} per ray", self.unit().name()));
        picture
    }

    /// Returns the unit of the values.
    pub fn unit(&self) -> Unit {
        match self.of_pixels {
            OfPixels::Steps(_) => Unit::Steps,
            OfPixels::Ticks(_) => Unit::Ticks,
        }
    }

    /// Returns the mean steps per ray; `None` if time was measured instead.
    pub fn mean(&self) -> Option<MeanSteps> {
        let OfPixels::Steps(steps) = &self.of_pixels else { return None };
        let rays = steps.len() as f64 * f64::from(self.samples);
        let mean = |of: fn(&Steps) -> u32| steps.iter().map(|s| u64::from(of(s))).sum::<u64>() as f64 / rays;
        Some(MeanSteps {
            tlas_nodes: mean(|s| s.top),
            entries: mean(|s| s.entries),
            blas_nodes: mean(|s| s.bottom),
            triangle_tests: mean(|s| s.tests),
        })
    }

    /// Returns the cost per ray of each pixel, in rows from the top: steps, triangle tests included, or ticks.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        let count = self.size[0] as usize * self.size[1] as usize;
        let sum = |pixel: usize| match &self.of_pixels {
            OfPixels::Steps(steps) => steps[pixel].total() + u64::from(steps[pixel].tests),
            OfPixels::Ticks(ticks) => ticks[pixel],
        };
        (0..count).map(move |pixel| sum(pixel) as f64 / f64::from(self.samples))
    }
}
