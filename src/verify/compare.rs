//! Compares the hits of both scenes ray by ray, and resolves differences by the true hit.

use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::approach::Approach;
use super::cpu::{Reference, TrueHit};
use super::errors::{Errors, HitError, OffPlane, OffPlanes};
use super::identity::describe;
use super::materials::Materials;
use super::random::Random;
use super::rays::{Ray, RayKind};
use super::rounding::{self, Magnitude};
use super::sight::CannotTell;
use super::structure::{Structure, allowed_error};
use super::surface::pairs::Pairs;
use super::{Hit, Mismatch, Side, Sides, Target, VerifyOptions, Wrong};
use crate::parallel;
use crate::scene::{InstanceId, Scene, TriangleRef};

/// Distance between two hits, as a share of the scene's radius, above which they count as far apart.
pub(crate) const FAR_RATIO: f64 = 1e-4;
/// Lower limit of the distance that errors are relative to, as a share of the scene's radius.
pub(crate) const NEAR_RATIO: f64 = 1e-3;
/// Largest share of an object's size that may excuse a difference at it as rounding.
pub(super) const EXCUSABLE: f64 = 0.1;
/// Number of mismatches described in words.
pub(super) const EXAMPLES: usize = 4;
/// Random number stream for samples, separate from those of the rays.
const SAMPLE_STREAM: u64 = 100;

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
    /// Number of rays that only a slack larger than [`EXCUSABLE`] of an object explains.
    pub unclear: u64,
    /// Instances of the input at which such rays were found.
    pub(super) unclear_objects: BTreeSet<u32>,
    /// Instances of the input that a hit of the output shows, within [`EXCUSABLE`] of their size.
    pub(super) told_objects: BTreeSet<u32>,
    /// Triangles of the input that were hit; only if nothing but rays is compared.
    pub(super) touched: BTreeSet<TriangleRef>,
    /// Errors in the input.
    pub before: Errors,
    /// Errors in the output.
    pub after: Errors,
    /// How far hits of the output lie off the planes of their triangles.
    pub(super) off_planes: OffPlanes,
    /// The first mismatches.
    pub examples: Vec<Mismatch>,
}

impl Tally {
    /// Counts the judged hits of a ray in the input and the output; `agreed` tells whether both are the same.
    pub(super) fn count(&mut self, judged: Sides<Judgement>, agreed: bool) {
        use Judgement::{Right, Silhouette, Tie, Unclear, Wrong};
        match (judged.before, judged.after) {
            (Wrong(_), Wrong(_)) if agreed => self.tracer_faults += 1,
            (_, Wrong(_)) => self.mismatches += 1,
            (Wrong(_), _) => self.tracer_faults += 1,
            (Unclear, _) | (_, Unclear) => self.unclear += 1,
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
        self.unclear += other.unclear;
        self.unclear_objects.extend(other.unclear_objects);
        self.told_objects.extend(other.told_objects);
        self.touched.extend(other.touched);
        self.off_planes.add(other.off_planes);
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
    pairs: Option<&'a Pairs>,
    magnitudes: Vec<Magnitude>,
    /// Largest position error of the triangles of each instance, in world units; at most the allowed error.
    position_errors: Vec<f64>,
    /// The largest of them.
    pub(super) largest_position_error: f64,
}

/// Two scenes and the truth about the first.
pub struct Comparison<'a> {
    before: View<'a>,
    after: View<'a>,
    pairs: &'a Pairs,
    materials: Materials,
    reference: &'a Reference<'a>,
    structure_is_clean: bool,
    radius: f64,
    seed: u64,
    sample_ratio: f64,
}

/// A hit reported by a tracer, compared with the triangle it names.
struct Claim {
    /// The triangle hit, of the tracer's scene.
    at: TriangleRef,
    source: Option<TriangleRef>,
    /// The kind of its material.
    material: u32,
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
    /// Right only by a slack larger than [`EXCUSABLE`] of an object.
    Unclear,
    Wrong(Wrong),
}

/// What a first look at a ray finds.
struct FirstLook {
    errors: Sides<Option<HitError>>,
    /// Of the output's hit, with its mesh.
    off_plane: Option<(u32, OffPlane)>,
    /// The instance of the input that the output's hit shows.
    told: Option<u32>,
    /// The ray, if it must be judged by the truth.
    doubt: Option<Doubt>,
}

/// A ray that must be judged by the truth.
struct Doubt {
    ray: usize,
    before: Option<Claim>,
    after: Option<Claim>,
}

impl<'a> Comparison<'a> {
    /// Prepares a comparison; `structure` and `pairs` are the results of [`super::surface::compare`], `radius` is the
    /// scene's radius.
    pub fn new(
        scenes: Sides<&'a Scene>,
        pairs: &'a Pairs,
        reference: &'a Reference<'a>,
        structure: &Structure,
        radius: f64,
        options: &VerifyOptions,
    ) -> Self {
        let Sides { before, after } = scenes;
        let allowed = allowed_error(before, options.max_position_error_ratio);
        let position_errors = structure.of_instances.iter().map(|error| error.min(allowed)).collect();
        Comparison {
            before: View::of_input(before),
            after: View::new(after, Some(pairs), position_errors),
            pairs,
            materials: Materials::in_place(scenes),
            reference,
            structure_is_clean: structure.is_clean(),
            radius,
            seed: options.seed,
            sample_ratio: options.sample_ratio,
        }
    }

    /// Returns the largest distance of a corner of the output from its place, at most the allowed one, in world units.
    pub(super) fn displacement(&self) -> f64 {
        self.after.largest_position_error
    }

    /// Returns what rays could not tell.
    pub(super) fn cannot_tell(&self, tally: &Tally) -> CannotTell {
        CannotTell::new(&self.before, tally)
    }

    /// Compares the results of both tracers. If they agree and the result is true of the triangle they name, it is
    /// accepted; everything else, and a sample of the accepted rays, is judged by the true closest hit.
    pub fn compare(&self, kind: RayKind, rays: &[Ray], hits: Sides<&[Option<Hit>]>) -> Tally {
        let Sides { before, after } = hits;
        let mut tally =
            Tally { rays: rays.len() as u64, hits: before.iter().flatten().count() as u64, ..Tally::default() };
        let first: Vec<FirstLook> = (0..rays.len())
            .into_par_iter()
            .map(|i| self.first_look(kind, i, &rays[i], before[i].as_ref(), after[i].as_ref()))
            .collect();
        let mut doubts = Vec::new();
        for look in first {
            look.errors.before.into_iter().for_each(|error| tally.before.record(error));
            look.errors.after.into_iter().for_each(|error| tally.after.record(error));
            look.off_plane.into_iter().for_each(|(mesh, off)| tally.off_planes.record(mesh, off));
            tally.told_objects.extend(look.told);
            doubts.extend(look.doubt);
        }
        self.settle(kind, rays, &doubts, &mut tally);
        tally
    }

    /// Measures both hits, and looks whether the ray must be judged by the truth.
    fn first_look(
        &self,
        kind: RayKind,
        index: usize,
        ray: &Ray,
        before: Option<&Hit>,
        after: Option<&Hit>,
    ) -> FirstLook {
        let doubt = Doubt {
            ray: index,
            before: before.map(|hit| self.claim(&self.before, ray, hit)),
            after: after.map(|hit| self.claim(&self.after, ray, hit)),
        };
        let claims = Sides { before: &doubt.before, after: &doubt.after };
        let errors = claims.map(|claim| claim.as_ref().and_then(|claim| self.error(claim)));
        let after = doubt.after.as_ref();
        let off_plane = after.filter(|_| errors.after.is_some()).and_then(|claim| {
            let off = self.after.off_plane(ray, claim.at, claim.distance, &claim.truly?.0);
            Some((self.after.mesh(claim.at.instance), off))
        });
        let told = after.and_then(|claim| self.told(claim));
        let stream = SAMPLE_STREAM + kind as u64;
        let is_sampled = || Random::at(self.seed, stream, index).unit() < self.sample_ratio;
        let settled = doubt.is_agreement()
            && [&doubt.before, &doubt.after]
                .into_iter()
                .flatten()
                .all(|c| self.fault(c, self.excusable(c, None)).is_none());
        FirstLook { errors, off_plane, told, doubt: (!settled || is_sampled()).then_some(doubt) }
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
        let mut places = self.pairs.find(&missed.iter().flatten().copied().collect::<Vec<_>>()).into_iter();
        for ((doubt, truth), missed) in doubts.iter().zip(&truths).zip(missed) {
            let ray = &rays[doubt.ray];
            let place = missed.and_then(|_| places.next().flatten());
            let after = self.judge(&self.after, ray, doubt.after.as_ref(), truth.as_ref(), place);
            let before = self.judge(&self.before, ray, doubt.before.as_ref(), truth.as_ref(), truth.map(|t| t.at));
            if [before, after].contains(&Judgement::Unclear) {
                tally.unclear_objects.extend(self.smallest_object(doubt, truth.as_ref()));
            }
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
        Claim { at, source, material: self.kind(side, at), front: hit.front, distance, truly }
    }

    /// Returns the kind of material of a triangle.
    fn kind(&self, of: &View, at: TriangleRef) -> u32 {
        let side = if of.pairs.is_some() { Side::After } else { Side::Before };
        self.materials.kind(side, of.scene, at)
    }

    /// Returns the largest slack that may excuse anything about a claim and the true hit, in world units: a share of the
    /// smaller object.
    fn excusable(&self, claim: &Claim, truth: Option<&TrueHit>) -> f64 {
        let objects = claim.source.into_iter().chain(truth.map(|truth| truth.at));
        objects.map(|at| self.before.excusable(at.instance)).fold(f64::INFINITY, f64::min)
    }

    /// Returns the smaller of the objects that the claims and the true hit of a ray are about.
    fn smallest_object(&self, doubt: &Doubt, truth: Option<&TrueHit>) -> Option<u32> {
        let claims = [&doubt.before, &doubt.after].into_iter().flatten();
        let objects = claims.filter_map(|claim| claim.source).chain(truth.map(|truth| truth.at)).map(|at| at.instance);
        objects.min_by(|&a, &b| self.before.excusable(a).total_cmp(&self.before.excusable(b)).then(a.cmp(&b)))
    }

    /// Returns the object that a claim shows, if single precision can tell it from what is beside it.
    fn told(&self, claim: &Claim) -> Option<u32> {
        let (source, (_, slack)) = (claim.source?, claim.truly?);
        let excusable = self.before.excusable(source.instance);
        (slack <= excusable && self.fault(claim, excusable).is_none()).then_some(source.instance)
    }

    /// Returns what is wrong with a claim, without knowing the truth. No slack larger than `most` excuses anything.
    fn fault(&self, claim: &Claim, most: f64) -> Option<Wrong> {
        let (Some(source), Some((truly, slack))) = (claim.source, claim.truly) else {
            return Some(Wrong::UnknownTriangle);
        };
        let slack = slack.min(most);
        if claim.material != self.kind(&self.before, source) {
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
        let of_truth = || truth.map_or(f64::INFINITY, |truth| self.before.excusable(truth.at.instance));
        let most = claim.map_or_else(of_truth, |claim| self.excusable(claim, truth));
        match self.judge_within(most, side, ray, claim, truth, place) {
            wrong @ Judgement::Wrong(_) => match self.judge_within(f64::INFINITY, side, ray, claim, truth, place) {
                Judgement::Wrong(_) => wrong,
                _ => Judgement::Unclear,
            },
            judged => judged,
        }
    }

    /// Like [`Comparison::judge`]; no slack larger than `most` excuses anything.
    fn judge_within(
        &self,
        most: f64,
        side: &View,
        ray: &Ray,
        claim: Option<&Claim>,
        truth: Option<&TrueHit>,
        place: Option<TriangleRef>,
    ) -> Judgement {
        let claimed = claim.and_then(|c| c.source);
        if let Some(fault) = claim.and_then(|c| self.fault(c, most)) {
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
        let slack = side.slack(place.instance, ray, &truly).min(most);
        let distance = truth.t * ray.direction.as_dvec3().length();
        match (judge_distance(ray, claim.map(|claim| claim.distance), distance, &truly, slack), claim) {
            (Judgement::Tie, Some(claim)) => self.tie(claim, truth),
            (judged, _) => judged,
        }
    }

    /// Judges a hit of another triangle in the same place: either may be hit. If their materials differ, this holds
    /// only if the exact comparison confirms both.
    fn tie(&self, claim: &Claim, truth: &TrueHit) -> Judgement {
        if self.structure_is_clean || claim.material == self.kind(&self.before, truth.at) {
            Judgement::Tie
        } else {
            Judgement::Wrong(Wrong::MaterialInPlace)
        }
    }

    /// Returns the distance error of a hit, if the ray really intersects the triangle it names.
    fn error(&self, claim: &Claim) -> Option<HitError> {
        let ((truly, slack), object) = (claim.truly?, claim.source?.instance);
        let near = truly.distance.max(NEAR_RATIO * self.radius);
        let distance = (claim.distance - truly.distance).abs();
        let hit =
            HitError { relative: distance / near, distance, object: (object, self.before.over_size(object, distance)) };
        (truly.through && truly.explains(claim.distance, slack)).then_some(hit)
    }

    fn mismatch(&self, kind: RayKind, doubt: &Doubt, truth: Option<&TrueHit>, wrong: Wrong) -> Mismatch {
        let seen = |at| Target::Triangle(describe(self.before.scene, at));
        let shown = doubt.after.as_ref().and_then(|claim| claim.source).map(seen);
        Mismatch { kind, ray: doubt.ray, wrong, shown, truth: truth.map(|truth| seen(truth.at)) }
    }
}

/// Judges a hit of another triangle than the true one, or of nothing, by its distance. `truly` is how the ray passes the
/// true triangle, at the distance `truth`; no more than `slack` is excused. Distances are in world units.
pub(super) fn judge_distance(ray: &Ray, claimed: Option<f64>, truth: f64, truly: &Approach, slack: f64) -> Judgement {
    match claimed {
        Some(distance) if truly.explains(distance, slack) => Judgement::Tie,
        Some(distance) if distance < truth => Judgement::Silhouette,
        _ if truly.grazes(slack) || at_an_end(ray, truly, slack) => Judgement::Silhouette,
        Some(_) => Judgement::Wrong(Wrong::TriangleBehind),
        None => Judgement::Wrong(Wrong::Nothing),
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
    /// Creates a side for a scene, given how far the triangles of each instance are off, in world units.
    pub(super) fn new(scene: &'a Scene, pairs: Option<&'a Pairs>, position_errors: Vec<f64>) -> Self {
        let largest_position_error = position_errors.iter().copied().fold(0.0, f64::max);
        View { scene, pairs, magnitudes: magnitudes(scene), position_errors, largest_position_error }
    }

    /// Creates the side of the input.
    pub(super) fn of_input(scene: &'a Scene) -> Self {
        let errors = (0..scene.instances.len() as u32).map(|i| scene.unavoidable_error(InstanceId(i)));
        View::new(scene, None, errors.collect())
    }

    /// Returns the largest slack that may excuse anything at an instance, in world units.
    pub(super) fn excusable(&self, instance: u32) -> f64 {
        EXCUSABLE * self.scene.instance_boxes()[instance as usize].diagonal()
    }

    /// Returns a distance over the size of an instance.
    pub(super) fn over_size(&self, instance: u32, distance: f64) -> f64 {
        let ratio = distance / self.scene.instance_boxes()[instance as usize].diagonal();
        if ratio.is_nan() { 0.0 } else { ratio.min(f64::MAX) }
    }

    /// Returns the mesh of an instance.
    pub(super) fn mesh(&self, instance: u32) -> u32 {
        self.scene.instances[instance as usize].mesh.0
    }

    /// Returns how far a hit of an instance at a distance lies off the plane of the triangle that the ray truly passes
    /// so, with its bound.
    pub(super) fn off_plane(&self, ray: &Ray, at: TriangleRef, distance: f64, truly: &Approach) -> OffPlane {
        let of = &self.scene.instances[at.instance as usize];
        let mesh = &self.scene.meshes[of.mesh.0 as usize];
        let triangle = mesh.corners(at.triangle).map(|p| p.as_dvec3());
        let ahead = ray.direction.as_dvec3().normalize();
        let way = [ray.origin.as_dvec3(), distance * ahead];
        let bound = rounding::displacement(&of.transform, mesh.reach(), triangle, truly.normal, way);
        let off = (distance - truly.distance).abs() * truly.normal.dot(ahead).abs();
        OffPlane::of_hit(off, bound + self.position_errors[at.instance as usize])
    }

    /// Returns the instances that no ray can tell from what is beside them, unless it starts near them: those for which
    /// a ray as long as the scene may be off by more than a share of their size.
    pub(super) fn out_of_sight(&self) -> impl Iterator<Item = u32> + '_ {
        self.farthest_off().filter(|&(i, slack)| slack > self.excusable(i)).map(|(i, _)| i)
    }

    /// Returns how far a ray as long as the scene may be off at each instance that is larger than a point, in world
    /// units.
    pub(super) fn farthest_off(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        let bounds = self.scene.bounds();
        let reach =
            if bounds.is_empty() { DVec3::ZERO } else { bounds.min.abs().max(bounds.max.abs()) + bounds.size() };
        let is_seen = |i: &u32| self.scene.mesh_of(InstanceId(*i)).triangle_count() > 0 && self.excusable(*i) > 0.0;
        let instances = (0..self.scene.instances.len() as u32).filter(is_seen);
        instances.map(move |i| (i, self.magnitudes[i as usize].slack(reach)))
    }

    /// Returns the triangle of the input that a triangle represents.
    fn source(&self, at: TriangleRef) -> Option<TriangleRef> {
        match self.pairs {
            Some(pairs) => Some(pairs.get(at)?.at),
            None => Some(at),
        }
    }

    /// Returns how far a ray may be off a triangle of an instance at the point of passing, in world units.
    pub(super) fn slack(&self, instance: u32, ray: &Ray, approach: &Approach) -> f64 {
        let way = ray.direction.as_dvec3().abs() * approach.distance.abs();
        self.magnitudes[instance as usize].slack(ray.origin.as_dvec3().abs() + way)
            + self.position_errors[instance as usize]
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
    let reach: Vec<DVec3> = parallel::map(scene.meshes.len(), &|m| scene.meshes[m].reach());
    let magnitude =
        |i: &crate::scene::Instance| Magnitude::new(&i.transform, &i.transform.inverse(), reach[i.mesh.0 as usize]);
    scene.instances.iter().map(magnitude).collect()
}
