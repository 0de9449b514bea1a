//! The codecs of `EXT_meshopt_compression` and `KHR_meshopt_compression`: compressed bytes to elements.
//!
//! Written from Appendix A (bitstream) and Appendix B (filters) of the extension `KHR_meshopt_compression` by A.
//! Kapoulkine, J. St. Pierre and A. Knyazev (Khronos Group, release candidate of 2025), which includes the bitstream of
//! `EXT_meshopt_compression`. No allocation follows a claim that the compressed bytes cannot hold.

mod filter;
mod indices;
mod triangles;
mod varint;
mod vertices;

pub(crate) use filter::Filter;

/// Why a stream cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Fault {
    /// The first byte is not that of the mode.
    #[error("the stream begins with the byte {0:#04x}, which is not one of this mode")]
    Header(u8),
    /// The stream ends early.
    #[error("the stream is too short for its elements")]
    Short,
    /// Bytes are left over.
    #[error("{0} bytes of the stream are left over")]
    Long(usize),
    /// A mode of a channel that does not exist.
    #[error("there is no channel mode {0:#04x}")]
    Channel(u8),
    /// The table of the triangle codec refers to indices that it cannot hold.
    #[error("the table of triangle codes holds {0:#04x}")]
    Table(u8),
    /// A number of more than five bytes.
    #[error("a number of the stream is longer than 32 bits")]
    Number,
}

/// How elements are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    /// Elements of any kind, as differences of their bytes.
    Attributes,
    /// The corners of triangles, as edges and vertices that were met recently.
    Triangles,
    /// Other indices, as differences.
    Indices,
}

impl Mode {
    /// All modes, with their names in files.
    pub(crate) const ALL: [(&'static str, Mode); 3] =
        [("ATTRIBUTES", Mode::Attributes), ("TRIANGLES", Mode::Triangles), ("INDICES", Mode::Indices)];

    /// Returns the elements of a stream: `count` of `stride` bytes each.
    ///
    /// # Errors
    /// See [`Fault`].
    pub(crate) fn decode(self, stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Fault> {
        let indices = match self {
            Mode::Attributes => return vertices::decode(stream, count, stride),
            Mode::Triangles => triangles::decode(stream, count / 3)?.into_flattened(),
            Mode::Indices => indices::decode(stream, count)?,
        };
        Ok(match stride {
            // Larger indices wrap around, as the extension says.
            2 => indices.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect(),
            _ => indices.iter().flat_map(|i| i.to_le_bytes()).collect(),
        })
    }
}

/// Returns the shortest stream from which elements are decoded byte by byte as they are, and its mode. Elements of 2 or 4
/// bytes may be `indices`. `None` if no mode is made for elements of this size.
pub(crate) fn encode(elements: &[u8], stride: usize, indices: bool) -> Option<(Mode, Vec<u8>)> {
    let mut streams = Vec::new();
    if stride.is_multiple_of(4) && (4..=256).contains(&stride) {
        streams.push((Mode::Attributes, vertices::encode(elements, stride)));
    }
    if indices && (stride == 2 || stride == 4) {
        let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte));
        let numbers: Vec<u32> = elements.chunks_exact(stride).map(number).collect();
        // Numbers beyond are not whole after the shift for the baseline.
        if numbers.iter().all(|number| *number < 1 << 30) {
            streams.push((Mode::Indices, indices::encode(&numbers)));
        }
        let (triangles, rest) = numbers.as_chunks();
        if rest.is_empty() {
            let stream = triangles::encode(triangles);
            // The triangles may begin at another corner.
            if triangles::decode(&stream, triangles.len()).is_ok_and(|decoded| decoded == triangles) {
                streams.push((Mode::Triangles, stream));
            }
        }
    }
    streams.into_iter().min_by_key(|(_, stream)| stream.len())
}

/// Returns the first byte of a stream, if its upper half is that of the mode and its lower half a known version.
fn version(stream: &[u8], header: u8) -> Result<u8, Fault> {
    match *stream.first().ok_or(Fault::Short)? {
        byte if byte & 0xF0 == header && byte & 0x0F <= 1 => Ok(byte & 0x0F),
        other => Err(Fault::Header(other)),
    }
}

#[cfg(test)]
mod testing {
    /// Bytes from pairs of hexadecimal digits; other characters are skipped.
    pub(super) fn hex(text: &str) -> Vec<u8> {
        let digits: Vec<u32> = text.chars().filter_map(|c| c.to_digit(16)).collect();
        digits.as_chunks().0.iter().map(|[high, low]| (16 * high + low) as u8).collect()
    }
}
