//! Random numbers that are spread evenly over the samples of a pixel.
//!
//! For each purpose, the samples of a pixel draw consecutive points of a (0, 2)-sequence: of 2^n samples, every box of
//! area 2^-n whose sides are powers of two holds one. Sequence and index are scrambled by the pixel and the purpose, as in
//! B. Burley, "Practical Hash-based Owen Scrambling", Journal of Computer Graphics Techniques 9(4), 2020; the sequence
//! itself is that of T. Kollig and A. Keller, "Efficient Multidimensional Sampling", Computer Graphics Forum 21(3), 2002.

use glam::DVec3;

use crate::verify::random::{Random, direction};

/// Streams of the random numbers of pixels; apart from those of verifications.
const STREAM: u64 = 64;

/// What numbers are drawn for. Numbers of one purpose are spread evenly, numbers of two purposes are independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Where in its pixel a sample lies.
    Pixel,
    /// Which point of the lamp lights a surface.
    Lamp,
    /// Where light that a surface scatters comes from.
    Bounce,
    /// Which point of the lamp lights what is there.
    BounceLamp,
    /// Where light that a surface mirrors comes from.
    Mirror,
    /// Which point of the lamp lights what is there.
    MirrorLamp,
}

/// Number of purposes.
const PURPOSES: u64 = Purpose::MirrorLamp as u64 + 1;

/// The random numbers of a sample. They depend on the seed, the pixel, the sample and what they are for, not on their
/// order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draws {
    seed: u64,
    pixel: usize,
    sample: u32,
    layer: u64,
}

impl Draws {
    pub(super) fn of(seed: u64, pixel: usize, sample: u32) -> Draws {
        Draws { seed, pixel, sample, layer: 0 }
    }

    /// Returns the numbers for the n-th surface on the primary ray, independent of those for others.
    pub(super) fn at_layer(self, layer: usize) -> Draws {
        Draws { layer: layer as u64, ..self }
    }

    /// Returns two numbers in [0, 1).
    pub(super) fn pair(&self, purpose: Purpose) -> [f64; 2] {
        let stream = STREAM + self.layer * PURPOSES + purpose as u64;
        let mut random = Random::at(self.seed, stream, self.pixel);
        let [order, both] = [random.bits(), random.bits()];
        let index = scrambled(self.sample, order as u32);
        let point = [index.reverse_bits(), second(index)];
        let scrambles = [both as u32, (both >> 32) as u32];
        [0, 1].map(|axis| f64::from(scrambled(point[axis], scrambles[axis])) / 2f64.powi(32))
    }

    /// Returns a direction; all are equally likely.
    pub(super) fn direction(&self, purpose: Purpose) -> DVec3 {
        direction(self.pair(purpose))
    }
}

/// Second coordinate of a point of the sequence, as 32 binary digits; the first one has the digits of the index reversed.
fn second(mut index: u32) -> u32 {
    let (mut digits, mut column) = (0, 1u32 << 31);
    while index != 0 {
        if index & 1 == 1 {
            digits ^= column;
        }
        column ^= column >> 1;
        index >>= 1;
    }
    digits
}

/// Flips each binary digit or not, depending on the seed and the digits above it.
fn scrambled(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits().wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(factor);
    }
    x.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes of the unit square, as many as samples, of which each holds one sample.
    fn fills_boxes(points: &[[f64; 2]]) -> bool {
        let count = points.len();
        (0..=count.ilog2()).all(|n| {
            let columns = 1 << n;
            let rows = count / columns;
            let mut boxes: Vec<usize> =
                points.iter().map(|[x, y]| (x * columns as f64) as usize * rows + (y * rows as f64) as usize).collect();
            boxes.sort_unstable();
            boxes.into_iter().eq(0..count)
        })
    }

    #[test]
    fn samples_of_a_pixel_fill_all_boxes_of_their_area() {
        for (count, pixel) in [(1, 3), (4, 0), (4, 77), (16, 5), (256, 1)] {
            let draw = |purpose| move |sample| Draws::of(7, pixel, sample).at_layer(2).pair(purpose);
            let points: Vec<_> = (0..count).map(draw(Purpose::Lamp)).collect();
            assert!(fills_boxes(&points), "{points:?}");
            assert_ne!(points, (0..count).map(draw(Purpose::Bounce)).collect::<Vec<_>>(), "purposes are independent");
        }
    }

    #[test]
    fn pixels_layers_and_seeds_are_independent() {
        let of = |seed, pixel, layer| Draws::of(seed, pixel, 0).at_layer(layer).pair(Purpose::Lamp);
        let all = [of(1, 0, 0), of(2, 0, 0), of(1, 1, 0), of(1, 0, 1)];
        assert!((0..4).all(|i| (0..i).all(|j| all[i] != all[j])), "{all:?}");
        let mean: f64 = (0..4096).map(|pixel| of(1, pixel, 0)[0]).sum::<f64>() / 4096.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
    }
}
