//! The chart of the rounds of `overlap`, through which the page's slider steps.

use super::charts::{Chart, FRAME, side_grid};
use super::svg::{Anchor, Axis, Canvas, Scale, significant};
use crate::layout::{Round, Rounds};

const ID: &str = "chart-rounds";
const BOTTOM: f64 = 278.0;

/// What is drawn over the rounds: class, words, and the value.
type Curve = (&'static str, &'static str, fn(&Round) -> Option<f64>);

const CURVES: [Curve; 3] = [
    ("before", "overlap ratio", |round| Some(round.overlap_ratio)),
    ("after", "two-level cost", |round| round.two_level_cost),
    ("neutral", "SAH cost", |round| round.sah_cost),
];

/// How overlap and costs change from round to round; `None` if there was none.
pub(super) fn chart(rounds: &Rounds) -> Option<Chart> {
    (rounds.list.len() > 1).then(|| Chart {
        id: ID,
        title: "Rounds of splitting and merging",
        caption: format!(
            "Each over its value before the first round. {} splits and {} merges led to the state taken.",
            rounds.splits, rounds.merges
        ),
        svg: svg(rounds),
        legend: CURVES.iter().map(|&(class, words, _)| (class, words)).collect(),
        head: vec!["round", "groups", "splits", "merges", "overlap ratio", "SAH cost", "two-level cost", ""],
        rows: rounds.list.iter().enumerate().map(|(at, round)| row(at, round, rounds.taken == Some(at))).collect(),
    })
}

fn row(at: usize, round: &Round, is_taken: bool) -> Vec<String> {
    let cost = |cost: Option<f64>| cost.map_or(String::new(), significant);
    let taken = if is_taken { "taken" } else { "" };
    vec![
        at.to_string(),
        round.meshes.to_string(),
        round.splits.to_string(),
        round.merges.to_string(),
        format!("{:.4}", round.overlap_ratio),
        cost(round.sah_cost),
        cost(round.two_level_cost),
        taken.to_owned(),
    ]
}

fn svg(rounds: &Rounds) -> String {
    let curves = CURVES.map(|(class, _, value)| (class, relative(&rounds.list, value)));
    let values = curves.iter().flat_map(|(_, of)| of.iter().map(|&(_, value)| value)).chain([1.0]);
    let y = Axis::over(Scale::Linear, values, [BOTTOM - 8.0, 16.0]);
    let last = rounds.list.len() - 1;
    let x = |at: usize| FRAME[0] + (FRAME[1] - FRAME[0]) * at as f64 / last as f64;
    let mut canvas = Canvas::new(BOTTOM + 30.0);
    side_grid(&mut canvas, &y);
    for at in [0, last] {
        canvas.text([x(at), BOTTOM + 18.0], "mark", Anchor::Middle, &at.to_string());
    }
    canvas.line([x(0), 10.0], [x(0), BOTTOM], "cursor");
    for (class, of) in curves {
        canvas.path(&of.iter().map(|&(at, value)| [x(at), y.place(value)]).collect::<Vec<_>>(), class);
    }
    canvas.finish(ID)
}

/// Returns the rounds that have a value, with the value over the first; none if that is 0.
fn relative(list: &[Round], value: fn(&Round) -> Option<f64>) -> Vec<(usize, f64)> {
    let first = list.first().and_then(value).filter(|&first| first > 0.0);
    let over = |(at, round): (usize, &Round)| Some((at, value(round)? / first?));
    list.iter().enumerate().filter_map(over).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(meshes: u64, overlap_ratio: f64, two_level_cost: Option<f64>) -> Round {
        Round { meshes, splits: 1, merges: 0, overlap_ratio, sah_cost: None, two_level_cost }
    }

    #[test]
    fn each_round_is_a_row_and_each_known_value_a_point() {
        let list = vec![round(4, 2.0, Some(50.0)), round(6, 1.0, Some(40.0)), round(9, 1.5, None)];
        let chart = chart(&Rounds { taken: Some(1), splits: 1, merges: 0, list }).unwrap();
        assert_eq!(chart.rows.len(), 3);
        assert!(chart.rows.iter().all(|row| row.len() == chart.head.len()));
        assert_eq!(chart.rows[1][7], "taken");
        let points = |class: &str| {
            let line = chart.svg.split("<polyline").find(|l| l.contains(&format!(r#"class="{class}""#))).unwrap();
            line.matches(',').count()
        };
        assert_eq!((points("before"), points("after"), points("neutral")), (3, 2, 0));
    }

    #[test]
    fn no_round_is_no_chart() {
        assert!(chart(&Rounds { taken: None, splits: 0, merges: 0, list: vec![round(1, 0.0, None)] }).is_none());
    }
}
