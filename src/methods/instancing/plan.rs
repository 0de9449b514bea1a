//! Plans for the instances of one mesh, with their bytes and costs.

use super::tally::{Count, Tally};
use crate::cost::bytes;

/// Size of a baked group in bytes that fits in a device's caches, and the relative cost increase of a step within a
/// group each time its size doubles beyond that: the last-level cache of an NVIDIA H200 is 50 MB.
const CACHE_BYTES: f64 = 50e6;
const DEARER_PER_DOUBLING: f64 = 0.25;

/// Shares of the instances that may be baked, and of the others that may be opened; those that gain most by baking come
/// first.
const BAKED_SHARES: [f64; 5] = [0.0, 0.125, 0.25, 0.5, 1.0];
const OPENED_SHARES: [f64; 4] = [0.125, 0.25, 0.5, 1.0];

/// A plan for the instances of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plan {
    /// What instances are opened into: an index into [`Mesh::pieces`]; 0 if none are opened.
    pub(super) level: usize,
    /// Number of nodes whose instances are baked: the first of [`Mesh::order`].
    pub(super) baked: usize,
    /// Number of nodes whose instances are opened: the next ones. The others keep theirs.
    pub(super) opened: usize,
    /// Predicted bytes of the structures of the mesh.
    pub(super) bytes: f64,
    /// Predicted cost: total steps of all segments.
    pub(super) cost: f64,
    /// Triangles written out.
    pub(super) copied: u64,
    /// Instances in the TLAS.
    pub(super) placements: u64,
}

impl Plan {
    /// Keeps all instances of a mesh that was not examined; its bytes do not matter.
    pub(super) const NONE: Plan =
        Plan { level: 0, baked: 0, opened: 0, bytes: 0.0, cost: 0.0, copied: 0, placements: 0 };

    /// Whether all instances stay unchanged.
    pub(super) fn keeps(&self) -> bool {
        self.level == 0 && self.baked == 0
    }
}

/// A mesh that several instances place, some of which need not stay.
pub(super) struct Mesh {
    pub(super) triangles: u64,
    /// Triangles of each piece, for each way to open the mesh; the first way keeps it whole.
    pub(super) pieces: Vec<Vec<u64>>,
    /// Instances of each node (indices into those counted); the copies of a node share their fate.
    pub(super) nodes: Vec<Vec<usize>>,
    /// Nodes in descending order of their gain from baking.
    pub(super) order: Vec<usize>,
    /// Number of instances that must stay unchanged.
    pub(super) pinned: u64,
    pub(super) tally: Tally,
}

impl Mesh {
    /// Creates the mesh with its nodes sorted.
    pub(super) fn new(
        triangles: u64,
        pieces: Vec<Vec<u64>>,
        nodes: Vec<Vec<usize>>,
        pinned: u64,
        tally: Tally,
        entry_cost: f64,
    ) -> Mesh {
        let gain = |node: &Vec<usize>| -> f64 {
            let of = |&i: &usize| price(tally.levels[0][i], entry_cost) - price(tally.baked[i], entry_cost);
            node.iter().map(of).sum()
        };
        let gains: Vec<f64> = nodes.iter().map(gain).collect();
        let mut order: Vec<usize> = (0..nodes.len()).collect();
        order.sort_by(|&a, &b| gains[b].total_cmp(&gains[a]).then(a.cmp(&b)));
        Mesh { triangles, pieces, nodes, order, pinned, tally }
    }

    /// Returns all plans; the first keeps each instance. `has_base` says whether other triangles are baked anyway, so
    /// that baked instances need no group, and so no entry, of their own; `all_alike` whether either all instances that
    /// are not baked are opened or none.
    pub(super) fn plans(&self, entry_cost: f64, has_base: bool, all_alike: bool) -> Vec<Plan> {
        let usable = |&level: &usize| level > 0 && !self.tally.levels[level].is_empty();
        let levels: Vec<usize> = (0..self.tally.levels.len()).filter(usable).collect();
        let count = |share: f64, of: usize| (share * of as f64).round() as usize;
        let mut counts: Vec<usize> = BAKED_SHARES.iter().map(|share| count(*share, self.nodes.len())).collect();
        counts.dedup();
        let shares = if all_alike { &OPENED_SHARES[OPENED_SHARES.len() - 1..] } else { &OPENED_SHARES };
        let mut plans = Vec::new();
        for &baked in &counts {
            plans.push(self.plan(0, [baked, 0], entry_cost, has_base));
            let left = self.nodes.len() - baked;
            let mut opened: Vec<usize> = shares.iter().map(|share| count(*share, left)).collect();
            opened.dedup();
            for &opened in opened.iter().filter(|&&opened| opened > 0) {
                plans.extend(levels.iter().map(|&level| self.plan(level, [baked, opened], entry_cost, has_base)));
            }
        }
        plans
    }

    fn plan(&self, level: usize, [baked, opened]: [usize; 2], entry_cost: f64, has_base: bool) -> Plan {
        let (in_baked, in_left) = self.order.split_at(baked);
        let (in_opened, in_kept) = in_left.split_at(opened);
        let instances = |nodes: &[usize]| nodes.iter().map(|&n| self.nodes[n].len() as u64).sum::<u64>();
        let [count_baked, count_opened, count_kept] = [in_baked, in_opened, in_kept].map(instances);
        let copied = self.triangles.saturating_mul(count_baked);
        let copied_bytes = copied as f64 * bytes::COMPACTED_BLAS_BYTES_PER_TRIANGLE as f64;
        let placements = self.pinned + count_kept + count_opened.saturating_mul(self.pieces[level].len() as u64);
        let blas = |pieces: &[u64]| pieces.iter().map(|&t| bytes::blas(t) as f64).sum::<f64>();
        let stored = if self.pinned + count_kept > 0 { bytes::blas(self.triangles) as f64 } else { 0.0 }
            + if count_opened > 0 { blas(&self.pieces[level]) } else { 0.0 };

        let sum = |nodes: &[usize], counts: &[Count]| -> f64 {
            nodes.iter().flat_map(|&n| &self.nodes[n]).map(|&i| price(counts[i], entry_cost)).sum()
        };
        let own_entry = if baked > 0 && !has_base { entry_cost * self.tally.met as f64 } else { 0.0 };
        let baked_cost = dearer(copied_bytes) * sum(in_baked, &self.tally.baked) + own_entry;
        let left_cost = sum(in_kept, &self.tally.levels[0]) + sum(in_opened, &self.tally.levels[level]);
        Plan {
            level,
            baked,
            opened,
            bytes: stored + copied_bytes + (bytes::TLAS_BYTES_PER_INSTANCE * placements) as f64,
            cost: left_cost + baked_cost,
            copied,
            placements,
        }
    }
}

fn price(count: Count, entry_cost: f64) -> f64 {
    entry_cost * count.entries + count.steps
}

/// Returns the factor by which a step is more expensive in a group of this size.
fn dearer(bytes: f64) -> f64 {
    1.0 + DEARER_PER_DOUBLING * (bytes / CACHE_BYTES).max(1.0).log2()
}

/// Returns the plans on the lower convex hull of cost over bytes, starting at the first plan: each costs less than the
/// previous one and, except for those that take no more bytes than the first, gains less per byte.
pub(super) fn hull(plans: &[Plan]) -> Vec<Plan> {
    let mut sorted = plans.to_vec();
    sorted.sort_by(|a, b| a.bytes.total_cmp(&b.bytes).then(a.cost.total_cmp(&b.cost)));
    let mut hull: Vec<Plan> = plans.first().copied().into_iter().collect();
    for plan in sorted {
        if hull.last().is_some_and(|last| plan.cost < last.cost) {
            while let [.., a, b] = *hull.as_slice() {
                if gain_a_byte(&b, &plan) < gain_a_byte(&a, &b) {
                    break;
                }
                hull.pop();
            }
            hull.push(plan);
        }
    }
    hull
}

/// Returns the gain of a change of plan per byte it takes; infinite if it takes none.
pub(super) fn gain_a_byte(from: &Plan, to: &Plan) -> f64 {
    let bytes = to.bytes - from.bytes;
    if bytes > 0.0 { (from.cost - to.cost) / bytes } else { f64::INFINITY }
}
