//! What the kinds of rays count for.

use super::speed::{KindSpeed, Kinds};

/// How many rays of each kind a picture takes, in relation to each other; each at least 0.
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

impl Weights {
    /// The weighted sum of something that every kind has, in the order of [`super::rays::RayKind::ALL`], over the sum
    /// of the weights; 0 where that is 0.
    pub fn mean(&self, of: [f64; 4]) -> f64 {
        let sum: f64 = self.counted().map(|(i, weight)| weight * of[i]).sum();
        let total: f64 = self.0.iter().sum();
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
        let total: f64 = self.0.iter().sum();
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
        self.0.into_iter().enumerate().filter(|(_, weight)| *weight > 0.0)
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
        if weights.0.iter().sum::<f64>() > 0.0 { Ok(weights) } else { Err("no kind counts anything".into()) }
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
