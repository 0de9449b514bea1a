//! The exact part of verification: every placed triangle of the input is in the output, once, in its place.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::FaultKind;
use super::identity::{Chunk, Identity, chunks, describe};
use crate::scene::{InstanceId, Scene, TriangleRef};

/// Triangles with one kind of fault.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Fault {
    /// Number of triangles.
    pub count: u64,
    /// Description of the first of them.
    pub first: Option<String>,
}

/// Results of comparing two scenes triangle by triangle.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Structure {
    /// Number of triangles placed by the input's instances.
    pub triangles_before: u64,
    /// Number of triangles placed by the output's instances.
    pub triangles_after: u64,
    /// Triangles of the input that are not in the output.
    pub missing: Fault,
    /// Triangles of the input that the output has more than once; the first occurrence does not count.
    pub repeated: Fault,
    /// Triangles of the output that do not represent a triangle of the input.
    pub unknown: Fault,
    /// Triangles with another material than in the input.
    pub wrong_material: Fault,
    /// Triangles in their place that face the other way.
    pub flipped: Fault,
    /// Triangles with a corner farther from its place than allowed.
    pub moved: Fault,
    /// Largest distance of a corner from its place, in world units.
    pub max_position_error: f64,
    /// The same over the diagonal of the input's box (for a single point, over its distance from the origin).
    pub position_error_ratio: f64,
    /// The object of the input with the largest distance over the diagonal of its own box, and that ratio.
    #[serde(skip)]
    pub worst_object: Option<(InstanceId, f64)>,
    /// The largest distance of a corner of each instance of the output, in world units.
    #[serde(skip)]
    pub of_instances: Vec<f64>,
}

impl Structure {
    /// The faults, each with its kind.
    pub fn faults(&self) -> [(FaultKind, &Fault); 6] {
        [
            (FaultKind::Missing, &self.missing),
            (FaultKind::Repeated, &self.repeated),
            (FaultKind::Unknown, &self.unknown),
            (FaultKind::WrongMaterial, &self.wrong_material),
            (FaultKind::Flipped, &self.flipped),
            (FaultKind::Moved, &self.moved),
        ]
    }

    /// Whether there are no faults.
    pub fn is_clean(&self) -> bool {
        self.faults().iter().all(|(_, fault)| fault.count == 0)
    }
}

/// Compares two scenes triangle by triangle, in time linear in their number, using two bits of memory for each.
///
/// Corners may be listed in another order as long as the same side is the front; each may lie up to
/// `max_position_error_ratio` times the input's diagonal from its place, and by as much farther as the input as stored is
/// off ([`allowed_error`]). The place is that which the input's file gives. Instances with singular transforms, which no
/// ray can enter, are compared too.
pub fn compare(identity: &Identity, before: &Scene, after: &Scene, max_position_error_ratio: f64) -> Structure {
    let size = reference_length(before);
    let limit = allowed_error(before, max_position_error_ratio);
    let check = Check { identity, before, after, limit, seen: Seen::new(before) };
    let chunks = chunks(after);
    let tallies: Vec<Tally> = chunks.par_iter().map(|chunk| check.chunk(chunk)).collect();
    let mut of_instances = vec![0f64; after.instances.len()];
    for (chunk, tally) in chunks.iter().zip(&tallies) {
        let largest = &mut of_instances[chunk.instance as usize];
        *largest = largest.max(tally.max_error);
    }
    let all = tallies.into_iter().fold(Tally::default(), Tally::then);
    let words = |scene: &Scene, first: Option<TriangleRef>| first.map(|at| describe(scene, at));
    let in_after = |few: Few| Fault { count: few.count, first: words(after, few.first) };
    let in_before = |few: Few| Fault { count: few.count, first: words(before, few.first) };
    Structure {
        triangles_before: before.triangles_placed(),
        triangles_after: after.triangles_placed(),
        missing: in_before(check.seen.missing()),
        repeated: in_before(Few { count: all.repeated, first: check.seen.first_repeated() }),
        unknown: in_after(all.unknown),
        wrong_material: in_after(all.wrong_material),
        flipped: in_after(all.flipped),
        moved: in_after(all.moved),
        max_position_error: all.max_error.min(f64::MAX),
        position_error_ratio: if all.max_error > 0.0 { (all.max_error / size).min(f64::MAX) } else { 0.0 },
        worst_object: all.worst_object,
        of_instances,
    }
}

/// Returns the length that position errors are relative to: the diagonal of the scene's box, or its replacement.
pub fn reference_length(scene: &Scene) -> f64 {
    let bounds = scene.bounds();
    let from_origin = bounds.center().length();
    [bounds.diagonal(), from_origin].into_iter().find(|&length| length > 0.0).unwrap_or(1.0)
}

/// Returns how far a corner may lie from where the input's file has it, in world units. What the input itself stores
/// otherwise, no output can avoid.
pub fn allowed_error(before: &Scene, max_position_error_ratio: f64) -> f64 {
    max_position_error_ratio * reference_length(before) + before.largest_unavoidable_error()
}

struct Check<'a> {
    identity: &'a Identity<'a>,
    before: &'a Scene,
    after: &'a Scene,
    /// Largest allowed position error, in world units.
    limit: f64,
    seen: Seen,
}

/// A number of triangles and the first of them.
#[derive(Clone, Copy, Default)]
struct Few {
    count: u64,
    first: Option<TriangleRef>,
}

impl Few {
    fn add(&mut self, at: TriangleRef) {
        self.count += 1;
        self.first = self.first.or(Some(at));
    }

    fn then(self, later: Few) -> Few {
        Few { count: self.count + later.count, first: self.first.or(later.first) }
    }
}

/// Results for a range of triangles.
#[derive(Clone, Copy, Default)]
struct Tally {
    repeated: u64,
    unknown: Few,
    wrong_material: Few,
    flipped: Few,
    moved: Few,
    max_error: f64,
    /// As in [`Structure::worst_object`].
    worst_object: Option<(InstanceId, f64)>,
}

impl Tally {
    fn then(self, later: Tally) -> Tally {
        Tally {
            repeated: self.repeated + later.repeated,
            unknown: self.unknown.then(later.unknown),
            wrong_material: self.wrong_material.then(later.wrong_material),
            flipped: self.flipped.then(later.flipped),
            moved: self.moved.then(later.moved),
            max_error: self.max_error.max(later.max_error),
            worst_object: worse_object(self.worst_object, later.worst_object),
        }
    }
}

/// Returns the object with the larger ratio; the first of equal ones.
fn worse_object(a: Option<(InstanceId, f64)>, b: Option<(InstanceId, f64)>) -> Option<(InstanceId, f64)> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.1 > a.1 { b } else { a }),
        _ => a.or(b),
    }
}

impl Check<'_> {
    /// Returns a distance over the size of an object.
    fn of_object(&self, object: InstanceId, distance: f64) -> f64 {
        (distance / self.before.instance_boxes()[object.0 as usize].diagonal()).min(f64::MAX)
    }

    fn chunk(&self, chunk: &Chunk) -> Tally {
        let mut tally = Tally::default();
        let sources = self.identity.sources(chunk.instance, chunk.geometry, chunk.triangles.clone());
        let material = self.after.mesh_of(InstanceId(chunk.instance)).geometries[chunk.geometry].material;
        for (at, source) in chunk.refs(self.after).zip(sources) {
            let Some(source) = source else {
                tally.unknown.add(at);
                continue;
            };
            tally.repeated += u64::from(self.seen.mark(source));
            let (placed, original) = (self.after.world_corners(at), self.before.world_corners(source));
            let (error, same_side) = distance(&placed, &original);
            tally.max_error = tally.max_error.max(error);
            if error > 0.0 {
                let object = InstanceId(source.instance);
                tally.worst_object = worse_object(tally.worst_object, Some((object, self.of_object(object, error))));
            }
            if !same_side {
                tally.flipped.add(at);
            }
            if error > self.limit {
                tally.moved.add(at);
            }
            let mesh = self.before.mesh_of(InstanceId(source.instance));
            if material != mesh.geometries[mesh.locate(source.triangle).0].material {
                tally.wrong_material.add(at);
            }
        }
        tally
    }
}

/// Returns the distance of the farthest corner from its place, for the best assignment of corners, and whether that
/// assignment keeps the same side in front. If both sides fit about equally well, as in triangles no larger than the
/// error, the triangle does not count as flipped.
fn distance(placed: &[DVec3; 3], original: &[DVec3; 3]) -> (f64, bool) {
    let [a, b, c] = *placed;
    let farthest = |order: [DVec3; 3]| order.iter().zip(original).map(|(p, q)| p.distance(*q)).fold(0.0, worse);
    let same = [[a, b, c], [b, c, a], [c, a, b]].map(farthest).into_iter().fold(f64::INFINITY, f64::min);
    if same == 0.0 {
        return (0.0, true);
    }
    let flipped = [[a, c, b], [c, b, a], [b, a, c]].map(farthest).into_iter().fold(f64::INFINITY, f64::min);
    if flipped < 0.25 * same { (flipped, false) } else { (same, true) }
}

/// Returns the larger of two distances; NaN counts as infinitely far.
fn worse(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// The placed triangles of the input that were found, and those found more than once.
struct Seen {
    /// Bit index of each instance's first triangle.
    first: Vec<u64>,
    once: Vec<AtomicU64>,
    again: Vec<AtomicU64>,
    total: u64,
}

impl Seen {
    fn new(scene: &Scene) -> Seen {
        let mut total = 0;
        let mut first = Vec::with_capacity(scene.instances.len());
        for instance in &scene.instances {
            first.push(total);
            total += scene.meshes[instance.mesh.0 as usize].triangle_count() as u64;
        }
        let bits = || (0..total.div_ceil(64)).map(|_| AtomicU64::new(0)).collect();
        Seen { first, once: bits(), again: bits(), total }
    }

    /// Marks a triangle as found; returns whether it already was.
    fn mark(&self, at: TriangleRef) -> bool {
        let bit = self.first[at.instance as usize] + u64::from(at.triangle);
        let (word, mask) = ((bit / 64) as usize, 1 << (bit % 64));
        let repeated = self.once[word].fetch_or(mask, Ordering::Relaxed) & mask != 0;
        if repeated {
            self.again[word].fetch_or(mask, Ordering::Relaxed);
        }
        repeated
    }

    fn missing(&self) -> Few {
        let met: u64 = self.once.iter().map(|w| u64::from(w.load(Ordering::Relaxed).count_ones())).sum();
        let first = self.once.iter().enumerate().find_map(|(i, w)| lowest_bit(i, !w.load(Ordering::Relaxed)));
        Few { count: self.total - met, first: first.filter(|&bit| bit < self.total).map(|bit| self.triangle(bit)) }
    }

    fn first_repeated(&self) -> Option<TriangleRef> {
        let first = self.again.iter().enumerate().find_map(|(i, w)| lowest_bit(i, w.load(Ordering::Relaxed)));
        first.map(|bit| self.triangle(bit))
    }

    fn triangle(&self, bit: u64) -> TriangleRef {
        let instance = self.first.partition_point(|&first| first <= bit) - 1;
        TriangleRef { instance: instance as u32, triangle: (bit - self.first[instance]) as u32 }
    }
}

/// Returns the index of a word's lowest set bit within all words.
fn lowest_bit(word: usize, bits: u64) -> Option<u64> {
    (bits != 0).then(|| word as u64 * 64 + u64::from(bits.trailing_zeros()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    #[test]
    fn corners_may_be_rotated_but_not_exchanged() {
        let [a, b, c] = TRIANGLE;
        assert_eq!(distance(&[b, c, a], &TRIANGLE), (0.0, true));
        assert_eq!(distance(&[b, a, c], &TRIANGLE), (0.0, false));
    }

    #[test]
    fn a_triangle_of_two_equal_corners_has_no_side_to_turn() {
        let [a, b, _] = TRIANGLE;
        assert_eq!(distance(&[a, b, a], &[a, a, b]), (0.0, true));
        assert_eq!(distance(&[b, a, a], &[a, a, b]), (0.0, true));
    }

    #[test]
    fn what_is_no_number_is_infinitely_far() {
        let nan = [DVec3::NAN, DVec3::X, DVec3::Y];
        assert_eq!(distance(&nan, &TRIANGLE), (f64::INFINITY, true));
    }
}
