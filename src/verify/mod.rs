//! Verifies that a written file shows the same as the input.
//!
//! [`surface`] compares the two scenes triangle by triangle, exactly; [`compare`] compares what rays hit in them;
//! [`verdict`] states the rules. Rays, comparison and verdict use tracers only through the trait [`Tracer`]; [`device`]
//! decides which one traces.

pub mod accuracy;
pub mod approach;
pub mod batch;
pub mod build;
pub mod check_hits;
pub mod compare;
pub mod contents;
pub mod cpu;
pub mod device;
pub mod errors;
mod exact;
pub mod frames;
mod hit_surfaces;
pub mod identity;
mod materials;
mod note;
mod per_kind;
pub mod precisions;
#[cfg(feature = "lab")]
pub(crate) mod probe;
mod race;
pub(crate) mod random;
pub mod rays;
pub mod regrouped;
pub mod rounding;
pub mod seams;
mod sides;
pub mod sight;
pub mod speed;
pub mod structure;
pub mod surface;
#[cfg(test)]
pub(crate) mod test_scenes;
#[cfg(test)]
mod tests;
mod tracing;
pub mod verdict;
pub mod view;
mod view_speeds;
pub mod views;
#[cfg(feature = "vulkan")]
pub mod vulkan;
pub mod weights;
pub mod work;

use build::BuildOptions;
use compare::Comparison;
use cpu::{CpuTracer, Reference, TwoLevel};
pub use device::{DeviceChoice, DeviceError, Machine, MachineKind};
pub use exact::Exact;
use hit_surfaces::Surfaces;
pub use note::{Failure, FaultKind, Mismatch, Note, OpaqueTextures, Target, WhyCpu, Wrong};
pub use per_kind::PerKind;
pub use race::{RaceResult, Timing, race_on_cpu};
use rays::Sampling;
use seams::Aimed;
use serde::Serialize;
pub use sides::{Side, Sides};
use structure::reference_length;
pub use tracing::{TimingHints, Tracer, Tracers};
pub use verdict::Verification;
pub use view_speeds::ViewSpeeds;
use views::Role;
use weights::Weights;

use crate::cost::mesh_trees::MeshTrees;
use crate::scene::Scene;

/// Options of a verification.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct VerifyOptions {
    /// The device to trace on; only [`Machine::open`] reads it.
    pub device: DeviceChoice,
    /// How triangles are matched.
    pub matching: Matching,
    /// How a device builds its acceleration structures.
    pub build: BuildOptions,
    /// Number of compared rays for each of the four kinds.
    pub rays_per_kind: u32,
    /// Number of timed rays for each kind; `None` for as many as suit the device ([`TimingHints::rays`]).
    pub timed_rays_per_kind: Option<u32>,
    /// Number of views that rays come from; half of them choose a layout, the others judge it.
    pub views: u32,
    /// Seed of the views and rays.
    pub seed: u64,
    /// Weight of each ray kind in the overall speed.
    pub weights: Weights,
    /// Number of times each kind is timed; 0 counts as 1.
    pub repeats: u32,
    /// Least speedup of any judging view with which an output still counts as faster.
    pub least_view_ratio: f64,
    /// Largest allowed position error of a corner, relative to the diagonal of the input's box.
    pub max_position_error_ratio: f64,
    /// Whether the output must have the input's BLAS groups: none merged, none split.
    pub same_groups: bool,
    /// Share of the rays with equal results that is checked against the truth anyway, 0 to 1.
    pub sample_ratio: f64,
}

impl Default for VerifyOptions {
    fn default() -> Self {
        VerifyOptions {
            device: DeviceChoice::default(),
            matching: Matching::default(),
            build: BuildOptions::default(),
            rays_per_kind: 16_384,
            timed_rays_per_kind: None,
            views: views::DEFAULT_VIEWS,
            seed: 1,
            weights: Weights::default(),
            repeats: 7,
            least_view_ratio: 0.97,
            max_position_error_ratio: 1e-6,
            same_groups: false,
            sample_ratio: 1.0 / 16.0,
        }
    }
}

impl VerifyOptions {
    /// The same without times, for files that are equal.
    pub(crate) fn untimed(&self) -> VerifyOptions {
        VerifyOptions { timed_rays_per_kind: Some(0), ..self.clone() }
    }

    /// Rays of each kind from the views of a role, or from all of them.
    pub(crate) fn sampling(&self, rays_per_kind: usize, role: Option<Role>) -> Sampling {
        Sampling { rays_per_kind, views: self.views.max(views::FEWEST_VIEWS), role, seed: self.seed }
    }
}

/// How triangles of the output are matched with those of the input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Matching {
    /// All triangles by their place, in double precision; what the output records about them need not be right.
    Place,
    /// All triangles by their place, which must be the one that the output records.
    #[default]
    Identity,
    /// Not matched: only the surfaces that rays hit are compared, by place, side, and the name or look of their
    /// material.
    Surface,
}

/// A hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance, in units of the direction's length.
    pub t: f32,
    /// Index into the scene's instances.
    pub instance: u32,
    /// Index of the triangle in the instance's mesh, counted across all its geometries.
    pub triangle: u32,
    /// Whether the front is hit, by glTF's rule: the side on which the corners run counter-clockwise in the mesh.
    pub front: bool,
}

impl Hit {
    /// Orders hits of a ray by distance; ties by instance and triangle.
    pub(crate) fn nearer(&self, other: &Hit) -> std::cmp::Ordering {
        let place = |hit: &Hit| (hit.instance, hit.triangle);
        self.t.total_cmp(&other.t).then(place(self).cmp(&place(other)))
    }
}

/// Verifies `after`, the written file, against `before`, the input, on the CPU.
pub fn verify(before: &Scene, after: &Scene, options: &VerifyOptions) -> Verification {
    let (none, scenes) = (&MeshTrees::default(), Sides { before, after });
    let exact = Exact::of_scenes(scenes, options);
    verify_on_cpu(scenes, Sides { before: none, after: none }, exact.as_ref(), options)
}

/// Like [`verify`], with given trees of the scenes' meshes, and the results of comparing them exhaustively.
fn verify_on_cpu(
    scenes: Sides<&Scene>,
    trees: Sides<&MeshTrees>,
    exact: Option<&Exact>,
    options: &VerifyOptions,
) -> Verification {
    let Sides { before, after } = scenes.zip(trees);
    let (before, after) =
        rayon::join(|| TwoLevel::build_with(before.0, before.1), || TwoLevel::build_with(after.0, after.1));
    let reference = Reference::new(&before);
    let tracers = Sides { before: CpuTracer::new(&before), after: CpuTracer::new(&after) };
    let Ok(found) = verify_with(scenes, exact, &reference, tracers.as_ref(), options);
    found
}

/// Verifies with one tracer per scene; `reference` is that of `before`. Without an `exact` comparison, only what rays see
/// is compared.
///
/// # Errors
/// Returns the errors of the tracers.
pub fn verify_with<'t, T: Tracer + 't>(
    scenes: Sides<&Scene>,
    exact: Option<&Exact>,
    reference: &Reference,
    tracers: impl Into<Tracers<'t, T>>,
    options: &VerifyOptions,
) -> Result<Verification, T::Error> {
    let before = scenes.before;
    let tracers = tracers.into();
    let rays = rays::generate(before, reference, &options.sampling(options.rays_per_kind as usize, None));
    let Some(exact) = exact else {
        let surfaces = Surfaces::new(scenes, reference, rays.radius, options);
        let compare = |kind, rays: &[_], hits: Sides<&[_]>| surfaces.compare(kind, rays, hits);
        let aimed = Aimed::new(before, None, options.max_position_error_ratio * reference_length(before), options);
        let mut seen = tracing::trace(before, &rays, &aimed, tracers, options, compare)?;
        seen.notes.extend(surfaces.note());
        let cannot_tell = surfaces.cannot_tell(&seen.tally);
        return Ok(verdict::judge(scenes, seen, None, cannot_tell, options));
    };
    let comparison = Comparison::new(scenes, &exact.pairs, reference, &exact.structure, rays.radius, options);
    let compare = |kind, rays: &[_], hits: Sides<&[_]>| comparison.compare(kind, rays, hits);
    let aimed = Aimed::new(before, Some(&exact.pairs), comparison.displacement(), options);
    let seen = tracing::trace(before, &rays, &aimed, tracers, options, compare)?;
    let cannot_tell = comparison.cannot_tell(&seen.tally);
    Ok(verdict::judge(scenes, seen, Some(exact), cannot_tell, options))
}
