//! The pixels of a picture and the rays through them.

use rayon::prelude::*;

use super::draws::{Draws, Purpose};
use super::{Camera, RenderError, RenderOptions, View};
use crate::verify::rays::Ray;
use crate::verify::view::View as Sight;

/// Number of pixels per task: few enough to spread over threads, enough to amortise what a task prepares.
const BATCH: usize = 128;

/// A picture to be drawn.
pub(super) struct Frame {
    pub(super) sight: Sight,
    pub(super) size: [u32; 2],
    /// Samples per pixel.
    pub(super) samples: u32,
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
        Ok(Frame { sight: camera.sight.fitted(width / height), size: options.size, samples, seed: options.seed })
    }

    /// Returns the number of pixels.
    pub(super) fn pixels(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }

    /// Computes something for every pixel, in rows from the top. `start` returns what a task uses for all its pixels.
    pub(super) fn each<S, T: Send>(
        &self,
        start: impl Fn() -> S + Sync + Send,
        of: impl Fn(&mut S, usize) -> T + Sync + Send,
    ) -> Vec<T> {
        (0..self.pixels()).into_par_iter().with_min_len(BATCH).map_init(start, of).collect()
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
    pub(super) fn ray(&self, pixel: usize, [x, y]: [f64; 2]) -> Ray {
        let [width, height] = self.size.map(|side| side as usize);
        let x = ((pixel % width) as f64 + x) / width as f64;
        let y = ((pixel / width) as f64 + y) / height as f64;
        let (origin, direction) = self.sight.ray([2.0 * x - 1.0, 1.0 - 2.0 * y]);
        Ray::endless(origin, direction)
    }
}
