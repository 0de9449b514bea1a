//! What the kinds of rays count for.

use std::ops::RangeInclusive;

use super::speed::{KindSpeed, Kinds};

/// How many rays of each kind a picture takes, in relation to each other; each at least 0 and finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights(pub [f64; 4]);

impl Default for Weights {
    /// The kinds that light a picture, all but random lines, each counted alike.
    fn default() -> Self {
        Weights([1.0, 1.0, 1.0, 0.0])
    }
}

/// Speed over several kinds of rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overall {
    /// Million rays a second through the input; 0 without rays.
    pub before_mrays_per_s: f64,
    /// The same through the output.
    pub after_mrays_per_s: f64,
    /// The time of the input over that of the output; 1 without rays.
    pub speedup_ratio: f64,
    /// How far off it may be, as [`KindSpeed::spread_ratio`].
    pub spread_ratio: f64,
}

impl Overall {
    /// Whether the output is faster, by more than what may be off.
    pub fn is_faster(&self) -> bool {
        self.speedup_ratio > 1.0 + self.spread_ratio
    }
}

/// Weights of which the largest is in this range are taken as they are: sums and products of others overflow or vanish.
const ORDINARY: RangeInclusive<f64> = 1e-100..=1e100;

impl Weights {
    /// The weighted sum of something that every kind has, in the order of [`super::rays::RayKind::ALL`], over the sum
    /// of the weights; 0 where that is 0.
    pub fn mean(&self, of: [f64; 4]) -> f64 {
        let sum: f64 = self.counted().map(|(i, weight)| weight * of[i]).sum();
        let total = self.total();
        if total > 0.0 { sum / total } else { 0.0 }
    }

    /// The speed over all kinds: times add up, as they do over a picture. Kinds are timed one after the other, so
    /// that their errors are independent: their squares add up, each weighted by its share of the time.
    pub fn overall(&self, kinds: &Kinds) -> Overall {
        let kinds = kinds.named().map(|(_, kind)| kind);
        let before = self.mean(kinds.map(|k| 1.0 / k.before_mrays_per_s));
        let time = |k: KindSpeed| 1.0 / (k.before_mrays_per_s * k.speedup_ratio);
        let after = self.mean(kinds.map(time));
        if !(before > 0.0 && before.is_finite() && after > 0.0 && after.is_finite()) {
            return Overall { before_mrays_per_s: 0.0, after_mrays_per_s: 0.0, speedup_ratio: 1.0, spread_ratio: 0.0 };
        }
        let total = self.total();
        let share = |i: usize, weight: f64| weight / total * time(kinds[i]) / after;
        let off = |(i, weight)| (share(i, weight) * kinds[i].spread_ratio / kinds[i].speedup_ratio).powi(2);
        let speedup_ratio = before / after;
        Overall {
            before_mrays_per_s: 1.0 / before,
            after_mrays_per_s: 1.0 / after,
            speedup_ratio,
            spread_ratio: speedup_ratio * self.counted().map(off).sum::<f64>().sqrt(),
        }
    }

    /// The kinds that count, with their weights.
    fn counted(&self) -> impl Iterator<Item = (usize, f64)> {
        self.scaled().into_iter().enumerate().filter(|(_, weight)| *weight > 0.0)
    }

    fn total(&self) -> f64 {
        self.scaled().iter().sum()
    }

    /// The weights over the largest where that is far from 1, else bit for bit as they are.
    fn scaled(&self) -> [f64; 4] {
        let most = self.0.into_iter().fold(0.0, f64::max);
        if most == 0.0 || ORDINARY.contains(&most) { self.0 } else { self.0.map(|weight| weight / most) }
    }
}

impl std::str::FromStr for Weights {
    type Err = String;

    /// Reads `primary=1,shadow=1,diffuse=1,random=0`; kinds left out count nothing.
    fn from_str(text: &str) -> Result<Weights, String> {
        let mut weights = Weights([0.0; 4]);
        let mut given = [false; 4];
        for part in text.split(',') {
            let (name, value) = part.split_once('=').ok_or_else(|| format!("`{part}` is not KIND=WEIGHT"))?;
            let names = Kinds::default().named().map(|(name, _)| name);
            let kind = names.iter().position(|n| *n == name.trim());
            let kind = kind.ok_or_else(|| format!("`{name}` is none of {}", names.join(", ")))?;
            if std::mem::replace(&mut given[kind], true) {
                return Err(format!("`{}` is given twice", names[kind]));
            }
            weights.0[kind] = match value.trim().parse() {
                Ok(weight) if (0.0..f64::INFINITY).contains(&weight) => weight,
                _ => return Err(format!("`{value}` is not a weight: a number of at least 0")),
            };
        }
        if weights.0.iter().any(|weight| *weight > 0.0) { Ok(weights) } else { Err("no kind counts anything".into()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind(before: f64, speedup_ratio: f64, spread_ratio: f64) -> KindSpeed {
        KindSpeed { before_mrays_per_s: before, after_mrays_per_s: before * speedup_ratio, speedup_ratio, spread_ratio }
    }

    fn kinds(of: [KindSpeed; 4]) -> Kinds {
        let [primary, shadow, diffuse, random] = of;
        Kinds { primary, shadow, diffuse, random }
    }

    #[test]
    fn times_add_up_and_what_counts_nothing_does_not_matter() {
        let unsure = kind(1.0, 9.0, f64::INFINITY);
        let all =
            Weights::default().overall(&kinds([kind(1.0, 2.0, 0.2), kind(2.0, 1.0, 0.0), kind(2.0, 1.0, 0.0), unsure]));
        assert!((all.speedup_ratio - 2.0 / 1.5).abs() < 1e-12, "{all:?}");
        assert!((all.spread_ratio - all.speedup_ratio * 0.1 / 3.0).abs() < 1e-12, "{all:?}");
        assert!((all.before_mrays_per_s - 1.5).abs() < 1e-12 && all.is_faster());
    }

    #[test]
    fn without_rays_nothing_is_faster() {
        let none = Weights::default().overall(&Kinds::default());
        assert_eq!((none.speedup_ratio, none.is_faster()), (1.0, false));
    }

    #[test]
    fn only_the_relation_of_weights_counts() {
        let kinds = kinds([kind(1.0, 2.0, 0.2), kind(3.0, 1.1, 0.1), kind(7.0, 0.9, 0.3), kind(1.0, 1.0, 0.0)]);
        let of = |scale: f64| Weights([scale, scale, scale / 2.0, 0.0]).overall(&kinds);
        let one = of(1.0);
        assert!(one.is_faster(), "{one:?}");
        for scale in [f64::MAX, 1e308, 1e101, 3e-101, 1e-300, 1e-310] {
            let [a, b] =
                [one, of(scale)].map(|o| [o.before_mrays_per_s, o.after_mrays_per_s, o.speedup_ratio, o.spread_ratio]);
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-12 * a), "{scale}: {b:?} for {a:?}");
        }
        let denormal = Weights([1e-320, 1e-320, 0.0, 0.0]);
        assert_eq!(denormal.mean([1.0, 3.0, 5.0, 7.0]), 2.0);
        assert_eq!(Weights([1e308, 0.0, 1e-308, 0.0]).mean([1.0, 3.0, f64::MAX, 7.0]), 1.0);
    }

    #[test]
    fn ordinary_weights_stay_bit_for_bit() {
        for weights in [[0.1, 0.3, 0.0, 0.7], [1e100, 1e-300, 0.0, 3.0], [1e-100, 1e-101, 0.0, 0.0], [0.0; 4]] {
            assert_eq!(Weights(weights).scaled().map(f64::to_bits), weights.map(f64::to_bits));
        }
    }

    #[test]
    fn weights_are_read_by_name() {
        assert_eq!("shadow=2, diffuse=0.5".parse(), Ok(Weights([0.0, 2.0, 0.5, 0.0])));
        for wrong in [
            "",
            "shadow",
            "shadows=1",
            "shadow=-1",
            "shadow=inf",
            "shadow=0",
            "shadow=1,shadow=1",
            "shadow=0,random=1, shadow=2",
        ] {
            assert!(wrong.parse::<Weights>().is_err(), "{wrong}");
        }
    }
}
