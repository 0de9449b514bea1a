//! A layout in the running.

use std::borrow::Cow;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use super::model::{Predicted, Ranking, RayCost};
use super::outcome::{CandidateResult, Outcome};
use super::passes::{Pass, PassId, Reason};
use super::plans::Plan;
use crate::cost::mesh_trees::MeshTrees;
use crate::emit::{self, Refuse};
use crate::layout::{self, Content, Layout, PlacedTrees, as_built};
use crate::methods::{self, Cache};
use crate::scene::{Bounds, Overlay, Pinned, Scene};
use crate::verify::accuracy::{Accuracy, Probe};
use crate::verify::cpu::TwoLevel;
use crate::verify::weights::{Overall, Weights};
use crate::verify::{PerKind, RaceResult};

/// A candidate and what is known of it.
pub(crate) struct Candidate {
    pub(crate) plan: Plan,
    pub(crate) laid: Laid,
    pub(crate) predicted: Predicted,
    /// What tracing it costs in accuracy.
    pub(super) accuracy: Accuracy,
    /// Triangles of the largest group that could be divided: meshes of several instances, or of one that is pinned, cannot.
    pub(super) largest_group: usize,
    /// Longest side of the world box of such a group, in world units; 0 where the user sets no bound on it.
    pub(super) longest_group: f64,
    /// How it did on a device.
    pub(super) lap: Option<RaceResult>,
    /// Its speed in the views that judge, where it was the fastest in those that choose.
    pub(super) judged: Option<Overall>,
    /// Its speed over that of the input where it was timed briefly, which compares with others that were, and no more.
    pub(super) brief: Option<f64>,
    pub(super) seconds: f64,
    /// Why the device could not take it.
    pub(super) failure: Option<String>,
}

/// A layout whose rounding is within the limit.
#[derive(Clone)]
pub(crate) struct Laid {
    /// Before its axes are turned.
    pub(crate) layout: Arc<Layout>,
    /// How they are: see [`layout::turn_axes`]. Neither boxes nor rounding depend on it.
    pub(super) axes: u8,
    pub(super) passes: Vec<Pass>,
    /// Pins the instances that rounding would move too far.
    pub(crate) overlay: Overlay,
    /// The largest distance between a corner and its stored position, over the diagonal of the scene.
    pub(crate) position_error_ratio: f64,
    /// Instances that it leaves as they are only because of that.
    pub(super) held_back: usize,
}

/// Gives the scene of each layout, by its index, as it would be written: the order of triangles matters to some drivers.
pub(crate) fn written<'a>(scene: &'a Scene, layouts: Vec<&'a Laid>) -> impl Fn(usize) -> Scene + Sync + 'a {
    let last = Mutex::default();
    move |i| layouts[i].written_after(scene, &last)
}

/// The scene of a layout before its axes are turned.
struct StoredUnturned {
    of: Arc<Layout>,
    scene: Scene,
    /// For each mesh whether it is new.
    is_rewritten: Vec<bool>,
}

impl StoredUnturned {
    fn new(scene: &Scene, of: &Arc<Layout>) -> StoredUnturned {
        let mut layout = Layout::clone(of);
        layout::order_by_tree(scene, &mut layout);
        let is_rewritten = layout.groups.iter().map(|g| !g.content.is_kept()).collect();
        StoredUnturned { of: of.clone(), scene: layout::stored(scene, &layout), is_rewritten }
    }
}

impl Laid {
    /// The scene as it would be written, made of the last one if that differs by its axes alone.
    fn written_after(&self, scene: &Scene, last: &Mutex<Option<StoredUnturned>>) -> Scene {
        let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
        let known = last.take().filter(|known| Arc::ptr_eq(&known.of, &self.layout));
        let straight = known.unwrap_or_else(|| StoredUnturned::new(scene, &self.layout));
        let written = layout::turn_stored(&straight.scene, &straight.is_rewritten, self.axes);
        *last = Some(straight);
        written
    }

    /// Whether two layouts come to the same document but for names.
    pub(super) fn is_same(&self, other: &Laid) -> bool {
        self.axes == other.axes && self.layout.is_same(&other.layout)
    }
}

/// What is known of the scene before a candidate is looked at.
pub(super) struct Known<'a> {
    /// Trees of its meshes.
    pub(super) trees: &'a MeshTrees,
    /// Trees over its triangles, placed.
    pub(super) placed: &'a PlacedTrees,
    /// Two-level cost as it is, and as it is built.
    pub(super) cost: f64,
    /// What rays meet in it as it is, with one BLAS per mesh.
    pub(super) kinds: PerKind<RayCost>,
    /// What tracing it costs in accuracy.
    pub(super) accuracy: Accuracy,
    /// Measures that of a candidate.
    pub(super) probe: &'a Probe,
}

impl Candidate {
    /// Predicts what a layout costs as it is built.
    pub(super) fn new(scene: &Scene, known: &Known, plan: Plan, laid: Laid, ranking: &Ranking) -> Candidate {
        let built = as_built(scene, &laid.layout, ranking.blas_per);
        let (two_level_cost, kinds, accuracy) = match (&built, emit::is_unchanged(&laid.layout)) {
            (Cow::Borrowed(_), true) => (known.cost, known.kinds, known.accuracy),
            (built, unchanged) => {
                let of_groups = known.trees.of_layout(scene, built, known.placed);
                let stored = layout::stored(scene, built);
                let trees = TwoLevel::build_to_count(&stored.translated(-ranking.vantage), &of_groups);
                let cost = if unchanged { known.cost } else { trees.cost(scene.bounds().area()) };
                (cost, ranking.costs(&trees), known.probe.measure(&trees.padded(&stored)))
            }
        };
        let picoseconds = ranking.weights.mean(&kinds.map(|kind| kind.picoseconds));
        let predicted = Predicted { two_level_cost, as_bytes: built.as_bytes(scene), kinds, picoseconds };
        let largest_group = largest_group(scene, &built);
        let longest_group =
            if plan.options.cluster.max_group_extent_ratio.is_some() { longest_group(scene, &built) } else { 0.0 };
        Candidate {
            plan,
            laid,
            predicted,
            accuracy,
            largest_group,
            longest_group,
            lap: None,
            judged: None,
            brief: None,
            seconds: 0.0,
            failure: None,
        }
    }

    /// Whether it is the input as it is.
    pub(super) fn is_input(&self) -> bool {
        emit::is_unchanged(&self.laid.layout)
    }

    /// Its speed over that of the input, where it was timed.
    pub(super) fn speed(&self, weights: &Weights) -> Option<Overall> {
        self.lap.as_ref().map(|lap| lap.views.overall(weights))
    }

    /// What it came to.
    pub(super) fn result(&self, weights: &Weights, outcome: Outcome) -> CandidateResult {
        CandidateResult {
            plan: self.plan.id,
            predicted_cost: self.predicted.two_level_cost,
            sampled_cost: self.predicted.picoseconds,
            measured: self.speed(weights),
            judged: self.judged,
            outcome,
            as_bytes: self.predicted.as_bytes,
            position_error_ratio: self.laid.position_error_ratio,
            accuracy: self.accuracy,
            seconds: self.seconds,
            brief: self.brief.is_some() && self.lap.is_none(),
        }
    }
}

/// The groups that could be divided, in order.
fn divisible<'l>(scene: &Scene, layout: &'l Layout) -> impl Iterator<Item = &'l Content> {
    let mut uses = vec![0u32; scene.meshes.len()];
    scene.instances.iter().for_each(|i| uses[i.mesh.0 as usize] += if i.pinned.is_some() { 2 } else { 1 });
    let is_divisible = move |content: &&Content| match content {
        Content::Kept(mesh) | Content::Piece { mesh, .. } => uses[mesh.0 as usize] < 2,
        Content::Baked { .. } => true,
    };
    layout.groups.iter().map(|group| &group.content).filter(is_divisible)
}

/// As in [`Candidate::largest_group`].
fn largest_group(scene: &Scene, layout: &Layout) -> usize {
    divisible(scene, layout).map(|content| content.triangle_count(scene)).max().unwrap_or(0)
}

/// As in [`Candidate::longest_group`].
fn longest_group(scene: &Scene, layout: &Layout) -> f64 {
    let mut of_mesh = vec![Bounds::EMPTY; scene.meshes.len()];
    for (instance, bounds) in scene.instances.iter().zip(scene.instance_boxes()) {
        let all = &mut of_mesh[instance.mesh.0 as usize];
        *all = all.union(bounds);
    }
    let box_of = |content: &Content| match content {
        Content::Kept(mesh) => of_mesh[mesh.0 as usize],
        Content::Piece { geometries, .. } | Content::Baked { geometries, .. } => {
            let triangles = geometries.iter().flat_map(|geometry| &geometry.triangles);
            Bounds::of(triangles.flat_map(|&at| scene.world_corners(at)))
        }
    };
    let longest = |content: &Content| box_of(content).size().max_element();
    divisible(scene, layout).map(longest).fold(0.0, f64::max)
}

/// Layouts tried without those instances alone that rounding moves too far, before all of their groups stay as they are.
const MOST_ROUNDS: usize = 4;

/// Runs a plan and keeps its rounding within the limit.
pub(super) fn lay_out(cache: &mut Cache, scene: &Scene, plan: &Plan, max_error_ratio: f64) -> Laid {
    let start = Instant::now();
    let mut layout = methods::run_with(cache, plan.method, scene, &plan.options);
    let regrouped = !emit::is_unchanged(&layout);
    let reason = if regrouped { Reason::Regrouped } else { Reason::NotRegrouped };
    let mut passes = vec![Pass::since(start, PassId::Regroup, regrouped, reason)];

    let start = Instant::now();
    let mut settled = emit::settle(scene, &mut layout, max_error_ratio, Refuse::Instances);
    let (mut held_back, mut rounds, mut overlay) = (0, 0, Overlay::default());
    while !settled.refused.is_empty() || !settled.bound.is_empty() {
        held_back += settled.refused.len();
        rounds += 1;
        overlay.pin(&settled.bound, Pinned::Seam);
        overlay.pin(&settled.refused, Pinned::Precision);
        let pinned = scene.overlaid(&overlay);
        layout = methods::run_with(cache, plan.method, &pinned, &plan.options);
        let refuse = if rounds < MOST_ROUNDS { Refuse::Instances } else { Refuse::Groups };
        settled = emit::settle(&pinned, &mut layout, max_error_ratio, refuse);
    }
    passes.push(Pass::since(start, PassId::CentreFrames, settled.centred > 0, Reason::Centred(settled.centred)));
    let diagonal = scene.bounds().diagonal();
    let position_error_ratio = if settled.error == 0.0 { 0.0 } else { settled.error / diagonal };
    Laid { layout: Arc::new(layout), axes: 0, passes, overlay, position_error_ratio, held_back }
}
