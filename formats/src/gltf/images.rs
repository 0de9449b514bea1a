//! Images of an output: embedded, copied next to it, or left in place.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use bytes::Bytes;
use serde_json::Value;

use super::json::At;
use super::pack::Packed;
use super::read::read_regular;
use super::uri::{self, Uri};
use crate::document::{Kind, Staged};
use crate::{Document, Error};

/// Decides where the images of an output go.
pub(super) struct Images<'a> {
    doc: &'a Document,
    kind: Kind,
    /// Whether the output is in the folder of the input.
    same_folder: bool,
    /// Names already used in the output's folder, in lower case.
    taken: BTreeSet<String>,
    /// Files already embedded, with their buffer view and media type.
    embedded: BTreeMap<PathBuf, (usize, &'static str)>,
    copied: BTreeMap<PathBuf, String>,
}

impl<'a> Images<'a> {
    /// Creates the state; `taken` are file names that no image may use.
    pub(super) fn new(doc: &'a Document, kind: Kind, same_folder: bool, taken: &[&str]) -> Self {
        let taken = taken.iter().map(|name| name.to_lowercase()).collect();
        Images { doc, kind, same_folder, taken, embedded: BTreeMap::new(), copied: BTreeMap::new() }
    }

    /// Returns the `images` list of the output, if the document has images.
    pub(super) fn place(&mut self, packed: &mut Packed, staged: &mut Staged) -> Result<Option<Value>, Error> {
        let root = At::root(self.doc);
        if root.get("images").is_none() {
            return Ok(None);
        }
        let mut images = Vec::new();
        for at in root.list("images")? {
            let uri = at.get("uri").and_then(|uri| uri.value.as_str());
            images.push(match uri {
                Some(uri) => self.place_uri(&at, uri, packed, staged)?,
                None => at.value.clone(),
            });
        }
        Ok(Some(Value::Array(images)))
    }

    fn place_uri(&mut self, at: &At<'_>, uri: &str, packed: &mut Packed, staged: &mut Staged) -> Result<Value, Error> {
        let glb = self.kind == Kind::Glb;
        let stays = match uri::parse(uri) {
            Uri::Data { media, base64, payload } if glb => match uri::decode(base64, payload) {
                Ok(data) => match mime_type(&data).or(Some(media).filter(|media| media.starts_with("image/"))) {
                    Some(mime) => return Ok(embed(at.value, packed.push(data.into()), mime)),
                    None => Some("the type of the image is unknown".to_owned()),
                },
                Err(cause) => Some(cause),
            },
            Uri::File(name) => return self.place_file(at, uri, &name, packed, staged),
            Uri::Scheme(scheme) if glb => Some(format!("URIs of the scheme {scheme}: are not embedded")),
            Uri::Malformed(cause) => Some(cause.to_owned()),
            Uri::Data { .. } | Uri::Scheme(_) => None,
        };
        if let Some(cause) = stays {
            staged.warnings.push(at.warning(format_args!("{cause}; it stays as it is")));
        }
        Ok(at.value.clone())
    }

    fn place_file(
        &mut self,
        at: &At<'_>,
        uri: &str,
        name: &str,
        packed: &mut Packed,
        staged: &mut Staged,
    ) -> Result<Value, Error> {
        let file = uri::locate(uri::folder_of(&self.doc.path), uri, name);
        if !file.is_file() {
            staged.warnings.push(at.warning(format_args!("the image {name} is missing; it stays a reference")));
            return Ok(at.value.clone());
        }
        if self.kind == Kind::Glb {
            if let Some((view, mime)) = self.embed_file(&file, packed)? {
                return Ok(embed(at.value, view, mime));
            }
            let message = format!("the image {name} is neither PNG, JPEG, WebP, KTX2, DDS nor AVIF; it stays a file");
            staged.warnings.push(at.warning(message));
        }
        let mut image = at.value.clone();
        if !self.same_folder {
            let literal = file == uri::folder_of(&self.doc.path).join(uri);
            let wanted = if literal { uri } else { name };
            let copy = self.copy(&file, wanted, staged)?;
            if plain(&copy) != plain(wanted) {
                image["uri"] = uri::encode(&copy).into();
            }
        }
        Ok(image)
    }

    /// Embeds a file and returns its buffer view and media type; `None` if its type is unknown.
    fn embed_file(&mut self, file: &Path, packed: &mut Packed) -> Result<Option<(usize, &'static str)>, Error> {
        if let Some(found) = self.embedded.get(file) {
            return Ok(Some(*found));
        }
        let data: Bytes = read_regular(file).map_err(|e| Error::io(file, "", &e))?;
        let Some(mime) = mime_type(&data) else { return Ok(None) };
        let view = packed.push(data);
        self.embedded.insert(file.to_owned(), (view, mime));
        Ok(Some((view, mime)))
    }

    /// Copies a file next to the output, under its relative name if that stays within the folder and is free.
    fn copy(&mut self, file: &Path, wanted: &str, staged: &mut Staged) -> Result<String, Error> {
        if let Some(name) = self.copied.get(file) {
            return Ok(name.clone());
        }
        let name = match uri::stays_inside(wanted) && self.taken.insert(caseless(wanted)) {
            true => wanted.to_owned(),
            false => self.free_name(file),
        };
        staged.copy(file, Path::new(&name))?;
        self.copied.insert(file.to_owned(), name.clone());
        Ok(name)
    }

    /// Returns an unused name directly in the output's folder.
    fn free_name(&mut self, file: &Path) -> String {
        let text = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
        let (stem, extension) = (text(file.file_stem()), text(file.extension()));
        let names = (0..).map(|i| match i {
            0 => format!("{stem}.{extension}"),
            _ => format!("{stem}_{i}.{extension}"),
        });
        let taken = &mut self.taken;
        names
            .map(|name| name.trim_end_matches('.').to_owned())
            .find(|name| taken.insert(caseless(name)))
            .unwrap_or(stem)
    }
}

/// Returns a relative name without `./`.
fn plain(name: &str) -> PathBuf {
    Path::new(name).components().filter(|c| *c != Component::CurDir).collect()
}

/// Returns a relative name for comparison on case-insensitive file systems.
fn caseless(name: &str) -> String {
    plain(name).to_string_lossy().to_lowercase()
}

/// Returns an image that refers to a buffer view instead of a URI.
fn embed(image: &Value, view: usize, mime: &str) -> Value {
    let mut embedded = serde_json::Map::new();
    for (key, value) in image.as_object().into_iter().flatten().filter(|(key, _)| *key != "uri") {
        embedded.insert(key.clone(), value.clone());
    }
    embedded.insert("mimeType".into(), mime.into());
    embedded.insert("bufferView".into(), view.into());
    Value::Object(embedded)
}

/// Detects the media type of an image from its first bytes.
fn mime_type(data: &[u8]) -> Option<&'static str> {
    let at = |start: usize, magic: &[u8]| data.get(start..).is_some_and(|rest| rest.starts_with(magic));
    Some(match () {
        () if at(0, b"\x89PNG\r\n\x1A\n") => "image/png",
        () if at(0, b"\xFF\xD8\xFF") => "image/jpeg",
        () if at(0, b"RIFF") && at(8, b"WEBP") => "image/webp",
        () if at(0, b"\xABKTX 20\xBB\r\n\x1A\n") => "image/ktx2",
        () if at(0, b"DDS ") => "image/vnd-ms.dds",
        () if at(4, b"ftypavif") => "image/avif",
        () => return None,
    })
}
