//! Merges the blocks of a text in order: names, parts, places.

use bytes::Bytes;

use super::super::normals::Run;
use super::super::notes::Notes;
use super::super::text::place;
use super::block::{Block, Context, Damage, Event};
use super::elements::{self, Tally};
use super::face::{self, Largest};
use super::pieces::Sources;
use super::{Fault, Interner, Kind, Part, Scan, Statements};

/// Kind, object, group and material of a part.
type Key = (Kind, Option<usize>, Option<usize>, Option<usize>);

/// Merges blocks.
pub(super) struct Merge<'n> {
    scan: Scan,
    statements: Statements,
    notes: &'n mut Notes,
    keys: Interner<Key>,
    object: Option<usize>,
    group: Option<usize>,
    material: Option<usize>,
    /// The current smoothing group; 0 if none.
    smoothing: u32,
    /// The current part, for object, group and material, with its kind; `None` until a face needs it.
    part: Option<(Kind, usize)>,
    /// Number of lines so far.
    lines: usize,
    tally: Tally,
    largest: Largest,
    /// See [`Block::damage`].
    damage: [Damage; 3],
    known: bool,
    unknown: Option<usize>,
}

impl<'n> Merge<'n> {
    pub(super) fn new(notes: &'n mut Notes) -> Self {
        Merge {
            scan: Scan::default(),
            statements: Statements::default(),
            notes,
            keys: Interner::default(),
            object: None,
            group: None,
            material: None,
            smoothing: 0,
            part: None,
            lines: 0,
            tally: Tally::default(),
            largest: [(0, 0); 3],
            damage: Default::default(),
            known: false,
            unknown: None,
        }
    }

    pub(super) fn add(&mut self, text: String, mut block: Block) -> Result<(), Fault> {
        let line = |within: usize| self.lines + within;
        for &(first, message, count) in &block.notes {
            self.notes.add_many(|| place(line(first)), message, count);
        }
        if let Some(fault) = block.fault {
            return Err(Fault { line: line(fault.line), ..fault });
        }
        for (largest, (index, within)) in self.largest.iter_mut().zip(block.largest) {
            if index > largest.0 {
                *largest = (index, line(within));
            }
        }
        for (damage, of_block) in self.damage.iter_mut().zip(&block.damage) {
            if damage.count == 0 {
                *damage = Damage { line: line(of_block.line), ..of_block.clone() };
            } else {
                damage.count += of_block.count;
            }
        }
        self.known |= block.known;
        self.unknown = self.unknown.or(block.unknown.map(line));
        self.scan.libraries.extend(block.libraries.drain(..).map(|(within, rest)| (line(within), rest)));
        self.tally.add(&block.tally);
        self.lines += block.lines;

        let sources = block.sources(text);
        self.statements.elements.extend(block.elements.iter().map(|piece| sources.slice(piece)));
        for event in &block.events {
            self.event(event, &block.names, &sources);
        }
        Ok(())
    }

    fn event(&mut self, event: &Event, names: &str, sources: &Sources) {
        match event {
            Event::Object(name) => {
                // Objects of one name are as many objects.
                self.object = (!name.is_empty()).then(|| {
                    self.scan.objects.push(names[name.clone()].to_owned());
                    self.scan.objects.len() - 1
                });
                self.group = None;
            }
            Event::Group(name) => {
                self.group = (!name.is_empty()).then(|| self.scan.groups.number(&names[name.clone()]));
            }
            Event::Material(name) => self.material = Some(self.scan.materials.number(&names[name.clone()])),
            Event::Smoothing(group) => {
                self.smoothing = *group;
                return;
            }
            Event::Faces(kind, piece, count) => {
                let part =
                    self.part.filter(|(of, _)| of == kind).map_or_else(|| self.enter_part(*kind), |(_, part)| part);
                self.part = Some((*kind, part));
                self.add_run(part, *count);
                return self.statements.faces[part].push(sources.slice(piece));
            }
        }
        self.part = None;
    }

    /// Adds faces of the current smoothing group to a part.
    fn add_run(&mut self, part: usize, faces: usize) {
        let (runs, group) = (&mut self.scan.parts[part].smoothing, self.smoothing);
        match runs.last_mut() {
            Some(last) if last.group == group => last.faces += faces,
            _ => runs.push(Run { group, faces }),
        }
    }

    fn enter_part(&mut self, kind: Kind) -> usize {
        let (object, group, material) = (self.object, self.group, self.material);
        let part = self.keys.number((kind, object, group, material));
        if part == self.scan.parts.len() {
            self.scan.parts.push(Part { kind, object, group, material, smoothing: Vec::new() });
            self.statements.faces.push(Vec::new());
        }
        part
    }

    pub(super) fn finish(mut self, context: Context) -> Result<(Scan, Statements), Fault> {
        if let Some(line) = self.unknown.filter(|_| !self.known) {
            return Err(Fault { line, cause: "the file has no OBJ statement: is it of another format?".to_owned() });
        }
        if let Some((line, cause)) = face::beyond(&self.largest, self.tally.counts) {
            return Err(Fault { line, cause });
        }
        let has_faces = self.scan.parts.iter().any(|part| part.kind == Kind::Faces);
        if let [Damage { line, cause, count: 1.. }, ..] = &self.damage
            && !has_faces
        {
            return Err(Fault { line: *line, cause: cause.clone() });
        }
        let left_out = ["the face is left out", "it counts as missing", "it counts as missing"];
        for (damage, done) in self.damage.iter().zip(left_out) {
            self.notes.add_many(|| place(damage.line), &format!("{}: {done}", damage.cause), damage.count);
        }
        let missing = elements::missing(context.has_texcoords, context.has_normals);
        self.statements.elements.extend(missing.map(|line| Bytes::from_static(line.as_bytes())));
        self.scan.full_color = self.tally.full_color(self.notes);
        if !has_faces {
            self.notes.add(String::new, "no faces");
        }
        Ok((self.scan, self.statements))
    }
}
