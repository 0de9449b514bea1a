//! Rays through a scene's acceleration structures.

use std::cell::Cell;

use ash::vk;

use super::Error;
use super::accel::{Blases, BuildOptions, BuildReport, Plan, Tlas};
use super::alpha::{AlphaTests, Textures};
use super::commands::Timer;
use super::device::Device;
use super::interface;
use super::memory::{Buffer, Purpose};
use super::pipeline::{HITS, Pipeline, TIMING};
use super::transfer::{Uploader, download};
use crate::scene::Scene;
use crate::verify::Hit;
use crate::verify::rays::Ray;

/// Rays of one buffer: 256 MiB of them.
const RAYS_PER_PART: usize = 1 << 23;

/// Rays in the memory of a device, for any tracer of that device.
pub struct RayBuffer<'d> {
    device: &'d Device,
    parts: Vec<Part<'d>>,
}

struct Part<'d> {
    rays: Buffer<'d>,
    count: u64,
}

impl RayBuffer<'_> {
    /// The number of rays.
    pub fn len(&self) -> usize {
        self.parts.iter().map(|p| p.count as usize).sum()
    }

    /// Whether there is no ray.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }
}

impl Device {
    /// Uploads rays.
    ///
    /// # Errors
    /// Out of memory.
    pub fn upload_rays(&self, rays: &[Ray]) -> Result<RayBuffer<'_>, Error> {
        let parts = rays.chunks(RAYS_PER_PART).map(|part| upload(self, part)).collect::<Result<_, _>>()?;
        Ok(RayBuffer { device: self, parts })
    }
}

fn upload<'d>(device: &'d Device, rays: &[Ray]) -> Result<Part<'d>, Error> {
    const CHUNK: usize = 1 << 16;
    let bytes = (rays.len() * size_of::<interface::Ray>()) as u64;
    let buffer = Buffer::new(device, &format!("{} rays", rays.len()), bytes, Purpose::ShaderData)?;
    let mut uploader = Uploader::new(device, bytes)?;
    let mut offset = 0;
    for chunk in rays.chunks(CHUNK) {
        let converted: Vec<interface::Ray> = chunk.iter().map(interface::Ray::from).collect();
        uploader.write(&buffer, offset, bytemuck::cast_slice(&converted))?;
        offset += size_of_val(&converted[..]) as u64;
    }
    uploader.flush()?;
    drop(uploader);
    Ok(Part { rays: buffer, count: rays.len() as u64 })
}

/// The pipelines that trace, and the textures they look at, made once for all tracers of a device.
pub struct Pipelines<'d> {
    device: &'d Device,
    hits: Pipeline<'d>,
    timing: Pipeline<'d>,
    textures: Textures<'d>,
    timer: Timer<'d>,
}

impl<'d> Pipelines<'d> {
    /// Makes the pipelines.
    ///
    /// # Errors
    /// A failure of the driver.
    pub fn new(device: &'d Device) -> Result<Pipelines<'d>, Error> {
        Ok(Pipelines {
            device,
            hits: Pipeline::new(device, &HITS)?,
            timing: Pipeline::new(device, &TIMING)?,
            textures: Textures::new(device),
            timer: Timer::new(device)?,
        })
    }

    /// The device they are for.
    pub fn device(&self) -> &'d Device {
        self.device
    }
}

/// What was hit, and how often triangles were found that may let a ray through.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traced {
    /// For each ray its hit.
    pub hits: Vec<Option<Hit>>,
    /// Invocations of the any-hit shader: the triangles of alpha-tested and blended materials that traversal found.
    /// A driver may find a triangle more than once.
    pub any_hit_invocations: u64,
}

/// The acceleration structures of a scene on a device, ready for rays.
pub struct VulkanTracer<'p, 'd> {
    pipelines: &'p Pipelines<'d>,
    tlas: Tlas<'d>,
    /// The TLAS refers to them.
    _blases: Blases<'d>,
    alpha: AlphaTests<'d>,
    identity: Identity,
    report: BuildReport,
    /// Invocations of the any-hit shader on behalf of a verification.
    pub(super) any_hits: Cell<u64>,
}

impl<'p, 'd> VulkanTracer<'p, 'd> {
    /// Builds the structures of a scene that passed [`Scene::check`]. The scene is not needed afterwards.
    ///
    /// # Errors
    /// [`Error::Limit`] before anything is built, [`Error::OutOfMemory`], or another failure of the driver.
    pub fn new(pipelines: &'p Pipelines<'d>, scene: &Scene, options: BuildOptions) -> Result<Self, Error> {
        let device = pipelines.device;
        let plan = Plan::new(scene, options.blas_per, &device.info().limits)?;
        let blases = Blases::build(device, scene, &plan, &options)?;
        let tlas = Tlas::build(device, scene, &plan, &blases, &options)?;
        let alpha = AlphaTests::new(device, &pipelines.textures, scene, &plan)?;
        let report = BuildReport {
            blases: blases.len() as u64,
            tlas_instances: plan.entries.len() as u64,
            skipped_instances: plan.skipped_instances,
            blas_build_ms: blases.build_ms,
            tlas_build_ms: tlas.build_ms,
            blas_bytes: blases.bytes,
            blas_bytes_compacted: blases.bytes_compacted,
            tlas_bytes: tlas.bytes,
        };
        let identity = Identity::new(scene, &plan);
        Ok(VulkanTracer { pipelines, tlas, _blases: blases, alpha, identity, report, any_hits: Cell::new(0) })
    }

    /// What was built.
    pub fn report(&self) -> &BuildReport {
        &self.report
    }

    /// What each ray hits: first, or with `any_hit` whatever is found first. A ray that is no ray (a direction of
    /// no length, a number that is none, `t_max` before `t_min`) hits nothing.
    ///
    /// # Errors
    /// Out of memory, or a failure of the driver.
    pub fn trace(&self, rays: &RayBuffer<'_>, any_hit: bool) -> Result<Traced, Error> {
        let mut traced = Traced { hits: Vec::with_capacity(rays.len()), any_hit_invocations: 0 };
        let results = self.results(rays, size_of::<interface::Hit>() as u64)?;
        for part in &rays.parts {
            self.device().submit(&format!("tracing {} rays", part.count), |commands| {
                self.record(commands, &self.pipelines.hits, part, &results, any_hit);
            })?;
            download(self.device(), &results, part.count as usize, |hit: &interface::Hit| {
                traced.any_hit_invocations += u64::from(hit.any_hits);
                traced.hits.push(self.identity.hit(hit));
            })?;
        }
        Ok(traced)
    }

    /// Textures of alpha-tested materials that are taken for opaque, and why; in words.
    pub fn notes(&self) -> &[String] {
        &self.alpha.notes
    }

    /// Milliseconds the device takes to trace all rays once. Other than [`VulkanTracer::trace`], this lets rays
    /// through where the textures of alpha-tested materials do.
    ///
    /// # Errors
    /// As [`VulkanTracer::trace`].
    pub fn time(&self, rays: &RayBuffer<'_>, any_hit: bool) -> Result<f64, Error> {
        let results = self.results(rays, size_of::<u32>() as u64)?;
        self.time_into(&results, rays, any_hit)
    }

    /// As [`VulkanTracer::time`]; also whether each of the rays, all of one part, hit anything.
    #[cfg(test)]
    pub(super) fn timed_hits(&self, rays: &RayBuffer<'_>, any_hit: bool) -> Result<Vec<bool>, Error> {
        let results = self.results(rays, size_of::<u32>() as u64)?;
        self.time_into(&results, rays, any_hit)?;
        let mut hits = Vec::new();
        // The sign of the distance is that of the word: hits of the any-hit shader are too few to reach it.
        download(self.device(), &results, rays.len(), |word: &u32| hits.push(word >> 31 == 0))?;
        Ok(hits)
    }

    fn time_into(&self, results: &Buffer<'d>, rays: &RayBuffer<'_>, any_hit: bool) -> Result<f64, Error> {
        self.device().submit(&format!("timing {} rays", rays.len()), |commands| {
            self.pipelines.timer.measure(commands, || {
                for part in &rays.parts {
                    self.record(commands, &self.pipelines.timing, part, results, any_hit);
                }
            });
        })?;
        self.pipelines.timer.milliseconds()
    }

    /// The device it traces on.
    pub(super) fn device(&self) -> &'d Device {
        self.pipelines.device
    }

    /// Room for the results of one part at a time.
    fn results(&self, rays: &RayBuffer<'_>, element: u64) -> Result<Buffer<'d>, Error> {
        assert!(std::ptr::eq(self.device(), rays.device), "rays and structures are on the same device");
        let most = rays.parts.iter().map(|p| p.count).max().unwrap_or(0);
        Buffer::new(self.device(), &format!("the results of {most} rays"), most * element, Purpose::ShaderData)
    }

    fn record(
        &self,
        commands: vk::CommandBuffer,
        pipeline: &Pipeline<'d>,
        part: &Part<'_>,
        results: &Buffer<'d>,
        any_hit: bool,
    ) {
        let flags = if any_hit { TERMINATE_ON_FIRST_HIT } else { 0 };
        let work = interface::Work {
            scene: self.tlas.address(),
            rays: part.rays.address,
            results: results.address,
            first: 0,
            ray_flags: flags,
            scale: self.identity.scale as f32,
            padding: 0,
            alpha: self.alpha.geometries,
            first_geometries: self.alpha.first_geometries,
        };
        pipeline.trace(commands, work, part.count, self.device().info().limits.rays_per_launch);
    }
}

/// `gl_RayFlagsTerminateOnFirstHitEXT`.
const TERMINATE_ON_FIRST_HIT: u32 = 4;

/// From what a device calls a triangle to what the scene does.
struct Identity {
    /// Units on the device a unit of the rays.
    scale: f64,
    /// For each TLAS entry its instance in the scene and its group.
    entries: Vec<(u32, u32)>,
    /// Where each group's geometries start in `first_triangles`.
    groups: Vec<u32>,
    /// For each geometry of each group the number of its first triangle in its mesh.
    first_triangles: Vec<u32>,
}

impl Identity {
    fn new(scene: &Scene, plan: &Plan) -> Identity {
        let (first_triangles, groups) = plan.first_triangles(scene);
        let entries = plan.entries.iter().map(|e| (e.instance, e.group)).collect();
        Identity { scale: plan.scales.world, entries, groups, first_triangles }
    }

    fn hit(&self, found: &interface::Hit) -> Option<Hit> {
        if found.t < 0.0 {
            return None;
        }
        let (instance, group) = self.entries[found.entry as usize];
        let geometry = self.groups[group as usize] + found.geometry;
        let triangle = self.first_triangles[geometry as usize] + found.primitive;
        let t = (f64::from(found.t) / self.scale) as f32;
        Some(Hit { t, instance, triangle, front: found.front != 0 })
    }
}
