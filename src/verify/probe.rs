//! Tracers of any kind behind one interface, for experiments: in each arithmetic on the CPU, or on a device.

use std::time::Instant;

use super::cpu::{ComputingTracer, TrueHit};
use super::{
    Machine, VerifyOptions,
    rays::{Ray, RayKind},
};
#[cfg(feature = "vulkan")]
use super::{
    Tracer,
    build::BuildOptions,
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
    /// Returns the number of rays of each kind that times should be taken of.
    fn timed(&self, options: &VerifyOptions) -> u32 {
        options.timed_rays_per_kind.unwrap_or(options.rays_per_kind)
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
}

#[cfg(feature = "vulkan")]
struct VulkanProber<'d> {
    pipelines: Pipelines<'d>,
    build: BuildOptions,
}

#[cfg(feature = "vulkan")]
impl Prober for VulkanProber<'_> {
    fn probe(&self, scene: &Scene) -> Result<Box<dyn Probe + '_>, String> {
        let tracer = VulkanTracer::new(&self.pipelines, scene, self.build).map_err(in_words)?;
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
