//! Multithreaded tree construction by clustering and reinsertion.
//!
//! Combines the parts of obvhs as `obvhs::bvh2::builder::build_bvh2` does (D. Meister, J. Bittner, "Parallel
//! Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", IEEE TVCG 24(3), 2018; "Parallel Reinsertion
//! for Bounding Volume Hierarchy Optimization", Computer Graphics Forum 37(2), 2018), with two differences: very large
//! inputs are clustered in parts, and reinsertions are searched in parallel but applied in a fixed order, so that equal
//! input gives an equal tree for any number of threads.

use std::time::Duration;

use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::{Reinsertion, find_reinsertion, reinsert_node};
use obvhs::bvh2::{Bvh2, DEFAULT_MAX_STACK_DEPTH};
use obvhs::ploc::PlocBuilder;
use rayon::prelude::*;

use super::Boxed;
use super::divide::divide;
use crate::scene::Bounds;

/// Fewer boxes than this are built on one thread.
const FEW: usize = 1 << 14;

/// More boxes than this are clustered in parts, each of which temporarily takes about 150 bytes per box. For scenes of
/// 200,000 to 1,000,000 triangles, tree cost then differs from clustering as a whole by up to 1.3 % in either
/// direction; with parts a quarter of this size, it is up to 7 % higher.
const PART: usize = 1 << 17;

/// Minimum number of candidates per parallel task.
const AT_ONCE: usize = 64;

/// Builds the tree over `count` boxes within the unit cube; box `i` is `boxed(i)`, which is computed several times.
pub(super) fn build(count: usize, boxed: &(dyn Fn(u32) -> Boxed + Sync), params: &BvhBuildParams) -> Bvh2 {
    match count < FEW {
        true => build_bvh2(&(0..count as u32).map(boxed).collect::<Vec<_>>(), *params, &mut Duration::default()),
        false => in_parts(count, boxed, params, PART),
    }
}

fn in_parts(count: usize, boxed: &(dyn Fn(u32) -> Boxed + Sync), params: &BvhBuildParams, largest: usize) -> Bvh2 {
    let (top, parts) = clustered(count, boxed, params, largest);
    let mut bvh = joined(top, parts);
    reinsert(&mut bvh, params.reinsertion_batch_ratio);
    collapse(&mut bvh, params.max_prims_per_leaf, params.collapse_traversal_cost);
    reinsert(&mut bvh, params.reinsertion_batch_ratio * params.post_collapse_reinsertion_batch_ratio_multiplier);
    bvh
}

/// Clusters parts of at most `largest` boxes into trees with one box per leaf, without reinsertion, and builds the tree
/// over the parts.
fn clustered(
    count: usize,
    boxed: &(dyn Fn(u32) -> Boxed + Sync),
    params: &BvhBuildParams,
    largest: usize,
) -> (Bvh2, Vec<Part>) {
    let bounds = |i: u32| {
        let Aabb { min, max } = boxed(i).0;
        Bounds { min: min.as_dvec3(), max: max.as_dvec3() }
    };
    let leaf = |part: Vec<u32>| {
        let of_part: Vec<Boxed> = part.iter().map(|&i| boxed(i)).collect();
        vec![Part { bvh: cluster(&of_part, params), items: part }]
    };
    let join = |mut left: Vec<Part>, right: Vec<Part>| {
        left.extend(right);
        left
    };
    let parts = divide((0..count as u32).collect(), largest, &bounds, &leaf, &join);
    let roots: Vec<Boxed> = parts.iter().map(|part| Boxed(*part.bvh.nodes[0].aabb())).collect();
    (cluster(&roots, params), parts)
}

fn cluster(boxes: &[Boxed], params: &BvhBuildParams) -> Bvh2 {
    let (distance, threshold) = (params.ploc_search_distance, params.search_depth_threshold);
    let items = (0..boxes.len() as u32).collect();
    PlocBuilder::with_capacity(boxes.len()).build(distance, boxes, items, params.sort_precision, threshold)
}

/// A tree over some of the boxes.
struct Part {
    bvh: Bvh2,
    /// The boxes, in the order in which the tree numbers them.
    items: Vec<u32>,
}

/// Merges the trees of parts and the tree over them into one. Pairs of siblings near the roots come first for all
/// parts, because reinsertion starts there.
fn joined(top: Bvh2, parts: Vec<Part>) -> Bvh2 {
    let pairs: Vec<usize> = parts.iter().map(|part| part.bvh.nodes.len() / 2).collect();
    let first_pair = top.nodes.len();
    let mut nodes = top.nodes;
    let is_root = |node: &Bvh2Node| node.is_leaf().then_some(node.first_index as usize);
    let mut root_of = vec![0; parts.len()];
    nodes.iter().enumerate().for_each(|(at, node)| is_root(node).into_iter().for_each(|part| root_of[part] = at));
    nodes.resize(first_pair + 2 * pairs.iter().sum::<usize>(), Bvh2Node::default());
    let mut primitive_indices: Vec<u32> = Vec::with_capacity(parts.iter().map(|part| part.items.len()).sum());
    for (p, Part { bvh, items }) in parts.into_iter().enumerate() {
        let at = |pair: usize| first_pair + 2 * turn(&pairs, p, pair);
        let moved = |node: &Bvh2Node| {
            let first_index = match node.is_leaf() {
                true => node.first_index + primitive_indices.len() as u32,
                false => at(node.first_index as usize / 2) as u32,
            };
            Bvh2Node { first_index, ..*node }
        };
        nodes[root_of[p]] = moved(&bvh.nodes[0]);
        for (pair, two) in bvh.nodes[1..].chunks_exact(2).enumerate() {
            let to = at(pair);
            nodes[to..to + 2].copy_from_slice(&[moved(&two[0]), moved(&two[1])]);
        }
        primitive_indices.extend(items);
    }
    let max_depth = depth(&nodes).max(DEFAULT_MAX_STACK_DEPTH);
    Bvh2 { nodes, primitive_indices, max_depth, ..Bvh2::default() }
}

/// Returns the position of a pair of a part when the pairs of all parts are interleaved evenly; `pairs` holds the
/// number of pairs per part. Pairs are ordered by their index divided by the number of pairs of their part, ties by
/// part.
fn turn(pairs: &[usize], part: usize, pair: usize) -> usize {
    let before = |(p, &count): (usize, &usize)| match p < part {
        // Counts pairs with index / count <= pair / pairs[part]; below, with a strict comparison.
        true => (pair * count / pairs[part] + 1).min(count),
        false => (pair * count).div_ceil(pairs[part]),
    };
    pairs.iter().enumerate().map(before).sum()
}

/// Returns the number of nodes on the longest path from the root; children must come after their parents.
fn depth(nodes: &[Bvh2Node]) -> usize {
    let mut depths = vec![1u32; nodes.len()];
    for (at, node) in nodes.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
        let (child, below) = (node.first_index as usize, depths[at] + 1);
        depths[child..child + 2].fill(below);
    }
    depths.into_iter().max().unwrap_or(0) as usize
}

/// Moves nodes to where they increase the areas of their ancestors less: first many, then ever fewer near the root.
fn reinsert(bvh: &mut Bvh2, batch_ratio: f32) {
    if batch_ratio <= 0.0 || bvh.nodes.first().is_none_or(Bvh2Node::is_leaf) {
        return;
    }
    bvh.init_parents_if_uninit();
    bvh.children_are_ordered_after_parents = false;
    let mut touched = vec![false; bvh.nodes.len()];
    for share in (1..32).step_by(2) {
        let batch = (bvh.nodes.len() as f32 * batch_ratio / share as f32) as usize;
        let found = reinsertions(bvh, batch.clamp(1, bvh.nodes.len() - 1));
        touched.fill(false);
        for Reinsertion { from, to, .. } in found {
            let (from, to) = (from as usize, to as usize);
            let parent = |of: usize| bvh.parents[of] as usize;
            let involved = [to, from, Bvh2Node::get_sibling_id(from), parent(to), parent(from)];
            if !involved.iter().any(|&i| touched[i]) {
                involved.iter().for_each(|&i| touched[i] = true);
                reinsert_node(bvh, from, to);
            }
        }
    }
}

/// Returns the worthwhile reinsertions among the largest nodes, best first.
fn reinsertions(bvh: &Bvh2, batch: usize) -> Vec<Reinsertion> {
    let area = |node: u32| bvh.nodes[node as usize].aabb().half_area();
    let last = (2 * (batch + 1)).min(bvh.nodes.len()) as u32;
    let mut candidates: Vec<(f32, u32)> = (1..last).map(|node| (area(node), node)).collect();
    candidates.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    candidates.truncate(batch);
    let find = |&(_, node): &(f32, u32)| find_reinsertion(bvh, node as usize);
    let mut found: Vec<Reinsertion> =
        candidates.par_iter().with_min_len(AT_ONCE).map(find).filter(|found| found.area_diff > 0.0).collect();
    found.par_sort_unstable_by(|a, b| b.area_diff.total_cmp(&a.area_diff).then(a.from.cmp(&b.from)));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3A;

    /// Boxes of very different sizes within the unit cube.
    fn boxes(count: u32) -> Vec<Boxed> {
        let noise = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32;
        let one = |i: u32| {
            let min = Vec3A::new(noise(3 * i), noise(3 * i + 1), noise(3 * i + 2)) - 0.5;
            Boxed(Aabb::new(min, min + Vec3A::new(0.02, 0.001, 0.3 * noise(7 * i).powi(20))))
        };
        (0..count).map(one).collect()
    }

    fn of(boxes: &[Boxed]) -> impl Fn(u32) -> Boxed + Sync {
        |i| boxes[i as usize]
    }

    fn cost(bvh: &Bvh2) -> f32 {
        bvh.nodes.iter().map(|n| n.aabb().half_area() * n.prim_count.max(1) as f32).sum()
    }

    #[test]
    fn trees_in_parts_are_as_good_as_those_in_one_and_whole() {
        let (boxes, params) = (boxes(20_000), BvhBuildParams::medium_build());
        let whole = cost(&build_bvh2(&boxes, params, &mut Duration::default()));
        for largest in [3000, 20_000] {
            let bvh = in_parts(boxes.len(), &of(&boxes), &params, largest);
            bvh.validate(&boxes, false, false);
            let mut items = bvh.primitive_indices.clone();
            items.sort_unstable();
            assert!(items.into_iter().eq(0..20_000));
            assert!(cost(&bvh) < 1.05 * whole, "{} for {whole}", cost(&bvh));
        }
    }

    #[test]
    fn every_pair_has_its_own_turn() {
        let pairs = [5, 0, 12, 1, 5];
        let turns = |p: usize| (0..pairs[p]).map(|pair| turn(&pairs, p, pair)).collect::<Vec<_>>();
        let of_parts: Vec<Vec<usize>> = (0..pairs.len()).map(turns).collect();
        assert!(of_parts.iter().all(|turns| turns.is_sorted()));
        let mut all = of_parts.concat();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..23));
        assert_eq!(of_parts[0][0], 0);
    }

    #[test]
    fn trees_are_the_same_for_any_number_of_threads() {
        let (boxes, params) = (boxes(20_000), BvhBuildParams::medium_build());
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let bvh = pool.install(|| in_parts(boxes.len(), &of(&boxes), &params, 3000));
            let nodes = bvh.nodes.iter().map(|n| (n.min.to_array(), n.max.to_array(), n.prim_count, n.first_index));
            (nodes.collect::<Vec<_>>(), bvh.primitive_indices)
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn equal_boxes_are_divided_all_the_same() {
        let equal = vec![boxes(1)[0]; 1000];
        let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
        let bvh = in_parts(equal.len(), &of(&equal), &params, 300);
        bvh.validate(&equal, false, false);
        assert_eq!(bvh.nodes.len(), 1999);
    }
}
