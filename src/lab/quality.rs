//! Rates how well predicted times rank the layouts of scenes.

use serde::Serialize;

/// Times of the layouts of one scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Times {
    /// Measured picoseconds per ray; greater than 0.
    pub(super) measured: Vec<f64>,
    /// Predicted picoseconds per ray, in the same order.
    pub(super) predicted: Vec<f64>,
    /// Index of the single BLAS.
    pub(super) single: usize,
}

/// How well layouts are predicted, each relative to the single BLAS of its scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quality {
    /// Number of layouts compared, without the single BLASes.
    pub layouts: usize,
    /// Number of scenes with at least two layouts.
    pub scenes: usize,
    /// Correlation of the logarithms of measured and predicted speed ratios, -1 to 1; `None` if either does not vary.
    pub correlation: Option<f64>,
    /// Root mean square of the predicted over the measured ratio minus 1.
    pub rms_ratio_error: f64,
    /// Speed of the layout predicted fastest over that of the layout measured fastest, 0 to 1: mean over the scenes.
    pub picked_mean_ratio: f64,
    /// The same ratio, minimum over the scenes.
    pub picked_worst_ratio: f64,
}

/// Returns `None` if no scene has two layouts.
pub(super) fn quality(scenes: &[Times]) -> Option<Quality> {
    let scenes: Vec<&Times> = scenes.iter().filter(|s| s.measured.len() > 1).collect();
    let speeds = |times: &[f64], single: usize| -> Vec<f64> { times.iter().map(|t| times[single] / t).collect() };
    let mut ratios = Vec::new();
    for scene in &scenes {
        let [measured, predicted] = [&scene.measured, &scene.predicted].map(|times| speeds(times, scene.single));
        ratios.extend((0..measured.len()).filter(|&i| i != scene.single).map(|i| (measured[i], predicted[i])));
    }
    let picked: Vec<f64> = scenes.iter().map(|scene| picked(scene)).collect();
    let mean = |numbers: &mut dyn Iterator<Item = f64>, count: usize| numbers.sum::<f64>() / count as f64;
    (!ratios.is_empty()).then(|| Quality {
        layouts: ratios.len(),
        scenes: scenes.len(),
        correlation: correlation(&ratios.iter().map(|r| (r.0.ln(), r.1.ln())).collect::<Vec<_>>()),
        rms_ratio_error: mean(&mut ratios.iter().map(|r| (r.1 / r.0 - 1.0).powi(2)), ratios.len()).sqrt(),
        picked_mean_ratio: mean(&mut picked.iter().copied(), picked.len()),
        picked_worst_ratio: picked.iter().copied().fold(1.0, f64::min),
    })
}

/// Speed of the layout predicted fastest over that of the layout measured fastest.
fn picked(scene: &Times) -> f64 {
    let least = |times: &[f64]| (0..times.len()).min_by(|&a, &b| times[a].total_cmp(&times[b])).unwrap_or(0);
    scene.measured[least(&scene.measured)] / scene.measured[least(&scene.predicted)]
}

/// Pearson's correlation; `None` if either side does not vary.
fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let (x, y) = (pairs.iter().map(|p| p.0).sum::<f64>() / count, pairs.iter().map(|p| p.1).sum::<f64>() / count);
    let moment = |of: fn(f64, f64) -> f64| pairs.iter().map(|p| of(p.0 - x, p.1 - y)).sum::<f64>();
    let (xx, xy, yy) = (moment(|x, _| x * x), moment(|x, y| x * y), moment(|_, y| y * y));
    let found = xy / (xx * yy).sqrt();
    (pairs.len() > 1 && found.is_finite()).then(|| found.clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_true_prediction_has_no_error_and_picks_the_best() {
        let scene = Times { measured: vec![4.0, 2.0, 8.0], predicted: vec![40.0, 20.0, 80.0], single: 0 };
        let found = quality(&[scene]).expect("two layouts beside the single");
        assert_eq!((found.layouts, found.scenes), (2, 1));
        assert!(found.correlation.is_some_and(|c| c > 1.0 - 1e-12));
        assert_eq!((found.rms_ratio_error, found.picked_mean_ratio, found.picked_worst_ratio), (0.0, 1.0, 1.0));
    }

    #[test]
    fn a_wrong_pick_costs_what_it_is_slower() {
        let right = Times { measured: vec![1.0, 2.0], predicted: vec![1.0, 2.0], single: 0 };
        let wrong = Times { measured: vec![1.0, 2.0], predicted: vec![1.0, 0.5], single: 0 };
        let found = quality(&[right, wrong]).expect("layouts");
        assert_eq!((found.picked_mean_ratio, found.picked_worst_ratio), (0.75, 0.5));
        assert_eq!(found.rms_ratio_error, (0.5f64 * 9.0).sqrt());
    }

    #[test]
    fn nothing_to_compare_has_no_quality() {
        assert_eq!(quality(&[]), None);
        assert_eq!(quality(&[Times { measured: vec![1.0], predicted: vec![1.0], single: 0 }]), None);
        let alike = Times { measured: vec![1.0, 2.0, 3.0], predicted: vec![1.0; 3], single: 0 };
        assert_eq!(quality(&[alike]).expect("layouts").correlation, None);
    }
}
