//! The triangles of a scene that may be grouped at will, placed, whatever object they belong to.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::layout::builder::Object;
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::{Bounds, Scene, TriangleRef};

/// Placed triangles. Corners are seen from the middle of the scene, in half diagonals of the scene, where single
/// precision is enough to choose a group: what is stored is computed from the input, in double precision.
pub(super) struct Soup {
    /// Which triangles.
    pub(super) refs: Vec<TriangleRef>,
    corners: Vec<[Vec3; 3]>,
    /// Where corners are seen from, in the world, and how much larger they are seen.
    middle: DVec3,
    unit: f64,
    /// The first triangle of every object, and the number of all triangles.
    pub(super) objects: Vec<u32>,
}

impl Soup {
    /// The triangles of some objects, in their order.
    pub(super) fn new(scene: &Scene, objects: &[Object]) -> Soup {
        let bounds = scene.bounds();
        let (middle, unit) = (bounds.center(), 2.0 / bounds.diagonal());
        let unit = if unit.is_finite() { unit } else { 1.0 };
        let count = objects.iter().map(|object| object.geometry(scene).triangles.len()).sum();
        let mut soup = Soup { refs: Vec::with_capacity(count), corners: Vec::new(), middle, unit, objects: vec![0] };
        for object in objects {
            soup.refs.extend(object.triangles(scene));
            soup.objects.push(soup.refs.len() as u32);
        }
        let seen = |p: DVec3| ((p - middle) * unit).as_vec3();
        soup.corners =
            soup.refs.par_iter().with_min_len(CHEAP_ELEMENTS).map(|&at| scene.world_corners(at).map(seen)).collect();
        soup
    }

    /// Number of triangles.
    pub(super) fn len(&self) -> usize {
        self.refs.len()
    }

    /// Corners of a triangle.
    pub(super) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.corners[triangle as usize].map(|p| p.as_dvec3())
    }

    /// Corners as they are stored, for telling whether two triangles share one.
    pub(super) fn stored(&self, triangle: u32) -> &[Vec3; 3] {
        &self.corners[triangle as usize]
    }

    /// Takes what is in the world to where it is seen in a frame.
    pub(super) fn seen_in(&self, frame: &Turned) -> DAffine3 {
        let matrix3 = frame.rotation.transpose() * self.unit;
        DAffine3 { matrix3, translation: -(matrix3 * self.middle) }
    }

    /// The box of a triangle in a frame.
    pub(super) fn bounds_in(&self, frame: &Turned, triangle: u32) -> Bounds {
        let into = frame.rotation.transpose();
        Bounds::of(self.corners(triangle).map(|p| into * p))
    }
}

/// Surface area of the tightest box there is around a triangle: a rectangle of twice its area, with two sides.
pub(super) fn tightest([a, b, c]: [DVec3; 3]) -> f64 {
    2.0 * (b - a).cross(c - a).length()
}

/// A rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turned {
    /// World from group.
    pub(super) rotation: DMat3,
}

impl Turned {
    /// The axes of the world.
    pub(super) const NOT: Turned = Turned { rotation: DMat3::IDENTITY };

    /// The frame of a rotation.
    pub(super) fn by(rotation: DMat3) -> Turned {
        Turned { rotation }
    }

    /// World box of a box in this frame, as a driver computes it.
    pub(super) fn out(&self, bounds: &Bounds) -> Bounds {
        bounds.transformed(&DAffine3 { matrix3: self.rotation, translation: DVec3::ZERO })
    }
}
