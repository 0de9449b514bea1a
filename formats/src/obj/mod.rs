//! Converts Wavefront OBJ and MTL to a glTF [`Document`].
//!
//! ```text
//! text ─► scan ─► tobj ─► mesh (polygon) ─┐
//!            └──► library ─► material ────┴─► assemble ─► Document
//! ```
//! An object is a group/object of the file split by material: one node with one mesh per material, in order of first
//! appearance. `o` starts an object and ends the previous group; `g` names a group within the object. A name is the
//! rest of its line. Groups of one name within one object are one group, even if other groups lie between.
//!
//! Coordinates are read in double precision and stored as 32-bit floats, far from the origin relative to a point near the
//! object's middle, see [`shift`].
//!
//! `tobj` parses the text in a normalised form, see [`scan`]: by itself it merges groups and objects, drops the names
//! of undefined materials, invents missing texture coordinates and normals, treats lines as faces, shifts vertex
//! colours if some vertices have none, and stops at a Latin-1 byte.

mod assemble;
mod files;
mod library;
mod material;
mod mesh;
mod notes;
mod outline;
mod polygon;
mod scan;
mod shift;
mod streams;
mod text;
mod texture;

use std::fs::File;
use std::path::Path;

use bytes::Bytes;

use crate::document::Kind;
use crate::{Document, Error};
use assemble::Assembled;
use files::Files;
use library::Libraries;
use material::Materials;
use notes::Notes;
use scan::{Fault, Scan};

pub(crate) use outline::outline;

/// Whether to read the file as OBJ.
pub(crate) fn is_obj(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"))
}

/// Reads an OBJ file and its MTL files.
///
/// # Errors
/// Names the line of an OBJ statement that cannot be read: malformed numbers, indices that are zero or out of range.
/// Problems with an MTL file or a texture are warnings.
pub(crate) fn read(path: &Path) -> Result<Document, Error> {
    parsed(path, &|| text::read_blocks(File::open(path)?), Files::beside(path))
}

/// Reads the bytes of an OBJ file. Its MTL files are not found, which is a warning.
pub(crate) fn read_bytes(name: &Path, bytes: Bytes) -> Result<Document, Error> {
    let doc = parsed(name, &|| text::read_blocks(&bytes[..]), Files::none())?;
    Ok(Document { in_memory: Some(bytes), ..doc })
}

/// The raw text of an OBJ file, from its start.
type Source<'a> = &'a dyn Fn() -> std::io::Result<Vec<Vec<u8>>>;

fn parsed(path: &Path, source: Source<'_>, mut files: Files) -> Result<Document, Error> {
    let whole = |reason: std::io::Error| Error::io(path, "", &reason);
    let mut notes = Notes::default();
    let blocks = blocks(source, &mut notes).map_err(whole)?;
    let at_line = |fault: Fault| Error::at(path, text::place(fault.line), fault.cause);
    let (scan, statements) = Scan::of(blocks, &mut notes).map_err(at_line)?;
    let models = statements.parse().map_err(|cause| match first_malformed(source) {
        Some(fault) => at_line(fault),
        None => Error::whole(path, cause),
    })?;

    let libraries = Libraries::load(&scan.libraries, &mut files, &mut notes);
    let materials = Materials::of(libraries, files);
    let Assembled { json, buffer, residuals } = assemble::assemble(&scan, models, materials, &mut notes);
    let buffers = if buffer.is_empty() { Vec::new() } else { vec![buffer.into()] };
    let warnings = notes.into_warnings();
    Ok(Document { json, buffers, path: path.to_owned(), kind: Kind::Obj, warnings, in_memory: None, residuals })
}

/// Returns the text of a file in blocks; the last line ends in a line feed.
fn blocks(source: Source<'_>, notes: &mut Notes) -> std::io::Result<Vec<String>> {
    let mut blocks = text::decode(source()?, notes);
    if let Some(last) = blocks.last_mut()
        && !last.ends_with('\n')
    {
        last.push('\n');
    }
    Ok(blocks)
}

/// Returns the first malformed coordinate of a file that `tobj` could not parse. Reads the file again, because parsing
/// frees its text.
fn first_malformed(source: Source<'_>) -> Option<Fault> {
    scan::first_malformed(&blocks(source, &mut Notes::default()).ok()?)
}
