//! Triangles that hang together: connected components and objects.

use glam::Vec3;
use rustc_hash::FxHashMap;

use super::soup::Soup;

/// Triangles by connected component: those of one object that share corners, directly or through others. `None` where
/// that tells nothing: every object is one component, or hardly any triangle is connected.
pub(super) fn components(soup: &Soup) -> Option<Vec<Vec<u32>>> {
    let mut parts = Vec::new();
    for object in soup.objects.windows(2) {
        parts.extend(components_of(soup, object[0]..object[1]));
    }
    let useful = parts.len() > soup.objects.len() && 4 * parts.len() <= soup.len();
    useful.then_some(parts)
}

/// Triangles by object; `None` where there is one object or hardly any has two triangles.
pub(super) fn objects(soup: &Soup) -> Option<Vec<Vec<u32>>> {
    let objects: Vec<Vec<u32>> =
        soup.objects.windows(2).map(|o| (o[0]..o[1]).collect::<Vec<u32>>()).filter(|o| !o.is_empty()).collect();
    (objects.len() > 1 && 4 * objects.len() <= soup.len()).then_some(objects)
}

/// The components of some triangles, in the order of their first triangles.
fn components_of(soup: &Soup, triangles: std::ops::Range<u32>) -> Vec<Vec<u32>> {
    let first = triangles.start;
    let mut parents: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut owners: FxHashMap<[u32; 3], u32> = FxHashMap::default();
    for t in 0..triangles.len() as u32 {
        for &corner in soup.stored(first + t) {
            let owner = *owners.entry(key(corner)).or_insert(t);
            let (a, b) = (root(&mut parents, owner), root(&mut parents, t));
            parents[a.max(b) as usize] = a.min(b);
        }
    }
    let mut parts: Vec<Vec<u32>> = Vec::new();
    let mut numbers = vec![0u32; parents.len()];
    for t in 0..parents.len() as u32 {
        let root = root(&mut parents, t);
        if root == t {
            numbers[t as usize] = parts.len() as u32;
            parts.push(Vec::new());
        }
        parts[numbers[root as usize] as usize].push(first + t);
    }
    parts
}

/// The bits of a position, of both zeros the same.
fn key(position: Vec3) -> [u32; 3] {
    (position + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// The smallest member of a set (R. Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", 1975), halving
/// the path to it.
fn root(parents: &mut [u32], mut at: u32) -> u32 {
    while parents[at as usize] != at {
        parents[at as usize] = parents[parents[at as usize] as usize];
        at = parents[at as usize];
    }
    at
}
