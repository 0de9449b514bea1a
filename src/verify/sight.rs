//! What rays in single precision cannot tell.

use std::collections::BTreeSet;

use serde::Serialize;

use super::compare::{Tally, View};
use super::errors::ErrorSizes;
use crate::scene::Scene;

/// Objects named.
const NAMED: usize = 4;

/// Objects of the input so small, for their distance from where rays start or from the origin, that rounding may move a
/// ray by more than a tenth of their size: whether the output shows them cannot be told by rays.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CannotTell {
    /// Number of rays that hit something else, which only a slack larger than a tenth of an object explains.
    pub rays: u64,
    /// Number of such objects that no hit of the output shows beyond doubt.
    pub objects: usize,
    /// The names of the first few.
    pub names: Vec<String>,
}

impl CannotTell {
    /// Of a comparison with the input.
    pub(super) fn new(input: &View, tally: &Tally) -> CannotTell {
        let untold = |object: &u32| !tally.told_objects.contains(object);
        let unclear = tally.unclear_objects.iter().copied();
        CannotTell::of(tally.unclear, input, input.out_of_sight().chain(unclear).filter(untold).collect())
    }

    fn of(rays: u64, input: &View, objects: BTreeSet<u32>) -> CannotTell {
        let name = |&object: &u32| input.scene.instances[object as usize].display_name();
        CannotTell { rays, objects: objects.len(), names: objects.iter().take(NAMED).map(name).collect() }
    }

    /// Whether everything can be told.
    pub fn is_nothing(&self) -> bool {
        self.objects == 0
    }
}

/// What single precision may do to rays as long as the scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DeviceError {
    /// The bound of how far such a ray may be off where it meets an object: in world units, over the scene, over the
    /// object, and the object with the largest ratio.
    pub bound: ErrorSizes,
    /// The objects at which that is more than a tenth of their size; no rays were traced.
    pub cannot_tell: CannotTell,
}

impl DeviceError {
    /// Bounds the error from the boxes and transforms of a scene.
    pub fn of(scene: &Scene) -> DeviceError {
        let view = View::of_input(scene);
        let objects = view.farthest_off().map(|(i, off)| (i, view.over_size(i, off)));
        let worst = objects.reduce(|worst, other| if other.1 > worst.1 { other } else { worst });
        let max = view.farthest_off().map(|(_, off)| off.min(f64::MAX)).fold(0.0, f64::max);
        DeviceError {
            bound: ErrorSizes::new(scene, max, worst),
            cannot_tell: CannotTell::of(0, &view, view.out_of_sight().collect()),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::super::test_scenes::{cube, scene};
    use super::super::{Failure, Matching, Note, VerifyOptions, verify};
    use super::*;

    /// A cube of two units at this distance from the origin, beside `others` of 1000 units about the origin.
    fn far_cube(distance: f64, others: usize) -> Scene {
        let far = (0, DAffine3::from_translation(DVec3::new(distance, 0.0, 0.0)));
        let near = (0, DAffine3::from_scale(DVec3::splat(500.0)));
        let places: Vec<_> = std::iter::once(far).chain(std::iter::repeat_n(near, others)).collect();
        scene(vec![cube(0, None)], &places)
    }

    fn verified(before: &Scene, after: &Scene, matching: Matching) -> super::super::Verification {
        let options =
            VerifyOptions { rays_per_kind: 512, timed_rays_per_kind: Some(0), matching, ..VerifyOptions::default() };
        verify(before, after, &options)
    }

    #[test]
    fn a_far_object_that_is_gone_is_never_the_same_surface() {
        let (before, mut after) = (far_cube(3e7, 1), far_cube(3e7, 1));
        after.instances.remove(0);
        let found = verified(&before, &after, Matching::Surface);
        assert!(!found.passed(), "{found:?}");
        assert!(found.failures.iter().any(|f| matches!(f, Failure::CannotTell(what) if what.names == ["node 0"])));
    }

    #[test]
    fn what_rays_cannot_tell_is_a_note_if_the_exact_comparison_can() {
        let scene = far_cube(3e7, 1);
        let found = verified(&scene, &scene, Matching::Identity);
        assert!(found.passed() && found.cannot_tell.objects == 1, "{found:?}");
        assert!(found.notes.iter().any(|note| matches!(note, Note::CannotTell(_))));
    }

    #[test]
    fn near_objects_can_be_told() {
        let scene = far_cube(1e3, 1);
        for matching in [Matching::Identity, Matching::Surface] {
            let found = verified(&scene, &scene, matching);
            assert!(found.passed() && found.cannot_tell == CannotTell::default(), "{found:?}");
        }
    }

    #[test]
    fn nothing_hit_is_nothing_told() {
        let flat = scene(vec![cube(0, None)], &[(0, DAffine3::from_scale(DVec3::new(1.0, 0.0, 0.0)))]);
        let found = verified(&flat, &flat, Matching::Surface);
        assert!(found.failures.contains(&Failure::NothingHit), "{found:?}");
    }

    #[test]
    fn error_of_a_device_grows_with_the_distance_and_names_the_object() {
        let [near, far] = [1e4, 3e7].map(|distance| DeviceError::of(&far_cube(distance, 1)));
        assert!(near.cannot_tell.is_nothing() && far.cannot_tell.names == ["node 0"], "{near:?} {far:?}");
        assert!(far.bound.ratio_of_object > 1e3 * near.bound.ratio_of_object);
        assert_eq!(far.bound.object.as_deref(), Some("node 0"));
    }
}
