//! The GLB container.

use std::ops::Range;
use std::path::Path;

use crate::{Error, Warning};

/// First four bytes of a GLB file.
pub(crate) const MAGIC: &[u8; 4] = b"glTF";
/// Type of the JSON chunk.
pub(crate) const JSON: &[u8; 4] = b"JSON";
/// Type of the binary chunk.
pub(crate) const BIN: &[u8; 4] = b"BIN\0";
/// Size of the file header in bytes.
pub(crate) const HEADER: usize = 12;
/// Size of a chunk header in bytes.
pub(crate) const CHUNK_HEADER: usize = 8;

/// Locations of the parts of a GLB file.
#[derive(Debug, Default)]
pub(super) struct Parts {
    pub(super) json: Range<usize>,
    pub(super) bin: Option<Range<usize>>,
    pub(super) warnings: Vec<Warning>,
}

/// Finds the JSON and binary chunks of a GLB file whose magic was recognised.
pub(super) fn parts(file: &Path, bytes: &[u8]) -> Result<Parts, Error> {
    let total = total_length(file, bytes)?;
    let mut parts = Parts::default();
    if total < bytes.len() {
        let message = format!("{} bytes after the end that the header gives are ignored", bytes.len() - total);
        parts.warnings.push(Warning { place: String::new(), message });
    }
    let mut start = HEADER;
    for number in 0.. {
        if start == total {
            break;
        }
        let (kind, data) = chunk(file, &bytes[..total], start, number)?;
        start = data.end;
        match (number, &kind) {
            (0, JSON) => parts.json = data,
            (0, _) => return Err(Error::at(file, "chunk 0", "the first chunk is not JSON")),
            (_, BIN) if parts.bin.is_none() => parts.bin = Some(data),
            _ => parts.warnings.push(Warning {
                place: format!("chunk {number}"),
                message: format!("of the unknown type \"{}\" is skipped", kind.escape_ascii()),
            }),
        }
    }
    if parts.json.is_empty() { Err(Error::whole(file, "the JSON chunk is missing")) } else { Ok(parts) }
}

/// Returns the length of the file according to its header.
fn total_length(file: &Path, bytes: &[u8]) -> Result<usize, Error> {
    let (Some(version), Some(total)) = (word(bytes, 4), word(bytes, 8)) else {
        let cause = format!("truncated: a GLB header has {HEADER} bytes, the file has {}", bytes.len());
        return Err(Error::whole(file, cause));
    };
    if version != 2 {
        let cause = format!("GLB version {version} is not supported, only version 2");
        return Err(Error::at(file, "header", cause).unsupported());
    }
    if total > bytes.len() {
        let cause = format!("truncated: the header gives {total} bytes, the file has {}", bytes.len());
        return Err(Error::at(file, "header", cause));
    }
    if total < HEADER {
        return Err(Error::at(file, "header", format!("a total length of {total} bytes is less than the header")));
    }
    Ok(total)
}

/// Returns type and data of the chunk that starts at the given byte of the file.
fn chunk(file: &Path, bytes: &[u8], start: usize, number: usize) -> Result<([u8; 4], Range<usize>), Error> {
    let place = format!("chunk {number}");
    let kind = bytes.get(start + 4..start + CHUNK_HEADER).and_then(|b| <[u8; 4]>::try_from(b).ok());
    let (Some(length), Some(kind)) = (word(bytes, start), kind) else {
        return Err(Error::at(
            file,
            place,
            format!("truncated: {} bytes are too short for a chunk header", bytes.len() - start),
        ));
    };
    let data = start + CHUNK_HEADER;
    match data.checked_add(length).filter(|end| *end <= bytes.len()) {
        Some(end) => Ok((kind, data..end)),
        None => Err(Error::at(
            file,
            place,
            format!("its {length} bytes pass the end of the file, which is {} bytes away", bytes.len() - data),
        )),
    }
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(four.try_into().ok()?) as usize)
}
