//! The configuration of an experiment, in TOML.

use std::fmt::Display;
use std::fs;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;

use super::LabError;
use super::error_vs_time::{self, Bake, ErrorVsTime};
use super::flags::{self, Flags};
use super::motion::{self, Motion};
use crate::choose::ChooseOptions;
use crate::choose::model::Class;
use crate::choose::plans::{Effort, Plan, plans};
use crate::methods::{Method, Options};
use crate::verify::rays::MOST_RAYS;
use crate::verify::speed::MOST_REPEATS;
use crate::verify::{DeviceChoice, VerifyOptions};

/// The scenes and layouts to measure, and what to do with the results.
pub(super) struct Config {
    /// The files with their names in the tables, which are their paths as written in the configuration.
    pub(super) scenes: Vec<(String, PathBuf)>,
    pub(super) plans: Vec<Plan>,
    /// How layouts are timed.
    pub(super) verify: VerifyOptions,
    /// Number of rays of each kind to count traversal steps for.
    pub(super) counted_rays: usize,
    /// The folder for the tables.
    pub(super) out: PathBuf,
    /// Whether to skip scenes that cannot be read.
    pub(super) skip_broken: bool,
    /// The device class to fit prices for.
    pub(super) fit: Option<Class>,
    /// What to measure instead of prices.
    pub(super) error_vs_time: Option<ErrorVsTime>,
    /// Build flags to measure instead.
    pub(super) flags: Option<Flags>,
    /// What to move and measure instead.
    pub(super) motion: Option<Motion>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    scenes: Spanned<Vec<Spanned<String>>>,
    methods: Option<Spanned<Vec<Spanned<String>>>>,
    effort: Option<Spanned<u32>>,
    device: Option<String>,
    rays: Option<Spanned<u32>>,
    counted_rays: Option<Spanned<u32>>,
    repeats: Option<Spanned<u32>>,
    seed: Option<u64>,
    max_position_error_ratio: Option<Spanned<f64>>,
    out: PathBuf,
    #[serde(default)]
    skip_broken: bool,
    fit: Option<FitKeys>,
    #[serde(rename = "error-vs-time")]
    error_vs_time: Option<Spanned<error_vs_time::Keys>>,
    motion: Option<Spanned<motion::Keys>>,
    flags: Option<Spanned<flags::Keys>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FitKeys {
    class: Spanned<String>,
}

impl Config {
    /// Reads a configuration; paths in it are relative to its folder.
    ///
    /// # Errors
    /// Fails if the file cannot be read or is not TOML, if a key is unknown, missing or has an invalid value, or if a
    /// glob matches nothing. All errors name the file and the line.
    pub(super) fn read(path: &Path) -> Result<Config, LabError> {
        let text = fs::read_to_string(path).map_err(|e| LabError::file(path, e))?;
        let source = Source { path, text: &text };
        let keys: Keys = toml::from_str(&text).map_err(|e| source.error(e.span(), e.message()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let error_vs_time = error_vs_time(&source, &keys)?;
        let motion = motion(&source, &keys, folder)?;
        let is_fit = error_vs_time.is_none();
        let config = Config {
            scenes: match &error_vs_time {
                Some(made) if made.has_scenes() && keys.scenes.get_ref().is_empty() => Vec::new(),
                _ => scenes(&source, &keys.scenes, folder)?,
            },
            plans: match given_plans(&keys, is_fit) {
                Some(plans) => plans,
                None => chosen_plans(&source, &keys)?,
            },
            verify: verify_options(&source, &keys)?,
            counted_rays: counted_rays(&source, &keys)?.unwrap_or(Effort::default().rays()),
            out: folder.join(&keys.out),
            skip_broken: keys.skip_broken,
            fit: keys.fit.as_ref().map(|fit| class(&source, &fit.class)).transpose()?,
            error_vs_time,
            motion,
            flags: flags(&source, &keys)?,
        };
        match keys.fit.map(|fit| (config.cannot_fit(), fit.class.span())) {
            Some((Some(why), span)) => Err(source.error(Some(span), format!("`fit`: {why}"))),
            _ => Ok(config),
        }
    }

    /// Why prices cannot be fitted, as far as this is known before measuring.
    fn cannot_fit(&self) -> Option<&'static str> {
        match (self.scenes.len(), self.plans.iter().any(|plan| plan.method == Method::Single)) {
            (..2, _) => Some("it takes two scenes, so that one can be left out"),
            (_, false) => Some("it takes the layout `single`, which others are compared with"),
            _ => None,
        }
    }
}

/// The text of a configuration, for errors that state lines.
pub(super) struct Source<'a> {
    path: &'a Path,
    text: &'a str,
}

impl<'a> Source<'a> {
    pub(super) fn new(path: &'a Path, text: &'a str) -> Source<'a> {
        Source { path, text }
    }

    /// Returns the line at which a span begins, counted from 1.
    pub(super) fn line(&self, span: Option<Range<usize>>) -> usize {
        let before = span.and_then(|s| self.text.get(..s.start));
        before.map_or(1, |text| text.matches('\n').count() + 1)
    }

    pub(super) fn error(&self, span: Option<Range<usize>>, cause: impl Display) -> LabError {
        LabError::Config { file: self.path.to_owned(), line: self.line(span), cause: cause.to_string() }
    }

    pub(super) fn within(
        &self,
        value: &Spanned<u32>,
        key: &str,
        allowed: RangeInclusive<u32>,
    ) -> Result<u32, LabError> {
        let (number, [least, most]) = (*value.get_ref(), [allowed.start(), allowed.end()]);
        match allowed.contains(&number) {
            true => Ok(number),
            false => {
                Err(self.error(Some(value.span()), format!("`{key}` is {number}, not between {least} and {most}")))
            }
        }
    }

    pub(super) fn count(&self, value: &Option<Spanned<u32>>, key: &str, most: u32) -> Result<Option<u32>, LabError> {
        value.as_ref().map(|value| self.within(value, key, 1..=most)).transpose()
    }

    pub(super) fn ratio(&self, value: &Spanned<f64>, key: &str) -> Result<f64, LabError> {
        match *value.get_ref() {
            ratio if ratio >= 0.0 => Ok(ratio),
            _ => Err(self.error(Some(value.span()), format!("`{key}` is a number of at least 0"))),
        }
    }
}

fn counted_rays(source: &Source<'_>, keys: &Keys) -> Result<Option<usize>, LabError> {
    Ok(source.count(&keys.counted_rays, "counted_rays", MOST_RAYS)?.map(|n| n as usize))
}

/// The experiment `[error-vs-time]`. The keys outside of it are what its layouts are made with where it says nothing
/// else.
fn error_vs_time(source: &Source<'_>, keys: &Keys) -> Result<Option<ErrorVsTime>, LabError> {
    let Some(table) = &keys.error_vs_time else { return Ok(None) };
    if keys.fit.is_some() {
        return Err(source.error(Some(table.span()), "`fit` and `error-vs-time` cannot both be given"));
    }
    let effort = keys.effort.as_ref().map(|effort| source.within(effort, "effort", 0..=u32::from(Effort::MOST)));
    let choose = ChooseOptions {
        effort: effort.transpose()?.map_or(Effort::default(), |level| Effort::new(level as u8)),
        ranking_rays: counted_rays(source, keys)?,
        ..ChooseOptions::default()
    };
    let bake = Bake { choose, verify: verify_options(source, keys)? };
    ErrorVsTime::read(source, table.get_ref(), keys.methods.as_ref(), bake).map(Some)
}

/// The experiment `[motion]`.
fn motion(source: &Source<'_>, keys: &Keys, folder: &Path) -> Result<Option<Motion>, LabError> {
    let Some(table) = &keys.motion else { return Ok(None) };
    if keys.fit.is_some() || keys.error_vs_time.is_some() {
        return Err(source.error(Some(table.span()), "`motion` cannot be given with `fit` or `error-vs-time`"));
    }
    let common = (&verify_options(source, keys)?, counted_rays(source, keys)?);
    Motion::read(source, table.get_ref(), folder, common).map(Some)
}

/// The experiment `[flags]`.
fn flags(source: &Source<'_>, keys: &Keys) -> Result<Option<Flags>, LabError> {
    let Some(table) = &keys.flags else { return Ok(None) };
    if keys.fit.is_some() || keys.error_vs_time.is_some() || keys.motion.is_some() {
        let cause = "`flags` cannot be given with `fit`, `error-vs-time` or `motion`";
        return Err(source.error(Some(table.span()), cause));
    }
    Flags::read(source, table, &verify_options(source, keys)?).map(Some)
}

/// The layouts of an experiment that does not measure all of them, unless the configuration names some.
fn given_plans(keys: &Keys, is_fit: bool) -> Option<Vec<Plan>> {
    let are_named = keys.methods.is_some() || keys.effort.is_some();
    match () {
        () if !is_fit => Some(Vec::new()),
        () if keys.motion.is_some() && !are_named => Some([Method::Keep, Method::Single].map(of_method).into()),
        () if keys.flags.is_some() && !are_named => Some([Method::Single, Method::PerObject].map(of_method).into()),
        () => None,
    }
}

/// How layouts are timed.
fn verify_options(source: &Source<'_>, keys: &Keys) -> Result<VerifyOptions, LabError> {
    let defaults = VerifyOptions::default();
    let timed = source.count(&keys.rays, "rays", MOST_RAYS)?;
    Ok(VerifyOptions {
        device: keys.device.as_deref().map_or(defaults.device.clone(), DeviceChoice::from),
        rays_per_kind: timed.unwrap_or(defaults.rays_per_kind),
        timed_rays_per_kind: timed,
        repeats: source.count(&keys.repeats, "repeats", MOST_REPEATS)?.unwrap_or(defaults.repeats),
        seed: keys.seed.unwrap_or(defaults.seed),
        max_position_error_ratio: match &keys.max_position_error_ratio {
            Some(ratio) => source.ratio(ratio, "max_position_error_ratio")?,
            None => defaults.max_position_error_ratio,
        },
        ..defaults
    })
}

/// The scenes in the order of the list, matches of a glob sorted by name; duplicates are removed.
fn scenes(
    source: &Source<'_>,
    listed: &Spanned<Vec<Spanned<String>>>,
    folder: &Path,
) -> Result<Vec<(String, PathBuf)>, LabError> {
    let mut scenes: Vec<(String, PathBuf)> = Vec::new();
    for entry in listed.get_ref() {
        let error = |cause: String| source.error(Some(entry.span()), format!("`scenes`: {cause}"));
        for found in files(entry.get_ref(), folder).map_err(error)? {
            if !scenes.contains(&found) {
                scenes.push(found);
            }
        }
    }
    if scenes.is_empty() {
        return Err(source.error(Some(listed.span()), "`scenes` lists no scene"));
    }
    Ok(scenes)
}

/// The file of that name or, if there is none, the files that match the glob.
fn files(entry: &str, folder: &Path) -> Result<Vec<(String, PathBuf)>, String> {
    let path = folder.join(entry);
    if path.is_file() || !entry.contains(['*', '?', '[']) {
        return Ok(vec![(entry.to_owned(), path)]);
    }
    let prefix = glob::Pattern::escape(&folder.to_string_lossy());
    let pattern = if Path::new(entry).is_absolute() || prefix.is_empty() {
        entry.to_owned()
    } else {
        format!("{prefix}/{entry}")
    };
    let matches = glob::glob(&pattern).map_err(|e| format!("`{entry}` is not a glob: {e}"))?;
    let mut found: Vec<PathBuf> = matches.collect::<Result<_, _>>().map_err(|e| e.to_string())?;
    found.retain(|path| path.is_file());
    found.sort();
    if found.is_empty() {
        return Err(format!("`{entry}` matches no file"));
    }
    let name = |path: PathBuf| (path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().replace('\\', "/"), path);
    Ok(found.into_iter().map(name).collect())
}

/// The plan of a method with its default options.
fn of_method(method: Method) -> Plan {
    Plan { id: method.into(), method, options: Options::default() }
}

/// The layouts listed in `methods` or, without it, those of an effort, by default the largest.
fn chosen_plans(source: &Source<'_>, keys: &Keys) -> Result<Vec<Plan>, LabError> {
    let most = u32::from(Effort::MOST);
    let of_effort = |effort: u32| plans(Effort::new(effort as u8), &Options::default());
    let methods = match (&keys.methods, &keys.effort) {
        (Some(methods), None) => methods,
        (Some(_), Some(effort)) => {
            return Err(source.error(Some(effort.span()), "`effort` and `methods` cannot both be given"));
        }
        (None, Some(effort)) => return Ok(of_effort(source.within(effort, "effort", 0..=most)?)),
        (None, None) => return Ok(of_effort(most)),
    };
    let all = of_effort(most);
    let defaults = Method::ALL.map(of_method);
    let known: Vec<&Plan> = all.iter().chain(&defaults).collect();
    let plan = |name: &Spanned<String>| {
        let found = known.iter().find(|plan| plan.id.to_string() == *name.get_ref());
        found.map(|plan| (*plan).clone()).ok_or_else(|| {
            let mut names: Vec<String> = known.iter().map(|p| format!("`{}`", p.id)).collect();
            names.sort();
            names.dedup();
            let cause = format!("`methods`: there is no `{}`; there are {}", name.get_ref(), names.join(", "));
            source.error(Some(name.span()), cause)
        })
    };
    match methods.get_ref().is_empty() {
        true => Err(source.error(Some(methods.span()), "`methods` lists none")),
        false => methods.get_ref().iter().map(plan).collect(),
    }
}

fn class(source: &Source<'_>, name: &Spanned<String>) -> Result<Class, LabError> {
    Class::ALL.into_iter().find(|class| class.name() == name.get_ref()).ok_or_else(|| {
        let names = Class::ALL.map(|class| format!("`{}`", class.name())).join(" and ");
        source.error(Some(name.span()), format!("`class`: there is no `{}`, only {names}", name.get_ref()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a configuration in a folder with two files `a.obj` and `b.obj`.
    fn read(text: &str) -> Result<Config, String> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in ["a.obj", "b.obj"] {
            fs::write(folder.path().join(name), "").expect("writable");
        }
        let path = folder.path().join("lab.toml");
        fs::write(&path, text).expect("writable");
        Config::read(&path).map_err(|e| e.to_string().replace(&folder.path().display().to_string(), ""))
    }

    fn error(text: &str) -> String {
        read(text).err().expect("an error")
    }

    #[test]
    fn defaults_are_all_layouts_timed_as_suits_the_device() {
        let config = read("scenes = ['*.obj']\nout = 'tables'").expect("sound");
        let names: Vec<&str> = config.scenes.iter().map(|s| s.0.as_str()).collect();
        assert_eq!(names, ["a.obj", "b.obj"]);
        assert_eq!(config.plans.len(), plans(Effort::new(Effort::MOST), &Options::default()).len());
        assert_eq!(config.verify, VerifyOptions::default());
        assert_eq!((config.fit, config.skip_broken), (None, false));
        assert!(config.out.ends_with("tables"));
    }

    #[test]
    fn scenes_keep_the_order_of_the_list_and_count_once() {
        let config = read("scenes = ['b.obj', '?.obj', 'b.obj']\nout = 'x'").expect("sound");
        let names: Vec<&str> = config.scenes.iter().map(|s| s.0.as_str()).collect();
        assert_eq!(names, ["b.obj", "a.obj"]);
    }

    #[test]
    fn methods_are_methods_or_layouts_of_auto() {
        let config = read("scenes = ['a.obj']\nout = 'x'\nmethods = ['cluster', 'single', 'cluster, entry 80']");
        let config = config.expect("sound");
        let costs: Vec<f64> = config.plans.iter().map(|p| p.options.instances.entry_cost).collect();
        assert_eq!((config.plans.len(), costs[2]), (3, 80.0));
    }

    #[test]
    fn errors_name_file_line_and_key() {
        let base = "scenes = ['a.obj']\nout = 'x'\n";
        for (more, words) in [
            ("seeds = 3", "/lab.toml:3: unknown field `seeds`"),
            ("[fit]\nclasses = 'x'", "/lab.toml:4: unknown field `classes`"),
            (
                "[fit]\nclass = 'abacus'",
                "/lab.toml:4: `class`: there is no `abacus`, only `no-rt-cores` and `rt-cores`",
            ),
            ("effort = 7", "/lab.toml:3: `effort` is 7, not between 0 and 6"),
            ("repeats = 0", "/lab.toml:3: `repeats` is 0"),
            ("rays = 4294967295", "/lab.toml:3: `rays` is 4294967295, not between 1 and 16777216"),
            ("counted_rays = 16777217", "/lab.toml:3: `counted_rays` is 16777217, not between 1 and 16777216"),
            ("repeats = 1001", "/lab.toml:3: `repeats` is 1001, not between 1 and 1000"),
            ("max_position_error_ratio = nan", "/lab.toml:3: `max_position_error_ratio` is a number"),
            ("methods = ['magic']", "/lab.toml:3: `methods`: there is no `magic`; there are `bvh`"),
            ("methods = []", "/lab.toml:3: `methods` lists none"),
            ("methods = ['keep']\neffort = 2", "/lab.toml:4: `effort` and `methods`"),
            ("repeats = 'often'", "/lab.toml:3: "),
            ("seed = ", "/lab.toml:3: "),
            ("[fit]\nclass = 'no-rt-cores'", "/lab.toml:4: `fit`: it takes two scenes"),
            ("[error-vs-time]\nshininess = 3", "/lab.toml:4: unknown key `shininess` in `error-vs-time`"),
            ("[error-vs-time]\ntracers = ['f16']", "/lab.toml:4: `tracers`: there is no `f16`; there are `f32-fast`"),
            ("[error-vs-time]\nplacements = []", "/lab.toml:4: `placements` is not a value or a list of them"),
            ("[error-vs-time]\nplacements = 'away'", "/lab.toml:4: `placements`: there is no `away`"),
            ("[error-vs-time]\nerror_rays = 0", "/lab.toml:4: `error_rays` is not an integer from 1"),
            ("[error-vs-time]\neffort = [0, 7]", "/lab.toml:4: `effort` is 7, not an integer from 0 to 6"),
            ("[error-vs-time]\nframes = ['on']", "/lab.toml:4: `frames` is on, not `true` or `false`"),
            ("[error-vs-time]\nentry_cost = nan", "/lab.toml:4: `entry_cost` is not a value or a list of them"),
            ("methods = ['single, turned']\n[error-vs-time]", "/lab.toml:3: `methods`: there is no `single, turned`"),
            ("[error-vs-time]\n[fit]\nclass = 'rt-cores'", "/lab.toml:3: `fit` and `error-vs-time` cannot both"),
        ] {
            let found = error(&format!("{base}{more}"));
            assert!(found.starts_with(words), "{more}: {found}");
        }
        let without = "scenes = ['*.obj']\nout = 'x'\nmethods = ['keep']\n[fit]\nclass = 'rt-cores'";
        assert!(error(without).contains("it takes the layout `single`"), "{}", error(without));
        assert!(error("out = 'x'").contains("missing field `scenes`"));
        assert!(error("scenes = []\nout = 'x'").contains("`scenes` lists no scene"));
        assert!(error("out = 'x'\nscenes = ['*.glb']").starts_with("/lab.toml:2: `scenes`: `*.glb` matches no file"));
    }
}
