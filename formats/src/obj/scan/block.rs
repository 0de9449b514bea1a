//! Scans one block of an OBJ text by itself; whatever depends on earlier blocks is left open.

use std::ops::Range;

use super::super::text::{self, Line};
use super::Fault;
use super::elements::{Elements, Tally};
use super::face::{Faces, Largest};
use super::pieces::{Piece, Sources};

/// What the scan of a block needs to know of the others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Context {
    /// Whether the text may have texture coordinates (it has a `vt` somewhere).
    pub(super) has_texcoords: bool,
    /// Whether the text may have normals.
    pub(super) has_normals: bool,
    /// Whether a position of the text has a colour.
    pub(super) colored: bool,
    /// Number of elements before the block; `None` if not counted yet.
    pub(super) before: Option<[i64; 3]>,
}

/// Statements that assign faces to parts, and the faces between them. Names are ranges of [`Block::names`].
#[derive(Debug)]
pub(super) enum Event {
    Object(Range<usize>),
    Group(Range<usize>),
    Material(Range<usize>),
    Faces(Piece),
}

/// The scan of a block. Line numbers are relative to the block and start at 1.
#[derive(Debug)]
pub(super) struct Block {
    /// Number of lines.
    pub(super) lines: usize,
    pub(super) tally: Tally,
    /// All elements, as `tobj` reads them.
    pub(super) elements: Vec<Piece>,
    pub(super) events: Vec<Event>,
    pub(super) names: String,
    /// Replacements of statements that `tobj` would misread.
    pub(super) mended: String,
    /// `mtllib` statements: line and rest of the line.
    pub(super) libraries: Vec<(usize, String)>,
    /// Messages, each with its first line and the number of lines.
    pub(super) notes: Vec<(usize, &'static str, usize)>,
    pub(super) largest: Largest,
    /// Whether faces use indices relative to earlier elements.
    pub(super) counts_back: bool,
    /// The first faulty line, at which the scan stopped.
    pub(super) fault: Option<Fault>,
}

impl Block {
    /// Scans the block.
    pub(super) fn of(text: &str, context: Context) -> Block {
        let mut scanner = Scanner::new(context);
        let fault = text::lines(text).find_map(|line| {
            let number = line.number;
            scanner.statement(line).err().map(|cause| Fault { line: number, cause })
        });
        scanner.finish(text, fault)
    }

    /// Whether the scan would differ once the other blocks are known.
    pub(super) fn depends_on_others(&self, colored: bool, context: Context) -> bool {
        context.before.is_none() && self.counts_back || colored && !context.colored
    }

    /// Returns the text and the replacement statements that the pieces of this block refer to.
    pub(super) fn sources(&mut self, text: String) -> Sources {
        Sources::new(text, std::mem::take(&mut self.mended))
    }
}

struct Scanner {
    before: Option<[i64; 3]>,
    elements: Elements,
    faces: Faces,
    events: Vec<Event>,
    names: String,
    mended: String,
    libraries: Vec<(usize, String)>,
    notes: Vec<(usize, &'static str, usize)>,
}

impl Scanner {
    fn new(context: Context) -> Self {
        Scanner {
            before: context.before,
            elements: Elements { color_all: context.colored, ..Elements::default() },
            faces: Faces::new(&context),
            events: Vec::new(),
            names: String::new(),
            mended: String::new(),
            libraries: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn statement(&mut self, line: Line<'_>) -> Result<(), String> {
        let (key, rest) = line.text();
        match key {
            "v" | "vt" | "vn" => {
                if let Some(unread) = self.elements.add(&line, &mut self.mended)? {
                    self.note(line.number, unread);
                }
            }
            "f" | "fo" => self.face(&line)?,
            "o" => {
                let name = self.name(rest);
                self.events.push(Event::Object(name));
            }
            "g" => {
                let name = self.name(rest);
                self.events.push(Event::Group(name));
            }
            "usemtl" => {
                let name = self.name(rest);
                self.events.push(Event::Material(name));
            }
            "mtllib" => self.libraries.push((line.number, rest.to_owned())),
            _ => self.note(line.number, left_out(key)),
        }
        Ok(())
    }

    fn name(&mut self, name: &str) -> Range<usize> {
        let start = self.names.len();
        self.names.push_str(name);
        start..self.names.len()
    }

    fn note(&mut self, line: usize, message: &'static str) {
        match self.notes.iter_mut().find(|(_, known, _)| *known == message) {
            Some((_, _, count)) => *count += 1,
            None => self.notes.push((line, message, 1)),
        }
    }

    /// Whether the block will be scanned again, so that for now only its elements need to be counted.
    fn is_provisional(&self) -> bool {
        self.before.is_none() && (self.faces.counts_back || self.elements.tally.colored && !self.elements.color_all)
    }

    fn face(&mut self, line: &Line<'_>) -> Result<(), String> {
        if self.is_provisional() {
            return Ok(());
        }
        let (key, rest) = line.text();
        let within = self.elements.tally.counts;
        let counts = self.before.map(|before| [0, 1, 2].map(|kind| before[kind] + within[kind]));
        if self.faces.read(rest, line.number, counts)? < 3 {
            self.note(line.number, "faces of fewer than three corners left out");
            return Ok(());
        }
        let piece = if self.faces.is_plain() && line.is_verbatim() && key == "f" {
            Piece::text(line.range.clone())
        } else {
            let start = self.mended.len();
            self.faces.write(rest, &mut self.mended);
            Piece::mended(start..self.mended.len())
        };
        let follows = match self.events.last_mut() {
            Some(Event::Faces(last)) => last.extend(&piece),
            _ => false,
        };
        if !follows {
            self.events.push(Event::Faces(piece));
        }
        Ok(())
    }

    fn finish(self, text: &str, fault: Option<Fault>) -> Block {
        Block {
            lines: text.bytes().filter(|&byte| byte == b'\n').count(),
            tally: self.elements.tally,
            elements: self.elements.pieces,
            events: self.events,
            names: self.names,
            mended: self.mended,
            libraries: self.libraries,
            notes: self.notes,
            largest: self.faces.largest,
            counts_back: self.faces.counts_back,
            fault,
        }
    }
}

/// Returns the note for a statement that does not define a surface.
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
