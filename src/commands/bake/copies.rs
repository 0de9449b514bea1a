//! The pass "find copies": meshes that are copies of others become instances of them.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::time::Instant;

use raykiln_formats::Document;

use super::BakeOptions;
use super::turned::{self, Class};
use crate::choose::Choice;
use crate::commands::measure::measure_with;
use crate::copies::{self, CopiedMesh, Copies, Count, LEAST_SAVED_BYTES, LEAST_SAVED_RATIO, Likeness};
use crate::copies::{Looser, Materials, Saved, Sharing};
use crate::cost::Metrics;
use crate::cost::mesh_trees::MeshTrees;
use crate::layout::Layout;
use crate::scene::{InstanceId, Overlay, Scene};

/// Whether copies are looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FindCopies {
    /// For `auto`; the other methods restructure what the file holds, as it holds it.
    #[default]
    ByMethod,
    /// Whatever the method.
    Always(Likeness),
    /// Never.
    Off,
}

impl FindCopies {
    fn likeness(self, method: Choice) -> Option<Likeness> {
        match (self, method) {
            (FindCopies::Off, _) => None,
            (FindCopies::Always(likeness), _) => Some(likeness),
            (FindCopies::ByMethod, Choice::Auto) => Some(Likeness::Rigid),
            (FindCopies::ByMethod, Choice::Method(_)) => None,
        }
    }
}

/// Predicted cost that sharing may add, over the input's: what it saves is memory.
const MOST_COST_RATIO: f64 = 1.01;

/// Where so many classes cost too much together, one in so many of them is tried.
const FEWER: usize = 8;

/// The scene in which copies are shared, if any are.
pub(super) struct SharedScene<'a> {
    /// The scene with the meshes that stand in for their copies.
    pub(super) scene: Cow<'a, Scene>,
    /// Its metrics.
    pub(super) metrics: Metrics,
    /// What was done, and the seconds it took; `None` if the options leave the pass out.
    pub(super) sharing: Option<(Sharing, f64)>,
}

/// Lets meshes stand in for their copies, but for those whose looser boxes cost too much, and unless hardly any memory
/// is saved.
pub(super) fn share<'a>(
    doc: &Document,
    scene: &'a Scene,
    trees: &MeshTrees,
    before: &Metrics,
    options: &BakeOptions,
) -> SharedScene<'a> {
    let start = Instant::now();
    let Some(likeness) = options.copies.likeness(options.choose.method) else {
        return SharedScene { scene: Cow::Borrowed(scene), metrics: before.clone(), sharing: None };
    };
    let max_position_error_ratio = options.verify.max_position_error_ratio;
    let least_saved_bytes = if options.copies == FindCopies::ByMethod { least_saved_bytes(before) } else { 0 };
    let materials = Materials::Same;
    let search = copies::Options { likeness, materials, max_position_error_ratio, least_saved_bytes };
    let found = copies::find(doc, scene, &search);
    let (shared, sharing) = match (found.list.as_slice(), found.most_saved_bytes) {
        ([], Some(0) | None) => (None, Sharing::NoneAlike),
        ([], Some(most)) => (None, Sharing::NotLookedFor(most)),
        _ => worth_sharing(doc, scene, trees, before, &found, options),
    };
    let (overlay, metrics) = shared.unwrap_or_else(|| (Overlay::default(), before.clone()));
    SharedScene { scene: scene.overlaid(&overlay), metrics, sharing: Some((sharing, start.elapsed().as_secs_f64())) }
}

/// Whether a layout places a mesh that stands in for a copy, or pieces of one, rather than write it out.
pub(super) fn are_placed(scene: &Scene, layout: &Layout) -> bool {
    let is_copy = |i: InstanceId| scene.stand_in(i).is_some();
    layout.placements.iter().filter_map(|placement| placement.instance).any(is_copy)
}

/// What came of sharing in the output: if the input is left alone after all, or all copies are written out, none.
pub(super) fn as_written(sharing: Sharing, unchanged: bool, placed: bool) -> Sharing {
    match (sharing.is_applied(), unchanged, placed) {
        (false, ..) | (true, false, true) => sharing,
        (true, true, _) => Sharing::InputLeftAlone(Box::new(sharing)),
        (true, false, false) => Sharing::WrittenOut(Box::new(sharing)),
    }
}

/// Predicted bytes of acceleration structures that `auto` must save to share at all.
fn least_saved_bytes(before: &Metrics) -> u64 {
    LEAST_SAVED_BYTES.max((LEAST_SAVED_RATIO * before.as_bytes() as f64).ceil() as u64)
}

/// The copies to share, with the metrics of the scene that shares them, and why; `None` if none are to be shared.
fn worth_sharing(
    doc: &Document,
    scene: &Scene,
    trees: &MeshTrees,
    before: &Metrics,
    found: &Copies,
    options: &BakeOptions,
) -> (Option<(Overlay, Metrics)>, Sharing) {
    let Part { shared, overlay, metrics, cost_of_all } = best_part(doc, scene, trees, before, found, options);
    let looser = cost_of_all.map(|cost| Looser { cost, before: before.two_level_cost });
    if let Some(looser) = looser.filter(|_| shared.list.is_empty()) {
        return (None, Sharing::TooLoose(Count::of(&found.list), looser));
    }
    let left_out = looser.map(|looser| (Count::of(&left_out(found, &shared)), looser));
    let as_bytes = before.as_bytes().saturating_sub(metrics.as_bytes());
    let saved = Saved { shared: Count::of(&shared.list), as_bytes, left_out };
    if options.copies == FindCopies::ByMethod && as_bytes < least_saved_bytes(before) {
        return (None, Sharing::SavesTooLittle(saved));
    }
    (Some((overlay, metrics)), Sharing::Shared { saved, stored_bytes: stored_bytes(doc, scene, &shared) })
}

/// The copies found that are not shared.
fn left_out(found: &Copies, shared: &Copies) -> Vec<CopiedMesh> {
    let is_shared: BTreeSet<_> = shared.list.iter().map(|copy| copy.mesh).collect();
    found.list.iter().filter(|copy| !is_shared.contains(&copy.mesh)).cloned().collect()
}

/// Copies that are shared in a scene.
struct Part {
    shared: Copies,
    overlay: Overlay,
    metrics: Metrics,
    /// The predicted cost of sharing all there are, if that is too much.
    cost_of_all: Option<f64>,
}

/// Shares all copies, or those whose boxes stay as tight and what looser ones [`MOST_COST_RATIO`] affords: the classes
/// that save most bytes for what they cost. What is turned and not shared is still shared with what equals it exactly.
fn best_part(
    doc: &Document,
    scene: &Scene,
    trees: &MeshTrees,
    before: &Metrics,
    found: &Copies,
    options: &BakeOptions,
) -> Part {
    let per = options.verify.build.blas_per;
    let fits = |metrics: &Metrics| metrics.two_level_cost <= MOST_COST_RATIO * before.two_level_cost;
    let overlay = found.overlay(scene);
    let with_all = scene.overlaid(&overlay);
    let all = measure_with(&with_all, trees, per);
    if fits(&all) {
        return Part { shared: found.clone(), overlay, metrics: all, cost_of_all: None };
    }
    let costs_with = turned::costs_of_instances(&with_all, trees, per);
    let costs_without = turned::costs_of_instances(scene, trees, per);
    let classes = turned::classes(scene, found, [&costs_without, &costs_with]);
    let mut count = turned::affordable(&classes, (MOST_COST_RATIO - 1.0) * before.two_level_cost);
    // What the TLAS makes of looser boxes is in no class's cost: fewer are tried where it takes the rest beyond the limit.
    loop {
        let shared = without(doc, scene, found, &classes[count..], options.verify.max_position_error_ratio);
        let overlay = shared.overlay(scene);
        let metrics =
            if overlay.is_empty() { before.clone() } else { measure_with(&scene.overlaid(&overlay), trees, per) };
        if count == 0 || fits(&metrics) {
            return Part { shared, overlay, metrics, cost_of_all: Some(all.two_level_cost) };
        }
        count /= FEWER;
    }
}

/// The copies but for some turned ones, of which only the exact copies of one another stay.
fn without(doc: &Document, scene: &Scene, found: &Copies, classes: &[Class], max_position_error_ratio: f64) -> Copies {
    let models: BTreeSet<_> = classes.iter().map(|class| class.model).collect();
    let is_left_out = |copy: &CopiedMesh| !copy.keeps_boxes() && models.contains(&copy.model);
    let (left_out, mut list): (Vec<_>, Vec<_>) = found.list.iter().cloned().partition(is_left_out);
    list.extend(copies::find_exact_among(doc, scene, &left_out, max_position_error_ratio).list);
    list.sort_unstable_by_key(|copy| copy.mesh);
    Copies { list, most_saved_bytes: None }
}

/// Bytes of the accessors that only the copies' meshes use.
fn stored_bytes(doc: &Document, scene: &Scene, found: &Copies) -> u64 {
    let source = |copy: &CopiedMesh| scene.meshes[copy.mesh.0 as usize].source as usize;
    doc.bytes_used_only_by(&found.list.iter().map(source).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::methods::{self, Method};
    use crate::scene::MeshId;
    use crate::verify::test_scenes::{cube, scene};
    use glam::DAffine3;

    #[test]
    fn sharing_that_is_written_out_again_is_not_applied() {
        let saved = Saved { shared: Count { copies: 2, models: 1 }, as_bytes: 4096, left_out: None };
        let shared = Sharing::Shared { saved, stored_bytes: 10 };
        let written = |unchanged, placed| as_written(shared.clone(), unchanged, placed).is_applied();
        assert_eq!([written(false, true), written(false, false)], [true, false]);
        assert_eq!([written(true, true), written(true, false)], [false, false]);
        let out = as_written(shared.clone(), false, false).to_string();
        let first = shared.to_string();
        assert_eq!(out, format!("{first}; but the layout chosen writes all of them out"));
        assert_eq!(as_written(Sharing::NoneAlike, true, false), Sharing::NoneAlike);
    }

    #[test]
    fn copies_are_placed_where_their_model_is() {
        let scene = scene(vec![cube(0, None), cube(1, None)], &[0, 1].map(|mesh| (mesh, DAffine3::IDENTITY)));
        let copy = CopiedMesh { mesh: MeshId(1), model: MeshId(0), motion: DAffine3::IDENTITY, order: None };
        let placed =
            |scene: &Scene, method| are_placed(scene, &methods::run(method, scene, &methods::Options::default()));
        assert!(!placed(&scene, Method::Keep));
        let overlay = Copies { list: vec![copy], most_saved_bytes: None }.overlay(&scene);
        let shared = scene.overlaid(&overlay);
        assert!(placed(&shared, Method::Keep) && !placed(&shared, Method::Single));
    }
}
