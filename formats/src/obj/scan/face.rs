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
    /// Number of elements of the whole file if that is known to matter: faces refer to none beyond.
    total: Option<[i64; 3]>,
    strict: bool,
    /// Indices of the last face's corners, from 1; 0 if missing.
    corners: Vec<[i64; 3]>,
    /// Whether the words of the last face equal `corners`.
    plain: bool,
    /// Whether a face uses indices relative to the last element read.
    pub(super) counts_back: bool,
    pub(super) largest: Largest,
    /// What the last face refers to but does not exist: texture coordinates and normals, which then count as missing.
    pub(super) absent: [Option<String>; 2],
}

impl Faces {
    pub(super) fn new(context: &Context) -> Self {
        let Context { has_texcoords, has_normals, total, strict, .. } = *context;
        Faces {
            has_texcoords,
            has_normals,
            total,
            strict,
            corners: Vec::new(),
            plain: true,
            counts_back: false,
            largest: [(0, 0); 3],
            absent: [None, None],
        }
    }

    /// Reads the corners of a face; returns their number. `counts` are those of the elements before it, if known.
    ///
    /// # Errors
    /// The face is malformed, or refers to a vertex that does not exist.
    pub(super) fn read(&mut self, rest: &str, line: usize, counts: Option<[i64; 3]>) -> Result<usize, String> {
        self.absent = [None, None];
        self.plain = self.read_positive(rest) || !rest.contains('#');
        if self.corners.is_empty() {
            for word in words(rest) {
                let corner = self.corner(word, counts)?;
                self.corners.push(corner);
            }
        }
        self.check_total()?;
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

    /// Checks the corners against the number of elements of the file, if that is known.
    fn check_total(&mut self) -> Result<(), String> {
        let Some(total) = self.total else { return Ok(()) };
        for at in 0..self.corners.len() {
            for kind in 0..3 {
                let index = self.corners[at][kind];
                if index > total[kind] {
                    self.corners[at][kind] = self.missing(kind, beyond_message(kind, index, total))?;
                }
            }
        }
        Ok(())
    }

    /// Returns the index that stands for an element that does not exist.
    ///
    /// # Errors
    /// Every corner needs a vertex; a strict reader needs the others, too.
    fn missing(&mut self, kind: usize, cause: String) -> Result<i64, String> {
        if kind == 0 || self.strict {
            return Err(cause);
        }
        self.plain = false;
        self.absent[kind - 1].get_or_insert(cause);
        Ok(0)
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
            let read = index.parse().ok().or_else(|| self.whole(index)).ok_or_else(malformed)?;
            corner[kind] = match read {
                0 => self.missing(kind, format!("a face refers to {} 0; indices start at 1", KINDS[kind]))?,
                1.. => read,
                _ => self.counted_back(kind, read, counts)?,
            };
        }
        Ok(corner)
    }

    /// Parses an index written as a decimal (`3.0`) or followed by a comma.
    fn whole(&mut self, word: &str) -> Option<i64> {
        const MOST: f64 = (1u64 << 53) as f64;
        self.plain = false;
        let value: f64 = word.trim_end_matches(',').parse().ok()?;
        (value.fract() == 0.0 && value.abs() < MOST).then_some(value as i64)
    }

    /// Resolves a relative index; accepts any element if the number of elements is not known.
    fn counted_back(&mut self, kind: usize, index: i64, counts: Option<[i64; 3]>) -> Result<i64, String> {
        self.plain = false;
        self.counts_back = true;
        let Some(counts) = counts else { return Ok(1) };
        match counts[kind].checked_add(index) {
            Some(before) if before >= 0 => Ok(before + 1),
            _ => {
                self.missing(kind, format!("a face refers to {} {index}, with {} before it", KINDS[kind], counts[kind]))
            }
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

impl Faces {
    /// Writes the last corners read as strokes of `size` consecutive corners; returns their number.
    pub(super) fn write_strokes(&self, size: usize, out: &mut String) -> usize {
        for stroke in self.corners.windows(size) {
            out.push('f');
            for &[v, ..] in stroke {
                let _ = write!(out, " {v}/-1/-1");
            }
            out.push('\n');
        }
        self.corners.windows(size).len()
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
    Some((line, beyond_message(kind, index, counts)))
}

fn beyond_message(kind: usize, index: i64, counts: [i64; 3]) -> String {
    format!("a face refers to {} {index}, the file has {}", KINDS[kind], counts[kind])
}
