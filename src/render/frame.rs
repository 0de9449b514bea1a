//! The pixels of a picture and the rays through them.

use std::ops::Range;

use rayon::prelude::*;

use super::draws::{Draws, Purpose};
use super::probe::{Probe, Tracing, on_device};
use super::{Camera, Light, RenderError, RenderOptions, View};
use crate::verify::DeviceError;
use crate::verify::rays::Ray;
use crate::verify::view::View as Sight;

/// Number of pixels per task: few enough to spread over threads, enough to amortise what a task prepares.
pub(super) const BATCH: usize = 128;
/// Number of samples whose rays a device traces at once: enough to keep it busy, few enough to remember their answers.
const SAMPLES_AT_ONCE: usize = 1 << 18;

/// A picture to be drawn.
#[derive(Clone)]
pub(super) struct Frame {
    pub(super) sight: Sight,
    pub(super) size: [u32; 2],
    /// Samples per pixel.
    pub(super) samples: u32,
    pub(super) light: Option<Light>,
    pub(super) light_power: Option<f64>,
    seed: u64,
}

/// A sample of a pixel: a ray, and random numbers of its own.
pub(super) struct Sample {
    pub(super) ray: Ray,
    pub(super) draws: Draws,
}

impl Frame {
    /// Returns the frame of a picture.
    ///
    /// # Errors
    /// The first option that is out of range.
    pub(super) fn new(view: View, camera: &Camera, options: &RenderOptions) -> Result<Frame, RenderError> {
        let samples = options.checked(view)?;
        let [width, height] = options.size.map(f64::from);
        let RenderOptions { size, seed, light, light_power, .. } = *options;
        Ok(Frame { sight: camera.sight.fitted(width / height), size, samples, light, light_power, seed })
    }

    /// Returns the number of pixels.
    pub(super) fn pixels(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }

    /// Returns the share of the rays that hit something, given how many rays of each pixel do.
    pub(super) fn seen_ratio(&self, hits: impl ExactSizeIterator<Item = u32>) -> f64 {
        let rays = hits.len() as f64 * f64::from(self.samples);
        hits.map(u64::from).sum::<u64>() as f64 / rays
    }

    /// Returns the same picture with one sample in the middle of each pixel.
    pub(super) fn middles(&self) -> Frame {
        Frame { samples: 1, ..self.clone() }
    }

    /// Computes something of every sample, and of the samples of every pixel, in rows from the top.
    ///
    /// # Errors
    /// Fails if the device does.
    pub(super) fn each<T: Send, P: Send>(
        &self,
        tracing: &Tracing,
        of_sample: impl Fn(&mut Probe, &Sample) -> T + Sync + Send,
        of_pixel: impl Fn(&mut dyn Iterator<Item = T>) -> P + Sync + Send,
    ) -> Result<Vec<P>, DeviceError> {
        self.each_within(0..self.pixels(), tracing, of_sample, of_pixel)
    }

    /// The same for some of the pixels.
    pub(super) fn each_within<T: Send, P: Send>(
        &self,
        pixels: Range<usize>,
        tracing: &Tracing,
        of_sample: impl Fn(&mut Probe, &Sample) -> T + Sync + Send,
        of_pixel: impl Fn(&mut dyn Iterator<Item = T>) -> P + Sync + Send,
    ) -> Result<Vec<P>, DeviceError> {
        match tracing {
            Tracing::Cpu(tracer) => {
                let of = |probe: &mut Probe, pixel| of_pixel(&mut self.samples_of(pixel).map(|s| of_sample(probe, &s)));
                Ok(each_pixel(pixels, || Probe::Cpu(tracer.probe()), of))
            }
            Tracing::Device(device) => {
                let mut all = Vec::with_capacity(pixels.len());
                let samples = self.samples as usize;
                let step = (SAMPLES_AT_ONCE / samples).max(1);
                for first in pixels.clone().step_by(step) {
                    let some = first..(first + step).min(pixels.end);
                    let count = some.len();
                    let traced = on_device(*device, some.flat_map(|pixel| self.samples_of(pixel)), &of_sample)?;
                    let mut values = traced.into_iter();
                    all.extend((0..count).map(|_| of_pixel(&mut values.by_ref().take(samples))));
                }
                Ok(all)
            }
        }
    }

    /// Returns the samples of a pixel: its middle, or random points spread over it.
    pub(super) fn samples_of(&self, pixel: usize) -> impl Iterator<Item = Sample> {
        (0..self.samples).map(move |i| {
            let draws = Draws::of(self.seed, pixel, i);
            let within = if self.samples == 1 { [0.5; 2] } else { draws.pair(Purpose::Pixel) };
            Sample { ray: self.ray(pixel, within), draws }
        })
    }

    /// Returns the ray through a point of a pixel, from its upper left corner (0, 0) to its lower right one (1, 1).
    fn ray(&self, pixel: usize, [x, y]: [f64; 2]) -> Ray {
        let [width, height] = self.size.map(|side| side as usize);
        let x = ((pixel % width) as f64 + x) / width as f64;
        let y = ((pixel / width) as f64 + y) / height as f64;
        let (origin, direction) = self.sight.ray([2.0 * x - 1.0, 1.0 - 2.0 * y]);
        Ray::endless(origin, direction)
    }
}

/// Computes something of every pixel, in order. `start` returns what a task uses for all its pixels.
pub(super) fn each_pixel<S, P: Send>(
    pixels: Range<usize>,
    start: impl Fn() -> S + Sync + Send,
    of: impl Fn(&mut S, usize) -> P + Sync + Send,
) -> Vec<P> {
    pixels.into_par_iter().with_min_len(BATCH).map_init(start, of).collect()
}
