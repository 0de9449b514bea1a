//! Meshes that stand in for their copies.

use std::sync::Arc;

use glam::DAffine3;

use super::{InstanceId, MeshId, Scene, TriangleOrder, TriangleRef};

/// What an instance represents when its mesh stands in for the mesh that its node places in the document.
#[derive(Clone, Debug)]
pub struct StandIn {
    /// The mesh placed instead.
    pub model: MeshId,
    /// The mesh that the node places in the document.
    pub copy: MeshId,
    /// `copy` from `model`: rotation, translation and uniform scale, possibly mirrored; each coefficient is exactly
    /// representable as a 32-bit float.
    pub motion: DAffine3,
    /// World from `copy`.
    pub transform: DAffine3,
    /// For each triangle of `model`, the triangle of `copy` that it represents; `None` if both have the same order.
    pub order: Option<Arc<TriangleOrder>>,
}

/// The location of a triangle in the document.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    /// The mesh that the node places.
    pub mesh: MeshId,
    /// Triangle index in that mesh.
    pub triangle: u32,
    /// World from that mesh.
    pub transform: DAffine3,
}

impl Scene {
    /// Returns what the mesh that an instance places stands in for.
    pub fn stand_in(&self, instance: InstanceId) -> Option<&StandIn> {
        self.stand_ins.get(instance.0 as usize)?.as_ref()
    }

    /// Returns the location of a placed triangle in the document, which is in a different mesh than the one placed if
    /// that stands in for another.
    ///
    /// # Panics
    /// If there is no such triangle, or an order of triangles is invalid.
    pub fn origin(&self, at: TriangleRef) -> Origin {
        let instance = &self.instances[at.instance as usize];
        let Some(stand_in) = self.stand_in(InstanceId(at.instance)) else {
            return Origin { mesh: instance.mesh, triangle: at.triangle, transform: instance.transform };
        };
        let triangle = match &stand_in.order {
            Some(order) => order.triangle(at.triangle).expect("an order names every triangle"),
            None => at.triangle,
        };
        Origin { mesh: stand_in.copy, triangle, transform: stand_in.transform }
    }

    /// Returns the document index of the mesh that an instance's node places.
    pub fn document_mesh(&self, instance: InstanceId) -> u32 {
        let placed = self.instances[instance.0 as usize].mesh;
        let mesh = self.stand_in(instance).map_or(placed, |s| s.copy);
        self.meshes[mesh.0 as usize].source
    }
}
