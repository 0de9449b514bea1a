//! `f` statements: corner indices checked, made absolute, missing ones made explicit.

use std::fmt::Write;

use super::super::text::words;
use super::Fault;
use super::elements::shown;

/// What the indices of a corner are called, in order.
const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Reads faces one at a time.
pub(super) struct Faces {
    /// Whether the text may hold texture coordinates (it has a `vt` somewhere).
    pub(super) has_texcoords: bool,
    /// Whether the text may hold normals.
    pub(super) has_normals: bool,
    /// Indices of the last face's corners from 1; 0 is missing.
    corners: Vec<[i64; 3]>,
    /// Whether the words of the last face say just what `corners` says.
    plain: bool,
    /// For each kind the largest index that lay ahead of the elements read so far, and its line.
    ahead: [(i64, usize); 3],
}

impl Faces {
    /// A reader for the faces of this text.
    pub(super) fn of(text: &str) -> Self {
        let (has_texcoords, has_normals) = (text.contains("vt"), text.contains("vn"));
        Faces { has_texcoords, has_normals, corners: Vec::new(), plain: true, ahead: [(0, 0); 3] }
    }

    /// Reads the corners of a face; gives their number.
    pub(super) fn read(&mut self, rest: &str, line: usize, counts: [i64; 3]) -> Result<usize, String> {
        self.corners.clear();
        self.plain = !rest.contains('#');
        for word in words(rest) {
            let corner = self.corner(word, counts)?;
            for (kind, &index) in corner.iter().enumerate() {
                if index > counts[kind].max(self.ahead[kind].0) {
                    self.ahead[kind] = (index, line);
                }
            }
            self.plain &= (corner[1] != 0 || !self.has_texcoords) && (corner[2] != 0 || !self.has_normals);
            self.corners.push(corner);
        }
        Ok(self.corners.len())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative indices count back from the last element read.
    fn corner(&mut self, word: &str, counts: [i64; 3]) -> Result<[i64; 3], String> {
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
                _ => self.from_end(kind, index, counts[kind])?,
            };
        }
        Ok(corner)
    }

    fn from_end(&mut self, kind: usize, index: i64, count: i64) -> Result<i64, String> {
        self.plain = false;
        match count.checked_add(index) {
            Some(before) if before >= 0 => Ok(before + 1),
            _ => Err(format!("a face refers to {} {index}, with {count} before it", KINDS[kind])),
        }
    }

    /// Writes the last face read, whose words were `rest`.
    pub(super) fn write(&self, rest: &str, out: &mut String) {
        out.push_str("f ");
        if self.plain {
            out.push_str(rest);
        } else {
            for &[v, vt, vn] in &self.corners {
                // -1 is the element that stands for a missing one: it comes last.
                let or_missing = |index: i64| if index == 0 { -1 } else { index };
                let _ = write!(out, "{v}/{}/{} ", or_missing(vt), or_missing(vn));
            }
        }
        out.push('\n');
    }

    /// Whether all faces refer to elements there are.
    pub(super) fn check_range(&self, counts: [i64; 3]) -> Result<(), Fault> {
        let beyond = (0..3).find(|&kind| self.ahead[kind].0 > counts[kind]);
        beyond.map_or(Ok(()), |kind| {
            let (index, line) = self.ahead[kind];
            let cause = format!("a face refers to {} {index}, the file has {}", KINDS[kind], counts[kind]);
            Err(Fault { line, cause })
        })
    }
}
