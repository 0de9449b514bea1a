//! [`Regrouped`]: whether a file still has the BLAS groups of another.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::Sides;
use super::surface::pairs::Pairs;
use crate::scene::{Scene, TriangleRef};

/// Instances whose triangles are grouped otherwise in the output: how many, and the name of the first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Regrouped {
    /// Instances of the output with triangles of several of the input.
    pub merged: Option<(usize, String)>,
    /// Instances of the input whose triangles are in several of the output.
    pub split: Option<(usize, String)>,
    /// Meshes of the input that several instances share, in place of which the output has several meshes.
    pub unshared: Option<(usize, String)>,
}

impl Regrouped {
    /// Follows the triangles of both files that lie in the same places.
    pub fn of(scenes: Sides<&Scene>, pairs: &Pairs) -> Regrouped {
        let Sides { before, after } = scenes;
        let links = links(after, pairs);
        let (mut of_after, mut of_before) = (BTreeMap::new(), BTreeMap::new());
        let mut meshes: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
        for &[b, a] in &links {
            *of_after.entry(a).or_insert(0) += 1;
            *of_before.entry(b).or_insert(0) += 1;
            let mesh = before.instances[b as usize].mesh.0;
            meshes.entry(mesh).or_default().insert(after.instances[a as usize].mesh.0);
        }
        let several =
            |counts: BTreeMap<u32, usize>| counts.into_iter().filter(|(_, n)| *n > 1).map(|(i, _)| i).collect();
        let (merged, split): (Vec<u32>, Vec<u32>) = (several(of_after), several(of_before));
        let is_split = |mesh: u32| split.iter().any(|&i| before.instances[i as usize].mesh.0 == mesh);
        let unshared = meshes.iter().filter(|(mesh, now)| now.len() > 1 && !is_split(**mesh)).map(|(mesh, _)| *mesh);
        let named = |scene: &Scene, all: &[u32]| {
            let first = all.first().map(|&i| scene.instances[i as usize].display_name());
            first.map(|name| (all.len(), name))
        };
        let unshared: Vec<u32> = unshared.collect();
        let of_mesh = |mesh: u32| before.instances.iter().position(|i| i.mesh.0 == mesh).map(|i| i as u32);
        let placed: Vec<u32> = unshared.into_iter().filter_map(of_mesh).collect();
        Regrouped { merged: named(after, &merged), split: named(before, &split), unshared: named(before, &placed) }
    }

    /// Whether all groups are as they were.
    pub fn is_none(&self) -> bool {
        *self == Regrouped::default()
    }
}

/// Returns which instances of the input and the output have triangles in common.
fn links(after: &Scene, pairs: &Pairs) -> BTreeSet<[u32; 2]> {
    let of_instance = |a: u32| {
        let count = after.meshes[after.instances[a as usize].mesh.0 as usize].triangle_count() as u32;
        let mut found: Vec<[u32; 2]> = Vec::new();
        for triangle in 0..count {
            if let Some(pair) = pairs.get(TriangleRef { instance: a, triangle }) {
                let link = [pair.at.instance, a];
                if found.last() != Some(&link) {
                    found.push(link);
                }
            }
        }
        found
    };
    let all: Vec<[u32; 2]> = (0..after.instances.len() as u32).into_par_iter().flat_map_iter(of_instance).collect();
    all.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::MeshId;
    use crate::verify::identity::Identity;
    use crate::verify::surface;
    use crate::verify::test_scenes::room;
    use crate::verify::tests::baked;

    fn regrouped(before: &Scene, after: &Scene) -> Regrouped {
        let (_, pairs) = surface::compare(&Identity::new(before, after), 1e-6);
        Regrouped::of(Sides { before, after }, &pairs)
    }

    #[test]
    fn the_same_groups_are_the_same() {
        assert!(regrouped(&room(), &room()).is_none());
    }

    #[test]
    fn merged_and_split_groups_are_told_apart() {
        let (parts, whole) = (room(), baked(&room(), DAffine3::IDENTITY));
        let merged = regrouped(&parts, &whole);
        assert_eq!((merged.merged.map(|(n, _)| n), merged.split, merged.unshared), (Some(1), None, None));
        let split = regrouped(&whole, &parts);
        assert_eq!((split.merged, split.split.map(|(n, _)| n), split.unshared), (None, Some(1), None));
    }

    #[test]
    fn meshes_that_are_no_longer_shared_are_told() {
        let mut after = room();
        let copy = after.meshes[1].clone();
        after.meshes.push(copy);
        let last = after.meshes.len() as u32 - 1;
        after.instances[1].mesh = MeshId(last);
        let found = regrouped(&room(), &after);
        assert_eq!((found.merged, found.split, found.unshared.map(|(n, _)| n)), (None, None, Some(1)));
        assert!(regrouped(&after, &room()).is_none(), "sharing more is no loss");
    }
}
