//! Signatures shared by copies regardless of order and motion: a key, and lengths in units of the mesh's size.

use std::hash::Hasher;

use glam::DVec3;
use raykiln_formats::Document;
use rustc_hash::{FxHashMap, FxHasher};

use super::fit::stretch;
use super::shape::{Shape, kind, mixed};
use super::{Likeness, Materials, Options};
use crate::parallel;
use crate::scene::{Geometry, Mesh, MeshId, Scene};

/// Number of order statistics of the corners' distances from their mean, and of the sides' lengths.
const RANKS: usize = 8;

/// The lengths that determine the bucket: the median and the largest distance, the median side.
const BUCKET_RANKS: [usize; 3] = [RANKS / 2, RANKS - 1, RANKS + RANKS / 2];

/// Relative rounding error of lengths computed in double precision.
const ROUNDING: f64 = 1e-9;

/// A vertex may deviate by the first share of a mesh's size, and if its coordinates are coarser, by more, up to the
/// second.
const OWN_SIZE: [f64; 2] = [1e-4, 1e-2];

/// Properties shared by all copies.
#[derive(Clone, Debug)]
pub(super) struct Signature {
    pub(super) mesh: MeshId,
    /// A hash of everything exact; equal for copies.
    pub(super) key: u64,
    /// The largest coordinate.
    pub(super) reach: f64,
    /// How far a vertex of a copy may deviate, in the coordinates of this mesh.
    pub(super) tolerance: f64,
    /// Lengths in units of the spread. If vertices move by at most `tolerance`, each changes by at most
    /// [`Signature::bar`].
    lengths: [f64; 2 * RANKS],
    relative_tolerance: f64,
}

/// Returns a hash of the number of triangles of each material and kind.
pub(super) fn coarse_key(mesh: &Mesh, materials: Materials) -> u64 {
    let of = |g: &Geometry| (g.triangles.len() as u64).wrapping_mul(kind(g, materials));
    mesh.geometries.iter().fold(0, |sum, g| of(g).wrapping_add(sum))
}

/// Returns the signatures of some meshes, in their order.
pub(super) fn of_all(doc: &Document, scene: &Scene, meshes: &[MeshId], options: &Options) -> Vec<Signature> {
    let limit = options.max_position_error_ratio * scene.bounds().diagonal();
    let mut stretches = vec![0.0_f64; scene.meshes.len()];
    for instance in &scene.instances {
        let most = &mut stretches[instance.mesh.0 as usize];
        *most = most.max(stretch(&instance.transform.matrix3));
    }
    let of = |&mesh: &MeshId| {
        let budget = limit / stretches[mesh.0 as usize];
        Signature::new(&Shape::new(doc, scene, mesh, options.materials), mesh, budget, options)
    };
    parallel::map_each(meshes, &of)
}

impl Signature {
    /// `budget` is how far a vertex may deviate, as allowed by the scene.
    fn new(shape: &Shape, mesh: MeshId, budget: f64, options: &Options) -> Signature {
        let points = shape.corners.as_flattened();
        let reach = points.iter().fold(0.0, |most: f64, p| most.max(p.abs().max_element()));
        let tolerance = match options.likeness {
            Likeness::Exact => 0.0,
            Likeness::Rigid => tolerance(shape, reach, budget, options.max_position_error_ratio),
        };
        let unit = shape.unit();
        let mut distances: Vec<f64> = points.iter().map(|p| shape.distance(*p)).collect();
        let mut sides: Vec<f64> = shape.corners.iter().flat_map(|c| sides(c).map(|s| s / unit)).collect();
        let mut lengths = [0.0; 2 * RANKS];
        order_statistics(&mut distances, &mut lengths[..RANKS]);
        order_statistics(&mut sides, &mut lengths[RANKS..]);
        Signature {
            mesh,
            key: key(shape, options.likeness),
            reach,
            tolerance,
            lengths,
            relative_tolerance: tolerance / unit,
        }
    }

    /// Returns how far one of the lengths of a copy may deviate.
    fn bar(&self, length: f64) -> f64 {
        bar(self.relative_tolerance, length)
    }

    /// Whether `copy` may be a copy of this mesh.
    pub(super) fn resembles(&self, copy: &Signature) -> bool {
        self.lengths.iter().zip(&copy.lengths).all(|(&a, &b)| (a - b).abs() <= copy.bar(b))
    }
}

/// Returns how far a length may deviate if vertices may deviate by `tolerance`, both in units of the spread.
pub(super) fn bar(tolerance: f64, length: f64) -> f64 {
    (4.0 * tolerance + ROUNDING) * (1.0 + length)
}

/// Returns the tolerance in mesh coordinates, with a margin for rounding errors of the check itself.
fn tolerance(shape: &Shape, reach: f64, budget: f64, ratio: f64) -> f64 {
    let corner = |pick: fn(DVec3, DVec3) -> DVec3| shape.corners.as_flattened().iter().copied().reduce(pick);
    let size = match (corner(DVec3::min), corner(DVec3::max)) {
        (Some(min), Some(max)) => min.distance(max),
        _ => 0.0,
    };
    if size == 0.0 || budget.is_nan() {
        return 0.0;
    }
    let own = if ratio.is_finite() { ratio * reach } else { f64::INFINITY };
    0.999 * budget.min(own.clamp(OWN_SIZE[0] * size, OWN_SIZE[1] * size))
}

/// Returns the lengths of a triangle's sides, each with the index of the opposite corner.
pub(super) fn sides([a, b, c]: &[DVec3; 3]) -> [f64; 3] {
    [b.distance(*c), c.distance(*a), a.distance(*b)]
}

/// Writes the values at evenly spaced ranks, including the smallest and the largest.
fn order_statistics(values: &mut [f64], out: &mut [f64]) {
    values.sort_unstable_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    let steps = out.len() - 1;
    for (rank, slot) in out.iter_mut().enumerate() {
        *slot = values.get(rank * last / steps).copied().unwrap_or(0.0);
    }
}

fn key(shape: &Shape, likeness: Likeness) -> u64 {
    let position = |p: &DVec3| {
        let mut hasher = FxHasher::default();
        // Adding zero turns -0 into 0.
        p.to_array().iter().for_each(|c| hasher.write_u64((c + 0.0).to_bits()));
        mixed(hasher.finish())
    };
    let triangles = shape.keys.iter().zip(&shape.corners).map(|(keys, corners)| {
        let corner = |(key, at): (&u64, &DVec3)| match likeness {
            Likeness::Exact => mixed(key ^ position(at)),
            Likeness::Rigid => *key,
        };
        mixed(keys.iter().zip(corners).map(corner).fold(0, u64::wrapping_add))
    });
    triangles.fold(mixed(shape.properties), u64::wrapping_add)
}

/// Signatures in a grid over three of their lengths, with cells as wide as the widest error bars.
pub(super) struct Buckets {
    cells: FxHashMap<[i64; 3], Vec<usize>>,
    widths: [f64; 3],
}

impl Buckets {
    pub(super) fn new(signatures: &[Signature]) -> Buckets {
        let width = |rank: usize| signatures.iter().map(|s| s.bar(s.lengths[rank])).fold(ROUNDING, f64::max);
        let mut buckets = Buckets { cells: FxHashMap::default(), widths: BUCKET_RANKS.map(width) };
        for (i, signature) in signatures.iter().enumerate() {
            buckets.cells.entry(buckets.cell(signature)).or_default().push(i);
        }
        buckets
    }

    fn cell(&self, signature: &Signature) -> [i64; 3] {
        std::array::from_fn(|i| (signature.lengths[BUCKET_RANKS[i]] / self.widths[i]) as i64)
    }

    /// Returns, in ascending order, the `wanted` ones among those within the error bars of a signature and some others
    /// nearby.
    pub(super) fn near(&self, signature: &Signature, wanted: impl Fn(usize) -> bool) -> Vec<usize> {
        let cell = self.cell(signature);
        let mut near = Vec::new();
        for offset in 0..27 {
            let at = [cell[0] + offset % 3 - 1, cell[1] + offset / 3 % 3 - 1, cell[2] + offset / 9 - 1];
            near.extend(self.cells.get(&at).into_iter().flatten().copied().filter(|&i| wanted(i)));
        }
        near.sort_unstable();
        near
    }
}
