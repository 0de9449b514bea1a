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
mod closed;
mod encoding;
mod files;
mod library;
mod look;
mod material;
mod mesh;
mod normals;
mod notes;
mod outline;
mod picture;
mod polygon;
mod polypaint;
mod scan;
mod shift;
mod streams;
mod text;
mod texture;
mod unpack;

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs::File;
use std::path::Path;

use bytes::Bytes;

use crate::document::Kind;
use crate::{Document, DoubleSided, Error, ObjOptions, kinds};
use assemble::{Assembled, Frame};
use files::Files;
use library::Libraries;
use material::Materials;
use notes::Notes;
use scan::Scan;

pub(crate) use outline::outline;

/// Whether to read the file as OBJ: its name ends in `.obj`, in any case, or in `.obj.gz`.
pub(crate) fn is_obj(path: &Path) -> bool {
    model_name(path).is_some()
}

/// Returns the name of an OBJ file without `.obj` or `.obj.gz`.
fn model_name(path: &Path) -> Option<&OsStr> {
    let is = |path: &Path, extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    let inner = if is(path, "gz") { Path::new(path.file_stem()?) } else { path };
    is(inner, "obj").then(|| inner.file_stem()).flatten()
}

/// Reads an OBJ file and its MTL files.
///
/// # Errors
/// Names the line of an OBJ statement that cannot be read: malformed positions; with `options.strict` also malformed
/// faces, and indices that are zero or out of range. Problems with an MTL file or a texture are warnings.
pub(crate) fn read(path: &Path, options: &ObjOptions) -> Result<Document, Error> {
    let model = model_name(path).unwrap_or_default();
    parsed(path, &source(path), Files::beside(path, model, &options.search), options)
}

/// Returns what reads the raw text of a file.
fn source(path: &Path) -> impl Fn() -> std::io::Result<Vec<Vec<u8>>> + '_ {
    move || {
        let file = File::open(path)?;
        let size = file.metadata()?.len();
        text::read_blocks(unpack::unpacked(file, size)?)
    }
}

/// Reads the bytes of an OBJ file. Its MTL files are not found, which is a warning.
pub(crate) fn read_bytes(name: &Path, bytes: Bytes, options: &ObjOptions) -> Result<Document, Error> {
    let source = || text::read_blocks(unpack::unpacked(&bytes[..], bytes.len() as u64)?);
    let doc = parsed(name, &source, Files::none(), options)?;
    Ok(Document { in_memory: Some(bytes), ..doc })
}

/// The raw text of an OBJ file, from its start.
type Source<'a> = &'a dyn Fn() -> std::io::Result<Vec<Vec<u8>>>;

fn parsed(path: &Path, source: Source<'_>, mut files: Files, options: &ObjOptions) -> Result<Document, Error> {
    let mut notes = Notes::default();
    let (scan, mut models) = match numbers(path, source, &mut files, options, false, &mut notes)? {
        Ok(parsed) => parsed,
        // `tobj` does not say where it fails.
        Err(_) => {
            notes = Notes::default();
            let again = numbers(path, source, &mut files, options, true, &mut notes)?;
            again.map_err(|cause| Error::whole(path, cause))?
        }
    };
    let libraries = Libraries::load(&scan.libraries, &scan.materials, &mut files, &mut notes);
    normals::apply(&scan, &mut models, options.normals);
    let open = materials_of_open_surfaces(&scan, &models, options.double_sided);
    let bare_is_double_sided = options.double_sided == DoubleSided::Always;
    let materials = Materials::of(libraries, files, open, bare_is_double_sided);
    let frame = Frame { z_up: options.z_up, unit: options.unit.unwrap_or(1.0) };
    let Assembled { json, buffer, residuals } = assemble::assemble(&scan, models, frame, materials, &mut notes);
    let buffers = if buffer.is_empty() { Vec::new() } else { vec![buffer.into()] };
    let warnings = notes.into_warnings();
    let path = path.to_owned();
    Ok(Document { json, buffers, path, kind: Kind::Obj, warnings, in_memory: None, residuals, sidecar: None })
}

/// Names of the materials that are seen from both sides.
fn materials_of_open_surfaces(scan: &Scan, models: &[tobj::Mesh], which: DoubleSided) -> HashSet<String> {
    let closed = match which {
        DoubleSided::Never => vec![true; models.len()],
        DoubleSided::Always => vec![false; models.len()],
        DoubleSided::Auto => closed::closed(&scan.parts, models),
    };
    let open = scan.parts.iter().zip(closed).filter(|(_, closed)| !closed);
    open.filter_map(|(part, _)| Some(scan.materials.get(part.material?).to_owned())).collect()
}

/// The scan of a text and the meshes of its parts, or why `tobj` cannot parse it.
type Parsed = Result<(Scan, Vec<tobj::Mesh>), tobj::LoadError>;

/// Scans and parses the text; with `check` the scan checks the numbers of elements.
fn numbers(
    path: &Path,
    source: Source<'_>,
    files: &mut Files,
    options: &ObjOptions,
    check: bool,
    notes: &mut Notes,
) -> Result<Parsed, Error> {
    let raw = source().map_err(|reason| Error::io(path, "", &reason))?;
    let start = raw.first().map_or(&[][..], |block| &block[..block.len().min(kinds::START)]);
    let size = raw.iter().map(|block| block.len() as u64).sum();
    if let Some(other) = kinds::other(start, size).or_else(|| kinds::gltf_as_obj(start)) {
        return Err(Error::whole(path, other));
    }
    let mut blocks = blocks(raw, files, notes);
    polypaint::apply(&mut blocks, notes);
    let scanned = Scan::of(blocks, options.strict, check, notes);
    let (scan, statements) = scanned.map_err(|fault| Error::at(path, text::place(fault.line), fault.cause))?;
    Ok(statements.parse().map(|models| (scan, models)))
}

/// Returns the text of a file in blocks; the last line ends in a line feed.
fn blocks(raw: Vec<Vec<u8>>, files: &mut Files, notes: &mut Notes) -> Vec<String> {
    let code_page = |blocks: &[Vec<u8>]| {
        let found = encoding::of_scene(blocks, files);
        files.encoding = Some(found);
        found
    };
    let mut blocks = text::decode(raw, code_page, notes);
    if let Some(last) = blocks.last_mut()
        && !last.ends_with('\n')
    {
        last.push('\n');
    }
    blocks
}
