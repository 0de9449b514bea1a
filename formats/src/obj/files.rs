//! Finds files that OBJ and MTL refer to, which may come from other systems, with other folders or letter case.

use std::collections::HashMap;
use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};

/// Characters that a path segment of a URI need not escape (RFC 3986, 2.3).
const SEGMENT: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// Finds files by the names written in an OBJ file or its MTL files.
#[derive(Debug)]
pub(super) struct Files {
    /// The folder of the OBJ file.
    pub(super) folder: PathBuf,
    /// Whether there are files at all: not beside an OBJ file in memory.
    exist: bool,
    listings: HashMap<PathBuf, Vec<OsString>>,
}

impl Files {
    /// Creates the state for files next to `path`.
    pub(super) fn beside(path: &Path) -> Self {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Files { folder, exist: true, listings: HashMap::new() }
    }

    /// No files.
    pub(super) fn none() -> Self {
        Files { folder: PathBuf::new(), exist: false, listings: HashMap::new() }
    }

    /// Finds the file that `written` refers to, relative to `base` (the folder of the file that contains it): as
    /// written, in another case, or else a file with its last name in `base` or next to the OBJ file.
    pub(super) fn find(&mut self, base: &Path, written: &str) -> Option<PathBuf> {
        let written = normalised(written);
        let last = written.rsplit('/').next().unwrap_or_default();
        let beside = self.folder.clone();
        [(base, written.as_str()), (&beside, &written), (base, last), (&beside, last)]
            .into_iter()
            .find_map(|(base, name)| self.find_exactly(base, name))
    }

    /// Like [`Files::find`], but only in `base` and with all folders as written.
    pub(super) fn find_exactly(&mut self, base: &Path, written: &str) -> Option<PathBuf> {
        let written = normalised(written);
        if !self.exist || written.is_empty() || written.contains('\0') {
            return None;
        }
        let direct = base.join(&written);
        if direct.is_file() {
            return Some(direct);
        }
        let mut path = base.to_owned();
        for component in Path::new(&written).components() {
            path = self.step(path, component)?;
        }
        path.is_file().then_some(path)
    }

    fn step(&mut self, folder: PathBuf, component: Component<'_>) -> Option<PathBuf> {
        let direct = folder.join(component);
        if !matches!(component, Component::Normal(_)) || direct.exists() {
            return Some(direct);
        }
        let wanted = component.as_os_str().to_string_lossy().to_lowercase();
        let same = |name: &&OsString| name.to_string_lossy().to_lowercase() == wanted;
        let found = self.listing(&folder).iter().find(same)?;
        Some(folder.join(found))
    }

    /// Returns the names in a folder, sorted so that a choice among several does not depend on the file system.
    fn listing(&mut self, folder: &Path) -> &[OsString] {
        self.listings.entry(folder.to_owned()).or_insert_with(|| {
            let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            let mut names: Vec<OsString> =
                std::fs::read_dir(here).into_iter().flatten().flatten().map(|entry| entry.file_name()).collect();
            names.sort();
            names
        })
    }

    /// Returns the URI of a file, relative to the folder of the OBJ file.
    pub(super) fn uri(&self, file: &Path) -> String {
        let parts = match file.strip_prefix(&self.folder) {
            Ok(inside) => names(inside),
            Err(_) => relative(&self.folder, file),
        };
        parts.iter().map(|part| escaped(part)).collect::<Vec<_>>().join("/")
    }

    /// Returns the URI of a missing file: as written in a file of folder `base`, without a drive or root.
    pub(super) fn uri_as_written(&self, base: &Path, written: &str) -> String {
        let written = normalised(written);
        let absolute = written.starts_with('/') || written.as_bytes().get(1) == Some(&b':');
        let name = if absolute { written.rsplit('/').next().unwrap_or_default() } else { &written };
        self.uri(&base.join(name))
    }
}

/// Returns a path with forward slashes and without enclosing quotes or a leading `./`.
fn normalised(written: &str) -> String {
    let bare = written.trim().trim_matches('"').replace('\\', "/");
    let mut rest = bare.as_str();
    while let Some(shorter) = rest.strip_prefix("./") {
        rest = shorter.trim_start_matches('/');
    }
    rest.to_owned()
}

/// Returns the components of a relative path, with `..` resolved.
fn names(path: &Path) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for component in path.components() {
        match component {
            Component::ParentDir if out.last().is_some_and(|last| last != "..") => drop(out.pop()),
            Component::CurDir | Component::RootDir | Component::Prefix(_) => {}
            _ => out.push(component.as_os_str().to_string_lossy().into_owned()),
        }
    }
    out
}

fn relative(folder: &Path, file: &Path) -> Vec<String> {
    let absolute = |path: &Path| std::path::absolute(path).map_or_else(|_| names(path), |path| names(&path));
    let here = if folder.as_os_str().is_empty() { absolute(Path::new(".")) } else { absolute(folder) };
    let file = absolute(file);
    let common = here.iter().zip(&file).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n("..".to_owned(), here.len() - common);
    up.chain(file[common..].iter().cloned()).collect()
}

fn escaped(segment: &str) -> String {
    utf8_percent_encode(segment, SEGMENT).to_string()
}
