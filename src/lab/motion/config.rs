//! The table `[motion]` of a configuration.

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Deserialize;
use toml::Spanned;

use crate::lab::LabError;
use crate::lab::config::Source;
use crate::motion::frames::{FrameOptions, RebuildEvery};
use crate::motion::{Crowd, Deviating, Orbit};
use crate::verify::VerifyOptions;
use crate::verify::frames::Upkeep;
use crate::verify::rays::MOST_RAYS;

/// What moves, and what is measured.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::lab) struct Motion {
    /// The file of the model, if there are copies.
    pub(super) model: Option<PathBuf>,
    /// Numbers of copies of the model.
    pub(super) instances: Vec<u32>,
    /// Share of the copies that are animated.
    pub(super) animated_ratio: f64,
    /// Diagonal of a copy over that of the scene.
    pub(super) size_ratio: f64,
    /// Diagonals of the scene per second.
    speed_ratio: Deviating,
    /// Diagonals of the scene.
    distance_ratio: Deviating,
    /// Turns per second.
    turns: Deviating,
    /// Which animation of the scene's file plays.
    pub(super) animation: usize,
    /// Whether the instances are also measured without the scene.
    pub(super) alone: bool,
    pub(super) frames: FrameOptions,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::lab) struct Keys {
    model: Option<String>,
    instances: Option<Spanned<Vec<Spanned<u32>>>>,
    animated_ratio: Option<Spanned<f64>>,
    size_ratio: Option<Spanned<f64>>,
    speed_ratio: Option<Spanned<f64>>,
    speed_deviation_ratio: Option<Spanned<f64>>,
    distance_ratio: Option<Spanned<f64>>,
    distance_deviation_ratio: Option<Spanned<f64>>,
    turns: Option<Spanned<f64>>,
    turns_deviation: Option<Spanned<f64>>,
    animation: Option<usize>,
    #[serde(default)]
    alone: bool,
    rebuild_every: Option<Spanned<Vec<Spanned<Every>>>>,
    frames: Option<Spanned<u32>>,
    frames_per_second: Option<Spanned<f64>>,
    counted_every: Option<Spanned<u32>>,
    blas: Option<Spanned<String>>,
    camera_frequency: Option<f64>,
    camera: Option<Spanned<CameraKeys>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraKeys {
    position: [f64; 3],
    interest: [f64; 3],
}

/// A number of frames, or `never`.
#[derive(Deserialize)]
#[serde(untagged)]
enum Every {
    Frames(u32),
    Word(String),
}

/// Most copies: a TLAS has at most 2^24 instances.
const MOST_INSTANCES: u32 = 1 << 24;
/// Most frames.
const MOST_FRAMES: u32 = 1 << 20;

impl Motion {
    /// Reads the table. `verify` is what the keys outside of it say, `counted_rays` too.
    ///
    /// # Errors
    /// Fails if a value is invalid.
    pub(in crate::lab) fn read(
        source: &Source<'_>,
        keys: &Keys,
        folder: &Path,
        (verify, counted_rays): (&VerifyOptions, Option<usize>),
    ) -> Result<Motion, LabError> {
        let ratio = |value: &Option<Spanned<f64>>, key: &str, default: f64| match value {
            Some(value) => source.ratio(value, key).and_then(|ratio| finite(source, value, key, ratio)),
            None => Ok(default),
        };
        let deviating = |names: [&str; 2], values: [&Option<Spanned<f64>>; 2], defaults: [f64; 2]| {
            let base = ratio(values[0], names[0], defaults[0])?;
            Ok::<_, LabError>(Deviating { base, deviation: ratio(values[1], names[1], defaults[1])? })
        };
        Ok(Motion {
            model: keys.model.as_ref().map(|model| folder.join(model)),
            instances: instances(source, keys)?,
            animation: keys.animation.unwrap_or(0),
            animated_ratio: ratio(&keys.animated_ratio, "animated_ratio", 1.0)?.min(1.0),
            size_ratio: ratio(&keys.size_ratio, "size_ratio", 0.02)?,
            speed_ratio: deviating(
                ["speed_ratio", "speed_deviation_ratio"],
                [&keys.speed_ratio, &keys.speed_deviation_ratio],
                [0.05, 0.02],
            )?,
            distance_ratio: deviating(
                ["distance_ratio", "distance_deviation_ratio"],
                [&keys.distance_ratio, &keys.distance_deviation_ratio],
                [0.1, 0.05],
            )?,
            turns: deviating(["turns", "turns_deviation"], [&keys.turns, &keys.turns_deviation], [0.1, 0.05])?,
            alone: keys.alone,
            frames: frame_options(source, keys, verify, counted_rays)?,
        })
    }

    /// Returns the crowd in a scene of a diagonal.
    pub(super) fn crowd(&self, instances: u32, diagonal: f64, seed: u64) -> Crowd {
        let scaled = |of: Deviating| Deviating { base: of.base * diagonal, deviation: of.deviation * diagonal };
        Crowd {
            copies: instances as usize,
            animated: (self.animated_ratio * f64::from(instances)).round() as usize,
            speed: scaled(self.speed_ratio),
            distance: scaled(self.distance_ratio),
            turns: self.turns,
            seed,
        }
    }
}

fn finite(source: &Source<'_>, value: &Spanned<f64>, key: &str, number: f64) -> Result<f64, LabError> {
    let error = || source.error(Some(value.span()), format!("`{key}` is not finite"));
    if number.is_finite() { Ok(number) } else { Err(error()) }
}

fn instances(source: &Source<'_>, keys: &Keys) -> Result<Vec<u32>, LabError> {
    let list = match (&keys.instances, &keys.model) {
        (None, model) => return Ok(vec![if model.is_some() { 1000 } else { 0 }]),
        (Some(list), None) if list.get_ref().iter().any(|number| *number.get_ref() > 0) => {
            return Err(source.error(Some(list.span()), "`instances` of what? There is no `model`"));
        }
        (Some(list), _) => list,
    };
    if list.get_ref().is_empty() {
        return Err(source.error(Some(list.span()), "`instances` lists no number"));
    }
    list.get_ref().iter().map(|number| source.within(number, "instances", 0..=MOST_INSTANCES)).collect()
}

fn frame_options(
    source: &Source<'_>,
    keys: &Keys,
    verify: &VerifyOptions,
    counted_rays: Option<usize>,
) -> Result<FrameOptions, LabError> {
    let defaults = FrameOptions::default();
    let frequency = keys.camera_frequency.unwrap_or(defaults.camera_frequency);
    let count = |value, key, default| Ok::<_, LabError>(source.count(value, key, MOST_FRAMES)?.unwrap_or(default));
    Ok(FrameOptions {
        policies: policies(source, &keys.rebuild_every)?.unwrap_or(defaults.policies),
        frames: count(&keys.frames, "frames", defaults.frames)?,
        frames_per_second: match &keys.frames_per_second {
            Some(value) if *value.get_ref() > 0.0 => finite(source, value, "frames_per_second", *value.get_ref())?,
            Some(value) => return Err(source.error(Some(value.span()), "`frames_per_second` is a number above 0")),
            None => defaults.frames_per_second,
        },
        rays: verify.timed_rays_per_kind.unwrap_or(verify.rays_per_kind).min(MOST_RAYS) as usize,
        counted_rays: counted_rays.unwrap_or(defaults.counted_rays),
        counted_every: count(&keys.counted_every, "counted_every", defaults.counted_every)?,
        blas_upkeep: match &keys.blas {
            None => defaults.blas_upkeep,
            Some(word) if word.get_ref() == "refit" => Upkeep::Refit,
            Some(word) if word.get_ref() == "rebuild" => Upkeep::Rebuild,
            Some(word) => return Err(source.error(Some(word.span()), "`blas` is \"refit\" or \"rebuild\"")),
        },
        camera: keys.camera.as_ref().map(|camera| orbit(source, camera, frequency)).transpose()?,
        camera_frequency: frequency,
        build: verify.build,
        seed: verify.seed,
    })
}

/// The policies in the order of the list; equal ones count once.
fn policies(
    source: &Source<'_>,
    list: &Option<Spanned<Vec<Spanned<Every>>>>,
) -> Result<Option<Vec<RebuildEvery>>, LabError> {
    let Some(list) = list else { return Ok(None) };
    let mut policies = Vec::new();
    for every in list.get_ref() {
        let policy = match every.get_ref() {
            Every::Frames(frames @ 1..) => RebuildEvery::Frames(*frames),
            Every::Word(word) if word == "never" => RebuildEvery::Never,
            _ => {
                let cause = "`rebuild_every` lists numbers of frames of at least 1, and \"never\"";
                return Err(source.error(Some(every.span()), cause));
            }
        };
        if !policies.contains(&policy) {
            policies.push(policy);
        }
    }
    match policies.is_empty() {
        true => Err(source.error(Some(list.span()), "`rebuild_every` lists none")),
        false => Ok(Some(policies)),
    }
}

fn orbit(source: &Source<'_>, camera: &Spanned<CameraKeys>, frequency: f64) -> Result<Orbit, LabError> {
    let CameraKeys { position, interest } = camera.get_ref();
    let orbit = Orbit { position: DVec3::from(*position), interest: DVec3::from(*interest), frequency };
    match orbit.view(0.0) {
        Some(_) => Ok(orbit),
        None => Err(source.error(Some(camera.span()), "`camera`: position and interest are one point or not finite")),
    }
}
