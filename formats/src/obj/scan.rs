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

/// The faces of one object, group and material.
#[derive(Debug)]
pub(super) struct Part {
    /// Index into [`Scan::objects`]; `None` before the first `o` and after an `o` without a name.
    pub(super) object: Option<usize>,
    /// Index into [`Scan::groups`]; `None` if there was no `g` since the last `o`.
    pub(super) group: Option<usize>,
    /// Index into [`Scan::materials`]; `None` before the first `usemtl`.
    pub(super) material: Option<usize>,
}

/// The contents of an OBJ text except for its numbers.
#[derive(Debug, Default)]
pub(super) struct Scan {
    /// Names of objects, each once.
    pub(super) objects: Names,
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
    /// Scans a text in blocks of whole lines.
    ///
    /// # Errors
    /// Names the first line that has too few numbers, or indices that are malformed, zero or out of range. Malformed
    /// coordinates are left to [`Statements::parse`].
    pub(super) fn of(texts: Vec<String>, notes: &mut Notes) -> Result<(Self, Statements), Fault> {
        let has = |keyword: &str| texts.par_iter().any(|text| text.contains(keyword));
        let context =
            Context { has_texcoords: has("vt"), has_normals: has("vn"), colored: begins_colored(&texts), before: None };
        let mut blocks: Vec<Block> = texts.par_iter().map(|text| Block::of(text, context)).collect();
        settle(&texts, &mut blocks, context);

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

/// Rescans the blocks that depend on others, with the results of the first scan.
fn settle(texts: &[String], blocks: &mut [Block], context: Context) {
    let colored = blocks.iter().any(|block| block.tally.colored);
    let mut before = Tally::default();
    let known: Vec<Context> = blocks
        .iter()
        .map(|block| {
            let known = Context { colored, before: Some(before.counts), ..context };
            before.add(&block.tally);
            known
        })
        .collect();
    blocks.par_iter_mut().zip(texts).zip(known).for_each(|((block, text), known)| {
        if block.depends_on_others(known.colored, context) {
            *block = Block::of(text, known);
        }
    });
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

/// Returns the first line with a malformed coordinate; used after parsing has failed.
pub(super) fn first_malformed(texts: &[String]) -> Option<Fault> {
    let mut before = 0;
    texts.iter().find_map(|text| {
        let fault = text::lines(text).find_map(|line| {
            let (key, rest) = line.text();
            elements::check(key, rest).err().map(|cause| Fault { line: before + line.number, cause })
        });
        before += text.matches('\n').count();
        fault
    })
}

/// Whether the words contain NaN or infinity as printed by C, or are followed by a comment.
fn needs_repair(rest: &str) -> bool {
    rest.bytes().any(|byte| byte == b'#' || byte == b'(')
}

/// Returns the words without a trailing comment, with `1.#IND`, `-1.#INF`, `nan(ind)` and similar rewritten for Rust.
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
