//! Joins all buffers into one.

use std::io::{self, Write};

use bytes::Bytes;
use serde_json::Value;

use super::accessor::view_range;
use super::compressed::writing::Compressed;
use super::edit;
use super::json::At;
use crate::{Document, Error};

/// The one buffer of an output, and the buffer views into it.
#[derive(Default)]
pub(super) struct Packed {
    /// Bytes and their offsets, in ascending order; gaps are filled with zeros.
    pieces: Vec<(usize, Bytes)>,
    /// Total length in bytes.
    pub(super) length: usize,
    /// The `bufferViews` list; every view refers to buffer 0, but compressed ones to buffer 1.
    pub(super) views: Value,
    /// Length of buffer 1 in bytes, which holds nothing; 0 if there are no compressed views.
    pub(super) placeholder: usize,
}

/// Views of one buffer that share bytes, directly or through other views.
struct Cluster {
    buffer: usize,
    start: usize,
    end: usize,
    /// Each view, with the offset of its first byte in the old buffer.
    members: Vec<(usize, usize)>,
}

impl Packed {
    /// Joins the buffers of a document, with streams instead of the views that are compressed. Other bytes outside all views are dropped, shared bytes stay shared, and every offset
    /// stays the same modulo 4, which preserves alignment.
    pub(super) fn new(doc: &Document, compressed: &[Option<Compressed>]) -> Result<Self, Error> {
        let of_view = |i: usize| compressed.get(i).and_then(Option::as_ref);
        let mut views = Vec::new();
        for (i, view) in At::root(doc).list("bufferViews")?.enumerate().filter(|(i, _)| of_view(*i).is_none()) {
            let (buffer, range) = view_range(doc, &view)?;
            views.push((buffer, range.start, range.end, i));
        }
        views.sort_unstable();
        let mut packed = Packed { views: Value::Array(Vec::new()), ..Packed::default() };
        let mut offsets = vec![0; At::root(doc).count("bufferViews")];
        for cluster in clusters(&views) {
            let data = doc.buffers[cluster.buffer].slice(cluster.start..cluster.end);
            let offset = packed.append(data, cluster.start % 4);
            for (view, start) in cluster.members {
                offsets[view] = offset + (start - cluster.start);
            }
        }
        if packed.length == 0 && !offsets.is_empty() {
            // Empty views still need a buffer, and glTF forbids empty buffers.
            packed.append(Bytes::from_static(&[0; 4]), 0);
        }
        for (i, (view, offset)) in At::root(doc).list("bufferViews")?.zip(offsets).enumerate() {
            let view = match of_view(i) {
                Some(compressed) => packed.compressed(view.value, compressed),
                None => moved(view.value, offset),
            };
            edit::append(&mut packed.views, view);
        }
        Ok(packed)
    }

    /// Adds the stream of a compressed view; returns the view.
    fn compressed(&mut self, view: &Value, compressed: &Compressed) -> Value {
        let offset = self.append(compressed.stream.clone(), 0);
        let described = compressed.describe(view, offset, self.placeholder);
        self.placeholder += compressed.length().next_multiple_of(4);
        described
    }

    /// Adds a new buffer view for the given bytes; returns its index.
    pub(super) fn push(&mut self, data: Bytes) -> usize {
        let length = data.len();
        let offset = self.append(data, 0);
        edit::append(&mut self.views, serde_json::json!({ "buffer": 0, "byteOffset": offset, "byteLength": length }))
    }

    /// Appends bytes at the next offset that leaves `remainder` when divided by 4.
    fn append(&mut self, data: Bytes, remainder: usize) -> usize {
        let offset = self.length + (remainder + 4 - self.length % 4) % 4;
        self.length = offset + data.len();
        self.pieces.push((offset, data));
        offset
    }

    /// Writes the buffer.
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let mut position = 0;
        for (offset, data) in &self.pieces {
            out.write_all(&[0; 4][..offset - position])?;
            out.write_all(data)?;
            position = offset + data.len();
        }
        Ok(())
    }
}

/// Groups overlapping views; the views are sorted by buffer and first byte.
fn clusters(views: &[(usize, usize, usize, usize)]) -> Vec<Cluster> {
    let mut clusters: Vec<Cluster> = Vec::new();
    for &(buffer, start, end, view) in views {
        match clusters.last_mut() {
            Some(last) if last.buffer == buffer && start < last.end => {
                last.end = last.end.max(end);
                last.members.push((view, start));
            }
            _ => clusters.push(Cluster { buffer, start, end, members: vec![(view, start)] }),
        }
    }
    clusters
}

/// Returns a buffer view at a new offset. An omitted offset of zero stays omitted.
fn moved(view: &Value, offset: usize) -> Value {
    let mut view = view.clone();
    view["buffer"] = 0.into();
    if offset != 0 || view.get("byteOffset").is_some() {
        view["byteOffset"] = offset.into();
    }
    view
}
