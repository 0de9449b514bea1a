//! The files that an OBJ file refers to and the number of its triangles, from its statements alone.

use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::files::Files;
use super::library::library_files;
use super::notes::Notes;
use super::text;
use super::texture::Statement;
use crate::outline::Outline;
use crate::{Error, ObjOptions};

/// Returns the outline of an OBJ file. Its material libraries and textures are found as its reader finds them.
pub(crate) fn outline(path: &Path, options: &ObjOptions) -> Result<Outline, Error> {
    let mut notes = Notes::default();
    let raw = super::source(path)().map_err(|e| Error::io(path, "", &e))?;
    let mut files = Files::beside(path, super::model_name(path).unwrap_or_default(), &options.search);
    let texts = super::blocks(raw, &mut files, &mut notes);
    let statements: Vec<(u64, Vec<String>)> = texts.par_iter().map(|text| statements(text)).collect();
    let triangles = statements.iter().map(|(triangles, _)| triangles).sum();
    let written = statements.iter().flat_map(|(_, libraries)| libraries);
    let mut libraries: Vec<PathBuf> =
        written.flat_map(|written| library_files(written, 0, &mut files, &mut notes)).collect();
    // It is read if a material is not defined otherwise.
    libraries.extend(files.namesake().filter(|file| !libraries.contains(file)));
    let textures: Vec<PathBuf> = libraries.iter().flat_map(|library| textures(library, &mut files)).collect();
    let files = libraries.into_iter().chain(textures).collect();
    Ok(Outline { files, bytes: 0, triangles_stored: triangles, triangles_placed: triangles })
}

/// The number of triangles of a text, and what its `mtllib` statements say.
fn statements(text: &str) -> (u64, Vec<String>) {
    let (mut triangles, mut libraries) = (0, Vec::new());
    for line in text::lines(text) {
        let (key, rest) = line.text();
        match key {
            "f" | "fo" | "F" | "FO" => triangles += text::words(rest).count().saturating_sub(2) as u64,
            _ if key.eq_ignore_ascii_case("mtllib") => libraries.push(rest.to_owned()),
            _ => {}
        }
    }
    (triangles, libraries)
}

/// The textures of a material library that exist.
fn textures(library: &Path, files: &mut Files) -> Vec<PathBuf> {
    let folder = library.parent().unwrap_or(Path::new(""));
    let text = super::library::text(fs::read(library).unwrap_or_default(), folder, files, &mut Notes::default());
    let names = text::lines(&text).filter_map(|line| {
        let (key, rest) = line.text();
        let key = key.to_ascii_lowercase();
        let others = ["bump", "disp", "decal", "norm", "refl"];
        let is_texture = key.starts_with("map_") || others.contains(&key.as_str());
        is_texture.then(|| Statement::parse(rest).file)
    });
    names.collect::<Vec<_>>().iter().filter_map(|name| files.find(folder, name)).collect()
}
