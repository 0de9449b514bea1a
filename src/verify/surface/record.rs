//! Follows what the output records about its triangles, and believes only what lies in its place.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::corners::fit;
use super::errors::{Largest, PositionErrors};
use super::limits::Limits;
use super::numbering::Numbering;
use super::pairs::{Pair, Pairs, PairsMut};
use crate::scene::{Scene, TriangleRef};
use crate::verify::Sides;
use crate::verify::identity::{Chunk, Identity, chunks};

/// A triangle of the output, and the one of the input that it records but that another one has already.
type Conflict = (TriangleRef, Pair);

/// What one thread found in a range of triangles.
struct Part {
    largest: Largest,
    conflicts: Vec<Conflict>,
}

/// Pairs each triangle of the output with the one that it records, or with the one of the same number, if that lies in
/// the same place. If several record the same one, the first gets it. Returns the triangles of the input that were left
/// over, too.
pub(super) fn follow(identity: &Identity, limits: &Limits) -> (Pairs, PositionErrors, Vec<TriangleRef>) {
    let (before, after) = identity.scenes();
    let scenes = Sides { before, after };
    let seen = Seen::new(before);
    let mut pairs = Pairs::none(after);
    let chunks = chunks(after);
    let counts = chunks.iter().map(|chunk| chunk.triangles.len());
    let parts: Vec<Part> = pairs
        .split(counts)
        .into_par_iter()
        .zip(&chunks)
        .map(|(pairs, chunk)| follow_chunk(identity, scenes, limits, &seen, chunk, pairs))
        .collect();
    let mut errors = PositionErrors::new(after);
    let mut conflicts = Vec::new();
    for (chunk, part) in chunks.iter().zip(parts) {
        errors.add(chunk.instance, part.largest);
        conflicts.extend(part.conflicts);
    }
    settle(&mut pairs, &conflicts);
    (pairs, errors, seen.missing())
}

fn follow_chunk(
    identity: &Identity,
    scenes: Sides<&Scene>,
    limits: &Limits,
    seen: &Seen,
    chunk: &Chunk,
    mut pairs: PairsMut,
) -> Part {
    let mut part = Part { largest: Largest::default(), conflicts: Vec::new() };
    let sources = identity.sources(chunk.instance, chunk.geometry, chunk.triangles.clone());
    for (i, (at, source)) in chunk.refs(scenes.after).zip(sources).enumerate() {
        let Some(source) = source else { continue };
        let fit = fit(&scenes.after.world_corners(at), &scenes.before.world_corners(source));
        if !fit.same_side || fit.error > limits.of(source.instance) {
            continue;
        }
        // Also of a conflict, as which of both comes first depends on the threads.
        part.largest = part.largest.or(limits, source.instance, fit.error);
        let pair = Pair { at: source, turn: fit.turn };
        match seen.mark(source) {
            true => part.conflicts.push((at, pair)),
            false => pairs.set(i, pair),
        }
    }
    part
}

/// Gives each triangle of the input that several of the output record to the first of them, which may be another than
/// the one that was fastest.
fn settle(pairs: &mut Pairs, conflicts: &[Conflict]) {
    let mut wanted: Vec<TriangleRef> = conflicts.iter().map(|(_, pair)| pair.at).collect();
    wanted.sort_unstable();
    wanted.dedup();
    let holders = pairs.find(&wanted);
    let mut first: HashMap<TriangleRef, (TriangleRef, Pair)> = HashMap::new();
    for (source, holder) in wanted.into_iter().zip(holders) {
        first.extend(holder.and_then(|at| Some((source, (at, pairs.get(at)?)))));
        holder.into_iter().for_each(|at| pairs.clear(at));
    }
    for &(at, pair) in conflicts {
        let best = first.entry(pair.at).or_insert((at, pair));
        if at < best.0 {
            *best = (at, pair);
        }
    }
    first.into_values().for_each(|(at, pair)| pairs.set(at, pair));
}

/// One bit for each placed triangle of the input.
struct Seen {
    numbering: Numbering,
    bits: Vec<AtomicU64>,
}

impl Seen {
    fn new(scene: &Scene) -> Seen {
        let numbering = Numbering::of(scene);
        let bits = (0..numbering.total().div_ceil(64)).map(|_| AtomicU64::new(0)).collect();
        Seen { numbering, bits }
    }

    /// Marks a triangle as found; returns whether it already was.
    fn mark(&self, at: TriangleRef) -> bool {
        let bit = self.numbering.index(at);
        let mask = 1 << (bit % 64);
        self.bits[bit / 64].fetch_or(mask, Ordering::Relaxed) & mask != 0
    }

    /// Returns the triangles that were not found, in order.
    fn missing(&self) -> Vec<TriangleRef> {
        let total = self.numbering.total();
        let of_word = |(word, bits): (usize, &AtomicU64)| {
            let bits = bits.load(Ordering::Relaxed);
            let unset = (0..64).filter(move |bit| bits >> bit & 1 == 0).map(move |bit| 64 * word + bit);
            unset.filter(|&bit| bit < total).map(|bit| self.numbering.triangle(bit))
        };
        let incomplete = self.bits.par_iter().enumerate().filter(|(_, bits)| bits.load(Ordering::Relaxed) != u64::MAX);
        incomplete.flat_map_iter(of_word).collect()
    }
}
