//! The input shared by all cuts of the same triangles.

use std::cell::{OnceCell, RefCell};
use std::rc::Rc;
use std::sync::Arc;

use rustc_hash::FxHashSet;

use super::dynamic_programming::{self, Group, Known};
use super::facts::{self, Facts, OwnFrames, Turning};
use super::met::MetAreas;
use super::refit::Refit;
use super::search;
use super::soup::{Soup, Turned};
use super::units::{self, Unit};
use super::{Limits, WORTH_TURNING};
use crate::cost::segments::Segment;
use crate::layout::PlacedTrees;
use crate::layout::builder::Object;
use crate::methods::frames::{self, Search};
use crate::parallel;
use crate::scene::{Bounds, Scene};
use crate::tree::{Quality, Tree};

/// Triangles, their tree in the frame that fits all of them best, and better frames for parts of it.
pub(super) struct ClusterInput {
    pub(super) soup: Soup,
    base: Turned,
    tree: Tree,
    /// The tree along the world axes, if `base` is another frame.
    along: Option<Tree>,
    facts: Vec<Facts>,
    /// Whether parts may get their own frames.
    turns: bool,
    turning: Turning,
    /// Computed on first use.
    parts: OnceCell<Parts>,
    /// For the rays used last.
    rays: RefCell<Option<ByRays>>,
}

/// The facts and parts of the tree measured by rays.
#[derive(Clone)]
struct ByRays {
    segments: Arc<[Segment]>,
    facts: Rc<[Facts]>,
    parts: Option<Rc<Parts>>,
}

/// The parts that may leave.
struct Parts {
    own: OwnFrames,
    units: Vec<Unit>,
    /// `None` if there is only one component.
    by_components: Option<ByComponents>,
}

/// A tree in which every component has a node of its own, so that neighbours can get a common frame.
struct ByComponents {
    tree: Rc<Tree>,
    facts: Vec<Facts>,
    own: OwnFrames,
}

/// Number of triangles sampled to decide whether a frame may fit all.
const SAMPLE: usize = 1 << 14;

impl ClusterInput {
    /// Collects the triangles of some objects. `outside`: as in [`Soup::new`]; `None` if frames are not searched for.
    /// Returns `None` if the box of a triangle is too large for a tree.
    pub(super) fn new(
        scene: &Scene,
        objects: &[Object],
        outside: Option<&FxHashSet<u64>>,
        turning: Turning,
    ) -> Option<ClusterInput> {
        let (soup, turns) = (Soup::new(scene, objects, outside), outside.is_some());
        let tree_in =
            |frame: &Turned| Tree::build_from(soup.len(), Quality::Medium, &|triangle| soup.bounds_in(frame, triangle));
        let tree = tree_in(&Turned::NOT);
        if tree.order.len() < soup.len() || tree.nodes.is_empty() {
            return None;
        }
        let base = if turns { best_frame(&soup, &tree) } else { Turned::NOT };
        let (tree, along) = if base == Turned::NOT { (tree, None) } else { (tree_in(&base), Some(tree)) };
        let facts = facts::facts(&soup, &tree, &base);
        Some(ClusterInput {
            soup,
            base,
            tree,
            along,
            facts,
            turns,
            turning,
            parts: OnceCell::new(),
            rays: RefCell::default(),
        })
    }

    /// Returns the longest side of the box around all triangles.
    pub(super) fn extent(&self) -> f64 {
        self.facts.first().map_or(0.0, |root| root.extent)
    }

    /// Returns its trees, for reuse.
    pub(super) fn into_trees(self) -> PlacedTrees {
        let along = self.along.map(|tree| (Turned::NOT.rotation, tree));
        PlacedTrees::new(self.soup.refs, along.into_iter().chain([(self.base.rotation, self.tree)]).collect())
    }

    /// Returns the parts that may leave; `None` if none may.
    fn parts(&self) -> Option<&Parts> {
        let find = || Parts {
            own: facts::own_frames(&self.soup, &self.tree, &self.facts, &self.base, &self.turning, |_| None),
            units: units::units(&self.soup, &self.tree, &self.facts, &self.base),
            by_components: self.by_components(),
        };
        self.turns.then(|| self.parts.get_or_init(find))
    }

    /// Returns a tree over the components and their triangles.
    fn by_components(&self) -> Option<ByComponents> {
        let components = self.soup.components.all();
        if components.len() < 2 {
            return None;
        }
        let (soup, base) = (&self.soup, &self.base);
        let bounds_of = |t: u32| soup.bounds_in(base, t);
        let part = |items: &Vec<u32>| {
            let mut part = Tree::build_from(items.len(), Quality::Fast, &|i| bounds_of(items[i as usize]));
            part.order.iter_mut().for_each(|i| *i = items[*i as usize]);
            part
        };
        let around = |items: &Vec<u32>| items.iter().fold(Bounds::EMPTY, |all, &t| all.union(&bounds_of(t)));
        let boxes: Vec<Bounds> = parallel::map_each(&components, &around);
        let upper = Tree::build_usable(&boxes, Quality::Instances);
        if upper.order.len() < components.len() {
            return None;
        }
        let tree = Tree::grafted(&upper, &parallel::map_each(&components, &part));
        let facts = facts::facts(&self.soup, &tree, &self.base);
        let own = facts::own_frames(&self.soup, &tree, &facts, &self.base, &self.turning, |_| None);
        Some(ByComponents { tree: Rc::new(tree), facts, own })
    }

    /// Returns the groups of least cost, of the whole tree or of what remains once units have left it. Costs are based
    /// on the boxes that ray `segments` meet, if there are any.
    pub(super) fn cut(&self, limits: &Limits, segments: Option<&Arc<[Segment]>>) -> Vec<Group> {
        let triangles = self.facts.first().map_or(0, |root| root.triangles);
        if limits.whole && limits.allow(triangles, self.extent()) {
            return vec![Group { items: self.tree.order.clone(), frame: self.base }];
        }
        let cut_by_rays = segments.map(|segments| self.cut_by_rays(segments));
        let (facts, parts) = match &cut_by_rays {
            Some(rays) => (&*rays.facts, rays.parts.as_deref()),
            None => (self.facts.as_slice(), self.parts()),
        };
        let none = if parts.is_none() { vec![None; facts.len()] } else { Vec::new() };
        let own = parts.map_or(&none, |parts| &parts.own);
        let known = Known { tree: &self.tree, facts, own, base: self.base, fewest: 0 };
        let (groups, cost) = dynamic_programming::cut(&known, limits);
        let peeled = limits.max_extent.is_infinite().then(|| dynamic_programming::peel(&known, limits)).flatten();
        let segments = segments.map_or(&[][..], |segments| segments);
        let without_units =
            parts.filter(|_| limits.units).and_then(|parts| self.cut_without_units(&parts.units, limits, segments));
        let by_components = parts.and_then(|parts| parts.by_components.as_ref()).map(|by| {
            let known = Known { tree: &by.tree, facts: &by.facts, own: &by.own, base: self.base, fewest: 0 };
            dynamic_programming::cut(&known, limits)
        });
        // Without frames of their own, components are no better groups than parts of the tree.
        let by_components = by_components.filter(|(groups, _)| groups.iter().any(|group| group.frame != self.base));
        let others = [without_units, peeled, by_components];
        let all = others.into_iter().flatten();
        let (groups, _) = all.fold((groups, cost), |best, other| if other.1 < best.1 { other } else { best });
        let groups = match (limits.improve, limits.divide) {
            (true, _) => search::improve(&self.soup, groups, limits),
            (false, true) => search::divide_turned(&self.soup, groups, &self.base, limits),
            (false, false) => groups,
        };
        in_bounds(groups, limits.max_triangles.max(1) as usize)
    }

    /// Returns the facts and parts of the tree measured by rays.
    fn cut_by_rays(&self, segments: &Arc<[Segment]>) -> ByRays {
        let last = self.rays.take().filter(|last| Arc::ptr_eq(&last.segments, segments));
        let found = last.unwrap_or_else(|| {
            let met = MetAreas::new(&self.soup, &self.tree, &self.facts, &self.base, segments);
            let parts = self.parts().map(|parts| {
                let shares = units::shares(&self.soup, &self.tree, met.facts());
                let units = met.units(&parts.units, &shares, &self.soup, segments);
                let by_components = parts.by_components.as_ref().map(|by| {
                    let met = MetAreas::new(&self.soup, &by.tree, &by.facts, &self.base, segments);
                    ByComponents { tree: by.tree.clone(), own: met.own(&by.own), facts: met.into_facts() }
                });
                Rc::new(Parts { own: met.own(&parts.own), units, by_components })
            });
            ByRays { segments: segments.clone(), facts: met.into_facts().into(), parts }
        });
        self.rays.replace(Some(found.clone()));
        found
    }

    /// Returns the groups and their cost if each unit leaves for which that is cheaper; `None` if there is no such
    /// unit.
    fn cut_without_units(&self, units: &[Unit], limits: &Limits, segments: &[Segment]) -> Option<(Vec<Group>, f64)> {
        let price =
            |unit: &Unit| unit.own.price(limits.leaving_cost(), unit.items.len() as u32, limits.fewest_per_length());
        let is_large = |unit: &Unit| unit.items.len() >= limits.min_turned as usize;
        let is_allowed = |unit: &Unit| is_large(unit) && limits.allow(unit.items.len() as u32, unit.extent());
        let leaving: Vec<&Unit> = units.iter().filter(|u| is_allowed(u) && price(u) < u.share).collect();
        let mut stays = vec![true; self.soup.len()];
        leaving.iter().flat_map(|unit| &unit.items).for_each(|&t| stays[t as usize] = false);
        let mut groups: Vec<Group> =
            leaving.iter().map(|unit| Group { items: unit.items.clone(), frame: unit.own.frame }).collect();
        let mut cost: f64 = leaving.iter().map(|unit| price(unit)).sum();
        if groups.is_empty() {
            return None;
        }
        if stays.contains(&true) {
            let (others, of_rest) = self.cut_rest(&stays, limits, segments);
            groups.splice(0..0, others);
            cost += of_rest;
        }
        Some((groups, cost))
    }

    /// Returns the groups of what stays of the tree. Nothing is recomputed for nodes that lost nothing.
    fn cut_rest(&self, stays: &[bool], limits: &Limits, segments: &[Segment]) -> (Vec<Group>, f64) {
        let (tree, known) = self.tree.retaining(|triangle| stays[triangle as usize]);
        let mut facts = facts::facts(&self.soup, &tree, &self.base);
        let own = self.parts().map_or(&[][..], |parts| &parts.own);
        let known = |node: usize| known[node].map(|node| own[node as usize].as_deref().copied());
        let mut own = facts::own_frames(&self.soup, &tree, &facts, &self.base, &self.turning, known);
        if !segments.is_empty() {
            let met = MetAreas::new(&self.soup, &tree, &facts, &self.base, segments);
            own = met.own(&own);
            facts = met.into_facts();
        }
        dynamic_programming::cut(&Known { tree: &tree, facts: &facts, own: &own, base: self.base, fewest: 0 }, limits)
    }
}

/// Limits groups to `most` triangles: groups not divided because they are a leaf of the tree are divided in tree order.
fn in_bounds(groups: Vec<Group>, most: usize) -> Vec<Group> {
    let divided = |group: Group| match group.items.len() <= most {
        true => vec![group],
        false => group.items.chunks(most).map(|items| Group { items: items.to_vec(), frame: group.frame }).collect(),
    };
    groups.into_iter().flat_map(divided).collect()
}

/// Returns the frame in which a refitted tree over all triangles costs least; the world frame unless another is clearly
/// better.
fn best_frame(soup: &Soup, tree: &Tree) -> Turned {
    let mut refit = Refit::default();
    let mut cost = |frame: &Turned| refit.part(tree, 0, |t| soup.bounds_in(frame, t)).cost;
    let rotations = frames::rotations(0..soup.len() as u32, |t| soup.corners(t), Search::SCENE);
    // If the boxes of triangles are not smaller, a tree over them hardly costs less.
    let sample = || (0..soup.len() as u32).step_by(soup.len().div_ceil(SAMPLE).max(1));
    let area = |frame: &Turned| sample().map(|t| soup.bounds_in(frame, t).area()).sum::<f64>();
    let most = area(&Turned::NOT);
    let fitting: Vec<Turned> = rotations.into_iter().map(Turned::by).filter(|frame| area(frame) < most).collect();
    if fitting.is_empty() {
        return Turned::NOT;
    }
    let world = WORTH_TURNING * cost(&Turned::NOT);
    let tried = fitting.into_iter().map(|frame| (cost(&frame), frame));
    tried.fold((world, Turned::NOT), |best, tried| if tried.0 < best.0 { tried } else { best }).1
}
