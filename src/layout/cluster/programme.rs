//! The dynamic programme that cuts a tree into groups.
//!
//! Every node of the tree is, at the least predicted cost, one of three things: a node of the TLAS, above the groups; the
//! root of a group; a node within one. A part of a group may leave it for a frame of its own. Costs are those of
//! [`crate::cost::two_level`], found from the bottom up.

use rayon::prelude::*;

use super::Limits;
use super::refit::{Fitted, Refit};
use super::soup::{Soup, Turned};
use crate::cost::sah::{INTERSECTION, TRAVERSAL};
use crate::cost::tree::Tree;
use crate::layout::frames::{self, Search};
use crate::scene::Bounds;

/// Larger parts do not get a frame of their own: trying frames takes time for every level of the tree.
const MOST_TURNED: u32 = 1 << 16;

/// A frame of its own must fit a part this much better than the frame it is in to be worth a thought.
const LOOSE_RATIO: f64 = 1.25;

/// A group: parts of the tree, and the frame they are stored in.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Items, in tree order.
    pub(super) items: Vec<u32>,
    pub(super) frame: Turned,
}

/// What is known of a node.
#[derive(Clone, Copy, Debug)]
struct Facts {
    triangles: u32,
    /// Its box in the frame of the tree.
    bounds: Bounds,
    /// Its box in the world.
    world: Bounds,
    /// Sum over its triangles of the surface area of their boxes, over that of the tightest boxes there are.
    looseness: [f64; 2],
    /// Its cost within a group that it does not leave.
    inside: f64,
}

/// What a node may leave for.
#[derive(Clone, Copy, Debug)]
struct Own {
    frame: Turned,
    /// The cost of the part in that frame.
    inside: f64,
    /// Area of the world box of its box.
    loose: f64,
}

/// Costs of a node in squared units, and what is done for them.
#[derive(Clone, Copy, Debug, Default)]
struct Decision {
    /// Within a group.
    inside: f64,
    leaves: bool,
    /// Above or at the root of a group.
    outside: f64,
    is_group: bool,
}

/// Cuts a tree, whose boxes are those of `base`, into the groups of least cost; gives them and the cost.
pub(super) fn cut(soup: &Soup, tree: &Tree, base: Turned, limits: &Limits) -> (Vec<Group>, f64) {
    if tree.nodes.is_empty() {
        return (Vec::new(), 0.0);
    }
    let facts = facts(soup, tree, base);
    let own = own_frames(soup, tree, &facts, limits);
    let decisions = decide(tree, &facts, &own, base, limits);
    (groups(tree, &decisions, &own, base), decisions[0].outside)
}

fn facts(soup: &Soup, tree: &Tree, base: Turned) -> Vec<Facts> {
    let of_triangle = |t: u32| {
        let [a, b, c] = soup.corners(t);
        let bounds = soup.bounds_in(&base, t);
        let world = if base == Turned::NOT { bounds } else { soup.bounds_in(&Turned::NOT, t) };
        // The tightest box of a triangle is a rectangle of twice its area, with two sides.
        Facts {
            triangles: 1,
            bounds,
            world,
            looseness: [bounds.area(), 2.0 * (b - a).cross(c - a).length()],
            inside: 0.0,
        }
    };
    let empty = Facts { triangles: 0, bounds: Bounds::EMPTY, world: Bounds::EMPTY, looseness: [0.0; 2], inside: 0.0 };
    let leaf = |items: &[u32]| {
        let all = items.iter().map(|&t| of_triangle(t)).fold(empty, |a, b| a.with(&b));
        Facts { inside: INTERSECTION * f64::from(all.triangles) * all.bounds.area(), ..all }
    };
    let join = |a: &Facts, b: &Facts| {
        let all = a.with(b);
        Facts { inside: TRAVERSAL * all.bounds.area() + a.inside + b.inside, ..all }
    };
    tree.refit(leaf, join)
}

impl Facts {
    fn with(&self, other: &Facts) -> Facts {
        Facts {
            triangles: self.triangles + other.triangles,
            bounds: self.bounds.union(&other.bounds),
            world: self.world.union(&other.world),
            looseness: [0, 1].map(|i| self.looseness[i] + other.looseness[i]),
            inside: 0.0,
        }
    }
}

/// For every node the best frame of its own, where one promises anything.
fn own_frames(soup: &Soup, tree: &Tree, facts: &[Facts], limits: &Limits) -> Vec<Option<Own>> {
    if !limits.frames {
        return vec![None; tree.nodes.len()];
    }
    let sizes = limits.min_turned.max(2)..=MOST_TURNED.min(limits.max_triangles);
    let is_allowed = |f: &Facts| sizes.contains(&f.triangles) && limits.allow(f.triangles, &f.world);
    // A world box of a turned box is never smaller than that of the triangles themselves.
    let pays_entry = |f: &Facts| f.inside > limits.leaving_cost() * f.world.area();
    let promises = |f: &Facts| is_allowed(f) && pays_entry(f) && f.looseness[0] > LOOSE_RATIO * f.looseness[1];
    let try_node = |refit: &mut Refit, node: usize| {
        promises(&facts[node]).then(|| own_frame(soup, tree, node as u32, refit)).flatten()
    };
    (0..tree.nodes.len()).into_par_iter().with_max_len(64).map_init(Refit::default, try_node).collect()
}

fn own_frame(soup: &Soup, tree: &Tree, node: u32, refit: &mut Refit) -> Option<Own> {
    let items = items_below(tree, node);
    let rotations = frames::rotations(tree.order[items].iter().map(|&t| soup.corners(t)), Search::GROUP);
    let tried = rotations.into_iter().map(|rotation| {
        let frame = Turned::by(rotation);
        let Fitted { bounds, cost } = refit.part(tree, node, |t| soup.bounds_in(&frame, t));
        Own { frame, inside: cost, loose: frame.out(&bounds).area() }
    });
    tried.reduce(|a, b| if b.inside < a.inside { b } else { a })
}

/// The items below a node, as a range of the tree's order.
fn items_below(tree: &Tree, node: u32) -> std::ops::Range<usize> {
    let (mut first, mut last) = (node as usize, node as usize);
    while !tree.nodes[first].is_leaf() {
        first = tree.nodes[first].first as usize;
    }
    while !tree.nodes[last].is_leaf() {
        last = tree.nodes[last].first as usize + 1;
    }
    tree.nodes[first].items().start..tree.nodes[last].items().end
}

fn decide(tree: &Tree, facts: &[Facts], own: &[Option<Own>], base: Turned, limits: &Limits) -> Vec<Decision> {
    let mut decisions = vec![Decision::default(); tree.nodes.len()];
    for (at, node) in tree.nodes.iter().enumerate().rev() {
        let fact = &facts[at];
        let children = (!node.is_leaf()).then(|| [decisions[node.first as usize], decisions[node.first as usize + 1]]);
        let area = fact.bounds.area();
        let stays = match children {
            None => INTERSECTION * f64::from(node.count) * area,
            Some([a, b]) => TRAVERSAL * area + a.inside + b.inside,
        };
        let leaves = own[at].map_or(f64::INFINITY, |own| limits.leaving_cost() * own.loose + own.inside);
        let inside = stays.min(leaves);
        // The root's own frame is the base, so that it is a group of its own only where it does not leave.
        let group = limits.entry_cost * base.out(&fact.bounds).area() + stays;
        let divided = children.map_or(f64::INFINITY, |[a, b]| TRAVERSAL * fact.world.area() + a.outside + b.outside);
        let is_group = divided.is_infinite() || (limits.allow(fact.triangles, &fact.world) && group <= divided);
        let outside = if is_group { group } else { divided }.min(leaves);
        decisions[at] = Decision { inside, leaves: leaves < stays, outside, is_group: is_group && outside == group };
        decisions[at].leaves |= outside == leaves && leaves.is_finite();
    }
    decisions
}

/// The groups that the decisions come to: the base group of every cut, each followed by those that leave it.
fn groups(tree: &Tree, decisions: &[Decision], own: &[Option<Own>], base: Turned) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut roots = vec![0u32];
    while let Some(root) = roots.pop() {
        let decision = &decisions[root as usize];
        let node = &tree.nodes[root as usize];
        if let Some(own) = own[root as usize].filter(|_| decision.leaves && !decision.is_group) {
            groups.push(Group { items: tree.order[items_below(tree, root)].to_vec(), frame: own.frame });
        } else if decision.is_group {
            base_group(tree, decisions, own, base, root, &mut groups);
        } else {
            roots.extend([node.first + 1, node.first]);
        }
    }
    groups
}

/// Adds a group of what stays below its root, and the groups that leave it.
fn base_group(
    tree: &Tree,
    decisions: &[Decision],
    own: &[Option<Own>],
    base: Turned,
    root: u32,
    groups: &mut Vec<Group>,
) {
    let mut stays = Vec::new();
    let mut leaving = Vec::new();
    let mut nodes = vec![root];
    while let Some(at) = nodes.pop() {
        let node = &tree.nodes[at as usize];
        if let Some(own) = own[at as usize].filter(|_| at != root && decisions[at as usize].leaves) {
            leaving.push(Group { items: tree.order[items_below(tree, at)].to_vec(), frame: own.frame });
        } else if node.is_leaf() {
            stays.extend_from_slice(&tree.order[node.items()]);
        } else {
            nodes.extend([node.first + 1, node.first]);
        }
    }
    if !stays.is_empty() {
        groups.push(Group { items: stays, frame: base });
    }
    groups.extend(leaving);
}
