//! [`VulkanTracer`] as used by a verification.

use super::Error;
use super::trace::{RayBuffer, VulkanTracer};
use crate::verify::build::Built;
use crate::verify::rays::{Ray, RayKind};
use crate::verify::{Hit, OpaqueTextures, TimingHints, Tracer};

/// Number of rays per kind that keeps a GPU busy: four per pixel of a 1280 x 720 image.
const BUSY: u32 = 4 * 1280 * 720;

/// Number of rays per kind that a software driver traces repeatedly within seconds, through a million triangles.
const MANY: u32 = 4096;

impl<'d> Tracer for VulkanTracer<'_, 'd> {
    type Rays<'r> = RayBuffer<'d>;
    type Error = Error;

    fn device(&self) -> String {
        VulkanTracer::device(self).info().name.clone()
    }

    fn pace(&self) -> TimingHints {
        match VulkanTracer::device(self).info().is_software {
            true => TimingHints { rays: None, most_rays: Some(MANY), most_warm_ups: 1 },
            false => TimingHints { rays: Some(BUSY), most_rays: None, most_warm_ups: 30 },
        }
    }

    fn prepare<'r>(&self, rays: &'r [Ray]) -> Result<RayBuffer<'d>, Error> {
        VulkanTracer::device(self).upload_rays(rays)
    }

    fn closest(&self, rays: &RayBuffer<'d>) -> Result<Vec<Option<Hit>>, Error> {
        let traced = self.trace(rays, false)?;
        self.any_hits.set(self.any_hits.get() + traced.any_hit_invocations);
        Ok(traced.hits)
    }

    fn occluded(&self, rays: &RayBuffer<'d>) -> Result<Vec<bool>, Error> {
        Ok(self.trace(rays, true)?.hits.iter().map(Option::is_some).collect())
    }

    fn seconds(&self, kind: RayKind, rays: &RayBuffer<'d>) -> Result<f64, Error> {
        Ok(self.time(rays, kind == RayKind::Shadow)? * 1e-3)
    }

    fn opaque_textures(&self) -> Option<OpaqueTextures> {
        VulkanTracer::opaque_textures(self).cloned()
    }

    fn built(&self) -> Option<Built> {
        let report = self.report();
        Some(Built {
            blases: report.blases,
            tlas_instances: report.tlas_instances,
            blas_bytes: report.blas_bytes,
            blas_bytes_compacted: report.blas_bytes_compacted,
            tlas_bytes: report.tlas_bytes,
            blas_build_ms: report.blas_build_ms,
            tlas_build_ms: report.tlas_build_ms,
            any_hit_invocations: self.any_hits.get(),
        })
    }
}
