//! Files written beside their final place and renamed together.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::uri::folder_of;
use crate::document::Staged;
use crate::staging::{Folder, Hold};
use crate::{Error, ErrorKind, Warning};

impl Staged {
    /// An empty staging folder beside `out`, on the same file system.
    pub(super) fn new(out: &Path) -> Result<Self, Error> {
        let folder = staging_folder(out)?;
        let target = folder_of(out).to_owned();
        Ok(Staged { folder, target, files: Vec::new(), warnings: Vec::new() })
    }

    /// Writes a file that will bear `name` within the final folder.
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

    /// Copies a file that will bear `name` within the final folder; warns of a different file that it replaces.
    pub(super) fn copy(&mut self, from: &Path, name: &Path) -> Result<(), Error> {
        let there = self.target.join(name);
        if there.is_file() && !same_bytes(from, &there).unwrap_or(false) {
            let message = format!("replaces the different file {}", there.display());
            self.warnings.push(Warning { place: String::new(), message });
        }
        self.put(name, |path| fs::copy(from, path).map(|_| ()))
    }

    /// Makes a file of the final folder visible in the staging folder too, only for as long as that exists.
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

    /// The path of a name in the staging folder, its folders made.
    fn place(&self, name: &Path) -> Result<PathBuf, Error> {
        let path = self.folder.path().join(name);
        // A staging folder that was removed at the end of the program must not come back.
        let _hold = Hold::new();
        fs::create_dir_all(folder_of(&path))
            .map_err(|e| Error::io(&self.target.join(name), "cannot be staged: ", &e))?;
        Ok(path)
    }

    /// Where the staged scene file can be read before it is committed.
    pub fn path(&self) -> &Path {
        self.files.last().map_or(self.folder.path(), |(staged, _)| staged)
    }

    /// Size of all staged files in bytes.
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|(staged, _)| fs::metadata(staged).map_or(0, |m| m.len())).sum()
    }

    /// Renames the files to their final names, the scene file last.
    ///
    /// # Errors
    /// Names the file that could not be put in place; files put in place before it are removed again, and those
    /// they had replaced come back.
    pub fn commit(self) -> Result<(), Error> {
        self.put_in_place().map(drop)
    }

    /// As [`Staged::commit`], where what comes after may still fail.
    ///
    /// # Errors
    /// As [`Staged::commit`].
    pub fn put_in_place(self) -> Result<Placed, Error> {
        let _hold = Hold::new();
        let backup = hidden_folder(&self.target)?;
        let mut undo = Vec::new();
        for (i, (from, to)) in self.files.iter().enumerate() {
            if let Err(e) = replace(from, to, backup.path().join(i.to_string()), &mut undo) {
                undo.into_iter().rev().for_each(Undo::run);
                return Err(Error::io(to, "cannot be put in place: ", &e));
            }
        }
        Ok(Placed { undo, _backup: backup })
    }
}

/// Files under their final names. Dropped, they stay there.
#[derive(Debug)]
pub struct Placed {
    undo: Vec<Undo>,
    /// What the files replaced.
    _backup: Folder,
}

impl Placed {
    /// Removes the files again, and brings back those that they replaced, as far as the file system lets it.
    pub fn take_back(self) {
        self.undo.into_iter().rev().for_each(Undo::run);
    }
}

/// What takes back one step of a commit.
#[derive(Debug)]
enum Undo {
    RemoveFolder(PathBuf),
    RemoveFile(PathBuf),
    Restore { old: PathBuf, to: PathBuf },
}

impl Undo {
    /// Takes the step back as far as the file system lets it.
    fn run(self) {
        let _ = match self {
            Undo::RemoveFolder(folder) => fs::remove_dir(folder),
            Undo::RemoveFile(file) => fs::remove_file(file),
            Undo::Restore { old, to } => fs::rename(old, to),
        };
    }
}

/// Moves a file to its final name. What bore the name is kept as `old` till the end of the commit.
fn replace(from: &Path, to: &Path, old: PathBuf, undo: &mut Vec<Undo>) -> io::Result<()> {
    make_folders(folder_of(to), undo)?;
    match fs::symlink_metadata(to) {
        Ok(there) if there.is_dir() => return Err(io::Error::other("a folder bears that name")),
        Ok(_) => {
            // A second name keeps the first alive, so that at no time there is no file.
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

/// Refuses a file that cannot be written, before any work is done.
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
