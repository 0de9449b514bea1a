//! Pairs triangles that lie in the same place.
//!
//! Triangles of the input go into a grid of cubes 32 times as wide as what their corners may be off, so that most
//! triangles of the output need be sought in one cube only. As objects of different size may be off by different
//! amounts, there is a grid for each range of amounts. In a cube, triangles are sought along x among those that are
//! close enough. Triangles that are alone in their cubes are paired first ([`lone`]); the cubes of all others are found by
//! sorting: in parallel, in order, and in 16 bytes per triangle.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::corners::{Fit, fit};
use super::lone;
use crate::scene::{Scene, TriangleRef};
use crate::verify::materials::Materials;
use crate::verify::{Side, Sides};

/// Width of a cube over the largest tolerance of its grid.
const WIDTH: f64 = 32.0;
/// Tolerances of one grid differ by no more than this factor.
const RANGE: f64 = 4.0;
/// A partner whose corners are off by no more than this share of the tolerance is taken without looking for a better one.
const GOOD_SHARE: f64 = 1e-3;

/// Cubes that one thread handles at a time: most hold a triangle or two.
const CUBES: usize = 1 << 10;

/// What to pair.
pub(super) struct Seeker<'a> {
    pub scenes: Sides<&'a Scene>,
    pub materials: &'a Materials,
}

/// How far apart two triangles may be, and how they may face.
pub(super) struct Rule<'a> {
    /// By instance of the input, how far a corner may be off, in world units.
    pub tolerance: &'a (dyn Fn(u32) -> f64 + Sync),
    /// Whether a triangle must have the same side in front.
    pub same_side: bool,
    /// Which of the possible partners count.
    pub keep: Keep,
    /// How many triangles of the input to consider for one of the output; more are only there if the tolerance is wide.
    pub most_considered: usize,
}

/// Which of the possible partners of a triangle count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keep {
    /// The best one that no other triangle has.
    Best,
    /// The best one, which others may have too.
    BestShared,
    /// All.
    Every,
}

/// A triangle of the output and its partner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Match {
    /// Index into the triangles of the output that were given.
    pub after: u32,
    /// Index into those of the input.
    pub before: u32,
    pub fit: Fit,
}

/// A triangle in a cube.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Entry {
    /// A hash of the cube. Cubes with equal hashes cost time, and nothing else.
    cube: u64,
    /// Where the triangle is along x, over the width of the cube.
    x: f32,
    /// Index into the triangles that were given.
    index: u32,
}

/// The triangles of the input with about one tolerance.
struct Level {
    /// The largest tolerance.
    tolerance: f64,
    /// Indices into the triangles that were given.
    triangles: Vec<u32>,
}

impl Seeker<'_> {
    /// Pairs triangles of the output with triangles of the input; neither may be given twice. Small tolerances come
    /// first. The result does not depend on the number of threads.
    pub(super) fn pair(&self, triangles: Sides<&[TriangleRef]>, rule: &Rule) -> Vec<Match> {
        let mut matches = Vec::new();
        let mut taken = triangles.map(|of| vec![false; of.len()]);
        let mut take = |found: Vec<Match>, taken: &mut Sides<Vec<bool>>| {
            for m in &found {
                taken.before[m.before as usize] = rule.keep == Keep::Best;
                taken.after[m.after as usize] = rule.keep != Keep::Every;
            }
            if matches.is_empty() { matches = found } else { matches.extend(found) }
        };
        for level in levels(self.scenes.before, triangles.before, rule) {
            if rule.keep == Keep::Best {
                take(self.pair_lone(&level, triangles, rule, &taken), &mut taken);
            }
            for neighbour in 0..8 {
                take(self.pair_in(&level, triangles, rule, neighbour, &taken), &mut taken);
            }
        }
        matches
    }

    /// Pairs triangles of one grid that are alone in their cube, as [`Seeker::pair_in`] would.
    fn pair_lone(
        &self,
        level: &Level,
        triangles: Sides<&[TriangleRef]>,
        rule: &Rule,
        taken: &Sides<Vec<bool>>,
    ) -> Vec<Match> {
        let width = WIDTH * level.tolerance;
        let after: Vec<u32> = (0..triangles.after.len() as u32).filter(|&i| !taken.after[i as usize]).collect();
        let hashes = |side: Side, of: &[u32]| -> Vec<u64> {
            let cube = |&i: &u32| hash((center(self.scenes[side], triangles[side][i as usize]) / width).floor());
            lone::map_chunks(of.len(), &|chunk| of[chunk].iter().map(cube).collect::<Vec<u64>>()).concat()
        };
        let pairs = lone::pair(&hashes(Side::Before, &level.triangles), &hashes(Side::After, &after));
        let matches = lone::map_chunks(pairs.len(), &|chunk| {
            let matched = |&[b, a]: &[u32; 2]| {
                self.alone(Sides { before: level.triangles[b as usize], after: after[a as usize] }, triangles, rule)
            };
            pairs[chunk].iter().filter_map(matched).collect::<Vec<Match>>()
        });
        matches.concat()
    }

    /// Pairs triangles of one grid. `neighbour` 0 looks for each triangle in its own cube; the bits of others tell along
    /// which axes to look in the cube beyond the closest side, if a partner may be there.
    fn pair_in(
        &self,
        level: &Level,
        triangles: Sides<&[TriangleRef]>,
        rule: &Rule,
        neighbour: u32,
        taken: &Sides<Vec<bool>>,
    ) -> Vec<Match> {
        let width = WIDTH * level.tolerance;
        let after = (0..triangles.after.len() as u32).into_par_iter().filter(|&i| !taken.after[i as usize]);
        let center = |side: Side, i: u32| center(self.scenes[side], triangles[side][i as usize]);
        let reach = level.tolerance / width;
        let mut sought: Vec<Entry> =
            after.filter_map(|i| Entry::beside(i, center(Side::After, i) / width, neighbour, reach)).collect();
        if sought.is_empty() {
            return Vec::new();
        }
        sought.par_sort_unstable_by(Entry::order);
        let before = level.triangles.par_iter().filter(|&&i| !taken.before[i as usize]);
        let mut there: Vec<Entry> = before.map(|&i| Entry::new(i, center(Side::Before, i) / width)).collect();
        there.par_sort_unstable_by(Entry::order);
        let reach = (level.tolerance / width) as f32 + 4.0 * f32::EPSILON;
        let in_cubes = |cubes: &[(Range<usize>, Range<usize>)]| {
            let mut matches = Vec::with_capacity(cubes.len());
            for (of_before, of_after) in cubes {
                let entries = Sides { before: &there[of_before.clone()], after: &sought[of_after.clone()] };
                match (entries.before, entries.after) {
                    ([before], [after]) => {
                        let indices = Sides { before: before.index, after: after.index };
                        matches.extend(self.alone(indices, triangles, rule));
                    }
                    _ => self.in_cube(entries, triangles, rule, reach, &mut matches),
                }
            }
            matches
        };
        common_cubes(&there, &sought).par_chunks(CUBES).flat_map_iter(in_cubes).collect()
    }

    /// Pairs the only triangles in a cube, given as indices into `triangles`: what most cubes hold.
    fn alone(&self, indices: Sides<u32>, triangles: Sides<&[TriangleRef]>, rule: &Rule) -> Option<Match> {
        let at = |side: Side| triangles[side][indices[side] as usize];
        let corners = |side: Side| self.scenes[side].world_corners(at(side));
        let fit = fit(&corners(Side::After), &corners(Side::Before));
        let is_partner = fit.error <= (rule.tolerance)(at(Side::Before).instance) && fit.same_side == rule.same_side;
        is_partner.then_some(Match { after: indices.after, before: indices.before, fit })
    }

    /// Pairs the triangles in a cube.
    fn in_cube(
        &self,
        entries: Sides<&[Entry]>,
        triangles: Sides<&[TriangleRef]>,
        rule: &Rule,
        reach: f32,
        matches: &mut Vec<Match>,
    ) {
        let of = |side: Side, entry: &Entry| triangles[side][entry.index as usize];
        let corners = |side: Side, entry: &Entry| self.scenes[side].world_corners(of(side, entry));
        let there: Vec<[DVec3; 3]> = entries.before.iter().map(|entry| corners(Side::Before, entry)).collect();
        let kind = |side, entry: &Entry| self.materials.kind(side, self.scenes[side], of(side, entry));
        let mut free = Free::new(entries.before.len());
        for entry in entries.after {
            let placed = corners(Side::After, entry);
            let first = entries.before.partition_point(|b| b.x < entry.x - reach);
            let close = free.from(first).take_while(|&b| entries.before[b].x <= entry.x + reach);
            let partners = close.take(rule.most_considered).filter_map(|at| {
                let partner = &entries.before[at];
                let tolerance = (rule.tolerance)(of(Side::Before, partner).instance);
                let fit = fit(&placed, &there[at]);
                let is_partner = fit.error <= tolerance && fit.same_side == rule.same_side;
                is_partner.then(|| Partner {
                    at,
                    fit,
                    other: kind(Side::Before, partner) != kind(Side::After, entry),
                    tolerance,
                })
            });
            let matched = |of: &Partner| Match { after: entry.index, before: entries.before[of.at].index, fit: of.fit };
            if rule.keep == Keep::Every {
                matches.extend(partners.map(|partner| matched(&partner)));
            } else if let Some(partner) = best(partners) {
                matches.push(matched(&partner));
                if rule.keep == Keep::Best {
                    free.take(partner.at);
                }
            }
        }
    }
}

/// A possible partner.
struct Partner {
    /// Index among the triangles in the cube.
    at: usize,
    fit: Fit,
    /// Whether it is of another material.
    other: bool,
    /// How far its corners may be off, in world units.
    tolerance: f64,
}

/// Returns the partner of the same material, if there is one, whose corners are least far off; or the first that is good
/// enough.
fn best(partners: impl Iterator<Item = Partner>) -> Option<Partner> {
    let mut best: Option<Partner> = None;
    for partner in partners {
        let is_good = !partner.other && partner.fit.error <= GOOD_SHARE * partner.tolerance;
        if best.as_ref().is_none_or(|best| (partner.other, partner.fit.error) < (best.other, best.fit.error)) {
            best = Some(partner);
        }
        if is_good {
            break;
        }
    }
    best
}

/// Returns the centre of a triangle's box: the same for any order of its corners.
fn center(scene: &Scene, at: TriangleRef) -> DVec3 {
    let [a, b, c] = scene.world_corners(at);
    // Halved first, as a sum may leave the range of numbers.
    0.5 * a.min(b).min(c) + 0.5 * a.max(b).max(c)
}

/// Returns the triangles of the input by their tolerance, the smallest tolerances first.
fn levels(scene: &Scene, triangles: &[TriangleRef], rule: &Rule) -> Vec<Level> {
    let of_instance: Vec<f64> = (0..scene.instances.len() as u32).map(rule.tolerance).collect();
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    let tolerance = |i: u32| of_instance[triangles[i as usize].instance as usize].max(f64::MIN_POSITIVE);
    let least = order.iter().map(|&i| tolerance(i)).fold(f64::INFINITY, f64::min);
    let most = order.iter().map(|&i| tolerance(i)).fold(0.0, f64::max);
    if most <= RANGE * least {
        return vec![Level { tolerance: most, triangles: order }];
    }
    order.par_sort_by(|&a, &b| tolerance(a).total_cmp(&tolerance(b)));
    let of_range = order.chunk_by(|&a, &b| range_of(tolerance(a)) == range_of(tolerance(b)));
    of_range.map(|part| Level { tolerance: tolerance(part[part.len() - 1]), triangles: part.to_vec() }).collect()
}

/// Returns the number of the range that a tolerance is in.
fn range_of(tolerance: f64) -> i32 {
    (tolerance.log2() / RANGE.log2()).floor() as i32
}

/// Returns where each cube that both lists have is in them; both are in order.
fn common_cubes(there: &[Entry], sought: &[Entry]) -> Vec<(Range<usize>, Range<usize>)> {
    let mut common = Vec::new();
    let (mut b, mut a) = (0, 0);
    while b < there.len() && a < sought.len() {
        let (cube, other) = (there[b].cube, sought[a].cube);
        let end =
            |of: &[Entry], start: usize| start + of[start..].iter().take_while(|e| e.cube == of[start].cube).count();
        match cube.cmp(&other) {
            std::cmp::Ordering::Less => b = end(there, b),
            std::cmp::Ordering::Greater => a = end(sought, a),
            std::cmp::Ordering::Equal => {
                let ends = (end(there, b), end(sought, a));
                common.push((b..ends.0, a..ends.1));
                (b, a) = ends;
            }
        }
    }
    common
}

impl Entry {
    /// Of a triangle in its own cube; `at` is its centre over the width of a cube.
    fn new(index: u32, at: DVec3) -> Entry {
        let cube = at.floor();
        Entry { cube: hash(cube), x: (at.x - cube.x) as f32, index }
    }

    /// Of a triangle in the cube beside its own, beyond the closest side along each axis of `neighbour`; `None` if one of
    /// these sides is farther than `reach`.
    fn beside(index: u32, at: DVec3, neighbour: u32, reach: f64) -> Option<Entry> {
        let own = at.floor();
        let mut cube = own;
        for axis in (0..3).filter(|axis| neighbour >> axis & 1 == 1) {
            let inside = at[axis] - own[axis];
            cube[axis] += match inside {
                _ if inside <= reach => -1.0,
                _ if inside >= 1.0 - reach => 1.0,
                _ => return None,
            };
        }
        Some(Entry { cube: hash(cube), x: (at.x - cube.x) as f32, index })
    }

    fn order(a: &Entry, b: &Entry) -> std::cmp::Ordering {
        a.cube.cmp(&b.cube).then(a.x.total_cmp(&b.x)).then(a.index.cmp(&b.index))
    }
}

/// Mixes the coordinates of a cube (the finaliser of S. Vigna's SplitMix64).
fn hash(cube: DVec3) -> u64 {
    let mix = |x: u64| {
        let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    };
    // -0 and 0 are one cube.
    cube.to_array().into_iter().fold(0, |hash, x| mix(hash ^ mix((x + 0.0).to_bits())))
}

/// The places of a list that are not taken yet: a union-find structure over the next free one.
struct Free {
    next: Vec<u32>,
}

impl Free {
    fn new(count: usize) -> Free {
        Free { next: (0..=count as u32).collect() }
    }

    /// Returns the free places from `first` on, in order.
    fn from(&mut self, first: usize) -> impl Iterator<Item = usize> + '_ {
        let count = self.next.len() - 1;
        let mut at = first;
        std::iter::from_fn(move || {
            let found = self.find(at);
            at = found + 1;
            (found < count).then_some(found)
        })
    }

    fn take(&mut self, at: usize) {
        self.next[at] = at as u32 + 1;
    }

    fn find(&mut self, at: usize) -> usize {
        let mut root = at.min(self.next.len() - 1);
        while self.next[root] as usize != root {
            let next = self.next[root];
            self.next[root] = self.next[next as usize];
            root = next as usize;
        }
        root
    }
}
