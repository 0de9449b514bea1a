//! Dynamic programming that cuts a tree into groups.
//!
//! At the least predicted cost, each node of the tree is either a node of the TLAS above the groups, the root of a
//! group, or a node within one. A part of a group may leave it for a frame of its own. Costs are those of
//! [`crate::cost::two_level`], computed from the bottom up.

use super::Limits;
use super::facts::{Facts, Own};
use super::soup::Turned;
use crate::cost::sah::TRAVERSAL;
use crate::tree::Tree;

/// A group: items of the tree, and the frame they are stored in.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Items in tree order.
    pub(super) items: Vec<u32>,
    pub(super) frame: Turned,
}

/// A tree and what is known of its nodes.
pub(super) struct Known<'a> {
    pub(super) tree: &'a Tree,
    pub(super) facts: &'a [Facts],
    /// For each node, a frame of its own if one fits better.
    pub(super) own: &'a [Option<Box<Own>>],
    /// The frame of the tree.
    pub(super) base: Turned,
    /// A node is not divided into parts of fewer triangles unless a bound demands it.
    pub(super) fewest: u32,
}

/// Costs of a node in squared units, and the choices that lead to them.
#[derive(Clone, Copy, Debug)]
struct Decision {
    /// Cost within a group.
    inside: f64,
    /// Cost above groups or at the root of one.
    outside: f64,
    /// Whether the node leaves the group that contains it.
    leaves: bool,
    at_top: AtTop,
}

/// Cuts a tree that is too large for one group by removing as little as possible: one group stays in the frame of the
/// tree, and parts leave it unchanged. Returns the groups and the cost; `None` if that is impossible.
///
/// The parts to remove are one small part, or are found with a price per triangle (H. Everett, "Generalized Lagrange
/// Multiplier Method", 1963): those worth most minus their entry cost, at the least price that removes enough.
pub(super) fn peel(known: &Known, limits: &Limits) -> Option<(Vec<Group>, f64)> {
    let root = known.facts.first()?;
    let excess = root.triangles.checked_sub(limits.max_triangles)?;
    let costs = |at: usize| limits.leaving_cost() * known.facts[at].loose;
    let (mut low, mut high) = (0.0, limits.leaving_cost() * root.loose * 2.0);
    let mut enough = None;
    for _ in 0..PRICES {
        let price = 0.5 * (low + high);
        let taken = worth_taking(known, limits, price);
        let count: u32 = taken.iter().map(|&at| known.facts[at as usize].triangles).sum();
        if count >= excess {
            (high, enough) = (price, Some(taken));
        } else {
            low = price;
        }
    }
    // Prices find no solution between two that are each best at their price; for a small excess, one small part may
    // suffice.
    let priced = enough.map(|taken| without_surplus(known, taken, excess));
    let area = |taken: &Vec<u32>| taken.iter().map(|&at| known.facts[at as usize].loose).sum::<f64>();
    let choices = priced.into_iter().chain(smallest(known, limits, excess).map(|at| vec![at]));
    let taken = choices.min_by(|a, b| area(a).total_cmp(&area(b)))?;
    let cost = limits.entry_cost * root.loose + root.inside + taken.iter().map(|&at| costs(at as usize)).sum::<f64>();
    Some((peeled(known, &taken), cost))
}

/// Returns the part of least area that suffices by itself and is not too large.
fn smallest(known: &Known, limits: &Limits, excess: u32) -> Option<u32> {
    let fits = |at: &u32| (excess..=limits.max_triangles).contains(&known.facts[*at as usize].triangles);
    let area = |at: u32| known.facts[at as usize].loose;
    (1..known.facts.len() as u32).filter(fits).min_by(|&a, &b| area(a).total_cmp(&area(b)).then(a.cmp(&b)))
}

/// Drops parts that need not be removed after all, those most expensive per triangle first: similar parts become worth
/// their cost at the same price.
fn without_surplus(known: &Known, taken: Vec<u32>, excess: u32) -> Vec<u32> {
    let fact = |at: u32| &known.facts[at as usize];
    let dear = |at: u32| fact(at).loose / f64::from(fact(at).triangles.max(1));
    let mut surplus = taken.iter().map(|&at| fact(at).triangles).sum::<u32>() - excess;
    let mut order = taken.clone();
    order.sort_by(|&a, &b| dear(b).total_cmp(&dear(a)).then(b.cmp(&a)));
    let mut dropped = Vec::new();
    for at in order {
        if fact(at).triangles <= surplus {
            surplus -= fact(at).triangles;
            dropped.push(at);
        }
    }
    dropped.sort_unstable();
    taken.into_iter().filter(|at| dropped.binary_search(at).is_err()).collect()
}

/// Number of bisections of the price per triangle.
const PRICES: usize = 40;

/// Returns the disjoint parts worth most in total: a price per triangle minus their entry cost.
fn worth_taking(known: &Known, limits: &Limits, price: f64) -> Vec<u32> {
    let mut worth = vec![0.0; known.tree.nodes.len()];
    let mut whole = vec![false; known.tree.nodes.len()];
    for (at, node) in known.tree.nodes.iter().enumerate().rev() {
        let fact = &known.facts[at];
        let parts = if node.is_leaf() { 0.0 } else { worth[node.first as usize] + worth[node.first as usize + 1] };
        let own = price * f64::from(fact.triangles) - limits.leaving_cost() * fact.loose;
        whole[at] = at > 0 && fact.triangles <= limits.max_triangles && own > parts;
        worth[at] = if whole[at] { own } else { parts };
    }
    let (mut taken, mut nodes) = (Vec::new(), vec![0u32]);
    while let Some(at) = nodes.pop() {
        let node = &known.tree.nodes[at as usize];
        if whole[at as usize] {
            taken.push(at);
        } else if !node.is_leaf() {
            nodes.extend([node.first + 1, node.first]);
        }
    }
    taken
}

/// Returns the group of what stays, followed by those of the removed parts.
fn peeled(known: &Known, taken: &[u32]) -> Vec<Group> {
    let items = |at: u32| known.tree.order[known.tree.items_below(at)].to_vec();
    let mut stays = known.tree.order.clone();
    for &at in taken.iter().rev() {
        stays.drain(known.tree.items_below(at));
    }
    let whole = Group { items: stays, frame: known.base };
    let parts = taken.iter().map(|&at| Group { items: items(at), frame: known.base });
    std::iter::once(whole).filter(|g| !g.items.is_empty()).chain(parts).collect()
}

/// The role of a node that is not within a group.
#[derive(Clone, Copy, Debug, PartialEq)]
enum AtTop {
    /// The root of a group in the frame of the tree.
    Group,
    /// The root of a group in a frame of its own.
    Turned,
    /// A node of the TLAS.
    Divided,
}

/// Cuts a tree into the groups of least cost; returns them and the cost.
pub(super) fn cut(known: &Known, limits: &Limits) -> (Vec<Group>, f64) {
    let decisions = decide(known, limits);
    let cost = decisions.first().map_or(0.0, |root| root.outside);
    (groups(known, &decisions), cost)
}

fn decide(known: &Known, limits: &Limits) -> Vec<Decision> {
    let nothing = Decision { inside: 0.0, outside: 0.0, leaves: false, at_top: AtTop::Divided };
    let mut decisions = vec![nothing; known.tree.nodes.len()];
    for (at, node) in known.tree.nodes.iter().enumerate().rev() {
        let fact = &known.facts[at];
        let children = (!node.is_leaf()).then(|| [decisions[node.first as usize], decisions[node.first as usize + 1]]);
        let stays = children.map_or(fact.inside, |[a, b]| TRAVERSAL * fact.area + a.inside + b.inside);
        let allowed = limits.allow(fact.triangles, fact.extent);
        let own = known.own[at].as_deref().filter(|_| allowed && fact.triangles >= limits.min_turned);
        let price = |own: &Own| own.price(limits.leaving_cost(), fact.triangles, limits.fewest_per_length());
        let leaves = own.map_or(f64::INFINITY, price);
        // A leaf cannot be divided, so it may be a group whatever its size.
        let group = if allowed || children.is_none() { limits.entry_cost * fact.loose + stays } else { f64::INFINITY };
        let is_large = |child: u32| known.facts[child as usize].triangles >= known.fewest;
        let are_large = !node.is_leaf() && [node.first, node.first + 1].into_iter().all(is_large);
        let may_divide = !allowed || (limits.divide && are_large);
        let divided = children
            .filter(|_| may_divide)
            .map_or(f64::INFINITY, |[a, b]| TRAVERSAL * fact.world_area + a.outside + b.outside);
        let outside = leaves.min(group).min(divided);
        let at_top = match outside {
            cost if cost == group => AtTop::Group,
            cost if cost == divided => AtTop::Divided,
            _ => AtTop::Turned,
        };
        decisions[at] = Decision { inside: stays.min(leaves), outside, leaves: leaves < stays, at_top };
    }
    decisions
}

/// Returns the groups that the decisions lead to; each group in the frame of the tree is followed by those that leave
/// it.
fn groups(known: &Known, decisions: &[Decision]) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut roots: Vec<u32> = decisions.first().map(|_| 0).into_iter().collect();
    while let Some(root) = roots.pop() {
        match decisions[root as usize].at_top {
            AtTop::Group => push_with_leavers(known, decisions, root, &mut groups),
            AtTop::Turned => groups.extend(turned(known, root)),
            AtTop::Divided => {
                let first = known.tree.nodes[root as usize].first;
                roots.extend([first + 1, first]);
            }
        }
    }
    groups
}

/// Adds the group of what stays below its root, and the groups that leave it.
fn push_with_leavers(known: &Known, decisions: &[Decision], root: u32, groups: &mut Vec<Group>) {
    let mut stays = Vec::new();
    let mut leavers = Vec::new();
    let mut nodes = vec![root];
    while let Some(at) = nodes.pop() {
        let node = &known.tree.nodes[at as usize];
        if at != root && decisions[at as usize].leaves {
            leavers.extend(turned(known, at));
        } else if node.is_leaf() {
            stays.extend_from_slice(&known.tree.order[node.items()]);
        } else {
            nodes.extend([node.first + 1, node.first]);
        }
    }
    if !stays.is_empty() {
        groups.push(Group { items: stays, frame: known.base });
    }
    groups.extend(leavers);
}

/// Returns all items below a node, in its own frame.
fn turned(known: &Known, node: u32) -> Option<Group> {
    let items = known.tree.order[known.tree.items_below(node)].to_vec();
    known.own[node as usize].as_deref().map(|own| Group { items, frame: own.frame })
}
