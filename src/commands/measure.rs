//! Metrics of scenes as they are.

use crate::cost::mesh_trees::MeshTrees;
use crate::cost::{self, Metrics};
use crate::layout::{self, BlasPer};
use crate::methods::{self, Method};
use crate::report::notes::built_per_primitive;
use crate::scene::Scene;
use crate::verify::Sides;

/// Returns the metrics of an unchanged scene with one BLAS per mesh.
pub(super) fn measure_as_is(scene: &Scene) -> Metrics {
    measure_as_built(scene, BlasPer::Mesh)
}

/// Returns the metrics of an unchanged scene as its consumer builds it.
pub(super) fn measure_as_built(scene: &Scene, per: BlasPer) -> Metrics {
    measure_with(scene, &MeshTrees::default(), per)
}

/// Like [`measure_as_built`], with known trees for the scene's meshes.
pub(crate) fn measure_with(scene: &Scene, trees: &MeshTrees, per: BlasPer) -> Metrics {
    let layout = methods::run(Method::Keep, scene, &methods::Options::default());
    cost::measure_with(scene, &layout::as_built(scene, &layout, per), trees)
}

/// If metrics are for one BLAS per primitive, returns a note on what both scenes would cost with one per mesh.
pub(crate) fn per_primitive_note(per: BlasPer, scenes: Sides<&Scene>, metrics: Sides<&Metrics>) -> Vec<String> {
    if per == BlasPer::Mesh {
        return Vec::new();
    }
    let of_meshes = scenes.map(measure_as_is);
    vec![built_per_primitive(metrics, of_meshes.as_ref())]
}
