//! Frames of a moving scene, traced through several TLASes at once: one per policy of rebuilding and refitting.
//!
//! All policies trace the same rays in the same frame, and one of them builds anew in each frame, so that what refitting
//! loses is measured in pairs. The order of the policies changes from frame to frame, so that a drift of the device's speed
//! cancels. The steps of rays are counted on the CPU, on trees that are rebuilt and refitted in the same frames. How a tree
//! ages by refitting: D. Kopta, T. Ize, J. Spjut, E. Brunvand, A. Davis, A. Kensler, "Fast, Effective BVH Updates for
//! Animated Scenes", ACM Symposium on Interactive 3D Graphics and Games, 2012.

mod counter;
mod policy;
#[cfg(test)]
mod tests;

use std::time::Instant;

use glam::DVec3;
use serde::Serialize;

use super::{MovingScene, Orbit};
use crate::scene::{Bounds, Scene};
use crate::verify::build::BuildOptions;
use crate::verify::check_hits::{self, CheckedHits};
use crate::verify::cpu::{Reference, TrueHit, TwoLevel};
use crate::verify::frames::{FrameBytes, FrameMaker, FramePlan, FrameTimes, FrameTracer, Upkeep};
use crate::verify::rays::{self, Ray};
use crate::verify::view::{Stage, View};
use crate::verify::work::Work;
use crate::verify::{Hit, Machine, MachineKind, PerKind};
use counter::Counter;
pub use policy::RebuildEvery;

/// What to measure.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameOptions {
    /// The policies to compare.
    pub policies: Vec<RebuildEvery>,
    /// Number of frames; at least 1.
    pub frames: u32,
    /// Frames per second of the animation, which is not the speed at which they are traced.
    pub frames_per_second: f64,
    /// Number of rays of each kind in each frame.
    pub rays: usize,
    /// Number of rays of each kind whose steps are counted; at most all, 0 for no counts.
    pub counted_rays: usize,
    /// Steps are counted in each frame whose number is a multiple of this, and in the last one.
    pub counted_every: u32,
    /// How BLASes of meshes that deform are kept up to date.
    pub blas_upkeep: Upkeep,
    /// The camera; `None` for one that suits the scene.
    pub camera: Option<Orbit>,
    /// Revolutions of the camera that suits the scene, per second.
    pub camera_frequency: f64,
    /// How a device builds structures.
    pub build: BuildOptions,
    /// Seed of the rays.
    pub seed: u64,
}

impl Default for FrameOptions {
    fn default() -> Self {
        FrameOptions {
            policies: [1, 2, 8, 64].map(RebuildEvery::Frames).into_iter().chain([RebuildEvery::Never]).collect(),
            frames: 64,
            frames_per_second: 30.0,
            rays: 16_384,
            counted_rays: 1024,
            counted_every: 16,
            blas_upkeep: Upkeep::Refit,
            camera: None,
            camera_frequency: 0.1,
            build: BuildOptions::default(),
            seed: 1,
        }
    }
}

/// A frame traced by one policy.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Number of the frame, from 0.
    pub number: u32,
    /// Time of the animation, in seconds.
    pub time: f64,
    /// The policy.
    pub policy: RebuildEvery,
    /// Milliseconds of the CPU to compute the matrices of all instances, and the positions of what deforms.
    pub matrices_ms: f64,
    /// Milliseconds to refit or rebuild the BLASes of what deforms, for all policies.
    pub blas_ms: f64,
    /// What the frame took.
    pub times: FrameTimes,
    /// Milliseconds to trace the same rays through a TLAS that was rebuilt in this frame.
    pub fresh_trace_ms: Option<PerKind<f64>>,
    /// Steps of the counted rays, and those in trees built anew; only in the frames in which they are counted.
    pub work: Option<Compared>,
    /// Number of rays traced of each kind.
    pub rays: PerKind<usize>,
    /// Memory of the structures.
    pub bytes: FrameBytes,
}

/// Steps of rays through aged and through new trees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Compared {
    /// Through the trees of the policy.
    pub aged: PerKind<Work>,
    /// Through trees that were built in this frame.
    pub fresh: PerKind<Work>,
}

/// The hits of the last frame by one policy, held against the true ones.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LastHits {
    /// The policy.
    pub policy: RebuildEvery,
    /// How they compare.
    pub hits: CheckedHits,
}

/// Why frames could not be traced: the tracer failed, or whoever receives the frames.
#[derive(Debug, PartialEq)]
pub enum FramesError<E> {
    /// The tracer, in words.
    Tracer(String),
    /// The receiver.
    Receiver(E),
}

impl<E> From<String> for FramesError<E> {
    fn from(why: String) -> Self {
        FramesError::Tracer(why)
    }
}

/// Index of the TLAS that finds what the camera sees, which the other rays start from. It is refitted in each frame.
const SCOUT: usize = 0;
/// Index of the TLAS that is rebuilt in each frame.
const FRESH: usize = 1;
/// Frames traced on a GPU before the first one counts: an idle GPU needs time to raise its clock.
const WARM_UPS: u32 = 20;
/// Rays of each kind whose hits are checked in the last frame, at most.
const CHECKED: usize = 1 << 14;

/// Traces all frames of a scene, gives each frame of each policy to `each`, and checks the hits of the last frame. If a
/// device cannot build the scene, nothing is given.
///
/// # Errors
/// Fails if the device does, or if `each` does.
pub fn run<E>(
    moving: &mut MovingScene,
    machine: &Machine,
    options: &FrameOptions,
    each: &mut dyn FnMut(&Frame) -> Result<(), E>,
) -> Result<Vec<LastHits>, FramesError<E>> {
    moving.advance(0.0);
    let maker = machine.frame_maker()?;
    let mut run = Run::new(moving, &*maker, options)?;
    if machine.name().1 == MachineKind::Gpu {
        run.warm_up(moving.scene())?;
    }
    let mut counter = (options.counted_rays > 0).then(|| Counter::new(moving.scene(), options));
    for number in 0..options.frames {
        let (rays, frames) = run.frame(number, moving)?;
        let is_counted = number.is_multiple_of(options.counted_every.max(1)) || number + 1 == options.frames;
        let counter = counter.as_mut().filter(|_| is_counted);
        let counted = counter.map(|counter| counter.count(number, moving, &thinned(&rays, options.counted_rays)));
        for (i, mut frame) in frames.into_iter().enumerate() {
            frame.work = counted.as_ref().map(|counted| counted[i]);
            each(&frame).map_err(FramesError::Receiver)?;
        }
    }
    Ok(run.check(moving.scene())?)
}

/// State of all frames.
struct Run<'a> {
    tracer: Box<dyn FrameTracer + 'a>,
    options: &'a FrameOptions,
    /// For each policy, the index of its TLAS.
    tlas_of: Vec<usize>,
    stage: Stage,
    camera: Orbit,
    rays: PerKind<Vec<Ray>>,
}

impl<'a> Run<'a> {
    fn new(moving: &MovingScene, maker: &'a dyn FrameMaker, options: &'a FrameOptions) -> Result<Run<'a>, String> {
        let scene = moving.scene();
        let mut refits = vec![true, false];
        let tlas = |policy: &RebuildEvery| match policy {
            RebuildEvery::Frames(0 | 1) => FRESH,
            _ => {
                refits.push(true);
                refits.len() - 1
            }
        };
        let tlas_of = options.policies.iter().map(tlas).collect();
        let plan = FramePlan { refits, deforming: moving.deforming().to_vec(), build: options.build };
        let mut tracer = maker.frames(scene, &plan)?;
        tracer.frame(SCOUT, scene, Upkeep::Rebuild, false)?;
        let core = scene.core().bounds();
        let found = [core, scene.bounds()].into_iter().find(|bounds| !bounds.is_empty());
        let bounds = found.unwrap_or(Bounds { min: DVec3::ZERO, max: DVec3::ZERO });
        let stage = rays::stage(bounds, &|rays: &[Ray]| seen(&*tracer, rays), options.seed)?;
        let camera = options.camera.unwrap_or_else(|| Orbit::automatic(&stage, options.camera_frequency));
        Ok(Run { tracer, options, tlas_of, stage, camera, rays: PerKind::default() })
    }

    /// Keeps a GPU busy until it runs at its full clock.
    fn warm_up(&mut self, scene: &Scene) -> Result<(), String> {
        self.rays = self.rays_at(scene, 0.0)?;
        self.tracer.set_rays(&self.rays)?;
        for _ in 0..WARM_UPS {
            self.tracer.frame(FRESH, scene, Upkeep::Rebuild, true)?;
        }
        Ok(())
    }

    /// Traces a frame by all policies; returns its rays too.
    fn frame(&mut self, number: u32, moving: &mut MovingScene) -> Result<(PerKind<Vec<Ray>>, Vec<Frame>), String> {
        let time = self.options.time(number);
        let start = Instant::now();
        moving.advance(time);
        let matrices_ms = 1e3 * start.elapsed().as_secs_f64();
        let scene = moving.scene();
        let blas_ms = match moving.deforming() {
            [] => 0.0,
            deformed => self.tracer.deform(scene, deformed, self.options.blas_upkeep)?,
        };
        self.tracer.frame(SCOUT, scene, Upkeep::Refit, false)?;
        self.rays = self.rays_at(scene, time)?;
        self.tracer.set_rays(&self.rays)?;
        let times = self.traced(number, scene)?;
        let frame = |(i, policy): (usize, &RebuildEvery)| Frame {
            number,
            time,
            policy: *policy,
            matrices_ms,
            blas_ms,
            times: times[self.tlas_of[i]].unwrap_or_else(|| unreachable!("each policy has a TLAS")),
            fresh_trace_ms: times[FRESH].and_then(|times| times.trace_ms),
            work: None,
            rays: self.rays.each_ref().map(Vec::len),
            bytes: self.tracer.bytes(self.tlas_of[i]),
        };
        let frames = self.options.policies.iter().enumerate().map(frame).collect();
        Ok((self.rays.clone(), frames))
    }

    /// Brings all TLASes up to date and traces the rays through each; what each took, by its index.
    fn traced(&mut self, number: u32, scene: &Scene) -> Result<Vec<Option<FrameTimes>>, String> {
        let mut upkeep = vec![(FRESH, Upkeep::Rebuild)];
        let policies = self.options.policies.iter().zip(&self.tlas_of).filter(|(_, tlas)| **tlas != FRESH);
        upkeep.extend(policies.map(|(policy, tlas)| (*tlas, policy.upkeep(number))));
        let first = number as usize % upkeep.len();
        upkeep.rotate_left(first);
        let mut times = vec![None; FRESH + upkeep.len()];
        for (tlas, upkeep) in upkeep {
            times[tlas] = Some(self.tracer.frame(tlas, scene, upkeep, true)?);
        }
        Ok(times)
    }

    fn rays_at(&self, scene: &Scene, time: f64) -> Result<PerKind<Vec<Ray>>, String> {
        let view = self.camera.view(time).unwrap_or_else(|| View::automatic(&self.stage));
        let sampling = (self.options.rays, self.options.seed);
        rays::generate_from(scene, self.stage, view, &|rays| seen(&*self.tracer, rays), sampling)
    }

    /// Holds the hits of the last frame against true ones, found in double precision in trees of their own over the placed
    /// triangles.
    fn check(&self, scene: &Scene) -> Result<Vec<LastHits>, String> {
        let trees = TwoLevel::build(scene);
        let reference = Reference::new(&trees);
        let rays = thinned(&self.rays, CHECKED);
        let truths = rays.each_ref().map(|rays| reference.closest(rays));
        let of_policy = |(policy, tlas): (&RebuildEvery, &usize)| {
            let mut hits = CheckedHits::default();
            for (kind, rays) in rays.iter() {
                let found: Vec<Option<Hit>> = self.tracer.closest(*tlas, rays)?;
                hits.add(&check_hits::check(scene, &truths[kind], rays, &found));
            }
            Ok(LastHits { policy: *policy, hits })
        };
        self.options.policies.iter().zip(&self.tlas_of).map(of_policy).collect()
    }
}

impl FrameOptions {
    /// Returns the time of a frame, in seconds.
    fn time(&self, frame: u32) -> f64 {
        f64::from(frame) / self.frames_per_second
    }
}

/// Returns what rays hit first, in the form of true hits.
fn seen(tracer: &dyn FrameTracer, rays: &[Ray]) -> Result<Vec<Option<TrueHit>>, String> {
    let hits = tracer.closest(SCOUT, rays)?;
    Ok(hits.into_iter().map(|hit| hit.map(TrueHit::from)).collect())
}

/// Returns about so many rays of each kind, at regular intervals.
fn thinned(rays: &PerKind<Vec<Ray>>, count: usize) -> PerKind<Vec<Ray>> {
    rays.each_ref().map(|rays| {
        let step = rays.len().div_ceil(count.max(1)).max(1);
        rays.iter().step_by(step).copied().collect()
    })
}
