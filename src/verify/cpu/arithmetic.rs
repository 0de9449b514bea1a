//! In which numbers, from which origin and by which test the CPU traces a ray: the traversal is the same for all.

use glam::{Affine3A, DAffine3, DVec3, Vec3, Vec3A};

use super::boxes::{BoxRay, Real};
use super::search::Inside;
use super::two_level::{Bottom, Entry, LARGEST};
use super::watertight::{Crossing, ShearedRay, TriangleTest};

/// How a ray is traced.
pub(super) trait Arithmetic {
    /// The numbers that boxes and triangles are tested in.
    type Number: Real;
    /// The test of triangles.
    type Triangles: TriangleTest<Self::Number>;
    /// A ray in the scaled world.
    type Ray;
    /// What transforms a ray into an entry.
    type Way: Send + Sync;

    /// Returns the ray of an origin and a direction in the scaled world.
    fn ray(origin: DVec3, direction: DVec3) -> Self::Ray;
    /// Returns the ray for boxes in the scaled world whose coordinates are at most `reach`.
    fn slab(ray: &Self::Ray, reach: f64) -> BoxRay<Self::Number>;
    /// Returns how rays enter an instance of a mesh; `None` if the transform overflows.
    fn way(entry: &Entry, mesh: &Bottom) -> Option<Self::Way>;
    /// Transforms a ray into an entry.
    fn enter(way: &Self::Way, ray: &Self::Ray) -> Inside<Self::Number, Self::Triangles>;
}

/// Single precision throughout, as on a device, with a test of triangles.
pub(super) struct Single<X>(std::marker::PhantomData<X>);

impl<X: TriangleTest<f32>> Arithmetic for Single<X> {
    type Number = f32;
    type Triangles = X;
    type Ray = [Vec3A; 2];
    type Way = Affine3A;

    fn ray(origin: DVec3, direction: DVec3) -> [Vec3A; 2] {
        [origin.as_vec3().into(), direction.as_vec3().into()]
    }

    fn slab(ray: &[Vec3A; 2], reach: f64) -> BoxRay<f32> {
        slab_ray(ray[0].to_array(), ray[1].to_array(), ray[0].abs().max_element() + reach as f32)
    }

    fn way(entry: &Entry, _: &Bottom) -> Option<Affine3A> {
        let single = Affine3A::from_cols_array(&entry.to_mesh.to_cols_array().map(|x| x as f32));
        single.is_finite().then_some(single)
    }

    fn enter(to_mesh: &Affine3A, ray: &[Vec3A; 2]) -> Inside<f32, X> {
        let (origin, direction) = (to_mesh.transform_point3a(ray[0]), to_mesh.transform_vector3a(ray[1]));
        let boxes = Self::slab(&[origin, direction], LARGEST);
        Inside { start: 0.0, boxes, triangles: X::new(origin.to_array(), direction.to_array()) }
    }
}

/// Double precision throughout, except for the corners, which are stored in single precision.
pub(super) struct Double;

impl Arithmetic for Double {
    type Number = f64;
    type Triangles = ShearedRay<f64>;
    type Ray = [DVec3; 2];
    type Way = DAffine3;

    fn ray(origin: DVec3, direction: DVec3) -> [DVec3; 2] {
        [origin, direction]
    }

    fn slab(ray: &[DVec3; 2], reach: f64) -> BoxRay<f64> {
        slab_ray(ray[0].to_array(), ray[1].to_array(), ray[0].abs().max_element() + reach)
    }

    fn way(entry: &Entry, _: &Bottom) -> Option<DAffine3> {
        Some(entry.to_mesh)
    }

    fn enter(to_mesh: &DAffine3, ray: &[DVec3; 2]) -> Inside<f64, ShearedRay<f64>> {
        let (origin, direction) = (to_mesh.transform_point3(ray[0]), to_mesh.transform_vector3(ray[1]));
        let boxes = Self::slab(&[origin, direction], LARGEST);
        Inside { start: 0.0, boxes, triangles: ShearedRay::new(origin.to_array(), direction.to_array()) }
    }
}

/// Single precision relative to the mesh that the ray enters: P. Cozzi, K. Ring, "3D Engine Design for Virtual Globes",
/// 2011, section 5.2, place vertices relative to the centre of their object, and subtract it in double precision. Here
/// also the origin of the ray moves: in double precision it is advanced to the sphere around the mesh's box, so that
/// the numbers in the tests of triangles are as large as the mesh, however far off origin and mesh are.
pub(super) struct Recentred;

/// How a ray enters a mesh.
pub(super) struct ToCentre {
    to_mesh: DAffine3,
    /// Centre of the mesh's box, as its corners are stored.
    centre: Vec3,
    /// Radius of the sphere around the box.
    radius: f64,
}

/// A ray relative to the centre of a mesh.
pub(super) struct CentredRay {
    ray: ShearedRay<f32>,
    centre: Vec3,
}

impl TriangleTest<f32> for CentredRay {
    fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        CentredRay { ray: ShearedRay::new(origin, direction), centre: Vec3::ZERO }
    }

    fn cross(&self, corners: [[f32; 3]; 3]) -> Option<Crossing<f32>> {
        // Exact if the mesh is far from its origin: the difference of two numbers within a factor of two is.
        self.ray.cross(corners.map(|p| (Vec3::from_array(p) - self.centre).to_array()))
    }
}

impl Arithmetic for Recentred {
    type Number = f32;
    type Triangles = CentredRay;
    type Ray = [DVec3; 2];
    type Way = ToCentre;

    fn ray(origin: DVec3, direction: DVec3) -> [DVec3; 2] {
        [origin, direction]
    }

    fn slab(ray: &[DVec3; 2], reach: f64) -> BoxRay<f32> {
        Single::<CentredRay>::slab(&[ray[0].as_vec3().into(), ray[1].as_vec3().into()], reach)
    }

    fn way(entry: &Entry, mesh: &Bottom) -> Option<ToCentre> {
        let (centre, radius) = (mesh.bounds.center().as_vec3(), 0.5 * mesh.bounds.diagonal());
        Single::<CentredRay>::way(entry, mesh).map(|_| ToCentre { to_mesh: entry.to_mesh, centre, radius })
    }

    fn enter(way: &ToCentre, ray: &[DVec3; 2]) -> Inside<f32, CentredRay> {
        let direction = way.to_mesh.transform_vector3(ray[1]);
        let origin = way.to_mesh.transform_point3(ray[0]);
        let start = start(way.centre.as_dvec3() - origin, direction, way.radius);
        let origin = origin + f64::from(start) * direction;
        let boxes = Self::slab(&[origin, direction], LARGEST);
        let (from, along) = ((origin - way.centre.as_dvec3()).as_vec3(), direction.as_vec3());
        let ray = ShearedRay::new(from.to_array(), along.to_array());
        Inside { start, boxes, triangles: CentredRay { ray, centre: way.centre } }
    }
}

/// Returns the distance along a ray, in units of the direction's length and at least 0, to the point a radius before
/// the one nearest to a centre; 0 if that is not a finite number.
fn start(to_centre: DVec3, direction: DVec3, radius: f64) -> f32 {
    let start = (to_centre.dot(direction) - radius * direction.length()) / direction.length_squared();
    let start = start.max(0.0) as f32;
    if start.is_finite() { start } else { 0.0 }
}

/// Returns a ray for slab tests of coordinates up to `largest`.
fn slab_ray<T: Real>(origin: [T; 3], direction: [T; 3], largest: T) -> BoxRay<T> {
    BoxRay::new(origin, direction, T::PAD * largest)
}
