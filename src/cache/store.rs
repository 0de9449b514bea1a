//! [`Store`]: a folder of results.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use blake3::Hasher;
use raykiln_formats::staging::{Folder, Hold};
use rayon::prelude::*;

use super::entry::{Entry, MAGIC, Part};
use super::key::Key;

/// By this file, programs that make backups know that a folder can be left out (<https://bford.info/cachedir/>).
const TAG: (&str, &str) = (
    "CACHEDIR.TAG",
    "Signature: 8a477f597d28d172789f06886806bc55\n# This folder is a cache of raykiln (docs/pipeline.md).\n",
);
/// Extension of a file with a result.
const EXTENSION: &str = "baked";
/// Hidden folders of processes that were killed are removed when they are older.
const ABANDONED: Duration = Duration::from_secs(24 * 3600);

/// A folder of results, shared by any number of processes and machines.
#[derive(Clone, Debug)]
pub struct Store(PathBuf);

/// What a store holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Contents {
    /// Number of results.
    pub entries: usize,
    /// Their size in bytes.
    pub bytes: u64,
}

/// A file of the store.
struct Listed {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
}

impl Store {
    /// Opens a store; its folder is created if it does not exist.
    ///
    /// # Errors
    /// Fails if the folder cannot be created.
    pub fn open(folder: &Path) -> io::Result<Store> {
        fs::create_dir_all(folder)?;
        let (name, text) = TAG;
        if !folder.join(name).exists() {
            // A store that can only be read still serves results.
            let _ = fs::write(folder.join(name), text);
        }
        Ok(Store(folder.to_owned()))
    }

    /// Opens a store that exists.
    ///
    /// # Errors
    /// Fails if there is no store.
    pub fn existing(folder: &Path) -> io::Result<Store> {
        match folder.join(TAG.0).is_file() {
            true => Ok(Store(folder.to_owned())),
            false => Err(io::Error::new(io::ErrorKind::NotFound, "is not a cache: it has no file CACHEDIR.TAG")),
        }
    }

    /// Returns the folder.
    pub fn folder(&self) -> &Path {
        &self.0
    }

    fn path(&self, key: &Key) -> PathBuf {
        let name = key.to_string();
        self.0.join(&name[..2]).join(&name[2..]).with_extension(EXTENSION)
    }

    /// Begins to read a result; `None` if there is none, or its file is damaged, which is then removed.
    pub fn get(&self, key: &Key) -> Option<Entry> {
        let entry = Entry::open(self.path(key)).map_err(|e| self.discard_if_damaged(key, &e)).ok()?;
        // The time of the last use, by which results are removed; a store that can only be read has none.
        let _ = File::options().append(true).open(&entry.path).and_then(|file| file.set_modified(SystemTime::now()));
        Some(entry)
    }

    fn discard_if_damaged(&self, key: &Key, error: &io::Error) {
        if error.kind() == io::ErrorKind::InvalidData {
            self.discard(key);
        }
    }

    /// Removes a result that turned out to be damaged.
    pub fn discard(&self, key: &Key) {
        // Another process may have removed it, or replaced it, which costs one more bake.
        let _ = fs::remove_file(self.path(key));
    }

    /// Stores a result: its parts with their names, and what writes each of them.
    ///
    /// # Errors
    /// Fails if the folder cannot be written to.
    pub fn put<'a>(
        &self,
        key: &Key,
        parts: &[Part],
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()> + 'a,
    ) -> io::Result<()> {
        let path = self.path(key);
        fs::create_dir_all(path.parent().unwrap_or(&self.0))?;
        let hidden = Folder::new_in(&self.0)?;
        let staged = hidden.path().join("result");
        write_entry(&staged, parts, fill)?;
        let _hold = Hold::new();
        fs::rename(staged, path)
    }

    /// Returns what the store holds.
    ///
    /// # Errors
    /// Fails if the folder cannot be read.
    pub fn contents(&self) -> io::Result<Contents> {
        let all = self.list()?;
        Ok(Contents { entries: all.len(), bytes: all.iter().map(|listed| listed.bytes).sum() })
    }

    /// Removes the results that were not used for the longest time until the rest takes at most `most` bytes, and the files
    /// of processes that were killed. Returns what was removed.
    ///
    /// # Errors
    /// Fails if the folder cannot be read.
    pub fn trim(&self, most: u64) -> io::Result<Contents> {
        self.remove_abandoned();
        let mut all = self.list()?;
        all.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
        let mut left: u64 = all.iter().map(|listed| listed.bytes).sum();
        let mut removed = Contents::default();
        for listed in all.iter().take_while(|listed| {
            let goes = left > most;
            left -= if goes { listed.bytes } else { 0 };
            goes
        }) {
            // Another process may have removed it at the same time.
            if fs::remove_file(&listed.path).is_ok() {
                removed.entries += 1;
                removed.bytes += listed.bytes;
            }
        }
        Ok(removed)
    }

    /// Reads all results, and removes those that are damaged. Returns what is left, and the files that were removed.
    ///
    /// # Errors
    /// Fails if the folder cannot be read.
    pub fn verify(&self) -> io::Result<(Contents, Vec<PathBuf>)> {
        let all = self.list()?;
        let check = |listed: &Listed| Entry::open(listed.path.clone()).and_then(Entry::check);
        let sound: Vec<bool> = all.par_iter().map(|listed| check(listed).unwrap_or(false)).collect();
        let (mut left, mut damaged) = (Contents::default(), Vec::new());
        for (listed, is_sound) in all.into_iter().zip(sound) {
            if is_sound {
                left.entries += 1;
                left.bytes += listed.bytes;
            } else if listed.path.exists() {
                fs::remove_file(&listed.path)?;
                damaged.push(listed.path);
            }
        }
        Ok((left, damaged))
    }

    /// The files with results, by name.
    fn list(&self) -> io::Result<Vec<Listed>> {
        let mut all = Vec::new();
        for folder in fs::read_dir(&self.0)? {
            let folder = folder?;
            let is_of_keys = folder.file_name().len() == 2 && folder.path().is_dir();
            for file in is_of_keys.then(|| fs::read_dir(folder.path())).into_iter().flatten().flatten() {
                all.extend(file.ok().and_then(|file| Listed::of(file.path())));
            }
        }
        all.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(all)
    }

    /// Removes hidden folders that processes left behind when they were killed, as far as they are old.
    fn remove_abandoned(&self) {
        let is_old = |path: &Path| {
            let modified = fs::metadata(path).and_then(|metadata| metadata.modified());
            modified.is_ok_and(|time| time.elapsed().is_ok_and(|age| age > ABANDONED))
        };
        for file in fs::read_dir(&self.0).into_iter().flatten().flatten() {
            if file.file_name().to_string_lossy().starts_with(".raykiln-") && is_old(&file.path()) {
                let _ = fs::remove_dir_all(file.path());
            }
        }
    }
}

impl Listed {
    fn of(path: PathBuf) -> Option<Listed> {
        let metadata = fs::metadata(&path).ok().filter(|_| path.extension().is_some_and(|e| e == EXTENSION))?;
        Some(Listed { bytes: metadata.len(), used: metadata.modified().ok()?, path })
    }
}

/// Writes the file of a result. The hash is filled in last.
fn write_entry(path: &Path, parts: &[Part], fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut list = serde_json::to_vec(parts)?;
    list.push(b'\n');
    let mut file = BufWriter::with_capacity(1 << 16, File::create(path)?);
    writeln!(file, "{MAGIC}{:64}", "")?;
    let mut to = Hashing { to: file, hasher: Hasher::new(), bytes: 0 };
    to.write_all(&list)?;
    fill(&mut to)?;
    let expected = list.len() as u64 + parts.iter().map(|part| part.bytes).sum::<u64>();
    if to.bytes != expected {
        return Err(io::Error::other(format!("{} bytes were written instead of {expected}", to.bytes)));
    }
    let hash = to.hasher.finalize();
    let mut file = to.to.into_inner()?;
    file.seek(SeekFrom::Start(MAGIC.len() as u64))?;
    file.write_all(hash.to_hex().as_bytes())
}

/// Writes, and hashes what it wrote.
struct Hashing {
    to: BufWriter<File>,
    hasher: Hasher,
    bytes: u64,
}

impl Write for Hashing {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        let count = self.to.write(buffer)?;
        self.hasher.update(&buffer[..count]);
        self.bytes += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::super::KeyBuilder;
    use super::*;

    fn store() -> (tempfile::TempDir, Store) {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(&folder.path().join("cache")).expect("writable");
        (folder, store)
    }

    fn key(name: &str) -> Key {
        KeyBuilder::default().add(name).finish()
    }

    fn put(store: &Store, name: &str, text: &str) {
        let part = Part { name: name.into(), bytes: text.len() as u64 };
        store.put(&key(name), &[part], |to| to.write_all(text.as_bytes())).expect("writable");
    }

    fn get(store: &Store, name: &str) -> Option<String> {
        let mut entry = store.get(&key(name))?;
        let mut text = Vec::new();
        for part in entry.parts.clone() {
            entry.copy(part.bytes, &mut text).ok()?;
        }
        entry.finish().expect("readable").then(|| String::from_utf8(text).expect("text"))
    }

    #[test]
    fn what_was_stored_is_found_again() {
        let (_folder, store) = store();
        assert_eq!(get(&store, "a"), None);
        put(&store, "a", "first");
        put(&store, "b", "");
        assert_eq!((get(&store, "a").as_deref(), get(&store, "b").as_deref()), (Some("first"), Some("")));
        assert!(Store::existing(store.folder()).is_ok());
        let names: Vec<_> = fs::read_dir(store.folder()).expect("readable").flatten().map(|f| f.file_name()).collect();
        assert!(names.iter().all(|name| name == TAG.0 || name.len() == 2), "{names:?}");
    }

    #[test]
    fn a_damaged_file_is_not_a_result() {
        let (_folder, store) = store();
        for damage in 0..4 {
            put(&store, "a", "some text");
            let path = store.path(&key("a"));
            let mut bytes = fs::read(&path).expect("readable");
            match damage {
                0 => bytes.truncate(20),
                1 => _ = bytes.pop(),
                2 => bytes.push(0),
                _ => *bytes.last_mut().expect("a byte") ^= 1,
            }
            fs::write(&path, bytes).expect("writable");
            assert_eq!(get(&store, "a"), None, "{damage}");
            fs::write(&path, fs::read(&path).unwrap_or_default()).expect("writable");
            put(&store, "b", "sound");
            let (left, damaged) = store.verify().expect("readable");
            assert_eq!((left.entries, damaged), (1, vec![path]), "{damage}");
        }
    }

    #[test]
    fn fewer_bytes_than_announced_are_an_error() {
        let (_folder, store) = store();
        let part = Part { name: "a".into(), bytes: 5 };
        assert!(store.put(&key("a"), &[part], |to| to.write_all(b"four")).is_err());
        assert_eq!(store.contents().expect("readable"), Contents::default());
    }

    #[test]
    fn what_was_used_last_is_kept_longest() {
        let (_folder, store) = store();
        for (age, name) in [(3, "a"), (2, "b"), (1, "c")] {
            put(&store, name, "text");
            let file = File::options().append(true).open(store.path(&key(name))).expect("there");
            let time = SystemTime::now() - Duration::from_secs(1000 * age);
            file.set_modified(time).expect("the file's own time");
        }
        assert!(get(&store, "a").is_some());
        let each = store.contents().expect("readable").bytes / 3;
        assert_eq!(store.trim(2 * each).expect("readable"), Contents { entries: 1, bytes: each });
        assert_eq!(["a", "b", "c"].map(|name| get(&store, name).is_some()), [true, false, true]);
        assert_eq!(store.trim(0).expect("readable").entries, 2);
    }

    #[test]
    fn a_folder_that_is_not_a_store_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(Store::existing(folder.path()).is_err());
    }
}
