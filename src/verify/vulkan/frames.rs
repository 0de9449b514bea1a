//! Traces a scene that moves, frame by frame: one submission per TLAS and frame copies the matrices, refits or rebuilds the
//! TLAS and traces the rays, with timestamps in between. No frame allocates anything but rays and their results.

use super::Error;
use super::accel::{Deforming, Matrices, MovingTlas, Plan};
use super::commands::Timer;
use super::trace::{Pipelines, RayBuffer, VulkanTracer};
use crate::scene::Scene;
use crate::verify::frames::{FrameBytes, FramePlan, FrameTimes, FrameTracer, Upkeep};
use crate::verify::rays::{Ray, RayKind};
use crate::verify::{Hit, PerKind};

/// Traces frames on a device.
pub(in crate::verify) struct VulkanFrames<'p, 'd> {
    tracer: VulkanTracer<'p, 'd>,
    plan: Plan,
    matrices: Matrices<'d>,
    tlases: Vec<Level<'d>>,
    rays: Option<PerKind<RayBuffer<'d>>>,
    timer: Timer<'d>,
    /// Declared after the tracer, whose BLASes it holds.
    deforming: Deforming<'d>,
}

/// One of the TLASes.
struct Level<'d> {
    tlas: MovingTlas<'d>,
    /// Whether it holds anything that can be refitted.
    is_built: bool,
}

/// Intervals before tracing: upload and upkeep.
const BEFORE_TRACING: u32 = 2;

impl<'p, 'd> VulkanFrames<'p, 'd> {
    /// Builds the BLASes of a scene and allocates the TLASes.
    ///
    /// # Errors
    /// See [`VulkanTracer::new`].
    pub(in crate::verify) fn new(
        pipelines: &'p Pipelines<'d>,
        scene: &Scene,
        frames: &FramePlan,
    ) -> Result<VulkanFrames<'p, 'd>, Error> {
        let device = pipelines.device();
        let plan = Plan::moving(scene, frames.build.blas_per, &device.info().limits)?;
        let mut tracer = VulkanTracer::of_plan(pipelines, scene, &plan, frames.build)?;
        let deforming = Deforming::new(device, scene, &plan, (&frames.build, &frames.deforming), tracer.blases_mut())?;
        let level = |refits: &bool| -> Result<Level<'d>, Error> {
            Ok(Level { tlas: MovingTlas::new(device, &plan, &frames.build, *refits)?, is_built: false })
        };
        let tlases = frames.refits.iter().map(level).collect::<Result<Vec<_>, _>>()?;
        let matrices = Matrices::new(device, &plan)?;
        let timer = Timer::of_intervals(device, BEFORE_TRACING + RayKind::ALL.len() as u32)?;
        Ok(VulkanFrames { tracer, plan, matrices, tlases, rays: None, timer, deforming })
    }

    /// Uploads the rays of the frames that follow.
    pub(super) fn upload_rays(&mut self, rays: &PerKind<Vec<Ray>>) -> Result<(), Error> {
        // The old ones are freed first.
        self.rays = None;
        self.rays = Some(PerKind::try_of(|kind| self.tracer.device().upload_rays(&rays[kind]))?);
        Ok(())
    }

    /// See [`FrameTracer::frame`].
    pub(super) fn run_frame(
        &mut self,
        tlas: usize,
        scene: &Scene,
        upkeep: Upkeep,
        trace: bool,
    ) -> Result<FrameTimes, Error> {
        self.matrices.write(scene, &self.plan, self.tracer.blases());
        let level = &mut self.tlases[tlas];
        let upkeep = if level.is_built { upkeep } else { Upkeep::Rebuild };
        level.is_built = true;
        let (level, rays) = (&self.tlases[tlas], self.rays.as_ref().filter(|_| trace));
        let results = rays.map(|rays| self.tracer.results_of(rays)).transpose()?;
        let device = self.tracer.device();
        device.submit("a frame", |commands| {
            device.barrier(commands);
            self.timer.start(commands);
            self.matrices.upload(commands);
            self.timer.stamp(commands, 1);
            level.tlas.record(commands, &self.matrices, upkeep);
            self.timer.stamp(commands, BEFORE_TRACING);
            for (kind, rays) in rays.into_iter().flat_map(PerKind::iter) {
                let results = results.as_ref().unwrap_or_else(|| unreachable!("results were allocated with the rays"));
                self.tracer.record_timing(commands, level.tlas.address(), rays, results, kind == RayKind::Shadow);
                device.barrier(commands);
                self.timer.stamp(commands, BEFORE_TRACING + 1 + kind as u32);
            }
        })?;
        let traced = if rays.is_some() { RayKind::ALL.len() as u32 } else { 0 };
        let times = self.timer.intervals(BEFORE_TRACING + traced)?;
        let trace_ms = rays.map(|_| PerKind::of(|kind| times[BEFORE_TRACING as usize + kind as usize]));
        Ok(FrameTimes { upload_ms: times[0], upkeep, upkeep_ms: times[1], trace_ms })
    }

    /// See [`FrameTracer::closest`].
    pub(super) fn first_hits(&self, tlas: usize, rays: &[Ray]) -> Result<Vec<Option<Hit>>, Error> {
        let rays = self.tracer.device().upload_rays(rays)?;
        Ok(self.tracer.trace_through(self.tlases[tlas].tlas.address(), &rays, false)?.hits)
    }
}

impl FrameTracer for VulkanFrames<'_, '_> {
    fn set_rays(&mut self, rays: &PerKind<Vec<Ray>>) -> Result<(), String> {
        self.upload_rays(rays).map_err(in_words)
    }

    fn deform(&mut self, scene: &Scene, _: &[usize], upkeep: Upkeep) -> Result<f64, String> {
        self.deforming.update(scene, &self.plan, upkeep).map_err(in_words)
    }

    fn frame(&mut self, tlas: usize, scene: &Scene, upkeep: Upkeep, trace: bool) -> Result<FrameTimes, String> {
        self.run_frame(tlas, scene, upkeep, trace).map_err(in_words)
    }

    fn closest(&self, tlas: usize, rays: &[Ray]) -> Result<Vec<Option<Hit>>, String> {
        self.first_hits(tlas, rays).map_err(in_words)
    }

    fn bytes(&self, tlas: usize) -> FrameBytes {
        let report = self.tracer.report();
        let blas = report.blas_bytes_compacted.unwrap_or(report.blas_bytes);
        let device = Some(self.tracer.device().used_memory());
        FrameBytes { blas, tlas: self.tlases[tlas].tlas.bytes, device }
    }
}

fn in_words(error: Error) -> String {
    error.to_string()
}
