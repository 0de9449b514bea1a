//! What is known of the nodes of a tree before any decision.

use rayon::prelude::*;

use super::TLAS_NODES;
use super::refit::Refit;
use super::soup::{Soup, Turned, tightest};
use crate::cost::sah::{INTERSECTION, TRAVERSAL};
use crate::methods::frames::{self, Search};
use crate::methods::pieces::longest_axis;
use crate::scene::Bounds;
use crate::tree::Tree;

/// Larger parts do not get their own frame, because trying frames takes time at each level of the tree.
const MOST_TURNED: u32 = 1 << 16;

/// Smaller parts do not get their own frame.
const FEWEST_TURNED: u32 = 8;

/// Another frame is tried only if the boxes of a part's triangles are this many times as large as the tightest ones.
const LOOSE: f64 = 1.25;

/// Smallest share of the cost of entering a part that is left after it was divided along its length.
const WORTH_DIVIDING: f64 = 0.25;

/// Number of triangles sampled to decide whether a frame fits.
const SAMPLE: usize = 48;

/// A frame fits if the area of the sample's boxes is below this share.
const TIGHTER: f64 = 0.85;

/// Areas and costs of a node in squared units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facts {
    pub(super) triangles: u32,
    /// Surface area of its box in the frame of the tree.
    pub(super) area: f64,
    /// Surface area of the world box of that box, which rays meet if the node is a group.
    pub(super) loose: f64,
    /// Surface area of its box in world space.
    pub(super) world_area: f64,
    /// Longest side of its box in world space.
    pub(super) extent: f64,
    /// The cost of the whole node within a group.
    pub(super) inside: f64,
    /// Surface area of its triangles' boxes divided by that of the tightest possible boxes.
    looseness: f64,
}

/// A part's own frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Own {
    pub(super) frame: Turned,
    /// The cost of the part in that frame.
    pub(super) inside: f64,
    /// Surface area of the world box of its box.
    pub(super) loose: f64,
    /// Its box in that frame.
    pub(super) bounds: Bounds,
}

/// Equal lengths that a part with a frame of its own may be divided into.
pub(super) const LENGTHS: [u32; 6] = [1, 2, 4, 8, 16, 32];

impl Own {
    /// Returns the cost of the part in its frame, divided along its longest side into as many groups as pay: the world
    /// boxes of long parts that lie diagonally are large. Groups have at least `fewest` of its `triangles`.
    pub(super) fn price(&self, leaving_cost: f64, triangles: u32, fewest: u32) -> f64 {
        let (whole, axis) = (self.frame.out(&self.bounds).area(), longest_axis(&self.bounds));
        let loose = |&lengths: &u32| {
            let mut part = self.bounds;
            part.max[axis] = part.min[axis] + part.size()[axis] / f64::from(lengths);
            let share = f64::from(lengths) * self.frame.out(&part).area() / whole;
            if share.is_finite() { share * self.loose } else { self.loose }
        };
        let allowed = LENGTHS.iter().filter(|&&lengths| lengths == 1 || triangles / lengths >= fewest.max(1));
        allowed.map(loose).fold(f64::INFINITY, f64::min) * leaving_cost + self.inside
    }
}

/// For each node of a tree, its own frame; `None` for most nodes.
pub(super) type OwnFrames = Vec<Option<Box<Own>>>;

/// Values summed and joined from the bottom up.
#[derive(Clone, Copy)]
struct Sums {
    triangles: u32,
    bounds: Bounds,
    world: Bounds,
    inside: f64,
    boxes: f64,
    tightest: f64,
}

/// Computes the facts of each node of a tree with boxes in the frame `base`.
pub(super) fn facts(soup: &Soup, tree: &Tree, base: &Turned) -> Vec<Facts> {
    let leaf = |items: &[u32]| {
        let all = items.iter().map(|&t| Sums::of(soup, base, t)).fold(Sums::NOTHING, |a, b| a.with(&b));
        Sums { inside: INTERSECTION * f64::from(all.triangles) * all.bounds.area(), ..all }
    };
    let join = |a: &Sums, b: &Sums| {
        let all = a.with(b);
        Sums { inside: TRAVERSAL * all.bounds.area() + all.inside, ..all }
    };
    tree.refit(leaf, join).iter().map(|sums| sums.facts(base)).collect()
}

impl Sums {
    const NOTHING: Sums =
        Sums { triangles: 0, bounds: Bounds::EMPTY, world: Bounds::EMPTY, inside: 0.0, boxes: 0.0, tightest: 0.0 };

    fn of(soup: &Soup, base: &Turned, triangle: u32) -> Sums {
        let bounds = soup.bounds_in(base, triangle);
        let world = if *base == Turned::NOT { bounds } else { soup.bounds_in(&Turned::NOT, triangle) };
        Sums {
            triangles: 1,
            bounds,
            world,
            inside: 0.0,
            boxes: bounds.area(),
            tightest: tightest(soup.corners(triangle)),
        }
    }

    fn with(&self, other: &Sums) -> Sums {
        Sums {
            triangles: self.triangles + other.triangles,
            bounds: self.bounds.union(&other.bounds),
            world: self.world.union(&other.world),
            inside: self.inside + other.inside,
            boxes: self.boxes + other.boxes,
            tightest: self.tightest + other.tightest,
        }
    }

    fn facts(&self, base: &Turned) -> Facts {
        Facts {
            triangles: self.triangles,
            area: self.bounds.area(),
            loose: if *base == Turned::NOT { self.bounds.area() } else { base.out(&self.bounds).area() },
            world_area: self.world.area(),
            extent: self.world.size().max_element(),
            inside: self.inside,
            looseness: if self.tightest > 0.0 { self.boxes / self.tightest } else { 1.0 },
        }
    }
}

impl Facts {
    /// Whether a separate frame could pay off: the world box of a rotated box is never smaller than that of the
    /// triangles themselves, which gives a lower bound on the entry cost; divided along its length, a diagonal part is
    /// entered for [`WORTH_DIVIDING`] of that at least.
    fn could_be_turned(&self, by: &Turning) -> bool {
        (by.fewest.max(FEWEST_TURNED)..=MOST_TURNED).contains(&self.triangles)
            && self.looseness > LOOSE
            && self.inside > WORTH_DIVIDING * (by.least_entry + TLAS_NODES * TRAVERSAL) * self.world_area
    }
}

/// Which parts may get their own frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turning {
    /// Those with at least this many triangles.
    pub(super) fewest: u32,
    /// Those for which it could pay off at this entry cost.
    pub(super) least_entry: f64,
}

/// Finds the best separate frame for each eligible node, if one fits clearly better than that of the tree. `known`
/// returns the result for a node if it is already known.
pub(super) fn own_frames(
    soup: &Soup,
    tree: &Tree,
    facts: &[Facts],
    base: &Turned,
    by: &Turning,
    known: impl Fn(usize) -> Option<Option<Own>> + Sync,
) -> OwnFrames {
    let is_closed = soup.components.closed_nodes(tree);
    let find = |refit: &mut Refit, node: usize| {
        (is_closed[node] && facts[node].could_be_turned(by))
            .then(|| own_frame(soup, tree, node as u32, base, refit))
            .flatten()
    };
    let try_node = |refit: &mut Refit, node: usize| known(node).unwrap_or_else(|| find(refit, node)).map(Box::new);
    (0..tree.nodes.len()).into_par_iter().with_max_len(64).map_init(Refit::default, try_node).collect()
}

fn own_frame(soup: &Soup, tree: &Tree, node: u32, base: &Turned, refit: &mut Refit) -> Option<Own> {
    let items = &tree.order[tree.items_below(node)];
    let tried = fitting_frames(soup, items, base).map(|frame| {
        let fitted = refit.part(tree, node, |t| soup.bounds_in(&frame, t));
        Own { frame, inside: fitted.cost, loose: frame.out(&fitted.bounds).area(), bounds: fitted.bounds }
    });
    tried.reduce(|a, b| if b.inside < a.inside { b } else { a })
}

/// Returns frames derived from some triangles that make the boxes of a sample of them clearly smaller, which is faster
/// to check than a tree.
pub(super) fn fitting_frames<'a>(soup: &'a Soup, items: &'a [u32], than: &Turned) -> impl Iterator<Item = Turned> + 'a {
    let rotations = frames::rotations(items.iter(), |&t| soup.corners(t), Search::GROUP);
    let sample = || items.iter().step_by(items.len().div_ceil(SAMPLE).max(1));
    let area = move |frame: &Turned| sample().map(|&t| soup.bounds_in(frame, t).area()).sum::<f64>();
    let most = TIGHTER * area(than);
    rotations.into_iter().map(Turned::by).filter(move |frame| area(frame) < most)
}
