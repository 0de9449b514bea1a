//! Frames that keep the rounding of baked positions within a limit.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::layout::{Content, GroupGeometry, Layout};
use crate::scene::{Bounds, InstanceId, Scene};

/// What [`settle`] did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settled {
    /// Groups whose positions are now stored relative to their centre.
    pub centred: usize,
    /// Instances whose triangles cannot be written out within the limit.
    pub refused: Vec<InstanceId>,
}

/// Stores each baked group relative to its centre where rounding world positions to single precision would move a
/// vertex farther than `limit` (world units), and names the instances for which even that does not suffice.
pub fn settle(scene: &Scene, layout: &mut Layout, limit: f64) -> Settled {
    let mut settled = Settled::default();
    for group in &mut layout.groups {
        let Content::Baked { frame, geometries } = &mut group.content else { continue };
        if largest_error(scene, geometries, *frame) <= limit {
            continue;
        }
        *frame = centre(scene, geometries);
        settled.centred += 1;
        if largest_error(scene, geometries, *frame) > limit {
            settled.refused.extend(geometries.iter().flat_map(|g| g.triangles.iter().map(|t| InstanceId(t.instance))));
            settled.refused.sort_unstable();
            settled.refused.dedup();
        }
    }
    for placement in &mut layout.placements {
        if let Content::Baked { frame, .. } = &layout.groups[placement.group as usize].content {
            placement.transform = *frame;
        }
    }
    settled
}

/// The largest distance, in world units, between a corner and its position stored in `frame`.
fn largest_error(scene: &Scene, geometries: &[GroupGeometry], frame: DAffine3) -> f64 {
    let into = frame.inverse();
    let error = |instance: u32, corner: glam::Vec3| {
        let group_from_mesh = into * scene.instances[instance as usize].transform;
        if group_from_mesh == DAffine3::IDENTITY {
            return 0.0;
        }
        let exact = group_from_mesh.transform_point3(corner.as_dvec3());
        let moved = exact.as_vec3().as_dvec3().distance(exact);
        // A position that overflows single precision is off by more than any limit.
        if moved.is_finite() { moved } else { f64::INFINITY }
    };
    geometries
        .par_iter()
        .flat_map(|g| g.triangles.par_iter())
        .map(|at| {
            let corners = scene.mesh_of(InstanceId(at.instance)).corners(at.triangle);
            corners.into_iter().map(|c| error(at.instance, c)).fold(0.0, f64::max)
        })
        .reduce(|| 0.0, f64::max)
}

/// The translation to the middle of a group, rounded so that a file that is read in single precision holds it.
fn centre(scene: &Scene, geometries: &[GroupGeometry]) -> DAffine3 {
    let corners = geometries.iter().flat_map(|g| g.triangles.iter().flat_map(|&at| scene.world_corners(at)));
    let middle = Bounds::of(corners).center().as_vec3().as_dvec3();
    DAffine3::from_translation(if middle.is_finite() { middle } else { DVec3::ZERO })
}
