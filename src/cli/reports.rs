//! The files that a report is written to: staged in hidden folders beside their places, then renamed.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use raykiln_formats::staging::{Folder, Hold};

/// Files that a report or a plan can be written to.
pub(super) struct Reports<'a> {
    option: &'static str,
    files: &'a [PathBuf],
}

impl<'a> Reports<'a> {
    /// Rejects files that cannot be written, before any work is done. `taken` are the command's other files.
    pub(super) fn check(files: &'a [PathBuf], taken: &[&Path]) -> Result<Self> {
        Reports::check_option("--report", files, &["json", "html"], taken)
    }

    /// Rejects files that findings cannot be written to.
    pub(super) fn check_sarif(files: &'a [PathBuf], taken: &[&Path]) -> Result<Self> {
        Reports::check_option("--report", files, &["sarif"], taken)
    }

    /// Rejects a plan that cannot be written.
    pub(super) fn check_plan(file: &'a Option<PathBuf>, taken: &[&Path]) -> Result<Self> {
        Reports::check_option("--write-plan", file.as_slice(), &["json"], taken)
    }

    fn check_option(option: &'static str, files: &'a [PathBuf], extensions: &[&str], taken: &[&Path]) -> Result<Self> {
        for file in files {
            check(file, extensions, taken).with_context(|| format!("{option} {}", file.display()))?;
        }
        Ok(Reports { option, files })
    }

    /// Whether a file is to be a page.
    pub(super) fn have_page(&self) -> bool {
        self.files.iter().any(|file| is_page(file))
    }

    /// Writes a report to all files, but does not put them in place yet. `page` is called if a file is to be a page.
    pub(super) fn stage(&self, json: &str, page: impl FnOnce() -> String) -> Result<StagedReports> {
        let page = self.have_page().then(page).unwrap_or_default();
        let stage = |file: &PathBuf| {
            let text = if is_page(file) { &page } else { json };
            let staged = Staged::new(file).and_then(|staged| fs::write(&staged.from, text).map(|()| staged));
            staged.with_context(|| format!("{} {}: cannot be written", self.option, file.display()))
        };
        Ok(StagedReports(self.files.iter().map(stage).collect::<Result<_>>()?))
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

fn check(file: &Path, extensions: &[&str], taken: &[&Path]) -> Result<()> {
    let is_known = extensions.iter().any(|extension| has_extension(file, extension));
    ensure!(is_known, "only files with the extension .{} can be written", extensions.join(" or ."));
    let folder = folder_of(file);
    ensure!(folder.is_dir(), "there is no folder {}", folder.display());
    ensure!(!file.is_dir(), "is a folder");
    ensure!(file.is_file() || !file.exists(), "is not a regular file");
    let place = place(file);
    ensure!(!taken.iter().any(|other| self::place(other) == place), "is the scene itself");
    Staged::new(file).with_context(|| format!("the folder {} cannot be written to", folder.display()))?;
    Ok(())
}

fn has_extension(file: &Path, extension: &str) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

/// Whether a report is written to a file as a page.
fn is_page(file: &Path) -> bool {
    has_extension(file, "html")
}

/// Parts files into those that findings are written to as SARIF, and the others.
pub(super) fn sarif_and_others(files: &[PathBuf]) -> (Vec<PathBuf>, Vec<PathBuf>) {
    files.iter().cloned().partition(|file| has_extension(file, "sarif"))
}

/// The file that a path leads to, whether it exists or not.
fn place(file: &Path) -> PathBuf {
    let of_folder = || Some(fs::canonicalize(folder_of(file)).ok()?.join(file.file_name()?));
    fs::canonicalize(file).ok().or_else(of_folder).unwrap_or_else(|| file.to_owned())
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
