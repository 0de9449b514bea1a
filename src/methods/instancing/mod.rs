//! Decides which instances a method may bake and which stay instanced.
//!
//! A mesh that one instance places costs nothing to restructure, so the method always gets it. For a mesh that several
//! instances place, [`Instances`] selects the rule: [`bake_or_keep`] bakes all of its instances or none, [`choose`]
//! weighs keeping, opening and baking them. Both obey two limits: [`InstanceOptions::max_bytes_ratio`] is the user's,
//! and [`MOST_COPIED_TRIANGLES`] keeps a small file with many instances of a large mesh from exhausting memory.

mod bake_or_keep;
mod choose;
mod cut;
mod improve;
mod known;
mod notes;
mod pieces;
mod plan;
mod tally;
#[cfg(test)]
mod tests;

pub(super) use known::Known;

use crate::cost::bytes;
use crate::layout::Layout;
use crate::layout::builder::{Builder, Part};
use crate::methods::{InstanceOptions, Instances};
use crate::scene::{Bounds, InstanceId, Scene};
use glam::DAffine3;

/// Maximum number of triangles written out for instances of shared meshes: a few gigabytes of references, vertices and
/// indices.
const MOST_COPIED_TRIANGLES: u64 = 1 << 26;

/// Maximum number of triangles restructured: `VkPhysicalDeviceAccelerationStructurePropertiesKHR::maxPrimitiveCount` is
/// at least 2^29 - 1, and `single` puts all of them into one BLAS.
const MOST_TRIANGLES: u64 = (1 << 29) - 1;

/// The treatment of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    /// It stays unchanged.
    Keep,
    /// The pieces of its mesh are placed instead of the mesh.
    Open,
    /// The method restructures its triangles.
    Bake,
}

/// Divides the instances of a scene into those that a method restructures and those that it leaves.
pub(super) struct Selection {
    fates: Vec<Fate>,
    /// The triangles of each piece of each opened mesh, parallel to the meshes.
    pieces: Vec<Vec<Part>>,
}

impl Selection {
    /// Returns the instances to restructure, in scene order.
    pub(super) fn baked(&self) -> impl Iterator<Item = InstanceId> + '_ {
        (0u32..).zip(&self.fates).filter(|(_, fate)| **fate == Fate::Bake).map(|(i, _)| InstanceId(i))
    }

    /// Adds the instances that are not restructured to a layout, unchanged or opened.
    pub(super) fn place_left(&self, layout: &mut Builder) {
        for (i, fate) in (0u32..).zip(&self.fates) {
            match fate {
                Fate::Keep => layout.keep(InstanceId(i)),
                Fate::Open => layout.open(InstanceId(i), &self.pieces),
                Fate::Bake => {}
            }
        }
    }

    /// Returns the world boxes of what [`Selection::place_left`] places, without instances outside the scene's core.
    pub(super) fn left_bounds(&self, scene: &Scene) -> Vec<Bounds> {
        let of_piece = |mesh: usize, piece: &Part| {
            let into = piece.frame.inverse();
            let corners = |&t: &u32| scene.meshes[mesh].corners(t).map(|p| into.transform_point3(p.as_dvec3()));
            (Bounds::of(piece.triangles.iter().flat_map(corners)), piece.frame)
        };
        let of_pieces = |mesh: usize| self.pieces[mesh].iter().map(|piece| of_piece(mesh, piece)).collect();
        let pieces: Vec<Vec<(Bounds, DAffine3)>> = (0..scene.meshes.len()).map(of_pieces).collect();
        let mut whole: Vec<Option<Bounds>> = vec![None; scene.meshes.len()];
        let mut bounds = Vec::new();
        for (i, (instance, fate)) in (0u32..).zip(scene.instances.iter().zip(&self.fates)) {
            let mesh = instance.mesh.0 as usize;
            match fate {
                _ if scene.core().sets_instance_apart(InstanceId(i)) => {}
                Fate::Keep => {
                    let local = whole[mesh].get_or_insert_with(|| scene.meshes[mesh].bounds());
                    bounds.push(local.transformed(&instance.transform));
                }
                Fate::Open => {
                    bounds.extend(pieces[mesh].iter().map(|(b, frame)| b.transformed(&(instance.transform * *frame))))
                }
                Fate::Bake => {}
            }
        }
        bounds
    }
}

/// Runs a method on as many instances as the limits and [`InstanceOptions::shared`] allow. `known` is what earlier runs
/// over the scene learned.
pub(super) fn bake_within_limits(
    scene: &Scene,
    options: &InstanceOptions,
    known: &Known,
    method: impl Fn(&Selection) -> Layout,
) -> Layout {
    match options.shared {
        Instances::BakeOrKeep => bake_or_keep::run(scene, options, method),
        Instances::Choose => choose::run(scene, options, known, method),
    }
}

/// Predicts the bytes of the scene as stored in the document, including the meshes for which others stand in.
fn input_bytes(scene: &Scene) -> u64 {
    bytes_of(scene, |_| true)
}

/// Predicts the bytes of the scene as its instances place it.
fn placed_bytes(scene: &Scene) -> u64 {
    let mut placed = vec![false; scene.meshes.len()];
    scene.instances.iter().for_each(|i| placed[i.mesh.0 as usize] = true);
    bytes_of(scene, |mesh| placed[mesh])
}

fn bytes_of(scene: &Scene, counts: impl Fn(usize) -> bool) -> u64 {
    let meshes = scene.meshes.iter().enumerate().filter(|(i, _)| counts(*i));
    let blases = meshes.map(|(_, m)| bytes::blas(m.triangle_count() as u64)).fold(0, u64::saturating_add);
    blases.saturating_add(bytes::tlas(scene.instances.len() as u64))
}
