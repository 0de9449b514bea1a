//! The scenes at hand, and what they stand for.

use std::fs;
use std::path::{Path, PathBuf};

use super::numbers::{Edition, SCENES};
use crate::lab::LabError;

/// A scene at hand.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Index of the scene of table 5.1 that it is or stands for; `None` for a sample.
    pub(super) of: Option<usize>,
    pub(super) name: String,
    pub(super) edition: Edition,
    /// The file below the folder of scenes, as rows name it.
    pub(super) model: String,
    pub(super) file: PathBuf,
}

/// Scenes that a quick run takes if the folder has none of the thesis.
const QUICK_SCENES: usize = 3;

/// What such a scene is.
pub(super) const SAMPLE: Edition = Edition::Other("a sample in place of the thesis's scenes");

/// Extensions of scenes.
const EXTENSIONS: [&str; 3] = ["obj", "gltf", "glb"];

/// Returns the scenes of table 5.1 that a folder has. A quick run takes the largest others instead if there are none.
///
/// # Errors
/// Fails if the folder cannot be read or has no scene.
pub(super) fn find(folder: &Path, quick: bool) -> Result<Vec<Found>, LabError> {
    if !folder.is_dir() {
        return Err(LabError::file(folder, "is not a folder"));
    }
    let of_thesis = |(of, scene): (usize, &super::numbers::ThesisScene)| {
        let (file, edition) = scene.files.iter().find(|(file, _)| folder.join(file).is_file())?;
        let (name, model) = (scene.name.into(), (*file).to_owned());
        Some(Found { of: Some(of), name, edition: *edition, model, file: folder.join(file) })
    };
    let mut found: Vec<Found> = SCENES.iter().enumerate().filter_map(of_thesis).collect();
    if found.is_empty() && quick {
        found = largest(folder)?;
    }
    match found.is_empty() {
        true => {
            let files: Vec<&str> = SCENES.iter().flat_map(|scene| scene.files).map(|(file, _)| *file).collect();
            Err(LabError::file(folder, format!("has none of the scenes {}", files.join(", "))))
        }
        false => Ok(found),
    }
}

/// Returns the largest scenes of a folder and the folders in it, by name.
fn largest(folder: &Path) -> Result<Vec<Found>, LabError> {
    let mut files: Vec<(u64, PathBuf)> = Vec::new();
    for inner in entries(folder)? {
        let of_inner = if inner.is_dir() { entries(&inner)? } else { vec![inner] };
        let is_scene = |path: &PathBuf| {
            let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
            path.is_file() && EXTENSIONS.contains(&extension)
        };
        files.extend(of_inner.into_iter().filter(is_scene).map(|path| (path.metadata().map_or(0, |m| m.len()), path)));
    }
    files.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    files.truncate(QUICK_SCENES);
    files.sort_by(|a, b| a.1.cmp(&b.1));
    let named = |(_, file): (u64, PathBuf)| {
        let model = file.strip_prefix(folder).unwrap_or(&file).display().to_string();
        let folder = file.parent().and_then(Path::file_name);
        let name = folder.or(file.file_stem()).map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Found { of: None, name, edition: SAMPLE, model, file }
    };
    Ok(files.into_iter().map(named).collect())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, LabError> {
    let failed = |e: std::io::Error| LabError::file(folder, e);
    let read = fs::read_dir(folder).map_err(failed)?;
    let mut paths: Vec<PathBuf> =
        read.map(|entry| entry.map(|e| e.path())).collect::<Result<_, _>>().map_err(failed)?;
    paths.sort();
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_better_edition_is_taken_and_missing_scenes_are_left_out() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        assert!(find(folder.path(), false).expect_err("nothing").to_string().contains("has none of the scenes"));
        for file in ["fireplace_room/living-room.obj", "sibenik/sibenik.obj", "other/scene.glb"] {
            let file = folder.path().join(file);
            fs::create_dir_all(file.parent().expect("a folder")).expect("writable");
            fs::write(file, "x").expect("writable");
        }
        let found = find(folder.path(), false).expect("two");
        let names: Vec<&str> = found.iter().map(|scene| scene.name.as_str()).collect();
        assert_eq!(names, ["Fireplace", "Sibenik"]);
        assert!(found[0].edition != Edition::Same && found[1].edition == Edition::Same);
        assert_eq!(find(folder.path(), true).expect("the same").len(), 2);
    }

    #[test]
    fn a_quick_run_takes_the_largest_samples() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (name, size) in [("a", 5), ("b", 1), ("c", 9), ("d", 7)] {
            fs::create_dir(folder.path().join(name)).expect("writable");
            fs::write(folder.path().join(name).join("scene.glb"), vec![0; size]).expect("writable");
        }
        let found = find(folder.path(), true).expect("three");
        let names: Vec<&str> = found.iter().map(|scene| scene.name.as_str()).collect();
        assert_eq!(names, ["a", "c", "d"]);
    }
}
