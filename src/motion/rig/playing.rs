//! An animation that plays in a scene.

use glam::DAffine3;

use super::{Placed, Rig};
use crate::scene::{MeshId, Scene};

/// A [`Rig`] in a scene, which may be another layout of the one that it was read for.
#[derive(Clone, Debug)]
pub struct Playing {
    rig: Rig,
    /// The instances of the scene that move as a whole.
    placed: Vec<Placed>,
    /// For each body that the scene has: its index in the rig, the instance, and the mesh.
    bodies: Vec<(usize, u32, u32)>,
}

impl Playing {
    /// Lets an animation play in a scene. `place` returns the instance that places an instance of the scene for which the
    /// rig was read, as it is; `None` if there is none. Each instance that deforms gets a mesh of its own.
    pub fn new(rig: Rig, scene: &mut Scene, place: impl Fn(u32) -> Option<u32>) -> Playing {
        let placed = rig.placed.iter().filter_map(|p| Some(Placed { instance: place(p.instance)?, ..*p })).collect();
        let mut bodies = Vec::new();
        for (index, body) in rig.bodies.iter().enumerate() {
            if let Some(instance) = place(body.instance) {
                let of_instance = &mut scene.instances[instance as usize].mesh;
                let mesh = scene.meshes[of_instance.0 as usize].clone();
                *of_instance = MeshId(scene.meshes.len() as u32);
                bodies.push((index, instance, of_instance.0));
                scene.meshes.push(mesh);
            }
        }
        Playing { rig, placed, bodies }
    }

    /// Moves and deforms everything as at a time in seconds.
    pub fn advance(&self, scene: &mut Scene, time: f64) {
        let pose = self.rig.pose(time);
        for Placed { instance, node, copy } in &self.placed {
            let transform = pose.worlds[*node] * *copy;
            if transform.is_finite() {
                scene.instances[*instance as usize].transform = transform;
            }
        }
        for (index, instance, mesh) in &self.bodies {
            let body = &self.rig.bodies[*index];
            if body.is_in_world() {
                scene.instances[*instance as usize].transform = DAffine3::IDENTITY;
            }
            body.deform(&pose, &self.rig.skins, &mut scene.meshes[*mesh as usize]);
        }
    }

    /// Returns the meshes that deform.
    pub fn deforming(&self) -> Vec<usize> {
        self.bodies.iter().map(|(_, _, mesh)| *mesh as usize).collect()
    }

    /// Returns the instances that move or deform.
    pub fn instances(&self) -> impl Iterator<Item = u32> + '_ {
        self.placed.iter().map(|p| p.instance).chain(self.bodies.iter().map(|(_, instance, _)| *instance))
    }
}
