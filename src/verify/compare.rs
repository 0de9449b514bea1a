//! Compares the hits of both scenes ray by ray, and resolves differences by the true hit.

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::approach::Approach;
use super::cpu::{Reference, TrueHit};
use super::identity::{Identity, describe};
use super::random::Random;
use super::rays::{Ray, RayKind};
use super::rounding::{Magnitude, SINGLE, SMALLEST};
use super::structure::{Structure, allowed_error};
use super::{Hit, Mismatch, Sides, Target, VerifyOptions, Wrong};
use crate::scene::{InstanceId, Scene, TriangleRef};

/// Number of rounding errors that may accumulate between a ray and its hit.
pub const ROUNDINGS: f64 = 8.0;
/// Distance between two hits, as a share of the scene's radius, above which they count as far apart.
pub(super) const FAR_RATIO: f64 = 1e-4;
/// Lower limit of the distance that errors are relative to, as a share of the scene's radius.
pub(super) const NEAR_RATIO: f64 = 1e-3;
/// Number of mismatches described in words.
pub(super) const EXAMPLES: usize = 4;
/// Random number stream for samples, separate from those of the rays.
const SAMPLE_STREAM: u64 = 100;

/// The largest errors of the classes of a [`Histogram`]; the last class has none.
const UP_TO: [f64; 10] = [1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Classes of a [`Histogram`].
const CLASSES: usize = UP_TO.len() + 1;

/// How relative distance errors are distributed, by decades.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Histogram {
    /// The largest error of each class; none for the last one.
    pub up_to: Vec<Option<f64>>,
    /// How many hits are in each class.
    #[serde(flatten)]
    pub hits: Sides<[u64; CLASSES]>,
}

impl Histogram {
    /// Of the hits that a comparison measured.
    pub(super) fn of(tally: &Tally) -> Histogram {
        let hits = Sides { before: tally.before.by_decade, after: tally.after.by_decade };
        Histogram { up_to: UP_TO.into_iter().map(Some).chain([None]).collect(), hits }
    }
}

/// Distance errors relative to the truth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Number of hits measured.
    pub count: u64,
    /// Largest relative error.
    pub max: f64,
    sum_of_squares: f64,
    /// How many are in each class of [`Histogram`].
    pub(super) by_decade: [u64; CLASSES],
}

impl Errors {
    /// Returns the root mean square of the relative errors; 0 without hits.
    pub fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.sum_of_squares / self.count as f64).sqrt() }
    }

    pub(super) fn record(&mut self, error: f64) {
        self.count += 1;
        self.max = self.max.max(error);
        self.sum_of_squares += error * error;
        self.by_decade[UP_TO.iter().position(|most| error <= *most).unwrap_or(UP_TO.len())] += 1;
    }

    fn add(&mut self, other: Errors) {
        self.count += other.count;
        self.max = self.max.max(other.max);
        self.sum_of_squares += other.sum_of_squares;
        self.by_decade.iter_mut().zip(other.by_decade).for_each(|(all, more)| *all += more);
    }
}

/// Results of comparing rays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// Number of rays traced.
    pub rays: u64,
    /// Number of rays that hit something in the input.
    pub hits: u64,
    /// Number of rays for which the output is wrong in a way that rounding does not explain.
    pub mismatches: u64,
    /// Number of rays whose hits lie farther apart than rounding moves a hit along a surface.
    pub far_hits: u64,
    /// Number of rays that pass so close to an edge that rounding decides what they hit.
    pub silhouettes: u64,
    /// Number of rays that hit several triangles at the same distance.
    pub ties: u64,
    /// Number of rays for which the tracer is wrong, but not because of the output.
    pub tracer_faults: u64,
    /// Errors in the input.
    pub before: Errors,
    /// Errors in the output.
    pub after: Errors,
    /// The first mismatches.
    pub examples: Vec<Mismatch>,
}

impl Tally {
    /// Counts the judged hits of a ray in the input and the output; `agreed` tells whether both are the same.
    pub(super) fn count(&mut self, judged: Sides<Judgement>, agreed: bool) {
        use Judgement::{Right, Silhouette, Tie, Wrong};
        match (judged.before, judged.after) {
            (Wrong(_), Wrong(_)) if agreed => self.tracer_faults += 1,
            (_, Wrong(_)) => self.mismatches += 1,
            (Wrong(_), _) => self.tracer_faults += 1,
            (Right, Right) => {}
            _ if agreed => {}
            (Silhouette, _) | (_, Silhouette) => self.silhouettes += 1,
            (Tie, _) | (_, Tie) => self.ties += 1,
        }
    }

    /// Adds the results of another comparison.
    pub fn add(&mut self, other: Tally) {
        self.rays += other.rays;
        self.hits += other.hits;
        self.mismatches += other.mismatches;
        self.far_hits += other.far_hits;
        self.silhouettes += other.silhouettes;
        self.ties += other.ties;
        self.tracer_faults += other.tracer_faults;
        self.before.add(other.before);
        self.after.add(other.after);
        self.examples.extend(other.examples);
        self.examples.truncate(EXAMPLES);
    }
}

/// One of the two scenes, as seen by its tracer.
pub(super) struct View<'a> {
    pub(super) scene: &'a Scene,
    /// Maps its triangles to those of the input; `None` for the input itself.
    identity: Option<&'a Identity<'a>>,
    magnitudes: Vec<Magnitude>,
    /// Largest position error of its triangles, in world units; at most the allowed error.
    pub(super) position_error: f64,
}

/// Two scenes and the truth about the first.
pub struct Comparison<'a> {
    before: View<'a>,
    after: View<'a>,
    identity: &'a Identity<'a>,
    reference: &'a Reference<'a>,
    structure_is_clean: bool,
    radius: f64,
    seed: u64,
    sample_ratio: f64,
}

/// A hit reported by a tracer, compared with the triangle it names.
struct Claim {
    source: Option<TriangleRef>,
    material: Option<u32>,
    front: bool,
    /// Distance in world units.
    distance: f64,
    /// How the ray really passes the named triangle, and the slack.
    truly: Option<(Approach, f64)>,
}

/// Judgement of a tracer's result for a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Judgement {
    Right,
    Tie,
    Silhouette,
    Wrong(Wrong),
}

/// A ray that must be judged by the truth.
struct Doubt {
    ray: usize,
    before: Option<Claim>,
    after: Option<Claim>,
}

impl<'a> Comparison<'a> {
    /// Prepares a comparison; `structure` is the result of [`super::structure::compare`], `radius` the scene's radius.
    pub fn new(
        identity: &'a Identity<'a>,
        reference: &'a Reference<'a>,
        structure: &Structure,
        radius: f64,
        options: &VerifyOptions,
    ) -> Self {
        let (before, after) = identity.scenes();
        let allowed = allowed_error(before, options.max_position_error_ratio);
        let position_error = structure.max_position_error.min(allowed);
        Comparison {
            before: View::new(before, None, before.largest_unavoidable_error()),
            after: View::new(after, Some(identity), position_error),
            identity,
            reference,
            structure_is_clean: structure.is_clean(),
            radius,
            seed: options.seed,
            sample_ratio: options.sample_ratio,
        }
    }

    /// Returns the largest distance of a corner of the output from its place, at most the allowed one, in world units.
    pub(super) fn displacement(&self) -> f64 {
        self.after.position_error
    }

    /// Compares the results of both tracers. If they agree and the result is true of the triangle they name, it is
    /// accepted; everything else, and a sample of the accepted rays, is judged by the true closest hit.
    pub fn compare(&self, kind: RayKind, rays: &[Ray], hits: Sides<&[Option<Hit>]>) -> Tally {
        let Sides { before, after } = hits;
        let mut tally =
            Tally { rays: rays.len() as u64, hits: before.iter().flatten().count() as u64, ..Tally::default() };
        let first: Vec<(Sides<Option<f64>>, Option<Doubt>)> = (0..rays.len())
            .into_par_iter()
            .map(|i| self.first_look(kind, i, &rays[i], before[i].as_ref(), after[i].as_ref()))
            .collect();
        let mut doubts = Vec::new();
        for (errors, doubt) in first {
            errors.before.into_iter().for_each(|error| tally.before.record(error));
            errors.after.into_iter().for_each(|error| tally.after.record(error));
            doubts.extend(doubt);
        }
        self.settle(kind, rays, &doubts, &mut tally);
        tally
    }

    /// Returns the distance errors of both hits, and the ray if it must be judged by the truth.
    fn first_look(
        &self,
        kind: RayKind,
        index: usize,
        ray: &Ray,
        before: Option<&Hit>,
        after: Option<&Hit>,
    ) -> (Sides<Option<f64>>, Option<Doubt>) {
        let doubt = Doubt {
            ray: index,
            before: before.map(|hit| self.claim(&self.before, ray, hit)),
            after: after.map(|hit| self.claim(&self.after, ray, hit)),
        };
        let claims = Sides { before: &doubt.before, after: &doubt.after };
        let errors = claims.map(|claim| claim.as_ref().and_then(|claim| self.error(claim)));
        let stream = SAMPLE_STREAM + kind as u64;
        let is_sampled = || Random::at(self.seed, stream, index).unit() < self.sample_ratio;
        let settled = doubt.is_agreement()
            && [&doubt.before, &doubt.after].into_iter().flatten().all(|c| self.fault(c).is_none());
        (errors, (!settled || is_sampled()).then_some(doubt))
    }

    /// Judges rays by the truth.
    fn settle(&self, kind: RayKind, rays: &[Ray], doubts: &[Doubt], tally: &mut Tally) {
        let doubtful: Vec<Ray> = doubts.iter().map(|d| rays[d.ray]).collect();
        let truths = self.reference.closest(&doubtful);
        let missed = |(doubt, truth): (&Doubt, &Option<TrueHit>)| {
            let named = doubt.after.as_ref().and_then(|claim| claim.source);
            truth.map(|t| t.at).filter(|at| named != Some(*at))
        };
        let missed: Vec<Option<TriangleRef>> = doubts.iter().zip(&truths).map(missed).collect();
        let mut places = self.identity.find(&missed.iter().flatten().copied().collect::<Vec<_>>()).into_iter();
        for ((doubt, truth), missed) in doubts.iter().zip(&truths).zip(missed) {
            let ray = &rays[doubt.ray];
            let place = missed.and_then(|_| places.next().flatten());
            let after = self.judge(&self.after, ray, doubt.after.as_ref(), truth.as_ref(), place);
            let before = self.judge(&self.before, ray, doubt.before.as_ref(), truth.as_ref(), truth.map(|t| t.at));
            self.count(doubt, before, after, tally);
            if let Judgement::Wrong(wrong) = after
                && tally.examples.len() < EXAMPLES
            {
                tally.examples.push(self.mismatch(kind, doubt, truth.as_ref(), wrong));
            }
        }
    }

    /// Counts one judged ray.
    fn count(&self, doubt: &Doubt, before: Judgement, after: Judgement, tally: &mut Tally) {
        tally.count(Sides { before, after }, doubt.is_agreement());
        tally.far_hits += u64::from(self.is_far(doubt));
    }

    /// Whether the hits lie farther apart than rounding moves a hit along a surface.
    fn is_far(&self, doubt: &Doubt) -> bool {
        match (&doubt.before, &doubt.after) {
            (None, None) => false,
            (Some(before), Some(after)) => (before.distance - after.distance).abs() > FAR_RATIO * self.radius,
            _ => true,
        }
    }

    fn claim(&self, side: &View, ray: &Ray, hit: &Hit) -> Claim {
        let at = TriangleRef { instance: hit.instance, triangle: hit.triangle };
        let source = side.source(at);
        let length = ray.direction.as_dvec3().length();
        let truly = source.map(|source| {
            let approach = Approach::new(ray, &self.before.scene.world_corners(source));
            (approach, side.slack(hit.instance, ray, &approach))
        });
        let distance = f64::from(hit.t) * length;
        Claim { source, material: material(side.scene, at), front: hit.front, distance, truly }
    }

    /// Returns what is wrong with a claim, without knowing the truth.
    fn fault(&self, claim: &Claim) -> Option<Wrong> {
        let (Some(source), Some((truly, slack))) = (claim.source, claim.truly) else {
            return Some(Wrong::UnknownTriangle);
        };
        if claim.material != material(self.before.scene, source) {
            Some(Wrong::Material)
        } else if !truly.explains(claim.distance, slack) {
            Some(Wrong::MovedTriangle)
        } else if claim.front != truly.front && !truly.grazes(slack) {
            Some(Wrong::BackOfTriangle)
        } else {
            None
        }
    }

    /// Judges a claim by the true closest hit; `place` is the truly hit triangle in the side's scene.
    fn judge(
        &self,
        side: &View,
        ray: &Ray,
        claim: Option<&Claim>,
        truth: Option<&TrueHit>,
        place: Option<TriangleRef>,
    ) -> Judgement {
        let claimed = claim.and_then(|c| c.source);
        if let Some(fault) = claim.and_then(|c| self.fault(c)) {
            return Judgement::Wrong(fault);
        }
        let Some(truth) = truth else {
            return if claim.is_some() { Judgement::Silhouette } else { Judgement::Right };
        };
        if claimed == Some(truth.at) {
            return Judgement::Right;
        }
        let Some(place) = place else { return Judgement::Wrong(Wrong::LostTriangle) };
        let truly = Approach::new(ray, &self.before.scene.world_corners(truth.at));
        let slack = side.slack(place.instance, ray, &truly);
        let distance = truth.t * ray.direction.as_dvec3().length();
        match claim {
            Some(claim) if truly.explains(claim.distance, slack) => self.tie(claim, truth),
            Some(claim) if claim.distance < distance => Judgement::Silhouette,
            _ if truly.grazes(slack) || at_an_end(ray, &truly, slack) => Judgement::Silhouette,
            Some(_) => Judgement::Wrong(Wrong::TriangleBehind),
            None => Judgement::Wrong(Wrong::Nothing),
        }
    }

    /// Judges a hit of another triangle in the same place: either may be hit. If their materials differ, this holds
    /// only if the exact comparison confirms both.
    fn tie(&self, claim: &Claim, truth: &TrueHit) -> Judgement {
        if self.structure_is_clean || claim.material == material(self.before.scene, truth.at) {
            Judgement::Tie
        } else {
            Judgement::Wrong(Wrong::MaterialInPlace)
        }
    }

    /// Returns the relative distance error of a hit, if the ray really intersects the triangle it names.
    fn error(&self, claim: &Claim) -> Option<f64> {
        let (truly, slack) = claim.truly?;
        let distance = truly.distance.max(NEAR_RATIO * self.radius);
        (truly.through && truly.explains(claim.distance, slack))
            .then(|| (claim.distance - truly.distance).abs() / distance)
    }

    fn mismatch(&self, kind: RayKind, doubt: &Doubt, truth: Option<&TrueHit>, wrong: Wrong) -> Mismatch {
        let seen = |at| Target::Triangle(describe(self.before.scene, at));
        let shown = doubt.after.as_ref().and_then(|claim| claim.source).map(seen);
        Mismatch { kind, ray: doubt.ray, wrong, shown, truth: truth.map(|truth| seen(truth.at)) }
    }
}

impl Doubt {
    /// Whether both tracers agree, as far as that can be determined without knowing their accuracy.
    fn is_agreement(&self) -> bool {
        match (&self.before, &self.after) {
            (None, None) => true,
            (Some(b), Some(a)) => b.source == a.source && b.front == a.front && b.material == a.material,
            _ => false,
        }
    }
}

impl<'a> View<'a> {
    /// Creates a side for a scene whose triangles are off by at most this many world units.
    pub(super) fn new(scene: &'a Scene, identity: Option<&'a Identity<'a>>, position_error: f64) -> Self {
        View { scene, identity, magnitudes: magnitudes(scene), position_error }
    }

    /// Returns the triangle of the input that a triangle represents.
    fn source(&self, at: TriangleRef) -> Option<TriangleRef> {
        match self.identity {
            Some(identity) => identity.source(at),
            None => Some(at),
        }
    }

    /// Returns how far a ray may be off a triangle of an instance at the point of passing, in world units.
    pub(super) fn slack(&self, instance: u32, ray: &Ray, approach: &Approach) -> f64 {
        let way = ray.direction.as_dvec3().abs() * approach.distance.abs();
        let magnitude = self.magnitudes[instance as usize].at(ray.origin.as_dvec3().abs() + way);
        ROUNDINGS * (SINGLE * magnitude + SMALLEST) + self.position_error
    }
}

/// Whether a triangle is passed at an end of the ray, where rounding decides whether the hit counts.
pub(super) fn at_an_end(ray: &Ray, approach: &Approach, slack: f64) -> bool {
    let [near, far] = approach.window(slack);
    let length = ray.direction.as_dvec3().length();
    [ray.t_min, ray.t_max].into_iter().map(|t| f64::from(t) * length).any(|end| near <= end && end <= far)
}

pub(super) fn material(scene: &Scene, at: TriangleRef) -> Option<u32> {
    let mesh = scene.mesh_of(InstanceId(at.instance));
    mesh.geometries[mesh.locate(at.triangle).0].material
}

pub(super) fn magnitudes(scene: &Scene) -> Vec<Magnitude> {
    let reach: Vec<DVec3> = scene
        .meshes
        .par_iter()
        .map(|mesh| {
            let bounds = mesh.bounds();
            if bounds.is_empty() { DVec3::ZERO } else { bounds.min.abs().max(bounds.max.abs()) }
        })
        .collect();
    let magnitude =
        |i: &crate::scene::Instance| Magnitude::new(&i.transform, &i.transform.inverse(), reach[i.mesh.0 as usize]);
    scene.instances.iter().map(magnitude).collect()
}
