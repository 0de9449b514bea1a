//! Reads a file into a [`Document`].

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use bytes::Bytes;
use serde_json::Value;

use super::extensions::{self, COMPRESSED, MESHOPT};
use super::json::{At, unsigned};
use super::uri::{self, Uri};
use super::{binary, edit};
use crate::document::{Kind, Residuals};
use crate::extension_names::KHR_DRACO_MESH_COMPRESSION;
use crate::{Document, Error, ErrorKind, Warning};

/// Reads a glTF or GLB file, distinguished by its first bytes.
pub(crate) fn read(path: &Path) -> Result<Document, Error> {
    let file = Bytes::from(fs::read(path).map_err(|e| Error::io(path, "", &e))?);
    parsed(path, &file, Some(uri::folder_of(path)))
}

/// Reads the bytes of a glTF or GLB file that refers to no other file.
pub(crate) fn read_bytes(name: &Path, bytes: Bytes) -> Result<Document, Error> {
    let mut doc = parsed(name, &bytes, None)?;
    check_images_are_inside(&At::root(&doc))?;
    doc.in_memory = Some(bytes);
    Ok(doc)
}

/// The document of a file's bytes. Without a `folder` it may refer to no buffer file.
fn parsed(path: &Path, file: &Bytes, folder: Option<&Path>) -> Result<Document, Error> {
    let (json, bin, kind, mut warnings) = open(path, file)?;
    let root = At::new(path, &json);
    check_asset(&root)?;
    extensions::check_required(&root)?;
    let buffers = load_buffers(&root, folder, bin, &mut warnings)?;
    let residuals = Residuals::default();
    let mut doc = Document { json, buffers, path: path.to_owned(), kind, warnings, in_memory: None, residuals };
    drop_draco(&mut doc)?;
    drop_meshopt(&mut doc);
    Ok(doc)
}

type Opened = (Value, Option<Bytes>, Kind, Vec<Warning>);

/// Returns the JSON and binary chunk of a file.
fn open(path: &Path, file: &Bytes) -> Result<Opened, Error> {
    if file.starts_with(binary::MAGIC) {
        let parts = binary::parts(path, file)?;
        let text = &file[parts.json];
        let padding = text.iter().rev().take_while(|b| **b == 0).count();
        let json = parse(path, "JSON chunk, ", &text[..text.len() - padding])?;
        return Ok((json, parts.bin.map(|range| file.slice(range)), Kind::Glb, parts.warnings));
    }
    if file.is_empty() {
        return Err(Error::whole(path, "the file is empty"));
    }
    if path.extension().and_then(OsStr::to_str).is_some_and(|e| e.eq_ignore_ascii_case("glb")) {
        return Err(Error::whole(path, "wrong magic: a GLB file starts with the bytes \"glTF\""));
    }
    let text = file.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(file);
    if text.trim_ascii_start().first().is_some_and(|b| *b != b'{') {
        return Err(Error::whole(path, "wrong magic: neither glTF JSON, which starts with \"{\", nor binary glTF"));
    }
    Ok((parse(path, "", text)?, None, Kind::Gltf, Vec::new()))
}

/// Parses JSON. serde_json rejects values nested deeper than 128 levels, so no tree can exhaust the stack.
fn parse(path: &Path, part: &str, text: &[u8]) -> Result<Value, Error> {
    serde_json::from_slice(text).map_err(|e| {
        let message = e.to_string();
        let cause = message.split(" at line ").next().unwrap_or(&message);
        Error::at(path, format!("{part}line {} column {}", e.line(), e.column()), format_args!("JSON: {cause}"))
    })
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

/// Returns exactly `byteLength` bytes of each buffer. A file that several buffers name is read once.
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
            (Some(uri), _) => load_uri(&uri, folder, &mut files)?,
            (None, Some(bin)) if i == 0 => {
                unused_bin = false;
                bin.clone()
            }
            (None, _) if length == 0 => Bytes::new(),
            (None, _) => return Err(no_bytes(&at)),
        };
        if bytes.len() < length {
            return Err(at.error(format_args!("byteLength is {length}, but there are only {} bytes", bytes.len())));
        }
        buffers.push(bytes.slice(..length));
    }
    if unused_bin {
        warnings.push(Warning { place: "BIN chunk".into(), message: "no buffer refers to it; it is left out".into() });
    }
    Ok(buffers)
}

fn no_bytes(at: &At<'_>) -> Error {
    match MESHOPT.iter().find(|name| at.extension(name).is_some()) {
        Some(name) => {
            at.error(format_args!("{name} has no uncompressed fallback here, and {COMPRESSED}")).unsupported()
        }
        None => at.error("has neither a uri nor a BIN chunk, so there are no bytes"),
    }
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

/// Drops optional Draco compression: the uncompressed accessors hold the same data, and the compressed copy would
/// contradict every changed primitive.
fn drop_draco(doc: &mut Document) -> Result<(), Error> {
    let root = At::root(doc);
    let mut dropped = 0;
    for mesh in root.list("meshes")? {
        for primitive in mesh.list("primitives")? {
            if primitive.extension(KHR_DRACO_MESH_COMPRESSION).is_some() {
                check_fallback(&root, &primitive)?;
                dropped += 1;
            }
        }
    }
    if dropped > 0 {
        edit::each_primitive(&mut doc.json, |primitive| {
            extensions::remove(primitive, KHR_DRACO_MESH_COMPRESSION);
        });
        extensions::forget(&mut doc.json, KHR_DRACO_MESH_COMPRESSION);
        let message = format!(
            "{KHR_DRACO_MESH_COMPRESSION} of {dropped} primitives is left out; their uncompressed accessors are used"
        );
        doc.warnings.push(Warning { place: "meshes".into(), message });
    }
    Ok(())
}

/// Rejects a Draco primitive whose accessors have no data of their own.
fn check_fallback(root: &At<'_>, primitive: &At<'_>) -> Result<(), Error> {
    let accessors = root.get("accessors");
    let attributes = primitive.get("attributes").and_then(|at| at.value.as_object());
    let attributes = attributes.into_iter().flat_map(|map| map.values());
    for index in attributes.chain(primitive.value.get("indices")) {
        let accessor = unsigned(index).and_then(|i| accessors?.element(i));
        if accessor.is_some_and(|at| at.get("bufferView").is_none() && at.get("sparse").is_none()) {
            let cause =
                format_args!("{KHR_DRACO_MESH_COMPRESSION} has no uncompressed fallback here, and {COMPRESSED}");
            return Err(primitive.error(cause).unsupported());
        }
    }
    Ok(())
}

/// Drops optional meshopt compression, like [`drop_draco`]. Fallback buffers without bytes were already rejected.
fn drop_meshopt(doc: &mut Document) {
    for name in MESHOPT {
        let mut dropped = 0;
        for list in ["bufferViews", "buffers"] {
            for item in doc.json.get_mut(list).and_then(Value::as_array_mut).into_iter().flatten() {
                let found = extensions::remove(item, name).is_some();
                dropped += usize::from(found && list == "bufferViews");
            }
        }
        if dropped > 0 {
            extensions::forget(&mut doc.json, name);
            let message = format!("{name} of {dropped} buffer views is left out; their uncompressed bytes are used");
            doc.warnings.push(Warning { place: "bufferViews".into(), message });
        }
    }
}
