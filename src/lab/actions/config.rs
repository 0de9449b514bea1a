//! The file that lists actions.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;

use crate::lab::LabError;
use crate::lab::config::Source;
use crate::lab::thesis_files::{Section, SettingsFile, Sort, read_sections};

/// An action.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(super) enum Action {
    /// Writes scenes with instances.
    Generate(GenerateKeys),
    /// Measures environments on scenes.
    Run(RunKeys),
    /// Draws what was measured.
    Plot(PlotKeys),
}

/// The keys of `generate`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GenerateKeys {
    /// Scene files, TOML files, or names of sections of this file.
    pub(super) scenes: Vec<String>,
    pub(super) params: Params,
}

/// What to generate; named as in the thesis, where it has names.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Params {
    /// Indices into `scenes`.
    pub(super) model_mask: Vec<usize>,
    /// Numbers of instances.
    pub(super) n_all: Vec<u64>,
    /// How many of each of these are animated.
    pub(super) n_anim_all: Vec<u64>,
    /// Speed in scene units per second, and its deviation.
    pub(super) v: Option<f64>,
    pub(super) v_dev: Option<f64>,
    /// Distance in scene units, and its deviation.
    pub(super) d: Option<f64>,
    pub(super) d_dev: Option<f64>,
    /// Turns per second, and their deviation.
    #[serde(default)]
    pub(super) turns: f64,
    #[serde(default)]
    pub(super) turns_dev: f64,
    pub(super) seed: Option<u64>,
}

/// The keys of `run`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RunKeys {
    /// Scene files, TOML files, or names of sections of this file.
    pub(super) scenes: Vec<String>,
    /// Environments, in the same way.
    pub(super) envs: Vec<String>,
    /// Seconds that a run is timed for.
    pub(super) seconds: Option<f64>,
    /// Passes over the picture that a run is timed for, instead of seconds.
    pub(super) passes: Option<u32>,
    /// Frames of scenes with instances that move; 0 for none.
    pub(super) frames: Option<u32>,
    pub(super) seed: Option<u64>,
    pub(super) device: Option<String>,
    /// Degrees Celsius to which the GPU cools down before each run.
    pub(super) max_temperature: Option<f64>,
    /// Seconds after which a run begins even if the GPU is warmer.
    pub(super) cooling_timeout: Option<f64>,
    /// Views of which a picture is drawn after each run.
    #[serde(default)]
    pub(super) pictures: Vec<String>,
}

/// The keys of `plot`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlotKeys {
    /// Names of the scenes to show; without them, all that were run.
    #[serde(default)]
    pub(super) scenes: Vec<String>,
    /// Names of the environments, in the same way.
    #[serde(default)]
    pub(super) envs: Vec<String>,
    /// Tables (`runs.jsonl`) of earlier runs.
    #[serde(default)]
    pub(super) logs: Vec<PathBuf>,
    pub(super) plot_type: PlotType,
    pub(super) plot_metadata: Metadata,
}

/// The kind of a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum PlotType {
    Bar,
    Line,
}

/// What a plot shows.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Metadata {
    pub(super) title: String,
    pub(super) x_label: Option<String>,
    pub(super) y_label: Option<String>,
    /// Name of the files, without extension.
    pub(super) output: String,
    /// The column to show.
    pub(super) value_data: String,
    /// The column whose values stand beside each other; `scene` by default.
    pub(super) x_data: Option<String>,
    /// The column of the series; `environment` by default.
    pub(super) series_data: Option<String>,
}

/// An action with the line at which it begins.
#[derive(Clone, Debug)]
pub(super) struct Listed {
    pub(super) what: Action,
    pub(super) line: usize,
}

/// A file that lists actions.
pub(super) struct Actions {
    pub(super) path: PathBuf,
    pub(super) out: PathBuf,
    pub(super) actions: Vec<Listed>,
    /// Sections of the file.
    scenes: Vec<SettingsFile>,
    environments: Vec<SettingsFile>,
}

/// A scene that an action generates.
#[derive(Clone, Debug)]
pub(super) struct Generated {
    /// The name of its file in the folder of results.
    pub(super) file_name: String,
    pub(super) scene: SettingsFile,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InJson {
    out: Option<PathBuf>,
    actions: Vec<Action>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InToml {
    out: Option<PathBuf>,
    actions: Vec<Spanned<toml::Value>>,
    #[serde(default)]
    scene: Vec<Spanned<Section>>,
    #[serde(default)]
    env: Vec<Spanned<Section>>,
}

/// Whether a file lists actions: it is JSON, or TOML with a key `actions`.
pub fn lists_actions(file: &Path) -> bool {
    match file.extension().and_then(|e| e.to_str()) {
        Some("json") => true,
        _ => fs::read_to_string(file)
            .is_ok_and(|text| text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("actions"))),
    }
}

impl Actions {
    /// Reads a file; paths in it are relative to its folder.
    ///
    /// # Errors
    /// Fails if the file cannot be read, or on the first key that is wrong; the error names file, line and cause.
    pub(super) fn read(path: &Path) -> Result<Actions, LabError> {
        let text = fs::read_to_string(path).map_err(|e| LabError::file(path, e))?;
        let mut actions = if path.extension().is_some_and(|e| e == "json") {
            Actions::of_json(path, &text)?
        } else {
            Actions::of_toml(path, &text)?
        };
        actions.out = path.parent().unwrap_or(Path::new("")).join(actions.out);
        Ok(actions)
    }

    fn new(path: &Path, out: Option<PathBuf>, actions: Vec<Listed>) -> Actions {
        let stem = || PathBuf::from(path.file_stem().unwrap_or_default()).join("");
        let out = out.unwrap_or_else(|| PathBuf::from(format!("{}-results", stem().display()).replace('/', "")));
        Actions { path: path.to_owned(), out, actions, scenes: Vec::new(), environments: Vec::new() }
    }

    fn of_json(path: &Path, text: &str) -> Result<Actions, LabError> {
        let read: InJson = serde_json::from_str(text).map_err(|e| LabError::Config {
            file: path.to_owned(),
            line: e.line().max(1),
            cause: e.to_string(),
        })?;
        let mut from = 0;
        let listed = |what: Action| {
            // JSON values do not know their lines: each action states its type once.
            from += text[from..].find("\"type\"").map_or(0, |at| at + 1);
            Listed { what, line: text[..from].matches('\n').count() + 1 }
        };
        Ok(Actions::new(path, read.out, read.actions.into_iter().map(listed).collect()))
    }

    fn of_toml(path: &Path, text: &str) -> Result<Actions, LabError> {
        let source = Source::new(path, text);
        let read: InToml = toml::from_str(text).map_err(|e| source.error(e.span(), e.message()))?;
        let listed = |action: Spanned<toml::Value>| {
            let span = action.span();
            let what = Action::deserialize(action.into_inner());
            let what = what.map_err(|e| source.error(Some(span.clone()), e.message()))?;
            Ok(Listed { what, line: source.line(Some(span)) })
        };
        let actions = read.actions.into_iter().map(listed).collect::<Result<_, LabError>>()?;
        Ok(Actions {
            scenes: read_sections(&source, path, Sort::Scene, &read.scene)?,
            environments: read_sections(&source, path, Sort::Environment, &read.env)?,
            ..Actions::new(path, read.out, actions)
        })
    }

    /// Returns an error of an action.
    pub(super) fn error(&self, action: &Listed, cause: impl std::fmt::Display) -> LabError {
        LabError::Config { file: self.path.clone(), line: action.line, cause: cause.to_string() }
    }

    /// Returns the scenes of a list: sections of the file by their names, `generated` ones by the names of their files, `.scn`
    /// files, and all sections of `.toml` files.
    ///
    /// # Errors
    /// Fails if one is missing or wrong.
    pub(super) fn scenes(
        &self,
        action: &Listed,
        names: &[String],
        generated: &[Generated],
    ) -> Result<Vec<SettingsFile>, LabError> {
        let known = |name: &String| generated.iter().find(|of| of.file_name == *name).map(|of| &of.scene);
        self.named(Sort::Scene, action, names, &known)
    }

    /// Returns the environments of a list, in the same way.
    ///
    /// # Errors
    /// Fails if one is missing or wrong.
    pub(super) fn environments(&self, action: &Listed, names: &[String]) -> Result<Vec<SettingsFile>, LabError> {
        self.named(Sort::Environment, action, names, &|_| None)
    }

    fn named<'a>(
        &'a self,
        sort: Sort,
        action: &Listed,
        names: &[String],
        known: &dyn Fn(&String) -> Option<&'a SettingsFile>,
    ) -> Result<Vec<SettingsFile>, LabError> {
        if names.is_empty() {
            return Err(self.error(action, format!("the list of {}s is empty", sort.section())));
        }
        let (sections, key) = match sort {
            Sort::Scene => (&self.scenes, "scene_name"),
            Sort::Environment => (&self.environments, "environment_name"),
        };
        let mut found = Vec::new();
        for name in names {
            let path = self.path.parent().unwrap_or(Path::new("")).join(name);
            let section = sections.iter().find(|section| section.in_words(key).as_ref() == Some(name));
            match section.or_else(|| known(name)) {
                Some(of) => found.push(of.clone()),
                None if name.ends_with(".toml") => found.extend(sections_of(sort, &path)?),
                None if path.extension().is_some_and(|e| e.eq_ignore_ascii_case(sort.extension())) => {
                    found.push(SettingsFile::read(&path)?);
                }
                None => {
                    let cause = format!("`{name}` is neither a section nor a .{} or .toml file", sort.extension());
                    return Err(self.error(action, cause));
                }
            }
        }
        Ok(found)
    }
}

#[derive(Deserialize)]
struct OnlySections {
    #[serde(default)]
    scene: Vec<Spanned<Section>>,
    #[serde(default)]
    env: Vec<Spanned<Section>>,
}

fn sections_of(sort: Sort, path: &Path) -> Result<Vec<SettingsFile>, LabError> {
    let text = fs::read_to_string(path).map_err(|e| LabError::file(path, e))?;
    let source = Source::new(path, &text);
    let read: OnlySections = toml::from_str(&text).map_err(|e| source.error(e.span(), e.message()))?;
    let sections = if sort == Sort::Scene { read.scene } else { read.env };
    match sections.is_empty() {
        true => Err(LabError::file(path, format!("there is no section `[[{}]]`", sort.section()))),
        false => read_sections(&source, path, sort, &sections),
    }
}
