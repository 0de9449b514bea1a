//! Compares two files without known triangle identities by the surfaces that rays hit: place, side and material.
//!
//! The truth about the input is found in double precision: the closest triangle of each ray and, if the output shows
//! something else there, whether any triangle that the ray intersects matches the output. The output is right if its
//! hit lies on a triangle of the input whose material has the same name (or the same look, see [`Materials`]), with the
//! same side seen, and nothing of the input lies in front of it.

use std::cell::LazyCell;

use rayon::prelude::*;

use super::approach::Approach;
use super::compare::{EXAMPLES, FAR_RATIO, Judgement, NEAR_RATIO, Tally, View, at_an_end};
use super::cpu::{Reference, TrueHit};
use super::errors::HitError;
use super::materials::Materials;
use super::rays::{Ray, RayKind};
use super::sight::CannotTell;
use super::structure::allowed_error;
use super::{Hit, Mismatch, Note, Side, Sides, Target, VerifyOptions, Wrong};
use crate::scene::{Scene, TriangleRef};

/// Two scenes and the truth about the first.
pub(super) struct Surfaces<'a> {
    /// The input and the output.
    sides: Sides<View<'a>>,
    materials: Materials,
    reference: &'a Reference<'a>,
    radius: f64,
}

/// A hit reported by one side's tracer; lengths are in world units.
#[derive(Clone, Copy)]
struct Claim {
    /// The triangle hit, of the tracer's scene.
    at: TriangleRef,
    /// How the ray passes the hit triangle, in its own file.
    own: Approach,
    distance: f64,
    front: bool,
    /// The kind of material, see [`Materials`].
    material: u32,
    /// How far off line and corners may be.
    slack: f64,
    /// Whether the ray passes an edge of the hit triangle, in its own file, within the slack, or begins or ends there,
    /// so that rounding decides whether it is hit.
    doubtful: bool,
}

/// A triangle of the input on the path of a ray.
#[derive(Clone, Copy)]
struct Truth {
    /// Its instance.
    object: u32,
    approach: Approach,
    slack: f64,
    distance: f64,
    /// The kind of material, see [`Materials`].
    material: u32,
}

/// A claim that is not obviously right.
struct Doubt {
    ray: usize,
    side: Side,
    claim: Option<Claim>,
}

impl<'a> Surfaces<'a> {
    /// Prepares a comparison. Any corner of `after` may be off by the largest allowed position error.
    pub(super) fn new(
        scenes: Sides<&'a Scene>,
        reference: &'a Reference<'a>,
        radius: f64,
        options: &VerifyOptions,
    ) -> Self {
        let allowed = allowed_error(scenes.before, options.max_position_error_ratio);
        let of_after = vec![allowed; scenes.after.instances.len()];
        let sides = Sides { before: View::of_input(scenes.before), after: View::new(scenes.after, None, of_after) };
        Surfaces { sides, materials: Materials::of(scenes), reference, radius }
    }

    /// Returns a note on how materials are matched.
    pub(super) fn note(&self) -> Option<Note> {
        (!self.materials.are_named()).then_some(Note::ByLook)
    }

    /// Returns what rays could not tell.
    pub(super) fn cannot_tell(&self, tally: &Tally) -> CannotTell {
        CannotTell::new(&self.sides.before, tally)
    }

    /// Compares the results of both tracers.
    pub(super) fn compare(&self, kind: RayKind, rays: &[Ray], hits: Sides<&[Option<Hit>]>) -> Tally {
        let mut tally =
            Tally { rays: rays.len() as u64, hits: hits.before.iter().flatten().count() as u64, ..Tally::default() };
        let touched = hits.before.iter().flatten();
        tally.touched.extend(touched.map(|hit| TriangleRef { instance: hit.instance, triangle: hit.triangle }));
        let truths = self.reference.closest(rays);
        let claim = |i: usize, side: Side| hits[side][i].as_ref().map(|hit| self.claim(side, &rays[i], hit));
        let claims: Vec<Sides<Option<Claim>>> =
            (0..rays.len()).into_par_iter().map(|i| Side::BOTH.map(|side| claim(i, side)).into()).collect();
        let truths: Vec<Option<Truth>> =
            rays.par_iter().zip(&truths).map(|(ray, t)| t.as_ref().map(|t| self.truth(ray, t))).collect();
        let mut doubts = Vec::new();
        for (at, (claims, truth)) in claims.iter().zip(&truths).enumerate() {
            self.first_look((at, &rays[at]), claims, truth.as_ref(), &mut doubts, &mut tally);
        }
        self.settle(kind, rays, &claims, &truths, &doubts, &mut tally);
        tally
    }

    /// Records errors and far hits, and collects claims that are not obviously right.
    fn first_look(
        &self,
        (at, ray): (usize, &Ray),
        claims: &Sides<Option<Claim>>,
        truth: Option<&Truth>,
        doubts: &mut Vec<Doubt>,
        tally: &mut Tally,
    ) {
        for side in Side::BOTH {
            match (&claims[side], truth) {
                (None, None) => {}
                (Some(claim), Some(truth)) if self.shows_within_share(side, ray, claim, truth) => {
                    self.record(side, ray, claim, truth, tally);
                }
                (claim, _) => doubts.push(Doubt { ray: at, side, claim: *claim }),
            }
        }
        tally.far_hits += u64::from(match (&claims.before, &claims.after) {
            (None, None) => false,
            (Some(before), Some(after)) => (before.distance - after.distance).abs() > FAR_RATIO * self.radius,
            _ => true,
        });
    }

    /// Whether a claim refers to a triangle within a slack that the smaller of both objects excuses.
    fn shows_within_share(&self, side: Side, ray: &Ray, claim: &Claim, truth: &Truth) -> bool {
        let most = self.excusable(side, claim, truth);
        truth.within(most).shows(&claim.within(most, ray))
    }

    /// Returns the largest slack that may excuse anything about a claim and a triangle of the input, in world units.
    fn excusable(&self, side: Side, claim: &Claim, truth: &Truth) -> f64 {
        self.sides[side].excusable(claim.at.instance).min(self.sides.before.excusable(truth.object))
    }

    /// Records what a claim that shows a triangle of the input tells.
    fn record(&self, side: Side, ray: &Ray, claim: &Claim, truth: &Truth, tally: &mut Tally) {
        if side == Side::After && claim.slack + truth.slack <= self.excusable(side, claim, truth) {
            tally.told_objects.insert(truth.object);
        }
        if !truth.approach.through {
            return;
        }
        let distance = (claim.distance - truth.distance).abs();
        let relative = distance / truth.distance.max(NEAR_RATIO * self.radius);
        let object = (truth.object, self.sides.before.over_size(truth.object, distance));
        let errors = HitError { relative, distance, object };
        match side {
            Side::Before => tally.before.record(errors),
            Side::After => {
                tally.after.record(errors);
                let of = &self.sides.after;
                tally
                    .off_planes
                    .record(of.mesh(claim.at.instance), of.off_plane(ray, claim.at, claim.distance, &truth.approach));
            }
        }
    }

    /// Judges the doubts, ray by ray.
    fn settle(
        &self,
        kind: RayKind,
        rays: &[Ray],
        claims: &[Sides<Option<Claim>>],
        truths: &[Option<Truth>],
        doubts: &[Doubt],
        tally: &mut Tally,
    ) {
        let there = self.are_there(Within::Share, rays, doubts);
        let there_at_all = LazyCell::new(|| self.are_there(Within::All, rays, doubts));
        let mut at = 0;
        for of_ray in doubts.chunk_by(|a, b| a.ray == b.ray) {
            let ray = of_ray[0].ray;
            let mut judged = Sides { before: Judgement::Right, after: Judgement::Right };
            for doubt in of_ray {
                let judge = |within, there| self.judge(within, &rays[ray], doubt, truths[ray].as_ref(), there);
                judged[doubt.side] = match judge(Within::Share, there[at]) {
                    wrong @ Judgement::Wrong(_) => match judge(Within::All, there_at_all[at]) {
                        Judgement::Wrong(_) => wrong,
                        _ => Judgement::Unclear,
                    },
                    right => right,
                };
                if judged[doubt.side] == Judgement::Unclear {
                    tally.unclear_objects.extend(truths[ray].as_ref().map(|truth| truth.object));
                }
                at += 1;
            }
            tally.count(judged, agree(&claims[ray], FAR_RATIO * self.radius));
            if let Judgement::Wrong(wrong) = judged.after
                && tally.examples.len() < EXAMPLES
            {
                let seen = |material, distance| Target::Surface {
                    material: self.materials.name(material).to_owned(),
                    distance,
                };
                let shown = claims[ray].after.as_ref().map(|claim| seen(claim.material, claim.distance));
                let truth = truths[ray].as_ref().map(|truth| seen(truth.material, truth.distance));
                tally.examples.push(Mismatch { kind, ray, wrong, shown, truth });
            }
        }
    }

    /// Returns, for each doubt, whether the input has a surface at the claimed place, with the claimed material and
    /// side. As other surfaces may be equally close, all triangles that the ray intersects are considered.
    fn are_there(&self, within: Within, rays: &[Ray], doubts: &[Doubt]) -> Vec<bool> {
        let from: Vec<Ray> = doubts.iter().map(|doubt| rays[doubt.ray]).collect();
        self.reference.meet(&from, |i, hit| {
            let (truth, side) = (self.truth(&from[i], hit), doubts[i].side);
            doubts[i].claim.as_ref().is_some_and(|claim| match within {
                Within::Share => self.shows_within_share(side, &from[i], claim, &truth),
                Within::All => truth.shows(claim),
            })
        })
    }

    /// Judges one side's result for a ray.
    fn judge(&self, within: Within, ray: &Ray, doubt: &Doubt, truth: Option<&Truth>, is_there: bool) -> Judgement {
        let of_input = &self.sides.before;
        let most = match (within, &doubt.claim, truth) {
            (Within::All, ..) | (_, None, None) => f64::INFINITY,
            (_, Some(claim), Some(truth)) => self.excusable(doubt.side, claim, truth),
            (_, Some(claim), None) => self.sides[doubt.side].excusable(claim.at.instance),
            (_, None, Some(truth)) => of_input.excusable(truth.object),
        };
        let truth = truth.map(|truth| truth.within(most));
        match doubt.claim {
            Some(claim) => judge_hit(ray, &claim.within(most, ray), truth.as_ref(), is_there),
            None => judge_miss(ray, truth.as_ref(), self.sides[doubt.side].largest_position_error.min(most)),
        }
    }

    fn claim(&self, of: Side, ray: &Ray, hit: &Hit) -> Claim {
        let side = &self.sides[of];
        let at = TriangleRef { instance: hit.instance, triangle: hit.triangle };
        let own = Approach::new(ray, &side.scene.world_corners(at));
        let slack = side.slack(hit.instance, ray, &own);
        Claim {
            at,
            own,
            distance: f64::from(hit.t) * ray.direction.as_dvec3().length(),
            front: hit.front,
            material: self.materials.kind(of, side.scene, at),
            slack,
            doubtful: own.grazes(slack) || at_an_end(ray, &own, slack),
        }
    }

    fn truth(&self, ray: &Ray, hit: &TrueHit) -> Truth {
        let side = &self.sides.before;
        let approach = Approach::new(ray, &side.scene.world_corners(hit.at));
        Truth {
            object: hit.at.instance,
            slack: side.slack(hit.at.instance, ray, &approach),
            distance: hit.t * ray.direction.as_dvec3().length(),
            material: self.materials.kind(Side::Before, side.scene, hit.at),
            approach,
        }
    }
}

/// How large a slack may excuse a difference.
#[derive(Clone, Copy)]
enum Within {
    /// Up to a share of the smaller object.
    Share,
    /// Any.
    All,
}

impl Claim {
    /// Returns it with a slack of at most `most`.
    fn within(&self, most: f64, ray: &Ray) -> Claim {
        if self.slack <= most {
            return *self;
        }
        Claim { slack: most, doubtful: self.own.grazes(most) || at_an_end(ray, &self.own, most), ..*self }
    }
}

impl Truth {
    /// Returns it with a slack of at most `most`.
    fn within(&self, most: f64) -> Truth {
        Truth { slack: self.slack.min(most), ..*self }
    }

    /// Whether a claim refers to this triangle, or to one that looks the same in the same place.
    fn shows(&self, claim: &Claim) -> bool {
        let slack = self.slack + claim.slack;
        self.material == claim.material && self.is_at(claim) && {
            claim.front == self.approach.front || self.approach.grazes(slack) || claim.doubtful
        }
    }

    /// Whether rounding, or triangles off by `slack` more, decide that the ray hits this triangle.
    fn is_doubtful(&self, ray: &Ray, slack: f64) -> bool {
        let slack = self.slack + slack;
        self.approach.grazes(slack) || at_an_end(ray, &self.approach, slack)
    }

    /// Whether a claim is at the place of this triangle.
    fn is_at(&self, claim: &Claim) -> bool {
        self.approach.explains(claim.distance, self.slack + claim.slack)
    }
}

/// Judges a claim; `is_there` tells whether the input has such a surface at that place.
fn judge_hit(ray: &Ray, claim: &Claim, truth: Option<&Truth>, is_there: bool) -> Judgement {
    use Judgement::{Silhouette, Tie};
    if !is_there && !claim.doubtful {
        return Judgement::Wrong(match truth {
            Some(truth) if truth.is_at(claim) && truth.material == claim.material => Wrong::BackOfSurface,
            Some(truth) if truth.is_at(claim) => Wrong::Material,
            _ => Wrong::MovedSurface,
        });
    }
    match truth {
        None => Silhouette,
        Some(truth) if truth.is_at(claim) && is_there => Tie,
        Some(truth) if truth.is_at(claim) || claim.distance < truth.distance => Silhouette,
        Some(truth) if truth.is_doubtful(ray, claim.slack) => Silhouette,
        Some(_) => Judgement::Wrong(Wrong::SurfaceBehind),
    }
}

/// Judges a claimed miss in a file whose triangles may be off by `position_error`.
fn judge_miss(ray: &Ray, truth: Option<&Truth>, position_error: f64) -> Judgement {
    match truth {
        None => Judgement::Right,
        Some(truth) if truth.is_doubtful(ray, position_error) => Judgement::Silhouette,
        Some(_) => Judgement::Wrong(Wrong::Nothing),
    }
}

/// Whether both tracers agree, with distances apart by no more than `far`.
fn agree(claims: &Sides<Option<Claim>>, far: f64) -> bool {
    match (&claims.before, &claims.after) {
        (None, None) => true,
        (Some(b), Some(a)) => b.front == a.front && b.material == a.material && (b.distance - a.distance).abs() <= far,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DAffine3, DVec3};
    use proptest::prelude::*;

    use super::super::test_scenes::{Style, cases, cube, random_scene, room, scene};
    use super::super::tests::{baked, tilted};
    use super::super::{Matching, Verification, verify};
    use super::*;

    fn verified(before: &Scene, after: &Scene) -> Verification {
        let options = VerifyOptions {
            rays_per_kind: 2048,
            timed_rays_per_kind: Some(0),
            matching: Matching::Surface,
            ..VerifyOptions::default()
        };
        verify(before, after, &options)
    }

    /// Returns a room whose materials have names.
    fn named_room() -> Scene {
        let mut scene = room();
        for (material, name) in scene.materials.iter_mut().zip(["wall", "red", "blue", "none"]) {
            material.name = Some(name.into());
        }
        scene
    }

    #[test]
    fn what_shows_the_same_passes_whatever_it_is_made_of() {
        let before = named_room();
        for after in [named_room(), baked(&before, DAffine3::IDENTITY), baked(&before, tilted())] {
            let found = verified(&before, &after);
            assert!(found.passed(), "{found}");
            assert_eq!((found.mismatches, found.tracer_faults, found.structure), (0, 0, None));
            assert!(found.hits > 4096 && found.position_error_ratio.is_nan());
        }
    }

    #[test]
    fn materials_go_by_their_name() {
        let before = named_room();
        let mut after = named_room();
        after.materials.swap(1, 2);
        let found = verified(&before, &after);
        assert!(found.mismatches > 100 && found.failures[0].to_string().contains("another material"), "{found}");
        let (geometries, swapped) = (&mut after.meshes[1].geometries, [Some(2), Some(1)]);
        geometries.iter_mut().zip(swapped).for_each(|(g, m)| g.material = m);
        assert!(verified(&before, &after).passed());
    }

    #[test]
    fn materials_go_by_their_look_where_names_are_lost() {
        let mut before = named_room();
        before.materials.iter_mut().zip([0.1, 0.2, 0.3]).for_each(|(m, red)| m.look.base_color[0] = red);
        let mut after = before.clone();
        after.materials.iter_mut().for_each(|m| m.name = None);
        let found = verified(&before, &after);
        assert!(found.passed() && found.notes.contains(&Note::ByLook), "{found}");
        after.materials.swap(1, 2);
        let found = verified(&before, &after);
        assert!(found.mismatches > 100 && found.failures[0].to_string().contains("of base color"), "{found}");
    }

    #[test]
    fn planted_faults_are_seen() {
        type Fault = fn(&mut Scene);
        let faults: [(&str, Fault); 5] = [
            ("moved", |s| Arc::make_mut(&mut s.meshes[1].geometries[0].positions)[4].x += 0.05),
            ("lost", |s| s.meshes[0].geometries[0].triangles[3] = [0; 3]),
            ("flipped", |s| s.meshes[0].geometries[0].triangles[5].swap(0, 1)),
            ("shrunk", |s| s.instances[3].transform *= DAffine3::from_scale(DVec3::splat(0.9))),
            ("gone", |s| s.instances.truncate(5)),
        ];
        for (name, fault) in faults {
            let mut after = named_room();
            fault(&mut after);
            let found = verified(&named_room(), &after);
            assert!(!found.passed() && found.mismatches > 0, "{name}: {found:?}");
        }
    }

    #[test]
    fn of_surfaces_in_one_place_either_may_be_shown() {
        let two =
            |first, second| scene(vec![cube(0, Some(first)), cube(1, Some(second))], &[(0, tilted()), (1, tilted())]);
        let named = |mut scene: Scene| {
            scene.materials.iter_mut().zip(["a", "b", "c"]).for_each(|(m, name)| m.name = Some(name.into()));
            scene
        };
        let found = verified(&named(two(0, 1)), &named(two(1, 0)));
        assert!(found.passed() && found.ties > 100, "{found:?}");
        assert!(!verified(&named(two(0, 1)), &named(two(2, 2))).passed());
    }

    #[test]
    fn nothing_is_nothing() {
        assert!(verified(&Scene::default(), &Scene::default()).passed());
        assert!(!verified(&room(), &Scene::default()).passed());
    }

    #[test]
    fn a_surface_counts_as_there_though_another_lies_as_close() {
        let style = Style { size: 1.0, offset: 0.0, on_grid: true, thin: true, wild: true };
        let scene = random_scene(4965530506959467450, style);
        let found = verified(&scene, &scene);
        assert_eq!((found.mismatches, found.tracer_faults), (0, 0), "{found}");
    }

    proptest! {
        #![proptest_config(cases(16))]

        #[test]
        fn rounding_is_never_a_mismatch(seed: u64, [on_grid, thin, wild] in any::<[bool; 3]>()) {
            let before = random_scene(seed, Style { size: 1.0, offset: 0.0, on_grid, thin, wild });
            for after in [before.clone(), baked(&before, DAffine3::IDENTITY)] {
                let found = verified(&before, &after);
                prop_assert_eq!(found.mismatches, 0, "{}", found);
            }
        }
    }
}
