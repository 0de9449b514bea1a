//! The rounds of a method that changes a scene step by step.

use serde::Serialize;

/// What the rounds of `overlap` made of a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rounds {
    /// Index into `list` of the state that became the layout; `None`: the input stayed as it is.
    pub taken: Option<usize>,
    /// Objects divided in two on the way to that state.
    pub splits: u64,
    /// Times that objects became one on the way to that state.
    pub merges: u64,
    /// The state before any round, then after each.
    pub list: Vec<Round>,
}

/// The state of a scene after a round.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Round {
    /// Mesh groups that take part: all but instances that stay as they are.
    pub meshes: u64,
    /// Objects that the round divided in two.
    pub splits: u64,
    /// Times that objects became one in the round.
    pub merges: u64,
    /// Sum of the surface areas of the pairwise intersections of boxes, over that of the box of the scene (of its core,
    /// where the rule sets objects apart).
    pub overlap_ratio: f64,
    /// Expected cost of a random line through the scene's box with free entries into groups; `None`: not computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sah_cost: Option<f64>,
    /// The same with the cost of entering each group.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub two_level_cost: Option<f64>,
}

impl Rounds {
    /// Sums splits and merges up to the state taken; up to the last one if none was.
    pub(crate) fn new(list: Vec<Round>, taken: Option<usize>) -> Rounds {
        let until = taken.map_or(list.len(), |taken| taken + 1);
        let sum = |of: fn(&Round) -> u64| list[..until].iter().map(of).sum();
        Rounds { taken, splits: sum(|round| round.splits), merges: sum(|round| round.merges), list }
    }
}
