//! Tracing a scene that moves, frame by frame, through several trees over its instances at once, so that ways to keep
//! them up to date can be compared in the same frame.

use std::time::Instant;

use super::build::BuildOptions;
use super::cpu::{Bottoms, CpuTracer, MovingTop};
use super::rays::{Ray, RayKind};
#[cfg(feature = "vulkan")]
use super::vulkan::{Pipelines, VulkanFrames};
use super::{Hit, Machine, PerKind};
use crate::scene::Scene;

/// How an acceleration structure follows what moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Upkeep {
    /// Its boxes are computed anew, its topology stays.
    Refit,
    /// It is built anew.
    Rebuild,
}

/// What one frame took, in milliseconds: on a device by its timestamps, on the CPU by the clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTimes {
    /// To hand the matrices of the instances to the tracer.
    pub upload_ms: f64,
    /// What was done to the TLAS. A refit becomes a rebuild if rays can enter other instances than before.
    pub upkeep: Upkeep,
    /// To refit or rebuild the TLAS.
    pub upkeep_ms: f64,
    /// To trace the rays of each kind, if they were traced.
    pub trace_ms: Option<PerKind<f64>>,
}

/// Memory of the structures of a tracer, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameBytes {
    /// Of all BLASes.
    pub blas: u64,
    /// Of one TLAS.
    pub tlas: u64,
    /// Everything that the program has allocated on the device now; `None` on the CPU.
    pub device: Option<u64>,
}

/// Traces frames. Errors are in words.
pub(crate) trait FrameTracer {
    /// Sets the rays to trace in the frames that follow.
    fn set_rays(&mut self, rays: &PerKind<Vec<Ray>>) -> Result<(), String>;

    /// Brings the BLASes of the meshes that deform up to date, for all TLASes. Returns the milliseconds it took.
    fn deform(&mut self, scene: &Scene, deformed: &[usize], upkeep: Upkeep) -> Result<f64, String>;

    /// Brings a TLAS up to date with the scene and traces the rays through it, if `trace` says so.
    fn frame(&mut self, tlas: usize, scene: &Scene, upkeep: Upkeep, trace: bool) -> Result<FrameTimes, String>;

    /// Returns the first hits of rays through a TLAS as it is.
    fn closest(&self, tlas: usize, rays: &[Ray]) -> Result<Vec<Option<Hit>>, String>;

    /// Returns the memory of the structures.
    fn bytes(&self, tlas: usize) -> FrameBytes;
}

/// What a [`FrameTracer`] is made for.
#[derive(Clone, Debug)]
pub(crate) struct FramePlan {
    /// For each TLAS, whether it is ever refitted.
    pub(crate) refits: Vec<bool>,
    /// The meshes that deform, in ascending order.
    #[cfg_attr(not(feature = "vulkan"), allow(dead_code, reason = "only devices read it"))]
    pub(crate) deforming: Vec<usize>,
    /// How a device builds structures. Whether they can be updated follows from the plan.
    #[cfg_attr(not(feature = "vulkan"), allow(dead_code, reason = "only devices read it"))]
    pub(crate) build: BuildOptions,
}

/// Traces frames on the CPU.
pub(crate) struct CpuFrames {
    bottoms: Bottoms,
    tops: Vec<MovingTop>,
    rays: PerKind<Vec<Ray>>,
}

impl CpuFrames {
    /// Builds all trees.
    pub(crate) fn new(scene: &Scene, tops: usize) -> CpuFrames {
        let bottoms = Bottoms::build(scene);
        let tops = (0..tops).map(|_| MovingTop::build(&bottoms, scene)).collect();
        CpuFrames { bottoms, tops, rays: PerKind::default() }
    }
}

impl FrameTracer for CpuFrames {
    fn set_rays(&mut self, rays: &PerKind<Vec<Ray>>) -> Result<(), String> {
        self.rays = rays.clone();
        Ok(())
    }

    fn deform(&mut self, scene: &Scene, deformed: &[usize], upkeep: Upkeep) -> Result<f64, String> {
        let start = Instant::now();
        match upkeep {
            Upkeep::Refit => self.bottoms.refit(scene, deformed),
            Upkeep::Rebuild => self.bottoms.rebuild(scene, deformed),
        }
        Ok(milliseconds(start))
    }

    fn frame(&mut self, tlas: usize, scene: &Scene, upkeep: Upkeep, trace: bool) -> Result<FrameTimes, String> {
        let top = &mut self.tops[tlas];
        let start = Instant::now();
        let was_refitted = match upkeep {
            Upkeep::Refit => top.refit(&self.bottoms, scene),
            Upkeep::Rebuild => {
                *top = MovingTop::build(&self.bottoms, scene);
                false
            }
        };
        let upkeep_ms = milliseconds(start);
        let start = Instant::now();
        let tracer = CpuTracer::new(top.trees());
        let upload_ms = milliseconds(start);
        let trace_ms = trace.then(|| PerKind::of(|kind| traced(&tracer, kind, &self.rays[kind])));
        let upkeep = if was_refitted { Upkeep::Refit } else { Upkeep::Rebuild };
        Ok(FrameTimes { upload_ms, upkeep, upkeep_ms, trace_ms })
    }

    fn closest(&self, tlas: usize, rays: &[Ray]) -> Result<Vec<Option<Hit>>, String> {
        Ok(CpuTracer::new(self.tops[tlas].trees()).closest(rays))
    }

    fn bytes(&self, tlas: usize) -> FrameBytes {
        FrameBytes { blas: self.bottoms.bytes(), tlas: self.tops[tlas].bytes(), device: None }
    }
}

/// Returns the milliseconds to trace rays of a kind.
fn traced(tracer: &CpuTracer, kind: RayKind, rays: &[Ray]) -> f64 {
    let start = Instant::now();
    match kind {
        RayKind::Shadow => drop(std::hint::black_box(tracer.occluded(rays))),
        _ => drop(std::hint::black_box(tracer.closest(rays))),
    }
    milliseconds(start)
}

fn milliseconds(since: Instant) -> f64 {
    1e3 * since.elapsed().as_secs_f64()
}

/// Makes frame tracers, one after the other.
pub(crate) trait FrameMaker {
    /// Builds the structures of a scene.
    fn frames(&self, scene: &Scene, plan: &FramePlan) -> Result<Box<dyn FrameTracer + '_>, String>;
}

struct OnCpu;

impl FrameMaker for OnCpu {
    fn frames(&self, scene: &Scene, plan: &FramePlan) -> Result<Box<dyn FrameTracer + '_>, String> {
        Ok(Box::new(CpuFrames::new(scene, plan.refits.len())))
    }
}

#[cfg(feature = "vulkan")]
impl FrameMaker for Pipelines<'_> {
    fn frames(&self, scene: &Scene, plan: &FramePlan) -> Result<Box<dyn FrameTracer + '_>, String> {
        let frames = VulkanFrames::new(self, scene, plan).map_err(|e| e.to_string())?;
        Ok(Box::new(frames))
    }
}

impl Machine {
    /// Returns what makes frame tracers on the machine.
    ///
    /// # Errors
    /// Why the device cannot trace, in words.
    #[cfg(feature = "vulkan")]
    pub(crate) fn frame_maker(&self) -> Result<Box<dyn FrameMaker + '_>, String> {
        match &self.device {
            None => Ok(Box::new(OnCpu)),
            Some(device) => Ok(Box::new(Pipelines::new(device).map_err(|e| e.to_string())?)),
        }
    }

    /// Returns what makes frame tracers on the CPU.
    ///
    /// # Errors
    /// None.
    #[cfg(not(feature = "vulkan"))]
    pub(crate) fn frame_maker(&self) -> Result<Box<dyn FrameMaker + '_>, String> {
        Ok(Box::new(OnCpu))
    }
}
