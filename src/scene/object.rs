//! Objects: geometries placed by instances.

use super::{Geometry, InstanceId, Scene, TriangleRef};

/// A geometry placed by an instance: what the thesis calls an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Object {
    /// Index into [`Scene::instances`].
    pub(crate) instance: u32,
    /// Index into the geometries of the instance's mesh.
    pub(crate) geometry: u32,
}

impl Object {
    /// Returns the placed geometry.
    pub(crate) fn geometry(self, scene: &Scene) -> &Geometry {
        &scene.mesh_of(InstanceId(self.instance)).geometries[self.geometry as usize]
    }

    /// Returns the placed triangles, in file order.
    pub(crate) fn triangles(self, scene: &Scene) -> impl Iterator<Item = TriangleRef> + use<> {
        let g = self.geometry(scene);
        let first = g.first_triangle;
        (first..first + g.triangles.len() as u32).map(move |triangle| TriangleRef { instance: self.instance, triangle })
    }
}

/// Returns the objects of some instances, in scene order.
pub(crate) fn objects(scene: &Scene, instances: impl IntoIterator<Item = InstanceId>) -> Vec<Object> {
    let of_instance = |i: InstanceId| {
        let count = scene.mesh_of(i).geometries.len() as u32;
        (0..count).map(move |geometry| Object { instance: i.0, geometry })
    };
    instances.into_iter().flat_map(of_instance).collect()
}
