//! Units: connected triangles that leave together for a frame of their own.
//!
//! Long thin parts that cross each other, such as hair, cables and railings, cannot be separated spatially: a tree over
//! all triangles mixes them. So connected components of the surface may leave before that tree is cut.

use rayon::prelude::*;

use super::facts::{Facts, Own, fitting_frames};
use super::refit::Refit;
use super::soup::{Soup, Turned};
use crate::scene::Bounds;
use crate::tree::{Quality, Tree};

/// Smaller units do not leave.
const FEWEST: usize = 8;
/// Larger units do not leave as a whole.
const MOST: usize = 1 << 16;

/// A unit that fits clearly better in its own frame.
#[derive(Clone, Debug)]
pub(super) struct Unit {
    pub(super) items: Vec<u32>,
    pub(super) own: Own,
    /// Its share of the cost of the tree over all triangles.
    pub(super) share: f64,
    /// Its box in world space.
    pub(super) world: Bounds,
}

/// Returns the units that cost more within the tree than in their own frame, ignoring entries.
pub(super) fn units(soup: &Soup, tree: &Tree, facts: &[Facts], base: &Turned) -> Vec<Unit> {
    let shares = shares(soup, tree, facts);
    let unit = |items: Vec<u32>| {
        let share = items.iter().map(|&t| shares[t as usize]).sum();
        let (items, own) = own_frame(soup, items, base).filter(|(_, own)| own.inside < share)?;
        let world = items.iter().fold(Bounds::EMPTY, |all, &t| all.union(&soup.bounds_in(&Turned::NOT, t)));
        Some(Unit { items, own, share, world })
    };
    let components = soup.components.free().into_par_iter();
    components.filter(|items| (FEWEST..=MOST).contains(&items.len())).filter_map(unit).collect()
}

impl Unit {
    /// Returns the longest side of its box in world space.
    pub(super) fn extent(&self) -> f64 {
        self.world.size().max_element()
    }
}

/// Returns each triangle's share of the cost of a tree: an equal part of each node above it.
pub(super) fn shares(soup: &Soup, tree: &Tree, facts: &[Facts]) -> Vec<f64> {
    let mut above = vec![0.0; tree.nodes.len()];
    let mut shares = vec![0.0; soup.len()];
    for (at, node) in tree.nodes.iter().enumerate() {
        let inner = if node.is_leaf() {
            0.0
        } else {
            facts[node.first as usize].inside + facts[node.first as usize + 1].inside
        };
        let own = above[at] + (facts[at].inside - inner) / f64::from(facts[at].triangles.max(1));
        if node.is_leaf() {
            tree.order[node.items()].iter().for_each(|&t| shares[t as usize] = own);
        } else {
            (above[node.first as usize], above[node.first as usize + 1]) = (own, own);
        }
    }
    shares
}

/// Returns the items of a unit in tree order, and the best frame for it with its cost there, computed with a separate
/// tree.
fn own_frame(soup: &Soup, items: Vec<u32>, base: &Turned) -> Option<(Vec<u32>, Own)> {
    let frames: Vec<Turned> = fitting_frames(soup, &items, base).collect();
    let tried = frames.into_iter().map(|frame| {
        let boxes: Vec<Bounds> = items.iter().map(|&t| soup.bounds_in(&frame, t)).collect();
        let mut tree = Tree::build(&boxes, Quality::Fast);
        let fitted = Refit::default().part(&tree, 0, |i| boxes[i as usize]);
        tree.order.iter_mut().for_each(|i| *i = items[*i as usize]);
        (tree.order, Own { frame, inside: fitted.cost, loose: frame.out(&fitted.bounds).area(), bounds: fitted.bounds })
    });
    tried.reduce(|a, b| if b.1.inside < a.1.inside { b } else { a })
}
