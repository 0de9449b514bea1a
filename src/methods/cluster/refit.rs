//! The cost of a part of a tree in another frame.

use crate::cost::sah::{INTERSECTION, TRAVERSAL};
use crate::scene::Bounds;
use crate::tree::Tree;

/// Refits parts of a tree; reuses its memory between them.
#[derive(Default)]
pub(super) struct Refit {
    /// Nodes of the part, parents first, each with the index of its parent.
    nodes: Vec<(u32, u32)>,
    bounds: Vec<Bounds>,
}

/// Box and cost of a part of a tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fitted {
    /// The box of its root.
    pub(super) bounds: Bounds,
    /// C_t times the areas of inner nodes plus C_i times those of leaves, each counted once per item in it.
    pub(super) cost: f64,
}

impl Refit {
    /// Refits the part of a tree below `root` to the given boxes of its items.
    pub(super) fn part(&mut self, tree: &Tree, root: u32, item: impl Fn(u32) -> Bounds) -> Fitted {
        self.collect(tree, root);
        self.bounds.clear();
        self.bounds.resize(self.nodes.len(), Bounds::EMPTY);
        let mut cost = 0.0;
        for at in (0..self.nodes.len()).rev() {
            let (node, parent) = self.nodes[at];
            let node = &tree.nodes[node as usize];
            let price = if node.is_leaf() {
                let items = &tree.order[node.items()];
                self.bounds[at] = items.iter().fold(Bounds::EMPTY, |all, &i| all.union(&item(i)));
                INTERSECTION * f64::from(node.count)
            } else {
                TRAVERSAL
            };
            cost += price * self.bounds[at].area();
            if at > 0 {
                self.bounds[parent as usize] = self.bounds[parent as usize].union(&self.bounds[at]);
            }
        }
        Fitted { bounds: self.bounds[0], cost }
    }

    fn collect(&mut self, tree: &Tree, root: u32) {
        self.nodes.clear();
        self.nodes.push((root, 0));
        let mut at = 0;
        while at < self.nodes.len() {
            let node = &tree.nodes[self.nodes[at].0 as usize];
            if !node.is_leaf() {
                self.nodes.extend([(node.first, at as u32), (node.first + 1, at as u32)]);
            }
            at += 1;
        }
    }
}
