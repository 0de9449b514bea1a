//! The one buffer of the document: a stretch for each kind of vertex attribute and index, so that a document has at
//! most six buffer views however many primitives it has.

use serde_json::{Value, json};

/// What a stretch of the buffer holds, in the order of the buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stream {
    Positions,
    Normals,
    Texcoords,
    Colors,
    /// 32-bit indices.
    Indices,
    /// 16-bit indices; last, for their size need be no multiple of four.
    ShortIndices,
}

impl Stream {
    const ALL: [Stream; 6] = [
        Stream::Positions,
        Stream::Normals,
        Stream::Texcoords,
        Stream::Colors,
        Stream::Indices,
        Stream::ShortIndices,
    ];

    /// glTF's component type and type, and the bytes of an element.
    fn element(self) -> (u32, &'static str, usize) {
        match self {
            Stream::Positions | Stream::Normals | Stream::Colors => (5126, "VEC3", 12),
            Stream::Texcoords => (5126, "VEC2", 8),
            Stream::Indices => (5125, "SCALAR", 4),
            Stream::ShortIndices => (5123, "SCALAR", 2),
        }
    }

    fn is_index(self) -> bool {
        matches!(self, Stream::Indices | Stream::ShortIndices)
    }
}

/// Accessors, and the bytes they refer to.
#[derive(Debug, Default)]
pub(super) struct Streams {
    bytes: [Vec<u8>; 6],
    /// Stream, first byte in it, and the accessor without its buffer view.
    accessors: Vec<(Stream, Value)>,
}

impl Streams {
    /// Adds an accessor over the elements; returns its index.
    pub(super) fn push<T: bytemuck::NoUninit>(&mut self, stream: Stream, elements: &[T]) -> usize {
        let (component, kind, size) = stream.element();
        let bytes = &mut self.bytes[stream as usize];
        let offset = bytes.len();
        bytes.extend_from_slice(bytemuck::cast_slice(elements));
        let count = (bytes.len() - offset) / size;
        let accessor = json!({
            "bufferView": null, "byteOffset": offset, "componentType": component, "count": count, "type": kind
        });
        self.accessors.push((stream, accessor));
        self.accessors.len() - 1
    }

    /// Adds an accessor over positions, with their bounds.
    pub(super) fn push_positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let index = self.push(Stream::Positions, positions);
        let finite = |axis: usize| positions.iter().map(move |p| p[axis]).filter(|x| x.is_finite());
        // JSON has no infinity: where nothing is finite the bounds are zero.
        let bound = |pick: fn(f32, f32) -> f32| [0, 1, 2].map(|axis| finite(axis).reduce(pick).unwrap_or(0.0)).to_vec();
        self.accessors[index].1["min"] = bound(f32::min).into();
        self.accessors[index].1["max"] = bound(f32::max).into();
        index
    }

    /// `accessors`, `bufferViews` and the buffer.
    pub(super) fn finish(self) -> (Vec<Value>, Vec<Value>, Vec<u8>) {
        let (mut views, mut buffer, mut view_of) = (Vec::new(), Vec::new(), [0; 6]);
        buffer.reserve_exact(self.bytes.iter().map(Vec::len).sum());
        for (stream, bytes) in Stream::ALL.into_iter().zip(self.bytes) {
            if bytes.is_empty() {
                continue;
            }
            view_of[stream as usize] = views.len();
            views.push(view(stream, buffer.len(), bytes.len()));
            buffer.extend_from_slice(&bytes);
        }
        let accessors = self.accessors.into_iter().map(|(stream, mut accessor)| {
            accessor["bufferView"] = view_of[stream as usize].into();
            accessor
        });
        (accessors.collect(), views, buffer)
    }
}

/// A buffer view; 34962 and 34963 are vertex and index buffers.
fn view(stream: Stream, offset: usize, length: usize) -> Value {
    let mut view = json!({"buffer": 0, "byteOffset": offset, "byteLength": length});
    if stream.is_index() {
        view["target"] = 34963.into();
    } else {
        view["byteStride"] = stream.element().2.into();
        view["target"] = 34962.into();
    }
    view
}
