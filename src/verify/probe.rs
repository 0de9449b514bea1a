//! Tracers of any kind behind one interface, for experiments: in each arithmetic on the CPU, or on a device.

use std::time::Instant;

use super::build::{BuildOptions, Built};
use super::cpu::{ComputingTracer, TrueHit};
use super::{
    Machine, VerifyOptions,
    rays::{Ray, RayKind},
};
#[cfg(feature = "vulkan")]
use super::{
    Tracer,
    tracing::seen_by,
    vulkan::{Error, Pipelines, VulkanTracer},
};
use crate::scene::Scene;

/// Traces rays through one scene. Errors are in words.
pub(crate) trait Probe {
    /// Returns the first hit of each ray.
    fn closest(&self, rays: &[Ray]) -> Result<Vec<Option<TrueHit>>, String>;
    /// Returns, for each ray, whether it hits anything.
    fn occluded(&self, rays: &[Ray]) -> Result<Vec<bool>, String>;
    /// Returns the seconds to trace rays of a kind: shadow rays to the first hit found, others to the closest hit.
    fn seconds(&self, kind: RayKind, rays: &[Ray]) -> Result<f64, String>;
    /// Returns the seconds of each of several passes over rays of a kind, after a first one that does not count: as many
    /// passes as asked for, or as many as begin within the time.
    fn passes(&self, kind: RayKind, rays: &[Ray], until: Until) -> Result<Vec<f64>, String> {
        until.repeat(|| self.seconds(kind, rays))
    }
    /// Makes a pass over rays of a kind ready: what the device needs of the rays is handed to it once.
    fn pass<'p>(&'p self, kind: RayKind, rays: &'p [Ray]) -> Result<Pass<'p>, String> {
        Ok(Box::new(move || self.seconds(kind, rays)))
    }
    /// Returns what was built; `None` if it says nothing about a device.
    fn built(&self) -> Option<Built> {
        None
    }
    /// Returns the number of rays of each kind that times should be taken of.
    fn timed(&self, options: &VerifyOptions) -> u32 {
        options.timed_rays_per_kind.unwrap_or(options.rays_per_kind)
    }
}

/// A pass over rays that can be repeated; returns the seconds it took.
pub(crate) type Pass<'p> = Box<dyn FnMut() -> Result<f64, String> + 'p>;

/// When to stop timing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Until {
    /// After this number of passes; 0 counts as 1.
    Passes(u32),
    /// Once so many seconds have passed.
    Seconds(f64),
}

impl Until {
    /// Repeats a pass, which returns its own seconds.
    fn repeat<E>(self, mut pass: impl FnMut() -> Result<f64, E>) -> Result<Vec<f64>, E> {
        pass()?;
        let (start, mut times) = (Instant::now(), Vec::new());
        loop {
            // A clock that did not advance counts as one nanosecond.
            times.push(pass()?.max(1e-9));
            let is_over = match self {
                Until::Passes(count) => times.len() >= count as usize,
                Until::Seconds(seconds) => start.elapsed().as_secs_f64() >= seconds,
            };
            if is_over {
                return Ok(times);
            }
        }
    }
}

impl Probe for ComputingTracer<'_> {
    fn closest(&self, rays: &[Ray]) -> Result<Vec<Option<TrueHit>>, String> {
        Ok(ComputingTracer::closest(self, rays))
    }

    fn occluded(&self, rays: &[Ray]) -> Result<Vec<bool>, String> {
        Ok(ComputingTracer::occluded(self, rays))
    }

    fn seconds(&self, kind: RayKind, rays: &[Ray]) -> Result<f64, String> {
        let start = Instant::now();
        match kind {
            RayKind::Shadow => drop(std::hint::black_box(ComputingTracer::occluded(self, rays))),
            _ => drop(std::hint::black_box(ComputingTracer::closest(self, rays))),
        }
        Ok(start.elapsed().as_secs_f64())
    }
}

/// Makes probes of a device.
pub(crate) trait Prober {
    /// Builds the acceleration structures of a scene.
    fn probe(&self, scene: &Scene) -> Result<Box<dyn Probe + '_>, String>;

    /// Like [`Prober::probe`], with other options than those of the prober.
    fn probe_built(&self, scene: &Scene, build: BuildOptions) -> Result<Box<dyn Probe + '_>, String>;
}

#[cfg(feature = "vulkan")]
struct VulkanProber<'d> {
    pipelines: Pipelines<'d>,
    build: BuildOptions,
}

#[cfg(feature = "vulkan")]
impl Prober for VulkanProber<'_> {
    fn probe(&self, scene: &Scene) -> Result<Box<dyn Probe + '_>, String> {
        self.probe_built(scene, self.build)
    }

    fn probe_built(&self, scene: &Scene, build: BuildOptions) -> Result<Box<dyn Probe + '_>, String> {
        let tracer = VulkanTracer::new(&self.pipelines, scene, build).map_err(in_words)?;
        Ok(Box::new(tracer))
    }
}

#[cfg(feature = "vulkan")]
impl Probe for VulkanTracer<'_, '_> {
    fn closest(&self, rays: &[Ray]) -> Result<Vec<Option<TrueHit>>, String> {
        seen_by(self, rays).map_err(in_words)
    }

    fn occluded(&self, rays: &[Ray]) -> Result<Vec<bool>, String> {
        self.prepare(rays).and_then(|rays| Tracer::occluded(self, &rays)).map_err(in_words)
    }

    fn seconds(&self, kind: RayKind, rays: &[Ray]) -> Result<f64, String> {
        self.prepare(rays).and_then(|rays| Tracer::seconds(self, kind, &rays)).map_err(in_words)
    }

    fn passes(&self, kind: RayKind, rays: &[Ray], until: Until) -> Result<Vec<f64>, String> {
        let prepared = self.prepare(rays).map_err(in_words)?;
        until.repeat(|| Tracer::seconds(self, kind, &prepared)).map_err(in_words)
    }

    fn pass<'p>(&'p self, kind: RayKind, rays: &'p [Ray]) -> Result<Pass<'p>, String> {
        let prepared = self.prepare(rays).map_err(in_words)?;
        Ok(Box::new(move || Tracer::seconds(self, kind, &prepared).map_err(in_words)))
    }

    fn built(&self) -> Option<Built> {
        Tracer::built(self)
    }

    fn timed(&self, options: &VerifyOptions) -> u32 {
        self.pace().timed(options)
    }
}

#[cfg(feature = "vulkan")]
fn in_words(error: Error) -> String {
    error.to_string()
}

impl Machine {
    /// Returns what probes the device; `None` where the CPU traces.
    ///
    /// # Errors
    /// Why the device cannot trace, in words.
    #[cfg(feature = "vulkan")]
    pub(crate) fn prober(&self, options: &VerifyOptions) -> Option<Result<Box<dyn Prober + '_>, String>> {
        let device = self.device.as_ref()?;
        let build = options.build;
        let prober = Pipelines::new(device).map(|pipelines| VulkanProber { pipelines, build });
        Some(prober.map(|prober| Box::new(prober) as Box<dyn Prober + '_>).map_err(in_words))
    }

    /// Without Vulkan there is no device to probe.
    #[cfg(not(feature = "vulkan"))]
    pub(crate) fn prober(&self, _: &VerifyOptions) -> Option<Result<Box<dyn Prober + '_>, String>> {
        None
    }
}
