//! What a bake adds to a scene that it has read, which itself never changes.

use std::borrow::Cow;

use super::{InstanceId, Pinned, Scene, load};

/// What is laid over a scene: instances that must stay as they are for a reason found after loading. Costs nothing while it
/// is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overlay {
    /// By instance; those beyond the end are not pinned.
    pins: Vec<Option<Pinned>>,
}

impl Overlay {
    /// Pins instances.
    pub fn pin(&mut self, instances: &[InstanceId], reason: Pinned) {
        for instance in instances.iter().map(|i| i.0 as usize) {
            self.pins.resize(self.pins.len().max(instance + 1), None);
            self.pins[instance].get_or_insert(reason);
        }
    }

    /// Whether it changes nothing.
    pub fn is_empty(&self) -> bool {
        self.pins.is_empty()
    }
}

impl Scene {
    /// The scene with an overlay; it shares all meshes. With an instance the other copies of its node are pinned: one list of
    /// transforms serves them all, so that they stay or go together.
    pub fn overlaid(&self, overlay: &Overlay) -> Cow<'_, Scene> {
        if overlay.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut scene = self.clone();
        for (instance, pin) in scene.instances.iter_mut().zip(&overlay.pins) {
            instance.pinned = instance.pinned.or(*pin);
        }
        load::pin_whole_nodes(&mut scene.instances);
        Cow::Owned(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::test_scenes::room;

    #[test]
    fn pins_hold_for_all_copies_of_a_node_and_spare_the_scene_below() {
        let mut scene = room();
        let node = scene.instances[1].node;
        (scene.instances[2].node, scene.instances[2].copy) = (node, 1);
        scene.instances[3].pinned = Some(Pinned::Animated);
        let mut overlay = Overlay::default();
        assert!(matches!(scene.overlaid(&overlay), Cow::Borrowed(_)));
        overlay.pin(&[InstanceId(2), InstanceId(3)], Pinned::Precision);
        let pinned = scene.overlaid(&overlay);
        let pins: Vec<Option<Pinned>> = pinned.instances.iter().map(|i| i.pinned).collect();
        let precision = Some(Pinned::Precision);
        assert_eq!(pins[..4], [None, precision, precision, Some(Pinned::Animated)]);
        assert!(scene.instances[..3].iter().all(|i| i.pinned.is_none()));
        assert!(std::ptr::eq(&scene.meshes[0], &pinned.meshes[0]), "meshes are shared");
    }
}
