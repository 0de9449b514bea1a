//! Hidden folders in which files are created next to their final places.
//!
//! They are removed when dropped. A program terminated by a signal drops nothing; it can call [`remove_all`] first.
//! This crate does not handle signals itself. What a program leaves that was killed is removed by the next one that makes a
//! folder there: each program locks a file in its folders for as long as it runs.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use std::{fs, io, mem, thread};

struct State {
    folders: BTreeSet<PathBuf>,
    holds: usize,
    ended: bool,
}

static STATE: Mutex<State> = Mutex::new(State { folders: BTreeSet::new(), holds: 0, ended: false });
static CHANGED: Condvar = Condvar::new();
/// Number of attempts to remove a folder, in which another thread may be creating a file.
const TRIES: usize = 10;
/// Start of the name of a folder.
const PREFIX: &str = ".raykiln-";
/// The file in a folder that its program locks.
const LOCK: &str = ".lock";
/// The age from which a folder that is not locked was left behind.
const YOUNGEST: Duration = Duration::from_secs(1);

/// A hidden folder; it is removed with all its contents when dropped.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// Locked for as long as the folder is in use.
    _lock: File,
}

impl Folder {
    /// Creates a folder within `parent`. Blocks forever after [`remove_all`].
    ///
    /// # Errors
    /// Fails if `parent` is not a folder, or cannot be written to.
    pub fn new_in(parent: &Path) -> io::Result<Folder> {
        remove_abandoned(parent);
        // `remove_all` waits until the folder is known; other threads need not wait for the file system.
        let _hold = Hold::new();
        let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(parent)?;
        let lock = File::create_new(folder.path().join(LOCK))?;
        // Where files cannot be locked, nothing that was left behind is removed.
        let _ = lock.try_lock();
        let path = folder.keep();
        state().folders.insert(path.clone());
        Ok(Folder { path, _lock: lock })
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        remove(&self.path);
        state().folders.remove(&self.path);
    }
}

/// While one exists, [`remove_all`] waits; used for steps that belong together, such as renaming several files.
#[derive(Debug)]
pub struct Hold(());

impl Hold {
    /// Creates a hold. Blocks forever after [`remove_all`].
    #[expect(clippy::new_without_default, reason = "it may wait")]
    pub fn new() -> Hold {
        state_before_end().holds += 1;
        Hold(())
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        state().holds -= 1;
        CHANGED.notify_all();
    }
}

/// Removes the folders of all threads once no [`Hold`] is left, for a program that is about to end: any thread that
/// then creates a folder or a hold blocks forever.
pub fn remove_all() {
    let held = |state: &mut State| state.holds > 0;
    let mut state = CHANGED.wait_while(state(), held).unwrap_or_else(PoisonError::into_inner);
    state.ended = true;
    let folders = mem::take(&mut state.folders);
    drop(state);
    folders.iter().for_each(|folder| remove(folder));
}

/// Like [`remove_all`], for a program that is out of memory: gives up after `patience`, because another thread may wait
/// for memory while it creates a folder or renames files. Allocates next to nothing.
pub fn remove_all_within(patience: Duration) {
    let start = Instant::now();
    while start.elapsed() < patience {
        if let Ok(mut state) = STATE.try_lock()
            && state.holds == 0
        {
            state.ended = true;
            let folders = mem::take(&mut state.folders);
            drop(state);
            return folders.iter().for_each(|folder| remove(folder));
        }
        thread::sleep(Duration::from_millis(1));
    }
}

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn state_before_end() -> MutexGuard<'static, State> {
    CHANGED.wait_while(state(), |state| state.ended).unwrap_or_else(PoisonError::into_inner)
}

/// Removes the folders in `parent` whose program has ended, which unlocked their files.
fn remove_abandoned(parent: &Path) {
    let entries = fs::read_dir(parent).into_iter().flatten().flatten();
    let hidden = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(PREFIX));
    for folder in hidden.map(|entry| entry.path()) {
        if let Ok(lock) = File::open(folder.join(LOCK))
            && is_abandoned(&lock)
        {
            remove(&folder);
        }
    }
}

/// Whether nothing has locked a file. A program locks it right after making it, and may be in between: only files of some
/// age count.
fn is_abandoned(lock: &File) -> bool {
    let age = lock.metadata().and_then(|metadata| metadata.modified()).map(|time| time.elapsed().unwrap_or_default());
    match lock.try_lock() {
        Ok(()) => age.is_ok_and(|age| age > YOUNGEST),
        Err(TryLockError::WouldBlock | TryLockError::Error(_)) => false,
    }
}

/// Removes a folder as far as the file system allows.
fn remove(folder: &Path) {
    let gone = |removed: io::Result<()>| removed.is_ok() || !folder.exists();
    let _ = (0..TRIES).any(|_| gone(fs::remove_dir_all(folder)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_hidden_and_vanishes_with_all_that_is_in_it() {
        let parent = tempfile::tempdir().expect("a temporary folder");
        let folder = Folder::new_in(parent.path()).expect("writable");
        let name = folder.path().file_name().expect("a name").to_string_lossy().into_owned();
        assert!(name.starts_with(".raykiln-"), "{name}");
        fs::create_dir(folder.path().join("within")).expect("writable");
        fs::write(folder.path().join("within/file"), "text").expect("writable");
        drop(folder);
        assert_eq!(fs::read_dir(parent.path()).expect("readable").count(), 0);
        assert_eq!(
            Folder::new_in(&parent.path().join("absent")).err().map(|e| e.kind()),
            Some(io::ErrorKind::NotFound)
        );
    }

    #[test]
    fn what_a_killed_program_left_is_removed_by_the_next_and_nothing_else() {
        let parent = tempfile::tempdir().expect("a temporary folder");
        let make = |name: &str, age: u64| {
            let folder = parent.path().join(name);
            fs::create_dir(&folder).expect("writable");
            let lock = File::create(folder.join(LOCK)).expect("writable");
            lock.set_modified(std::time::SystemTime::now() - Duration::from_secs(age)).expect("a time");
            lock
        };
        drop((make(".raykiln-left", 60), make(".raykiln-young", 0), make(".other", 60)));
        fs::create_dir(parent.path().join(".raykiln-cache")).expect("writable");
        let used = make(".raykiln-used", 60);
        used.lock().expect("lockable");
        let folder = Folder::new_in(parent.path()).expect("writable");
        drop(Folder::new_in(parent.path()).expect("writable"));
        assert!(folder.path().exists(), "this program's own are locked, too");
        let is_there = |name: &str| parent.path().join(name).exists();
        assert!(!is_there(".raykiln-left"));
        assert!([".raykiln-young", ".raykiln-used", ".raykiln-cache", ".other"].into_iter().all(is_there));
    }

    #[test]
    fn holds_nest() {
        let outer = Hold::new();
        drop(Hold::new());
        drop(outer);
    }
}
