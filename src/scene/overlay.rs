//! What a bake adds to a loaded scene, which itself never changes.

use std::borrow::Cow;
use std::sync::Arc;

use super::{InstanceId, Pinned, Scene, StandIn, load};

/// An overlay on a scene: meshes that stand in for their copies, and instances that must stay unchanged for a reason
/// found after loading. Costs nothing if empty.
#[derive(Clone, Debug, Default)]
pub struct Overlay {
    /// By instance; empty if there are none.
    stand_ins: Arc<Vec<Option<StandIn>>>,
    /// By instance; instances beyond the end are not pinned.
    pins: Vec<Option<Pinned>>,
}

impl Overlay {
    /// Creates an overlay of meshes that stand in for others, by instance.
    pub fn of_stand_ins(stand_ins: Vec<Option<StandIn>>) -> Overlay {
        Overlay { stand_ins: Arc::new(stand_ins), pins: Vec::new() }
    }

    /// Pins instances.
    pub fn pin(&mut self, instances: &[InstanceId], reason: Pinned) {
        for instance in instances.iter().map(|i| i.0 as usize) {
            self.pins.resize(self.pins.len().max(instance + 1), None);
            self.pins[instance].get_or_insert(reason);
        }
    }

    /// Whether the overlay changes nothing.
    pub fn is_empty(&self) -> bool {
        self.stand_ins.is_empty() && self.pins.is_empty()
    }
}

impl Scene {
    /// Returns the scene with an overlay applied; it shares all meshes. If an instance is pinned, so are the other
    /// copies of its node: they share one list of transforms, so they stay or go together.
    pub fn overlaid(&self, overlay: &Overlay) -> Cow<'_, Scene> {
        if overlay.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut scene = self.clone();
        if !overlay.stand_ins.is_empty() {
            scene.stand_ins = overlay.stand_ins.clone();
        }
        for (instance, stand_in) in scene.instances.iter_mut().zip(overlay.stand_ins.iter()) {
            let Some(stand_in) = stand_in else { continue };
            instance.mesh = stand_in.model;
            instance.transform = stand_in.transform * stand_in.motion;
        }
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
