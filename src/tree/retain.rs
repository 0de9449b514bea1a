//! Removes items from trees without rebuilding them.

use super::{Node, Tree};

impl Tree {
    /// Returns the tree without some items: nodes without items are removed, and nodes left with one child are replaced
    /// by that child. Also returns, for each node of the new tree, the node of this tree with the same items; `None` if
    /// items below were removed.
    pub fn retaining(&self, stays: impl Fn(u32) -> bool) -> (Tree, Vec<Option<u32>>) {
        let count = |items: &[u32]| [items.iter().filter(|&&i| stays(i)).count() as u32, items.len() as u32];
        let counts = self.refit(count, |a, b| [a[0] + b[0], a[1] + b[1]]);
        let mut tree = Tree::default();
        let mut known = Vec::new();
        let mut places: Vec<(u32, usize)> = Vec::new();
        if counts.first().is_some_and(|c| c[0] > 0) {
            places.push((0, 0));
            tree.nodes.push(Node { first: 0, count: 0 });
            known.push(None);
        }
        while let Some((mut at, to)) = places.pop() {
            let holds = |node: u32| counts[node as usize][0] > 0;
            let only = |node: &Node| match [node.first, node.first + 1].map(holds) {
                [true, true] => None,
                [left, _] => Some(node.first + u32::from(!left)),
            };
            while let Some(child) = Some(&self.nodes[at as usize]).filter(|node| !node.is_leaf()).and_then(only) {
                at = child;
            }
            let node = &self.nodes[at as usize];
            let [stay, all] = counts[at as usize];
            known[to] = (stay == all).then_some(at);
            if node.is_leaf() {
                tree.fill(to, self.order[node.items()].iter().copied().filter(|&i| stays(i)).collect());
            } else {
                let child = tree.split(to);
                known.extend([None; 2]);
                places.extend([(node.first + 1, child + 1), (node.first, child)]);
            }
        }
        (tree, known)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Quality;
    use super::*;
    use crate::scene::Bounds;
    use glam::{DVec3, dvec3};

    #[test]
    fn a_tree_retains_some_items_in_its_order() {
        let at = |i: u32| dvec3(f64::from(i * 37 % 101), f64::from(i * 13 % 29), 0.0);
        let boxes: Vec<Bounds> = (0..500).map(at).map(|min| Bounds { min, max: min + DVec3::ONE }).collect();
        let tree = Tree::build(&boxes, Quality::Medium);
        let filters: [fn(u32) -> bool; 4] = [|i| i % 3 > 0, |i| i < 20, |_| true, |_| false];
        for stays in filters {
            let (some, known) = tree.retaining(stays);
            let order: Vec<u32> = tree.order.iter().copied().filter(|&i| stays(i)).collect();
            assert_eq!(some.order, order);
            assert_eq!(known.len(), some.nodes.len());
            for (at, known) in (0..).zip(&known) {
                let items = &some.order[some.items_below(at)];
                assert!(!items.is_empty());
                let of_known = known.map(|known| &tree.order[tree.items_below(known)]);
                assert!(of_known.is_none_or(|of_known| of_known == items));
            }
            assert!(order.is_empty() || some.nodes.iter().filter(|n| n.is_leaf()).count() * 2 == some.nodes.len() + 1);
        }
        let (all, known) = tree.retaining(|_| true);
        assert!(all == tree && (0..).zip(&known).all(|(at, known)| *known == Some(at)));
    }
}
