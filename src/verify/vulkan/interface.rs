//! Structures shared by host and shaders, declared in `shaders/interface.glsl`.

use crate::verify::rays;

/// A ray.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Ray {
    pub(super) origin: [f32; 3],
    pub(super) t_min: f32,
    pub(super) direction: [f32; 3],
    pub(super) t_max: f32,
}

/// Result of tracing a ray.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Hit {
    /// Negative for a miss.
    pub(super) t: f32,
    pub(super) entry: u32,
    pub(super) geometry: u32,
    pub(super) primitive: u32,
    pub(super) front: u32,
    pub(super) any_hits: u32,
}

/// Result of timing a ray alone.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Clocked {
    pub(super) ticks: u32,
    pub(super) is_hit: u32,
}

/// Parameters of a launch: the push constants.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Work {
    pub(super) scene: u64,
    pub(super) rays: u64,
    pub(super) results: u64,
    pub(super) first: u32,
    pub(super) ray_flags: u32,
    /// Device units per ray unit, a power of two.
    pub(super) scale: f32,
    /// Hits kept per ray, if all are.
    pub(super) kept_hits: u32,
    pub(super) alpha: u64,
    pub(super) first_geometries: u64,
}

/// Parameters of the alpha test of a geometry.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct AlphaGeometry {
    pub(super) triangles: u64,
    pub(super) texcoords: u64,
    pub(super) texels: u64,
    pub(super) size: [u32; 2],
    pub(super) wrap: [u32; 2],
    pub(super) factor: f32,
    pub(super) cutoff: f32,
}

impl AlphaGeometry {
    /// Accepts every hit.
    pub(super) const ACCEPT: AlphaGeometry = AlphaGeometry {
        triangles: 0,
        texcoords: 0,
        texels: 0,
        size: [1; 2],
        wrap: [0; 2],
        factor: 1.0,
        cutoff: f32::NEG_INFINITY,
    };
}

impl From<&rays::Ray> for Ray {
    fn from(ray: &rays::Ray) -> Ray {
        Ray { origin: ray.origin.to_array(), t_min: ray.t_min, direction: ray.direction.to_array(), t_max: ray.t_max }
    }
}

#[cfg(test)]
mod tests;
