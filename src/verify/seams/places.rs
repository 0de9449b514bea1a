//! Finds edges and vertices at which the surface of a scene is closed.
//!
//! Corners are the same if their world positions are, in double precision, bit for bit, whatever object they belong to.
//! Edges and vertices of random triangles are drawn first; then one pass over all placed triangles finds those that meet
//! there. It takes time linear in the triangles and memory linear in the number drawn, at most [`MOST_TRIANGLES`] times.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::scene::{Instance, InstanceId, Scene, TriangleRef, position_key};
use crate::verify::identity::{Chunk, chunks};
use crate::verify::random::Random;

/// Places where more triangles meet are left out.
pub(super) const MOST_TRIANGLES: u32 = 64;
/// Number of edges and vertices drawn for each place wanted: scenes have fewer between objects than inside them.
const DRAWN_PER_PLACE: usize = 2;
/// Largest number drawn: they are held in memory, and each may be aimed at by many rays.
const MOST_DRAWN: usize = 1 << 18;
/// One of so many places drawn is a vertex, the others are edges.
const PLACES_PER_VERTEX: usize = 4;
/// Random number stream of the places drawn, separate from those of the rays.
const STREAM: u64 = 110;

/// An edge or a vertex, surrounded by triangles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) core: Core,
    /// The outline of the triangles around it. Counter-clockwise, seen from in front of the first triangle.
    pub(super) ring: Vec<DVec3>,
    /// The triangles; of several with the same corners, the first.
    pub(super) triangles: Vec<TriangleRef>,
}

impl Place {
    /// Returns the vertex, or the point at a share of the way along the edge.
    pub(super) fn target(&self, share: f64) -> DVec3 {
        match self.core {
            Core::Edge([a, b]) => a + share * (b - a),
            Core::Vertex(at) => at,
        }
    }
}

/// World positions of an edge's ends or of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Core {
    Edge([DVec3; 2]),
    Vertex(DVec3),
}

/// Finds about `count` places or more, fewer if the scene has fewer. A place is an edge with one triangle on either side,
/// or a vertex with one circle of triangles around it; triangles with the same corners count as one.
pub(super) fn find(scene: &Scene, count: usize, seed: u64) -> Vec<Place> {
    let drawn = Drawn::new(scene, (DRAWN_PER_PLACE * count).min(MOST_DRAWN), seed);
    let met = drawn.meetings(scene);
    let place = |met: &[(u32, TriangleRef)]| drawn.place(scene, met);
    met.par_chunk_by(|a, b| a.0 == b.0).filter_map(place).collect()
}

/// Hashes of the positions of an edge's ends, in order, or of a vertex.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Key {
    Edge([u64; 2]),
    Vertex(u64),
}

impl Key {
    fn edge(a: u64, b: u64) -> Key {
        Key::Edge([a.min(b), a.max(b)])
    }
}

/// A set of hashes that answers quickly for most that are not in it.
struct Sieve(Vec<u64>);

impl Sieve {
    const BITS: u32 = 22;

    fn new(hashes: impl Iterator<Item = u64>) -> Sieve {
        let mut words = vec![0; 1 << (Sieve::BITS - 6)];
        for hash in hashes {
            let (word, mask) = Sieve::bit(hash);
            words[word] |= mask;
        }
        Sieve(words)
    }

    fn may_contain(&self, hash: u64) -> bool {
        let (word, mask) = Sieve::bit(hash);
        self.0[word] & mask != 0
    }

    fn bit(hash: u64) -> (usize, u64) {
        let bit = hash >> (64 - Sieve::BITS);
        ((bit / 64) as usize, 1 << (bit % 64))
    }
}

/// Edges and vertices of random triangles.
struct Drawn {
    cores: Vec<Core>,
    numbers: FxHashMap<Key, u32>,
    sieve: Sieve,
}

impl Drawn {
    /// Draws edges and vertices, each placed triangle being equally likely. Instances that no ray can enter have none.
    fn new(scene: &Scene, count: usize, seed: u64) -> Drawn {
        let mut total = 0;
        let mut ends = Vec::with_capacity(scene.instances.len());
        for (i, instance) in (0..).zip(&scene.instances) {
            let triangles = scene.mesh_of(InstanceId(i)).triangle_count() as u64;
            total += if can_be_entered(instance) { triangles } else { 0 };
            ends.push(total);
        }
        let draw = |i| {
            let mut random = Random::at(seed, STREAM, i);
            let triangle = random.below(total);
            let instance = ends.partition_point(|&end| end <= triangle);
            let first = if instance == 0 { 0 } else { ends[instance - 1] };
            let at = TriangleRef { instance: instance as u32, triangle: (triangle - first) as u32 };
            let (corners, k) = (scene.world_corners(at), random.below(3) as usize);
            match i % PLACES_PER_VERTEX {
                0 => Core::Vertex(corners[k]),
                _ => Core::Edge([corners[k], corners[(k + 1) % 3]]),
            }
        };
        let all: Vec<Core> = (0..if total == 0 { 0 } else { count }).into_par_iter().map(draw).collect();
        let (mut cores, mut numbers) = (Vec::new(), FxHashMap::default());
        for core in all {
            numbers.entry(core.key()).or_insert_with(|| {
                cores.push(core);
                cores.len() as u32 - 1
            });
        }
        let hashes = numbers.keys().flat_map(|key| match *key {
            Key::Edge(ends) => ends,
            Key::Vertex(at) => [at; 2],
        });
        let sieve = Sieve::new(hashes);
        Drawn { cores, numbers, sieve }
    }

    /// Returns the triangles that meet at each edge and vertex drawn, in order; none where too many meet.
    fn meetings(&self, scene: &Scene) -> Vec<(u32, TriangleRef)> {
        let counts: Vec<AtomicU32> = self.cores.iter().map(|_| AtomicU32::new(0)).collect();
        if counts.is_empty() {
            return Vec::new();
        }
        let in_chunk = |chunk: &Chunk| self.meetings_in(scene, chunk, &counts);
        let mut met: Vec<_> = chunks(scene).par_iter().map(in_chunk).flatten_iter().collect();
        met.retain(|&(number, _)| counts[number as usize].load(Ordering::Relaxed) <= MOST_TRIANGLES);
        met.par_sort_unstable();
        met
    }

    fn meetings_in(&self, scene: &Scene, chunk: &Chunk, counts: &[AtomicU32]) -> Vec<(u32, TriangleRef)> {
        let instance = &scene.instances[chunk.instance as usize];
        let mut met = Vec::new();
        if !can_be_entered(instance) {
            return met;
        }
        let geometry = &scene.mesh_of(InstanceId(chunk.instance)).geometries[chunk.geometry];
        let world = |p: DVec3| instance.transform.transform_point3(p);
        for (t, at) in chunk.triangles.clone().zip(chunk.refs(scene)) {
            let hashes = geometry.exact_corners(t).map(|p| position_key(world(p)));
            let maybe = hashes.map(|hash| self.sieve.may_contain(hash));
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let keys = [
                    maybe[i].then_some(Key::Vertex(hashes[i])),
                    (maybe[i] && maybe[j]).then(|| Key::edge(hashes[i], hashes[j])),
                ];
                let numbers = keys.into_iter().flatten().filter_map(|key| self.numbers.get(&key).copied());
                // Beyond the limit a place is left out, so that it does not matter which triangles it keeps.
                let within = |n: &u32| counts[*n as usize].fetch_add(1, Ordering::Relaxed) < MOST_TRIANGLES;
                met.extend(numbers.filter(within).map(|number| (number, at)));
            }
        }
        met
    }

    /// Returns the place at which these triangles meet, if the surface is closed there.
    fn place(&self, scene: &Scene, met: &[(u32, TriangleRef)]) -> Option<Place> {
        let triangles = met.iter().map(|&(_, at)| (at, scene.world_corners(at)));
        match self.cores[met[0].0 as usize] {
            Core::Edge(ends) => edge(ends, triangles),
            Core::Vertex(at) => vertex(at, triangles),
        }
    }
}

impl Core {
    fn key(&self) -> Key {
        match *self {
            Core::Edge([a, b]) => Key::edge(position_key(a), position_key(b)),
            Core::Vertex(at) => Key::Vertex(position_key(at)),
        }
    }
}

/// Whether rays can be transformed into the mesh of an instance.
fn can_be_entered(instance: &Instance) -> bool {
    instance.transform.matrix3.determinant() != 0.0 && instance.transform.inverse().is_finite()
}

/// Returns the place of an edge with one triangle on either side.
fn edge(ends: [DVec3; 2], triangles: impl Iterator<Item = (TriangleRef, [DVec3; 3])>) -> Option<Place> {
    let mut sides: Vec<(DVec3, TriangleRef, bool)> = Vec::new();
    for (at, corners) in triangles {
        let Some((tip, is_along)) = beside(ends, &corners) else { continue };
        if sides.iter().all(|side| side.0 != tip) {
            sides.push((tip, at, is_along));
        }
    }
    let [(left, first, is_along), (right, second, _)] = sides[..] else { return None };
    let [a, b] = if is_along { ends } else { [ends[1], ends[0]] };
    Some(Place { core: Core::Edge([a, b]), ring: vec![b, left, a, right], triangles: vec![first, second] })
}

/// Returns a triangle's corner beside one of its edges, and whether the edge runs from the first end to the second.
fn beside([a, b]: [DVec3; 2], corners: &[DVec3; 3]) -> Option<(DVec3, bool)> {
    let sides = [(0, 1, 2), (1, 2, 0), (2, 0, 1)].map(|(i, j, k)| (corners[i], corners[j], corners[k]));
    let side = sides.into_iter().find(|&(p, q, _)| (p, q) == (a, b) || (p, q) == (b, a))?;
    (side.2 != a && side.2 != b && a != b).then_some((side.2, side.0 == a))
}

/// Returns the place of a vertex with one circle of triangles around it.
fn vertex(at: DVec3, triangles: impl Iterator<Item = (TriangleRef, [DVec3; 3])>) -> Option<Place> {
    let mut rest: Vec<([DVec3; 2], TriangleRef)> = Vec::new();
    for (triangle, [a, b, c]) in triangles {
        let Some([p, q]) = [[a, b, c], [b, c, a], [c, a, b]].into_iter().find(|t| t[0] == at).map(|t| [t[1], t[2]])
        else {
            continue;
        };
        let is_degenerate = p == q || p == at || q == at;
        if !is_degenerate && rest.iter().all(|&(other, _)| other != [p, q] && other != [q, p]) {
            rest.push(([p, q], triangle));
        }
    }
    if rest.is_empty() {
        return None;
    }
    let ([start, mut next], first) = rest.remove(0);
    let (mut ring, mut around) = (vec![start], vec![first]);
    while next != start {
        let mut with = rest.iter().enumerate().filter(|(_, (ends, _))| ends.contains(&next)).map(|(i, _)| i);
        let (Some(one), None) = (with.next(), with.next()) else { return None };
        let ([p, q], triangle) = rest.swap_remove(one);
        ring.push(next);
        around.push(triangle);
        next = if p == next { q } else { p };
    }
    rest.is_empty().then_some(Place { core: Core::Vertex(at), ring, triangles: around })
}
