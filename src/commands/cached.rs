//! Results of bakes that are kept in a [`Store`]: what decides a result, looking it up, keeping it.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use raykiln_formats::document::{self, Staged};
use raykiln_formats::{Error, ObjOptions, Outline};

use crate::cache::{Key, KeyBuilder, Part, Store};
use crate::choose::Choice;
use crate::commands::bake::BakeOptions;
use crate::verify::{DeviceChoice, DeviceError, Machine, MachineKind};

/// What the bytes of a result depend on besides the files: bakes of other versions or processors may round or decide
/// otherwise. Whoever builds a version of their own names it in the environment variable `RAYKILN_BUILD` of the compiler.
const PROGRAM: [&str; 5] = [
    "raykiln bake",
    env!("CARGO_PKG_VERSION"),
    match option_env!("RAYKILN_BUILD") {
        Some(build) => build,
        None => "",
    },
    std::env::consts::ARCH,
    std::env::consts::OS,
];
/// Part with the scene file of the output.
const SCENE: &str = "scene";
/// Start of the name of a part with another file of the output.
const BESIDE: &str = "beside/";
/// Start of the name of a part with a report.
const REPORT: &str = "report/";
/// A report is read into memory only up to this size in bytes.
const MOST_REPORT: u64 = 1 << 30;

/// What decides the result of a bake.
#[derive(Clone, Debug)]
pub struct Decides<'a> {
    /// The scene.
    pub input: &'a Path,
    /// Where the result is to be put.
    pub output: &'a Path,
    /// Every option that decides what is written, by its long name, with its values.
    pub options: &'a BTreeMap<String, Vec<String>>,
    /// How an OBJ file is read: where its files are sought.
    pub obj: ObjOptions,
    /// The device that decides, see [`deciding_device`].
    pub device: &'a str,
    /// The plan that is followed, if any.
    pub plan: Option<&'a Path>,
    /// The reports that are wanted besides JSON. They name the files, which therefore decide, too.
    pub reports: &'a [&'a str],
}

/// What stands for the CPU as a device.
pub const CPU: &str = "cpu";

/// Returns what identifies the device that is chosen: its name and driver, or [`CPU`].
///
/// # Errors
/// Fails if a requested device does not exist or cannot trace rays.
pub fn device(choice: &DeviceChoice) -> Result<String, DeviceError> {
    if *choice == DeviceChoice::Cpu {
        return Ok(CPU.into());
    }
    let machine = Machine::open(choice)?;
    Ok(match machine.name() {
        (_, MachineKind::Cpu) => CPU.into(),
        (name, _) => format!("{name}, {}", machine.driver()),
    })
}

/// Whether the measurements of a device may decide what is written: not if a method is asked for, or the decision is known.
pub fn is_decided_by_device(options: &BakeOptions) -> bool {
    options.choose.method == Choice::Auto && options.choose.decided.is_none()
}

/// Returns what identifies the device if its measurements decide what is written; empty otherwise. The CPU's times decide
/// nothing, so that machines without a GPU are alike.
///
/// # Errors
/// Fails if a requested device does not exist or cannot trace rays.
pub fn deciding_device(options: &BakeOptions) -> Result<String, DeviceError> {
    if is_decided_by_device(options) { device(&options.verify.device) } else { Ok(String::new()) }
}

impl Decides<'_> {
    /// Returns the key of the result: the hash of everything that decides it, with the content of each file that the scene
    /// consists of. Also returns these files.
    ///
    /// # Errors
    /// Fails if the scene's file cannot be read.
    pub fn key(&self) -> Result<(Key, Outline), Error> {
        let outline = raykiln_formats::outline_with(self.input, &self.obj)?;
        let mut key = KeyBuilder::default();
        PROGRAM.iter().for_each(|part| _ = key.add(part));
        key.add(self.device);
        for (option, values) in self.options {
            key.add(option).add((values.len() as u64).to_le_bytes());
            values.iter().for_each(|value| _ = key.add(value));
        }
        self.add_files(&mut key, &outline)?;
        self.add_names(&mut key, &outline);
        Ok((key.finish(), outline))
    }

    /// Adds the content of all files.
    fn add_files(&self, key: &mut KeyBuilder, outline: &Outline) -> Result<(), Error> {
        let folder = folder_of(self.input);
        let files = [self.input].into_iter().chain(outline.files.iter().map(PathBuf::as_path));
        for file in files.chain(self.plan).filter(|file| *file == self.input || file.is_file()) {
            let is_scene = file == self.input;
            let name = if is_scene { Path::new("") } else { file.strip_prefix(folder).unwrap_or(file) };
            key.add(name.as_os_str().as_encoded_bytes());
            key.add_file(file).map_err(|e| Error::io(file, "", &e))?;
        }
        Ok(())
    }

    /// Adds the names of the files, as far as the result depends on them.
    fn add_names(&self, key: &mut KeyBuilder, outline: &Outline) {
        let extension = |path: &Path| path.extension().unwrap_or_default().to_ascii_lowercase();
        key.add(extension(self.input).as_encoded_bytes()).add(extension(self.output).as_encoded_bytes());
        if !outline.files.is_empty() || extension(self.output) == OsStr::new("gltf") {
            let [from, to] = [self.input, self.output].map(|path| fs::canonicalize(folder_of(path)).ok());
            key.add(self.output.file_name().unwrap_or_default().as_encoded_bytes()).add([u8::from(from == to)]);
        }
        if !self.reports.is_empty() {
            self.reports.iter().for_each(|report| _ = key.add(report));
            key.add(self.input.as_os_str().as_encoded_bytes()).add(self.output.as_os_str().as_encoded_bytes());
        }
    }
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A result that was found.
#[derive(Debug)]
pub struct Hit {
    /// The output, not yet in place.
    pub staged: Staged,
    /// Its reports by name, as they were stored.
    pub reports: BTreeMap<String, String>,
}

/// Looks up a result and stages its files. `None` if there is none, or it cannot be put beside what is there; a damaged
/// result is removed.
///
/// # Errors
/// Fails if the output cannot be written.
pub fn look_up(store: &Store, key: &Key, output: &Path) -> Result<Option<Hit>, Error> {
    let Some(mut entry) = store.get(key) else { return Ok(None) };
    let parts = entry.parts.clone();
    let beside = parts.iter().filter_map(|part| part.name.strip_prefix(BESIDE));
    if !beside.map(Path::new).all(|name| document::can_hold(output, name)) {
        return Ok(None);
    }
    let mut hit = Hit { staged: Staged::begin(output)?, reports: BTreeMap::new() };
    // What cannot be read is like what is not there; what cannot be written is found when the bake writes it.
    let read = parts.iter().try_for_each(|part| hit.take(part, &mut entry, output)).is_ok();
    if read && entry.finish().unwrap_or(false) {
        return Ok(Some(hit));
    }
    store.discard(key);
    Ok(None)
}

impl Hit {
    /// Takes the next part of an entry.
    fn take(&mut self, part: &Part, entry: &mut crate::cache::Entry, output: &Path) -> io::Result<()> {
        if let Some(report) = part.name.strip_prefix(REPORT) {
            let mut text = Vec::new();
            entry.copy(part.bytes.min(MOST_REPORT), &mut text)?;
            let text = String::from_utf8(text).map_err(io::Error::other)?;
            self.reports.insert(report.to_owned(), text);
            return Ok(());
        }
        let name = match part.name.strip_prefix(BESIDE) {
            Some(name) => Path::new(name),
            None => Path::new(output.file_name().unwrap_or_default()),
        };
        self.staged.add(name, |to| entry.copy(part.bytes, to)).map_err(io::Error::other)
    }
}

/// Keeps a result: the files of an output that is not in place yet, and its reports by name.
///
/// # Errors
/// Fails if the store cannot be written to.
pub fn keep(store: &Store, key: &Key, staged: &Staged, reports: &[(&str, &str)]) -> io::Result<()> {
    let mut parts: Vec<Part> =
        reports.iter().map(|(name, text)| Part { name: format!("{REPORT}{name}"), bytes: text.len() as u64 }).collect();
    let mut files = Vec::new();
    for (from, name) in staged.named_files() {
        let is_scene = from == staged.path();
        let beside = || name.to_str().map(|name| format!("{BESIDE}{name}"));
        let name = if is_scene { Some(SCENE.to_owned()) } else { beside() };
        let name = name.ok_or_else(|| io::Error::other("a file name is not UTF-8"))?;
        parts.push(Part { name, bytes: fs::metadata(from)?.len() });
        files.push(from);
    }
    store.put(key, &parts, |to| {
        reports.iter().try_for_each(|(_, text)| to.write_all(text.as_bytes()))?;
        files.iter().try_for_each(|file| io::copy(&mut File::open(file)?, to).map(drop))
    })
}
