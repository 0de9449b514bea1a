//! Reads a file into a [`Document`].

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use bytes::Bytes;
use serde_json::Value;

use super::json::At;
use super::uri::{self, Uri};
use super::{binary, bounds, compressed, extensions, provenance};
use crate::document::{Kind, Residuals};
use crate::{Document, Error, ErrorKind, Warning, kinds};

/// Reads a glTF or GLB file, distinguished by its first bytes.
/// Files that it names must be within `root`, if there is one.
pub(crate) fn read(path: &Path, root: Option<&Path>) -> Result<Document, Error> {
    let file = Bytes::from(fs::read(path).map_err(|e| Error::io(path, "", &e))?);
    let doc = parsed(path, &file, Some((uri::folder_of(path), root)))?;
    Ok(Document { sidecar: provenance::beside(path), ..doc })
}

/// Reads the bytes of a glTF or GLB file that refers to no other file.
pub(crate) fn read_bytes(name: &Path, bytes: Bytes) -> Result<Document, Error> {
    let mut doc = parsed(name, &bytes, None)?;
    check_images_are_inside(&At::root(&doc))?;
    doc.in_memory = Some(bytes);
    Ok(doc)
}

/// The document of a file's bytes. Without a `folder`, with the root of the files that it may name, it may refer to no file.
fn parsed(path: &Path, file: &Bytes, folder: Option<(&Path, Option<&Path>)>) -> Result<Document, Error> {
    let (mut json, bin, kind, mut warnings) = open(path, file)?;
    whole_numbers(&mut json);
    let root = At::new(path, &json);
    check_asset(&root)?;
    extensions::check_required_of_file(&root)?;
    if let Some((folder, bound)) = folder {
        bounds::check(&root, folder, bound, &mut warnings)?;
    }
    let buffers = load_buffers(&root, folder.map(|(folder, _)| folder), bin, &mut warnings)?;
    let residuals = Residuals::default();
    let path = path.to_owned();
    let mut doc = Document { json, buffers, path, kind, warnings, in_memory: None, residuals, sidecar: None };
    compressed::decompress(&mut doc)?;
    Ok(doc)
}

type Opened = (Value, Option<Bytes>, Kind, Vec<Warning>);

/// Returns the JSON and binary chunk of a file.
fn open(path: &Path, file: &Bytes) -> Result<Opened, Error> {
    if file.starts_with(binary::MAGIC) {
        let parts = binary::parts(path, file)?;
        let text = &file[parts.json];
        let padding = text.iter().rev().take_while(|b| **b == 0).count();
        let json = parse(path, "JSON chunk, ", without_mark(&text[..text.len() - padding]))?;
        return Ok((json, parts.bin.map(|range| file.slice(range)), Kind::Glb, parts.warnings));
    }
    if file.is_empty() {
        return Err(Error::whole(path, "the file is empty"));
    }
    if let Some(other) = kinds::other(&file[..file.len().min(kinds::START)], file.len() as u64) {
        return Err(Error::whole(path, other));
    }
    if path.extension().and_then(OsStr::to_str).is_some_and(|e| e.eq_ignore_ascii_case("glb")) {
        return Err(Error::whole(path, "wrong magic: a GLB file starts with the bytes \"glTF\""));
    }
    let text = without_mark(file);
    if text.trim_ascii_start().first().is_some_and(|b| *b != b'{') {
        return Err(Error::whole(path, "wrong magic: neither glTF JSON, which starts with \"{\", nor binary glTF"));
    }
    Ok((parse(path, "", text)?, None, Kind::Gltf, Vec::new()))
}

/// Returns a text without a byte order mark, which glTF forbids and some writers of JSON put first.
fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text)
}

/// Parses JSON. serde_json rejects values nested deeper than 128 levels, so no tree can exhaust the stack.
fn parse(path: &Path, part: &str, text: &[u8]) -> Result<Value, Error> {
    serde_json::from_slice(text).map_err(|e| {
        let message = e.to_string();
        let cause = message.split(" at line ").next().unwrap_or(&message);
        Error::at(path, format!("{part}line {} column {}", e.line(), e.column()), format_args!("JSON: {cause}"))
    })
}

/// Properties of glTF whose numbers are integers, alone or in a list.
const INTEGERS: [&str; 35] = [
    "bufferView",
    "byteOffset",
    "byteLength",
    "byteStride",
    "buffer",
    "componentType",
    "count",
    "target",
    "mesh",
    "skin",
    "camera",
    "node",
    "nodes",
    "children",
    "joints",
    "skeleton",
    "inverseBindMatrices",
    "indices",
    "material",
    "mode",
    "source",
    "sampler",
    "index",
    "texCoord",
    "scene",
    "input",
    "output",
    "magFilter",
    "minFilter",
    "wrapS",
    "wrapT",
    "light",
    "variants",
    "externalAsset",
    "file",
];

/// Writes integers as such that the file has as `36.0` or `3.6e1`: JSON does not tell them apart, readers do. Extras stay
/// as they are.
fn whole_numbers(json: &mut Value) {
    // Properties of "attributes" and "targets" are named by the file.
    let mut todo = vec![(false, json)];
    while let Some((is_integer, value)) = todo.pop() {
        match value {
            Value::Number(number) if is_integer && number.is_f64() => {
                if let Some(integer) = number.as_f64().filter(|x| x.fract() == 0.0 && x.abs() < 9e15) {
                    *value = Value::from(integer as i64);
                }
            }
            Value::Array(list) => todo.extend(list.iter_mut().map(|value| (is_integer, value))),
            Value::Object(map) => {
                let all = map.iter_mut().filter(|(key, _)| *key != "extras");
                let named = |key: &str| ["attributes", "targets"].contains(&key) || INTEGERS.contains(&key);
                todo.extend(all.map(|(key, value)| {
                    let is_integer = named(key) || is_integer && value.is_number();
                    (is_integer, value)
                }));
            }
            _ => {}
        }
    }
}

/// Rejects files of another glTF version.
fn check_asset(root: &At<'_>) -> Result<(), Error> {
    root.object()?;
    let asset = root.need("asset")?;
    let version = asset.need("version")?;
    if version.string()?.split('.').next() != Some("2") {
        return Err(version
            .error(format_args!("glTF version {} is not supported, only 2.x", version.value))
            .unsupported());
    }
    match asset.get("minVersion") {
        Some(min) if min.string()? != "2.0" => {
            Err(min.error(format_args!("glTF version {} is needed, only 2.0 is supported", min.value)).unsupported())
        }
        _ => Ok(()),
    }
}

/// Returns exactly `byteLength` bytes of each buffer, but none of a fallback buffer that is not there. A file that several
/// buffers name is read once.
fn load_buffers(
    root: &At<'_>,
    folder: Option<&Path>,
    bin: Option<Bytes>,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Bytes>, Error> {
    let mut files = BTreeMap::new();
    let mut unused_bin = bin.is_some();
    let mut buffers = Vec::new();
    for (i, at) in root.list("buffers")?.enumerate() {
        let length = at.need("byteLength")?.integer()?;
        let bytes = match (at.get("uri"), &bin) {
            (Some(uri), _) => match load_uri(&uri, folder, &mut files) {
                Err(error) if is_absent(&error) && compressed::is_fallback(root, i) => {
                    let message = format!("{}; its compressed form is used", error.cause);
                    warnings.push(Warning { place: error.place, message });
                    None
                }
                loaded => Some(loaded?),
            },
            (None, Some(bin)) if i == 0 => {
                unused_bin = false;
                Some(bin.clone())
            }
            (None, _) if length == 0 || compressed::is_fallback(root, i) => None,
            (None, _) => return Err(at.error("has neither a uri nor a BIN chunk, so there are no bytes")),
        };
        if let Some(bytes) = bytes.as_ref().filter(|bytes| bytes.len() < length) {
            return Err(at.error(format_args!("byteLength is {length}, but there are only {} bytes", bytes.len())));
        }
        buffers.push(bytes.map_or_else(Bytes::new, |bytes| bytes.slice(..length)));
    }
    if unused_bin {
        warnings.push(Warning { place: "BIN chunk".into(), message: "no buffer refers to it; it is left out".into() });
    }
    Ok(buffers)
}

/// Whether a buffer could not be read because its file is not there, or may not be read.
fn is_absent(error: &Error) -> bool {
    matches!(error.kind, ErrorKind::Io(_) | ErrorKind::Unsupported)
}

fn load_uri(at: &At<'_>, folder: Option<&Path>, files: &mut BTreeMap<PathBuf, Bytes>) -> Result<Bytes, Error> {
    let uri = at.string()?;
    match uri::parse(uri) {
        Uri::Data { base64, payload, .. } => {
            uri::decode(base64, payload).map(Bytes::from).map_err(|cause| at.error(cause))
        }
        Uri::Scheme(scheme) => {
            Err(at.error(format_args!("URIs of the scheme {scheme}: are not supported")).unsupported())
        }
        Uri::Malformed(cause) => Err(at.error(cause)),
        Uri::File(name) => {
            let file = uri::locate(folder.ok_or_else(|| refers_to_file(at))?, uri, &name);
            if let Some(bytes) = files.get(&file) {
                return Ok(bytes.clone());
            }
            let bytes = read_regular(&file).map_err(|e| {
                let cause = format_args!("the buffer file {} cannot be read: {e}", file.display());
                at.error(cause).of_kind(ErrorKind::Io(e.kind()))
            })?;
            files.insert(file, bytes.clone());
            Ok(bytes)
        }
    }
}

fn refers_to_file(at: &At<'_>) -> Error {
    at.error("refers to a file, which a scene read from memory cannot do").unsupported()
}

/// Refuses images that are files of their own.
fn check_images_are_inside(root: &At<'_>) -> Result<(), Error> {
    for image in root.list("images")? {
        if let Some(uri) = image.get("uri")
            && matches!(uri::parse(uri.string()?), Uri::File(_))
        {
            return Err(refers_to_file(&uri));
        }
    }
    Ok(())
}

/// Reads a file that a scene refers to; rejects pipes and devices, which may never end.
pub(crate) fn read_regular(file: &Path) -> std::io::Result<Bytes> {
    if !fs::metadata(file)?.is_file() {
        return Err(std::io::Error::other("not a regular file"));
    }
    fs::read(file).map(Bytes::from)
}
