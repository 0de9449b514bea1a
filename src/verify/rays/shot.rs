//! The rays of a picture: what a renderer traces that has one camera, one area light and one diffuse bounce.

use glam::DVec3;

use super::{Maker, Ray, RayKind, TrueHit, generated, stage, stream};
use crate::scene::Scene;
use crate::verify::PerKind;
use crate::verify::view::View;

/// A horizontal, square area light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// The corner with the least coordinates, in world units.
    pub corner: DVec3,
    /// Length of its sides along x and z, in world units; at least 0.
    pub size: f64,
}

impl Light {
    /// Returns a point of it for two numbers in [0, 1].
    pub(crate) fn at(&self, [x, z]: [f64; 2]) -> DVec3 {
        self.corner + self.size * DVec3::new(x, 0.0, z)
    }
}

/// What a picture shows, and how it is sampled.
#[derive(Clone, Debug)]
pub(crate) struct Shot {
    /// The camera, or its places while it moves: each gets as many rows of the picture, and sees the whole of its view.
    pub(crate) views: Vec<View>,
    /// The light; `None` for that of [`Stage::light`](crate::verify::view::Stage::light).
    pub(crate) light: Option<Light>,
    /// Width and height in pixels; above 0.
    pub(crate) size: [u32; 2],
    /// Primary rays per pixel.
    pub(crate) samples: u32,
    /// Shadow rays per surface point that a primary ray hits.
    pub(crate) light_samples: u32,
    /// Whether a diffuse ray leaves each such point.
    pub(crate) bounces: bool,
    /// Seed of the samples.
    pub(crate) seed: u64,
}

/// Returns the rays of a picture; kinds that it does not need are empty. `closest` returns the first hits of rays.
///
/// # Errors
/// Returns the errors of `closest`.
pub(crate) fn of_shot<E>(
    scene: &Scene,
    closest: impl Fn(&[Ray]) -> Result<Vec<Option<TrueHit>>, E>,
    shot: &Shot,
) -> Result<PerKind<Vec<Ray>>, E> {
    let bounds = scene.bounds();
    if bounds.is_empty() || scene.triangles_placed() == 0 {
        return Ok(PerKind::default());
    }
    let maker = Maker { scene, stage: stage(bounds, &closest, shot.seed)?, seed: shot.seed };
    let primary = shot.primary(&maker);
    let seen = maker.seen(&primary, &closest(&primary)?);
    let lights = shot.light_samples as usize;
    let shadow = generated(0..seen.len() * lights, &|i| {
        let mut random = maker.random_at(stream::SHADOW, i);
        let place = [random.unit(), random.unit()];
        let light = shot.light.map_or_else(|| maker.stage.light(place), |light| light.at(place));
        maker.toward(light, &seen[i / lights])
    });
    let bounces = if shot.bounces { seen.len() } else { 0 };
    let diffuse = generated(0..bounces, &|i| maker.diffuse(i, &seen));
    let mut kinds: PerKind<Vec<Ray>> = PerKind::default();
    (kinds[RayKind::Primary], kinds[RayKind::Shadow], kinds[RayKind::Diffuse]) = (primary, shadow, diffuse);
    Ok(kinds)
}

impl Shot {
    /// Returns the primary rays, row by row; those of a pixel follow each other.
    fn primary(&self, maker: &Maker) -> Vec<Ray> {
        let [width, height] = self.size.map(|side| side.max(1) as usize);
        let aspect = width as f64 / height as f64;
        let views: Vec<View> = self.views.iter().map(|view| view.fitted(aspect)).collect();
        let (samples, count) = (self.samples.max(1) as usize, views.len().max(1));
        let of_view = |v: usize| (v + 1) * height / count - v * height / count;
        let mut rays = Vec::with_capacity(width * height * samples);
        for (v, view) in views.iter().enumerate() {
            let (rows, first) = (of_view(v), rays.len());
            rays.extend(generated(first..first + width * rows * samples, &|i| {
                let mut random = maker.random_at(stream::PRIMARY, i);
                let pixel = (i - first) / samples;
                let x = ((pixel % width) as f64 + random.unit()) / width as f64;
                let y = ((pixel / width) as f64 + random.unit()) / rows as f64;
                let (origin, direction) = view.ray([2.0 * x - 1.0, 1.0 - 2.0 * y]);
                Ray::endless(origin, direction)
            }));
        }
        rays
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::cpu::{Reference, TwoLevel};
    use crate::verify::test_scenes;

    fn shot() -> Shot {
        let view = View::toward("camera".into(), DVec3::new(0.1, 0.2, 0.1), DVec3::new(0.1, 0.0, -1.0), 1.0);
        Shot {
            views: vec![view.expect("it looks somewhere")],
            light: None,
            size: [8, 6],
            samples: 1,
            light_samples: 1,
            bounces: true,
            seed: 1,
        }
    }

    fn rays(shot: &Shot) -> PerKind<Vec<Ray>> {
        let scene = test_scenes::room();
        let trees = TwoLevel::build(&scene);
        let reference = Reference::new(&trees);
        let Ok(rays) = of_shot(&scene, |rays| Ok::<_, std::convert::Infallible>(reference.closest(rays)), shot);
        rays
    }

    fn counts(shot: &Shot) -> [usize; 4] {
        RayKind::ALL.map(|kind| rays(shot)[kind].len())
    }

    #[test]
    fn samples_lights_and_bounces_set_the_number_of_rays() {
        let [primary, shadow, diffuse, random] = counts(&shot());
        assert_eq!((primary, random), (48, 0));
        assert!(shadow > 24 && shadow == diffuse, "{shadow} {diffuse}");
        let more = counts(&Shot { samples: 3, light_samples: 2, bounces: false, ..shot() });
        assert!(more[0] == 144 && more[1] > 144 && more[1].is_multiple_of(2) && more[2] == 0, "{more:?}");
        assert_eq!(counts(&Shot { light_samples: 0, ..shot() })[1], 0);
    }

    #[test]
    fn shadow_rays_end_at_the_light() {
        let light = Light { corner: DVec3::new(0.25, 0.5, -0.25), size: 0.125 };
        let rays = rays(&Shot { light: Some(light), ..shot() });
        assert!(!rays[RayKind::Shadow].is_empty());
        for ray in &rays[RayKind::Shadow] {
            let end = (ray.origin + ray.t_max * ray.direction).as_dvec3() - light.corner;
            assert!(
                end.y.abs() < 1e-5 && (-1e-5..0.12501).contains(&end.x) && (-1e-5..0.12501).contains(&end.z),
                "{end}"
            );
        }
    }

    #[test]
    fn a_moving_camera_shares_the_rays_among_its_places() {
        let one = shot();
        let other = View::toward("other".into(), DVec3::ZERO, DVec3::X, 1.0).expect("it looks somewhere");
        let both = Shot { views: vec![one.views[0].clone(), other], ..one };
        let rays = rays(&both);
        let from: Vec<glam::Vec3> = rays[RayKind::Primary].iter().map(|ray| ray.origin).collect();
        assert_eq!(from.len(), 48);
        assert!(from[..24].iter().all(|p| *p == from[0]) && from[24..].iter().all(|p| *p == glam::Vec3::ZERO));
    }
}
