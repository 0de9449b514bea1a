//! Keep, open or bake: for each mesh that several instances place, the choice that gains most within the bytes allowed.
//!
//! Each way to treat a mesh has predicted bytes and a predicted cost, counted on sampled rays ([`super::tally`]); the
//! worthwhile ones lie on the convex hull of cost over bytes. Steps along all hulls are taken in the order of their
//! gain per byte until the bytes are used up, as G. B. Dantzig, "Discrete-Variable Extremum Problems", Operations
//! Research 5(2), 1957, fills a knapsack (with the choice of one item of each class: P. Sinha, A. A. Zoltners, "The
//! Multiple-Choice Knapsack Problem", Operations Research 27(3), 1979). Remaining bytes go to the meshes whose next
//! step did not fit.

use std::iter::repeat_n;

use super::known::{Facts, Known, Opened};
use super::plan::{Mesh, Plan, gain_a_byte, hull};
use super::tally::{Base, Tally};
use super::{Fate, MOST_COPIED_TRIANGLES, MOST_TRIANGLES, Selection, input_bytes, placed_bytes};
use crate::layout::Layout;
use crate::layout::builder::Part;
use crate::methods::InstanceOptions;
use crate::scene::{InstanceId, MeshId, Scene};

/// A change must save more than this share of the mesh's cost, unless the number of pieces is given: then any saving
/// suffices.
const WORTH_A_CHANGE: f64 = 0.05;

/// Number of segments that must enter instances of a mesh for a meaningful prediction.
const FEWEST_MET: usize = 32;

/// Maximum number of instances in a layout due to opening: a quarter of the minimum that devices support (2^24 - 1).
const MOST_PLACEMENTS: u64 = 1 << 22;

/// Number of rounds after which all instances are kept, if the method always needs more bytes than predicted.
const MOST_ROUNDS: usize = 4;

/// Runs a method on the instances chosen for baking.
pub(super) fn run(
    scene: &Scene,
    options: &InstanceOptions,
    known: &Known,
    method: impl Fn(&Selection) -> Layout,
) -> Layout {
    let candidates = Candidates::of(scene, options, known);
    let most_bytes = options.max_bytes_ratio.map_or(f64::INFINITY, |ratio| ratio * input_bytes(scene) as f64);
    let mut allowed = most_bytes - placed_bytes(scene) as f64;
    for round in 0.. {
        let plans = if round < MOST_ROUNDS { candidates.choose(allowed) } else { candidates.keep_all() };
        let mut layout = method(&candidates.select(scene, &plans));
        let excess = layout.as_bytes(scene) as f64 - most_bytes;
        // NaN is not an excess: a limit that is NaN allows what the input takes.
        let exceeds = excess > 0.0;
        if !exceeds || plans.iter().all(Plan::keeps) {
            layout.notes.extend(candidates.notes(scene, &plans, allowed));
            return layout;
        }
        let used: f64 = plans.iter().zip(&candidates.meshes).map(|(p, m)| p.bytes - m.plans[0].bytes).sum();
        allowed = allowed.min(used) - excess;
    }
    unreachable!("the last round keeps every instance")
}

/// A mesh that several instances place, and the plans for it.
pub(super) struct Candidate {
    pub(super) id: MeshId,
    /// Its instances that are not pinned.
    pub(super) instances: Vec<InstanceId>,
    /// `None` if only keeping was considered.
    pub(super) looked_at: Option<LookedAt>,
    /// At least one; the first keeps all instances.
    pub(super) plans: Vec<Plan>,
}

/// Results of examining a mesh.
pub(super) struct LookedAt {
    pub(super) mesh: Mesh,
    /// The pieces for each way to open the mesh, parallel to [`Mesh::pieces`] without its first entry, which keeps the
    /// mesh whole.
    pub(super) opened: Vec<Vec<Part>>,
}

pub(super) struct Candidates {
    pub(super) meshes: Vec<Candidate>,
    /// Triangles of meshes that one unpinned instance places.
    base_triangles: u64,
    /// Share of a mesh's cost that a change must save.
    worth_a_change: f64,
    /// Whether no mesh was examined, because no two instance boxes overlap.
    pub(super) are_apart: bool,
}

impl Candidates {
    pub(super) fn of(scene: &Scene, options: &InstanceOptions, known: &Known) -> Candidates {
        let mut instances: Vec<Vec<InstanceId>> = vec![Vec::new(); scene.meshes.len()];
        (0u32..).zip(&scene.instances).for_each(|(i, at)| instances[at.mesh.0 as usize].push(InstanceId(i)));
        let uses: Vec<usize> = instances.iter().map(Vec::len).collect();
        let free = |i: &InstanceId| scene.instances[i.0 as usize].pinned.is_none();
        instances.iter_mut().for_each(|list| list.retain(free));
        let alone = |m: &usize| uses[*m] == 1 && !instances[*m].is_empty();
        let base = (0..uses.len()).filter(alone).map(|m| scene.meshes[m].triangle_count() as u64).sum();
        let meshes: Vec<Candidate> = (0u32..)
            .zip(instances)
            .filter(|(m, list)| uses[*m as usize] > 1 && !list.is_empty())
            .map(|(m, instances)| Candidate { id: MeshId(m), instances, looked_at: None, plans: vec![Plan::NONE] })
            .collect();
        let worth_a_change = if options.pieces.is_some() { 0.0 } else { WORTH_A_CHANGE };
        let mut candidates = Candidates { meshes, base_triangles: base, worth_a_change, are_apart: false };
        if !candidates.meshes.is_empty() {
            candidates.look(scene, options, &uses, known);
        }
        candidates
    }

    /// Finds the plans of all meshes.
    fn look(&mut self, scene: &Scene, options: &InstanceOptions, uses: &[usize], known: &Known) {
        let mut known = known.of(scene, &self.meshes, options);
        self.are_apart = known.are_apart;
        if self.are_apart {
            return;
        }
        let worth = worth_opening(&known.meshes, options);
        known.open(scene, &self.meshes, &worth, options.pieces);
        let has_base = self.base_triangles > 0;
        for ((candidate, facts), worth) in self.meshes.iter_mut().zip(&known.meshes).zip(worth) {
            let Some(facts) = facts.as_ref().filter(|facts| facts.base.met >= FEWEST_MET) else { continue };
            let opened = facts.opened_into(scene, candidate, options.pieces).filter(|_| worth).unwrap_or_default();
            let pinned = (uses[candidate.id.0 as usize] - candidate.instances.len()) as u64;
            let found = LookedAt::new(facts, &opened, pinned, options.entry_cost);
            candidate.plans = found.mesh.plans(options.entry_cost, has_base, options.pieces.is_some());
            candidate.looked_at = Some(found);
        }
    }

    fn keep_all(&self) -> Vec<Plan> {
        self.meshes.iter().map(|m| m.plans[0]).collect()
    }

    /// Returns the plan for each mesh that gains most, while all together take at most `allowed` bytes more than the
    /// input.
    pub(super) fn choose(&self, allowed: f64) -> Vec<Plan> {
        let hulls: Vec<Vec<Plan>> = self.meshes.iter().map(|m| hull(&m.plans)).collect();
        let mut steps: Vec<(f64, usize, usize)> = Vec::new();
        for (m, hull) in hulls.iter().enumerate() {
            let gain = |(i, pair): (usize, &[Plan])| (gain_a_byte(&pair[0], &pair[1]), m, i + 1);
            steps.extend(hull.windows(2).enumerate().map(gain));
        }
        steps.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut chosen = Chosen { plans: self.keep_all(), left: Budget::new(allowed, self.base_triangles) };
        for &(_, m, i) in &steps {
            chosen.change(m, hulls[m][i], self.worth_a_change * self.meshes[m].plans[0].cost);
        }
        // The remaining bytes may pay for plans above the hulls.
        for (m, mesh) in self.meshes.iter().enumerate() {
            let mut plans = mesh.plans.clone();
            plans.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            plans.into_iter().any(|plan| chosen.change(m, plan, self.worth_a_change * mesh.plans[0].cost));
        }
        chosen.plans
    }

    /// Returns the fate of each instance under the plans.
    pub(super) fn select(&self, scene: &Scene, plans: &[Plan]) -> Selection {
        let mut selection =
            Selection { fates: vec![Fate::Bake; scene.instances.len()], pieces: vec![Vec::new(); scene.meshes.len()] };
        for (fate, instance) in selection.fates.iter_mut().zip(&scene.instances) {
            if instance.pinned.is_some() {
                *fate = Fate::Keep;
            }
        }
        for (candidate, plan) in self.meshes.iter().zip(plans) {
            candidate.instances.iter().for_each(|i| selection.fates[i.0 as usize] = Fate::Keep);
            let Some(LookedAt { mesh, opened }) = &candidate.looked_at else { continue };
            let fates = repeat_n(Fate::Bake, plan.baked).chain(repeat_n(Fate::Open, plan.opened));
            for (&node, fate) in mesh.order.iter().zip(fates) {
                let instances = mesh.nodes[node].iter().map(|&i| candidate.instances[i]);
                instances.for_each(|i| selection.fates[i.0 as usize] = fate);
            }
            if plan.opened > 0 {
                selection.pieces[candidate.id.0 as usize] = opened[plan.level - 1].clone();
            }
        }
        selection
    }
}

/// Whether opening each mesh could pay: rays enter it often enough to tell.
fn worth_opening(meshes: &[Option<Facts>], _options: &InstanceOptions) -> Vec<bool> {
    meshes.iter().map(|facts| facts.as_ref().is_some_and(|facts| facts.base.met >= FEWEST_MET)).collect()
}

impl LookedAt {
    fn new(facts: &Facts, opened: &[&Opened], pinned: u64, entry_cost: f64) -> LookedAt {
        let sizes = |opened: &&Opened| opened.parts.iter().map(|part| part.triangles.len() as u64).collect();
        let pieces: Vec<Vec<u64>> = [vec![facts.triangles]].into_iter().chain(opened.iter().map(sizes)).collect();
        let Base { whole, baked, met } = &facts.base;
        let levels = [whole].into_iter().chain(opened.iter().map(|opened| &opened.counts)).cloned().collect();
        let tally = Tally { levels, baked: baked.clone(), met: *met };
        let mesh = Mesh::new(facts.triangles, pieces, facts.nodes.clone(), pinned, tally, entry_cost);
        LookedAt { mesh, opened: opened.iter().map(|opened| opened.parts.clone()).collect() }
    }
}

/// The remaining budget.
struct Budget {
    bytes: f64,
    copied: u64,
    restructured: u64,
    placements: u64,
}

impl Budget {
    fn new(bytes: f64, base_triangles: u64) -> Budget {
        let restructured = MOST_TRIANGLES.saturating_sub(base_triangles);
        Budget { bytes, copied: MOST_COPIED_TRIANGLES, restructured, placements: MOST_PLACEMENTS }
    }
}

/// The plans chosen so far.
struct Chosen {
    plans: Vec<Plan>,
    left: Budget,
}

impl Chosen {
    /// Changes the plan of a mesh if that saves more than `least` and fits the budget.
    fn change(&mut self, mesh: usize, to: Plan, least: f64) -> bool {
        let from = self.plans[mesh];
        let bytes = to.bytes - from.bytes;
        let fits = (bytes <= 0.0 || bytes <= self.left.bytes)
            && to.copied <= self.left.copied.saturating_add(from.copied)
            && to.copied <= self.left.restructured.saturating_add(from.copied)
            && to.placements <= self.left.placements.saturating_add(from.placements);
        if !fits || from.cost - to.cost <= least {
            return false;
        }
        self.left.bytes -= bytes;
        self.left.copied = self.left.copied + from.copied - to.copied;
        self.left.restructured = self.left.restructured + from.copied - to.copied;
        self.left.placements = (self.left.placements + from.placements).saturating_sub(to.placements);
        self.plans[mesh] = to;
        true
    }
}
