//! Puts trees together.

use super::{Node, Tree};

impl Tree {
    /// Returns a tree whose upper part is `upper`, a tree with one item per leaf, and in which `parts[i]` takes the place
    /// of item `i`; its items are those of the parts.
    pub fn grafted(upper: &Tree, parts: &[Tree]) -> Tree {
        let mut tree = Tree { nodes: vec![Node { first: 0, count: 0 }], order: Vec::new() };
        let mut places: Vec<(usize, &Tree, u32)> = vec![(0, upper, 0)];
        while let Some((at, mut from, mut node)) = places.pop() {
            if std::ptr::eq(from, upper) && upper.nodes[node as usize].is_leaf() {
                (from, node) = (&parts[upper.order[upper.nodes[node as usize].items().start] as usize], 0);
            }
            let Node { first, .. } = from.nodes[node as usize];
            if from.nodes[node as usize].is_leaf() {
                tree.fill(at, from.order[from.nodes[node as usize].items()].to_vec());
            } else {
                let child = tree.split(at);
                places.extend([(child + 1, from, first + 1), (child, from, first)]);
            }
        }
        tree
    }
}

#[cfg(test)]
mod tests {
    use super::super::Quality;
    use super::*;
    use crate::scene::Bounds;
    use glam::{DVec3, dvec3};

    #[test]
    fn parts_take_the_places_of_items() {
        let boxes = |count: u32| -> Vec<Bounds> {
            let at = |i: u32| dvec3(f64::from(i * 37 % 101), f64::from(i * 13 % 29), 0.0);
            (0..count).map(at).map(|min| Bounds { min, max: min + DVec3::ONE }).collect()
        };
        let upper = Tree::build(&boxes(7), Quality::Instances);
        let part = |i: u32| {
            let mut part = Tree::build(&boxes(3 + 20 * i), Quality::Medium);
            part.order.iter_mut().for_each(|item| *item += 1000 * i);
            part
        };
        let parts: Vec<Tree> = (0..7).map(part).collect();
        let tree = Tree::grafted(&upper, &parts);
        let order: Vec<u32> = upper.order.iter().flat_map(|&i| parts[i as usize].order.clone()).collect();
        assert_eq!(tree.order, order);
        assert_eq!(tree.items_below(0), 0..order.len());
        let inner = |tree: &Tree| tree.nodes.iter().filter(|node| !node.is_leaf()).count();
        assert_eq!(inner(&tree), inner(&upper) + parts.iter().map(inner).sum::<usize>());
        assert!((0..).zip(&tree.nodes).all(|(at, node)| node.is_leaf() || node.first > at));
    }
}
