//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: compressed buffer views.

use bytes::Bytes;
use rayon::prelude::*;
use serde_json::json;

use super::budget::Budget;
use crate::gltf::accessor::view_range;
use crate::gltf::edit::{array, push};
use crate::gltf::extensions::{self, MESHOPT};
use crate::gltf::json::At;
use crate::meshopt::{Filter, Mode};
use crate::{Document, Error, Warning};

/// A compressed buffer view.
struct View<'d> {
    /// Index into `bufferViews`.
    index: usize,
    /// Its extension object.
    at: At<'d>,
    stream: Bytes,
    mode: Mode,
    filter: Option<Filter>,
    count: usize,
    stride: usize,
    /// `byteLength` of the buffer view itself.
    length: usize,
}

/// Returns the extension object of a buffer or a buffer view, under either name.
pub(super) fn extension<'v>(at: &At<'v>) -> Option<At<'v>> {
    MESHOPT.iter().find_map(|name| at.extension(name))
}

/// Decodes all compressed buffer views whose uncompressed bytes are not there, each to a buffer of its own.
pub(super) fn decompress(doc: &mut Document, budget: &mut Budget) -> Result<(), Error> {
    let views = views(doc, budget)?;
    let decoded: Vec<_> = views.par_iter().map(|view| (view.index, view.decode())).collect();
    let decoded = decoded.into_iter().map(|(index, bytes)| Ok((index, bytes?))).collect::<Result<Vec<_>, Error>>()?;
    drop(views);
    for (view, bytes) in decoded {
        place(doc, view, bytes.into());
    }
    forget(doc);
    Ok(())
}

/// Returns the compressed buffer views of a document, checked.
fn views<'d>(doc: &'d Document, budget: &mut Budget) -> Result<Vec<View<'d>>, Error> {
    let mut views = Vec::new();
    for (index, at) in At::root(doc).list("bufferViews")?.enumerate() {
        let is_there = || view_range(doc, &at).is_ok();
        if let Some(extension) = extension(&at).filter(|_| !is_there()) {
            let view = view(doc, index, &at, extension)?;
            let size = (view.count as u64).saturating_mul(view.stride as u64);
            budget.take(size).map_err(|cause| extension.error(cause))?;
            views.push(view);
        }
    }
    Ok(views)
}

fn view<'d>(doc: &'d Document, index: usize, view: &At<'d>, at: At<'d>) -> Result<View<'d>, Error> {
    let (buffer, range) = view_range(doc, &at)?;
    let (mode_at, stride_at, count_at) = (at.need("mode")?, at.need("byteStride")?, at.need("count")?);
    let (stride, count) = (stride_at.integer()?, count_at.integer()?);
    let name = mode_at.string()?;
    let mode = Mode::ALL.into_iter().find(|(known, _)| *known == name);
    let (_, mode) = mode.ok_or_else(|| mode_at.error(format_args!("there is no mode \"{name}\"")))?;
    let filter = at.get("filter").map(|filter| read_filter(&filter)).transpose()?.flatten();
    let is_allowed = match mode {
        Mode::Attributes => stride.is_multiple_of(4) && (4..=256).contains(&stride),
        Mode::Triangles | Mode::Indices => stride == 2 || stride == 4,
    };
    if !is_allowed {
        return Err(stride_at.error(format_args!("elements of {stride} bytes cannot have the mode {name}")));
    }
    if mode == Mode::Triangles && !count.is_multiple_of(3) {
        return Err(count_at.error(format_args!("{count} indices do not make whole triangles")));
    }
    if filter.is_some_and(|filter| mode != Mode::Attributes || !filter.allows(stride)) {
        return Err(at.error_at("filter", format_args!("elements of {stride} bytes in mode {name} cannot have it")));
    }
    let length_at = view.need("byteLength")?;
    let length = length_at.integer()?;
    if count.checked_mul(stride).is_none_or(|size| size < length) {
        let cause = format_args!("is {length}, but the compressed data holds {count} elements of {stride} bytes");
        return Err(length_at.error(cause));
    }
    Ok(View { index, at, stream: doc.buffers[buffer].slice(range), mode, filter, count, stride, length })
}

fn read_filter(at: &At<'_>) -> Result<Option<Filter>, Error> {
    match at.string()? {
        "NONE" => Ok(None),
        name => {
            let filter = Filter::ALL.into_iter().find(|(known, _)| *known == name);
            filter
                .map(|(_, filter)| Some(filter))
                .ok_or_else(|| at.error(format_args!("there is no filter \"{name}\"")))
        }
    }
}

impl View<'_> {
    /// Returns the bytes of the uncompressed view.
    fn decode(&self) -> Result<Vec<u8>, Error> {
        let fault = |fault| self.at.error(format_args!("cannot be decompressed: {fault}"));
        let mut elements = self.mode.decode(&self.stream, self.count, self.stride).map_err(fault)?;
        if let Some(filter) = self.filter {
            filter.apply(&mut elements, self.stride);
        }
        elements.truncate(self.length);
        Ok(elements)
    }
}

/// Lets a view refer to a buffer of its own.
fn place(doc: &mut Document, view: usize, bytes: Bytes) {
    let buffer = push(&mut doc.json, "buffers", json!({ "byteLength": bytes.len() }));
    doc.buffers.resize(buffer, Bytes::new());
    doc.buffers.push(bytes);
    let view = &mut doc.json["bufferViews"][view];
    view["buffer"] = buffer.into();
    if let Some(properties) = view.as_object_mut() {
        properties.shift_remove("byteOffset");
    }
    for name in MESHOPT {
        extensions::remove(view, name);
    }
}

/// Removes the extensions from the document; says so of views whose uncompressed bytes are used. Fallback buffers that
/// are not there become empty.
fn forget(doc: &mut Document) {
    for name in MESHOPT {
        let mut removed_of =
            |list| array(&mut doc.json, list).filter_map(|item| extensions::remove(item, name)).count();
        let (unused, _) = (removed_of("bufferViews"), removed_of("buffers"));
        extensions::forget(&mut doc.json, name);
        if unused > 0 {
            let message = format!("{name} of {unused} buffer views is left out; their uncompressed bytes are used");
            doc.warnings.push(Warning { place: "bufferViews".into(), message });
        }
    }
    let buffers = array(&mut doc.json, "buffers").filter_map(|buffer| buffer.as_object_mut());
    for (buffer, _) in buffers.zip(&doc.buffers).filter(|(_, bytes)| bytes.is_empty()) {
        buffer.insert("byteLength".into(), 0.into());
        buffer.shift_remove("uri");
    }
}
