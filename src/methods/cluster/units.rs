//! Units: connected triangles that leave together for a frame of their own.
//!
//! Long thin parts that cross each other, such as hair, cables and railings, cannot be separated spatially: a tree over
//! all triangles mixes them. So connected components and objects may leave before that tree is cut.

use glam::Vec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

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
    candidates(soup).into_par_iter().filter_map(unit).collect()
}

impl Unit {
    /// Returns the longest side of its box in world space.
    pub(super) fn extent(&self) -> f64 {
        self.world.size().max_element()
    }
}

/// Returns connected components; objects that are connected count as one.
fn candidates(soup: &Soup) -> Vec<Vec<u32>> {
    let of_object = |object: &[u32]| components(soup, object[0]..object[1]);
    let all: Vec<Vec<Vec<u32>>> = soup.objects.par_windows(2).map(of_object).collect();
    all.into_iter().flatten().filter(|unit| (FEWEST..=MOST).contains(&unit.len())).collect()
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
        (tree.order, Own { frame, inside: fitted.cost, loose: frame.out(&fitted.bounds).area() })
    });
    tried.reduce(|a, b| if b.1.inside < a.1.inside { b } else { a })
}

/// Returns the connected components of some triangles (connected by shared corners), in the order of their first
/// triangles.
fn components(soup: &Soup, triangles: std::ops::Range<u32>) -> Vec<Vec<u32>> {
    let first = triangles.start;
    let mut parents: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut owners: FxHashMap<[u32; 3], u32> = FxHashMap::default();
    for t in 0..triangles.len() as u32 {
        for &corner in soup.stored(first + t) {
            let owner = *owners.entry(key(corner)).or_insert(t);
            let (a, b) = (root(&mut parents, owner), root(&mut parents, t));
            parents[a.max(b) as usize] = a.min(b);
        }
    }
    let mut parts: Vec<Vec<u32>> = Vec::new();
    let mut numbers = vec![0u32; parents.len()];
    for t in 0..parents.len() as u32 {
        let root = root(&mut parents, t);
        if root == t {
            numbers[t as usize] = parts.len() as u32;
            parts.push(Vec::new());
        }
        parts[numbers[root as usize] as usize].push(first + t);
    }
    parts
}

/// Returns the bits of a position, equal for both zeros.
fn key(position: Vec3) -> [u32; 3] {
    (position + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// Returns the smallest member of a set (R. Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", 1975),
/// with path halving.
fn root(parents: &mut [u32], mut at: u32) -> u32 {
    while parents[at as usize] != at {
        parents[at as usize] = parents[parents[at as usize] as usize];
        at = parents[at as usize];
    }
    at
}
