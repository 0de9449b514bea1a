//! How far a layout and a tracer are from the truth: positions, distances, and rays lost at seams.
//!
//! The truth is the true closest hit of each ray, in double precision, over the exact positions of the input
//! ([`Scene::world_corners`]).

use glam::DVec3;
use rayon::prelude::*;

use crate::layout::{Layout, shown};
use crate::scene::{Bounds, InstanceId, Scene, TriangleRef};
use crate::verify::VerifyOptions;
use crate::verify::approach::exact_distance;
use crate::verify::cpu::{Reference, TrueHit, TwoLevel};
use crate::verify::precisions::{DistanceErrors, per_million};
use crate::verify::probe::Probe;
use crate::verify::rays::{self, Ray};
use crate::verify::seams::Aimed;

/// How far corners are from where the input has them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PositionErrors {
    /// Largest distance, over the diagonal of the scene's box.
    pub(super) ratio: f64,
    /// Largest distance over the diagonal of the corner's own object, of the objects that are not points.
    pub(super) object_ratio: f64,
}

/// Errors of what rays hit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct RayErrors {
    /// Of distances; a hit of the true triangle is never far.
    pub(super) distances: DistanceErrors,
    /// Rays aimed at closed edges and vertices that pass through, per million; `None` if nothing is closed.
    pub(super) lost_per_million: Option<f64>,
}

/// The rays of a scene and what they truly hit.
pub(super) struct Truth {
    rays: Vec<Ray>,
    /// For each ray the triangle and the distance.
    hits: Vec<Option<(TriangleRef, f64)>>,
    /// Half the diagonal of the scene's box.
    radius: f64,
    aimed: Aimed,
}

impl Truth {
    /// Generates rays of all kinds and aims as many at each class of seams; `displacement` is the largest distance by
    /// which any layout moves a corner, in world units.
    pub(super) fn new(scene: &Scene, trees: &TwoLevel, displacement: f64, options: &VerifyOptions) -> Truth {
        let reference = Reference::new(trees);
        let rays = rays::generate(scene, &reference, &options.sampling(options.rays_per_kind as usize, None));
        let radius = rays.radius;
        let rays: Vec<Ray> = rays.kinds.values().flatten().copied().collect();
        let exact = |(hit, ray): (Option<TrueHit>, &Ray)| hit.map(|hit| (hit.at, exact_distance(scene, ray, &hit)));
        let hits = reference.closest(&rays).into_par_iter().zip(&rays).map(exact).collect();
        Truth { rays, hits, radius, aimed: Aimed::new(scene, None, displacement, options) }
    }

    /// Traces the rays through a layout's stored scene.
    ///
    /// # Errors
    /// Those of the tracer.
    pub(super) fn errors(&self, probe: &dyn Probe, layout: &Layout) -> Result<RayErrors, String> {
        let found = probe.closest(&self.rays)?;
        let lost = probe.occluded(&self.aimed.rays)?.iter().filter(|hit| !**hit).count() as u64;
        let aimed = self.aimed.rays.len();
        Ok(RayErrors {
            distances: DistanceErrors::of(&found, &self.hits, self.radius, |at, truly| shown(layout, at) == truly),
            lost_per_million: (aimed > 0).then(|| per_million(lost, aimed)),
        })
    }
}

/// The box and the largest error of each object.
type OfObjects = Vec<(Bounds, f64)>;

/// Compares all corners of a layout's stored scene with those of the input.
pub(super) fn position_errors(scene: &Scene, layout: &Layout, stored: &Scene) -> PositionErrors {
    let firsts = first_objects(scene);
    let object = |at: TriangleRef| {
        let (geometry, _) = scene.mesh_of(InstanceId(at.instance)).locate(at.triangle);
        firsts[at.instance as usize] + geometry
    };
    let mut of_objects: OfObjects = vec![(Bounds::EMPTY, 0.0); firsts.last().copied().unwrap_or(0)];
    for instance in 0..stored.instances.len() as u32 {
        for triangle in 0..stored.mesh_of(InstanceId(instance)).triangle_count() as u32 {
            let at = TriangleRef { instance, triangle };
            let source = shown(layout, at);
            let exact = scene.world_corners(source);
            let off = exact.iter().zip(traced_corners(stored, at)).map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
            let (bounds, error) = &mut of_objects[object(source)];
            (*bounds, *error) = (bounds.union(&Bounds::of(exact)), error.max(off));
        }
    }
    let ratio = |error: f64, size: f64| if error == 0.0 || size == 0.0 { 0.0 } else { error / size };
    let largest = of_objects.iter().map(|(_, error)| *error).fold(0.0, f64::max);
    PositionErrors {
        ratio: ratio(largest, scene.bounds().diagonal()),
        object_ratio: of_objects.iter().map(|(bounds, error)| ratio(*error, bounds.diagonal())).fold(0.0, f64::max),
    }
}

/// Returns the corners that a tracer sees, in world coordinates: as rounded in the file.
fn traced_corners(stored: &Scene, at: TriangleRef) -> [DVec3; 3] {
    let instance = &stored.instances[at.instance as usize];
    let corners = stored.mesh_of(InstanceId(at.instance)).corners(at.triangle);
    let [a, b, c] = corners.map(|p| instance.transform.transform_point3(p.as_dvec3()));
    if instance.mirrored() { [a, c, b] } else { [a, b, c] }
}

/// Returns the number of objects before each instance, and of all.
fn first_objects(scene: &Scene) -> Vec<usize> {
    let mut firsts = vec![0];
    for instance in &scene.instances {
        let before = firsts[firsts.len() - 1];
        firsts.push(before + scene.meshes[instance.mesh.0 as usize].geometries.len());
    }
    firsts
}

#[cfg(test)]
mod tests {
    use super::super::placed::{Generated, Placement};
    use super::*;
    use crate::layout;
    use crate::methods::{self, Method};
    use crate::verify::cpu::{ComputingTracer, Precision};

    /// The errors of a method with the torus placed somewhere, by each arithmetic.
    fn errors(placement: Placement, method: Method) -> [RayErrors; 4] {
        let scene = placement.place(&Generated::Torus.scene());
        let options = VerifyOptions { rays_per_kind: 1024, ..VerifyOptions::default() };
        let mut laid = methods::run(method, &scene, &methods::Options::default());
        layout::order_by_tree(&scene, &mut laid);
        let stored = layout::stored(&scene, &laid);
        let displacement = position_errors(&scene, &laid, &stored).ratio * scene.bounds().diagonal();
        let truth = Truth::new(&scene, &TwoLevel::build(&scene), displacement, &options);
        let trees = TwoLevel::build(&stored);
        Precision::ALL.map(|precision| {
            truth.errors(&ComputingTracer::new(&trees, precision), &laid).expect("the CPU does not fail")
        })
    }

    #[test]
    fn more_digits_are_nearer_to_the_truth() {
        let [fast, watertight, recentred, double] = errors(Placement::AsIs, Method::Keep);
        assert!(
            watertight.distances.p999 < 1e-3 && recentred.distances.p999 < 1e-3 && fast.distances.p999 < 1e-3,
            "{fast:?} {watertight:?}"
        );
        assert!(double.distances.largest < 1e-9, "{double:?}");
        assert_eq!([watertight.lost_per_million, double.lost_per_million], [Some(0.0); 2]);
        assert!(fast.lost_per_million > Some(0.0), "{fast:?}");
    }

    #[test]
    fn recentring_opens_no_seams_inside_a_group() {
        let [_, _, recentred, _] = errors(Placement::AsIs, Method::Single);
        assert_eq!(recentred.lost_per_million, Some(0.0));
    }

    #[test]
    fn far_away_recentring_keeps_the_distance() {
        let [_, watertight, recentred, double] = errors(Placement::Far, Method::Keep);
        assert!(recentred.distances.p999 < 1e-5 && double.distances.largest < 1e-7, "{recentred:?} {double:?}");
        assert!(watertight.distances.p999 > 10.0 * recentred.distances.p999, "{watertight:?} {recentred:?}");
    }

    #[test]
    fn position_errors_are_those_of_the_stored_corners() {
        let scene = Generated::Torus.scene();
        let of = |method| {
            let layout = methods::run(method, &scene, &methods::Options::default());
            position_errors(&scene, &layout, &layout::stored(&scene, &layout))
        };
        assert_eq!(of(Method::Keep), PositionErrors::default());
        let turned = Placement::Far.place(&scene);
        let layout = methods::run(Method::Single, &turned, &methods::Options::default());
        let stored = layout::stored(&turned, &layout);
        let found = position_errors(&turned, &layout, &stored);
        assert!(found.ratio > 0.0 && found.ratio < 1e-3 && found.object_ratio > found.ratio, "{found:?}");
    }
}
