//! Wavefront OBJ and MTL, made into a glTF [`Document`].
//!
//! ```text
//! text ─► scan ─► tobj ─► mesh (polygon) ─┐
//!            └──► library ─► material ────┴─► assemble ─► Document
//! ```
//! An object is a group/object of the file split by material: one node with one mesh for each, in order of first
//! appearance. `o` starts an object and ends the group before it; `g` names a group within the object. A name is the
//! rest of its line. Groups of one name within one object are one group, also when other groups lie between.
//!
//! `tobj` parses a normalised copy of the text, see [`scan`]: by itself it merges groups and objects, forgets the
//! names of undefined materials, invents missing texture coordinates and normals, takes lines for faces, shifts
//! vertex colours where some vertices have none, and stops at a Latin-1 byte.

mod assemble;
mod files;
mod library;
mod material;
mod mesh;
mod notes;
mod polygon;
mod scan;
mod streams;
mod text;
mod texture;

use std::path::Path;

use crate::document::Kind;
use crate::{Document, Error};
use files::Files;
use library::Libraries;
use material::Materials;
use notes::Notes;
use scan::{Fault, Scan};

/// Whether the file is to be read as OBJ.
pub(crate) fn is_obj(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"))
}

/// Reads an OBJ file and its MTL files.
///
/// # Errors
/// Names the line of an OBJ statement that cannot be read: malformed numbers, indices that are zero or out of range.
/// What is wrong with an MTL file or a texture is a warning.
pub(crate) fn read(path: &Path) -> Result<Document, Error> {
    let bytes = std::fs::read(path).map_err(|cause| Error::whole(path, cause))?;
    let mut notes = Notes::default();
    let text = text::decode(bytes, &mut notes);
    let at_line = |fault: Fault| Error::at(path, text::place(fault.line), fault.cause);
    let scan = Scan::of(&text, &mut notes).map_err(at_line)?;
    let models = scan.parse().map_err(|cause| match scan::first_malformed(&text) {
        Some(fault) => at_line(fault),
        None => Error::whole(path, cause),
    })?;

    let mut files = Files::beside(path);
    let libraries = Libraries::load(&scan.libraries, &mut files, &mut notes);
    let mut materials = Materials::default();
    let material_of_name: Vec<Option<usize>> =
        scan.materials.iter().map(|name| materials.resolve(name, &libraries, &mut files, &mut notes)).collect();

    let (json, buffer) = assemble::assemble(&scan, models, &material_of_name, materials, &mut notes);
    let buffers = if buffer.is_empty() { Vec::new() } else { vec![buffer.into()] };
    Ok(Document { json, buffers, path: path.to_owned(), kind: Kind::Obj, warnings: notes.into_warnings() })
}
