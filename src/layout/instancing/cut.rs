//! Cuts of a mesh into pieces, along a tree over its triangles.
//!
//! Opening an instance's tree from the top is C. Benthin, S. Woop, I. Wald, A. Áfra, "Improved Two-Level BVHs using
//! Partial Re-Braiding", High Performance Graphics 2017, done to the file: always the node whose world box is largest
//! is opened next. Other than there, all instances of a mesh are opened alike, so that they share the pieces.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DMat3;

use crate::cost::segments::Boxed;
use crate::scene::Bounds;

/// Nodes with fewer triangles are not opened for a piece.
const FEWEST_TRIANGLES: u32 = 16;

/// Cuts of one tree, each a refinement of the one before.
pub(super) struct Cuts {
    /// The nodes that are the roots of the pieces of each cut; the first cut is the root alone.
    pub(super) levels: Vec<Vec<u32>>,
    /// For every node the first cut that has it opened: from there on it is above all pieces. The number of cuts where
    /// none has.
    pub(super) opened_at: Vec<u8>,
}

impl Cuts {
    /// Cuts a tree that is not empty into as many pieces as each of `wanted` says, in ascending order; fewer where
    /// nodes are too small, except that the last cut may go down to the leaves. `placed` are linear parts of transforms by whose
    /// instances the boxes of nodes are compared.
    pub(super) fn of(mesh: &Boxed, wanted: &[usize], placed: &[DMat3]) -> Cuts {
        let triangles = mesh.tree.refit(|items| items.len() as u32, |a: &u32, b| a + b);
        let mut heap = BinaryHeap::from([Opening::new(mesh, 0, placed)]);
        let mut small: Vec<u32> = Vec::new();
        let mut cuts = Cuts { levels: vec![vec![0]], opened_at: vec![wanted.len() as u8 + 1; triangles.len()] };
        let levels = wanted.len();
        for (level, &wanted) in (1u8..).zip(wanted) {
            let finest = usize::from(level) == levels;
            let fewest = if finest { 0 } else { FEWEST_TRIANGLES };
            if finest {
                heap.extend(small.drain(..).map(|node| Opening::new(mesh, node, placed)));
            }
            while heap.len() + small.len() < wanted {
                let Some(Opening { node, .. }) = heap.pop() else { break };
                let of = &mesh.tree.nodes[node as usize];
                if of.is_leaf() || triangles[node as usize] < fewest {
                    small.push(node);
                    continue;
                }
                cuts.opened_at[node as usize] = level;
                heap.extend([of.first, of.first + 1].map(|child| Opening::new(mesh, child, placed)));
            }
            let mut roots: Vec<u32> = heap.iter().map(|o| o.node).chain(small.iter().copied()).collect();
            roots.sort_unstable();
            cuts.levels.push(roots);
        }
        cuts
    }

    /// The triangles of each piece of a cut, in ascending order.
    pub(super) fn pieces(&self, mesh: &Boxed, level: usize) -> Vec<Vec<u32>> {
        self.levels[level].iter().map(|&root| triangles_below(mesh, root)).collect()
    }
}

/// The triangles below a node, in ascending order.
pub(super) fn triangles_below(mesh: &Boxed, root: u32) -> Vec<u32> {
    let mut triangles = Vec::new();
    let mut stack = vec![root];
    while let Some(at) = stack.pop() {
        let node = &mesh.tree.nodes[at as usize];
        triangles.extend_from_slice(mesh.items(at as usize));
        if !node.is_leaf() {
            stack.extend([node.first, node.first + 1]);
        }
    }
    triangles.sort_unstable();
    triangles
}

/// A node that may be opened: largest first, then the first.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Opening {
    /// Bits of the area, which order as the numbers do, since it is not negative.
    area: u64,
    first: Reverse<u32>,
    node: u32,
}

impl Opening {
    fn new(mesh: &Boxed, node: u32, placed: &[DMat3]) -> Opening {
        let size = mesh.bounds[node as usize].size();
        let world = |m: &DMat3| Bounds { min: glam::DVec3::ZERO, max: m.abs() * size }.area();
        let area: f64 = placed.iter().map(world).sum();
        Opening { area: area.to_bits(), first: Reverse(node), node }
    }
}
