//! The placed triangles of a scene that may be grouped freely, regardless of objects.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;
use rustc_hash::FxHashSet;

use crate::layout::builder::Object;
use crate::layout::seams::{Components, corner_keys};
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::{Bounds, Scene, TriangleRef};

/// Placed triangles. Corners are relative to the middle of the scene, in half diagonals of the scene, where single
/// precision is enough to choose a group; stored vertices are computed from the input in double precision.
pub(super) struct Soup {
    /// The triangles' references.
    pub(super) refs: Vec<TriangleRef>,
    corners: Vec<[Vec3; 3]>,
    /// World-space origin of the corners, and their scale factor.
    middle: DVec3,
    unit: f64,
    /// The first triangle of each object, followed by the number of all triangles.
    pub(super) objects: Vec<u32>,
    /// The connected components of the triangles; of none unless parts may have frames of their own.
    pub(super) components: Components,
}

impl Soup {
    /// Collects the triangles of some objects, in their order. If parts of them may have frames of their own, `outside`
    /// holds the keys of the corners that others share with them (see [`crate::layout::seams`]).
    pub(super) fn new(scene: &Scene, objects: &[Object], outside: Option<&FxHashSet<u64>>) -> Soup {
        let bounds = scene.bounds();
        let (middle, unit) = (bounds.center(), 2.0 / bounds.diagonal());
        let unit = if unit.is_finite() { unit } else { 1.0 };
        let count = objects.iter().map(|object| object.geometry(scene).triangles.len()).sum();
        let (refs, components) = (Vec::with_capacity(count), Components::default());
        let mut soup = Soup { refs, corners: Vec::new(), middle, unit, objects: vec![0], components };
        for object in objects {
            soup.refs.extend(object.triangles(scene));
            soup.objects.push(soup.refs.len() as u32);
        }
        let seen = |p: DVec3| ((p - middle) * unit).as_vec3();
        soup.corners =
            soup.refs.par_iter().with_min_len(CHEAP_ELEMENTS).map(|&at| scene.world_corners(at).map(seen)).collect();
        if let Some(outside) = outside {
            let refs = soup.refs.par_iter().with_min_len(CHEAP_ELEMENTS);
            let keys: Vec<[u64; 3]> = refs.map(|&at| corner_keys(scene, at)).collect();
            soup.components = Components::of(&keys, outside);
        }
        soup
    }

    /// Returns the number of triangles.
    pub(super) fn len(&self) -> usize {
        self.refs.len()
    }

    /// Returns the corners of a triangle.
    pub(super) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.corners[triangle as usize].map(|p| p.as_dvec3())
    }

    /// Returns the transform from world space to the soup's coordinates in a frame.
    pub(super) fn seen_in(&self, frame: &Turned) -> DAffine3 {
        let matrix3 = frame.rotation.transpose() * self.unit;
        DAffine3 { matrix3, translation: -(matrix3 * self.middle) }
    }

    /// Returns the box of a triangle in a frame.
    pub(super) fn bounds_in(&self, frame: &Turned, triangle: u32) -> Bounds {
        let into = frame.rotation.transpose();
        Bounds::of(self.corners(triangle).map(|p| into * p))
    }
}

/// Returns the surface area of the tightest possible box around a triangle: a two-sided rectangle of twice its area.
pub(super) fn tightest([a, b, c]: [DVec3; 3]) -> f64 {
    2.0 * (b - a).cross(c - a).length()
}

/// A rotated frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turned {
    /// World from group.
    pub(super) rotation: DMat3,
}

impl Turned {
    /// The world axes.
    pub(super) const NOT: Turned = Turned { rotation: DMat3::IDENTITY };

    /// Creates the frame of a rotation.
    pub(super) fn by(rotation: DMat3) -> Turned {
        Turned { rotation }
    }

    /// Returns the world box of a box in this frame, as a driver computes it.
    pub(super) fn out(&self, bounds: &Bounds) -> Bounds {
        bounds.transformed(&DAffine3 { matrix3: self.rotation, translation: DVec3::ZERO })
    }
}
