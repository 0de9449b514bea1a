//! Finds files that OBJ and MTL refer to, which may come from other systems, with other folders or letter case.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::path::{Component, Path, PathBuf};

use encoding_rs::Encoding;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};
use unicode_normalization::UnicodeNormalization;

use super::encoding::CODE_PAGES;

/// Characters that a path segment of a URI need not escape (RFC 3986, 2.3).
const SEGMENT: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// Finds files by the names written in an OBJ file or its MTL files.
#[derive(Debug)]
pub(super) struct Files {
    /// The folder of the OBJ file.
    pub(super) folder: PathBuf,
    /// The name of the OBJ file without its extension.
    pub(super) model: String,
    /// The code page of the scene's texts, if they are not UTF-8.
    pub(super) encoding: Option<&'static Encoding>,
    /// Whether there are files at all: not beside an OBJ file in memory.
    exist: bool,
    /// Folders to look in after those of the scene.
    search: Vec<PathBuf>,
    listings: HashMap<PathBuf, Vec<OsString>>,
}

impl Files {
    /// Creates the state for files next to `path`, and in the folders `search`.
    pub(super) fn beside(path: &Path, model: &OsStr, search: &[PathBuf]) -> Self {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let model = model.to_string_lossy().into_owned();
        Files { folder, model, encoding: None, exist: true, search: search.to_vec(), listings: HashMap::new() }
    }

    /// No files.
    pub(super) fn none() -> Self {
        let (folder, model) = (PathBuf::new(), String::new());
        Files { folder, model, encoding: None, exist: false, search: Vec::new(), listings: HashMap::new() }
    }

    /// Finds the file that `written` refers to, relative to `base` (the folder of the file that contains it): the
    /// longest end of the path for which there is a file in `base`, next to the OBJ file or in a folder to search. A
    /// comment behind the name and escapes of URIs are left out if there is no such file otherwise.
    pub(super) fn find(&mut self, base: &Path, written: &str) -> Option<PathBuf> {
        let plain = normalised(written);
        let without_comment = without_comment(written).map(normalised);
        let decoded = percent_decode_str(&plain).decode_utf8().ok().map(Cow::into_owned).filter(|name| *name != plain);
        let names = [Some(plain), without_comment, decoded];
        names.into_iter().flatten().find_map(|name| self.find_end(base, &name))
    }

    fn find_end(&mut self, base: &Path, name: &str) -> Option<PathBuf> {
        let bases: Vec<PathBuf> = [base, &self.folder]
            .into_iter()
            .chain(self.search.iter().map(PathBuf::as_path))
            .map(Path::to_owned)
            .collect();
        let starts = std::iter::once(0).chain(name.match_indices('/').map(|(at, _)| at + 1));
        for start in starts.take(MOST_FOLDERS) {
            let found = bases.iter().find_map(|base| self.find_exactly(base, &name[start..]));
            if found.is_some() {
                return found;
            }
        }
        None
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

    /// Enters a folder or names a file in it: as written, or else in another case, Unicode form or encoding.
    fn step(&mut self, folder: PathBuf, component: Component<'_>) -> Option<PathBuf> {
        let direct = folder.join(component);
        if !matches!(component, Component::Normal(_)) || direct.exists() {
            return Some(direct);
        }
        let wanted = likeness(&component.as_os_str().to_string_lossy());
        let encoding = self.encoding;
        let found = self.listing(&folder).iter().find(|name| spells(name, &wanted, encoding))?;
        Some(folder.join(found))
    }

    /// Returns the library that is named like the model, if there is one.
    pub(super) fn namesake(&mut self) -> Option<PathBuf> {
        self.find_exactly(&self.folder.clone(), &format!("{}.mtl", self.model))
    }

    /// Whether a file lies outside the folder of the OBJ file and those to search.
    pub(super) fn is_outside(&self, file: &Path) -> bool {
        let is_searched = |folder: &PathBuf| file.strip_prefix(folder).is_ok_and(|inside| !climbs(inside));
        if self.search.iter().any(is_searched) {
            return false;
        }
        match file.strip_prefix(&self.folder) {
            Ok(inside) => file.is_absolute() && !self.folder.is_absolute() || climbs(inside),
            Err(_) => true,
        }
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
}

/// Number of folders of a path that may be left out.
const MOST_FOLDERS: usize = 64;

/// Whether a relative path leaves the folder it starts from.
fn climbs(path: &Path) -> bool {
    let mut depth = 0i64;
    path.components().any(|component| {
        depth += match component {
            Component::ParentDir => -1,
            Component::Normal(_) => 1,
            _ => 0,
        };
        depth < 0
    })
}

/// Returns a name in the form in which names are compared: composed, in lower case.
fn likeness(name: &str) -> String {
    name.nfc().collect::<String>().to_lowercase().nfc().collect()
}

/// Whether the name of a file, as its bytes are, is the wanted one. Names that are not UTF-8 are in the code page of the
/// scene, or else in any.
fn spells(name: &OsStr, wanted: &str, encoding: Option<&'static Encoding>) -> bool {
    if let Some(name) = name.to_str() {
        return likeness(name) == wanted;
    }
    let bytes = name.as_encoded_bytes();
    let mut pages = encoding.into_iter().chain(CODE_PAGES.into_iter().filter(|_| encoding.is_none()));
    pages.any(|page| {
        let name = page.decode_without_bom_handling_and_without_replacement(bytes);
        name.is_some_and(|name| likeness(&name) == wanted)
    })
}

/// Returns what precedes a comment behind a name.
pub(super) fn without_comment(name: &str) -> Option<&str> {
    let (at, _) = name.match_indices('#').find(|(at, _)| name[..*at].ends_with(char::is_whitespace))?;
    Some(name[..at].trim_end()).filter(|name| !name.is_empty())
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
