//! What the keys of an environment mean.

use crate::choose::Choice;
use crate::choose::ChooseOptions;
use crate::lab::LabError;
use crate::lab::error_vs_time::{Bake, Setting, Tracer, Value as OptionValue};
use crate::lab::thesis_files::{SettingsFile, Value};
use crate::layout::BlasPer;
use crate::methods::{Method, OverlapRule};
use crate::verify::build::{BuildOptions, Prefer};
use crate::verify::rays::MOST_RAYS;
use crate::verify::{DeviceChoice, VerifyOptions};

/// Build flags of OptiX (`OptixBuildFlags`).
mod flag {
    pub(super) const ALLOW_UPDATE: u64 = 1;
    pub(super) const ALLOW_COMPACTION: u64 = 1 << 1;
    pub(super) const PREFER_FAST_TRACE: u64 = 1 << 2;
    pub(super) const PREFER_FAST_BUILD: u64 = 1 << 3;
}

/// The picture whose rays are timed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::lab) struct PictureSetup {
    /// Width and height in pixels.
    pub(in crate::lab) size: [u32; 2],
    /// Primary rays per pixel.
    pub(in crate::lab) samples: u32,
    /// Shadow rays per point that a primary ray hits.
    pub(in crate::lab) light_samples: u32,
    /// Whether a diffuse ray leaves each such point.
    pub(in crate::lab) secondary_rays: bool,
    /// Traversal steps per ray at the last colour of a heat map; `None`: as suits the picture.
    pub(in crate::lab) heat_scale: Option<f64>,
}

impl Default for PictureSetup {
    fn default() -> Self {
        PictureSetup { size: [1280, 720], samples: 1, light_samples: 1, secondary_rays: true, heat_scale: None }
    }
}

/// One environment, with one value of each key.
#[derive(Clone, Debug)]
pub(in crate::lab) struct Setup {
    /// The environment's name.
    pub(in crate::lab) name: String,
    /// The swept keys with their values, in words.
    pub(in crate::lab) swept: Vec<(String, String)>,
    /// The method with its options, and how acceleration structures are built.
    pub(in crate::lab) bake: Bake,
    /// What traces; `None`: the device, or the CPU if there is none.
    pub(in crate::lab) tracer: Option<Tracer>,
    /// The device.
    pub(in crate::lab) device: DeviceChoice,
    /// Frames from one rebuild of the TLAS to the next; 0: it is never rebuilt.
    pub(in crate::lab) rebuild_interval: u32,
    pub(in crate::lab) picture: PictureSetup,
}

impl Setup {
    /// Returns a setup for each combination of an environment's values.
    ///
    /// # Errors
    /// Fails if there are too many, or if keys contradict each other; the error names the line.
    pub(in crate::lab) fn all_of(file: &SettingsFile) -> Result<Vec<Setup>, LabError> {
        let swept = file.swept();
        let setup = |one: SettingsFile| {
            let value = |name: &String| (name.clone(), one.in_words(name).unwrap_or_default());
            Ok(Setup { swept: swept.iter().map(value).collect(), ..Setup::of(&one)? })
        };
        file.combinations()?.into_iter().map(setup).collect()
    }

    /// Returns the setup of an environment of which every key has one value.
    fn of(file: &SettingsFile) -> Result<Setup, LabError> {
        let mut setup = Setup::with(method_of(file));
        setup.name = text(file, "ENVIRONMENT_NAME").unwrap_or_else(|| setup.bake.choose.method.name().to_owned());
        setup.rebuild_interval = whole(file, "SCENE_REBUILD_INTERVAL").unwrap_or(1) as u32;
        setup.bake.verify.build = build(whole(file, "BUILD_FLAGS"));
        set_thresholds(&mut setup.bake.choose, file);
        setup.picture = picture(file)?;
        for (name, values, line) in &file.options {
            setup.set(name, &values[0]).map_err(|cause| file.error(*line, cause))?;
        }
        Ok(setup)
    }

    /// Returns the setup of a method without more.
    pub(in crate::lab) fn with(method: Choice) -> Setup {
        let choose = ChooseOptions { method, ..ChooseOptions::default() };
        Setup {
            name: method.name().to_owned(),
            swept: Vec::new(),
            bake: Bake { choose, verify: VerifyOptions::default() },
            tracer: None,
            device: DeviceChoice::Auto,
            rebuild_interval: 1,
            picture: PictureSetup::default(),
        }
    }

    /// Sets an option that the thesis's files do not have.
    fn set(&mut self, name: &str, value: &OptionValue) -> Result<(), String> {
        let word = value.word().unwrap_or_default();
        match name {
            "method" => {
                let mut all = [Choice::Auto].into_iter().chain(Method::ALL.map(Choice::Method));
                self.bake.choose.method = all.find(|of| of.name() == word).ok_or_else(|| no_such(name, value))?;
            }
            "tracer" => {
                let tracer = Tracer::ALL.into_iter().find(|of| of.name() == word);
                self.tracer = Some(tracer.ok_or_else(|| no_such(name, value))?);
            }
            "device" => self.device = DeviceChoice::from(value.to_string().as_str()),
            "blas_per" => {
                self.bake.verify.build.blas_per = match word {
                    "mesh" => BlasPer::Mesh,
                    "primitive" => BlasPer::Primitive,
                    _ => return Err(no_such(name, value)),
                }
            }
            _ => Setting::named(name).iter().for_each(|setting| setting.apply(&mut self.bake, value)),
        }
        Ok(())
    }
}

fn no_such(name: &str, value: &OptionValue) -> String {
    format!("`{name}`: there is no `{value}`")
}

/// Returns the method that an environment asks for: one BLAS (`SINGLE_GAS`), else `bvh` (`USE_BVH`), else `overlap` if it
/// states a threshold of it, else one BLAS per object.
fn method_of(file: &SettingsFile) -> Choice {
    let is_set = |name| matches!(file.values(name), [Value::Flag(true)]);
    let has_threshold = ["SOM_THRESHOLD", "SKIP_OVERLAP_THRESHOLD", "OVERLAP_THRESHOLD"]
        .iter()
        .any(|name| !file.values(name).is_empty());
    Choice::Method(match () {
        () if is_set("SINGLE_GAS") => Method::Single,
        () if is_set("USE_BVH") => Method::Bvh,
        () if has_threshold => Method::Overlap,
        () => Method::PerObject,
    })
}

/// Returns how acceleration structures are built for a sum of OptiX's flags; without one, as by default.
/// `ALLOW_RANDOM_VERTEX_ACCESS` changes nothing: rays do not ask for vertices.
fn build(flags: Option<u64>) -> BuildOptions {
    let Some(flags) = flags else { return BuildOptions::default() };
    BuildOptions {
        prefer: match () {
            () if flags & flag::PREFER_FAST_TRACE != 0 => Prefer::FastTrace,
            () if flags & flag::PREFER_FAST_BUILD != 0 => Prefer::FastBuild,
            () => Prefer::None,
        },
        allow_update: flags & flag::ALLOW_UPDATE != 0,
        compact: flags & flag::ALLOW_COMPACTION != 0,
        ..BuildOptions::default()
    }
}

/// Returns the flags of OptiX that a build corresponds to.
pub(in crate::lab) fn flags(build: &BuildOptions) -> u64 {
    let of = |is_set: bool, flag: u64| if is_set { flag } else { 0 };
    of(build.allow_update, flag::ALLOW_UPDATE)
        | of(build.compact, flag::ALLOW_COMPACTION)
        | of(build.prefer == Prefer::FastTrace, flag::PREFER_FAST_TRACE)
        | of(build.prefer == Prefer::FastBuild, flag::PREFER_FAST_BUILD)
}

fn set_thresholds(choose: &mut ChooseOptions, file: &SettingsFile) {
    let (overlap, bvh) = (&mut choose.layout.overlap, &mut choose.layout.bvh);
    let set = |name, to: &mut f64| to.clone_from(&number(file, name).unwrap_or(*to));
    set("SOM_THRESHOLD", &mut overlap.split_or_merge_ratio);
    // The thesis does not state the threshold between the two branches that split: see `OverlapOptions`.
    overlap.split_ratio = 0.5 * overlap.split_or_merge_ratio;
    // The files are those of the thesis, and so is the method.
    overlap.rule = OverlapRule::Thesis;
    set("SKIP_OVERLAP_THRESHOLD", &mut overlap.skip_overlap_ratio);
    set("OVERLAP_THRESHOLD", &mut overlap.termination_overlap_ratio);
    set("NODES_TO_TRIS", &mut bvh.nodes_per_triangle_ratio);
    if let Some(count) = whole(file, "MIN_SIZE") {
        (overlap.min_triangles, bvh.min_triangles) = (count as usize, count as usize);
    }
}

fn picture(file: &SettingsFile) -> Result<PictureSetup, LabError> {
    let defaults = PictureSetup::default();
    let or = |name, otherwise: u32| whole(file, name).map_or(otherwise, |n| n as u32);
    let picture = PictureSetup {
        size: [or("WIDTH", defaults.size[0]), or("HEIGHT", defaults.size[1])],
        samples: or("PIXEL_SAMPLES", defaults.samples),
        light_samples: or("LIGHT_SAMPLES", defaults.light_samples),
        secondary_rays: match file.values("SECONDARY_RAYS") {
            [Value::Flag(flag)] => *flag,
            _ => defaults.secondary_rays,
        },
        heat_scale: number(file, "HEATSCALE"),
    };
    let primary = picture.size.map(u64::from).iter().product::<u64>() * u64::from(picture.samples);
    let most = primary.saturating_mul(u64::from(picture.light_samples.max(1)));
    if most > u64::from(MOST_RAYS) {
        let cause = format!("the picture takes {most} rays of a kind, more than {MOST_RAYS}");
        return Err(file.error(file.line_of("WIDTH"), cause));
    }
    Ok(picture)
}

fn text(file: &SettingsFile, name: &str) -> Option<String> {
    if let [Value::Text(text)] = file.values(name) { Some(text.clone()) } else { None }
}

fn number(file: &SettingsFile, name: &str) -> Option<f64> {
    if let [Value::Number(x)] = file.values(name) { Some(*x) } else { None }
}

fn whole(file: &SettingsFile, name: &str) -> Option<u64> {
    if let [Value::Whole(n)] = file.values(name) { Some(*n) } else { None }
}
