//! Segments of the rays that layouts are ranked by, for methods that cut by what rays traverse.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::plans::Plan;
use crate::cost::segments::Segment;
use crate::verify::cpu::{Reference, TwoLevel};
use crate::verify::rays::{Ray, RayKind, Rays};
use crate::verify::weights::Weights;

/// Length, in scene radii, that rays without a hit are cut to.
const FAR: f64 = 4.0;

/// Returns the plans, with segments for those cut by rays. Each ray kind contributes rays in proportion to its weight,
/// the kind of the largest weight all of them. `trees` and `rays` are relative to `vantage`.
pub(super) fn given(plans: &[Plan], trees: &TwoLevel, rays: &Rays, weights: &Weights, vantage: DVec3) -> Vec<Plan> {
    let mut plans = plans.to_vec();
    if plans.iter().any(Plan::is_by_rays) {
        let to_world = DAffine3::from_translation(vantage);
        let segments = segments(trees, rays, weights).iter().map(|segment| segment.under(&to_world)).collect();
        let segments: Arc<[Segment]> = segments;
        plans
            .iter_mut()
            .filter(|plan| plan.is_by_rays())
            .for_each(|p| p.options.cluster.search.segments = Some(segments.clone()));
    }
    plans
}

fn segments(trees: &TwoLevel, rays: &Rays, weights: &Weights) -> Vec<Segment> {
    let reference = Reference::new(trees);
    let most = weights.largest();
    let of_kind = |(kind, rays_of_kind): (RayKind, &Vec<Ray>)| {
        let weight = weights.0[kind];
        let count = (rays_of_kind.len() as f64 * weight / most).round() as usize;
        let some: Vec<Ray> = evenly(rays_of_kind, count).copied().collect();
        let ends = reference.closest(&some);
        let end = |ray: &Ray| f64::from(ray.t_max).min(FAR * rays.radius / ray.direction.as_dvec3().length());
        let segment = |(ray, hit): (&Ray, Option<_>)| segment(ray, hit.unwrap_or(end(ray)));
        some.iter().zip(ends.into_iter().map(|hit| hit.map(|hit| hit.t))).map(segment).collect::<Vec<_>>()
    };
    rays.kinds.iter().filter(|(kind, _)| weights.0[*kind] > 0.0).flat_map(of_kind).collect()
}

fn segment(ray: &Ray, length: f64) -> Segment {
    Segment::new(ray.origin.as_dvec3(), ray.direction.as_dvec3(), length)
}

/// Selects up to `count` items, evenly spread.
fn evenly<T>(all: &[T], count: usize) -> impl Iterator<Item = &T> {
    (0..count.min(all.len())).map(move |i| &all[i * all.len() / count.min(all.len())])
}

#[cfg(test)]
mod tests {
    use super::super::plans::{Effort, plans};
    use super::*;
    use crate::methods::Options;
    use crate::verify::rays::{self, Sampling};

    #[test]
    fn things_are_taken_evenly() {
        let of = |count| evenly(&[0, 1, 2, 3, 4, 5], count).copied().collect::<Vec<_>>();
        assert_eq!([of(0), of(2), of(4), of(9)], [vec![], vec![0, 3], vec![0, 1, 3, 4], vec![0, 1, 2, 3, 4, 5]]);
    }

    #[test]
    fn plans_by_rays_get_as_many_as_count() {
        let scene = crate::verify::test_scenes::room();
        let trees = TwoLevel::build(&scene);
        let rays = rays::generate(&scene, &Reference::new(&trees), &Sampling::new(64, 1));
        let of = |weights: [f64; 4]| {
            let given = given(
                &plans(Effort::new(6), &Options::default()),
                &trees,
                &rays,
                &Weights(weights.into()),
                DVec3::ZERO,
            );
            let lengths =
                given.iter().filter_map(|plan| plan.options.cluster.search.segments.as_ref()).map(|s| s.len());
            let lengths: Vec<usize> = lengths.collect();
            assert!(lengths.iter().all(|&len| len == lengths[0]) && lengths.len() > 2);
            lengths[0]
        };
        let all: Vec<usize> = rays.kinds.values().map(Vec::len).collect();
        assert_eq!(of([1.0, 1.0, 1.0, 0.0]), all[..3].iter().sum::<usize>());
        assert_eq!(of([0.0, 0.0, 0.0, 0.5]), all[3]);
        assert_eq!(of([1.0, 0.0, 0.0, 0.25]), all[0] + all[3] / 4);
    }
}
