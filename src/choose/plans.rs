//! The layouts that `auto` considers.

use std::sync::Arc;

use crate::methods::{ClusterSearch, Instances, Method, Options, PlanId};

/// How much time to spend, from 0 to 6.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Effort(u8);

impl Default for Effort {
    fn default() -> Self {
        Effort(3)
    }
}

impl Effort {
    /// The largest level.
    pub const MOST: u8 = 6;

    /// Returns the effort of a level, limited to the largest.
    pub fn new(level: u8) -> Effort {
        Effort(level.min(Effort::MOST))
    }

    /// The level.
    pub fn level(self) -> u8 {
        self.0
    }

    /// Number of layouts to measure on a device, in addition to the input and the single BLAS.
    pub(super) fn measured(self) -> usize {
        [1, 1, 4, 12, 18, 24, usize::MAX][usize::from(self.0)]
    }

    /// Number of rays of each kind that layouts are ranked by.
    pub(crate) fn rays(self) -> usize {
        [1024, 2048, 4096, 8192, 8192, 16_384, 32_768][usize::from(self.0)]
    }
}

/// A layout to consider: a method and its options.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) id: PlanId,
    pub(crate) method: Method,
    pub(crate) options: Options,
}

impl Plan {
    /// Whether the layout is cut by what rays traverse.
    pub(crate) fn is_by_rays(&self) -> bool {
        self.options.cluster.search.segments.is_some()
    }

    /// Whether everything that may be regrouped goes into one BLAS aligned with the world axes.
    pub(crate) fn is_single(&self) -> bool {
        self.method == Method::Single && !self.options.single.turned
    }

    /// Whether it divides groups that exceed the user's bounds.
    fn is_within_bounds(&self) -> bool {
        self.method == Method::Cluster || self.options.single.turned
    }
}

/// A plan and the lowest effort that considers it.
type Entry = (u8, &'static str, Method, fn(&mut Options));

/// Plans that start at this effort or above improve groups by local search, which costs time and does not always pay.
/// Plans below it are never searched, so that a higher effort considers everything that a lower one does.
const SEARCHED: u8 = 4;

/// The plans in order of effort; the unchanged input comes first. Entry costs above the fitted one yield fewer and
/// larger groups, which pays most often on devices without RT cores.
const PLANS: [Entry; 38] = [
    (0, "keep", Method::Keep, |_| {}),
    (0, "single", Method::Single, |_| {}),
    (1, "single, turned", Method::Single, |o| o.single.turned = true),
    (2, "cluster, entry 15", Method::Cluster, |o| o.instances.entry_cost = 15.0),
    (3, "single, isolated", Method::Single, |o| o.parts.isolate = true),
    (3, "single, opacity split", Method::Single, |o| o.parts.split_opacity = true),
    (3, "cluster, entry 40", Method::Cluster, |o| o.instances.entry_cost = 40.0),
    (3, "cluster, entry 5", Method::Cluster, |o| o.instances.entry_cost = 5.0),
    (3, "cluster, entry 15, extent 0.25", Method::Cluster, |o| in_boxes(o, 15.0, 0.25)),
    (3, "overlap", Method::Overlap, |_| {}),
    (3, "single, instances chosen", Method::Single, |o| o.instances.shared = Instances::Choose),
    (3, "cluster, entry 15, instances chosen", Method::Cluster, |o| {
        (o.instances.entry_cost, o.instances.shared) = (15.0, Instances::Choose)
    }),
    (3, "cluster by rays, entry 16", Method::Cluster, |o| cut_by_rays(o, 16.0)),
    (3, "cluster by rays, entry 8, without units", Method::Cluster, |o| without_units(o, 8.0)),
    (3, "single, instances in 12 pieces", Method::Single, |o| in_pieces(o, 12)),
    (3, "single, instances in 20 pieces", Method::Single, |o| in_pieces(o, 20)),
    (4, "single, instances in 16 pieces", Method::Single, |o| in_pieces(o, 16)),
    (4, "single, instances in 32 pieces", Method::Single, |o| in_pieces(o, 32)),
    (5, "single, instances in 8 pieces", Method::Single, |o| in_pieces(o, 8)),
    (5, "single, instances in 64 pieces", Method::Single, |o| in_pieces(o, 64)),
    (4, "per-object", Method::PerObject, |_| {}),
    (4, "bvh", Method::Bvh, |_| {}),
    (4, "cluster, entry 25", Method::Cluster, |o| o.instances.entry_cost = 25.0),
    (4, "cluster, entry 15, extent 0.5", Method::Cluster, |o| in_boxes(o, 15.0, 0.5)),
    (4, "cluster, entry 15, isolated", Method::Cluster, |o| (o.instances.entry_cost, o.parts.isolate) = (15.0, true)),
    (4, "cluster by rays, entry 2, divided", Method::Cluster, |o| {
        cut_by_rays(o, 2.0);
        o.cluster.search.divide = true;
    }),
    (4, "cluster by rays, entry 16, at most 65,536 triangles", Method::Cluster, |o| {
        cut_by_rays(o, 16.0);
        let most = &mut o.cluster.max_group_triangles;
        *most = Some(most.unwrap_or(u32::MAX).min(1 << 16));
    }),
    (4, "cluster by rays, entry 12", Method::Cluster, |o| cut_by_rays(o, 12.0)),
    (5, "cluster by rays, entry 20, without units", Method::Cluster, |o| without_units(o, 20.0)),
    (5, "cluster by rays, entry 4", Method::Cluster, |o| cut_by_rays(o, 4.0)),
    (5, "cluster by rays, entry 25", Method::Cluster, |o| cut_by_rays(o, 25.0)),
    (5, "cluster, entry 15, opacity split", Method::Cluster, |o| {
        (o.instances.entry_cost, o.parts.split_opacity) = (15.0, true)
    }),
    (5, "cluster, entry 2", Method::Cluster, |o| o.instances.entry_cost = 2.0),
    (5, "cluster, entry 15, extent 0.125", Method::Cluster, |o| in_boxes(o, 15.0, 0.125)),
    (6, "cluster, entry 80", Method::Cluster, |o| o.instances.entry_cost = 80.0),
    (6, "cluster by rays, entry 8", Method::Cluster, |o| cut_by_rays(o, 8.0)),
    (6, "cluster by rays, entry 12, without units", Method::Cluster, |o| without_units(o, 12.0)),
    (6, "cluster by rays, entry 40", Method::Cluster, |o| cut_by_rays(o, 40.0)),
];

/// Cuts by rays that are supplied later (see [`super::segments`]); one group keeps everything that gains nothing by
/// leaving it.
fn cut_by_rays(options: &mut Options, entry_cost: f64) {
    options.instances.entry_cost = entry_cost;
    let search = &mut options.cluster.search;
    (search.segments, search.divide) = (Some(Arc::default()), false);
}

/// Like [`cut_by_rays`], but only subtrees leave the group.
fn without_units(options: &mut Options, entry_cost: f64) {
    cut_by_rays(options, entry_cost);
    options.cluster.search.units = false;
}

/// Opens instances into a given number of pieces, for scenes in which predicting the best number fails.
fn in_pieces(options: &mut Options, pieces: u32) {
    let instances = &mut options.instances;
    (instances.shared, instances.pieces) = (Instances::Choose, instances.pieces.or(Some(pieces)));
}

/// Limits the boxes of groups to this share of the scene's length, or to the user's limit if that is smaller.
fn in_boxes(options: &mut Options, entry_cost: f64, max_extent_ratio: f64) {
    options.instances.entry_cost = entry_cost;
    let most = &mut options.cluster.max_group_extent_ratio;
    *most = Some(most.map_or(max_extent_ratio, |asked| asked.min(max_extent_ratio)));
}

/// The plans of an effort. If the user bounds groups, only the input and the plans that keep to the bounds remain.
pub(crate) fn plans(effort: Effort, options: &Options) -> Vec<Plan> {
    let is_bounded = options.cluster.is_bounded();
    let plan = |&(from, name, method, tell): &Entry| {
        let mut told = options.clone();
        told.cluster.search = ClusterSearch { improve: from >= SEARCHED, ..ClusterSearch::default() };
        tell(&mut told);
        Plan { id: PlanId::new(method, name), method, options: told }
    };
    let is_tried = |plan: &Plan| !is_bounded || plan.id.is_input() || plan.is_within_bounds();
    PLANS.iter().filter(|entry| entry.0 <= effort.0).map(plan).filter(is_tried).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::ClusterOptions;

    #[test]
    fn more_effort_looks_at_more_and_the_input_always_competes() {
        let counts: Vec<usize> = (0..=6).map(|e| plans(Effort::new(e), &Options::default()).len()).collect();
        assert!(counts.windows(2).all(|c| c[0] < c[1]), "{counts:?}");
        assert_eq!(counts[6], PLANS.len());
        assert!((0..=6).all(|e| plans(Effort::new(e), &Options::default())[0].method == Method::Keep));
        assert_eq!(Effort::new(200).level(), 6);
    }

    #[test]
    fn no_two_plans_have_one_name_and_each_begins_with_its_method() {
        let plans = plans(Effort::new(6), &Options::default());
        let names: Vec<String> = plans.iter().map(|plan| plan.id.to_string()).collect();
        assert!((1..names.len()).all(|i| !names[..i].contains(&names[i])), "{names:?}");
        assert!(plans.iter().zip(&names).all(|(plan, name)| name.starts_with(plan.method.name())), "{names:?}");
    }

    #[test]
    fn bounds_of_the_user_are_never_loosened() {
        let cluster = ClusterOptions { max_group_extent_ratio: Some(0.3), ..ClusterOptions::default() };
        let options = Options { cluster, ..Options::default() };
        for plan in plans(Effort::new(6), &options) {
            assert!(plan.id.is_input() || plan.is_within_bounds());
            let most = plan.options.cluster.max_group_extent_ratio;
            assert!(most.is_some_and(|ratio| ratio <= 0.3), "{}", plan.id);
        }
    }
}
