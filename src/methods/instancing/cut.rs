//! Cuts a mesh along a tree over its triangles: finely, or into parts of about equal triangle counts.
//!
//! Opening a tree from the top is from C. Benthin, S. Woop, I. Wald, A. Áfra, "Improved Two-Level BVHs using Partial
//! Re-Braiding", High Performance Graphics 2017: the node with the largest world box is always opened next.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DMat3;

use crate::cost::segments::Boxed;
use crate::scene::Bounds;

/// The cut of a tree that represents baked instances.
pub(super) struct Cuts {
    /// Its nodes, in ascending order.
    pub(super) finest: Vec<u32>,
}

impl Cuts {
    /// Cuts a non-empty tree into as many parts as wanted, or into all leaves. `placed` holds linear parts of instance
    /// transforms, under which the boxes of nodes are compared.
    pub(super) fn of(mesh: &Boxed, wanted: usize, placed: &[DMat3]) -> Cuts {
        let world = |node: u32, m: &DMat3| {
            Bounds { min: glam::DVec3::ZERO, max: m.abs() * mesh.bounds[node as usize].size() }.area()
        };
        // Areas are not negative, so their bits have the same order.
        Cuts { finest: cut(mesh, wanted, |node| placed.iter().map(|m| world(node, m)).sum::<f64>().to_bits()) }
    }

    /// Returns the triangles of as many parts as wanted, or of all leaves, with about equal triangle counts.
    pub(super) fn of_equal_parts(mesh: &Boxed, wanted: usize) -> Vec<Vec<u32>> {
        let triangles = mesh.tree.refit(|items| items.len() as u64, |a: &u64, b| a + b);
        let cut = cut(mesh, wanted, |node| triangles[node as usize]);
        cut.iter().map(|&root| triangles_below(mesh, root)).collect()
    }
}

/// Returns the nodes, in ascending order, of a cut that always opens the node of largest size; the first one wins ties.
fn cut(mesh: &Boxed, wanted: usize, size: impl Fn(u32) -> u64) -> Vec<u32> {
    let mut heap = BinaryHeap::from([(size(0), Reverse(0u32))]);
    let mut finest: Vec<u32> = Vec::new();
    while heap.len() + finest.len() < wanted {
        let Some((_, Reverse(node))) = heap.pop() else { break };
        let of = &mesh.tree.nodes[node as usize];
        if of.is_leaf() {
            finest.push(node);
        } else {
            heap.extend([of.first, of.first + 1].map(|child| (size(child), Reverse(child))));
        }
    }
    finest.extend(heap.into_iter().map(|(_, Reverse(node))| node));
    finest.sort_unstable();
    finest
}

/// Returns the triangles below a node, in ascending order.
pub(super) fn triangles_below(mesh: &Boxed, root: u32) -> Vec<u32> {
    let mut triangles = mesh.tree.order[mesh.tree.items_below(root)].to_vec();
    triangles.sort_unstable();
    triangles
}
