//! Traces rays through the acceleration structures of a scene.

use std::cell::{Cell, OnceCell};

use ash::vk;

use super::Error;
use super::accel::{Blases, BuildOptions, BuildReport, Plan, Tlas};
use super::alpha::{AlphaTests, Textures};
use super::commands::Timer;
use super::device::Device;
use super::interface;
use super::memory::{Buffer, Purpose};
use super::pipeline::{ALL, CLOCK, HITS, Pipeline, Shaders, TIMING};
use super::transfer::{Uploader, download};
use crate::scene::Scene;
use crate::verify::rays::Ray;
use crate::verify::{Hit, OpaqueTextures, PerKind};

/// Number of rays in one buffer, which takes 256 MiB.
const RAYS_PER_PART: usize = 1 << 23;

/// Rays in device memory, for use by any tracer of that device.
pub struct RayBuffer<'d> {
    device: &'d Device,
    pub(super) parts: Vec<Part<'d>>,
}

pub(super) struct Part<'d> {
    rays: Buffer<'d>,
    pub(super) count: u64,
}

impl RayBuffer<'_> {
    /// Returns the number of rays.
    pub fn len(&self) -> usize {
        self.parts.iter().map(|p| p.count as usize).sum()
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    fn most_in_part(&self) -> u64 {
        self.parts.iter().map(|p| p.count).max().unwrap_or(0)
    }
}

impl Device {
    /// Uploads rays.
    ///
    /// # Errors
    /// Fails if memory runs out.
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

/// The pipelines and the textures they read, created once for all tracers of a device.
pub struct Pipelines<'d> {
    device: &'d Device,
    hits: Pipeline<'d>,
    timing: Pipeline<'d>,
    /// Created for the first picture that needs it.
    all: OnceCell<Pipeline<'d>>,
    /// Likewise.
    clock: OnceCell<Pipeline<'d>>,
    textures: Textures<'d>,
    timer: Timer<'d>,
}

impl<'d> Pipelines<'d> {
    /// Creates the pipelines.
    ///
    /// # Errors
    /// Fails if the driver does.
    pub fn new(device: &'d Device) -> Result<Pipelines<'d>, Error> {
        Ok(Pipelines {
            device,
            hits: Pipeline::new(device, &HITS)?,
            timing: Pipeline::new(device, &TIMING)?,
            all: OnceCell::new(),
            clock: OnceCell::new(),
            textures: Textures::new(device),
            timer: Timer::new(device)?,
        })
    }

    /// Returns the pipeline that finds all hits.
    pub(super) fn all(&self) -> Result<&Pipeline<'d>, Error> {
        self.created(&self.all, &ALL)
    }

    /// Returns the pipeline that times each ray; only for devices with a clock.
    pub(super) fn clock(&self) -> Result<&Pipeline<'d>, Error> {
        self.created(&self.clock, &CLOCK)
    }

    fn created<'p>(&self, cell: &'p OnceCell<Pipeline<'d>>, shaders: &Shaders) -> Result<&'p Pipeline<'d>, Error> {
        if let Some(pipeline) = cell.get() {
            return Ok(pipeline);
        }
        let pipeline = Pipeline::new(self.device, shaders)?;
        Ok(cell.get_or_init(|| pipeline))
    }

    /// Returns the device of the pipelines.
    pub fn device(&self) -> &'d Device {
        self.device
    }
}

/// Hits of rays, and the number of any-hit invocations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traced {
    /// The hit of each ray.
    pub hits: Vec<Option<Hit>>,
    /// Number of any-hit shader invocations, one for each triangle of an alpha-tested or blended material found in
    /// traversal. A driver may find a triangle more than once.
    pub any_hit_invocations: u64,
}

/// The acceleration structures of a scene on a device, ready to be traced.
pub struct VulkanTracer<'p, 'd> {
    pub(super) pipelines: &'p Pipelines<'d>,
    tlas: Tlas<'d>,
    /// The TLAS refers to them.
    blases: Blases<'d>,
    alpha: AlphaTests<'d>,
    pub(super) identity: Identity,
    report: BuildReport,
    /// Number of any-hit shader invocations during a verification.
    pub(super) any_hits: Cell<u64>,
}

impl<'p, 'd> VulkanTracer<'p, 'd> {
    /// Builds the structures of a scene that passed [`Scene::check`]. The scene is not needed afterwards.
    ///
    /// # Errors
    /// Returns [`Error::Limit`] before anything is built, [`Error::OutOfMemory`], or another driver error.
    pub fn new(pipelines: &'p Pipelines<'d>, scene: &Scene, options: BuildOptions) -> Result<Self, Error> {
        let plan = Plan::new(scene, options.blas_per, &pipelines.device.info().limits)?;
        VulkanTracer::of_plan(pipelines, scene, &plan, options)
    }

    /// Like [`VulkanTracer::new`], of a plan.
    pub(super) fn of_plan(
        pipelines: &'p Pipelines<'d>,
        scene: &Scene,
        plan: &Plan,
        options: BuildOptions,
    ) -> Result<Self, Error> {
        let device = pipelines.device;
        let blases = Blases::build(device, scene, plan, &options)?;
        let tlas = Tlas::build(device, scene, plan, &blases, &options)?;
        let alpha = AlphaTests::new(device, &pipelines.textures, scene, plan)?;
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
        let identity = Identity::new(scene, plan);
        Ok(VulkanTracer { pipelines, tlas, blases, alpha, identity, report, any_hits: Cell::new(0) })
    }

    /// Returns the build report.
    pub fn report(&self) -> &BuildReport {
        &self.report
    }

    /// Returns the hit of each ray: the closest, or with `any_hit` the first one found. An invalid ray (zero direction,
    /// NaN, or `t_max` before `t_min`) hits nothing.
    ///
    /// # Errors
    /// Fails if memory runs out or the driver fails.
    pub fn trace(&self, rays: &RayBuffer<'_>, any_hit: bool) -> Result<Traced, Error> {
        self.trace_through(self.tlas.address(), rays, any_hit)
    }

    /// Like [`VulkanTracer::trace`], through another TLAS over the same entries.
    pub(super) fn trace_through(&self, tlas: u64, rays: &RayBuffer<'_>, any_hit: bool) -> Result<Traced, Error> {
        let mut traced = Traced { hits: Vec::with_capacity(rays.len()), any_hit_invocations: 0 };
        let results = self.results(rays, size_of::<interface::Hit>() as u64)?;
        for part in &rays.parts {
            self.device().submit(&format!("tracing {} rays", part.count), |commands| {
                self.record(commands, &self.pipelines.hits, tlas, part, &results, Launch::until_first(any_hit));
            })?;
            download(self.device(), &results, part.count as usize, |hit: &interface::Hit| {
                traced.any_hit_invocations += u64::from(hit.any_hits);
                traced.hits.push(self.identity.hit(hit));
            })?;
        }
        Ok(traced)
    }

    /// Returns the textures of alpha-tested materials that are treated as opaque, and why.
    pub fn opaque_textures(&self) -> Option<&OpaqueTextures> {
        self.alpha.opaque.as_ref()
    }

    /// Returns the time the device takes to trace all rays once, in milliseconds. Unlike [`VulkanTracer::trace`], rays
    /// pass through transparent texels of alpha-tested materials.
    ///
    /// # Errors
    /// See [`VulkanTracer::trace`].
    pub fn time(&self, rays: &RayBuffer<'_>, any_hit: bool) -> Result<f64, Error> {
        let results = self.results(rays, size_of::<u32>() as u64)?;
        self.time_into(&results, rays, any_hit)
    }

    /// Like [`VulkanTracer::time`], but also returns whether each ray hit anything; the rays must fit in one part.
    #[cfg(test)]
    pub(super) fn timed_hits(&self, rays: &RayBuffer<'_>, any_hit: bool) -> Result<Vec<bool>, Error> {
        let results = self.results(rays, size_of::<u32>() as u64)?;
        self.time_into(&results, rays, any_hit)?;
        let mut hits = Vec::new();
        // The sign bit of the distance is that of the word: the any-hit count is too small to reach it.
        download(self.device(), &results, rays.len(), |word: &u32| hits.push(word >> 31 == 0))?;
        Ok(hits)
    }

    fn time_into(&self, results: &Buffer<'d>, rays: &RayBuffer<'_>, any_hit: bool) -> Result<f64, Error> {
        self.device().submit(&format!("timing {} rays", rays.len()), |commands| {
            let timer = &self.pipelines.timer;
            timer.measure(commands, || self.record_timing(commands, self.tlas.address(), rays, results, any_hit));
        })?;
        self.pipelines.timer.milliseconds()
    }

    /// Records tracing all rays for their time.
    pub(super) fn record_timing(
        &self,
        commands: vk::CommandBuffer,
        tlas: u64,
        rays: &RayBuffer<'_>,
        results: &Buffer<'d>,
        any_hit: bool,
    ) {
        for part in &rays.parts {
            self.record(commands, &self.pipelines.timing, tlas, part, results, Launch::until_first(any_hit));
        }
    }

    /// Allocates results that rays of any kind can be timed into.
    pub(super) fn results_of(&self, rays: &PerKind<RayBuffer<'_>>) -> Result<Buffer<'d>, Error> {
        let most = rays.values().max_by_key(|rays| rays.most_in_part());
        self.results(most.unwrap_or_else(|| unreachable!("there are kinds of rays")), size_of::<u32>() as u64)
    }

    /// Returns the device address of the tracer's own TLAS.
    pub(super) fn tlas_address(&self) -> u64 {
        self.tlas.address()
    }

    /// Returns the BLASes, to replace some. The TLAS of the tracer itself must not be traced then.
    pub(super) fn blases_mut(&mut self) -> &mut Blases<'d> {
        &mut self.blases
    }

    /// Returns the BLASes.
    pub(super) fn blases(&self) -> &Blases<'d> {
        &self.blases
    }

    /// Returns the device of the tracer.
    pub(super) fn device(&self) -> &'d Device {
        self.pipelines.device
    }

    /// Allocates results for one part at a time; `element` is their size per ray, in bytes.
    pub(super) fn results(&self, rays: &RayBuffer<'_>, element: u64) -> Result<Buffer<'d>, Error> {
        assert!(std::ptr::eq(self.device(), rays.device), "rays and structures are on the same device");
        let most = rays.most_in_part();
        Buffer::new(self.device(), &format!("the results of {most} rays"), most * element, Purpose::ShaderData)
    }

    pub(super) fn record(
        &self,
        commands: vk::CommandBuffer,
        pipeline: &Pipeline<'d>,
        tlas: u64,
        part: &Part<'_>,
        results: &Buffer<'d>,
        launch: Launch,
    ) {
        let work = interface::Work {
            scene: tlas,
            rays: part.rays.address,
            results: results.address,
            first: 0,
            ray_flags: launch.ray_flags,
            scale: self.identity.scale as f32,
            kept_hits: launch.kept_hits,
            alpha: self.alpha.geometries,
            first_geometries: self.alpha.first_geometries,
        };
        pipeline.trace(commands, work, part.count, self.device().info().limits.rays_per_launch);
    }
}

/// How rays are traced.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Launch {
    ray_flags: u32,
    /// Hits kept per ray, if all are.
    kept_hits: u32,
}

impl Launch {
    /// To the closest hit, or with `any_hit` to the first one found.
    fn until_first(any_hit: bool) -> Launch {
        // The value of `gl_RayFlagsTerminateOnFirstHitEXT`.
        Launch { ray_flags: if any_hit { 4 } else { 0 }, kept_hits: 0 }
    }

    /// Through all hits.
    pub(super) fn through(kept_hits: u32) -> Launch {
        // The value of `gl_RayFlagsNoOpaqueEXT`: opaque triangles are announced, too.
        Launch { ray_flags: 2, kept_hits }
    }
}

/// Maps the device's identification of a triangle to the scene's.
pub(super) struct Identity {
    /// Device units per ray unit.
    scale: f64,
    /// The scene instance and the group of each TLAS entry.
    entries: Vec<(u32, u32)>,
    /// Index in `first_triangles` at which the geometries of each group start.
    groups: Vec<u32>,
    /// Number, within its mesh, of the first triangle of each geometry of each group.
    first_triangles: Vec<u32>,
}

impl Identity {
    fn new(scene: &Scene, plan: &Plan) -> Identity {
        let (first_triangles, groups) = plan.first_triangles(scene);
        let entries = plan.entries.iter().map(|e| (e.instance, e.group)).collect();
        Identity { scale: plan.scales.world, entries, groups, first_triangles }
    }

    pub(super) fn hit(&self, found: &interface::Hit) -> Option<Hit> {
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
