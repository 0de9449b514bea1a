//! Fits prices to measured layouts.
//!
//! For each ray kind, finds the non-negative prices of [`crate::choose::model`] that minimise the sum of squared
//! *relative* errors of predicted times ([`super::nnls`]). Cross-validation rates how far they can be trusted: every
//! scene is predicted by prices fitted to the others (M. Stone, "Cross-Validatory Choice and Assessment of Statistical
//! Predictions", Journal of the Royal Statistical Society B 36(2), 1974). Whole scenes are left out, not single rows,
//! because layouts of one scene are similar.

use serde::Serialize;

use super::nnls;
use super::quality::{Quality, Times, quality};
use super::rows::{KindRow, Row, by_scene};
use crate::choose::model::{Class, Counts, Prices};
use crate::verify::rays::RayKind;
use crate::verify::weights::Weights;
use crate::verify::{MachineKind, PerKind};

/// Minimum number of rows: twice the number of prices.
const FEWEST_ROWS: usize = 8;

/// Identifies the JSON form of [`Fit`].
pub const SCHEMA: &str = "raykiln.fit/1";

/// Prices of a device class, and how well they predict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fit {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// The device class.
    pub class: &'static str,
    /// The device that timed the layouts.
    pub device: String,
    /// `gpu`, `software driver` or `cpu`.
    pub device_kind: MachineKind,
    /// Number of layouts used.
    pub layouts: usize,
    /// Number of scenes that they belong to.
    pub scenes: usize,
    /// In the order of [`crate::verify::rays::RayKind::ALL`].
    pub kinds: Vec<KindFit>,
    /// Times over all ray kinds, with the default weights of `bake`.
    pub overall: Predicted,
}

/// Prices of a ray kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KindFit {
    /// Name of the ray kind.
    pub kind: &'static str,
    /// Prices fitted to all rows.
    pub prices: Prices,
    /// Root mean square of predicted over measured time minus 1, over all rows.
    pub rms_relative_error: f64,
    /// The program's current prices for the class.
    pub table: Prices,
    /// The same error with the program's prices.
    pub table_rms_relative_error: f64,
    /// How well layouts are ranked.
    #[serde(flatten)]
    pub predicted: Predicted,
}

/// How well layouts are ranked; `None` if no scene has two layouts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Predicted {
    /// Each scene predicted by prices fitted to the others.
    pub left_out: Option<Quality>,
    /// Predicted by the program's current prices.
    pub by_table: Option<Quality>,
}

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Too few rows.
    #[error("prices cannot be fitted to {rows} timed layouts: it takes {FEWEST_ROWS} at least")]
    TooFewRows {
        /// The number found.
        rows: usize,
    },
    /// Too few scenes.
    #[error("prices cannot be fitted to timed layouts of {scenes} scenes: it takes 2, so that one can be left out")]
    TooFewScenes {
        /// The number found.
        scenes: usize,
    },
}

/// A layout: for each ray kind, the traversal counts and picoseconds per ray.
#[derive(Clone, Debug, PartialEq)]
struct Sample {
    kinds: PerKind<(Counts, f64)>,
    single: bool,
}

/// Fits prices to the rows in which all ray kinds were timed.
///
/// # Errors
/// Fails if there are too few rows or scenes.
pub(super) fn fit(rows: &[Row], class: Class) -> Result<Fit, FitError> {
    let samples = |rows: Vec<&Row>| -> Vec<Sample> { rows.into_iter().filter_map(sample).collect() };
    let scenes: Vec<Vec<Sample>> = by_scene(rows).into_iter().map(samples).filter(|s| !s.is_empty()).collect();
    let all: Vec<&Sample> = scenes.iter().flatten().collect();
    if all.len() < FEWEST_ROWS {
        return Err(FitError::TooFewRows { rows: all.len() });
    }
    if scenes.len() < 2 {
        return Err(FitError::TooFewScenes { scenes: scenes.len() });
    }
    let fitted: Vec<PerKind<Prices>> = (0..scenes.len()).map(|out| prices_without(&scenes, out)).collect();
    let table = class.prices();
    let predicted = |weights: &Weights| Predicted {
        left_out: quality(&times(&scenes, weights, |scene| &fitted[scene])),
        by_table: quality(&times(&scenes, weights, |_| &table)),
    };
    let kind = |kind| kind_fit(&all, kind, table[kind], predicted(&Weights::only(kind)));
    Ok(Fit {
        schema: SCHEMA,
        raykiln_version: env!("CARGO_PKG_VERSION"),
        class: class.name(),
        device: rows[0].device.clone(),
        device_kind: rows[0].device_kind,
        layouts: all.len(),
        scenes: scenes.len(),
        kinds: RayKind::ALL.map(kind).to_vec(),
        overall: predicted(&Weights::default()),
    })
}

/// Prices for all ray kinds, fitted to all scenes except one.
fn prices_without(scenes: &[Vec<Sample>], out: usize) -> PerKind<Prices> {
    let others: Vec<&Sample> = scenes[..out].iter().chain(&scenes[out + 1..]).flatten().collect();
    PerKind::of(|kind| prices(&others, kind))
}

fn kind_fit(samples: &[&Sample], kind: RayKind, table: Prices, predicted: Predicted) -> KindFit {
    let prices = prices(samples, kind);
    KindFit {
        kind: kind.name(),
        prices,
        rms_relative_error: rms_relative_error(samples, kind, &prices),
        table,
        table_rms_relative_error: rms_relative_error(samples, kind, &table),
        predicted,
    }
}

/// Converts a row; `None` unless all ray kinds were timed.
fn sample(row: &Row) -> Option<Sample> {
    let timed = |of: &KindRow| Some((of.counts(), of.picoseconds.filter(|t| *t > 0.0)?));
    let kinds = PerKind::try_of(|kind| timed(&row.kinds[kind]).ok_or(())).ok()?;
    Some(Sample { kinds, single: row.is("single") })
}

/// The prices with the least squared relative error.
fn prices(samples: &[&Sample], kind: RayKind) -> Prices {
    let relative = |sample: &&Sample| {
        let (met, measured) = sample.kinds[kind];
        [1.0, met.top, met.entries, met.bottom].map(|count| count / measured)
    };
    let rows: Vec<[f64; 4]> = samples.iter().map(relative).collect();
    let [ray, top, entry, bottom] = nnls::solve(&rows, &vec![1.0; rows.len()]);
    Prices { ray, top, entry, bottom }
}

fn rms_relative_error(samples: &[&Sample], kind: RayKind, prices: &Prices) -> f64 {
    let squared = |s: &&Sample| (prices.of(&s.kinds[kind].0) / s.kinds[kind].1 - 1.0).powi(2);
    (samples.iter().map(squared).sum::<f64>() / samples.len() as f64).sqrt()
}

/// Measured and predicted times, weighted over ray kinds, of the scenes that have a single BLAS.
fn times<'p>(scenes: &[Vec<Sample>], weights: &Weights, prices: impl Fn(usize) -> &'p PerKind<Prices>) -> Vec<Times> {
    let of_scene = |(scene, samples): (usize, &Vec<Sample>)| {
        let prices = prices(scene);
        let predicted = |s: &Sample| weights.mean(&PerKind::of(|kind| prices[kind].of(&s.kinds[kind].0)));
        Some(Times {
            single: samples.iter().position(|s| s.single)?,
            measured: samples.iter().map(|s| weights.mean(&s.kinds.map(|k| k.1))).collect(),
            predicted: samples.iter().map(predicted).collect(),
        })
    };
    scenes.iter().enumerate().filter_map(of_scene).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choose::model::RayCost;

    /// Pseudo-random numbers from 0 to 1.
    fn noise(i: usize) -> f64 {
        (i as f64 * 0.754_877_666).fract()
    }

    /// Layouts of scenes, single BLASes first; their rays take the time given by the prices, times `error`.
    fn planted(prices: &Prices, scenes: usize, layouts: usize, error: impl Fn(usize) -> f64) -> Vec<Row> {
        let row = |i: usize| {
            let single = i.is_multiple_of(layouts);
            let counts = Counts {
                top: if single { 0.0 } else { 40.0 * noise(3 * i) },
                entries: if single { 1.0 } else { 1.0 + 12.0 * noise(3 * i + 1) },
                bottom: 20.0 + 60.0 * noise(3 * i + 2),
            };
            let kind = KindRow {
                picoseconds: Some(prices.of(&counts) * error(i)),
                ..KindRow::of(RayCost { counts, ..RayCost::default() })
            };
            Row {
                scene: format!("scene {}", i / layouts),
                layout: if single { "single".into() } else { format!("layout {i}") },
                kinds: PerKind::of(|_| kind),
                ..Row::default()
            }
        };
        (0..scenes * layouts).map(row).collect()
    }

    const PLANTED: Prices = Prices { ray: 50.0, top: 5.8, entry: 23.7, bottom: 5.4 };

    fn close(found: &Prices, expected: &Prices, within: f64) -> bool {
        let each = |p: &Prices| [p.ray, p.top, p.entry, p.bottom];
        each(found).iter().zip(each(expected)).all(|(a, b)| (a - b).abs() <= within)
    }

    #[test]
    fn planted_prices_are_found_and_predict_perfectly() {
        let found = fit(&planted(&PLANTED, 4, 6, |_| 1.0), Class::NoRtCores).expect("enough rows");
        assert_eq!((found.layouts, found.scenes, found.kinds.len()), (24, 4, 4));
        for kind in &found.kinds {
            assert!(close(&kind.prices, &PLANTED, 1e-6), "{:?}", kind.prices);
            assert!(kind.rms_relative_error < 1e-9);
            let quality = kind.predicted.left_out.expect("scenes with layouts");
            assert!(quality.rms_ratio_error < 1e-9 && quality.picked_worst_ratio == 1.0, "{quality:?}");
            assert!(quality.correlation.is_some_and(|c| c > 1.0 - 1e-9));
        }
        for (kind, table) in found.kinds.iter().zip(Class::NoRtCores.prices().values()) {
            assert_eq!(kind.table, *table);
            assert!(kind.table_rms_relative_error > 1e-3);
        }
    }

    #[test]
    fn a_zero_price_stays_zero() {
        for zero in 0..4 {
            let mut prices = PLANTED;
            *[&mut prices.ray, &mut prices.top, &mut prices.entry, &mut prices.bottom][zero] = 0.0;
            let found = fit(&planted(&prices, 3, 5, |_| 1.0), Class::NoRtCores).expect("enough rows");
            let p = found.kinds[0].prices;
            assert_eq!([p.ray, p.top, p.entry, p.bottom][zero], 0.0, "{p:?}");
            assert!(close(&p, &prices, 1e-6), "{p:?}");
        }
    }

    #[test]
    fn noise_blurs_prices_no_more_than_it_must() {
        let rows = planted(&PLANTED, 8, 10, |i| 0.95 + 0.1 * noise(7 * i + 5));
        let kind = fit(&rows, Class::NoRtCores).expect("enough rows").kinds[0].clone();
        assert!(close(&kind.prices, &PLANTED, 8.0), "{:?}", kind.prices);
        assert!((0.01..0.05).contains(&kind.rms_relative_error), "{}", kind.rms_relative_error);
        let left_out = kind.predicted.left_out.expect("scenes").rms_ratio_error;
        assert!((0.01..0.1).contains(&left_out), "{left_out}");
    }

    #[test]
    fn counts_that_go_together_do_not_blow_up() {
        let mut rows = planted(&PLANTED, 3, 4, |_| 1.0);
        for row in &mut rows {
            for (_, kind) in row.kinds.iter_mut() {
                (kind.entries, kind.blas_nodes) = (2.0 * kind.tlas_nodes, 0.0);
                kind.picoseconds = Some(10.0 + 5.0 * kind.tlas_nodes);
            }
        }
        let found = fit(&rows, Class::NoRtCores).expect("enough rows").kinds[0].clone();
        let p = found.prices;
        assert!((p.ray - 10.0).abs() < 1e-6 && (p.top + 2.0 * p.entry - 5.0).abs() < 1e-6, "{p:?}");
        assert_eq!(p.bottom, 0.0);
        assert!(found.rms_relative_error < 1e-9);
    }

    #[test]
    fn too_few_rows_or_scenes_are_an_error_in_words() {
        let error = |rows: &[Row]| fit(rows, Class::NoRtCores).expect_err("too few").to_string();
        assert!(error(&planted(&PLANTED, 1, 7, |_| 1.0)).contains("to 7 timed layouts: it takes 8"));
        assert!(error(&planted(&PLANTED, 1, 20, |_| 1.0)).contains("layouts of 1 scenes: it takes 2"));
        assert!(error(&[]).contains("to 0 timed layouts"));
    }

    #[test]
    fn rows_that_were_not_timed_do_not_count() {
        let mut rows = planted(&PLANTED, 4, 6, |_| 1.0);
        rows[7].kinds[RayKind::Random].picoseconds = None;
        rows[8].kinds[RayKind::Primary].picoseconds = Some(0.0);
        let found = fit(&rows, Class::NoRtCores).expect("enough rows");
        assert_eq!(found.layouts, 22);
        assert!(close(&found.kinds[0].prices, &PLANTED, 1e-6));
    }

    #[test]
    fn scenes_without_a_single_blas_are_fitted_but_not_compared() {
        let mut rows = planted(&PLANTED, 3, 4, |_| 1.0);
        rows[0].layout = "keep".into();
        let found = fit(&rows, Class::NoRtCores).expect("enough rows");
        assert_eq!((found.layouts, found.overall.left_out.expect("two scenes").scenes), (12, 2));
        rows[0].same_as = vec!["single".into()];
        let found = fit(&rows, Class::NoRtCores).expect("enough rows");
        assert_eq!(found.overall.left_out.expect("three scenes").scenes, 3);
    }
}
