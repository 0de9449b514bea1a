//! [`Nodes`]: which node of the output is which of the input.

use std::collections::HashMap;
use std::hash::Hash;

use glam::DAffine3;
use raykiln_formats::contents::Node;
use raykiln_formats::properties::Hierarchy;

use super::super::{Side, Sides};

/// The nodes of two files, and which are the same.
pub(super) struct Nodes {
    pub(super) hierarchies: Sides<Hierarchy>,
    /// World from node.
    pub(super) world: Sides<Vec<DAffine3>>,
    /// Whether the output has the input's nodes under the same numbers.
    pub(super) are_numbered: bool,
    /// For each node of the input, the same of the output.
    pub(super) after: Vec<Option<usize>>,
    /// For each node of the output, the same of the input.
    pub(super) before: Vec<Option<usize>>,
}

impl Nodes {
    /// Matches nodes by number if the output keeps them, as a bake does; otherwise by the names on the way from the root, then by name alone. Nodes of equal names are
    /// matched in file order if there are equally many; nodes without names by their place below the same node.
    /// Of nodes that an earlier bake `added`, those under their number may be others.
    pub(super) fn of(hierarchies: Sides<Hierarchy>, added: impl Fn(usize) -> bool) -> Nodes {
        let Sides { before, after } = &hierarchies;
        let are_numbered = are_numbered(&before.nodes, &after.nodes);
        let matched = if are_numbered {
            let is_same = |&i: &usize| {
                let (b, a) = (&before.nodes[i], &after.nodes[i]);
                !added(i) || b.name == a.name && b.local == a.local
            };
            (0..before.nodes.len()).map(|i| Some(i).filter(is_same)).collect()
        } else {
            by_name(&before.nodes, &after.nodes)
        };
        let mut inverse = vec![None; after.nodes.len()];
        for (i, at) in matched.iter().enumerate() {
            if let Some(at) = at {
                inverse[*at] = Some(i);
            }
        }
        let world = hierarchies.as_ref().map(|hierarchy| world(&hierarchy.nodes));
        Nodes { world, are_numbered, after: matched, before: inverse, hierarchies }
    }

    /// Returns a node of either file.
    pub(super) fn get(&self, side: Side, node: usize) -> &Node {
        &self.hierarchies[side].nodes[node]
    }

    /// Returns a name to display of a node of the input.
    pub(super) fn name(&self, node: usize) -> String {
        match self.get(Side::Before, node).name.as_deref() {
            None | Some("") => format!("node {node}"),
            Some(name) => name.to_owned(),
        }
    }

    /// Whether two nodes are the same.
    pub(super) fn are_same(&self, before: usize, after: usize) -> bool {
        self.after.get(before).copied().flatten() == Some(after)
    }

    /// Returns some nodes and all below them.
    pub(super) fn below(&self, side: Side, roots: Vec<usize>) -> impl Iterator<Item = usize> {
        let mut todo = roots;
        std::iter::from_fn(move || {
            let node = todo.pop()?;
            todo.extend(&self.get(side, node).children);
            Some(node)
        })
    }

    /// Returns the nodes that a node is below, from its parent on.
    pub(super) fn above(&self, side: Side, node: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(self.get(side, node).parent, move |&at| self.get(side, at).parent)
    }
}

/// Share of the nodes that may be hung elsewhere or be others if numbers are kept.
const OTHERS: usize = 10;

/// Whether nodes have the same numbers in both files: nearly all are below the same node, and have the same name or the
/// same place there.
fn are_numbered(before: &[Node], after: &[Node]) -> bool {
    let is_other = |(b, a): &(&Node, &Node)| b.parent != a.parent || b.name != a.name && b.local != a.local;
    let others = before.iter().zip(after).filter(is_other).count();
    after.len() >= before.len() && others <= (before.len() / OTHERS).max(1)
}

/// Returns the node of the output for each of the input.
fn by_name(before: &[Node], after: &[Node]) -> Vec<Option<usize>> {
    let mut matched = vec![None; before.len()];
    let mut taken = vec![false; after.len()];
    let [paths_before, paths_after] = [before, after].map(paths);
    pair_up(&paths_before, &paths_after, &mut matched, &mut taken);
    let names = |nodes: &[Node]| nodes.iter().map(|node| node.name.clone()).collect::<Vec<_>>();
    pair_up(&names(before), &names(after), &mut matched, &mut taken);
    let stems = |nodes: &[Node]| {
        nodes.iter().map(|node| node.name.as_deref().map(stem)).map(|s| s.map(str::to_owned)).collect::<Vec<_>>()
    };
    pair_up(&stems(before), &stems(after), &mut matched, &mut taken);
    pair_unnamed(before, after, &mut matched, &mut taken);
    matched
}

/// Matches nodes without a name below the same node, in file order, if they have the same place there: a tool that drops
/// nodes keeps the order of the others.
fn pair_unnamed(before: &[Node], after: &[Node], matched: &mut [Option<usize>], taken: &mut [bool]) {
    let mut todo: Vec<(Vec<usize>, Vec<usize>)> = vec![(roots(before).collect(), roots(after).collect())];
    while let Some((of_before, of_after)) = todo.pop() {
        let mut next = 0;
        for b in of_before {
            let is_same = |a: &usize| !taken[*a] && after[*a].name.is_none() && after[*a].local == before[b].local;
            let is_sought = matched[b].is_none() && before[b].name.is_none();
            if let Some(at) = of_after[next..].iter().position(is_same).filter(|_| is_sought) {
                let a = of_after[next + at];
                (matched[b], taken[a], next) = (Some(a), true, next + at + 1);
            }
            if let Some(a) = matched[b] {
                todo.push((before[b].children.clone(), after[a].children.clone()));
            }
        }
    }
}

/// Matches what has equal keys, in order, if equally many are left on both sides.
fn pair_up<K: Hash + Eq>(before: &[Option<K>], after: &[Option<K>], matched: &mut [Option<usize>], taken: &mut [bool]) {
    let mut groups: HashMap<&K, [Vec<usize>; 2]> = HashMap::new();
    for (i, key) in before.iter().enumerate().filter(|(i, _)| matched[*i].is_none()) {
        key.iter().for_each(|key| groups.entry(key).or_default()[0].push(i));
    }
    for (i, key) in after.iter().enumerate().filter(|(i, _)| !taken[*i]) {
        key.iter().for_each(|key| groups.entry(key).or_default()[1].push(i));
    }
    for [before, after] in groups.into_values().filter(|[before, after]| before.len() == after.len()) {
        for (b, a) in before.into_iter().zip(after) {
            matched[b] = Some(a);
            taken[a] = true;
        }
    }
}

/// Returns a name without the number that Blender adds to tell equal names apart.
pub(super) fn stem(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, number)) if number.len() == 3 && number.bytes().all(|b| b.is_ascii_digit()) => stem,
        _ => name,
    }
}

/// Returns the names on the way to each node, as the path of its parent and its name; `None` without a name.
fn paths(nodes: &[Node]) -> Vec<Option<(u64, String)>> {
    use std::hash::{DefaultHasher, Hasher};
    let mut hashes = vec![0_u64; nodes.len()];
    let mut todo: Vec<(usize, u64)> = roots(nodes).map(|root| (root, 0)).collect();
    let mut paths = vec![None; nodes.len()];
    while let Some((at, above)) = todo.pop() {
        let mut hasher = DefaultHasher::new();
        (above, &nodes[at].name).hash(&mut hasher);
        hashes[at] = hasher.finish();
        paths[at] = nodes[at].name.clone().map(|name| (above, name));
        todo.extend(nodes[at].children.iter().map(|&child| (child, hashes[at])));
    }
    paths
}

fn roots(nodes: &[Node]) -> impl Iterator<Item = usize> {
    (0..nodes.len()).filter(|i| nodes[*i].parent.is_none())
}

fn world(nodes: &[Node]) -> Vec<DAffine3> {
    let mut world = vec![DAffine3::IDENTITY; nodes.len()];
    let mut todo: Vec<(usize, DAffine3)> = roots(nodes).map(|root| (root, DAffine3::IDENTITY)).collect();
    while let Some((at, above)) = todo.pop() {
        world[at] = above * nodes[at].local;
        todo.extend(nodes[at].children.iter().map(|&child| (child, world[at])));
    }
    world
}
