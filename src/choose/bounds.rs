//! What a layout may take, which candidates keep to it, and what of a layout that is written does not.

use super::candidate::Candidate;
use crate::layout::BlasPer;
use crate::layout::as_built;
use crate::layout::{Content, Layout, Placement};
use crate::methods::Method;
use crate::scene::{Bounds as Box3, Pinned, Scene};
use crate::words::{counted, grouped};

/// Lengths that were computed in different ways may differ by this share.
const ROUNDING: f64 = 1e-6;

/// What a layout may take.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    /// Predicted bytes of acceleration structures over the input's; infinite: any.
    pub(super) most_bytes_ratio: f64,
    /// Whether the user set it.
    pub(super) is_asked_for: bool,
    /// The input's predicted bytes.
    pub(super) input_bytes: u64,
    /// Triangles of a group; `None`: any number.
    pub(super) most_triangles: Option<u32>,
    /// Longest side of the world box of a group over that of the scene; infinite: any length.
    pub(super) longest_ratio: f64,
    /// Longest side of the scene's box.
    pub(super) extent: f64,
    /// What is one group.
    pub(super) blas_per: BlasPer,
}

/// Why what is written is what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// The user asked for a method.
    Asked(Method),
    /// A candidate was chosen.
    Chosen(Method),
    /// No candidate keeps to the bounds.
    NoneKeeps,
}

impl Bounds {
    /// For each candidate what of it is beyond the bounds, in words; `None` where it keeps to them. Where no candidate keeps to a
    /// bound on groups, what the best of them comes to stands for the bound: no method divides a triangle, nor some of the
    /// smallest parts. The input, which is the first one, may have its own bytes, whatever the bound.
    pub(super) fn refusals(&self, candidates: &[Candidate]) -> Vec<Option<String>> {
        let smallest = candidates.iter().map(|c| c.largest_group).min().unwrap_or(0);
        let most_triangles = self.most_triangles.map_or(usize::MAX, |n| smallest.max(n as usize));
        let shortest = candidates.iter().map(|c| c.longest_group).fold(f64::INFINITY, f64::min);
        let longest = (self.longest_ratio * self.extent).max(shortest) * (1.0 + ROUNDING);
        let refusal = |c: &Candidate| {
            let triangles = (c.largest_group > most_triangles).then(|| self.words_of_triangles(c.largest_group));
            let length = (c.longest_group > longest).then(|| self.words_of_length(c.longest_group));
            let bytes = (!c.is_input() && self.are_too_many(c.as_bytes)).then(|| self.words_of_bytes(c.as_bytes));
            let all: Vec<String> = [bytes, triangles, length].into_iter().flatten().collect();
            (!all.is_empty()).then(|| all.join("; "))
        };
        candidates.iter().map(refusal).collect()
    }

    /// Which candidates may be taken; the input where none keeps to the bounds.
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

    fn words_of_bytes(&self, as_bytes: u64) -> String {
        let ratio = as_bytes as f64 / self.input_bytes as f64;
        format!("{} times the input's bytes, {} allowed", above(ratio, self.most_bytes_ratio), self.most_bytes_ratio)
    }

    fn words_of_triangles(&self, count: usize) -> String {
        let most = grouped(u64::from(self.most_triangles.unwrap_or(u32::MAX)));
        format!("a group of {}, {most} allowed", counted(count, "triangle"))
    }

    fn words_of_length(&self, length: f64) -> String {
        let ratio = above(length / self.extent, self.longest_ratio);
        format!("a group {ratio} of the scene's length, {} allowed", self.longest_ratio)
    }

    /// What of a layout is beyond what the user allows, how far, and why: a note for each bound and cause. `pins` say why
    /// each instance of the scene is pinned.
    pub(super) fn notes(&self, scene: &Scene, layout: &Layout, origin: Origin, pins: &[Option<Pinned>]) -> Vec<String> {
        let built = as_built(scene, layout, self.blas_per);
        let causes = Causes::of(pins, &built, origin);
        let mut notes = self.note_of_bytes(built.as_bytes(scene), origin);
        if let Some(most) = self.most_triangles {
            let size = |group: usize| built.groups[group].content.triangle_count(scene);
            let excess = |group: usize| (size(group) > most as usize).then(|| size(group) as f64);
            let words = |group: usize| counted(size(group), "triangle");
            notes.extend(causes.notes(&format!("--max-group-triangles {most}"), &excess, &words));
        }
        if self.longest_ratio.is_finite() {
            let lengths = lengths(scene, &built);
            let longest = self.longest_ratio * self.extent * (1.0 + ROUNDING);
            let excess = |group: usize| Some(lengths[group]).filter(|&length| length > longest);
            let words = |group: usize| {
                format!("a side of {} of the scene's", above(lengths[group] / self.extent, self.longest_ratio))
            };
            notes.extend(causes.notes(&format!("--max-group-extent-ratio {}", self.longest_ratio), &excess, &words));
        }
        notes
    }

    fn note_of_bytes(&self, as_bytes: u64, origin: Origin) -> Vec<String> {
        if !self.is_asked_for || !self.are_too_many(as_bytes) {
            return Vec::new();
        }
        let why = match origin {
            Origin::Asked(Method::Keep) => "`keep` changes nothing".to_owned(),
            Origin::Asked(method) => {
                format!("`{}` writes no instance out beyond it, but divides all the same", method.name())
            }
            Origin::Chosen(_) => "that is the input as it is, which always competes".to_owned(),
            Origin::NoneKeeps => "no candidate keeps to all that is allowed, and the input stays".to_owned(),
        };
        vec![format!(
            "--max-bytes-ratio {} does not hold: {}: {why}",
            self.most_bytes_ratio,
            self.words_of_bytes(as_bytes)
        )]
    }
}

/// A ratio above a bound to as few digits as tell the two apart, but two.
fn above(ratio: f64, bound: f64) -> String {
    let digits = (2..6).find(|&digits| {
        let unit = 10f64.powi(digits);
        (ratio * unit).round() / unit > bound
    });
    format!("{ratio:.0$}", digits.unwrap_or(6) as usize)
}

/// Why a group is as large as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Cause {
    Pinned(&'static str),
    /// So many instances place it.
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
    fn of(pins: &[Option<Pinned>], layout: &'l Layout, origin: Origin) -> Causes<'l> {
        let mut of_groups = vec![Cause::Whole; layout.groups.len()];
        let mut placed = vec![0; layout.groups.len()];
        layout.placements.iter().for_each(|p| placed[p.group as usize] += 1);
        for (cause, &count) in of_groups.iter_mut().zip(&placed) {
            if count > 1 {
                *cause = Cause::Shared(count);
            }
        }
        for Placement { group, instance, .. } in &layout.placements {
            let pinned = instance.and_then(|i| pins[i.0 as usize]);
            if let (Some(why), Cause::Whole) = (pinned, of_groups[*group as usize]) {
                of_groups[*group as usize] = Cause::Pinned(words_of(why));
            }
        }
        Causes { layout, of_groups, origin }
    }

    /// A note for each cause; `excess` gives the size of a group that is beyond the bound, `words` says it.
    fn notes(
        &self,
        bound: &str,
        excess: &dyn Fn(usize) -> Option<f64>,
        words: &dyn Fn(usize) -> String,
    ) -> Vec<String> {
        let mut beyond: Vec<(usize, f64)> =
            (0..self.of_groups.len()).filter_map(|group| Some((group, excess(group)?))).collect();
        beyond.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let kind = |group: usize| std::mem::discriminant(&self.of_groups[group]);
        let mut notes: Vec<String> = Vec::new();
        for (i, &(group, _)) in beyond.iter().enumerate() {
            if beyond[..i].iter().any(|&(larger, _)| kind(larger) == kind(group)) {
                continue;
            }
            let others = beyond[i + 1..].iter().filter(|&&(other, _)| kind(other) == kind(group)).count();
            let others = match others {
                0 => String::new(),
                n => format!(", and {} more likewise", counted(n, "group")),
            };
            let name = match self.layout.groups[group].name.as_str() {
                "" => format!("group {group}"),
                name => format!("group `{name}`"),
            };
            notes.push(format!("{bound} does not hold: {name} has {}{others}: {}", words(group), self.why(group)));
        }
        notes
    }

    fn why(&self, group: usize) -> String {
        let is_rewritten = !self.layout.groups[group].content.is_kept();
        match (self.of_groups[group], self.origin) {
            (Cause::Pinned(why), _) => format!("it stays as it is: {why}"),
            (Cause::Shared(count), _) if is_rewritten => {
                format!("it is placed {count} times, and a mesh is not opened further")
            }
            (Cause::Shared(count), _) => format!("its mesh is placed {count} times and stays whole"),
            (Cause::Whole, Origin::NoneKeeps) => {
                "no candidate keeps to all that is allowed, and the input stays".to_owned()
            }
            (Cause::Whole, Origin::Asked(Method::Cluster) | Origin::Chosen(_)) => {
                "it is one triangle, or a leaf of the tree that is cut".to_owned()
            }
            (Cause::Whole, Origin::Asked(method)) => format!("`{}` does not heed it", method.name()),
        }
    }
}

fn words_of(pinned: Pinned) -> &'static str {
    match pinned {
        Pinned::Animated => "it is animated",
        Pinned::Skinned => "it has a skin",
        Pinned::Morphed => "it has morph targets",
        Pinned::Protected => "--keep protects it",
        Pinned::OtherScene => "another scene of the file shows it too",
        Pinned::UnknownExtension => "it has an extension that is not known",
        Pinned::Singular => "its transform is singular",
        Pinned::Precision => "written out, its vertices would move too far",
    }
}

/// The longest side of the world box of each group, of the placement where it is longest.
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
