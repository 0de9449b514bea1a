//! Writes files next to their final place and renames them together.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::uri::folder_of;
use crate::document::Staged;
use crate::staging::{Folder, Hold};
use crate::{Error, ErrorKind, Warning};

impl Staged {
    /// Returns the written files, where they are staged; the scene file itself comes last.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(|(from, _)| from.as_path())
    }

    /// Begins an output whose files are known already, to be added with [`Staged::add`], the scene file last.
    ///
    /// # Errors
    /// As [`crate::document::check_output`].
    pub fn begin(out: &Path) -> Result<Self, Error> {
        super::write::kind_of(out)?;
        Staged::new(out)
    }

    /// Adds a file to be named `name` in the final folder, with what `fill` writes.
    ///
    /// # Errors
    /// Names the file that could not be written.
    pub fn add(&mut self, name: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Error> {
        self.write(name, |file| fill(file))
    }

    /// Returns the written files, where they are staged, each with its name in the final folder; the scene file comes last.
    pub fn named_files(&self) -> impl Iterator<Item = (&Path, &Path)> {
        self.files.iter().map(|(from, to)| (from.as_path(), to.strip_prefix(&self.target).unwrap_or(to)))
    }

    /// Creates an empty staging folder next to `out`, on the same file system.
    pub(super) fn new(out: &Path) -> Result<Self, Error> {
        let folder = staging_folder(out)?;
        let target = folder_of(out).to_owned();
        Ok(Staged { folder, target, files: Vec::new(), warnings: Vec::new(), is_input: false })
    }

    /// Writes a file to be named `name` in the final folder.
    pub(super) fn write(
        &mut self,
        name: &Path,
        fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), Error> {
        self.put(name, |path| {
            let mut file = BufWriter::with_capacity(1 << 18, File::create(path)?);
            fill(&mut file)?;
            file.flush()
        })
    }

    /// Copies a file to be named `name` in the final folder; warns if it replaces a different file.
    pub(super) fn copy(&mut self, from: &Path, name: &Path) -> Result<(), Error> {
        let there = self.target.join(name);
        if there.is_file() && !same_bytes(from, &there).unwrap_or(false) {
            let message = format!("replaces the different file {}", there.display());
            self.warnings.push(Warning { place: String::new(), message });
        }
        self.put(name, |path| fs::copy(from, path).map(|_| ()))
    }

    /// Makes a file of the final folder visible in the staging folder for as long as that exists.
    pub(super) fn lend(&self, from: &Path, name: &Path) -> Result<(), Error> {
        let path = self.place(name)?;
        fs::hard_link(from, &path)
            .or_else(|_| fs::copy(from, &path).map(|_| ()))
            .map_err(|e| Error::io(from, "cannot be staged: ", &e))
    }

    fn put(&mut self, name: &Path, make: impl FnOnce(&Path) -> io::Result<()>) -> Result<(), Error> {
        let path = self.place(name)?;
        make(&path).map_err(|e| Error::io(&self.target.join(name), "cannot be written: ", &e))?;
        self.files.push((path, self.target.join(name)));
        Ok(())
    }

    /// Returns the path of a name in the staging folder, and creates its folders.
    fn place(&self, name: &Path) -> Result<PathBuf, Error> {
        let path = self.folder.path().join(name);
        // A staging folder that was removed at program exit must not be created again.
        let _hold = Hold::new();
        fs::create_dir_all(folder_of(&path))
            .map_err(|e| Error::io(&self.target.join(name), "cannot be staged: ", &e))?;
        Ok(path)
    }

    /// Returns the path at which the staged scene file can be read before the commit.
    pub fn path(&self) -> &Path {
        self.files.last().map_or(self.folder.path(), |(staged, _)| staged)
    }

    /// Returns the size of all staged files in bytes.
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|(staged, _)| fs::metadata(staged).map_or(0, |m| m.len())).sum()
    }

    /// Renames the files to their final names, the scene file last.
    ///
    /// # Errors
    /// Names the file that could not be put in place; files already put in place are removed again, and the files they
    /// replaced are restored.
    pub fn commit(self) -> Result<(), Error> {
        self.put_in_place().map(drop)
    }

    /// Like [`Staged::commit`], for use if later steps may still fail.
    ///
    /// # Errors
    /// See [`Staged::commit`].
    pub fn put_in_place(self) -> Result<Placed, Error> {
        let _hold = Hold::new();
        let (mut backup, mut undo) = (None, Vec::new());
        for (i, (from, to)) in self.files.iter().enumerate() {
            if let Err(e) = replace(from, to, || place_in(&mut backup, &self.target, i), &mut undo) {
                undo.into_iter().rev().for_each(Undo::run);
                return Err(Error::io(to, "cannot be put in place: ", &e));
            }
        }
        Ok(Placed { undo, _backup: backup })
    }
}

/// Files under their final names. They stay there when dropped.
#[derive(Debug)]
pub struct Placed {
    undo: Vec<Undo>,
    /// Holds the replaced files, if there are any.
    _backup: Option<Folder>,
}

impl Placed {
    /// Removes the files and restores those that they replaced, as far as the file system allows.
    pub fn take_back(self) {
        self.undo.into_iter().rev().for_each(Undo::run);
    }
}

/// Reverts one step of a commit.
#[derive(Debug)]
enum Undo {
    RemoveFolder(PathBuf),
    RemoveFile(PathBuf),
    Restore { old: PathBuf, to: PathBuf },
}

impl Undo {
    /// Reverts the step as far as the file system allows.
    fn run(self) {
        let _ = match self {
            Undo::RemoveFolder(folder) => fs::remove_dir(folder),
            Undo::RemoveFile(file) => fs::remove_file(file),
            Undo::Restore { old, to } => fs::rename(old, to),
        };
    }
}

/// Returns the place of a replaced file; the folder is created for the first.
fn place_in(backup: &mut Option<Folder>, target: &Path, number: usize) -> io::Result<PathBuf> {
    let folder = match backup.take() {
        Some(folder) => folder,
        None => Folder::new_in(target)?,
    };
    Ok(backup.insert(folder).path().join(number.to_string()))
}

/// Moves a file to its final name. The replaced file is kept at the place that `old` gives until the end of the commit.
fn replace(from: &Path, to: &Path, old: impl FnOnce() -> io::Result<PathBuf>, undo: &mut Vec<Undo>) -> io::Result<()> {
    make_folders(folder_of(to), undo)?;
    match fs::symlink_metadata(to) {
        Ok(there) if there.is_dir() => return Err(io::Error::other("a folder bears that name")),
        Ok(_) => {
            let old = old()?;
            // A second link keeps the old file, so that there is always a file at `to`.
            fs::hard_link(to, &old).or_else(|_| fs::rename(to, &old))?;
            undo.push(Undo::Restore { old, to: to.to_owned() });
        }
        Err(_) => undo.push(Undo::RemoveFile(to.to_owned())),
    }
    fs::rename(from, to)
}

fn make_folders(folder: &Path, undo: &mut Vec<Undo>) -> io::Result<()> {
    let missing: Vec<&Path> = folder.ancestors().take_while(|f| !f.as_os_str().is_empty() && !f.exists()).collect();
    for folder in missing.into_iter().rev() {
        fs::create_dir(folder)?;
        undo.push(Undo::RemoveFolder(folder.to_owned()));
    }
    Ok(())
}

/// Rejects a file that cannot be written, before any work is done.
pub(super) fn check(out: &Path) -> Result<(), Error> {
    staging_folder(out).map(drop)
}

fn staging_folder(out: &Path) -> Result<Folder, Error> {
    if out.is_dir() {
        return Err(Error::output(out, "is a folder"));
    }
    hidden_folder(folder_of(out))
}

fn hidden_folder(parent: &Path) -> Result<Folder, Error> {
    Folder::new_in(parent).map_err(|e| {
        let cause = match e.kind() {
            io::ErrorKind::NotFound => "the folder does not exist".to_owned(),
            cause => format!("the folder cannot be written to: {cause}"),
        };
        Error::whole(parent, cause).of_kind(ErrorKind::Io(e.kind()))
    })
}

fn same_bytes(a: &Path, b: &Path) -> io::Result<bool> {
    Ok(fs::metadata(a)?.len() == fs::metadata(b)?.len() && fs::read(a)? == fs::read(b)?)
}
