//! What all cuts of the same triangles have in common.

use std::cell::OnceCell;

use super::facts::{self, Facts, Own};
use super::programme::{self, Group, Known};
use super::refit::Refit;
use super::soup::{Soup, Turned};
use super::units::{self, Unit};
use super::{Limits, PROHIBITIVE, WORTH_TURNING};
use crate::cost::tree::{Quality, Tree};
use crate::layout::builder::Object;
use crate::layout::frames::{self, Search};
use crate::scene::{Bounds, Scene};

/// Triangles, their tree in the frame that fits all of them best, and the frames that parts of it would rather have.
pub(super) struct Ground {
    pub(super) soup: Soup,
    base: Turned,
    boxes: Vec<Bounds>,
    tree: Tree,
    facts: Vec<Facts>,
    /// Whether parts may get frames of their own.
    turns: bool,
    /// Found when it is needed first.
    parts: OnceCell<Parts>,
}

/// What may leave.
struct Parts {
    own: Vec<Option<Own>>,
    units: Vec<Unit>,
}

impl Ground {
    /// Of the triangles of some objects; `None` where one of them has a box that no tree can hold. `frames` is whether
    /// frames are looked for.
    pub(super) fn new(scene: &Scene, objects: &[Object], frames: bool) -> Option<Ground> {
        let soup = Soup::new(scene, objects);
        let boxes = soup.boxes_in(&Turned::NOT);
        let tree = Tree::build_usable(&boxes, Quality::Medium);
        if tree.order.len() < soup.len() || tree.nodes.is_empty() {
            return None;
        }
        let base = if frames { best_frame(&soup, &tree) } else { Turned::NOT };
        let (tree, boxes) = match base == Turned::NOT {
            true => (tree, boxes),
            false => {
                let boxes = soup.boxes_in(&base);
                (Tree::build(&boxes, Quality::Medium), boxes)
            }
        };
        let facts = facts::facts(&soup, &tree, &base);
        Some(Ground { soup, base, boxes, tree, facts, turns: frames, parts: OnceCell::new() })
    }

    /// The box around all triangles.
    pub(super) fn extent(&self) -> f64 {
        self.facts.first().map_or(0.0, |root| root.extent)
    }

    /// What may leave; `None` where nothing may.
    fn parts(&self) -> Option<&Parts> {
        let find = || Parts {
            own: facts::own_frames(&self.soup, &self.tree, &self.facts, &self.base),
            units: units::units(&self.soup, &self.tree, &self.facts, &self.base),
        };
        self.turns.then(|| self.parts.get_or_init(find))
    }

    /// The groups of least cost: of the tree as it is, or of what the units leave of it.
    pub(super) fn cut(&self, limits: &Limits) -> Vec<Group> {
        let triangles = self.facts.first().map_or(0, |root| root.triangles);
        if limits.entry_cost >= PROHIBITIVE && limits.allow(triangles, self.extent()) {
            return vec![Group { items: self.tree.order.clone(), frame: self.base }];
        }
        let none = if self.turns { Vec::new() } else { vec![None; self.facts.len()] };
        let own = self.parts().map_or(&none, |parts| &parts.own);
        let known = Known { tree: &self.tree, facts: &self.facts, own, base: self.base };
        let (groups, cost) = programme::cut(&known, limits);
        let peeled = limits.max_extent.is_infinite().then(|| programme::peel(&known, limits)).flatten();
        let others = [self.cut_without_units(limits), peeled];
        others.into_iter().flatten().fold((groups, cost), |best, other| if other.1 < best.1 { other } else { best }).0
    }

    /// The groups where every unit leaves that costs less so, and their cost; `None` where none does.
    fn cut_without_units(&self, limits: &Limits) -> Option<(Vec<Group>, f64)> {
        let price = |unit: &Unit| limits.leaving_cost() * unit.own.loose + unit.own.inside;
        let is_large = |unit: &Unit| unit.items.len() >= limits.min_turned as usize;
        let is_allowed = |unit: &Unit| is_large(unit) && limits.allow(unit.items.len() as u32, unit.extent);
        let units = &self.parts()?.units;
        let leaving: Vec<&Unit> = units.iter().filter(|u| is_allowed(u) && price(u) < u.share).collect();
        let mut stays = vec![true; self.soup.len()];
        leaving.iter().flat_map(|unit| &unit.items).for_each(|&t| stays[t as usize] = false);
        let mut groups: Vec<Group> =
            leaving.iter().map(|unit| Group { items: unit.items.clone(), frame: unit.own.frame }).collect();
        let mut cost: f64 = leaving.iter().map(|unit| price(unit)).sum();
        if groups.is_empty() {
            return None;
        }
        let rest: Vec<u32> = (0..self.soup.len() as u32).filter(|&t| stays[t as usize]).collect();
        if !rest.is_empty() {
            let (others, of_rest) = self.cut_rest(&rest, limits);
            groups.splice(0..0, others);
            cost += of_rest;
        }
        Some((groups, cost))
    }

    fn cut_rest(&self, rest: &[u32], limits: &Limits) -> (Vec<Group>, f64) {
        let boxes: Vec<Bounds> = rest.iter().map(|&t| self.boxes[t as usize]).collect();
        let mut tree = Tree::build(&boxes, Quality::Medium);
        tree.order.iter_mut().for_each(|i| *i = rest[*i as usize]);
        let facts = facts::facts(&self.soup, &tree, &self.base);
        let own = facts::own_frames(&self.soup, &tree, &facts, &self.base);
        programme::cut(&Known { tree: &tree, facts: &facts, own: &own, base: self.base }, limits)
    }
}

/// The frame in which a tree over all triangles, refitted, costs least; the world's unless another is clearly better.
fn best_frame(soup: &Soup, tree: &Tree) -> Turned {
    let mut refit = Refit::default();
    let mut cost = |frame: &Turned| refit.part(tree, 0, |t| soup.bounds_in(frame, t)).cost;
    let rotations = frames::rotations((0..soup.len() as u32).map(|t| soup.corners(t)), Search::SCENE);
    let world = WORTH_TURNING * cost(&Turned::NOT);
    let tried = rotations.into_iter().map(Turned::by).map(|frame| (cost(&frame), frame));
    tried.fold((world, Turned::NOT), |best, tried| if tried.0 < best.0 { tried } else { best }).1
}
