//! Accessors, checked against the buffers they read.

use std::borrow::Cow;
use std::ops::Range;

use serde_json::Value;

use super::json::At;
use crate::document::{Component, Element};
use crate::{Document, Error};

/// Number of elements that an accessor without a buffer view may always have. Beyond it, its zeros must not outnumber
/// the bytes of the document, so that a few bytes of JSON cannot exhaust memory.
const MAX_ZEROS: usize = 1 << 16;

/// An accessor whose elements all lie within its buffer.
#[derive(Clone)]
pub(crate) struct Accessor<'d> {
    /// `SCALAR`, `VEC3`, ...
    pub(super) kind: &'d str,
    /// The type of its elements; for matrices, their components without padding between columns.
    pub(super) element: Element,
    /// Number of elements.
    pub(super) count: usize,
    /// Bytes from one element to the next.
    pub(super) stride: usize,
    /// The bytes from the start of the first element to the end of the last; `None` represents zeros.
    data: Option<&'d [u8]>,
    sparse: Option<Sparse<'d>>,
    /// Its place in the file.
    pub(super) at: At<'d>,
}

/// Elements that replace some of those in the base.
#[derive(Clone)]
struct Sparse<'d> {
    indices: Vec<u32>,
    values: &'d [u8],
}

/// A run of elements in a buffer view.
struct Run {
    offset: usize,
    count: usize,
    /// Size of an element in bytes.
    size: usize,
}

impl<'d> Accessor<'d> {
    /// Reads and checks the accessor that an index property refers to.
    pub(super) fn referred(doc: &'d Document, index: &At<'d>) -> Result<Self, Error> {
        let number = index.index_into("accessors", At::root(doc).count("accessors"))?;
        Accessor::read(doc, number)
    }

    /// Reads and checks accessor `index`.
    pub(crate) fn read(doc: &'d Document, index: usize) -> Result<Self, Error> {
        let root = At::root(doc);
        let list = root.need("accessors")?;
        let at = list.element(index).ok_or_else(|| list.error(format_args!("there is no accessor {index}")))?;
        let kind = at.need("type")?.string()?;
        let element = element(&at, kind)?;
        let count = at.need("count")?.integer()?;
        let size = element_size(kind, element);
        let offset = at.get("byteOffset").map_or(Ok(0), |o| o.integer())?;
        let (data, stride) = match at.get("bufferView") {
            Some(view) => {
                let (data, stride) = view_data(doc, &view, &at, Run { offset, count, size })?;
                (Some(data), stride)
            }
            None => (None, size),
        };
        if data.is_none() && count > MAX_ZEROS && count as u64 > doc.distinct_bytes() {
            return Err(
                at.error(format_args!("{count} elements without a bufferView are more than the file has bytes"))
            );
        }
        let sparse = at.get("sparse").map(|sparse| read_sparse(doc, sparse, count, size)).transpose()?;
        Ok(Accessor { kind, element, count, stride, data, sparse, at })
    }

    /// Returns the bytes from the first element on, and the stride. Borrowed unless sparse or without a buffer view.
    pub(super) fn bytes(&self) -> (Cow<'d, [u8]>, usize) {
        let size = element_size(self.kind, self.element);
        let mut all = match (self.data, &self.sparse) {
            (Some(data), None) => return (Cow::Borrowed(data), self.stride),
            (Some(data), Some(_)) => tight(data, self.stride, size),
            (None, _) => vec![0; self.count * size],
        };
        if let Some(sparse) = &self.sparse {
            for (&index, value) in sparse.indices.iter().zip(sparse.values.chunks_exact(size)) {
                all[index as usize * size..][..size].copy_from_slice(value);
            }
        }
        (Cow::Owned(all), size)
    }

    /// Returns the number of bytes from the start of the first element to the end of the last; 0 without a buffer view.
    pub(super) fn stored_bytes(&self) -> usize {
        self.data.map_or(0, <[u8]>::len)
    }

    /// Bytes of all elements, tightly packed.
    pub(crate) fn tight_bytes(&self) -> usize {
        self.count * element_size(self.kind, self.element)
    }

    /// Whether the components are unsigned integers of 16 or 32 bits that stand for themselves.
    pub(super) fn is_unsigned(&self) -> bool {
        matches!(self.element.component, Component::U16 | Component::U32) && !self.element.normalized
    }

    /// Returns the elements as unsigned integers, if this is a SCALAR accessor of them.
    pub(super) fn scalars(&self) -> Option<Vec<u32>> {
        if self.kind != "SCALAR" || self.element.normalized {
            return None;
        }
        let (bytes, stride) = self.bytes();
        unsigned_integers(&bytes, stride, self.element.component)
    }

    /// Returns vectors as 32-bit floats; integers are dequantised.
    pub(super) fn vectors_f32<const N: usize>(&self) -> Vec<[f32; N]> {
        let (bytes, stride) = self.bytes();
        if self.element.component == Component::F32 {
            return elements(&bytes, stride, 4 * N).map(floats).collect();
        }
        self.decode(&bytes, stride).map(|v| v.map(|x| x as f32)).collect()
    }

    /// Returns vectors as 64-bit floats; integers are dequantised.
    pub(super) fn vectors_f64<const N: usize>(&self) -> Vec<[f64; N]> {
        let (bytes, stride) = self.bytes();
        self.decode(&bytes, stride).collect()
    }

    /// Returns the components of all elements, one after the other, as 64-bit floats; integers are dequantised.
    pub(super) fn all_numbers(&self) -> Vec<f64> {
        let (bytes, stride) = self.bytes();
        let (element, size) = (self.element, self.element.component.size());
        let width = element_size(self.kind, element);
        let column = width / columns_of(self.kind);
        let stored = element.components / columns_of(self.kind) * size;
        let columns = elements(&bytes, stride, width).flat_map(|e| e.chunks_exact(column.max(1)));
        columns.flat_map(|c| c[..stored].chunks_exact(size).map(|raw| element.number(raw))).collect()
    }

    fn decode<'b, const N: usize>(&self, bytes: &'b [u8], stride: usize) -> impl Iterator<Item = [f64; N]> + 'b {
        let element = self.element;
        let size = element.component.size();
        elements(bytes, stride, N * size).map(move |e| {
            let mut vector = [0.0; N];
            for (slot, c) in vector.iter_mut().zip(e.chunks_exact(size)) {
                *slot = element.number(c);
            }
            vector
        })
    }
}

/// Returns the type of an accessor's elements.
pub(super) fn element(at: &At<'_>, kind: &str) -> Result<Element, Error> {
    let component_at = at.need("componentType")?;
    let component = component_of(component_at.integer()?)
        .ok_or_else(|| component_at.error(format_args!("there is no component type {}", component_at.value)))?;
    let components =
        components_of(kind).ok_or_else(|| at.error_at("type", format_args!("there is no accessor type {kind}")))?;
    let normalized = at.get("normalized").is_some_and(|n| n.value == &Value::Bool(true));
    // glTF allows the property for 8 and 16 bits only and does not mention floats.
    if normalized && component == Component::U32 {
        return Err(at.error_at("normalized", "32-bit integers cannot be normalized"));
    }
    Ok(Element { component, components, normalized: normalized && component != Component::F32 })
}

fn component_of(number: usize) -> Option<Component> {
    use Component::{F32, I8, I16, U8, U16, U32};
    [I8, U8, I16, U16, U32, F32].into_iter().find(|c| *c as usize == number)
}

fn components_of(kind: &str) -> Option<usize> {
    Some(match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => return None,
    })
}

/// Returns the size of an element in bytes; matrix columns start at multiples of four bytes.
fn element_size(kind: &str, element: Element) -> usize {
    match columns_of(kind) {
        1 => element.size(),
        columns => columns * (columns * element.component.size()).next_multiple_of(4),
    }
}

fn columns_of(kind: &str) -> usize {
    match kind {
        "MAT2" => 2,
        "MAT3" => 3,
        "MAT4" => 4,
        _ => 1,
    }
}

/// Returns the bytes of a run of elements in the buffer view that an index property refers to, and their stride. The
/// error is reported at `owner` if the run does not fit.
fn view_data<'d>(doc: &'d Document, index: &At<'d>, owner: &At<'d>, run: Run) -> Result<(&'d [u8], usize), Error> {
    let root = At::root(doc);
    let number = index.index_into("bufferViews", root.count("bufferViews"))?;
    let view =
        root.get("bufferViews").and_then(|list| list.element(number)).ok_or_else(|| index.error("is missing"))?;
    let bytes = view_bytes(doc, &view)?;
    let stride = match view.get("byteStride") {
        Some(stride) if stride.integer()? < run.size => {
            return Err(stride.error(format_args!("is less than the {} bytes of an element of {owner}", run.size)));
        }
        Some(stride) => stride.integer()?,
        None => run.size,
    };
    if run.count == 0 {
        return Ok((&[], stride));
    }
    let end = (run.count - 1).checked_mul(stride).and_then(|n| n.checked_add(run.size)?.checked_add(run.offset));
    match end {
        Some(end) if end <= bytes.len() => Ok((&bytes[run.offset..end], stride)),
        _ => Err(owner.error(format_args!(
            "{} elements of {} bytes from byte {} on pass the end of bufferViews[{number}], which has {} bytes",
            run.count,
            run.size,
            run.offset,
            bytes.len()
        ))),
    }
}

/// Returns the bytes of a buffer view.
fn view_bytes<'d>(doc: &'d Document, view: &At<'d>) -> Result<&'d [u8], Error> {
    let (buffer, range) = view_range(doc, view)?;
    Ok(&doc.buffers[buffer][range])
}

/// Returns the buffer of a buffer view, and the range in it.
pub(super) fn view_range(doc: &Document, view: &At<'_>) -> Result<(usize, Range<usize>), Error> {
    view.object()?;
    let buffer = view.need("buffer")?.index_into("buffers", doc.buffers.len())?;
    let offset = view.get("byteOffset").map_or(Ok(0), |o| o.integer())?;
    let length = view.need("byteLength")?.integer()?;
    let size = doc.buffers[buffer].len();
    match offset.checked_add(length).filter(|end| *end <= size) {
        Some(end) => Ok((buffer, offset..end)),
        None => Err(view.error(format_args!(
            "{length} bytes from byte {offset} on pass the end of buffers[{buffer}], which has {size} bytes"
        ))),
    }
}

fn read_sparse<'d>(doc: &'d Document, at: At<'d>, base_count: usize, size: usize) -> Result<Sparse<'d>, Error> {
    let count = at.need("count")?.integer()?;
    let indices_at = at.need("indices")?;
    let component_at = indices_at.need("componentType")?;
    let component = component_of(component_at.integer()?)
        .ok_or_else(|| component_at.error(format_args!("there is no component type {}", component_at.value)))?;
    let run = |at: &At<'d>, size| -> Result<Run, Error> {
        Ok(Run { offset: at.get("byteOffset").map_or(Ok(0), |o| o.integer())?, count, size })
    };
    let index_run = run(&indices_at, component.size())?;
    let (bytes, stride) = view_data(doc, &indices_at.need("bufferView")?, &indices_at, index_run)?;
    let indices = unsigned_integers(bytes, stride, component)
        .ok_or_else(|| component_at.error("sparse indices must be unsigned integers"))?;
    if let Some(past) = indices.iter().find(|i| **i as usize >= base_count) {
        return Err(indices_at.error(format_args!("element {past} does not exist; there are {base_count} elements")));
    }
    let values_at = at.need("values")?;
    let (values, stride) = view_data(doc, &values_at.need("bufferView")?, &values_at, run(&values_at, size)?)?;
    if stride != size && count > 1 {
        return Err(values_at.error("sparse values must be tightly packed"));
    }
    Ok(Sparse { indices, values })
}

/// Iterates over the elements of a strided run. The last one may lack the padding after it.
fn elements(bytes: &[u8], stride: usize, size: usize) -> impl Iterator<Item = &[u8]> {
    bytes.chunks(stride.max(1)).filter_map(move |chunk| chunk.get(..size))
}

/// Packs strided elements.
fn tight(bytes: &[u8], stride: usize, size: usize) -> Vec<u8> {
    if stride == size { bytes.to_vec() } else { elements(bytes, stride, size).flatten().copied().collect() }
}

fn unsigned_integers(bytes: &[u8], stride: usize, component: Component) -> Option<Vec<u32>> {
    let all = elements(bytes, stride, component.size());
    Some(match component {
        Component::U8 => all.map(|e| u32::from(e[0])).collect(),
        Component::U16 => all.map(|e| u32::from(u16::from_le_bytes([e[0], e[1]]))).collect(),
        Component::U32 => all.map(|e| u32::from_le_bytes([e[0], e[1], e[2], e[3]])).collect(),
        Component::I8 | Component::I16 | Component::F32 => return None,
    })
}

fn floats<const N: usize>(e: &[u8]) -> [f32; N] {
    let mut vector = [0.0; N];
    for (slot, c) in vector.iter_mut().zip(e.chunks_exact(4)) {
        *slot = f32::from_le_bytes([c[0], c[1], c[2], c[3]]);
    }
    vector
}
