//! `overlap`: splits and merges objects until their boxes overlap little.
//!
//! T. Bilák, "Scene optimization for RTX", master's thesis, Czech Technical University in Prague, 2024, listing 4.1:
//! each round processes a queue of all overlapping pairs, largest overlap first. The treatment of a pair depends on the
//! area of its overlap relative to the area of the box around both: if small, both are split in the middle; if larger,
//! both are split at the overlap and the parts inside it merge; if most of it, both merge. An object takes part at most
//! once per round.
//!
//! Helps if objects are hollow or intersect each other; hurts if long triangles stick out of each piece.
//!
//! [`OverlapRule::Thesis`] follows the listing to the letter, but for two things: objects that merge keep their materials
//! (the thesis chooses one), and rounds end when nothing changes any more, when a state returns (two objects can be
//! split and merged in turns for ever), or after [`MOST_ROUNDS`]. So merged objects
//! are divided again; both objects of a pair are used up for the round, divided or not; where all or none of an object
//! lies inside the overlap, it is split in the middle, and the half that shares more with the overlap merges; ratios are
//! over the box of the whole scene, and the one that ends the rounds sums the queued pairs only; the state after the last
//! round is the layout, whatever its overlap.
//!
//! [`OverlapRule::Improved`], the default, departs where the thesis leaves a choice, or where following it literally
//! raises the overlap:
//! - Objects that merge form a mesh group in which each keeps its material. Such a group is never divided again.
//!   Objects can only be divided as often as they have triangles, and can only merge as often as there are objects, so
//!   the rounds terminate.
//! - An object that cannot be divided (a mesh group, one with few triangles, one whose centroids are all equal) takes
//!   part undivided: in the middle branch, all of it merges with the other object's part inside the overlap. A pair of
//!   two such objects is skipped unless they merge.
//! - An object with all or none of its triangles inside the overlap is split in the middle, and nothing of it merges.
//! - More than [`FEW_OBJECTS`] bodies with the same box merge in one round.
//! - The layout of the round with the least overlap wins, but only if it lowers that of the input (whose instances may
//!   hold several objects each), so the overlap of a scene never increases.
//!
//! Overlaps are relative to the box of the scene's core ([`Core`](crate::scene::Core)), which is that of the scene if no
//! object is set apart, and the ratio includes instances of the core that stay unchanged. Objects outside the core take
//! no part: the box of a sky dome overlaps everything, and cutting objects where it does separates nothing.

mod series;
#[cfg(test)]
mod tests;

use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use self::series::Series;
use crate::cost::overlap;
use crate::layout::builder::Builder;
use crate::layout::{Layout, Note, Round, Rounds};
use crate::methods::instancing::{Known, bake_within_limits};
use crate::methods::pieces::{Item, Piece, Pieces, bounds_of, centroid_bounds, longest_axis};
use crate::methods::{InstanceOptions, OverlapOptions, OverlapRule};
use crate::scene::{Bounds, Scene};

/// Maximum number of rounds, after which the best layout so far is taken. Scenes of a thousand objects take about a
/// hundred.
const MOST_ROUNDS: usize = 256;

/// Maximum number of pairs queued per round; if there could be more, only the objects with the largest boxes take part.
const MOST_PAIRS: usize = 1 << 21;

/// This many objects cannot form more than [`MOST_PAIRS`] pairs.
const FEW_OBJECTS: usize = 1 << 11;

/// Splits and merges objects to lower the overlap ratio.
pub(super) fn overlap(scene: &Scene, instances: &InstanceOptions, options: &OverlapOptions) -> Layout {
    bake_within_limits(scene, instances, &Known::default(), |selection| {
        let mut layout = Builder::new(scene);
        selection.place_left(&mut layout);
        let mut reduction = Reduction::new(Pieces::new(scene, selection), options);
        let input = overlap::ratio(&scene.core().instance_boxes(scene));
        let (groups, mut rounds) = reduction.run();
        let is_lower = rounds.taken.is_some_and(|taken| rounds.list[taken].overlap_ratio < input);
        if is_lower || options.rule == OverlapRule::Thesis {
            reduction.pieces.emit(&groups, &mut layout);
        } else {
            selection.baked().for_each(|instance| layout.keep(instance));
            layout.note(Note::OverlapNotLowered { of_input: input });
            rounds = Rounds::new(rounds.list, None);
        }
        Layout { rounds: Some(rounds), ..layout.finish() }
    })
}

/// An object, a part of one, or a mesh group.
#[derive(Clone, Debug)]
struct Body {
    /// Its pieces; more than one only in a mesh group.
    pieces: Vec<Piece>,
    bounds: Bounds,
    divisible: bool,
    /// Whether it is an object outside the scene's core, which stays as it is.
    apart: bool,
}

/// The state of the scene between rounds.
struct Reduction<'a> {
    pieces: Pieces<'a>,
    options: &'a OverlapOptions,
    /// All bodies ever created.
    bodies: Vec<Body>,
    /// Those that currently make up the scene.
    live: Vec<usize>,
    /// What the rounds did so far.
    done: Done,
}

/// How often objects were divided and joined.
#[derive(Clone, Copy, Default)]
struct Done {
    splits: u64,
    merges: u64,
}

/// Two bodies to process.
struct Task {
    /// Indices into [`Reduction::live`].
    places: [usize; 2],
    /// Surface area of the intersection of their boxes.
    area: f64,
}

impl<'a> Reduction<'a> {
    fn new(pieces: Pieces<'a>, options: &'a OverlapOptions) -> Self {
        let divisible = |piece: Piece| piece.len() > options.min_triangles;
        let is_apart = |piece| options.rule == OverlapRule::Improved && pieces.is_apart(piece);
        let body =
            |(piece, bounds)| Body { pieces: vec![piece], bounds, divisible: divisible(piece), apart: is_apart(piece) };
        let bodies: Vec<Body> = pieces.whole().into_iter().map(body).collect();
        Reduction { pieces, options, live: (0..bodies.len()).collect(), bodies, done: Done::default() }
    }

    /// Runs the rounds; returns the pieces of each body of the state to take, and what the rounds did.
    fn run(&mut self) -> (Vec<Vec<Piece>>, Rounds) {
        let mut series = self.options.series.then(Series::default);
        let mut list = vec![self.state(series.as_mut())];
        let (mut best, mut taken) = (self.live.clone(), 0);
        let mut seen = FxHashSet::default();
        while list.len() <= MOST_ROUNDS && seen.insert(self.fingerprint()) {
            let ratio = list[list.len() - 1].overlap_ratio;
            if !self.round(ratio) {
                break;
            }
            list.push(self.state(series.as_mut()));
            let is_better = list[list.len() - 1].overlap_ratio < list[taken].overlap_ratio;
            if is_better || self.options.rule == OverlapRule::Thesis {
                (best, taken) = (self.live.clone(), list.len() - 1);
            }
        }
        let groups = best.into_iter().map(|body| self.bodies[body].pieces.clone()).collect();
        (groups, Rounds::new(list, Some(taken)))
    }

    /// Describes the present state; what was done is counted anew from here.
    fn state(&mut self, series: Option<&mut Series>) -> Round {
        let Done { splits, merges } = std::mem::take(&mut self.done);
        let costs = series.map(|of| of.costs(&self.pieces, &self.bodies, &self.live, self.pieces.scene_area()));
        Round {
            meshes: self.live.len() as u64,
            splits,
            merges,
            overlap_ratio: self.overlap_ratio(),
            sah_cost: costs.map(|costs| costs.sah),
            two_level_cost: costs.map(|costs| costs.two_level),
        }
    }

    /// Returns a hash that is equal for equal states, whatever the order of the bodies.
    fn fingerprint(&self) -> u64 {
        let key = |&body: &usize| {
            let Body { bounds: Bounds { min, max }, pieces, .. } = &self.bodies[body];
            let triangles: usize = pieces.iter().map(|piece| piece.len()).sum();
            // Not a linear hash: triangles that pass from one body to the other would leave the sum alone.
            BuildHasherDefault::<DefaultHasher>::default()
                .hash_one(([*min, *max].map(|p| p.to_array().map(f64::to_bits)), triangles))
        };
        self.live.iter().map(key).fold(0, u64::wrapping_add)
    }

    /// The area that overlaps are relative to.
    fn area(&self) -> f64 {
        match self.options.rule {
            OverlapRule::Improved => self.pieces.core_area,
            OverlapRule::Thesis => self.pieces.scene_area(),
        }
    }

    fn overlap_ratio(&self) -> f64 {
        let live = self.live.iter().map(|&body| &self.bodies[body]).filter(|body| !body.apart).map(|body| body.bounds);
        let boxes: Vec<Bounds> = live.chain(self.pieces.others.iter().copied()).collect();
        overlap::ratio(&boxes)
    }

    /// Makes one pass through the queue; returns whether anything changed. Nothing does once the overlap is low enough, for
    /// which the thesis sums the pairs in the queue only.
    fn round(&mut self, overlap_ratio: f64) -> bool {
        let (is_literal, least) = (self.options.rule == OverlapRule::Thesis, self.options.termination_overlap_ratio);
        if !is_literal && overlap_ratio < least {
            return false;
        }
        if self.merge_crowds() {
            return true;
        }
        let queue = self.queue(overlap_ratio);
        if is_literal && queue.iter().map(|task| task.area).sum::<f64>() < least * self.area() {
            return false;
        }
        let (mut dirty, mut gone) = (vec![false; self.live.len()], vec![false; self.live.len()]);
        let mut successors = Vec::new();
        for Task { places, area } in queue {
            if places.iter().any(|&place| dirty[place]) {
                continue;
            }
            let new = self.process(places.map(|place| self.live[place]), area);
            for place in places {
                dirty[place] = new.is_some() || is_literal;
                gone[place] = new.is_some();
            }
            successors.extend(new.into_iter().flatten());
        }
        let mut place = 0..self.live.len();
        self.live.retain(|_| place.next().is_some_and(|place| !gone[place]));
        self.live.extend(&successors);
        !successors.is_empty()
    }

    /// Merges bodies whose boxes are equal, if these are more than a queue can hold all pairs of; returns whether there
    /// were any. In the queue they would merge two by two, a few thousand per round.
    fn merge_crowds(&mut self) -> bool {
        let is_literal = self.options.rule == OverlapRule::Thesis;
        if is_literal || self.live.len() <= FEW_OBJECTS || self.options.split_or_merge_ratio > 1.0 {
            return false;
        }
        let mut crowds: FxHashMap<[[u64; 3]; 2], Vec<usize>> = FxHashMap::default();
        for &body in self.live.iter().filter(|&&body| !self.bodies[body].apart && self.bodies[body].bounds.area() > 0.0)
        {
            let Bounds { min, max } = self.bodies[body].bounds;
            crowds.entry([min, max].map(|p| p.to_array().map(f64::to_bits))).or_default().push(body);
        }
        let mut crowds: Vec<Vec<usize>> = crowds.into_values().filter(|crowd| crowd.len() > FEW_OBJECTS).collect();
        crowds.sort_unstable();
        let merged: Vec<usize> = crowds.iter().map(|crowd| self.merge(crowd)).collect();
        let gone: FxHashSet<usize> = crowds.into_iter().flatten().collect();
        self.live.retain(|body| !gone.contains(body));
        self.live.extend(&merged);
        !merged.is_empty()
    }

    /// Returns the pairs that overlap enough, largest overlap first, ties in the order of the bodies.
    fn queue(&self, overlap_ratio: f64) -> Vec<Task> {
        let min_ratio = self.options.skip_overlap_ratio.max(0.0);
        let bounds_at = |place: usize| self.bodies[self.live[place]].bounds;
        let mut places: Vec<usize> =
            (0..self.live.len()).filter(|&place| !self.bodies[self.live[place]].apart).collect();
        // Upper bound on the number of pairs that can each exceed the minimum share of the overlap.
        let pairs_at_most = overlap_ratio / min_ratio;
        if places.len() > FEW_OBJECTS && pairs_at_most > MOST_PAIRS as f64 {
            places.sort_by(|&a, &b| bounds_at(b).area().total_cmp(&bounds_at(a).area()));
            places.truncate(FEW_OBJECTS);
            places.sort_unstable();
        }
        let boxes: Vec<Bounds> = places.iter().map(|&place| bounds_at(place)).collect();
        let mut pairs = overlap::pairs(&boxes, min_ratio * self.area());
        pairs.par_sort_by(|a, b| b.area.total_cmp(&a.area));
        let task = |pair: overlap::Pair| Task { places: [pair.a, pair.b].map(|i| places[i as usize]), area: pair.area };
        pairs.into_iter().map(task).collect()
    }

    /// Returns the bodies that replace two overlapping bodies; `None` if they stay unchanged.
    fn process(&mut self, pair: [usize; 2], area: f64) -> Option<Vec<usize>> {
        let [a, b] = pair.map(|body| self.bodies[body].bounds);
        let pair_overlap_ratio = area / a.union(&b).area();
        if pair_overlap_ratio >= self.options.split_or_merge_ratio {
            Some(vec![self.merge(&pair)])
        } else if pair_overlap_ratio < self.options.split_ratio {
            self.split_both(pair)
        } else {
            self.split_and_merge(pair, &a.intersection(&b))
        }
    }

    fn split_both(&mut self, pair: [usize; 2]) -> Option<Vec<usize>> {
        let halves = pair.map(|body| self.split_in_the_middle(body));
        halves.iter().any(Option::is_some).then(|| {
            let after = |(body, halves): (usize, Option<[usize; 2]>)| halves.map_or(vec![body], Vec::from);
            pair.into_iter().zip(halves).flat_map(after).collect()
        })
    }

    fn split_and_merge(&mut self, pair: [usize; 2], common: &Bounds) -> Option<Vec<usize>> {
        let [a, b] = pair.map(|body| self.cut(body, common));
        if a.outside.is_empty() && b.outside.is_empty() {
            return None;
        }
        let inside = match (a.inside, b.inside) {
            (Some(a), Some(b)) => vec![self.merge(&[a, b])],
            (a, b) => a.into_iter().chain(b).collect(),
        };
        Some([inside, a.outside, b.outside].concat())
    }

    /// Joins bodies into a mesh group.
    fn merge(&mut self, bodies: &[usize]) -> usize {
        self.done.merges += 1;
        let bounds = bodies.iter().map(|&body| self.baked_bounds(body)).reduce(|a, b| a.union(&b));
        let pieces: Vec<Piece> = bodies.iter().flat_map(|&body| self.bodies[body].pieces.iter().copied()).collect();
        let divisible = self.options.rule == OverlapRule::Thesis && self.is_large(&pieces);
        self.push(Body { pieces, bounds: bounds.unwrap_or(Bounds::EMPTY), divisible, apart: false })
    }

    /// Whether pieces have enough triangles together to be divided.
    fn is_large(&self, pieces: &[Piece]) -> bool {
        pieces.iter().map(|piece| piece.len()).sum::<usize>() > self.options.min_triangles
    }

    /// Returns the box of a body once it cannot stay as it is in the input.
    fn baked_bounds(&self, body: usize) -> Bounds {
        match *self.bodies[body].pieces {
            [object] if self.pieces.is_whole(object) => self.pieces.baked_bounds(object),
            _ => self.bodies[body].bounds,
        }
    }

    /// Divides a body into its parts inside and outside a box.
    fn cut(&mut self, body: usize, common: &Bounds) -> Cut {
        let [min, max] = [common.min, common.max].map(|p| self.pieces.seen_from_middle(p));
        let is_inside = |item: &Item| item.centroid.cmpge(min).all() && item.centroid.cmple(max).all();
        if let Some([inside, outside]) = self.divide(body, is_inside) {
            Cut { inside: Some(inside), outside: vec![outside] }
        } else if let Some(halves) = self.split_in_the_middle(body) {
            self.cut_in_the_middle(halves, common)
        } else {
            Cut { inside: Some(body), outside: Vec::new() }
        }
    }

    /// What merges of a body that was split in the middle: nothing, or by the thesis what shares more with the overlap.
    fn cut_in_the_middle(&self, [a, b]: [usize; 2], common: &Bounds) -> Cut {
        let shared = |body: usize| self.bodies[body].bounds.intersection(common).area();
        match self.options.rule {
            OverlapRule::Improved => Cut { inside: None, outside: vec![a, b] },
            OverlapRule::Thesis if shared(b) > shared(a) => Cut { inside: Some(b), outside: vec![a] },
            OverlapRule::Thesis => Cut { inside: Some(a), outside: vec![b] },
        }
    }

    /// Divides a body at the middle of the longest edge of its box, or of the box of its centroids if they all lie on
    /// one side; `None` if it cannot be divided, which is remembered.
    fn split_in_the_middle(&mut self, body: usize) -> Option<[usize; 2]> {
        let pieces = self.divisible_pieces(body)?;
        let around = |of: fn(&[Item]) -> Bounds| {
            pieces.iter().fold(Bounds::EMPTY, |all, &piece| all.union(&of(self.pieces.items(piece))))
        };
        let (bounds, centroids) = (around(bounds_of), around(centroid_bounds));
        let axis = longest_axis(&bounds);
        let middle = self.pieces.seen_from_middle(bounds.center())[axis];
        let halves = self.divide(body, |item| item.centroid[axis] < middle).or_else(|| {
            let axis = longest_axis(&centroids);
            let middle = centroids.center()[axis];
            self.divide(body, |item| f64::from(item.centroid[axis]) <= middle)
        });
        self.bodies[body].divisible = halves.is_some();
        halves
    }

    /// Divides a body into the triangles for which `is_first` holds and the others; `None` if it must not be divided or
    /// if one part would be empty.
    fn divide(&mut self, body: usize, is_first: impl Fn(&Item) -> bool) -> Option<[usize; 2]> {
        let mut parts = [Vec::new(), Vec::new()];
        for piece in self.divisible_pieces(body)? {
            let divided = self.pieces.divide(piece, &is_first);
            parts.iter_mut().zip(divided).for_each(|(part, piece)| part.extend(Some(piece).filter(|p| p.len() > 0)));
        }
        parts.iter().all(|part| !part.is_empty()).then(|| {
            self.done.splits += 1;
            parts.map(|pieces| {
                let bounds = pieces.iter().map(|&piece| self.pieces.baked_bounds(piece));
                let bounds = bounds.fold(Bounds::EMPTY, |all, b| all.union(&b));
                let divisible = self.is_large(&pieces);
                self.push(Body { pieces, bounds, divisible, apart: false })
            })
        })
    }

    /// Returns what a body that may be divided consists of, with its triangles read.
    fn divisible_pieces(&mut self, body: usize) -> Option<Vec<Piece>> {
        let Body { divisible: true, pieces, .. } = &self.bodies[body] else { return None };
        let pieces = pieces.clone();
        pieces.iter().for_each(|&piece| self.pieces.load(piece));
        Some(pieces)
    }

    fn push(&mut self, body: Body) -> usize {
        self.bodies.push(body);
        self.bodies.len() - 1
    }
}

/// A body divided by an overlap.
struct Cut {
    /// The part to merge.
    inside: Option<usize>,
    /// The parts that stay separate; empty if the body cannot be divided.
    outside: Vec<usize>,
}
