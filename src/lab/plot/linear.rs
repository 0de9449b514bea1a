//! Linear axes that begin at zero.

/// Part of an axis kept free at its end, as a share of the largest number.
const MARGIN: f64 = 0.06;

/// Number of ticks aimed for.
const TICKS: f64 = 6.0;

/// A linear axis from zero on a picture.
pub(super) struct LinearAxis {
    most: f64,
    /// Pixels of zero and of the end; the first may be the larger.
    pixels: [f64; 2],
}

impl LinearAxis {
    /// Creates an axis for numbers of at least 0; others are ignored. With no number it reaches to 1.
    pub(super) fn of(numbers: impl Iterator<Item = f64>, pixels: [i32; 2]) -> LinearAxis {
        let most = numbers.filter(|x| x.is_finite()).fold(0.0, f64::max);
        let most = if most > 0.0 { most * (1.0 + MARGIN) } else { 1.0 };
        LinearAxis { most, pixels: pixels.map(f64::from) }
    }

    /// Returns the pixel of a number.
    pub(super) fn pixel(&self, x: f64) -> i32 {
        (self.pixels[0] + x / self.most * (self.pixels[1] - self.pixels[0])).round() as i32
    }

    /// Returns the numbers to mark: multiples of one, two or five times a power of ten.
    pub(super) fn ticks(&self) -> Vec<f64> {
        let power = 10f64.powf((self.most / TICKS).log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter();
        let step = step.min_by(|a, b| (self.most / a - TICKS).abs().total_cmp(&(self.most / b - TICKS).abs()));
        let step = step.unwrap_or(power);
        (0..=(self.most / step).floor() as u32).map(|i| f64::from(i) * step).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::plot::axis::name;

    #[test]
    fn ticks_are_round_and_few() {
        for (most, expected) in [(10.0, "0 2 4 6 8 10"), (0.9, "0 0.2 0.4 0.6 0.8"), (4321.0, "0 1000 2000 3000 4000")]
        {
            let axis = LinearAxis::of([most, 1e-3, f64::NAN].into_iter(), [100, 0]);
            assert_eq!(axis.ticks().into_iter().map(name).collect::<Vec<_>>().join(" "), expected);
            assert!(axis.pixel(0.0) == 100 && axis.pixel(most) > 0 && axis.pixel(most) < 10);
        }
        assert_eq!(LinearAxis::of([].into_iter(), [0, 10]).ticks().len(), 6);
    }
}
