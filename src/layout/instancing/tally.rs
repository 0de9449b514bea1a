//! What the instances of a mesh cost rays, whole, opened, and baked, counted on sampled segments.

use glam::DAffine3;
use rayon::prelude::*;

use super::cut::{Cuts, triangles_below};
use crate::cost::segments::{Boxed, Segment};
use crate::cost::tree::Quality;
use crate::scene::{Bounds, InstanceId, Mesh, Scene};

/// Triangles up to which boxes of baked pieces are those of the placed triangles, and not of transformed boxes.
const MOST_EXACT_TRIANGLES: usize = 1 << 24;

/// How often segments enter an instance, or its pieces, and how many nodes they then pass, those of the top-level tree
/// over the instances of the mesh shared out by entries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Count {
    pub(super) entries: f64,
    pub(super) steps: f64,
}

/// The counts of a mesh.
pub(super) struct Tally {
    /// For every cut and every instance; empty for a cut that was not tried, whose boxes would be too many.
    pub(super) levels: Vec<Vec<Count>>,
    /// For every instance if all are baked, with no entries.
    pub(super) baked: Vec<Count>,
    /// Segments that enter at least one of the instances.
    pub(super) met: usize,
}

/// Some instances of a mesh among the segments of the scene.
pub(super) struct Counted<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) tree: &'a Boxed,
    pub(super) cuts: &'a Cuts,
    /// World from mesh.
    pub(super) placed: Vec<DAffine3>,
    pub(super) segments: &'a [Segment],
}

impl<'a> Counted<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        instances: &[InstanceId],
        tree: &'a Boxed,
        cuts: &'a Cuts,
        segments: &'a [Segment],
    ) -> Self {
        let placed = instances.iter().map(|i| scene.instances[i.0 as usize].transform).collect();
        Counted { mesh: scene.mesh_of(instances[0]), tree, cuts, placed, segments }
    }

    /// Counts all cuts of no more than `most_boxes` boxes; the last one stands for baking.
    ///
    /// The tree that a driver makes of baked instances is not built. A tree over the pieces of a cut, as fine as
    /// `most_boxes` allows, with the mesh's own tree below each, is one over the same triangles and costs at least as
    /// much.
    pub(super) fn tally(&self, most_boxes: usize) -> Tally {
        let last = self.cuts.levels.len() - 1;
        let whole = Boxed::build(&self.world_boxes(0), Quality::Instances);
        let below = self.steps_below(&whole);
        let count = |level: usize| -> Vec<Count> {
            if level > 0 && self.cuts.levels[level].len().saturating_mul(self.placed.len()) > most_boxes {
                return Vec::new();
            }
            self.count(level, &below.steps)
        };
        let levels: Vec<Vec<Count>> = (0..last).map(count).collect();
        let finest = (0..=last).rev().find(|&l| self.boxes_of(l) <= most_boxes).unwrap_or(0);
        let baked = self.count(finest, &below.steps);
        let baked = baked.into_iter().map(|c| Count { entries: 0.0, ..c }).collect();
        Tally { levels, baked, met: below.met }
    }

    fn boxes_of(&self, level: usize) -> usize {
        self.cuts.levels[level].len().saturating_mul(self.placed.len())
    }

    /// World boxes of the pieces of a cut, instance by instance.
    fn world_boxes(&self, level: usize) -> Vec<Bounds> {
        let roots = &self.cuts.levels[level];
        let exact = level + 1 == self.cuts.levels.len()
            && self.mesh.triangle_count().saturating_mul(self.placed.len()) <= MOST_EXACT_TRIANGLES;
        if !exact {
            let of_instance = |by: &DAffine3| -> Vec<Bounds> {
                roots.iter().map(|&root| self.tree.bounds[root as usize].transformed(by)).collect()
            };
            return self.placed.par_iter().flat_map_iter(of_instance).collect();
        }
        let pieces: Vec<Vec<u32>> = roots.iter().map(|&root| triangles_below(self.tree, root)).collect();
        let of_instance = |by: &DAffine3| -> Vec<Bounds> {
            let corners = |&t: &u32| self.mesh.corners(t).map(|p| by.transform_point3(p.as_dvec3()));
            pieces.iter().map(|piece| Bounds::of(piece.iter().flat_map(corners))).collect()
        };
        self.placed.par_iter().flat_map_iter(of_instance).collect()
    }

    /// The nodes of the mesh's tree that segments pass in every instance, by the cut that first has them opened.
    fn steps_below(&self, whole: &Boxed) -> Below {
        let kinds = self.cuts.levels.len() + 1;
        let into: Vec<DAffine3> = self.placed.iter().map(DAffine3::inverse).collect();
        let of_segment = |segment: &Segment| -> Vec<(u32, Vec<u32>)> {
            let mut passed = Vec::new();
            for instance in entered(whole, segment) {
                let mut steps = vec![0; kinds];
                let mut local = segment.under(&into[instance as usize]);
                self.tree.visit(&mut local, |node, _| steps[usize::from(self.cuts.opened_at[node])] += 1);
                passed.push((instance, steps));
            }
            passed
        };
        let mut below = Below { steps: vec![vec![0; kinds]; self.placed.len()], met: 0 };
        for block in self.segments.chunks(BLOCK) {
            let passed: Vec<Vec<(u32, Vec<u32>)>> = block.par_iter().map(of_segment).collect();
            below.met += passed.iter().filter(|p| !p.is_empty()).count();
            for (instance, steps) in passed.into_iter().flatten() {
                below.steps[instance as usize].iter_mut().zip(steps).for_each(|(sum, n)| *sum += u64::from(n));
            }
        }
        below
    }

    /// What every instance costs cut into the pieces of a level.
    fn count(&self, level: usize, below: &[Vec<u64>]) -> Vec<Count> {
        let top = Boxed::build(&self.world_boxes(level), Quality::Instances);
        let pieces = self.cuts.levels[level].len() as u32;
        let of_segment = |segment: &Segment| -> (u64, Vec<u32>) {
            let (mut steps, mut entered) = (0, Vec::new());
            top.visit(&mut { *segment }, |node, _| {
                steps += u64::from(!top.tree.nodes[node].is_leaf());
                entered.extend_from_slice(top.items(node));
            });
            (steps, entered)
        };
        let (mut entries, mut steps, mut all, mut used) = (vec![0u64; self.placed.len()], 0, 0, 0);
        for block in self.segments.chunks(BLOCK) {
            let passed: Vec<(u64, Vec<u32>)> = block.par_iter().map(of_segment).collect();
            used += block.len();
            steps += passed.iter().map(|p| p.0).sum::<u64>();
            all += passed.iter().map(|p| p.1.len()).sum::<usize>();
            passed.iter().flat_map(|p| &p.1).for_each(|piece| entries[(piece / pieces) as usize] += 1);
            if all > MOST_ENTRIES {
                break;
            }
        }
        let scale = self.segments.len() as f64 / used.max(1) as f64;
        let steps_an_entry = steps as f64 / all.max(1) as f64;
        let of_instance = |(&entries, below): (&u64, &Vec<u64>)| {
            let entries = scale * entries as f64;
            // Nodes that a cut up to this one has opened are above its pieces.
            Count { entries, steps: steps_an_entry * entries + below[level + 1..].iter().sum::<u64>() as f64 }
        };
        entries.iter().zip(below).map(of_instance).collect()
    }
}

/// Segments worked on at a time: what they pass is held for so many.
const BLOCK: usize = 64;

/// Entries into pieces after which those counted stand for all.
const MOST_ENTRIES: usize = 1 << 20;

/// What segments pass within instances.
struct Below {
    /// For every instance the nodes by the cut that first has them opened.
    steps: Vec<Vec<u64>>,
    met: usize,
}

/// The items whose box a segment meets.
fn entered(top: &Boxed, segment: &Segment) -> Vec<u32> {
    let mut items = Vec::new();
    top.visit(&mut { *segment }, |node, _| items.extend_from_slice(top.items(node)));
    items
}
