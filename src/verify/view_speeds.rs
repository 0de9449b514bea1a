//! The speed of both files over several views.
//!
//! Every line of a report comes from one table: picoseconds per ray of the input and of the output, by view and by ray
//! kind. Times add up over kinds with the weights of the kinds, and over views with weights that make every view count
//! alike: one over the geometric mean of the view's times through input and output, so that exchanging the two files
//! turns each ratio into its reciprocal. A ratio of sums lies between the ratios of its parts. So the overall speedup is
//! never outside of those of the kinds, nor of those of the views.

use super::PerKind;
use super::rays::RayKind;
use super::speed::KindSpeed;
use super::weights::{Overall, Weights};

/// Speed by ray kind in each of several views.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewSpeeds(pub Vec<PerKind<KindSpeed>>);

impl ViewSpeeds {
    /// Returns the speed of each view, over all kinds.
    pub fn views(&self, weights: &Weights) -> Vec<Overall> {
        self.0.iter().map(|kinds| weights.overall(kinds)).collect()
    }

    /// Returns the speed of each kind, over all views; the spread is that over repeats and views.
    pub fn kinds(&self, weights: &Weights) -> PerKind<KindSpeed> {
        let over_repeats = self.kinds_over_repeats(weights);
        PerKind::of(|kind| {
            let timed = self.0.iter().map(|kinds| kinds[kind]).filter(|speed| speed.before_mrays_per_s > 0.0);
            let ratios: Vec<f64> = timed.map(|speed| speed.speedup_ratio).collect();
            let speed = over_repeats[kind];
            let spread_ratio = speed.spread_ratio.hypot(speed.speedup_ratio * standard_error(&ratios));
            KindSpeed { spread_ratio, ..speed }
        })
    }

    /// Like [`ViewSpeeds::kinds`], with the spread over repeats alone.
    fn kinds_over_repeats(&self, weights: &Weights) -> PerKind<KindSpeed> {
        let views = self.views(weights);
        let picoseconds = |view: &Overall| 1.0 / (view.before_mrays_per_s * view.after_mrays_per_s).sqrt();
        let weight = |view: &Overall| if view.before_mrays_per_s > 0.0 { 1.0 / picoseconds(view) } else { 1.0 };
        let weights: Vec<f64> = views.iter().map(weight).collect();
        PerKind::of(|kind| self.kind(kind, &weights))
    }

    /// Returns the speed over all kinds and views.
    pub fn overall(&self, weights: &Weights) -> Overall {
        let all = weights.overall(&self.kinds_over_repeats(weights));
        let timed = self.views(weights).into_iter().filter(|view| view.before_mrays_per_s > 0.0);
        let ratios: Vec<f64> = timed.map(|view| view.speedup_ratio).collect();
        if ratios.is_empty() {
            return all;
        }
        let views_spread_ratio = all.speedup_ratio * standard_error(&ratios);
        Overall {
            views_spread_ratio,
            spread_ratio: all.repeats_spread_ratio.hypot(views_spread_ratio),
            least_view_ratio: ratios.iter().copied().fold(f64::INFINITY, f64::min),
            most_view_ratio: ratios.iter().copied().fold(0.0, f64::max),
            ..all
        }
    }

    /// Returns the speed of a kind over all views with weights of their own. Views are timed one after the other, so the
    /// squares of their relative spreads add up, each weighted by its share of the time.
    fn kind(&self, kind: RayKind, weights: &[f64]) -> KindSpeed {
        let timed = || {
            let of_kind = self.0.iter().map(|kinds| &kinds[kind]).zip(weights);
            of_kind.filter(|(speed, _)| speed.before_mrays_per_s > 0.0 && speed.speedup_ratio > 0.0)
        };
        let after = |speed: &KindSpeed| 1.0 / (speed.before_mrays_per_s * speed.speedup_ratio);
        let total: f64 = timed().map(|(_, weight)| weight).sum();
        if total == 0.0 {
            return KindSpeed::default();
        }
        let before_sum: f64 = timed().map(|(speed, weight)| weight / speed.before_mrays_per_s).sum();
        let after_sum: f64 = timed().map(|(speed, weight)| weight * after(speed)).sum();
        let off = |(speed, weight): (&KindSpeed, &f64)| {
            (weight * after(speed) / after_sum * speed.spread_ratio / speed.speedup_ratio).powi(2)
        };
        let speedup_ratio = before_sum / after_sum;
        KindSpeed {
            before_mrays_per_s: total / before_sum,
            after_mrays_per_s: total / after_sum,
            speedup_ratio,
            spread_ratio: speedup_ratio * timed().map(off).sum::<f64>().sqrt(),
        }
    }
}

/// Standard error of the mean of the logarithms of ratios; 0 for one ratio, which has no spread to speak of.
fn standard_error(ratios: &[f64]) -> f64 {
    let count = ratios.len() as f64;
    if count < 2.0 {
        return 0.0;
    }
    let mean = ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / count;
    let squares: f64 = ratios.iter().map(|ratio| (ratio.ln() - mean).powi(2)).sum();
    (squares / (count - 1.0) / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn speed(before_mrays_per_s: f64, speedup_ratio: f64, spread_ratio: f64) -> KindSpeed {
        let after_mrays_per_s = before_mrays_per_s * speedup_ratio;
        KindSpeed { before_mrays_per_s, after_mrays_per_s, speedup_ratio, spread_ratio }
    }

    fn view(of: [(f64, f64); 2]) -> PerKind<KindSpeed> {
        let [primary, shadow] = of.map(|(before, ratio)| speed(before, ratio, 0.01));
        [primary, shadow, KindSpeed::default(), KindSpeed::default()].into()
    }

    fn weights() -> Weights {
        "primary=1,shadow=1".parse().expect("weights")
    }

    fn swapped(kinds: &PerKind<KindSpeed>) -> PerKind<KindSpeed> {
        kinds.map(|k| speed(k.after_mrays_per_s, 1.0 / k.speedup_ratio, k.spread_ratio))
    }

    #[test]
    fn a_slow_view_counts_as_much_as_a_fast_one() {
        let views = ViewSpeeds(vec![view([(1.0, 1.2); 2]), view([(100.0, 1.0 / 1.2); 2])]);
        let all = views.overall(&weights());
        assert!((all.speedup_ratio - 1.0).abs() < 1e-12, "{all:?}");
        assert!((all.least_view_ratio - 1.0 / 1.2).abs() < 1e-12 && (all.most_view_ratio - 1.2).abs() < 1e-12);
        assert!((all.views_spread_ratio - 1.2f64.ln()).abs() < 1e-12 && !all.is_faster(), "{all:?}");
    }

    #[test]
    fn the_overall_speedup_lies_within_those_of_the_kinds_and_of_the_views() {
        // In each view the kind that takes long gains and the other loses.
        let views = [view([(1.0, 1.2), (9.0, 0.8)]), view([(9.0, 0.8), (1.0, 1.2)]), view([(2.0, 0.9), (3.0, 0.9)])];
        let views = ViewSpeeds(views.to_vec());
        let (kinds, all) = (views.kinds(&weights()), views.overall(&weights()));
        let of_kinds = [RayKind::Primary, RayKind::Shadow].map(|kind| kinds[kind].speedup_ratio);
        let of_views = views.views(&weights()).into_iter().map(|view| view.speedup_ratio).collect::<Vec<_>>();
        for parts in [&of_kinds[..], &of_views] {
            let [least, most] = [f64::min, f64::max].map(|of| parts.iter().copied().reduce(of).expect("some"));
            assert!((least..=most).contains(&all.speedup_ratio), "{parts:?} {all:?}");
        }
        assert!(kinds.values().all(|k| (k.after_mrays_per_s - k.before_mrays_per_s * k.speedup_ratio).abs() < 1e-9));
    }

    #[test]
    fn exchanging_the_files_turns_the_ratio_into_its_reciprocal() {
        let views = ViewSpeeds(vec![view([(1.0, 1.3), (5.0, 0.9)]), view([(70.0, 1.1), (3.0, 1.05)])]);
        let other = ViewSpeeds(views.0.iter().map(swapped).collect());
        let [here, there] = [views, other].map(|views| views.overall(&weights()));
        assert!((here.speedup_ratio * there.speedup_ratio - 1.0).abs() < 1e-12, "{here:?} {there:?}");
        assert!((here.least_view_ratio * there.most_view_ratio - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_view_without_rays_counts_for_nothing_and_one_view_has_no_spread() {
        let one = ViewSpeeds(vec![view([(1.0, 1.5); 2]), PerKind::default()]);
        let all = one.overall(&weights());
        assert!((all.speedup_ratio - 1.5).abs() < 1e-12 && all.views_spread_ratio == 0.0, "{all:?}");
        assert_eq!(ViewSpeeds::default().overall(&weights()), weights().overall(&PerKind::default()));
    }

    #[test]
    fn one_kind_alone_is_the_overall_speed() {
        let views = ViewSpeeds(vec![view([(1.0, 1.3), (5.0, 0.9)]), view([(70.0, 1.1), (3.0, 1.05)])]);
        let (all, kind) = (views.overall(&Weights::only(RayKind::Shadow)), views.kinds(&weights())[RayKind::Shadow]);
        let alone = views.kinds(&Weights::only(RayKind::Shadow))[RayKind::Shadow];
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(close(all.speedup_ratio, alone.speedup_ratio) && close(all.spread_ratio, alone.spread_ratio));
        assert!(kind.spread_ratio > all.repeats_spread_ratio);
    }

    #[test]
    fn spreads_of_views_and_repeats_add_up_as_squares() {
        let views = ViewSpeeds(vec![view([(1.0, 1.1); 2]), view([(1.0, 1.2); 2])]);
        let all = views.overall(&weights());
        let expected = all.repeats_spread_ratio.hypot(all.views_spread_ratio);
        assert!(all.spread_ratio == expected && all.repeats_spread_ratio > 0.0 && all.views_spread_ratio > 0.0);
    }
}
