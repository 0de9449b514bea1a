//! Writes a [`Document`] to staged files.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use super::binary::{BIN, CHUNK_HEADER, HEADER, JSON, MAGIC};
use super::compressed::writing;
use super::images::Images;
use super::json::At;
use super::outline::files_of;
use super::pack::Packed;
use super::read::read_regular;
use super::staged;
use super::uri::{self, Uri};
use crate::document::{Compression, Document, Kind, Staged};
use crate::{Error, Warning, record};

pub(crate) fn check(out: &Path) -> Result<(), Error> {
    kind_of(out)?;
    staged::check(out)
}

/// Whether a file of an earlier output can be put beside `out`: its name stays in the folder, and it replaces no buffer of
/// something else.
pub(crate) fn can_hold(out: &Path, name: &Path) -> bool {
    let file = uri::folder_of(out).join(name);
    let is_buffer = name.extension().is_some_and(|extension| extension == "bin");
    let is_foreign = || file.symlink_metadata().is_ok() && !buffer_files(out).contains(&file);
    name.to_str().is_some_and(uri::stays_inside) && !(is_buffer && is_foreign())
}

pub(crate) fn stage(doc: &Document, out: &Path) -> Result<Staged, Error> {
    stage_with(doc, out, Compression::None)
}

pub(crate) fn stage_with(doc: &Document, out: &Path, compression: Compression) -> Result<Staged, Error> {
    let kind = kind_of(out)?;
    let same_folder = is_same_folder(&doc.path, out);
    let name = file_name(out)?;
    let references = References::of(doc)?;
    check_references_survive(&references, doc, out, same_folder)?;
    let bin = bin_name(out, &references, same_folder && !is_same_file(&doc.path, out));
    let mut staged = Staged::new(out)?;
    let compressed = match compression {
        Compression::None => Vec::new(),
        Compression::Meshopt => writing::compress(doc)?,
    };
    let mut packed = Packed::new(doc, &compressed)?;
    let mut images = Images::new(doc, kind, same_folder, &[&name, &bin]);
    let images = images.place(&mut packed, &mut staged)?;
    let uri = (kind == Kind::Gltf).then(|| uri::encode(&bin));
    let buffers = joined_buffer(doc, uri, &packed, &mut staged.warnings);
    let views = std::mem::take(&mut packed.views);
    let views = views.as_array().is_some_and(|list| !list.is_empty()).then_some(views);
    let mut lists = vec![("buffers", buffers), ("bufferViews", views), ("images", images)];
    if packed.placeholder > 0 {
        let names = ["extensionsUsed", "extensionsRequired"];
        lists.extend(names.map(|list| (list, Some(writing::with_extension(&doc.json, list)))));
    }
    let json = to_text(&doc.json, &lists);
    stage_sidecar(doc, &name, &mut staged)?;
    match kind {
        Kind::Glb => write_glb(&mut staged, &name, &json, &packed, out)?,
        Kind::Gltf | Kind::Obj => {
            if packed.length > 0 {
                staged.warnings.extend(other_name_warning(out, &bin));
                staged.write(Path::new(&bin), |file| packed.write(file))?;
            }
            staged.write(Path::new(&name), |file| file.write_all(&json))?;
        }
    }
    Ok(staged)
}

pub(crate) fn stage_unchanged(doc: &Document, out: &Path) -> Result<Staged, Error> {
    let same_folder = is_same_folder(&doc.path, out);
    let references = References::of(doc)?;
    let name = file_name(out)?;
    if kind_of(out)? != doc.kind || !references.can_follow(&name, same_folder) {
        return stage(doc, out);
    }
    check_references_survive(&references, doc, out, same_folder)?;
    let mut staged = Staged::new(out)?;
    staged.is_input = true;
    for reference in &references.buffers {
        match same_folder {
            true => staged.lend(&reference.file, &reference.name)?,
            false => staged.copy(&reference.file, &reference.name)?,
        }
    }
    for reference in references.images.iter().filter(|_| !same_folder) {
        if reference.file.is_file() {
            staged.copy(&reference.file, &reference.name)?;
        } else {
            let message = format!("the image {} is missing", reference.name.display());
            staged.warnings.push(Warning { place: String::new(), message });
        }
    }
    stage_sidecar(doc, &name, &mut staged)?;
    if let Some(bytes) = &doc.in_memory {
        staged.write(Path::new(&name), |out| out.write_all(bytes))?;
    } else {
        let mut file = File::open(&doc.path).map_err(|e| Error::io(&doc.path, "", &e))?;
        staged.write(Path::new(&name), |out| io::copy(&mut file, out).map(|_| ()))?;
    }
    Ok(staged)
}

/// Stages the record that is to lie beside a scene of this name.
fn stage_sidecar(doc: &Document, name: &str, staged: &mut Staged) -> Result<(), Error> {
    let Some(record) = &doc.sidecar else { return Ok(()) };
    staged.write(&record::sidecar(Path::new(name)), |file| Ok(serde_json::to_writer_pretty(file, record)?))
}

/// Returns the size of the document's file and of the buffer files that it refers to, in bytes.
pub(crate) fn file_bytes(doc: &Document) -> Option<u64> {
    if let Some(bytes) = &doc.in_memory {
        return Some(bytes.len() as u64);
    }
    let buffers = references(doc, "buffers").ok()?;
    let files = std::iter::once(&doc.path).chain(buffers.iter().map(|reference| &reference.file));
    files.map(|file| fs::metadata(file).ok().map(|metadata| metadata.len())).sum()
}

/// Returns the kind of file for the extension of `out`.
pub(super) fn kind_of(out: &Path) -> Result<Kind, Error> {
    match out.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase).as_deref() {
        Some("glb") => Ok(Kind::Glb),
        Some("gltf") => Ok(Kind::Gltf),
        _ => Err(Error::output(out, "the name of an output must end in .glb or .gltf")),
    }
}

fn file_name(out: &Path) -> Result<String, Error> {
    let name = out.file_name().and_then(OsStr::to_str);
    name.map(str::to_owned).ok_or_else(|| Error::output(out, "the file name is not UTF-8"))
}

/// Compares canonical paths, to resolve links.
fn is_same_folder(a: &Path, b: &Path) -> bool {
    match (fs::canonicalize(uri::folder_of(a)), fs::canonicalize(uri::folder_of(b))) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

fn is_same_file(a: &Path, b: &Path) -> bool {
    matches!((fs::canonicalize(a), fs::canonicalize(b)), (Ok(a), Ok(b)) if a == b)
}

/// A file that the document refers to.
struct Reference {
    /// Relative to the document's folder.
    name: PathBuf,
    file: PathBuf,
}

/// All files that a document refers to, without duplicates.
struct References {
    buffers: Vec<Reference>,
    images: Vec<Reference>,
}

impl References {
    fn of(doc: &Document) -> Result<Self, Error> {
        Ok(References { buffers: references(doc, "buffers")?, images: references(doc, "images")? })
    }

    /// Whether all files can have the same relative names for an output of this name as for the input.
    fn can_follow(&self, name: &str, same_folder: bool) -> bool {
        let clash = |r: &Reference| r.name.to_string_lossy().to_lowercase() == name.to_lowercase();
        let follows = |r: &Reference| r.name.to_str().is_some_and(uri::stays_inside) && (same_folder || !clash(r));
        self.buffers.iter().all(follows) && (same_folder || self.images.iter().all(follows))
    }
}

fn references(doc: &Document, list: &'static str) -> Result<Vec<Reference>, Error> {
    let folder = uri::folder_of(&doc.path);
    let mut found: Vec<Reference> = Vec::new();
    let mut seen = std::collections::BTreeSet::new();
    for at in At::root(doc).list(list)? {
        let Some(text) = at.get("uri").and_then(|uri| uri.value.as_str()) else { continue };
        let Uri::File(name) = uri::parse(text) else { continue };
        let file = uri::locate(folder, text, &name);
        if seen.insert(file.clone()) {
            let name = if file == folder.join(&*name) { PathBuf::from(&*name) } else { PathBuf::from(text) };
            found.push(Reference { name, file });
        }
    }
    Ok(found)
}

/// Rejects an output that would replace a buffer or an image of its own input.
fn check_references_survive(
    references: &References,
    doc: &Document,
    out: &Path,
    same_folder: bool,
) -> Result<(), Error> {
    let mut all = references.buffers.iter().chain(&references.images);
    match all.find(|r| same_folder && is_same_file(&r.file, out)) {
        Some(_) => Err(Error::output(out, format_args!("is a file that {} refers to", doc.path.display()))),
        None => Ok(()),
    }
}

/// Returns the name of the buffer file: that of the scene file with `.bin`, or with a number, so that it replaces
/// neither a file of the input, still in use, nor one that is not a buffer of the replaced scene file.
fn bin_name(out: &Path, references: &References, spare_input: bool) -> String {
    let used = |name: &str| {
        let mut all = references.buffers.iter().chain(&references.images);
        all.any(|r| r.name.to_string_lossy().to_lowercase() == name.to_lowercase())
    };
    let replaced = buffer_files(out);
    let foreign = |name: &str| {
        let file = uri::folder_of(out).join(name);
        file.symlink_metadata().is_ok() && !replaced.contains(&file)
    };
    let mut names = (0..).map(|number| numbered_bin(out, number));
    names.find(|name| !(spare_input && used(name) || foreign(name))).unwrap_or_default()
}

fn numbered_bin(scene: &Path, number: u32) -> String {
    let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
    if number == 0 { format!("{stem}.bin") } else { format!("{stem}_{number}.bin") }
}

/// Returns the buffer files of a `.gltf` file; empty if it cannot be read.
fn buffer_files(scene: &Path) -> Vec<PathBuf> {
    let json = read_regular(scene).ok().and_then(|text| serde_json::from_slice::<Value>(&text).ok());
    json.iter().flat_map(|json| files_of(json, "buffers", scene)).collect()
}

fn other_name_warning(out: &Path, bin: &str) -> Option<Warning> {
    let usual = numbered_bin(out, 0);
    let message = format!("{usual} is a file of something else; the buffer is written as {bin}");
    (bin != usual).then(|| Warning { place: "buffers".into(), message })
}

/// Returns the `buffers` list of the output: the first buffer's properties, with another length and name.
fn joined_buffer(doc: &Document, uri: Option<String>, packed: &Packed, warnings: &mut Vec<Warning>) -> Option<Value> {
    if packed.length == 0 {
        return None;
    }
    let own = |key: &String| key != "uri" && key != "byteLength";
    let old = doc.json.get("buffers").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let lost = old.iter().skip(1).filter_map(Value::as_object).filter(|buffer| buffer.keys().any(own)).count();
    if lost > 0 {
        let message = format!("names, extras or extensions of {lost} buffers are lost in joining them with the first");
        warnings.push(Warning { place: "buffers".into(), message });
    }
    let mut buffer = Map::new();
    buffer.extend(uri.map(|uri| ("uri".to_owned(), Value::from(uri))));
    buffer.insert("byteLength".into(), packed.length.into());
    let rest = old.first().and_then(Value::as_object).into_iter().flatten();
    buffer.extend(rest.filter(|(key, _)| own(key)).map(|(key, value)| (key.clone(), value.clone())));
    let placeholder = (packed.placeholder > 0).then(|| writing::placeholder(packed.placeholder));
    Some([Value::Object(buffer)].into_iter().chain(placeholder).collect())
}

/// Returns the JSON text of a document, with some lists replaced or (if `None`) left out.
fn to_text(json: &Value, lists: &[(&str, Option<Value>)]) -> Vec<u8> {
    let replaced = |key: &str| lists.iter().find(|(list, _)| *list == key);
    let old = json.as_object().into_iter().flatten();
    let old = old.filter_map(|(key, value)| match replaced(key) {
        Some((_, list)) => Some((key.as_str(), list.as_ref()?)),
        None => Some((key.as_str(), value)),
    });
    let new = lists.iter().filter(|(key, _)| json.get(key).is_none());
    let new = new.filter_map(|(key, list)| Some((*key, list.as_ref()?)));
    let mut text = Vec::new();
    for (key, value) in old.chain(new) {
        let start = if text.is_empty() { '{' } else { ',' };
        // Writing to memory cannot fail.
        let _ = write!(text, "{start}{}:", Value::from(key));
        let _ = serde_json::to_writer(&mut text, value);
    }
    text.extend_from_slice(if text.is_empty() { b"{}" } else { b"}" });
    text
}

fn write_glb(staged: &mut Staged, name: &str, json: &[u8], packed: &Packed, out: &Path) -> Result<(), Error> {
    let json_length = json.len().next_multiple_of(4);
    let bin_length = packed.length.next_multiple_of(4);
    let bin_chunk = if bin_length > 0 { CHUNK_HEADER + bin_length } else { 0 };
    let total = HEADER + CHUNK_HEADER + json_length + bin_chunk;
    let Ok(total) = u32::try_from(total) else {
        let cause = format!("{total} bytes are more than the 4 GiB that a GLB file can hold; write .gltf instead");
        return Err(Error::output(out, cause));
    };
    staged.write(Path::new(name), |file| {
        // All lengths are at most the total, which fits in 32 bits.
        let chunk = |length: usize| (length as u32).to_le_bytes();
        file.write_all(MAGIC)?;
        file.write_all(&2_u32.to_le_bytes())?;
        file.write_all(&total.to_le_bytes())?;
        file.write_all(&chunk(json_length))?;
        file.write_all(JSON)?;
        file.write_all(json)?;
        file.write_all(&[b' '; 3][..json_length - json.len()])?;
        if bin_length > 0 {
            file.write_all(&chunk(bin_length))?;
            file.write_all(BIN)?;
            packed.write(file)?;
            file.write_all(&[0; 3][..bin_length - packed.length])?;
        }
        Ok(())
    })
}
