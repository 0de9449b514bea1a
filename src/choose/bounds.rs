//! Limits on layouts: which candidates keep to them, and what exceeds them in the layout written.

use super::ChooseOptions;
use super::candidate::Candidate;
use super::outcome::{Excess, GroupCause, Note, Origin};
use crate::cost::Metrics;
use crate::layout::BlasPer;
use crate::layout::as_built;
use crate::layout::{Content, Layout, Placement};
use crate::methods::Method;
use crate::scene::{Bounds as Box3, Pinned, Scene};
use crate::verify::VerifyOptions;

/// Tolerance, as a share, between lengths that were computed in different ways.
const ROUNDING: f64 = 1e-6;

/// Limits on a layout.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    /// Predicted bytes of acceleration structures over the input's; infinite: no limit.
    pub(super) most_bytes_ratio: f64,
    /// Whether the user set `most_bytes_ratio`.
    pub(super) is_asked_for: bool,
    /// The input's predicted bytes.
    pub(super) input_bytes: u64,
    /// Triangles per group; `None`: no limit.
    pub(super) most_triangles: Option<u32>,
    /// Longest side of a group's world box over that of the scene; infinite: no limit.
    pub(super) longest_ratio: f64,
    /// Longest side of the scene's box.
    pub(super) extent: f64,
    /// What counts as one group.
    pub(super) blas_per: BlasPer,
}

impl Bounds {
    /// Returns the bounds that options set on layouts of a scene; `input` are the metrics of the input.
    pub(super) fn new(scene: &Scene, input: &Metrics, options: &ChooseOptions, verify: &VerifyOptions) -> Bounds {
        let layout = &options.layout;
        Bounds {
            most_bytes_ratio: options.max_bytes_ratio().unwrap_or(f64::INFINITY),
            is_asked_for: layout.instances.max_bytes_ratio.is_some(),
            input_bytes: input.as_bytes(),
            most_triangles: layout.cluster.max_group_triangles,
            longest_ratio: layout.cluster.max_group_extent_ratio.unwrap_or(f64::INFINITY),
            extent: scene.bounds().size().max_element(),
            blas_per: verify.build.blas_per,
        }
    }

    /// Returns how each candidate exceeds the bounds; `None` if it keeps to them. If no candidate keeps to a bound on
    /// groups, the best value among them replaces the bound: no method divides a triangle, and some do not divide their
    /// smallest parts. The input, which comes first, may have its own bytes whatever the bound.
    pub(super) fn refusals(&self, candidates: &[Candidate]) -> Vec<Option<Vec<Excess>>> {
        let smallest = candidates.iter().map(|c| c.largest_group).min().unwrap_or(0);
        let most_triangles = self.most_triangles.map_or(usize::MAX, |n| smallest.max(n as usize));
        let shortest = candidates.iter().map(|c| c.longest_group).fold(f64::INFINITY, f64::min);
        let longest = (self.longest_ratio * self.extent).max(shortest) * (1.0 + ROUNDING);
        let refusal = |c: &Candidate| {
            let triangles = (c.largest_group > most_triangles).then(|| self.excess_of_triangles(c.largest_group));
            let extent = (c.longest_group > longest).then(|| self.excess_of_extent(c.longest_group));
            let bytes = (!c.is_input() && self.are_too_many(c.predicted.as_bytes))
                .then(|| self.excess_of_bytes(c.predicted.as_bytes));
            let all: Vec<Excess> = [bytes, triangles, extent].into_iter().flatten().collect();
            Some(all).filter(|all| !all.is_empty())
        };
        candidates.iter().map(refusal).collect()
    }

    /// Returns which candidates are allowed; only the input if none keeps to the bounds.
    pub(super) fn allow(&self, candidates: &[Candidate]) -> Vec<bool> {
        let mut allowed: Vec<bool> = self.refusals(candidates).iter().map(Option::is_none).collect();
        if !allowed.contains(&true) {
            allowed.iter_mut().take(1).for_each(|input| *input = true);
        }
        allowed
    }

    fn are_too_many(&self, as_bytes: u64) -> bool {
        as_bytes as f64 > self.most_bytes_ratio * self.input_bytes as f64
    }

    fn excess_of_bytes(&self, as_bytes: u64) -> Excess {
        Excess::Bytes { ratio: as_bytes as f64 / self.input_bytes as f64, allowed: self.most_bytes_ratio }
    }

    fn excess_of_triangles(&self, count: usize) -> Excess {
        Excess::Triangles { count, allowed: self.most_triangles.unwrap_or(u32::MAX) }
    }

    fn excess_of_extent(&self, length: f64) -> Excess {
        Excess::Extent { ratio: length / self.extent, allowed: self.longest_ratio }
    }

    /// Returns what in a layout exceeds the user's limits, by how much, and why: one note per bound and cause.
    pub(super) fn notes(&self, scene: &Scene, layout: &Layout, origin: Origin) -> Vec<Note> {
        let built = as_built(scene, layout, self.blas_per);
        let causes = Causes::of(scene, &built, origin);
        let as_bytes = built.as_bytes(scene);
        let mut notes = Vec::new();
        if self.is_asked_for && self.are_too_many(as_bytes) {
            notes.push(Note::TooManyBytes { excess: self.excess_of_bytes(as_bytes), origin });
        }
        if let Some(most) = self.most_triangles {
            let size = |group: usize| built.groups[group].content.triangle_count(scene);
            let size = |group: usize| Some(size(group)).filter(|&size| size > most as usize);
            notes.extend(causes.notes(&|group| Some((size(group)? as f64, self.excess_of_triangles(size(group)?)))));
        }
        if self.longest_ratio.is_finite() {
            let lengths = lengths(scene, &built);
            let longest = self.longest_ratio * self.extent * (1.0 + ROUNDING);
            let length = |group: usize| Some(lengths[group]).filter(|&length| length > longest);
            notes.extend(causes.notes(&|group| Some((length(group)?, self.excess_of_extent(length(group)?)))));
        }
        notes
    }
}

/// Why a group is as large as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    Pinned(Pinned),
    /// This many instances place it.
    Shared(usize),
    Whole,
}

/// The causes for the groups of a layout.
struct Causes<'l> {
    layout: &'l Layout,
    of_groups: Vec<Cause>,
    origin: Origin,
}

impl<'l> Causes<'l> {
    fn of(scene: &Scene, layout: &'l Layout, origin: Origin) -> Causes<'l> {
        let mut of_groups = vec![Cause::Whole; layout.groups.len()];
        let mut placed = vec![0; layout.groups.len()];
        layout.placements.iter().for_each(|p| placed[p.group as usize] += 1);
        for (cause, &count) in of_groups.iter_mut().zip(&placed) {
            if count > 1 {
                *cause = Cause::Shared(count);
            }
        }
        for Placement { group, instance, .. } in &layout.placements {
            let pinned = instance.and_then(|i| scene.instances[i.0 as usize].pinned);
            if let (Some(why), Cause::Whole) = (pinned, of_groups[*group as usize]) {
                of_groups[*group as usize] = Cause::Pinned(why);
            }
        }
        Causes { layout, of_groups, origin }
    }

    /// Returns a note for each cause; `excess` returns the size of a group that exceeds the bound, and by how much.
    fn notes(&self, excess: &dyn Fn(usize) -> Option<(f64, Excess)>) -> Vec<Note> {
        let mut beyond: Vec<(usize, (f64, Excess))> =
            (0..self.of_groups.len()).filter_map(|group| Some((group, excess(group)?))).collect();
        beyond.sort_by(|a, b| b.1.0.total_cmp(&a.1.0).then(a.0.cmp(&b.0)));
        let kind = |group: usize| std::mem::discriminant(&self.of_groups[group]);
        let mut notes = Vec::new();
        for (i, &(group, (_, excess))) in beyond.iter().enumerate() {
            if beyond[..i].iter().any(|&(larger, _)| kind(larger) == kind(group)) {
                continue;
            }
            let others = beyond[i + 1..].iter().filter(|&&(other, _)| kind(other) == kind(group)).count();
            let name = self.layout.groups[group].name.clone();
            notes.push(Note::TooLarge { excess, group, name, others, cause: self.cause(group) });
        }
        notes
    }

    fn cause(&self, group: usize) -> GroupCause {
        let is_rewritten = !self.layout.groups[group].content.is_kept();
        match (self.of_groups[group], self.origin) {
            (Cause::Pinned(why), _) => GroupCause::Pinned(why),
            (Cause::Shared(count), _) if is_rewritten => GroupCause::Opened(count),
            (Cause::Shared(count), _) => GroupCause::Shared(count),
            (Cause::Whole, Origin::NoneKeeps) => GroupCause::InputStays,
            (Cause::Whole, Origin::Asked(Method::Cluster) | Origin::Chosen(_)) => GroupCause::Indivisible,
            (Cause::Whole, Origin::Asked(method)) => GroupCause::NotHeeded(method),
        }
    }
}

/// The longest side of each group's world box, over all of its placements.
fn lengths(scene: &Scene, layout: &Layout) -> Vec<f64> {
    let of_instances = scene.instance_boxes();
    let box_of_piece =
        |geometries: &[crate::layout::GroupGeometry], mesh: usize, placement: &Placement, frame: glam::DAffine3| {
            let world_from_mesh = placement.transform * frame.inverse();
            let triangles = geometries.iter().flat_map(|geometry| &geometry.triangles);
            let corners = triangles.flat_map(|at| scene.meshes[mesh].corners(at.triangle));
            Box3::of(corners.map(|corner| world_from_mesh.transform_point3(corner.as_dvec3())))
        };
    let mut lengths = vec![0.0f64; layout.groups.len()];
    for placement in &layout.placements {
        let bounds = match (&layout.groups[placement.group as usize].content, placement.instance) {
            (Content::Kept(_), Some(instance)) => of_instances[instance.0 as usize],
            (Content::Piece { mesh, frame, geometries }, _) => {
                box_of_piece(geometries, mesh.0 as usize, placement, *frame)
            }
            (Content::Baked { geometries, .. }, _) => {
                let triangles = geometries.iter().flat_map(|geometry| &geometry.triangles);
                Box3::of(triangles.flat_map(|&at| scene.world_corners(at)))
            }
            (Content::Kept(_), None) => Box3::EMPTY,
        };
        let length = &mut lengths[placement.group as usize];
        *length = length.max(bounds.size().max_element());
    }
    lengths
}
