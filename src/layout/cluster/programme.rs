//! The dynamic programme that cuts a tree into groups.
//!
//! Every node of the tree is, at the least predicted cost, one of three things: a node of the TLAS, above the groups; the
//! root of a group; a node within one. A part of a group may leave it for a frame of its own. Costs are those of
//! [`crate::cost::two_level`], found from the bottom up.

use super::Limits;
use super::facts::{Facts, Own};
use super::soup::Turned;
use crate::cost::sah::TRAVERSAL;
use crate::cost::tree::Tree;

/// A group: items of the tree, and the frame they are stored in.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// In tree order.
    pub(super) items: Vec<u32>,
    pub(super) frame: Turned,
}

/// A tree and what is known of its nodes.
pub(super) struct Known<'a> {
    pub(super) tree: &'a Tree,
    pub(super) facts: &'a [Facts],
    /// For every node a frame of its own, where one fits better.
    pub(super) own: &'a [Option<Own>],
    /// The frame of the tree.
    pub(super) base: Turned,
}

/// Costs of a node in squared units, and what is done for them.
#[derive(Clone, Copy, Debug)]
struct Decision {
    /// Within a group.
    inside: f64,
    /// Above groups or at the root of one.
    outside: f64,
    /// Whether it leaves the group that it is in.
    leaves: bool,
    at_top: AtTop,
}

/// What a node is that is not within a group.
#[derive(Clone, Copy, Debug, PartialEq)]
enum AtTop {
    /// The root of a group in the frame of the tree.
    Group,
    /// The root of a group in a frame of its own.
    Turned,
    /// A node of the TLAS.
    Divided,
}

/// Cuts a tree into the groups of least cost; gives them and the cost.
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
        let own = known.own[at].filter(|_| allowed && fact.triangles >= limits.min_turned);
        let leaves = own.map_or(f64::INFINITY, |own| limits.leaving_cost() * own.loose + own.inside);
        // A leaf cannot be divided, and is a group whatever its size.
        let group = if allowed || children.is_none() { limits.entry_cost * fact.loose + stays } else { f64::INFINITY };
        let divided = children.map_or(f64::INFINITY, |[a, b]| TRAVERSAL * fact.world_area + a.outside + b.outside);
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

/// The groups that the decisions come to: each group in the frame of the tree is followed by those that leave it.
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

/// All items below a node, in its own frame.
fn turned(known: &Known, node: u32) -> Option<Group> {
    let items = known.tree.order[known.tree.items_below(node)].to_vec();
    known.own[node as usize].map(|own| Group { items, frame: own.frame })
}
