//! Which files a scene may name: within a root if one is given; otherwise relative ones, with a warning for each outside of
//! the scene's folder.

use std::fs;
use std::path::{Component, Path, PathBuf};

use super::json::At;
use super::uri::{self, Uri};
use crate::{Error, Warning};

/// Rejects names of files that lead out of `root`, by `..`, as absolute paths or through symbolic links; without a root,
/// absolute ones.
pub(super) fn check(
    document: &At<'_>,
    folder: &Path,
    root: Option<&Path>,
    warnings: &mut Vec<Warning>,
) -> Result<(), Error> {
    let home = real(root.unwrap_or(folder));
    for list in ["buffers", "images"] {
        for element in document.list(list)? {
            let Some(at) = element.get("uri") else { continue };
            let Some(Uri::File(name)) = at.value.as_str().map(uri::parse) else { continue };
            let file = real(&uri::locate(folder, at.value.as_str().unwrap_or_default(), &name));
            let is_outside = !file.starts_with(&home);
            match root {
                Some(root) if is_outside => {
                    let cause = format_args!("leads to {}, outside of {}", file.display(), root.display());
                    return Err(at.error(cause).unsupported());
                }
                None if Path::new(&*name).is_absolute() => {
                    return Err(at
                        .error("is an absolute path, which is read only below a given root (--root)")
                        .unsupported());
                }
                None if is_outside => {
                    let message = format_args!("is read from outside of the scene's folder: {}", file.display());
                    warnings.push(at.warning(message));
                }
                _ => {}
            }
        }
    }
    Ok(())
}

/// Rejects files of a scene that are outside of a root.
pub(crate) fn check_files(scene: &Path, files: &[PathBuf], root: &Path) -> Result<(), Error> {
    let home = real(root);
    match files.iter().map(|file| real(file)).find(|file| !file.starts_with(&home)) {
        None => Ok(()),
        Some(file) => {
            let cause = format_args!("refers to {}, outside of {}", file.display(), root.display());
            Err(Error::whole(scene, cause).unsupported())
        }
    }
}

/// Returns a path without links and `..`, as far as it exists.
fn real(path: &Path) -> PathBuf {
    if let Ok(real) = fs::canonicalize(path) {
        return real;
    }
    let mut plain = PathBuf::new();
    for component in std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).components() {
        match component {
            Component::ParentDir => {
                plain.pop();
            }
            component => plain.push(component),
        }
        plain = fs::canonicalize(&plain).unwrap_or(plain);
    }
    plain
}
