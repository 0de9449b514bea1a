//! `f` statements: checks corner indices, and makes them absolute and missing ones explicit.

use std::fmt::Write;

use super::super::text::words;
use super::block::Context;
use super::elements::shown;

/// Names of the indices of a corner, in order.
const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// For each kind, the largest index that a face refers to, and the first line with it.
pub(super) type Largest = [(i64, usize); 3];

/// Reads faces one at a time.
pub(super) struct Faces {
    has_texcoords: bool,
    has_normals: bool,
    /// Indices of the last face's corners, from 1; 0 if missing.
    corners: Vec<[i64; 3]>,
    /// Whether the words of the last face equal `corners`.
    plain: bool,
    /// Whether a face uses indices relative to the last element read.
    pub(super) counts_back: bool,
    pub(super) largest: Largest,
}

impl Faces {
    pub(super) fn new(context: &Context) -> Self {
        let Context { has_texcoords, has_normals, .. } = *context;
        Faces { has_texcoords, has_normals, corners: Vec::new(), plain: true, counts_back: false, largest: [(0, 0); 3] }
    }

    /// Reads the corners of a face; returns their number. `counts` are those of the elements before it, if known.
    pub(super) fn read(&mut self, rest: &str, line: usize, counts: Option<[i64; 3]>) -> Result<usize, String> {
        self.plain = self.read_positive(rest) || !rest.contains('#');
        if self.corners.is_empty() {
            for word in words(rest) {
                let corner = self.corner(word, counts)?;
                self.corners.push(corner);
            }
        }
        for corner in &self.corners {
            for (kind, &index) in corner.iter().enumerate() {
                if index > self.largest[kind].0 {
                    self.largest[kind] = (index, line);
                }
            }
            self.plain &= (corner[1] != 0 || !self.has_texcoords) && (corner[2] != 0 || !self.has_normals);
        }
        Ok(self.corners.len())
    }

    /// Reads a face of positive indices in plain ASCII, the common case. Reads no corners of any other face.
    fn read_positive(&mut self, rest: &str) -> bool {
        self.corners.clear();
        let blank = |byte: &u8| matches!(byte, b'\t'..=b'\r' | b' ');
        for word in rest.as_bytes().split(blank).filter(|word| !word.is_empty()) {
            let Some(corner) = positive_corner(word) else {
                self.corners.clear();
                return false;
            };
            self.corners.push(corner);
        }
        true
    }

    /// Parses `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative indices count back from the last element read.
    fn corner(&mut self, word: &str, counts: Option<[i64; 3]>) -> Result<[i64; 3], String> {
        let malformed = || format!("face corner `{}` is not of the form v, v/vt, v//vn or v/vt/vn", shown(word));
        let mut corner = [0; 3];
        for (kind, index) in word.split('/').enumerate() {
            if kind > 2 || (kind == 0 && index.is_empty()) {
                return Err(malformed());
            }
            if index.is_empty() {
                continue;
            }
            let index: i64 = index.parse().map_err(|_| malformed())?;
            corner[kind] = match index {
                0 => return Err(format!("a face refers to {} 0; indices start at 1", KINDS[kind])),
                1.. => index,
                _ => self.counted_back(kind, index, counts)?,
            };
        }
        Ok(corner)
    }

    /// Resolves a relative index; accepts any element if the number of elements is not known.
    fn counted_back(&mut self, kind: usize, index: i64, counts: Option<[i64; 3]>) -> Result<i64, String> {
        self.plain = false;
        self.counts_back = true;
        let Some(counts) = counts else { return Ok(1) };
        match counts[kind].checked_add(index) {
            Some(before) if before >= 0 => Ok(before + 1),
            _ => Err(format!("a face refers to {} {index}, with {} before it", KINDS[kind], counts[kind])),
        }
    }

    /// Whether `tobj` can read the last face as it is.
    pub(super) fn is_plain(&self) -> bool {
        self.plain
    }

    /// Writes the last face read; `rest` holds its words.
    pub(super) fn write(&self, rest: &str, out: &mut String) {
        out.push_str("f ");
        if self.plain {
            out.push_str(rest);
        } else {
            for &[v, vt, vn] in &self.corners {
                // -1 refers to the last element, which represents a missing one.
                let [v, vt, vn] = [v, vt, vn].map(|index| if index == 0 { -1 } else { index });
                let _ = write!(out, "{v}/{vt}/{vn} ");
            }
        }
        out.push('\n');
    }
}

/// Parses a corner of positive indices; `None` leaves it to [`Faces::corner`].
fn positive_corner(word: &[u8]) -> Option<[i64; 3]> {
    let mut corner = [0; 3];
    let (mut kind, mut digits) = (0, 0);
    for &byte in word {
        match byte {
            b'0'..=b'9' if digits < 18 => {
                corner[kind] = 10 * corner[kind] + i64::from(byte - b'0');
                digits += 1;
            }
            b'/' if kind < 2 && (corner[kind] > 0 || kind > 0 && digits == 0) => (kind, digits) = (kind + 1, 0),
            _ => return None,
        }
    }
    (corner[kind] > 0 || kind > 0 && digits == 0).then_some(corner)
}

/// Returns the fault of the line whose faces refer to elements beyond the last.
pub(super) fn beyond(largest: &Largest, counts: [i64; 3]) -> Option<(usize, String)> {
    let kind = (0..3).find(|&kind| largest[kind].0 > counts[kind])?;
    let (index, line) = largest[kind];
    Some((line, format!("a face refers to {} {index}, the file has {}", KINDS[kind], counts[kind])))
}
