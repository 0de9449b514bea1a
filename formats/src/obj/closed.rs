//! Which surfaces are closed, so that nobody sees them from behind.
//!
//! In a closed surface, each edge from one corner to the next has one in the opposite direction. Edges are not stored:
//! the hash of each is added and that of its opposite subtracted, and the sum is zero if all have one (or, for an open
//! surface, with a probability of 2^-64).

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::mesh::arities;
use super::scan::{Kind, Part};
use super::shift;

/// Whether each part belongs to a closed surface: by itself, with the parts of its group or with those of its object.
pub(super) fn closed(parts: &[Part], models: &[tobj::Mesh]) -> Vec<bool> {
    let sums: Vec<u64> = parts.par_iter().zip(models).map(|(part, model)| edges(part, model)).collect();
    let mut groups: FxHashMap<(Option<usize>, Option<usize>), u64> = FxHashMap::default();
    let mut objects: FxHashMap<Option<usize>, u64> = FxHashMap::default();
    for (part, &sum) in parts.iter().zip(&sums) {
        let group = groups.entry((part.object, part.group)).or_default();
        *group = group.wrapping_add(sum);
        let object = objects.entry(part.object).or_default();
        *object = object.wrapping_add(sum);
    }
    let is_closed =
        |part: &Part, sum: u64| sum == 0 || groups[&(part.object, part.group)] == 0 || objects[&part.object] == 0;
    parts.iter().zip(&sums).map(|(part, &sum)| is_closed(part, sum)).collect()
}

/// Sum over the edges of a part.
fn edges(part: &Part, mesh: &tobj::Mesh) -> u64 {
    if part.kind != Kind::Faces {
        return 0;
    }
    let corners: Vec<u64> = shift::positions(mesh).map(hash).collect();
    let (mut sum, mut start) = (0u64, 0);
    for count in arities(mesh) {
        let face = &mesh.indices[start..start + count];
        start += count;
        for at in 0..count {
            let (a, b) = (corners[face[at] as usize], corners[face[(at + 1) % count] as usize]);
            sum = sum.wrapping_add(directed(a, b)).wrapping_sub(directed(b, a));
        }
    }
    sum
}

fn hash(position: DVec3) -> u64 {
    // Adding 0 makes -0 equal to 0.
    let [x, y, z] = position.to_array().map(|x| (x + 0.0).to_bits());
    mixed(mixed(mixed(x).wrapping_add(y)).wrapping_add(z))
}

fn directed(a: u64, b: u64) -> u64 {
    mixed(a.wrapping_add(mixed(b ^ 0x9E37_79B9_7F4A_7C15)))
}

/// The finaliser of splitmix64 (G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number Generators", 2014).
fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
