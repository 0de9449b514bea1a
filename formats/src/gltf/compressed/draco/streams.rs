//! Decodes the streams of compressed primitives.

use std::collections::{BTreeMap, HashMap};

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use rayon::prelude::*;

use super::Primitive;
use crate::gltf::accessor::view_range;
use crate::gltf::compressed::budget::Budget;
use crate::gltf::json::At;
use crate::{Document, Error};

/// A stream that decodes to more than this, and to more than [`USUAL_RATIO`] times its size, is decoded by itself.
const USUAL_BYTES: u64 = 1 << 16;
/// See [`USUAL_BYTES`].
const USUAL_RATIO: u64 = 64;

/// A stream, with the first primitive that refers to it.
struct Stream<'d> {
    view: usize,
    at: At<'d>,
    bytes: &'d [u8],
    /// What is taken from the budget for decoding it beside others; `None` if the budget does not allow that.
    reserved: Option<u64>,
}

/// Decodes all streams, each once, and returns their meshes by buffer view. Those that decode to a usual size are decoded
/// in parallel, and then the others one by one, so that the budget bounds what is in memory.
pub(super) fn decode<'d>(
    doc: &'d Document,
    primitives: &[Primitive<'d>],
    budget: &mut Budget,
) -> Result<HashMap<usize, Mesh>, Error> {
    let streams = streams(doc, primitives, budget)?;
    let quick: Vec<Option<Mesh>> = streams.par_iter().map(|stream| stream.decode(stream.reserved?).ok()).collect();
    for (stream, mesh) in streams.iter().zip(&quick) {
        let used = mesh.as_ref().map_or(0, bytes_of);
        budget.give_back(stream.reserved.unwrap_or(0).saturating_sub(used));
    }
    let mut meshes = HashMap::new();
    for (stream, quick) in streams.iter().zip(quick) {
        let mesh = match quick {
            Some(mesh) => mesh,
            None => {
                let mesh = stream.decode(budget.left())?;
                budget.take(bytes_of(&mesh)).map_err(|cause| stream.at.error(cause))?;
                mesh
            }
        };
        meshes.insert(stream.view, mesh);
    }
    Ok(meshes)
}

/// Returns the streams of primitives, in the order of their buffer views.
fn streams<'d>(doc: &'d Document, primitives: &[Primitive<'d>], budget: &mut Budget) -> Result<Vec<Stream<'d>>, Error> {
    let mut first: BTreeMap<usize, At<'d>> = BTreeMap::new();
    for primitive in primitives {
        first.entry(primitive.view).or_insert(primitive.at);
    }
    let stream = |(view, at): (usize, At<'d>)| {
        let views = At::root(doc).need("bufferViews")?;
        let (buffer, range) = view_range(doc, &views.element(view).ok_or_else(|| at.error("has no buffer view"))?)?;
        let bytes = &doc.buffers[buffer][range];
        let usual = USUAL_BYTES + USUAL_RATIO * bytes.len() as u64;
        let reserved = budget.take(usual).is_ok().then_some(usual);
        Ok(Stream { view, at, bytes, reserved })
    };
    first.into_iter().map(stream).collect()
}

impl Stream<'_> {
    /// Decodes to at most so many bytes.
    fn decode(&self, most: u64) -> Result<Mesh, Error> {
        // Each point takes four bytes beside those of its attributes, each face twelve.
        let limits =
            DecodeLimits::default().with_max_points(most / 4).with_max_faces(most / 12).with_max_decoded_bytes(most);
        let mut mesh = Mesh::new();
        let mut bytes = DecoderBuffer::new(self.bytes).with_limits(limits);
        let decoded = MeshDecoder::new().decode(&mut bytes, &mut mesh);
        decoded.map_err(|e| self.at.error(format_args!("the stream cannot be decompressed: {e}")))?;
        Ok(mesh)
    }
}

/// Bytes of the attributes and faces of a mesh.
fn bytes_of(mesh: &Mesh) -> u64 {
    let attributes = (0..mesh.num_attributes()).map(|i| mesh.attribute(i).buffer().data_size() as u64);
    attributes.sum::<u64>() + 12 * mesh.num_faces() as u64
}
