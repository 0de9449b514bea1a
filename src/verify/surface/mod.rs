//! Compares the surfaces of two files exhaustively: every placed triangle of the input is in the output, once, in its
//! place, in double precision.
//!
//! What the output records about its triangles is only a guess of where to look first ([`record`]); it counts as far as
//! the triangle lies there. All others are sought by place ([`place`]): within the limits, then turned over, then farther
//! and farther away, so that what is missing, moved, doubled, flipped and added is told apart.

mod corners;
mod errors;
mod limits;
mod lone;
mod numbering;
pub mod pairs;
mod place;
mod record;
#[cfg(test)]
mod tests;
mod untangle;

use std::collections::BTreeSet;

use limits::Limits;
use pairs::{Pair, Pairs};
use place::{Keep, Match, Rule, Seeker};
use rayon::prelude::*;

use self::errors::{Largest, PositionErrors};
use super::identity::{Chunk, Identity, chunks, describe};
use super::materials::Materials;
use super::structure::{Fault, Power, Record, Structure, reference_length};
use super::{Side, Sides};
use crate::parallel;
use crate::scene::{Instance, Scene, TriangleRef};

/// Triangles considered for each within the limits, and for each that was moved.
const CONSIDERED: usize = 1 << 16;
const CONSIDERED_FAR: usize = 256;
/// How much farther each round looks for moved triangles than the one before.
const FARTHER: f64 = 8.0;
/// A suggested limit is rounded up to this number of digits.
const SUGGESTED_DIGITS: i32 = 2;

/// Compares all placed triangles of two scenes, those of instances with singular transforms included, and pairs them.
///
/// Corners may be listed in another order as long as the same side is the front. Each may be off by
/// `max_position_error_ratio` of the scene's size, but no more than a thousand times that ratio of its object's own
/// size, and a tenth of it. The place is that which the input's file gives. Time is linear in the number of triangles
/// where the output records their places, and that of sorting where it does not. Memory is 8 bytes for each placed
/// triangle, and 80 for each that is sought by place.
pub fn compare(identity: &Identity, max_position_error_ratio: f64) -> (Structure, Pairs) {
    let (before, after) = identity.scenes();
    let scenes = Sides { before, after };
    let limits = Limits::new(before, max_position_error_ratio);
    let (pairs, errors, missing) = record::follow(identity, &limits);
    let extra = pairs.unpaired();
    let mut search = Search::new(scenes, &limits, pairs, errors, Sides { before: missing, after: extra });
    search.run();
    let (structure, pairs) = search.finish();
    (Structure { power: power(scenes.before, &limits), ..structure }, pairs)
}

/// Returns the area of the given triangles of an instance, in world units.
fn area_of(scene: &Scene, instance: u32, triangles: impl Iterator<Item = u32>) -> f64 {
    triangles.map(|triangle| corners::area(scene.world_corners(TriangleRef { instance, triangle }))).sum()
}

/// Returns the area of all placed triangles, in world units.
pub(super) fn area(scene: &Scene) -> f64 {
    let count = |instance: &Instance| scene.meshes[instance.mesh.0 as usize].triangle_count() as u32;
    let of_instance = |(i, instance): (usize, &Instance)| area_of(scene, i as u32, 0..count(instance));
    scene.instances.par_iter().enumerate().map(of_instance).collect::<Vec<f64>>().iter().sum()
}

/// Returns the share of a scene's area that the given triangles are; 1 if nothing has an area.
pub(super) fn share_of_area(scene: &Scene, touched: &BTreeSet<TriangleRef>) -> f64 {
    let of_touched: f64 = touched.iter().map(|at| area_of(scene, at.instance, std::iter::once(at.triangle))).sum();
    let all = area(scene);
    if all > 0.0 { of_touched / all } else { 1.0 }
}

/// What the comparison looked at, and what it would have seen.
fn power(before: &Scene, limits: &Limits) -> Power {
    let shares = (0..before.instances.len() as u32).map(|i| (i, limits.over_own_size(i, limits.of(i))));
    let worst = shares.reduce(|a, b| if b.1 > a.1 { b } else { a });
    let largest = (0..before.instances.len() as u32).map(|i| limits.of(i)).fold(0.0, f64::max);
    Power {
        area: area(before).min(f64::MAX),
        smallest_displacement_seen: largest.min(f64::MAX),
        smallest_displacement_seen_ratio_of_object: worst.map_or(0.0, |(_, share)| share),
        object: worst.map(|(i, _)| before.instances[i as usize].display_name()),
    }
}

/// The search for the triangles whose place is not where the output records it.
struct Search<'a> {
    scenes: Sides<&'a Scene>,
    limits: &'a Limits,
    materials: Materials,
    pairs: Pairs,
    errors: PositionErrors,
    /// Triangles without partner.
    left: Sides<Vec<TriangleRef>>,
    /// Number of triangles that lie where the output records them.
    confirmed: u64,
    recorded_elsewhere: Faults,
    repeated: Faults,
    flipped: Faults,
    moved: Faults,
    degenerate: Sides<Faults>,
    /// The farthest moved triangle of the output and its distance.
    farthest: Option<(TriangleRef, f64)>,
    /// The smallest ratio that allows all moved triangles; `None` if none does.
    ratio_that_allows: Option<f64>,
}

/// Triangles with a fault.
#[derive(Default)]
struct Faults {
    count: u64,
    first: Option<TriangleRef>,
}

impl Faults {
    fn of(all: impl IntoIterator<Item = TriangleRef>) -> Faults {
        all.into_iter().fold(Faults::default(), |faults, at| Faults {
            count: faults.count + 1,
            first: Some(faults.first.map_or(at, |first| first.min(at))),
        })
    }

    fn described(&self, scene: &Scene) -> Fault {
        Fault { count: self.count, first: self.first.map(|at| describe(scene, at)) }
    }
}

impl<'a> Search<'a> {
    fn new(
        scenes: Sides<&'a Scene>,
        limits: &'a Limits,
        pairs: Pairs,
        errors: PositionErrors,
        left: Sides<Vec<TriangleRef>>,
    ) -> Self {
        Search {
            materials: Materials::in_place(scenes),
            confirmed: scenes.after.triangles_placed() - left.after.len() as u64,
            scenes,
            limits,
            pairs,
            errors,
            left,
            recorded_elsewhere: Faults::default(),
            repeated: Faults::default(),
            flipped: Faults::default(),
            moved: Faults::default(),
            degenerate: Sides::default(),
            farthest: None,
            ratio_that_allows: Some(0.0),
        }
    }

    fn run(&mut self) {
        let limits = self.limits;
        let within = |i| limits.of(i);
        let rule = Rule { tolerance: &within, same_side: true, keep: Keep::Best, most_considered: CONSIDERED };
        let mut found = self.pair(&rule);
        found.extend(self.untangle());
        self.recorded_elsewhere = Faults::of(found);
        self.set_aside_flat();
        self.set_aside_repeated();
        self.flipped = Faults::of(self.pair(&Rule { same_side: false, ..rule }));
        self.find_moved();
    }

    /// Pairs what is left by a rule; returns what was paired of the output.
    fn pair(&mut self, rule: &Rule) -> Vec<TriangleRef> {
        if self.left.before.is_empty() || self.left.after.is_empty() {
            return Vec::new();
        }
        let seeker = Seeker { scenes: self.scenes, materials: &self.materials };
        let given = Sides { before: self.left.before.as_slice(), after: self.left.after.as_slice() };
        let matches = seeker.pair(given, rule);
        let paired: Vec<TriangleRef> = matches.iter().map(|m| self.take(m)).collect();
        let mut paired_of = self.left.as_ref().map(|left| vec![false; left.len()]);
        for m in &matches {
            paired_of.before[m.before as usize] = true;
            paired_of.after[m.after as usize] = true;
        }
        retain(&mut self.left.before, &paired_of.before);
        retain(&mut self.left.after, &paired_of.after);
        paired
    }

    /// Pairs again where triangles lie closer together than they may be off; returns what was paired of the output.
    fn untangle(&mut self) -> Vec<TriangleRef> {
        let limits = self.limits;
        let seeker = Seeker { scenes: self.scenes, materials: &self.materials };
        let left = Sides { before: self.left.before.as_slice(), after: self.left.after.as_slice() };
        let repaired = untangle::untangle(&seeker, left, &|i| limits.of(i), &self.pairs);
        for &(at, source, fit) in &repaired {
            self.pairs.set(at, Pair { at: source, turn: fit.turn });
            self.errors.add(at.instance, Largest::default().or(limits, source.instance, fit.error));
        }
        let (sources, afters): (BTreeSet<_>, BTreeSet<_>) =
            repaired.iter().map(|(at, source, _)| (*source, *at)).unzip();
        let found = self.left.after.extract_if(.., |at| afters.contains(at)).collect();
        self.left.before.retain(|at| !sources.contains(at));
        found
    }

    /// Records a match; returns its triangle of the output.
    fn take(&mut self, found: &Match) -> TriangleRef {
        let (at, source) = (self.left.after[found.after as usize], self.left.before[found.before as usize]);
        self.pairs.set(at, Pair { at: source, turn: found.fit.turn });
        self.errors.add(at.instance, Largest::default().or(self.limits, source.instance, found.fit.error));
        if found.fit.error > self.limits.of(source.instance) {
            if self.farthest.is_none_or(|(_, farthest)| found.fit.error > farthest) {
                self.farthest = Some((at, found.fit.error));
            }
            let ratio = self.limits.ratio_that_allows(source.instance, found.fit.error);
            self.ratio_that_allows = self.ratio_that_allows.zip(ratio).map(|(a, b)| a.max(b));
        }
        at
    }

    /// Sets aside triangles without area that only one file has: no ray sees them.
    fn set_aside_flat(&mut self) {
        for side in Side::BOTH {
            let scene = self.scenes[side];
            let is_flat = |at: &TriangleRef| corners::is_flat(scene.world_corners(*at));
            let flat = self.left[side].extract_if(.., |at| is_flat(at)).collect::<Vec<_>>();
            self.degenerate[side] = Faults::of(flat);
        }
    }

    /// Sets aside triangles of the output that lie where another one of the output shows a triangle of the input.
    fn set_aside_repeated(&mut self) {
        if self.left.after.is_empty() {
            return;
        }
        let (limits, scenes) = (self.limits, self.scenes);
        let within = |i| limits.of(i);
        let rule = Rule { tolerance: &within, same_side: true, keep: Keep::BestShared, most_considered: CONSIDERED };
        let all = all_triangles(scenes.before);
        let given = Sides { before: all.as_slice(), after: self.left.after.as_slice() };
        let matches = Seeker { scenes, materials: &self.materials }.pair(given, &rule);
        let mut is_repeated = vec![false; self.left.after.len()];
        matches.iter().for_each(|m| is_repeated[m.after as usize] = true);
        self.repeated = Faults::of(matches.iter().map(|m| self.left.after[m.after as usize]));
        retain(&mut self.left.after, &is_repeated);
    }

    /// Pairs what is left with what lies farther and farther away, up to half the size of its object.
    fn find_moved(&mut self) {
        let limits = self.limits;
        let mut factor = 1.0;
        let mut moved = Vec::new();
        loop {
            let widest =
                |at: &TriangleRef| limits.widened(at.instance, FARTHER * factor) <= limits.widened(at.instance, factor);
            if self.left.before.iter().all(widest) || self.left.after.is_empty() {
                break;
            }
            factor *= FARTHER;
            let within = |i| limits.widened(i, factor);
            let rule = Rule { tolerance: &within, same_side: true, keep: Keep::Best, most_considered: CONSIDERED_FAR };
            moved.extend(self.pair(&rule));
        }
        self.moved = Faults::of(moved);
    }

    fn finish(self) -> (Structure, Pairs) {
        let Sides { before, after } = self.scenes;
        let missing = Faults::of(self.left.before.iter().copied());
        let unknown = Faults::of(self.left.after.iter().copied());
        let only_moved = self.moved.count > 0
            && [&missing, &unknown, &self.repeated, &self.flipped].iter().all(|faults| faults.count == 0);
        let suggested = self.ratio_that_allows.filter(|_| only_moved).map(rounded_up);
        let Largest { error, object } = self.errors.largest;
        let size = reference_length(before);
        let mut moved = self.moved.described(after);
        moved.first = self.farthest.map(|(at, _)| describe(after, at)).or(moved.first);
        let structure = Structure {
            triangles_before: before.triangles_placed(),
            triangles_after: after.triangles_placed(),
            missing: missing.described(before),
            repeated: self.repeated.described(after),
            unknown: unknown.described(after),
            wrong_material: wrong_materials(self.scenes, &self.materials, &self.pairs).described(after),
            flipped: self.flipped.described(after),
            moved,
            farthest_moved: self.farthest.map_or(0.0, |(_, distance)| distance.min(f64::MAX)),
            degenerate: Sides {
                before: self.degenerate.before.described(before),
                after: self.degenerate.after.described(after),
            },
            suggested_max_position_error_ratio: suggested,
            record: Record { confirmed: self.confirmed, elsewhere: self.recorded_elsewhere.described(after) },
            power: Power::default(),
            max_position_error: error.min(f64::MAX),
            position_error_ratio: if error > 0.0 { (error / size).min(f64::MAX) } else { 0.0 },
            worst_object: object,
            of_instances: self.errors.of_instances,
        };
        (structure, self.pairs)
    }
}

/// Returns the triangles whose partner has another material.
fn wrong_materials(scenes: Sides<&Scene>, materials: &Materials, pairs: &Pairs) -> Faults {
    let of_chunk = |chunk: &Chunk| {
        let differs = |at: &TriangleRef| {
            pairs.get(*at).is_some_and(|pair| {
                materials.kind(Side::After, scenes.after, *at) != materials.kind(Side::Before, scenes.before, pair.at)
            })
        };
        chunk.refs(scenes.after).filter(differs).collect::<Vec<TriangleRef>>()
    };
    let of_chunks: Vec<Vec<TriangleRef>> = parallel::map_each(&chunks(scenes.after), &of_chunk);
    Faults::of(of_chunks.into_iter().flatten())
}

/// Returns all placed triangles of a scene.
fn all_triangles(scene: &Scene) -> Vec<TriangleRef> {
    chunks(scene).par_iter().flat_map_iter(|chunk| chunk.refs(scene)).collect()
}

/// Keeps the elements that are not marked.
fn retain(of: &mut Vec<TriangleRef>, marked: &[bool]) {
    let mut marks = marked.iter();
    of.retain(|_| !marks.next().expect("one mark each"));
}

/// Rounds a positive number up to few digits.
fn rounded_up(ratio: f64) -> f64 {
    if !(ratio > 0.0 && ratio.is_finite()) {
        return ratio;
    }
    let digits = SUGGESTED_DIGITS - 1 - ratio.log10().floor() as i32;
    // Through text, as powers of ten are not exact.
    let least = (ratio * 10f64.powi(digits)).ceil();
    format!("{least}e{}", -digits).parse().unwrap_or(ratio)
}
