//! Weights of the ray kinds.

use std::ops::RangeInclusive;

use super::PerKind;
use super::rays::RayKind;
use super::speed::KindSpeed;

/// Relative number of rays of each kind in a picture; each at least 0 and finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights(pub PerKind<f64>);

impl Default for Weights {
    /// Equal weights for the kinds that light a picture: all but random lines.
    fn default() -> Self {
        Weights(PerKind::of(|kind| if kind == RayKind::Random { 0.0 } else { 1.0 }))
    }
}

/// Speed over several ray kinds, in one view or over several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overall {
    /// Million rays per second through the input; 0 without rays.
    pub before_mrays_per_s: f64,
    /// Million rays per second through the output.
    pub after_mrays_per_s: f64,
    /// The time of the input over that of the output; 1 without rays.
    pub speedup_ratio: f64,
    /// Uncertainty of the speedup: that over repeats and that over views, added as squares.
    pub spread_ratio: f64,
    /// Uncertainty over repeats, see [`KindSpeed::spread_ratio`].
    pub repeats_spread_ratio: f64,
    /// Uncertainty over views: the standard error of the mean of their speedups; 0 for one view.
    pub views_spread_ratio: f64,
    /// The least speedup of any view.
    pub least_view_ratio: f64,
    /// The largest speedup of any view.
    pub most_view_ratio: f64,
}

impl Overall {
    /// Whether the output is faster by more than the uncertainty.
    pub fn is_faster(&self) -> bool {
        self.speedup_ratio > 1.0 + self.spread_ratio
    }

    /// Whether the output is faster, and in no view slower than allowed.
    pub fn is_never_slower(&self, least_view_ratio: f64) -> bool {
        self.is_faster() && self.least_view_ratio >= least_view_ratio
    }

    /// The speedup that is left if the uncertainty is taken off.
    pub fn sure_ratio(&self) -> f64 {
        self.speedup_ratio - self.spread_ratio
    }

    /// The speed of one view.
    fn of_view(before_mrays_per_s: f64, after_mrays_per_s: f64, speedup_ratio: f64, spread_ratio: f64) -> Overall {
        Overall {
            before_mrays_per_s,
            after_mrays_per_s,
            speedup_ratio,
            spread_ratio,
            repeats_spread_ratio: spread_ratio,
            views_spread_ratio: 0.0,
            least_view_ratio: speedup_ratio,
            most_view_ratio: speedup_ratio,
        }
    }
}

/// Range of the largest weight for which no scaling is needed: sums and products of others overflow or underflow.
const ORDINARY: RangeInclusive<f64> = 1e-100..=1e100;

impl Weights {
    /// One kind alone.
    pub fn only(kind: RayKind) -> Weights {
        Weights(PerKind::of(|other| if other == kind { 1.0 } else { 0.0 }))
    }

    /// The largest weight.
    pub fn largest(&self) -> f64 {
        self.0.values().copied().fold(0.0, f64::max)
    }

    /// The weighted sum of something that every kind has over the sum of the weights; 0 where that is 0.
    pub fn mean(&self, of: &PerKind<f64>) -> f64 {
        let sum: f64 = self.counted().map(|(kind, weight)| weight * of[kind]).sum();
        let total = self.total();
        if total > 0.0 { sum / total } else { 0.0 }
    }

    /// Returns the speed over all kinds: times add up, as they do over a picture. Kinds are timed one after the other,
    /// so their errors are independent: the squares add up, each weighted by its share of the time.
    pub fn overall(&self, kinds: &PerKind<KindSpeed>) -> Overall {
        let before = self.mean(&kinds.each_ref().map(|k| 1.0 / k.before_mrays_per_s));
        let time = |k: &KindSpeed| 1.0 / (k.before_mrays_per_s * k.speedup_ratio);
        let after = self.mean(&kinds.each_ref().map(time));
        if !(before > 0.0 && before.is_finite() && after > 0.0 && after.is_finite()) {
            return Overall::of_view(0.0, 0.0, 1.0, 0.0);
        }
        let total = self.total();
        let share = |kind: RayKind, weight: f64| weight / total * time(&kinds[kind]) / after;
        let off = |(kind, weight)| (share(kind, weight) * kinds[kind].spread_ratio / kinds[kind].speedup_ratio).powi(2);
        let speedup_ratio = before / after;
        let spread_ratio = speedup_ratio * self.counted().map(off).sum::<f64>().sqrt();
        Overall::of_view(1.0 / before, 1.0 / after, speedup_ratio, spread_ratio)
    }

    /// Returns the kinds with nonzero weight, with their weights.
    fn counted(&self) -> impl Iterator<Item = (RayKind, f64)> {
        let scaled = self.scaled();
        RayKind::ALL.into_iter().map(move |kind| (kind, scaled[kind])).filter(|(_, weight)| *weight > 0.0)
    }

    fn total(&self) -> f64 {
        self.scaled().values().sum()
    }

    /// Returns the weights over the largest if that is far from 1, otherwise bit for bit as they are.
    fn scaled(&self) -> PerKind<f64> {
        let most = self.largest();
        if most == 0.0 || ORDINARY.contains(&most) { self.0 } else { self.0.map(|weight| weight / most) }
    }
}

impl std::str::FromStr for Weights {
    type Err = String;

    /// Parses `primary=1,shadow=1,diffuse=1,random=0`; omitted kinds weigh 0.
    fn from_str(text: &str) -> Result<Weights, String> {
        let mut weights = Weights(PerKind::default());
        let mut given = PerKind::<bool>::default();
        for part in text.split(',') {
            let (name, value) = part.split_once('=').ok_or_else(|| format!("`{part}` is not KIND=WEIGHT"))?;
            let kind = RayKind::ALL.into_iter().find(|kind| kind.name() == name.trim());
            let all = || RayKind::ALL.map(RayKind::name).join(", ");
            let kind = kind.ok_or_else(|| format!("`{name}` is none of {}", all()))?;
            if std::mem::replace(&mut given[kind], true) {
                return Err(format!("`{}` is given twice", kind.name()));
            }
            weights.0[kind] = match value.trim().parse() {
                Ok(weight) if (0.0..f64::INFINITY).contains(&weight) => weight,
                _ => return Err(format!("`{value}` is not a weight: a number of at least 0")),
            };
        }
        if weights.0.values().any(|weight| *weight > 0.0) { Ok(weights) } else { Err("no kind counts anything".into()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind(before: f64, speedup_ratio: f64, spread_ratio: f64) -> KindSpeed {
        KindSpeed { before_mrays_per_s: before, after_mrays_per_s: before * speedup_ratio, speedup_ratio, spread_ratio }
    }

    fn weights(of: [f64; 4]) -> Weights {
        Weights(of.into())
    }

    #[test]
    fn times_add_up_and_what_counts_nothing_does_not_matter() {
        let unsure = kind(1.0, 9.0, f64::INFINITY);
        let kinds = [kind(1.0, 2.0, 0.2), kind(2.0, 1.0, 0.0), kind(2.0, 1.0, 0.0), unsure];
        let all = Weights::default().overall(&kinds.into());
        assert!((all.speedup_ratio - 2.0 / 1.5).abs() < 1e-12, "{all:?}");
        assert!((all.spread_ratio - all.speedup_ratio * 0.1 / 3.0).abs() < 1e-12, "{all:?}");
        assert!((all.before_mrays_per_s - 1.5).abs() < 1e-12 && all.is_faster());
    }

    #[test]
    fn without_rays_nothing_is_faster() {
        let none = Weights::default().overall(&PerKind::default());
        assert_eq!((none.speedup_ratio, none.is_faster()), (1.0, false));
    }

    #[test]
    fn only_the_relation_of_weights_counts() {
        let kinds = [kind(1.0, 2.0, 0.2), kind(3.0, 1.1, 0.1), kind(7.0, 0.9, 0.3), kind(1.0, 1.0, 0.0)].into();
        let of = |scale: f64| weights([scale, scale, scale / 2.0, 0.0]).overall(&kinds);
        let one = of(1.0);
        assert!(one.is_faster(), "{one:?}");
        for scale in [f64::MAX, 1e308, 1e101, 3e-101, 1e-300, 1e-310] {
            let [a, b] =
                [one, of(scale)].map(|o| [o.before_mrays_per_s, o.after_mrays_per_s, o.speedup_ratio, o.spread_ratio]);
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-12 * a), "{scale}: {b:?} for {a:?}");
        }
        let denormal = weights([1e-320, 1e-320, 0.0, 0.0]);
        assert_eq!(denormal.mean(&[1.0, 3.0, 5.0, 7.0].into()), 2.0);
        assert_eq!(weights([1e308, 0.0, 1e-308, 0.0]).mean(&[1.0, 3.0, f64::MAX, 7.0].into()), 1.0);
    }

    #[test]
    fn ordinary_weights_stay_bit_for_bit() {
        for of in [[0.1, 0.3, 0.0, 0.7], [1e100, 1e-300, 0.0, 3.0], [1e-100, 1e-101, 0.0, 0.0], [0.0; 4]] {
            assert_eq!(weights(of).scaled().map(f64::to_bits), of.map(f64::to_bits).into());
        }
    }

    #[test]
    fn weights_are_read_by_name() {
        assert_eq!("shadow=2, diffuse=0.5".parse(), Ok(weights([0.0, 2.0, 0.5, 0.0])));
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
