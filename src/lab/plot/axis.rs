//! Logarithmic axes.

use std::ops::Range;

/// Part of an axis kept free at each end, as a share of its length.
const MARGIN: f64 = 0.06;

/// Least length of an axis, in decades.
const LEAST: f64 = 0.5;

/// A logarithmic axis on a picture.
pub(super) struct Axis {
    /// Decimal logarithms of the numbers at both ends.
    decades: Range<f64>,
    /// Pixels of both ends; the first may be the larger.
    pixels: [f64; 2],
}

impl Axis {
    /// Creates an axis for numbers above 0; others are ignored. With no number it reaches from 0.1 to 10.
    pub(super) fn of(numbers: impl Iterator<Item = f64>, pixels: [i32; 2]) -> Axis {
        let logs = numbers.filter(|x| *x > 0.0 && x.is_finite()).map(f64::log10);
        let (least, most) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), x| (l.min(x), m.max(x)));
        let (least, most) = if least <= most { (least, most) } else { (-1.0, 1.0) };
        let more = (LEAST - (most - least)).max(0.0) / 2.0 + MARGIN * (most - least).max(LEAST);
        Axis { decades: least - more..most + more, pixels: pixels.map(f64::from) }
    }

    /// Returns the pixel of a number above 0.
    pub(super) fn pixel(&self, x: f64) -> i32 {
        let share = (x.log10() - self.decades.start) / (self.decades.end - self.decades.start);
        (self.pixels[0] + share * (self.pixels[1] - self.pixels[0])).round() as i32
    }

    /// Returns the numbers to mark: powers of ten, of a short axis also multiples of them, and of a long one not all of
    /// them.
    pub(super) fn ticks(&self) -> Vec<f64> {
        let length = self.decades.end - self.decades.start;
        let factors: &[f64] = match length {
            ..1.2 => &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
            ..2.5 => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        let step = (length / 10.0).ceil().max(1.0) as i32;
        let powers = self.decades.start.floor() as i32..=self.decades.end.ceil() as i32;
        let powers = powers.filter(|power| power.rem_euclid(step) == 0);
        let ticks = powers.flat_map(|power| factors.iter().map(move |factor| factor * 10f64.powi(power)));
        ticks.filter(|x| self.decades.contains(&x.log10())).collect()
    }
}

/// Returns the name of a tick.
pub(super) fn name(x: f64) -> String {
    // Rounded first, as the product of a factor and a power is not exact.
    let rounded: f64 = format!("{x:.1e}").parse().unwrap_or(x);
    if rounded == 0.0 || (1e-2..1e5).contains(&rounded) { format!("{rounded}") } else { format!("{rounded:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lie_in_order_between_the_ends() {
        let axis = Axis::of([1e-9, 0.0, 1e-3].into_iter(), [700, 100]);
        let [least, middle, most] = [1e-9, 1e-6, 1e-3].map(|x| axis.pixel(x));
        assert!(least < 700 && middle == 400 && most > 100 && least > middle && middle > most);
        assert_eq!(axis.ticks().first().map(|x| name(*x)), Some("1e-9".into()));
    }

    #[test]
    fn short_and_empty_axes_have_ticks() {
        for numbers in [vec![], vec![300.0], vec![200.0, 900.0]] {
            let ticks = Axis::of(numbers.iter().copied(), [0, 1000]).ticks();
            assert!((2..=12).contains(&ticks.len()), "{ticks:?}");
        }
        assert_eq!([0.05, 200.0, 2e-7, 1e6].map(name), ["0.05", "200", "2e-7", "1e6"]);
    }
}
