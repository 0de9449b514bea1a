//! The one buffer of the document: one range per kind of vertex attribute and index, so that a document has at most six
//! buffer views, however many primitives it has.

use serde_json::{Value, json};

/// Contents of a range of the buffer, in the order of the buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stream {
    Positions,
    Normals,
    Texcoords,
    Colors,
    /// 32-bit indices.
    Indices,
    /// 16-bit indices; last, because their size need not be a multiple of four.
    ShortIndices,
}

impl Stream {
    const ALL: [Stream; 6] =
        [Stream::Positions, Stream::Normals, Stream::Texcoords, Stream::Colors, Stream::Indices, Stream::ShortIndices];

    /// Returns glTF's component type and type, and the size of an element in bytes.
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

/// Size of each stream in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sizes([usize; 6]);

impl Sizes {
    /// Adds `count` elements.
    pub(super) fn add(&mut self, stream: Stream, count: usize) {
        self.0[stream as usize] += count * stream.element().2;
    }
}

/// Accessors and their data.
#[derive(Debug)]
pub(super) struct Streams {
    buffer: Vec<u8>,
    /// Start of each stream, and the position of its next element.
    starts: [usize; 6],
    ends: [usize; 6],
    views: Vec<Value>,
    /// Buffer view of each stream.
    view_of: [usize; 6],
    accessors: Vec<Value>,
}

impl Streams {
    /// Creates streams of exactly these sizes.
    pub(super) fn new(sizes: &Sizes) -> Self {
        let (mut views, mut starts, mut view_of, mut end) = (Vec::new(), [0; 6], [0; 6], 0);
        for stream in Stream::ALL {
            let size = sizes.0[stream as usize];
            (starts[stream as usize], view_of[stream as usize]) = (end, views.len());
            if size > 0 {
                views.push(view(stream, end, size));
            }
            end += size;
        }
        Streams { buffer: vec![0; end], starts, ends: starts, views, view_of, accessors: Vec::new() }
    }

    /// Adds an accessor over the elements; returns its index.
    pub(super) fn push<T: bytemuck::NoUninit>(&mut self, stream: Stream, elements: &[T]) -> usize {
        let (component, kind, size) = stream.element();
        let bytes: &[u8] = bytemuck::cast_slice(elements);
        let start = self.ends[stream as usize];
        let end = start + bytes.len();
        self.buffer[start..end].copy_from_slice(bytes);
        self.ends[stream as usize] = end;
        self.accessors.push(json!({
            "bufferView": self.view_of[stream as usize], "byteOffset": start - self.starts[stream as usize],
            "componentType": component, "count": bytes.len() / size, "type": kind
        }));
        self.accessors.len() - 1
    }

    /// Adds an accessor over positions, with their bounds; returns its index.
    pub(super) fn push_positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let index = self.push(Stream::Positions, positions);
        let finite = |axis: usize| positions.iter().map(move |p| p[axis]).filter(|x| x.is_finite());
        // JSON has no infinity: if nothing is finite, the bounds are zero.
        let bound = |pick: fn(f32, f32) -> f32| [0, 1, 2].map(|axis| finite(axis).reduce(pick).unwrap_or(0.0)).to_vec();
        self.accessors[index]["min"] = bound(f32::min).into();
        self.accessors[index]["max"] = bound(f32::max).into();
        index
    }

    /// Returns `accessors`, `bufferViews` and the buffer.
    pub(super) fn finish(self) -> (Vec<Value>, Vec<Value>, Vec<u8>) {
        (self.accessors, self.views, self.buffer)
    }
}

/// Returns a buffer view; 34962 and 34963 denote vertex and index buffers.
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
