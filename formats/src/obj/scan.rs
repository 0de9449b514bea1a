//! The first pass over an OBJ text: assigns faces to parts, and produces a normalised text for `tobj`.
//!
//! The normalised text holds all `v`, `vt` and `vn` lines, then the faces of each part (object, group and material)
//! under a `g` line with the part's number. Corners without a texture coordinate or a normal refer to one appended at
//! the end that is NaN; vertices without a colour get NaN colours if others have one. Thus `tobj` never has to invent a
//! value, and missing values can be recognised in its output.
//!
//! Blocks of the text are scanned in parallel and merged in order. Most lines are already normalised: the result
//! consists of slices of the text, and each block is freed as soon as `tobj` has read the last of its slices.

use std::collections::HashMap;
use std::hash::Hash;

use bytes::Bytes;
use rayon::prelude::*;

use super::normals::Run;
use super::notes::Notes;
use super::text::{self, words};

mod block;
mod chunks;
mod elements;
mod face;
mod merge;
mod pieces;

use block::{Block, Context};
use chunks::Chunks;
use elements::Tally;
use merge::Merge;

/// A faulty line.
#[derive(Debug)]
pub(super) struct Fault {
    /// The line number, from 1.
    pub(super) line: usize,
    /// Description of the fault.
    pub(super) cause: String,
}

/// What a part consists of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    #[default]
    Faces,
    /// Pairs of corners.
    Lines,
    /// Single corners.
    Points,
}

/// The faces, lines or points of one object, group and material.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) kind: Kind,
    /// Index into [`Scan::objects`]; `None` before the first `o` and after an `o` without a name.
    pub(super) object: Option<usize>,
    /// Index into [`Scan::groups`]; `None` if there was no `g` since the last `o`.
    pub(super) group: Option<usize>,
    /// Index into [`Scan::materials`]; `None` before the first `usemtl`.
    pub(super) material: Option<usize>,
    /// The smoothing groups of its faces, in order.
    pub(super) smoothing: Vec<Run>,
}

/// The contents of an OBJ text except for its numbers.
#[derive(Debug, Default)]
pub(super) struct Scan {
    /// Names of objects, in order; several may have one name.
    pub(super) objects: Vec<String>,
    /// Names of groups, each once.
    pub(super) groups: Names,
    /// Names of materials, each once.
    pub(super) materials: Names,
    /// `mtllib` statements: line and rest of the line.
    pub(super) libraries: Vec<(usize, String)>,
    /// The parts with at least one face, in order of their first face.
    pub(super) parts: Vec<Part>,
    /// Divisor that brings vertex colours into 0..1.
    pub(super) full_color: f32,
}

/// The numbers of an OBJ text, in a form that `tobj` reads without loss.
#[derive(Debug, Default)]
pub(super) struct Statements {
    elements: Vec<Bytes>,
    /// The faces of each part.
    faces: Vec<Vec<Bytes>>,
}

/// Distinct names in order of first appearance.
#[derive(Debug, Default)]
pub(super) struct Names(Interner<String>);

impl Names {
    /// Returns the name with that index.
    pub(super) fn get(&self, index: usize) -> &str {
        &self.0.values[index]
    }

    /// Returns the names in order.
    pub(super) fn iter(&self) -> impl Iterator<Item = &str> {
        self.0.values.iter().map(String::as_str)
    }

    fn number(&mut self, name: &str) -> usize {
        self.0.index.get(name).copied().unwrap_or_else(|| self.0.number(name.to_owned()))
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

impl Scan {
    /// Scans a text in blocks of whole lines. With `check` the numbers of elements are checked, which `tobj` does, too,
    /// but without naming the line.
    ///
    /// # Errors
    /// Names the first line with a malformed position; if `strict`, the first with anything malformed or out of range,
    /// which is otherwise left out with a warning unless nothing else is there.
    pub(super) fn of(
        texts: Vec<String>,
        strict: bool,
        check: bool,
        notes: &mut Notes,
    ) -> Result<(Self, Statements), Fault> {
        let has = |keyword: &str| texts.par_iter().any(|text| text.contains(keyword));
        let (has_texcoords, has_normals, colored) = (has("vt"), has("vn"), begins_colored(&texts));
        let context = Context { has_texcoords, has_normals, colored, before: None, total: None, strict, check };
        let mut blocks: Vec<Block> = texts.par_iter().map(|text| Block::of(text, context)).collect();
        let context = settle(&texts, &mut blocks, context);

        let mut merge = Merge::new(notes);
        for (text, block) in texts.into_iter().zip(blocks) {
            merge.add(text, block)?;
        }
        merge.finish(context)
    }
}

/// Whether the first position of the text has a colour; if so, that need not be determined by scanning.
fn begins_colored(texts: &[String]) -> bool {
    let mut lines = texts.iter().take(1).flat_map(|text| text::lines(text));
    let first = lines.find(|line| line.text().0 == "v");
    first.is_some_and(|line| words(line.text().1).count() >= 6)
}

/// Rescans the blocks that depend on others, with the results of the first scan; returns what is known of all.
fn settle(texts: &[String], blocks: &mut [Block], context: Context) -> Context {
    let colored = blocks.iter().any(|block| block.tally.colored);
    let mut before = Tally::default();
    let known: Vec<[i64; 3]> = blocks
        .iter()
        .map(|block| {
            let counts = before.counts;
            before.add(&block.tally);
            counts
        })
        .collect();
    let total = before.counts;
    // Keywords in capitals are only found by the scan.
    let (texcoords, normals) = (context.has_texcoords || total[1] > 0, context.has_normals || total[2] > 0);
    let surprising = (texcoords, normals) != (context.has_texcoords, context.has_normals);
    let all = Context { has_texcoords: texcoords, has_normals: normals, colored, ..context };
    blocks.par_iter_mut().zip(texts).zip(known).for_each(|((block, text), before)| {
        if surprising || block.depends_on_others(colored, context) {
            *block = Block::of(text, Context { before: Some(before), ..all });
        }
        if !context.strict && block.goes_beyond(total) {
            *block = Block::of(text, Context { before: Some(before), total: Some(total), ..all });
        }
    });
    all
}

impl Statements {
    /// Parses the normalised text, which is freed as it is read. The meshes are in the order of [`Scan::parts`]; either
    /// all corners of a mesh have texture coordinates and normals or none has; missing ones are not finite.
    pub(super) fn parse(self) -> Result<Vec<tobj::Mesh>, tobj::LoadError> {
        let parts = self.faces.len();
        let header = |part: usize| Bytes::from(format!("g {part}\n"));
        let faces = (0..).zip(self.faces).flat_map(|(part, faces)| std::iter::once(header(part)).chain(faces));
        let options = tobj::LoadOptions { single_index: false, triangulate: false, ..Default::default() };
        let no_library = |_: &std::path::Path| Err(tobj::LoadError::GenericFailure);
        let mut text = Chunks::new(self.elements.into_iter().chain(faces));
        let (models, _) = tobj::load_obj_buf(&mut text, &options, no_library)?;
        // `tobj` adds an empty model if there are no faces at all.
        Ok(models.into_iter().map(|model| model.mesh).take(parts).collect())
    }
}

/// Whether the words contain numbers that Rust does not parse as they are, or are followed by a comment.
fn needs_repair(rest: &str) -> bool {
    rest.bytes().any(|byte| matches!(byte, b'#' | b'(' | b',' | b'd' | b'D'))
}

/// Returns the numbers of a statement without a trailing comment, rewritten for Rust: `1.#IND`, `-1.#INF`, `nan(ind)`
/// and similar of C, exponents `1.0D+00` of Fortran, decimal commas. Commas separate numbers if the statement has
/// otherwise too few.
fn repaired(key: &str, rest: &str) -> String {
    let least = if key == "vt" { 2 } else { 3 };
    let commas_separate = rest.contains(',') && words(rest).filter(|word| *word != ",").count() < least;
    let separated = commas_separate.then(|| rest.replace(',', " "));
    let mut out = String::with_capacity(rest.len());
    for word in words(separated.as_deref().unwrap_or(rest)) {
        let sign = if word.starts_with('-') { "-" } else { "" };
        let lower = word.to_ascii_lowercase();
        match () {
            () if lower.contains("#inf") => out.extend([sign, "inf"]),
            () if word.contains('#') || lower.contains("nan(") => out.push_str("nan"),
            () => out.push_str(&plain_number(&lower)),
        }
        out.push(' ');
    }
    out
}

/// Returns a number with a decimal point and an exponent `e`. The last of commas and points is the decimal one, those
/// before it group digits; a comma at the end only separates.
fn plain_number(word: &str) -> String {
    let word = word.trim_end_matches(',');
    let word = if word.starts_with(|c: char| c.is_ascii_digit() || "+-.,".contains(c)) {
        word.replacen('d', "e", 1)
    } else {
        word.to_owned()
    };
    match (word.rfind(','), word.rfind('.')) {
        (None, _) => word,
        (Some(comma), Some(point)) if comma < point => word.replace(',', ""),
        _ => word.replace('.', "").replacen(',', ".", 1),
    }
}
