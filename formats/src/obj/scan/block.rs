//! Scans one block of an OBJ text by itself; whatever depends on earlier blocks is left open.

use std::ops::Range;

use super::super::text::{self, Line, words};
use super::elements::{Elements, Tally};
use super::face::{Faces, Largest};
use super::pieces::{Piece, Sources};
use super::{Fault, Kind};

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
    /// Number of elements of the text, if faces refer to elements beyond.
    pub(super) total: Option<[i64; 3]>,
    /// Whether damage is a fault.
    pub(super) strict: bool,
    /// Whether the numbers of elements are checked.
    pub(super) check: bool,
}

/// Something wrong that the reader leaves out: the first cause, its line, and the number of lines.
#[derive(Clone, Debug, Default)]
pub(super) struct Damage {
    pub(super) line: usize,
    pub(super) cause: String,
    pub(super) count: usize,
}

impl Damage {
    fn add(&mut self, line: usize, cause: String) {
        if self.count == 0 {
            (self.line, self.cause) = (line, cause);
        }
        self.count += 1;
    }
}

/// Statements that assign faces to parts, and the faces between them. Names are ranges of [`Block::names`].
#[derive(Debug)]
pub(super) enum Event {
    Object(Range<usize>),
    Group(Range<usize>),
    Material(Range<usize>),
    /// A smoothing group; 0 for none.
    Smoothing(u32),
    /// Faces, lines or points, and their number.
    Faces(Kind, Piece, usize),
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
    /// Faces left out, and faces whose texture coordinates or normals count as missing.
    pub(super) damage: [Damage; 3],
    /// Whether there is a statement of OBJ.
    pub(super) known: bool,
    /// The first line that is none.
    pub(super) unknown: Option<usize>,
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

    /// Whether faces refer to elements beyond these.
    pub(super) fn goes_beyond(&self, counts: [i64; 3]) -> bool {
        (0..3).any(|kind| self.largest[kind].0 > counts[kind])
    }

    /// Returns the text and the replacement statements that the pieces of this block refer to.
    pub(super) fn sources(&mut self, text: String) -> Sources {
        Sources::new(text, std::mem::take(&mut self.mended))
    }
}

struct Scanner {
    before: Option<[i64; 3]>,
    strict: bool,
    damage: [Damage; 3],
    known: bool,
    unknown: Option<usize>,
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
            strict: context.strict,
            damage: Default::default(),
            known: false,
            unknown: None,
            elements: Elements {
                color_all: context.colored,
                strict: context.strict,
                check: context.check,
                ..Elements::default()
            },
            faces: Faces::new(&context),
            events: Vec::new(),
            names: String::new(),
            mended: String::new(),
            libraries: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn statement(&mut self, line: Line<'_>) -> Result<(), String> {
        let key = line.text().0;
        if self.keyword(key, &line)? {
            self.known = true;
            return Ok(());
        }
        let lower = key.to_ascii_lowercase();
        if lower != key && self.keyword(&lower, &line)? {
            self.known = true;
            return Ok(());
        }
        let message = left_out(&lower);
        match message {
            UNKNOWN => _ = self.unknown.get_or_insert(line.number),
            _ => self.known = true,
        }
        self.note(line.number, message);
        Ok(())
    }

    /// Reads a statement of this keyword; returns whether it is one that counts.
    fn keyword(&mut self, key: &str, line: &Line<'_>) -> Result<bool, String> {
        let rest = line.text().1;
        match key {
            "v" | "vt" | "vn" => {
                if let Some(unread) = self.elements.add(key, line, &mut self.mended)? {
                    self.note(line.number, unread);
                }
            }
            "f" | "fo" => self.face(line)?,
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
            "l" => self.strokes(Kind::Lines, line)?,
            "p" => self.strokes(Kind::Points, line)?,
            "s" | "sg" => self.events.push(Event::Smoothing(words(rest).next().map_or(0, smoothing_group))),
            "mtllib" => self.libraries.push((line.number, rest.to_owned())),
            _ => return Ok(false),
        }
        Ok(true)
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
        match self.faces.read(rest, line.number, counts) {
            Err(cause) if self.strict => return Err(cause),
            Err(cause) => {
                self.damage[0].add(line.number, cause);
                return Ok(());
            }
            Ok(0..3) => {
                self.note(line.number, "faces of fewer than three corners left out");
                return Ok(());
            }
            Ok(_) => {}
        }
        for (kind, absent) in self.faces.absent.iter_mut().enumerate() {
            if let Some(cause) = absent.take() {
                self.damage[kind + 1].add(line.number, cause);
            }
        }
        let piece = if self.faces.is_plain() && line.is_verbatim() && key == "f" {
            Piece::text(line.range.clone())
        } else {
            let start = self.mended.len();
            self.faces.write(rest, &mut self.mended);
            Piece::mended(start..self.mended.len())
        };
        self.push(Kind::Faces, piece, 1);
        Ok(())
    }

    fn push(&mut self, kind: Kind, piece: Piece, count: usize) {
        if let Some(Event::Faces(of, last, faces)) = self.events.last_mut()
            && *of == kind
            && last.extend(&piece)
        {
            *faces += count;
            return;
        }
        self.events.push(Event::Faces(kind, piece, count));
    }

    /// Adds lines between consecutive corners, or a point for each corner.
    fn strokes(&mut self, kind: Kind, line: &Line<'_>) -> Result<(), String> {
        if self.is_provisional() {
            return Ok(());
        }
        let within = self.elements.tally.counts;
        let counts = self.before.map(|before| [0, 1, 2].map(|kind| before[kind] + within[kind]));
        match self.faces.read(line.text().1, line.number, counts) {
            Err(cause) if self.strict => return Err(cause),
            Err(_) => self.note(line.number, "lines and points that refer to no vertex left out"),
            Ok(_) => {
                let start = self.mended.len();
                let count = self.faces.write_strokes(if kind == Kind::Lines { 2 } else { 1 }, &mut self.mended);
                if count > 0 {
                    self.push(kind, Piece::mended(start..self.mended.len()), count);
                }
                let message = match kind {
                    Kind::Lines => "lines (l) are kept as lines, which rays do not hit",
                    _ => "points (p) are kept as points, which rays do not hit",
                };
                self.note(line.number, message);
            }
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
            damage: self.damage,
            known: self.known,
            unknown: self.unknown,
            fault,
        }
    }
}

/// Returns the number of a smoothing group: 1 for `on`, 0 for `off` and anything else that is no number.
fn smoothing_group(word: &str) -> u32 {
    if word.eq_ignore_ascii_case("on") {
        return 1;
    }
    word.parse::<i64>().map_or(0, |group| group.unsigned_abs() as u32)
}

/// The note for statements that OBJ does not define.
const UNKNOWN: &str = "statements of unknown keyword ignored";

/// Returns the note for a statement that does not define a surface.
fn left_out(key: &str) -> &'static str {
    match key {
        "vp" | "cstype" | "deg" | "bmat" | "step" | "curv" | "curv2" | "surf" | "parm" | "trim" | "hole" | "scrv"
        | "sp" | "end" | "con" | "bsp" | "bzp" | "cdc" | "cdp" | "res" => "free-form curves and surfaces left out",
        "bevel" | "c_interp" | "d_interp" | "lod" | "maplib" | "usemap" | "shadow_obj" | "trace_obj" | "ctech"
        | "stech" | "mg" => "display attributes ignored",
        "call" | "csh" => "calls of other files (call, csh) ignored",
        _ => UNKNOWN,
    }
}
