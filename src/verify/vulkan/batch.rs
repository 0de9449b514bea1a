//! [`VulkanTracer`] as used by pictures.

use super::Error;
use super::interface::{self, Clocked};
use super::trace::{Launch, VulkanTracer};
use super::transfer::download;
use crate::verify::batch::{BatchTracer, Ticks};
use crate::verify::rays::Ray;
use crate::verify::{DeviceError, Hit};

/// Hits kept per ray at first, if all are wanted.
const KEPT: u32 = 16;
/// Hits kept at a time, which take 96 MiB.
const MOST_KEPT: usize = 1 << 22;

impl BatchTracer for VulkanTracer<'_, '_> {
    fn device(&self) -> &str {
        &self.device().info().name
    }

    fn has_clock(&self) -> bool {
        self.device().info().has_clock
    }

    fn closest(&self, rays: &[Ray]) -> Result<Vec<Option<Hit>>, DeviceError> {
        if rays.is_empty() {
            return Ok(Vec::new());
        }
        Ok(self.trace(&self.device().upload_rays(rays)?, false)?.hits)
    }

    fn all(&self, rays: &[Ray]) -> Result<Vec<Vec<Hit>>, DeviceError> {
        let mut all = vec![Vec::new(); rays.len()];
        let mut open: Vec<usize> = (0..rays.len()).collect();
        let mut kept = KEPT;
        // Rays with more hits than are kept are traced again.
        while !open.is_empty() {
            let (mut most, mut left) = (0, Vec::new());
            for chunk in open.chunks((MOST_KEPT / kept as usize).max(1)) {
                let wanted: Vec<Ray> = chunk.iter().map(|&i| rays[i]).collect();
                for (&i, (found, hits)) in chunk.iter().zip(self.kept(&wanted, kept)?) {
                    if found > kept {
                        most = most.max(found);
                        left.push(i);
                    } else {
                        all[i] = ordered(hits);
                    }
                }
            }
            (open, kept) = (left, most);
        }
        Ok(all)
    }

    fn ticks(&self, rays: &[Ray]) -> Result<Vec<Ticks>, DeviceError> {
        assert!(self.has_clock(), "the device has a clock");
        let buffer = self.device().upload_rays(rays)?;
        let results = self.results(&buffer, size_of::<Clocked>() as u64)?;
        let pipeline = self.pipelines.clock()?;
        let mut ticks = Vec::with_capacity(rays.len());
        for part in &buffer.parts {
            self.device().submit(&format!("clocking {} rays", part.count), |commands| {
                self.record(commands, pipeline, self.tlas_address(), part, &results, Launch::default());
            })?;
            download(self.device(), &results, part.count as usize, |of_ray: &Clocked| {
                ticks.push(Ticks { ticks: of_ray.ticks, is_hit: of_ray.is_hit != 0 });
            })?;
        }
        Ok(ticks)
    }
}

impl VulkanTracer<'_, '_> {
    /// Returns how many hits were found of each ray, and up to `kept` of them.
    fn kept(&self, rays: &[Ray], kept: u32) -> Result<Vec<(u32, Vec<Hit>)>, Error> {
        let buffer = self.device().upload_rays(rays)?;
        let results = self.results(&buffer, u64::from(kept) * size_of::<interface::Hit>() as u64)?;
        let pipeline = self.pipelines.all()?;
        let mut all = Vec::with_capacity(rays.len());
        for part in &buffer.parts {
            self.device().submit(&format!("tracing {} rays through all hits", part.count), |commands| {
                self.record(commands, pipeline, self.tlas_address(), part, &results, Launch::through(kept));
            })?;
            let mut place = 0;
            let (mut found, mut hits) = (0, Vec::new());
            download(self.device(), &results, part.count as usize * kept as usize, |hit: &interface::Hit| {
                if place == 0 {
                    found = hit.any_hits;
                }
                // What lies beyond those found was not written.
                if place < found {
                    hits.extend(self.identity.hit(hit));
                }
                place += 1;
                if place == kept {
                    all.push((found, std::mem::take(&mut hits)));
                    place = 0;
                }
            })?;
        }
        Ok(all)
    }
}

/// Sorts hits by distance, each triangle once: a driver may announce a triangle more than once.
fn ordered(mut hits: Vec<Hit>) -> Vec<Hit> {
    hits.sort_unstable_by(Hit::nearer);
    hits.dedup_by_key(|hit| (hit.instance, hit.triangle));
    hits
}
