//! Where new nodes hang: below the nearest common ancestor of the nodes whose triangles they show, so that an application
//! that moves a node still moves all that it showed.

use glam::{DAffine3, DMat3};
use raykiln_formats::Document;
use raykiln_formats::contents::Node;
use raykiln_formats::properties::Hierarchy as Nodes;

/// The nodes of the input.
pub(super) struct Hierarchy {
    nodes: Vec<Node>,
    /// World from node.
    world: Vec<DAffine3>,
    /// Number of nodes above each.
    depth: Vec<u32>,
}

/// A place for a new node.
pub(super) struct Below {
    /// `None` for a root.
    pub(super) parent: Option<usize>,
    /// Parent from node.
    pub(super) local: DAffine3,
}

impl Hierarchy {
    /// Reads the nodes of a document that a scene was loaded from.
    pub(super) fn of(doc: &Document) -> Hierarchy {
        let Nodes { nodes, .. } = doc.hierarchy().expect("the nodes of a loaded scene are sound");
        let mut world = vec![DAffine3::IDENTITY; nodes.len()];
        let mut depth = vec![0; nodes.len()];
        let mut todo: Vec<usize> = (0..nodes.len()).filter(|&node| nodes[node].parent.is_none()).collect();
        while let Some(node) = todo.pop() {
            world[node] = nodes[node].parent.map_or(DAffine3::IDENTITY, |parent| world[parent]) * nodes[node].local;
            depth[node] = nodes[node].parent.map_or(0, |parent| depth[parent] + 1);
            todo.extend(&nodes[node].children);
        }
        Hierarchy { nodes, world, depth }
    }

    /// Returns where a node with this transform into the world hangs that shows triangles of these nodes: below their
    /// nearest common ancestor, or above that if a node below it could not have that transform.
    pub(super) fn below_common_ancestor(&self, nodes: impl Iterator<Item = usize>, world: &DAffine3) -> Below {
        let mut parent = self.common_ancestor(nodes);
        while let Some(node) = parent {
            if let Some(local) = self.local(node, world) {
                return Below { parent, local };
            }
            parent = self.nodes[node].parent;
        }
        Below { parent, local: *world }
    }

    /// Returns the nearest node that all of these are below; `None` if there is none.
    fn common_ancestor(&self, nodes: impl Iterator<Item = usize>) -> Option<usize> {
        let parents = nodes.map(|node| self.nodes[node].parent);
        parents.reduce(|a, b| self.nearest(a?, b?)).flatten()
    }

    fn nearest(&self, a: usize, b: usize) -> Option<usize> {
        let (mut a, mut b) = (a, b);
        while a != b {
            let deeper = if self.depth[a] >= self.depth[b] { &mut a } else { &mut b };
            *deeper = self.nodes[*deeper].parent?;
        }
        Some(a)
    }

    /// Returns the transform of a node below `parent` that has this transform into the world; `None` if rounding would
    /// displace it, or if it is not a translation, a rotation and a scale, which glTF asks for.
    fn local(&self, parent: usize, world: &DAffine3) -> Option<DAffine3> {
        let above = self.world[parent];
        if above == DAffine3::IDENTITY {
            return Some(*world);
        }
        let back = above.inverse();
        let local = back * *world;
        let error = |local: &DAffine3| {
            let there = above * *local;
            let of = |m: DAffine3| m.to_cols_array();
            of(there).into_iter().zip(of(*world)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let largest = world.to_cols_array().into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        (local.is_finite() && error(&local) <= SAME * largest && has_no_shear(&local.matrix3)).then_some(local)
    }
}

/// Largest difference between entries of a transform that rounding in double precision makes, relative to the largest.
const SAME: f64 = 1e-14;

/// Whether the axes of a transform are at right angles.
fn has_no_shear(m: &DMat3) -> bool {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.normalize_or_zero());
    [x.dot(y), y.dot(z), z.dot(x)].into_iter().all(|cosine| cosine.abs() <= 1e-9)
}
