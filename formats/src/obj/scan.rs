//! The first pass over an OBJ text: who owns each face, and a normalised text for `tobj`.
//!
//! The normalised text holds all `v`, `vt` and `vn` lines, then the faces of each part (object, group and material)
//! under a `g` line with the part's number. Corners without a texture coordinate or a normal refer to one appended
//! after the last, which is not a number; so do uncoloured vertices, where the file colours others. Thus `tobj` never
//! has to invent a value, and every value it gives back can be told from a missing one.

use std::borrow::Cow;
use std::collections::HashMap;
use std::hash::Hash;

use super::notes::Notes;
use super::text::{self, Line, place, words};

mod chunks;
mod elements;
mod face;

use chunks::Chunks;
use elements::Elements;

/// What is wrong with a line.
#[derive(Debug)]
pub(super) struct Fault {
    /// The line, from 1.
    pub(super) line: usize,
    /// What is wrong with it, in words.
    pub(super) cause: String,
}

/// The faces of one object, group and material.
#[derive(Debug)]
pub(super) struct Part {
    /// Index into [`Scan::objects`]; `None` before the first `o` and after one without a name.
    pub(super) object: Option<usize>,
    /// Index into [`Scan::groups`]; `None` where no `g` has come since the last `o`.
    pub(super) group: Option<usize>,
    /// Index into [`Scan::materials`]; `None` before the first `usemtl`.
    pub(super) material: Option<usize>,
    faces: String,
}

/// What an OBJ text says besides its numbers, and its numbers in a form that `tobj` reads without loss.
#[derive(Debug, Default)]
pub(super) struct Scan<'a> {
    /// Names of objects, each once.
    pub(super) objects: Names<'a>,
    /// Names of groups, each once.
    pub(super) groups: Names<'a>,
    /// Names of materials, each once.
    pub(super) materials: Names<'a>,
    /// `mtllib` statements: line and rest of the line.
    pub(super) libraries: Vec<(usize, Cow<'a, str>)>,
    /// The parts with at least one face, in order of their first.
    pub(super) parts: Vec<Part>,
    elements: Elements,
    /// What vertex colours are to be multiplied by to come into 0..1.
    pub(super) color_scale: f32,
}

/// Distinct names in order of first appearance.
#[derive(Debug, Default)]
pub(super) struct Names<'a>(Interner<Cow<'a, str>>);

impl<'a> Names<'a> {
    /// The names, in order of first appearance.
    pub(super) fn iter(&self) -> impl Iterator<Item = &str> {
        self.0.values.iter().map(|name| name.as_ref())
    }

    /// The name of that index.
    pub(super) fn get(&self, index: usize) -> &str {
        &self.0.values[index]
    }
}

/// Distinct values, numbered in order of first appearance.
#[derive(Debug)]
struct Interner<T> {
    values: Vec<T>,
    index: HashMap<T, usize>,
}

impl<T> Default for Interner<T> {
    fn default() -> Self {
        Interner { values: Vec::new(), index: HashMap::new() }
    }
}

impl<T: Hash + Eq + Clone> Interner<T> {
    fn number(&mut self, value: T) -> usize {
        let Interner { values, index } = self;
        *index.entry(value).or_insert_with_key(|value| {
            values.push(value.clone());
            values.len() - 1
        })
    }
}

impl<'a> Scan<'a> {
    /// Scans a whole text.
    ///
    /// # Errors
    /// Names the first line whose numbers are too few or whose indices are malformed, zero or out of range. Malformed
    /// coordinates are left to [`Scan::parse`].
    pub(super) fn of(text: &'a str, notes: &mut Notes) -> Result<Self, Fault> {
        let mut scanner = Scanner::new(text, notes);
        for line in text::lines(text) {
            let number = line.number;
            scanner.statement(line).map_err(|cause| Fault { line: number, cause })?;
        }
        scanner.finish()
    }

    /// Parses the normalised text. The meshes are in the order of [`Scan::parts`]; the corners of a mesh all have
    /// texture coordinates and normals or none has, missing ones being those that are not finite.
    pub(super) fn parse(&self) -> Result<Vec<tobj::Mesh>, tobj::LoadError> {
        let mut headers = String::new();
        let ends: Vec<usize> = (0..self.parts.len())
            .map(|i| {
                headers.push_str(&format!("g {i}\n"));
                headers.len()
            })
            .collect();
        let mut chunks = vec![self.elements.text()];
        let mut start = 0;
        for (part, end) in self.parts.iter().zip(ends) {
            chunks.push(&headers.as_bytes()[start..end]);
            chunks.push(part.faces.as_bytes());
            start = end;
        }
        let options = tobj::LoadOptions { single_index: false, triangulate: false, ..Default::default() };
        let no_library = |_: &std::path::Path| Err(tobj::LoadError::GenericFailure);
        let (models, _) = tobj::load_obj_buf(&mut Chunks::new(chunks), &options, no_library)?;
        // tobj closes with an empty model where there is no face at all.
        Ok(models.into_iter().map(|model| model.mesh).take(self.parts.len()).collect())
    }
}

/// The first line with a coordinate that is no number; looked for once parsing has failed.
pub(super) fn first_malformed(text: &str) -> Option<Fault> {
    text::lines(text).find_map(|line| {
        let (key, rest) = line.text();
        elements::check(key, rest).err().map(|cause| Fault { line: line.number, cause })
    })
}

/// The state of the scan.
struct Scanner<'a, 'n> {
    scan: Scan<'a>,
    notes: &'n mut Notes,
    keys: Interner<(Option<usize>, Option<usize>, Option<usize>)>,
    object: Option<usize>,
    group: Option<usize>,
    material: Option<usize>,
    /// The part that object, group and material make; `None` until a face asks for it.
    part: Option<usize>,
    faces: face::Faces,
}

impl<'a, 'n> Scanner<'a, 'n> {
    fn new(text: &str, notes: &'n mut Notes) -> Self {
        Scanner {
            scan: Scan::default(),
            notes,
            keys: Interner::default(),
            object: None,
            group: None,
            material: None,
            part: None,
            faces: face::Faces::of(text),
        }
    }

    fn statement(&mut self, line: Line<'a>) -> Result<(), String> {
        let number = line.number;
        let (key, rest) = line.into_text();
        match key.as_ref() {
            "v" | "vt" | "vn" => return self.scan.elements.add(&key, &rest, number, self.notes),
            "f" | "fo" => return self.face(&rest, number),
            "o" => {
                self.object = named(&mut self.scan.objects, rest);
                self.group = None;
                self.part = None;
            }
            "g" => {
                self.group = named(&mut self.scan.groups, rest);
                self.part = None;
            }
            "usemtl" => {
                self.material = Some(self.scan.materials.0.number(rest));
                self.part = None;
            }
            "mtllib" => self.scan.libraries.push((number, rest)),
            _ => self.notes.add(|| place(number), left_out(&key)),
        }
        Ok(())
    }

    fn face(&mut self, rest: &str, line: usize) -> Result<(), String> {
        let corners = self.faces.read(rest, line, self.scan.elements.counts())?;
        if corners < 3 {
            self.notes.add(|| place(line), "faces of fewer than three corners left out");
            return Ok(());
        }
        let part = match self.part {
            Some(part) => part,
            None => self.enter_part(),
        };
        self.part = Some(part);
        self.faces.write(rest, &mut self.scan.parts[part].faces);
        Ok(())
    }

    fn enter_part(&mut self) -> usize {
        let (object, group, material) = (self.object, self.group, self.material);
        let part = self.keys.number((object, group, material));
        if part == self.scan.parts.len() {
            self.scan.parts.push(Part { object, group, material, faces: String::new() });
        }
        part
    }

    fn finish(mut self) -> Result<Scan<'a>, Fault> {
        self.faces.check_range(self.scan.elements.counts())?;
        self.scan.elements.finish(self.faces.has_texcoords, self.faces.has_normals);
        self.scan.color_scale = self.scan.elements.color_scale(self.notes);
        if self.scan.parts.is_empty() {
            self.notes.add(String::new, "no faces");
        }
        Ok(self.scan)
    }
}

fn named<'a>(names: &mut Names<'a>, name: Cow<'a, str>) -> Option<usize> {
    (!name.is_empty()).then(|| names.0.number(name))
}

/// What is said about a statement that makes no surface.
fn left_out(key: &str) -> &'static str {
    match key {
        "p" => "points (p) left out",
        "l" => "lines (l) left out",
        "s" | "sg" => "smoothing groups (s) ignored: normals are taken as the file has them",
        "vp" | "cstype" | "deg" | "bmat" | "step" | "curv" | "curv2" | "surf" | "parm" | "trim" | "hole" | "scrv"
        | "sp" | "end" | "con" | "bsp" | "bzp" | "cdc" | "cdp" | "res" => "free-form curves and surfaces left out",
        "bevel" | "c_interp" | "d_interp" | "lod" | "maplib" | "usemap" | "shadow_obj" | "trace_obj" | "ctech"
        | "stech" | "mg" => "display attributes ignored",
        "call" | "csh" => "calls of other files (call, csh) ignored",
        _ => "statements of unknown keyword ignored",
    }
}

/// Whether a number that C printed for "not a number" or infinity is among the words, or a comment behind them.
fn needs_repair(rest: &str) -> bool {
    rest.bytes().any(|byte| byte == b'#' || byte == b'(')
}

/// The words without a comment behind them, `1.#IND`, `-1.#INF`, `nan(ind)` and their like written as Rust reads them.
fn repaired(rest: &str) -> String {
    let mut out = String::with_capacity(rest.len());
    for word in words(rest) {
        let sign = if word.starts_with('-') { "-" } else { "" };
        let lower = word.to_ascii_lowercase();
        match () {
            () if lower.contains("#inf") => out.extend([sign, "inf"]),
            () if word.contains('#') || lower.contains("nan(") => out.push_str("nan"),
            () => out.push_str(word),
        }
        out.push(' ');
    }
    out
}
