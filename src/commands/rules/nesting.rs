//! RK017: nested instancing is flattened to two levels anyway (OptiX developer forum, thread 283898; Hart 2019).
//!
//! glTF nests instances by repeating nodes: an assembly is a node with at least two meshes below it whose whole subtree,
//! transforms included, occurs more than once. Each occurrence takes as many instances as the assembly has meshes.

use std::hash::Hasher;

use raykiln_formats::contents::Node;
use rustc_hash::{FxHashMap, FxHashSet, FxHasher};

use super::{Subject, moves};
use crate::cost::bytes;
use crate::report::{Broken, Finding, Objects};

/// Assemblies are reported if merging them saves this share of all instances.
const LEAST_SAVED: f64 = 0.05;

/// What is known of the subtree below a node.
#[derive(Clone, Copy, Default)]
struct Subtree {
    /// Equal for equal subtrees.
    hash: u64,
    /// Instances in it.
    instances: u64,
}

/// Finds assemblies that are placed more than once.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let Ok(hierarchy) = subject.doc.hierarchy() else { return Vec::new() };
    let nodes = &hierarchy.nodes;
    let roots = hierarchy.scenes.get(hierarchy.default).map_or(&[][..], |scene| scene.roots.as_slice());
    let order = depth_first(nodes, roots);
    let moving: FxHashSet<u32> = subject.scene.instances.iter().filter(|i| moves(i.pinned)).map(|i| i.node).collect();
    let subtrees = subtrees(nodes, &order, &moving);
    let mut occurrences: FxHashMap<u64, u64> = FxHashMap::default();
    let assembly = |n: usize| Some(subtrees[n]).filter(|subtree| subtree.instances > 1);
    order.iter().filter_map(|&n| assembly(n)).for_each(|subtree| *occurrences.entry(subtree.hash).or_default() += 1);
    let times = |n: usize| assembly(n).map_or(1, |subtree| occurrences[&subtree.hash]);

    let mut depths = vec![0_usize; nodes.len()];
    let (mut objects, mut saved, mut assemblies) = (Objects::default(), 0, FxHashSet::default());
    for &n in &order {
        let above = nodes[n].parent.filter(|_| !roots.contains(&n));
        let around = above.map_or(1, times);
        depths[n] = above.map_or(0, |p| depths[p]) + usize::from(times(n) > around);
        if times(n) > 1 && around == 1 {
            objects
                .add(|| nodes[n].name.clone().filter(|name| !name.is_empty()).unwrap_or_else(|| format!("node {n}")));
            assemblies.insert(subtrees[n].hash);
            saved += subtrees[n].instances - 1;
        }
    }
    let matters = saved as f64 >= LEAST_SAVED * subject.scene.instances.len() as f64;
    if objects.is_empty() || !matters {
        return Vec::new();
    }
    let depth = depths.iter().copied().max().unwrap_or(0);
    let size = saved * bytes::TLAS_BYTES_PER_INSTANCE;
    vec![Finding::new(objects, &Broken::Nested { assemblies: assemblies.len(), depth, saved, bytes: size })]
}

/// The nodes of a scene, parents before children.
fn depth_first(nodes: &[Node], roots: &[usize]) -> Vec<usize> {
    let mut stack: Vec<usize> = roots.iter().rev().copied().collect();
    let mut order = Vec::new();
    while let Some(n) = stack.pop() {
        order.push(n);
        stack.extend(nodes[n].children.iter().rev());
    }
    order
}

/// Summarises the subtrees of all nodes, from the leaves up.
fn subtrees(nodes: &[Node], order: &[usize], moving: &FxHashSet<u32>) -> Vec<Subtree> {
    let mut subtrees = vec![Subtree::default(); nodes.len()];
    for &n in order.iter().rev() {
        let node = &nodes[n];
        let mut hasher = FxHasher::default();
        hasher.write_usize(node.mesh.map_or(usize::MAX, |mesh| mesh));
        // What moves by design is like nothing else.
        hasher.write_usize(if moving.contains(&(n as u32)) || node.copies.is_some() { n } else { usize::MAX });
        let mut below: Vec<u64> =
            node.children.iter().map(|&child| placed_hash(&nodes[child], subtrees[child])).collect();
        below.sort_unstable();
        below.into_iter().for_each(|hash| hasher.write_u64(hash));
        let own = node.mesh.map_or(0, |_| node.copies.as_ref().map_or(1, |copies| copies.len() as u64));
        let instances = own + node.children.iter().map(|&child| subtrees[child].instances).sum::<u64>();
        subtrees[n] = Subtree { hash: hasher.finish(), instances };
    }
    subtrees
}

fn placed_hash(node: &Node, subtree: Subtree) -> u64 {
    let mut hasher = FxHasher::default();
    hasher.write_u64(subtree.hash);
    node.local.to_cols_array().iter().for_each(|c| hasher.write_u64(c.to_bits()));
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_with_triangle;
    use super::*;

    /// Nodes, of which the first is the root, that place two meshes.
    fn found(nodes: &str) -> Option<Finding> {
        let mesh = r#"{"primitives": [{"attributes": {"POSITION": 0}}]}"#;
        found_with_triangle(&format!(r#""nodes": [{nodes}], "meshes": [{mesh}, {mesh}]"#), check)
    }

    #[test]
    fn assemblies_placed_twice_are_found_with_the_instances_they_cost() {
        let nodes = r#"{"children": [1, 4]},
            {"name": "car", "children": [2, 3]}, {"mesh": 0}, {"mesh": 1, "translation": [1, 0, 0]},
            {"name": "other car", "translation": [9, 0, 0], "children": [5, 6]}, {"mesh": 1, "translation": [1, 0, 0]}, {"mesh": 0}"#;
        let finding = found(nodes).expect("a finding");
        assert_eq!(
            (finding.rule.id(), finding.objects.as_slice()),
            ("RK017", ["car".to_owned(), "other car".into()].as_slice())
        );
        assert_eq!(finding.message, "1 assembly of several meshes is placed 2 times");
        assert_eq!(finding.cost.bytes, Some(2 * bytes::TLAS_BYTES_PER_INSTANCE));
    }

    #[test]
    fn different_assemblies_and_single_meshes_are_left_alone() {
        let moved = r#"{"children": [1, 4]}, {"children": [2, 3]}, {"mesh": 0}, {"mesh": 1, "translation": [1, 0, 0]},
            {"children": [5, 6]}, {"mesh": 1, "translation": [2, 0, 0]}, {"mesh": 0}"#;
        assert_eq!(found(moved), None);
        assert_eq!(found(r#"{"children": [1, 2]}, {"mesh": 0}, {"mesh": 0, "translation": [1, 0, 0]}"#), None);
    }
}
