//! Whether a tracer's hits are the true ones, except for what rounding explains.

use rayon::prelude::*;
use serde::Serialize;

use super::Hit;
use super::approach::Approach;
use super::compare::{Judgement, View, judge_distance};
use super::cpu::TrueHit;
use super::note::Wrong;
use super::rays::Ray;
use crate::scene::{Scene, TriangleRef};

/// How a tracer's hits compare with the true ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CheckedHits {
    /// Number of rays.
    pub rays: u64,
    /// Number of rays that truly hit something.
    pub hits: u64,
    /// Number of rays that hit the same triangle, or nothing, in both.
    pub same: u64,
    /// Number of rays that hit another triangle at the same distance.
    pub ties: u64,
    /// Number of rays that pass so close to an edge that rounding decides what they hit.
    pub silhouettes: u64,
    /// Number of rays whose hit rounding does not explain.
    pub wrong: u64,
}

impl CheckedHits {
    /// Adds the results of other rays.
    pub fn add(&mut self, other: &CheckedHits) {
        self.rays += other.rays;
        self.hits += other.hits;
        self.same += other.same;
        self.ties += other.ties;
        self.silhouettes += other.silhouettes;
        self.wrong += other.wrong;
    }
}

/// Checks the hits of rays in a scene; `truths` are the true ones.
pub(crate) fn check(scene: &Scene, truths: &[Option<TrueHit>], rays: &[Ray], hits: &[Option<Hit>]) -> CheckedHits {
    assert!(rays.len() == hits.len() && rays.len() == truths.len(), "there is a result for each ray");
    let view = View::of_input(scene);
    let judged = |i: usize| judge(&view, &rays[i], hits[i].as_ref(), truths[i].as_ref());
    let judged: Vec<Judgement> = (0..rays.len()).into_par_iter().map(judged).collect();
    let count = |is: fn(&Judgement) -> bool| judged.iter().filter(|j| is(j)).count() as u64;
    CheckedHits {
        rays: rays.len() as u64,
        hits: truths.iter().flatten().count() as u64,
        same: count(|j| matches!(j, Judgement::Right)),
        ties: count(|j| matches!(j, Judgement::Tie)),
        silhouettes: count(|j| matches!(j, Judgement::Silhouette)),
        wrong: count(|j| matches!(j, Judgement::Wrong(_) | Judgement::Unclear)),
    }
}

/// Judges a hit by the true one.
fn judge(view: &View, ray: &Ray, hit: Option<&Hit>, truth: Option<&TrueHit>) -> Judgement {
    let length = ray.direction.as_dvec3().length();
    let passed = |at: TriangleRef| {
        let approach = Approach::new(ray, &view.scene.world_corners(at));
        let slack = view.slack(at.instance, ray, &approach).min(view.excusable(at.instance));
        (approach, slack)
    };
    let claim = hit.map(|hit| (hit.at(), f64::from(hit.t) * length));
    if let Some((at, distance)) = claim {
        let (approach, slack) = passed(at);
        if !approach.explains(distance, slack) {
            return Judgement::Wrong(Wrong::MovedTriangle);
        }
    }
    let Some(truth) = truth else {
        return if claim.is_some() { Judgement::Silhouette } else { Judgement::Right };
    };
    if claim.is_some_and(|(at, _)| at == truth.at) {
        return Judgement::Right;
    }
    let (approach, slack) = passed(truth.at);
    judge_distance(ray, claim.map(|(_, distance)| distance), truth.t * length, &approach, slack)
}

impl Hit {
    /// Returns the triangle that is hit.
    fn at(&self) -> TriangleRef {
        TriangleRef { instance: self.instance, triangle: self.triangle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::cpu::{CpuTracer, Reference, TwoLevel};
    use crate::verify::test_scenes::{Style, random_rays, room};

    fn rays() -> Vec<Ray> {
        random_rays(5, Style { size: 0.3, offset: 0.0, on_grid: false, thin: false, wild: false }, 2000)
    }

    #[test]
    fn the_hits_of_a_scene_are_right_and_those_of_another_are_not() {
        let (scene, rays) = (room(), rays());
        let trees = TwoLevel::build(&scene);
        let truths = Reference::new(&trees).closest(&rays);
        let hits = CpuTracer::new(&trees).closest(&rays);
        let right = check(&scene, &truths, &rays, &hits);
        assert_eq!((right.rays, right.wrong), (2000, 0));
        assert!(right.hits > 1000 && right.same + right.ties + right.silhouettes == 2000 && right.same > 1990);

        let mut moved = room();
        moved.instances[4].transform.translation.x += 0.01;
        let elsewhere = CpuTracer::new(&TwoLevel::build(&moved)).closest(&rays);
        assert!(check(&scene, &truths, &rays, &elsewhere).wrong > 0);
        let lost = vec![None; rays.len()];
        assert_eq!(check(&scene, &truths, &rays, &lost).wrong, right.hits);
    }
}
