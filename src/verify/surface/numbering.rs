//! [`Numbering`]: one running number for each placed triangle of a scene.

use crate::scene::{Scene, TriangleRef};

/// Numbers the placed triangles of a scene from 0, in the order of instances.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Numbering {
    /// The first number of each instance, and the number of triangles.
    pub(super) starts: Vec<usize>,
}

impl Numbering {
    pub(super) fn of(scene: &Scene) -> Numbering {
        let mut starts = vec![0];
        for instance in &scene.instances {
            let count = scene.meshes[instance.mesh.0 as usize].triangle_count();
            starts.push(starts[starts.len() - 1] + count);
        }
        Numbering { starts }
    }

    /// Returns the number of triangles.
    pub(super) fn total(&self) -> usize {
        self.starts[self.starts.len() - 1]
    }

    pub(super) fn index(&self, at: TriangleRef) -> usize {
        self.starts[at.instance as usize] + at.triangle as usize
    }

    pub(super) fn triangle(&self, index: usize) -> TriangleRef {
        let instance = self.starts.partition_point(|&start| start <= index) - 1;
        TriangleRef { instance: instance as u32, triangle: (index - self.starts[instance]) as u32 }
    }
}
