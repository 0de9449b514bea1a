//! Finds assets by patterns and lists.

use std::path::{Path, PathBuf};

/// An asset.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Asset {
    /// Its path below the folder that is mirrored, with `/` between the parts.
    pub name: String,
    /// Its file.
    pub file: PathBuf,
}

/// Why assets cannot be found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FindError {
    /// A pattern cannot be read.
    #[error("{pattern}: {cause}")]
    Pattern {
        /// The pattern.
        pattern: String,
        /// What is wrong with it.
        cause: String,
    },
    /// There is no file.
    #[error("{0}: there is no such file")]
    NoFile(String),
    /// An asset has no place in the mirrored folders.
    #[error("{}: is not below the folder {}, which is mirrored (--root)", file.display(), root.display())]
    Outside {
        /// The asset.
        file: PathBuf,
        /// The folder.
        root: PathBuf,
    },
    /// A folder or a name cannot be read.
    #[error("{0}")]
    Unreadable(String),
}

/// Characters by which a part of a path is a pattern.
const WILD: [char; 3] = ['*', '?', '['];

/// Returns the files that a pattern names, by name. Without `root`, the folder before the first part with a wildcard is
/// mirrored. Files in hidden folders, and in `except`, are left out.
///
/// # Errors
/// Fails if the pattern cannot be read, a plain name is not a file, or a file is not below `root`.
pub fn find(pattern: &str, root: Option<&Path>, except: &Path) -> Result<Vec<Asset>, FindError> {
    let base = base_of(pattern);
    let root = root.unwrap_or(&base);
    if !pattern.contains(WILD) {
        return list([pattern], Some(root));
    }
    let malformed = |cause: String| FindError::Pattern { pattern: pattern.to_owned(), cause };
    let options =
        glob::MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: true };
    let paths = glob::glob_with(pattern, options).map_err(|e| malformed(e.to_string()))?;
    let mut assets = Vec::new();
    for path in paths {
        let file = path.map_err(|e| FindError::Unreadable(e.to_string()))?;
        // If the outputs go beside the assets, they are told apart by name.
        let is_left_out = file.starts_with(except) && !root.starts_with(except);
        if file.is_file() && !is_left_out {
            assets.push(asset(&file, root)?);
        }
    }
    assets.sort();
    Ok(assets)
}

/// Returns the files of a list, one per name. Without `root`, the current folder is mirrored.
///
/// # Errors
/// Fails if a name is not a file, or a file is not below `root`.
pub fn list<'a>(names: impl IntoIterator<Item = &'a str>, root: Option<&Path>) -> Result<Vec<Asset>, FindError> {
    let root = root.unwrap_or(Path::new(""));
    let of = |name: &'a str| {
        let file = Path::new(name);
        if file.is_file() { asset(file, root) } else { Err(FindError::NoFile(name.to_owned())) }
    };
    names.into_iter().map(of).collect()
}

/// The folder before the first part of a pattern that has a wildcard, or before the last part.
fn base_of(pattern: &str) -> PathBuf {
    let path = Path::new(pattern);
    let parts: Vec<_> = path.components().collect();
    let plain = parts.iter().take_while(|part| !part.as_os_str().to_string_lossy().contains(WILD)).count();
    parts[..plain.min(parts.len().saturating_sub(1))].iter().collect()
}

fn asset(file: &Path, root: &Path) -> Result<Asset, FindError> {
    let outside = || FindError::Outside { file: file.to_owned(), root: root.to_owned() };
    let clean = |path: &Path| path.strip_prefix(".").unwrap_or(path).to_owned();
    let (plain, base) = (clean(file), clean(root));
    let below = plain.strip_prefix(&base).map_err(|_| outside())?;
    let is_inside = below.components().all(|part| matches!(part, std::path::Component::Normal(_)));
    let parts: Option<Vec<&str>> = below.components().map(|part| part.as_os_str().to_str()).collect();
    let name = parts.filter(|parts| is_inside && !parts.is_empty()).ok_or_else(outside)?.join("/");
    Ok(Asset { name, file: file.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["a.glb", "b.obj", "in/c.glb", "in/deep/d.glb", ".hidden/e.glb", "out/f.glb"] {
            let file = folder.path().join(name);
            std::fs::create_dir_all(file.parent().expect("a folder")).expect("writable");
            std::fs::write(file, "").expect("writable");
        }
        let path = folder.path().to_owned();
        (folder, path)
    }

    #[test]
    fn the_folder_before_the_first_wildcard_is_mirrored() {
        let (_folder, top) = folder();
        let names = |pattern: &str, root: Option<&Path>| -> Result<Vec<String>, FindError> {
            let found = find(top.join(pattern).to_str().expect("UTF-8"), root, &top.join("out"))?;
            Ok(found.into_iter().map(|asset| asset.name).collect())
        };
        assert_eq!(names("**/*.glb", None).expect("found"), ["a.glb", "in/c.glb", "in/deep/d.glb"]);
        assert_eq!(names("in/*.glb", None).expect("found"), ["c.glb"]);
        assert_eq!(names("in/*.glb", Some(&top)).expect("found"), ["in/c.glb"]);
        assert_eq!(names("in/deep/d.glb", None).expect("found"), ["d.glb"]);
        assert!(matches!(names("in/*.glb", Some(&top.join("out"))), Err(FindError::Outside { .. })));
        assert!(matches!(names("a***", None), Err(FindError::Pattern { .. })));
        assert!(matches!(names("absent.glb", None), Err(FindError::NoFile(_))));
        assert_eq!(names("nothing*", None).expect("found"), [""; 0]);
    }

    #[test]
    fn bases_of_patterns() {
        for (pattern, base) in [("a/b/*.glb", "a/b"), ("**/x", ""), ("/a/*", "/a"), ("a/b.glb", "a"), ("b.glb", "")] {
            assert_eq!(base_of(pattern), Path::new(base), "{pattern}");
        }
    }
}
