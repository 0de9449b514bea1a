//! The cost of the instances of a mesh for rays, kept whole, opened, or baked, counted on sampled segments.

use glam::DAffine3;
use rayon::prelude::*;

use super::cut::{Cuts, triangles_below};
use super::pieces::Piece;
use crate::cost::segments::{Boxed, Segment};
use crate::parallel;
use crate::scene::{Bounds, InstanceId, Mesh, Scene};
use crate::tree::Quality;

/// Up to this many triangles, boxes of baked parts are those of the placed triangles, not transformed boxes.
const MOST_EXACT_TRIANGLES: usize = 1 << 24;

/// How often segments enter an instance, or its pieces, and how many nodes they then visit, including nodes of the
/// top-level tree over the instances of the mesh, shared out by entries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Count {
    pub(super) entries: f64,
    pub(super) steps: f64,
}

/// The counts of a mesh.
#[derive(Clone)]
pub(super) struct Tally {
    /// For each way to open the instances (the first keeps them whole) and each instance; empty for ways that were not
    /// tried because there would be too many boxes.
    pub(super) levels: Vec<Vec<Count>>,
    /// For each instance if all are baked, with no entries.
    pub(super) baked: Vec<Count>,
    /// Segments that enter at least one of the instances.
    pub(super) met: usize,
}

/// The counts of a mesh that is not opened.
pub(super) struct Base {
    /// For each instance, kept whole.
    pub(super) whole: Vec<Count>,
    /// For each instance if all are baked, with no entries.
    pub(super) baked: Vec<Count>,
    /// Segments that enter at least one of the instances.
    pub(super) met: usize,
}

/// Some instances of a mesh, and the segments of the scene.
pub(super) struct Counted<'a> {
    mesh: &'a Mesh,
    tree: &'a Boxed,
    /// World from mesh.
    placed: Vec<DAffine3>,
    /// Mesh from world.
    into: Vec<DAffine3>,
    segments: &'a [Segment],
}

/// A part of each instance that is entered: the box of a node of the tree below, and how a segment continues there.
struct Part<'a> {
    tree: &'a Boxed,
    root: usize,
    /// Mesh from the coordinates of the tree.
    frame: DAffine3,
    /// The inverse of `frame`.
    into: DAffine3,
}

impl<'a> Counted<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        instances: &[InstanceId],
        tree: &'a Boxed,
        segments: &'a [Segment],
    ) -> Counted<'a> {
        let placed: Vec<DAffine3> = instances.iter().map(|i| scene.instances[i.0 as usize].transform).collect();
        let into = placed.iter().map(DAffine3::inverse).collect();
        Counted { mesh: scene.mesh_of(instances[0]), tree, placed, into, segments }
    }

    /// Counts the instances whole, and baked.
    ///
    /// The tree that a driver builds over baked instances is not built. Instead, a tree over the parts of a cut, as
    /// fine as the number of boxes allows, with the mesh's own tree below each part, is a tree over the same triangles and
    /// costs at least as much.
    pub(super) fn base(&self, cuts: &Cuts) -> Base {
        let part = |root: u32| self.part(root);
        let (whole, met) = self.count(&[part(0)], None);
        let parts: Vec<Part> = cuts.finest.iter().map(|&root| part(root)).collect();
        let (baked, _) = self.count(&parts, self.exact_boxes(&cuts.finest));
        let baked = baked.into_iter().map(|c| Count { entries: 0.0, ..c }).collect();
        Base { whole, baked, met }
    }

    /// Counts the instances opened into pieces, by instance; nothing if these have more than `most_boxes` boxes.
    pub(super) fn opened(&self, pieces: &[Piece], most_boxes: usize) -> Vec<Count> {
        if pieces.is_empty() || pieces.len().saturating_mul(self.placed.len()) > most_boxes {
            return Vec::new();
        }
        let parts: Vec<Part> = pieces.iter().map(Part::of).collect();
        self.count(&parts, None).0
    }

    /// Returns the part below a node of the mesh's tree.
    fn part(&self, root: u32) -> Part<'a> {
        Part { tree: self.tree, root: root as usize, frame: DAffine3::IDENTITY, into: DAffine3::IDENTITY }
    }

    /// Returns the world boxes of the triangles below each of some nodes, instance by instance; `None` if there are too
    /// many.
    fn exact_boxes(&self, roots: &[u32]) -> Option<Vec<Bounds>> {
        if self.mesh.triangle_count().saturating_mul(self.placed.len()) > MOST_EXACT_TRIANGLES {
            return None;
        }
        let parts: Vec<Vec<u32>> = roots.iter().map(|&root| triangles_below(self.tree, root)).collect();
        let of_instance = |by: &DAffine3| -> Vec<Bounds> {
            let corners = |&t: &u32| self.mesh.corners(t).map(|p| by.transform_point3(p.as_dvec3()));
            parts.iter().map(|part| Bounds::of(part.iter().flat_map(corners))).collect()
        };
        Some(self.placed.par_iter().flat_map_iter(of_instance).collect())
    }

    /// Counts the cost of each instance, entered part by part, and the segments that enter any. `boxes` are those of
    /// the parts, instance by instance, if they differ from those of a driver.
    fn count(&self, parts: &[Part], boxes: Option<Vec<Bounds>>) -> (Vec<Count>, usize) {
        let of_instance = |by: &DAffine3| -> Vec<Bounds> {
            parts.iter().map(|part| part.tree.bounds[part.root].transformed(&(*by * part.frame))).collect()
        };
        let boxes = boxes.unwrap_or_else(|| self.placed.par_iter().flat_map_iter(of_instance).collect());
        let top = Boxed::build(&boxes, Quality::Instances);
        let (mut sums, mut above, mut all, mut used, mut met) = (vec![(0u64, 0u64); self.placed.len()], 0, 0, 0, 0);
        for block in self.segments.chunks(BLOCK) {
            let passed: Vec<(u64, Vec<(u32, u64)>)> =
                parallel::map_each(block, &|segment| self.pass(&top, parts, segment));
            used += block.len();
            met += passed.iter().filter(|p| !p.1.is_empty()).count();
            above += passed.iter().map(|p| p.0).sum::<u64>();
            all += passed.iter().map(|p| p.1.len()).sum::<usize>();
            for &(instance, below) in passed.iter().flat_map(|p| &p.1) {
                let sum = &mut sums[instance as usize];
                *sum = (sum.0 + 1, sum.1 + below);
            }
            if all > MOST_ENTRIES {
                break;
            }
        }
        let scale = self.segments.len() as f64 / used.max(1) as f64;
        let above_an_entry = above as f64 / all.max(1) as f64;
        let of_instance = |&(entries, below): &(u64, u64)| {
            let entries = scale * entries as f64;
            Count { entries, steps: above_an_entry * entries + scale * below as f64 }
        };
        (sums.iter().map(of_instance).collect(), (scale * met as f64) as usize)
    }

    /// Returns the number of top-level nodes that a segment visits, and for each part entered its instance and the
    /// number of nodes visited within.
    fn pass(&self, top: &Boxed, parts: &[Part], segment: &Segment) -> (u64, Vec<(u32, u64)>) {
        let (mut steps, mut items) = (0, Vec::new());
        top.visit(&mut { *segment }, |node, _| {
            steps += u64::from(!top.tree.nodes[node].is_leaf());
            items.extend_from_slice(top.items(node));
        });
        let below = |&item: &u32| {
            let (instance, part) = (item / parts.len() as u32, &parts[item as usize % parts.len()]);
            let mut passed = 0;
            let local = &mut segment.under(&(part.into * self.into[instance as usize]));
            part.tree.visit_below(part.root, local, |_, _| passed += 1);
            (instance, passed)
        };
        (steps, items.iter().map(below).collect())
    }
}

impl<'a> Part<'a> {
    fn of(piece: &'a Piece) -> Part<'a> {
        let frame = piece.part.frame;
        Part { tree: &piece.tree, root: 0, frame, into: frame.inverse() }
    }
}

/// Segments per round; their results are held in memory until the round ends.
const BLOCK: usize = 64;

/// Number of entries into parts after which those counted represent all.
const MOST_ENTRIES: usize = 1 << 20;
