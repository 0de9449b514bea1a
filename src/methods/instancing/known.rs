//! What is learned of the instances of a scene, once for all runs over it: rays that are counted, what meshes cost whole
//! and baked, and pieces to open them into. None of it depends on what an entry costs, nor on the runs before.

use std::cell::{RefCell, RefMut};
use std::collections::BTreeMap;
use std::rc::Rc;

use rayon::prelude::*;

use super::choose::Candidate;
use super::cut::Cuts;
use super::pieces::{PIECES, Piece, Shapes, numbers};
use super::tally::{Base, Count, Counted};
use crate::cost::overlap;
use crate::cost::segments::{self, Boxed, Segment};
use crate::layout::builder::Part;
use crate::layout::seams;
use crate::methods::InstanceOptions;
use crate::parallel;
use crate::scene::{InstanceId, Scene};
use crate::tree::Quality;

/// Meshes with fewer triangles are not opened.
const FEWEST_TRIANGLES: usize = 64;

/// Maximum number of boxes of pieces considered, in total and per mesh.
const MOST_BOXES: usize = 1 << 21;
const MOST_BOXES_A_MESH: usize = 1 << 18;

/// Number of segments sampled: minimum, per shared mesh, and maximum.
const SEGMENTS: usize = 4096;
const SEGMENTS_A_MESH: usize = 64;
const MOST_SEGMENTS: usize = 1 << 16;

/// Boxes count as separate if their overlap is below this share of their area.
const APART: f64 = 1e-3;

/// What runs over one scene share. Clones share it too.
#[derive(Clone, Default)]
pub(in crate::methods) struct Known(Rc<RefCell<OfScene>>);

impl Known {
    /// Returns what is known of a scene's meshes, each of which several instances place.
    pub(super) fn of(&self, scene: &Scene, meshes: &[Candidate], options: &InstanceOptions) -> RefMut<'_, OfScene> {
        let mut of_scene = self.0.borrow_mut();
        let key = Key {
            pinned: scene.instances.iter().map(|i| i.pinned.is_some()).collect(),
            frames: options.frames,
            only: options.pieces.filter(|only| !PIECES.contains(only)),
        };
        if of_scene.key.as_ref() != Some(&key) {
            *of_scene = OfScene::learn(scene, meshes, key);
        }
        of_scene
    }
}

/// What the rest depends on.
#[derive(PartialEq)]
struct Key {
    pinned: Vec<bool>,
    frames: bool,
    /// A number of pieces that is none of [`PIECES`].
    only: Option<u32>,
}

/// What is known of a scene.
#[derive(Default)]
pub(super) struct OfScene {
    key: Option<Key>,
    /// Whether no two instance boxes overlap; then nothing else is known.
    pub(super) are_apart: bool,
    segments: Vec<Segment>,
    most_boxes: usize,
    /// Parallel to the meshes; `None` if rays cannot be counted.
    pub(super) meshes: Vec<Option<Facts>>,
}

/// What is known of a mesh that several instances place.
pub(super) struct Facts {
    pub(super) triangles: u64,
    /// Instances of each node (indices into those counted).
    pub(super) nodes: Vec<Vec<usize>>,
    /// What its instances cost whole and baked.
    pub(super) base: Base,
    /// Maximum number of pieces.
    most: usize,
    /// Whether pieces may be stored in frames of their own.
    turns: bool,
    shapes: Option<Shapes>,
    /// What was opened into the clusters with an index of `shapes`.
    opened: BTreeMap<usize, Opened>,
}

/// A mesh opened into pieces.
#[derive(Clone)]
pub(super) struct Opened {
    pub(super) parts: Vec<Part>,
    /// By instance; empty if there would be too many boxes.
    pub(super) counts: Vec<Count>,
}

impl OfScene {
    fn learn(scene: &Scene, meshes: &[Candidate], key: Key) -> OfScene {
        let boxes = scene.instance_boxes();
        let areas: f64 = meshes.iter().flat_map(|m| &m.instances).map(|i| boxes[i.0 as usize].area()).sum();
        let overlaps = overlap::shared_area(boxes) > APART * areas;
        if !overlaps {
            return OfScene { key: Some(key), are_apart: true, ..OfScene::default() };
        }
        let mut uses = vec![0usize; scene.meshes.len()];
        scene.instances.iter().for_each(|i| uses[i.mesh.0 as usize] += 1);
        let quality = |m: usize| if uses[m] > 1 { Quality::Medium } else { Quality::Fast };
        let trees: Vec<Boxed> = parallel::map(uses.len(), &|m| Boxed::of_mesh(&scene.meshes[m], quality(m)));
        let count = (SEGMENTS_A_MESH * meshes.len()).clamp(SEGMENTS, MOST_SEGMENTS);
        let segments = segments::sample(scene, &trees, count);
        let most_boxes = (MOST_BOXES / meshes.len()).clamp(1, MOST_BOXES_A_MESH);
        let touching = if key.frames { seams::touching(scene) } else { vec![false; scene.instances.len()] };
        let facts = parallel::map_each(meshes, &|mesh| {
            let tree = &trees[mesh.id.0 as usize];
            // The transforms of a node's copies apply between its mesh and the node, so that no frame can be added; what
            // shares corners with a neighbour would part from it.
            let is_bound =
                |i: &InstanceId| touching[i.0 as usize] || scene.is_copied(scene.instances[i.0 as usize].node);
            let turns = key.frames && !mesh.instances.iter().any(is_bound);
            Facts::of(scene, mesh, tree, &segments, most_boxes, turns)
        });
        OfScene { key: Some(key), are_apart: false, segments, most_boxes, meshes: facts }
    }

    /// Opens those meshes that are worth it into numbers of pieces, where that is not known yet.
    pub(super) fn open(&mut self, scene: &Scene, meshes: &[Candidate], worth: &[bool], only: Option<u32>) {
        let (segments, most_boxes) = (&self.segments, self.most_boxes);
        let with = self.meshes.par_iter_mut().zip(meshes).zip(worth).with_max_len(1);
        with.filter(|(_, worth)| **worth).for_each(|((facts, mesh), _)| {
            facts.iter_mut().for_each(|facts| facts.open(scene, mesh, segments, most_boxes, only));
        });
    }
}

impl Facts {
    /// Counts what the instances of a mesh cost; `None` if rays cannot be counted.
    fn of(
        scene: &Scene,
        mesh: &Candidate,
        tree: &Boxed,
        segments: &[Segment],
        most_boxes: usize,
        turns: bool,
    ) -> Option<Facts> {
        let of = &scene.meshes[mesh.id.0 as usize];
        if tree.tree.order.len() < of.triangle_count() || segments.is_empty() {
            return None;
        }
        let most = (most_boxes / mesh.instances.len()).max(1);
        let every = mesh.instances.len().div_ceil(16);
        let placed = |i: &InstanceId| scene.instances[i.0 as usize].transform.matrix3;
        let placed: Vec<_> = mesh.instances.iter().step_by(every).map(placed).collect();
        let base = Counted::new(scene, &mesh.instances, tree, segments).base(&Cuts::of(tree, most, &placed));
        let indexed: Vec<(u32, usize)> =
            mesh.instances.iter().enumerate().map(|(i, id)| (scene.instances[id.0 as usize].node, i)).collect();
        let nodes = indexed.chunk_by(|a, b| a.0 == b.0).map(|node| node.iter().map(|&(_, i)| i).collect()).collect();
        let triangles = of.triangle_count() as u64;
        Some(Facts { triangles, nodes, base, most, turns, shapes: None, opened: BTreeMap::new() })
    }

    /// Opens the mesh into numbers of pieces; only into `only` if given.
    fn open(&mut self, scene: &Scene, mesh: &Candidate, segments: &[Segment], most_boxes: usize, only: Option<u32>) {
        let of = &scene.meshes[mesh.id.0 as usize];
        if of.triangle_count() < FEWEST_TRIANGLES || self.opened_into(scene, mesh, only).is_some() {
            return;
        }
        let tree = Boxed::of_mesh(of, Quality::Medium);
        let another = only.filter(|only| !PIECES.contains(only));
        let shapes = self.shapes.get_or_insert_with(|| Shapes::of(of, &tree, self.most, self.turns, another));
        let counted = Counted::new(scene, &mesh.instances, &tree, segments);
        for index in shapes.indices(&numbers(of, self.most, only)) {
            self.opened.entry(index).or_insert_with(|| {
                let pieces = shapes.pieces(of, index);
                let counts = counted.opened(&pieces, most_boxes);
                Opened { parts: pieces.into_iter().map(|piece: Piece| piece.part).collect(), counts }
            });
        }
    }

    /// Returns the ways to open the mesh, by their number of pieces; `None` if they are not known.
    pub(super) fn opened_into(&self, scene: &Scene, mesh: &Candidate, only: Option<u32>) -> Option<Vec<&Opened>> {
        let numbers = numbers(&scene.meshes[mesh.id.0 as usize], self.most, only);
        let indices = self.shapes.as_ref()?.indices(&numbers);
        let mut opened: Vec<&Opened> =
            indices.iter().map(|index| self.opened.get(index)).collect::<Option<Vec<&Opened>>>()?;
        opened.retain(|opened| !opened.parts.is_empty());
        opened.sort_by_key(|opened| opened.parts.len());
        Some(opened)
    }
}
