//! Proves that a written file shows what the input shows.
//!
//! [`structure`] compares the two scenes triangle by triangle, exactly; [`compare`] compares what rays see of them;
//! [`verdict`] states the rules. Rays, comparison and verdict know no tracer but the trait [`Tracer`].

pub mod approach;
pub mod compare;
pub mod cpu;
pub mod identity;
mod random;
pub mod rays;
pub mod rounding;
pub mod speed;
pub mod structure;
#[cfg(test)]
mod test_scenes;
#[cfg(test)]
mod tests;
pub mod verdict;
pub mod view;
#[cfg(feature = "vulkan")]
pub mod vulkan;

use std::time::Instant;

use compare::{Comparison, Tally};
use cpu::{CpuTracer, Reference, TwoLevel};
use identity::Identity;
use rays::{Ray, RayKind};
use speed::Kinds;
pub use verdict::Verification;

use crate::scene::Scene;

/// How to verify.
#[derive(Clone, Debug, PartialEq)]
pub struct VerifyOptions {
    /// Rays of each of the four kinds.
    pub rays_per_kind: u32,
    /// Seed of the rays.
    pub seed: u64,
    /// How often each kind is timed; 0 counts as 1.
    pub repeats: u32,
    /// Largest distance a corner may lie from its place, over the diagonal of the input's box.
    pub max_position_error_ratio: f64,
    /// Share of the rays on which before and after agree that is held against the truth all the same, 0 to 1.
    pub sample_ratio: f64,
}

impl Default for VerifyOptions {
    fn default() -> Self {
        VerifyOptions {
            rays_per_kind: 16_384,
            seed: 1,
            repeats: 3,
            max_position_error_ratio: 1e-6,
            sample_ratio: 1.0 / 16.0,
        }
    }
}

/// What a ray hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f32,
    /// Index into the scene's instances.
    pub instance: u32,
    /// Triangle of the instance's mesh, counted through all its geometries.
    pub triangle: u32,
    /// Whether the front is seen, by glTF's rule: the side from which the corners run counter-clockwise in the mesh.
    pub front: bool,
}

/// Something that traces rays through one scene.
pub trait Tracer {
    /// What does the tracing, for the report.
    fn device(&self) -> String;

    /// The first hit of each ray.
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>>;

    /// For each ray whether it hits anything.
    fn occluded(&self, rays: &[Ray]) -> Vec<bool>;

    /// Seconds to trace rays of a kind: shadow rays until the first hit found, others to the closest.
    fn seconds(&self, kind: RayKind, rays: &[Ray]) -> f64 {
        let start = Instant::now();
        match kind {
            RayKind::Shadow => drop(std::hint::black_box(self.occluded(rays))),
            _ => drop(std::hint::black_box(self.closest(rays))),
        }
        start.elapsed().as_secs_f64()
    }
}

/// Verifies `after`, the file written, against `before`, the input, on the CPU.
pub fn verify(before: &Scene, after: &Scene, options: &VerifyOptions) -> Verification {
    let (trees_before, trees_after) = rayon::join(|| TwoLevel::build(before), || TwoLevel::build(after));
    let reference = Reference::new(&trees_before);
    let tracers = [CpuTracer::new(&trees_before), CpuTracer::new(&trees_after)];
    verify_with(before, after, &reference, [&tracers[0], &tracers[1]], options)
}

/// Verifies with a tracer through each of the scenes; `reference` is of `before`.
pub fn verify_with(
    before: &Scene,
    after: &Scene,
    reference: &Reference,
    tracers: [&dyn Tracer; 2],
    options: &VerifyOptions,
) -> Verification {
    let identity = Identity::new(before, after);
    let structure = structure::compare(&identity, before, after, options.max_position_error_ratio);
    let rays = rays::generate(before, reference, options.rays_per_kind as usize, options.seed);
    let comparison = Comparison::new(&identity, reference, &structure, rays.radius, options);
    let mut tally = Tally::default();
    let mut kinds = Kinds::default();
    for (kind, rays) in RayKind::ALL.into_iter().zip(&rays.kinds) {
        tally.add(compare_kind(&comparison, kind, rays, tracers));
        *kinds.of(kind) = speed::measure(kind, rays, tracers, options.repeats);
    }
    verdict::judge(tracers[0].device(), rays.view, structure, tally, kinds, options)
}

/// Traces rays through both scenes and compares what they see.
fn compare_kind(comparison: &Comparison, kind: RayKind, rays: &[Ray], tracers: [&dyn Tracer; 2]) -> Tally {
    let [before, after] = tracers.map(|tracer| tracer.closest(rays));
    let mut tally = comparison.compare(kind, rays, &before, &after);
    if kind == RayKind::Shadow {
        for (tracer, closest) in tracers.into_iter().zip([&before, &after]) {
            let occluded = tracer.occluded(rays);
            tally.tracer_faults += closest.iter().zip(occluded).filter(|(c, o)| c.is_some() != *o).count() as u64;
        }
    }
    tally
}
