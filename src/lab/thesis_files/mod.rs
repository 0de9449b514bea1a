//! Scene files (`.scn`) and environment files (`.env`) of T. Bilák, "Scene optimization for RTX", master's thesis, Czech
//! Technical University in Prague, 2024, tables 4.1 and 4.2, and the same as sections of TOML.
//!
//! A [`SettingsFile`] is what such a file says, key by key; `setup` gives the keys their meaning.

mod convert;
mod keys;
mod lines;
mod sections;

use std::path::{Component, Path, PathBuf};

pub use convert::{Converted, convert};
pub(super) use keys::{MOST_INSTANCES, Value, keys_of};
pub(super) use sections::{Section, read_sections};

use super::LabError;
use super::error_vs_time::Value as OptionValue;
use crate::motion::{Animation, PlacedCopies};
use keys::Key;

/// What a file describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sort {
    /// A scene: models, camera, light and instances.
    Scene,
    /// An environment: method, build flags and picture.
    Environment,
}

impl Sort {
    pub(super) const ALL: [Sort; 2] = [Sort::Scene, Sort::Environment];

    /// Returns the extension of its files.
    pub(super) fn extension(self) -> &'static str {
        match self {
            Sort::Scene => "scn",
            Sort::Environment => "env",
        }
    }

    /// Returns the name of its sections in TOML.
    pub(super) fn section(self) -> &'static str {
        match self {
            Sort::Scene => "scene",
            Sort::Environment => "env",
        }
    }

    /// Returns what a file is by its extension.
    fn of(path: &Path) -> Option<Sort> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Sort::ALL.into_iter().find(|sort| sort.extension() == extension)
    }
}

/// Largest number of combinations of values.
const MOST_COMBINATIONS: usize = 100_000;

/// A key with its values.
#[derive(Clone, Debug)]
struct Entry {
    key: &'static Key,
    /// Several are a sweep.
    values: Vec<Value>,
    /// The line of the file.
    line: usize,
}

/// What a scene or environment file says.
#[derive(Clone, Debug)]
pub(super) struct SettingsFile {
    sort: Sort,
    /// For paths in it and for errors.
    path: PathBuf,
    /// The line at which it begins.
    line: usize,
    /// In the order of the table of the thesis.
    entries: Vec<Entry>,
    /// Options of methods and tracers that the thesis's files do not have, with their values and lines; only of TOML.
    pub(super) options: Vec<(String, Vec<OptionValue>, usize)>,
    /// Where instances stand, in scene units.
    pub(super) positions: Vec<[f64; 3]>,
    /// How the first instances move.
    pub(super) animations: Vec<Animation>,
}

impl PartialEq for SettingsFile {
    /// Whether they say the same; where they say it does not matter.
    fn eq(&self, other: &SettingsFile) -> bool {
        let entries = |of: &SettingsFile| of.entries.iter().map(|e| (e.key.name, e.values.clone())).collect::<Vec<_>>();
        let options = |of: &SettingsFile| of.options.iter().map(|(n, v, _)| (n.clone(), v.clone())).collect::<Vec<_>>();
        self.sort == other.sort
            && entries(self) == entries(other)
            && options(self) == options(other)
            && self.positions == other.positions
            && self.animations == other.animations
    }
}

impl SettingsFile {
    fn new(sort: Sort, path: &Path, line: usize) -> SettingsFile {
        let (path, entries) = (path.to_owned(), Vec::new());
        SettingsFile { sort, path, line, entries, options: Vec::new(), positions: Vec::new(), animations: Vec::new() }
    }

    /// Reads a `.scn` or `.env` file.
    ///
    /// # Errors
    /// Fails if the file cannot be read, or on the first line that is wrong; the error names file, line and cause.
    pub(super) fn read(path: &Path) -> Result<SettingsFile, LabError> {
        let sort = Sort::of(path).ok_or_else(|| LabError::file(path, "is neither a .scn nor an .env file"))?;
        let text = std::fs::read_to_string(path).map_err(|e| LabError::file(path, e))?;
        lines::parse(sort, path, &text).map(|(file, _)| file)
    }

    /// Returns an error at a line of the file.
    pub(super) fn error(&self, line: usize, cause: impl std::fmt::Display) -> LabError {
        LabError::Config { file: self.path.clone(), line, cause: cause.to_string() }
    }

    /// Returns the line of a key, or that at which everything begins.
    pub(super) fn line_of(&self, name: &str) -> usize {
        self.entry(name).map_or(self.line, |entry| entry.line)
    }

    /// Returns the path of a file that it names.
    pub(super) fn beside(&self, name: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(name)
    }

    fn entry(&self, name: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.key.name == name)
    }

    /// Returns what the file describes, for names of files: that of a `.scn` or `.env` file, or else the name of the scene.
    pub(super) fn stem(&self) -> String {
        let of_path =
            |path: &Path| path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        match (Sort::of(&self.path), self.values("SCENE_NAME"), self.values("MODEL_FILE_NAME")) {
            (None, [Value::Text(name)], _) => name.clone(),
            (None, _, [Value::Text(model)]) => of_path(Path::new(model)),
            _ => of_path(&self.path),
        }
    }

    /// Returns a scene with a name and with other instances.
    pub(super) fn with_instances(&self, name: String, copies: PlacedCopies) -> SettingsFile {
        let PlacedCopies { positions, animations } = copies;
        let mut scene = self.clone();
        scene.set("SCENE_NAME", Value::Text(name));
        scene.set("INSTANCE_COUNT", Value::Whole(positions.len() as u64));
        scene.set("ANIM_INSTANCE_COUNT", Value::Whole(animations.len() as u64));
        scene.positions = positions.iter().map(|position| position.to_array()).collect();
        scene.animations = animations;
        scene
    }

    /// Writes a scene as a `.scn` file in a folder; paths of models are then relative to it.
    ///
    /// # Errors
    /// Fails if a model cannot be found, if lines cannot state something, or if the file cannot be written.
    pub(super) fn write_scene(&self, folder: &Path, name: &str) -> Result<PathBuf, LabError> {
        let failed = |at: &Path, e: std::io::Error| LabError::file(at, e);
        let real_folder = folder.canonicalize().map_err(|e| failed(folder, e))?;
        let mut scene = self.clone();
        for key in ["MODEL_FILE_NAME", "INSTANCE_FILE_NAME"] {
            if let [Value::Text(model)] = self.values(key) {
                let model = self.beside(model);
                let real = model.canonicalize().map_err(|e| failed(&model, e))?;
                scene.set(key, Value::Text(relative(&real_folder, &real).display().to_string()));
            }
        }
        let path = folder.join(name);
        std::fs::write(&path, lines::write(&scene)?).map_err(|e| failed(&path, e))?;
        Ok(path)
    }

    /// Sets a key to one value.
    fn set(&mut self, name: &str, value: Value) {
        match self.entries.iter_mut().find(|entry| entry.key.name == name) {
            Some(entry) => entry.values = vec![value],
            None => {
                let key = Key::named(self.sort, name).unwrap_or_else(|| unreachable!("`{name}` is a key"));
                self.insert(Entry { key, values: vec![value], line: self.line });
            }
        }
    }

    /// Returns the values of a key; none if it is not given.
    pub(super) fn values(&self, name: &str) -> &[Value] {
        self.entry(name).map_or(&[], |entry| &entry.values)
    }

    /// Returns one file for each combination of values, in their order; the last key changes fastest.
    ///
    /// # Errors
    /// Fails if there are too many.
    pub(super) fn combinations(&self) -> Result<Vec<SettingsFile>, LabError> {
        let lengths: Vec<usize> =
            self.entries.iter().map(|e| e.values.len()).chain(self.options.iter().map(|o| o.1.len())).collect();
        let count = lengths.iter().try_fold(1usize, |all, n| all.checked_mul(*n)).filter(|n| *n <= MOST_COMBINATIONS);
        let count = count.ok_or_else(|| {
            self.error(self.line, format!("the lists have more than {MOST_COMBINATIONS} combinations"))
        })?;
        Ok((0..count).map(|number| self.combination(number)).collect())
    }

    fn combination(&self, mut number: usize) -> SettingsFile {
        let mut one = self.clone();
        let mut take = |length: usize| {
            let chosen = number % length;
            number /= length;
            chosen
        };
        for (_, values, _) in one.options.iter_mut().rev() {
            *values = vec![values[take(values.len())].clone()];
        }
        for entry in one.entries.iter_mut().rev() {
            entry.values = vec![entry.values[take(entry.values.len())].clone()];
        }
        one
    }

    /// Returns the names of what has several values, as in TOML.
    pub(super) fn swept(&self) -> Vec<String> {
        let keys = self.entries.iter().filter(|entry| entry.values.len() > 1).map(|entry| entry.key.in_toml());
        keys.chain(self.options.iter().filter(|o| o.1.len() > 1).map(|o| o.0.clone())).collect()
    }

    /// Returns the first value of a name as in TOML, in words; `None` if it is not given.
    pub(super) fn in_words(&self, name: &str) -> Option<String> {
        let key = self.entries.iter().find(|entry| entry.key.in_toml() == name);
        let option = || self.options.iter().find(|option| option.0 == name).map(|option| option.1[0].to_string());
        key.map(|entry| entry.values[0].to_string()).or_else(option)
    }

    /// Adds a key, in the order of the table.
    fn add(&mut self, entry: Entry) -> Result<(), LabError> {
        if let Some(first) = self.entry(entry.key.name) {
            let cause = format!("`{}` is given twice, first in line {}", entry.key.name, first.line);
            return Err(self.error(entry.line, cause));
        }
        self.insert(entry);
        Ok(())
    }

    /// Inserts a key in the order of the table.
    fn insert(&mut self, entry: Entry) {
        let place = |key: &Key| keys_of(self.sort).iter().position(|of| of.name == key.name);
        let at = self.entries.partition_point(|other| place(other.key) < place(entry.key));
        self.entries.insert(at, entry);
    }

    /// Checks what concerns several keys.
    ///
    /// # Errors
    /// Fails if numbers of instances disagree with the lists, or build flags with each other.
    fn checked(self) -> Result<SettingsFile, LabError> {
        for (name, what, listed) in [
            ("INSTANCE_COUNT", "positions", self.positions.len()),
            ("ANIM_INSTANCE_COUNT", "animations", self.animations.len()),
        ] {
            let Some([Value::Whole(count)]) = self.entry(name).map(|entry| entry.values.as_slice()) else { continue };
            if listed > 0 && *count != listed as u64 {
                let cause = format!("`{name}` is {count}, but the file lists {listed} {what}");
                return Err(self.error(self.line_of(name), cause));
            }
        }
        if let ([Value::Whole(animated)], [Value::Whole(all)]) =
            (self.values("ANIM_INSTANCE_COUNT"), self.values("INSTANCE_COUNT"))
            && animated > all
        {
            let cause = format!("`ANIM_INSTANCE_COUNT` is {animated}, more than the {all} of `INSTANCE_COUNT`");
            return Err(self.error(self.line_of("ANIM_INSTANCE_COUNT"), cause));
        }
        Ok(self)
    }
}

/// Returns the way from a folder to a file, both without links; the file itself if they have nothing in common.
fn relative(folder: &Path, file: &Path) -> PathBuf {
    let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return file.to_owned();
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    up.chain(file.components().skip(common)).collect()
}
