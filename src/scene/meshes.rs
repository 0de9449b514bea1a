//! The meshes of a scene, which several scenes can share.

use std::ops::{Index, IndexMut};
use std::sync::Arc;

use rayon::prelude::*;

use super::{Known, Mesh};

/// A list of meshes. Clones share the meshes, so that scenes that place the same meshes in different ways store them
/// once; a mesh is copied before it is changed in one of them.
#[derive(Clone, Debug, Default)]
pub struct Meshes(Vec<Arc<Mesh>>);

impl Meshes {
    /// Returns the number of meshes.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are no meshes.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns a mesh by its index.
    pub fn get(&self, index: usize) -> Option<&Mesh> {
        self.0.get(index).map(Arc::as_ref)
    }

    /// Returns a mesh by its index, for another scene to share.
    pub fn share(&self, index: usize) -> Arc<Mesh> {
        self.0[index].clone()
    }

    /// Iterates over the meshes in order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &Mesh> + ExactSizeIterator {
        self.0.iter().map(Arc::as_ref)
    }

    /// Like [`Meshes::iter`], in parallel.
    pub fn par_iter(&self) -> impl IndexedParallelIterator<Item = &Mesh> {
        self.0.par_iter().map(Arc::as_ref)
    }

    /// Iterates over the meshes for modification.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Mesh> {
        self.0.iter_mut().map(changeable)
    }

    /// Adds a mesh.
    pub fn push(&mut self, mesh: Mesh) {
        self.0.push(Arc::new(mesh));
    }
}

impl<'a> IntoIterator for &'a Meshes {
    type Item = &'a Mesh;
    type IntoIter = std::iter::Map<std::slice::Iter<'a, Arc<Mesh>>, fn(&'a Arc<Mesh>) -> &'a Mesh>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter().map(Arc::as_ref)
    }
}

impl Index<usize> for Meshes {
    type Output = Mesh;

    fn index(&self, index: usize) -> &Mesh {
        &self.0[index]
    }
}

impl IndexMut<usize> for Meshes {
    fn index_mut(&mut self, index: usize) -> &mut Mesh {
        changeable(&mut self.0[index])
    }
}

/// Returns a mesh for modification and discards its cached bounds.
fn changeable(mesh: &mut Arc<Mesh>) -> &mut Mesh {
    let mesh = Arc::make_mut(mesh);
    mesh.extent = Known::default();
    mesh.residual = Known::default();
    mesh
}

impl From<Vec<Mesh>> for Meshes {
    fn from(meshes: Vec<Mesh>) -> Meshes {
        meshes.into_iter().map(Arc::new).collect()
    }
}

impl FromIterator<Arc<Mesh>> for Meshes {
    fn from_iter<I: IntoIterator<Item = Arc<Mesh>>>(meshes: I) -> Meshes {
        Meshes(meshes.into_iter().collect())
    }
}
