//! The files that a report is written to: staged in hidden folders beside their places, then renamed.

use std::borrow::Cow;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use raykiln_formats::staging::{Folder, Hold};

/// What a report or a plan is written as, by the extension of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Json,
    /// A page of HTML.
    Page,
    /// Findings as SARIF.
    Sarif,
}

impl Format {
    const ALL: [Format; 3] = [Format::Json, Format::Page, Format::Sarif];

    /// The extension of its files.
    pub(super) fn extension(self) -> &'static str {
        match self {
            Format::Json => "json",
            Format::Page => "html",
            Format::Sarif => "sarif",
        }
    }

    fn is_of(self, file: &Path) -> bool {
        file.extension().is_some_and(|e| e.eq_ignore_ascii_case(self.extension()))
    }
}

/// Files that a report or a plan can be written to.
pub(super) struct Reports<'a> {
    option: &'static str,
    files: &'a [PathBuf],
}

impl<'a> Reports<'a> {
    /// Rejects files that cannot be written, before any work is done. `taken` are the command's other files.
    pub(super) fn check(files: &'a [PathBuf], taken: &[&Path]) -> Result<Self> {
        Reports::check_option("--report", files, &Format::ALL, taken)
    }

    /// Rejects a plan that cannot be written.
    pub(super) fn check_plan(file: &'a Option<PathBuf>, taken: &[&Path]) -> Result<Self> {
        Reports::check_option("--write-plan", file.as_slice(), &[Format::Json], taken)
    }

    fn check_option(option: &'static str, files: &'a [PathBuf], formats: &[Format], taken: &[&Path]) -> Result<Self> {
        for file in files {
            check(file, formats, taken).with_context(|| format!("{option} {}", file.display()))?;
        }
        Ok(Reports { option, files })
    }

    /// Rejects a depfile that cannot be written.
    pub(super) fn check_depfile(file: &'a Option<PathBuf>, taken: &[&Path]) -> Result<Self> {
        let (option, files) = ("--depfile", file.as_slice());
        for file in files {
            check_place(file, taken).with_context(|| format!("{option} {}", file.display()))?;
        }
        Ok(Reports { option, files })
    }

    /// Writes a text to all files, whatever their format, but does not put them in place yet.
    pub(super) fn stage_text(&self, text: &str) -> Result<StagedReports> {
        self.files.iter().map(|file| self.stage_file(file, text)).collect::<Result<_>>().map(StagedReports)
    }

    fn stage_file(&self, file: &Path, text: &str) -> Result<Staged> {
        let written = Staged::new(file).and_then(|of| fs::write(&of.from, text.as_bytes()).map(|()| of));
        written.with_context(|| format!("{} {}: cannot be written", self.option, file.display()))
    }

    /// Whether a file has a format.
    pub(super) fn have(&self, format: Format) -> bool {
        self.files.iter().any(|file| format.is_of(file))
    }

    /// Writes a report to all files, but does not put them in place yet. `text` is called once for each format that a file
    /// has.
    pub(super) fn stage<'t>(&self, text: impl Fn(Format) -> Cow<'t, str>) -> Result<StagedReports> {
        let mut staged = Vec::new();
        for format in Format::ALL.into_iter().filter(|format| self.have(*format)) {
            let text = text(format);
            for file in self.files.iter().filter(|file| format.is_of(file)) {
                staged.push(self.stage_file(file, &text)?);
            }
        }
        Ok(StagedReports(staged))
    }
}

/// Report files that are written but not in place. Dropping them without [`StagedReports::commit`] removes them.
pub(super) struct StagedReports(Vec<Staged>);

impl StagedReports {
    /// Renames the files to their final names.
    pub(super) fn commit(self) -> Result<()> {
        let _hold = Hold::new();
        for Staged { from, to, .. } in &self.0 {
            fs::rename(from, to).with_context(|| format!("{}: cannot be put in place", to.display()))?;
        }
        Ok(())
    }
}

struct Staged {
    from: PathBuf,
    to: PathBuf,
    /// The hidden folder that holds `from`.
    _folder: Folder,
}

impl Staged {
    fn new(file: &Path) -> io::Result<Staged> {
        // Keeps a symbolic link and replaces its target.
        let to = fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
        let folder = Folder::new_in(folder_of(&to))?;
        Ok(Staged { from: folder.path().join("report.json"), to, _folder: folder })
    }
}

fn check(file: &Path, formats: &[Format], taken: &[&Path]) -> Result<()> {
    let is_known = formats.iter().any(|format| format.is_of(file));
    let extensions: Vec<&str> = formats.iter().map(|format| format.extension()).collect();
    ensure!(is_known, "only files with the extension .{} can be written", extensions.join(" or ."));
    check_place(file, taken)
}

/// Rejects a file that cannot be written, whatever its format.
fn check_place(file: &Path, taken: &[&Path]) -> Result<()> {
    let folder = folder_of(file);
    ensure!(folder.is_dir(), "there is no folder {}", folder.display());
    ensure!(!file.is_dir(), "is a folder");
    ensure!(file.is_file() || !file.exists(), "is not a regular file");
    let place = place(file);
    ensure!(!taken.iter().any(|other| self::place(other) == place), "is the scene itself");
    Staged::new(file).with_context(|| format!("the folder {} cannot be written to", folder.display()))?;
    Ok(())
}

/// The file that a path leads to, whether it exists or not.
fn place(file: &Path) -> PathBuf {
    let of_folder = || Some(fs::canonicalize(folder_of(file)).ok()?.join(file.file_name()?));
    fs::canonicalize(file).ok().or_else(of_folder).unwrap_or_else(|| file.to_owned())
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
