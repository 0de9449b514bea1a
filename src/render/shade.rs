//! Surfaces with their materials in the light of an area light, with one diffuse bounce.
//!
//! Meant for telling what is what, not for realism: light falls off softly, a rough metal is drawn as a diffuse surface,
//! glass does not bend rays, and what is lit over more than one bounce is lit evenly. Rays are sampled as in J. Kajiya,
//! "The Rendering Equation", SIGGRAPH 1986, cut after the first bounce.

use glam::{DVec3, Vec3};

use super::colour::encoded;
use super::draws::{Draws, Purpose};
use super::frame::Frame;
use super::look::{Look, Looks};
use super::probe::{Probe, Tracing};
use super::surface::Spot;
use super::{Light, Picture, Renderer, Statistics};
use crate::scene::{InstanceId, Scene};
use crate::verify::rays::{Ray, off_surface};
use crate::verify::view::Stage;
use crate::verify::{DeviceError, Hit};

/// Surfaces that one primary ray may pass.
const MOST_LAYERS: usize = 24;
/// Light of one sample that is not cut: a few samples with more would stand out as dots.
const MOST_LIGHT: f32 = 4.0;
/// Light that is not worth following any more.
const LEAST: f32 = 0.01;
/// Light of the lamp at one radius of the scene, inside an interior and elsewhere.
const LAMP: [f32; 2] = [1.1, 0.85];
/// Light that comes from nowhere: over more than one bounce.
const AMBIENT: f32 = 0.2;
/// Mean luminance of a picture that needs no more light, the most that it gets in powers of two, and in which steps.
const LIGHT_ENOUGH: f64 = 0.2;
const MOST_STOPS: f64 = 2.5;
const STEPS_PER_STOP: f64 = 2.0;
/// Share of light that glass and other smooth surfaces reflect head-on.
const REFLECTED: f32 = 0.04;

/// What shading needs to know.
pub(super) struct Shader<'r, 'a> {
    scene: &'r Scene,
    looks: &'r Looks<'a>,
    stage: Stage,
    /// The area light; `None` for that of the stage.
    light: Option<Light>,
    /// Its brightness over the default.
    power: f32,
}

/// Draws the shaded picture.
pub(super) fn picture(
    renderer: &Renderer,
    stage: Stage,
    frame: &Frame,
    tracing: &Tracing,
) -> Result<Picture, DeviceError> {
    let power = frame.light_power.map_or(1.0, |power| power as f32);
    let shader = Shader { light: frame.light, power, ..Shader::of(renderer, stage) };
    let of_pixel = |samples: &mut dyn Iterator<Item = (Vec3, bool)>| {
        let add = |(sum, hits): (Vec3, u32), (light, is_hit): (Vec3, bool)| {
            (sum + light.min(Vec3::splat(MOST_LIGHT)), hits + u32::from(is_hit))
        };
        let (sum, hits) = samples.fold((Vec3::ZERO, 0), add);
        (sum / frame.samples as f32, hits)
    };
    let of_pixels = frame.each(tracing, |probe, sample| shader.light(probe, sample.ray, sample.draws), of_pixel)?;
    let seen_ratio = frame.seen_ratio(of_pixels.iter().map(|(_, hits)| *hits));
    let exposure = match frame.light_power {
        Some(_) => 1.0,
        None => exposure(of_pixels.iter().map(|(light, _)| *light)),
    };
    let pixels = of_pixels.into_iter().map(|(light, _)| encoded(exposure * light)).collect();
    Ok(Picture::of(frame.size, pixels, Statistics { seen_ratio, ..Statistics::default() }))
}

/// Returns the factor that makes a dark picture light enough. It has few values, so that pictures of two files that show
/// the same have the same one.
fn exposure(pixels: impl ExactSizeIterator<Item = Vec3>) -> f32 {
    let count = pixels.len() as f64;
    let luminance = |light: Vec3| f64::from(light.dot(Vec3::new(0.2126, 0.7152, 0.0722)).min(1.0));
    let mean = pixels.map(luminance).sum::<f64>() / count;
    let stops = (LIGHT_ENOUGH / mean.max(1e-6)).log2().clamp(0.0, MOST_STOPS);
    ((STEPS_PER_STOP * stops).floor() / STEPS_PER_STOP).exp2() as f32
}

impl<'r, 'a> Shader<'r, 'a> {
    pub(super) fn of(renderer: &'r Renderer<'a>, stage: Stage) -> Shader<'r, 'a> {
        Shader { scene: renderer.scene, looks: renderer.looks(), stage, light: None, power: 1.0 }
    }

    /// Returns the light that comes against a ray, and whether the ray hits anything.
    fn light(&self, probe: &mut Probe, first: Ray, draws: Draws) -> (Vec3, bool) {
        let (mut ray, mut light, mut through) = (first, Vec3::ZERO, Vec3::ONE);
        for layer in 0..MOST_LAYERS {
            let Some((spot, look)) = self.meet(probe, &ray) else {
                return (light + through * self.sky(ray.direction), layer > 0);
            };
            light += through * look.alpha * self.leaving(probe, &ray, &spot, &look, draws.at_layer(layer));
            through *= passing(&look, &ray);
            if through.max_element() < LEAST {
                break;
            }
            let direction = ray.direction.as_dvec3();
            ray = Ray::endless(off_surface(spot.point, -spot.normal, self.stage.radius), direction);
        }
        (light, true)
    }

    /// Returns the normal that the file states for a point; see [`Looks::stated_normal`].
    pub(super) fn stated_normal(&self, spot: &Spot) -> Option<DVec3> {
        self.looks.stated_normal(spot)
    }

    /// Returns the first surface that a ray meets, without what alpha tests remove.
    pub(super) fn meet(&self, probe: &mut Probe, ray: &Ray) -> Option<(Spot<'r>, Look)> {
        let hit = probe.closest(ray, |hit| self.alpha(ray, hit) > 0.0)?;
        let spot = Spot::of(self.scene, ray, &hit);
        let look = self.looks.at(&spot);
        Some((spot, look))
    }

    fn alpha(&self, ray: &Ray, hit: &Hit) -> f32 {
        if self.may_pass(hit) { self.looks.base(&Spot::of(self.scene, ray, hit)).w } else { 1.0 }
    }

    fn may_pass(&self, hit: &Hit) -> bool {
        let mesh = self.scene.mesh_of(InstanceId(hit.instance));
        self.looks.lets_through(&mesh.geometries[mesh.locate(hit.triangle).0])
    }

    /// Returns the light that leaves a point against a ray.
    fn leaving(&self, probe: &mut Probe, ray: &Ray, spot: &Spot, look: &Look, draws: Draws) -> Vec3 {
        if look.is_unlit {
            return look.base;
        }
        let mut light = look.emission;
        let diffuse = diffuse(look);
        if diffuse.max_element() > 0.0 {
            let lamp = self.lamp(probe, spot, look, draws.pair(Purpose::Lamp));
            light += diffuse * (lamp + self.bounced(probe, spot, look, draws));
        }
        let mirrored = mirrored(look, ray);
        if mirrored.max_element() > LEAST {
            light += mirrored * self.reflected(probe, ray, spot, look, draws);
        }
        light
    }

    /// Returns the light of the lamp on a point: from a point of the lamp that two random numbers choose, as far as nothing
    /// is in between.
    fn lamp(&self, probe: &mut Probe, spot: &Spot, look: &Look, point: [f64; 2]) -> Vec3 {
        let way = self.light.map_or_else(|| self.stage.light(point), |light| light.at(point)) - spot.point;
        let distance = way.length();
        let cosine = look.normal.as_dvec3().dot(way) / distance;
        if !(cosine > 0.0 && spot.normal.dot(way) > 0.0) {
            return Vec3::ZERO;
        }
        let start = off_surface(spot.point, spot.normal, self.stage.radius);
        let ray = Ray { t_max: distance as f32, ..Ray::endless(start, way) };
        let share = distance / self.stage.radius;
        let strength = LAMP[usize::from(!self.stage.enclosed)] * 1.6 / (0.6 + share * share) as f32;
        self.power * strength * cosine as f32 * self.left_of(probe, &ray)
    }

    /// Returns the share of light that passes all that is on a ray.
    fn left_of(&self, probe: &mut Probe, ray: &Ray) -> Vec3 {
        let mut left = Vec3::ONE;
        let is_dark = |hit: &Hit| {
            left *= if self.may_pass(hit) {
                passing(&self.looks.at(&Spot::of(self.scene, ray, hit)), ray)
            } else {
                Vec3::ZERO
            };
            left.max_element() < LEAST
        };
        if probe.any(ray, is_dark).is_some() { Vec3::ZERO } else { left }
    }

    /// Returns the light that a random direction brings to a point, cosine-distributed about its normal.
    fn bounced(&self, probe: &mut Probe, spot: &Spot, look: &Look, draws: Draws) -> Vec3 {
        let normal = look.normal.as_dvec3();
        let direction = (normal + draws.direction(Purpose::Bounce)).try_normalize().unwrap_or(normal);
        self.brought(probe, spot, direction, draws.pair(Purpose::BounceLamp))
    }

    /// Returns the light that the mirrored direction brings to a point, blurred by the roughness.
    fn reflected(&self, probe: &mut Probe, ray: &Ray, spot: &Spot, look: &Look, draws: Draws) -> Vec3 {
        let mirror = ray.direction.as_dvec3().reflect(look.normal.as_dvec3());
        let blur = f64::from(look.roughness * look.roughness);
        let direction = (mirror + blur * draws.direction(Purpose::Mirror)).try_normalize().unwrap_or(mirror);
        self.brought(probe, spot, direction, draws.pair(Purpose::MirrorLamp))
    }

    /// Returns the light that comes to a point from a direction; what is there is lit by a point of the lamp and evenly.
    fn brought(&self, probe: &mut Probe, spot: &Spot, direction: DVec3, lamp: [f64; 2]) -> Vec3 {
        // A direction below the surface is mirrored to above it.
        let above = direction - 2.0 * direction.dot(spot.normal).min(0.0) * spot.normal;
        let ray = Ray::endless(off_surface(spot.point, spot.normal, self.stage.radius), above);
        match self.meet(probe, &ray) {
            None => self.sky(ray.direction),
            Some((_, look)) if look.is_unlit => look.base,
            Some((there, look)) => look.emission + look.base * (self.lamp(probe, &there, &look, lamp) + AMBIENT),
        }
    }

    /// Returns the light that comes from outside the scene.
    fn sky(&self, direction: Vec3) -> Vec3 {
        if self.stage.enclosed {
            return Vec3::splat(0.8);
        }
        let height = (0.5 + 0.5 * direction.y).clamp(0.0, 1.0);
        Vec3::new(0.55, 0.55, 0.55).lerp(Vec3::new(0.52, 0.66, 0.9), height)
    }
}

/// Share of light that a surface scatters; a rough metal scatters, a smooth one mirrors.
fn diffuse(look: &Look) -> Vec3 {
    look.base * (1.0 - look.metallic * (1.0 - look.roughness)) * (1.0 - look.transmission)
}

/// Share of light that a surface mirrors, after C. Schlick, "An Inexpensive BRDF Model for Physically-based Rendering",
/// Computer Graphics Forum 13(3), 1994.
fn mirrored(look: &Look, ray: &Ray) -> Vec3 {
    let head_on = Vec3::splat(REFLECTED).lerp(look.base, look.metallic);
    let smooth = 1.0 - look.roughness;
    let grazing = (1.0 - look.normal.dot(-ray.direction).clamp(0.0, 1.0)).powi(5);
    let all = head_on + (Vec3::ONE - head_on) * grazing;
    all * (look.metallic * smooth + (1.0 - look.metallic) * smooth * smooth)
}

/// Share of light that passes straight through a surface.
fn passing(look: &Look, ray: &Ray) -> Vec3 {
    let through = look.base * look.transmission * (Vec3::ONE - mirrored(look, ray)) * (1.0 - look.metallic);
    Vec3::splat(1.0 - look.alpha) + look.alpha * through
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dark_pictures_get_more_light_in_steps_and_light_ones_none() {
        let of = |light: f32| exposure([Vec3::splat(light); 9].into_iter());
        assert_eq!((of(0.9), of(0.2)), (1.0, 1.0));
        assert!((of(0.049) - 4.0).abs() < 1e-6 && of(0.0501) == of(0.055));
        assert_eq!(of(0.0), of(1e-4));
    }
}
