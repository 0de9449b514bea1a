//! Merges the blocks of a text in order: names, parts, places.

use bytes::Bytes;

use super::super::notes::Notes;
use super::super::text::place;
use super::block::{Block, Context, Event};
use super::elements::{self, Tally};
use super::face::{self, Largest};
use super::pieces::Sources;
use super::{Fault, Interner, Names, Part, Scan, Statements};

/// Merges blocks.
pub(super) struct Merge<'n> {
    scan: Scan,
    statements: Statements,
    notes: &'n mut Notes,
    keys: Interner<(Option<usize>, Option<usize>, Option<usize>)>,
    object: Option<usize>,
    group: Option<usize>,
    material: Option<usize>,
    /// The current part, for object, group and material; `None` until a face needs it.
    part: Option<usize>,
    /// Number of lines so far.
    lines: usize,
    tally: Tally,
    largest: Largest,
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
            part: None,
            lines: 0,
            tally: Tally::default(),
            largest: [(0, 0); 3],
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
                self.object = named(&mut self.scan.objects, &names[name.clone()]);
                self.group = None;
            }
            Event::Group(name) => self.group = named(&mut self.scan.groups, &names[name.clone()]),
            Event::Material(name) => self.material = Some(self.scan.materials.number(&names[name.clone()])),
            Event::Faces(piece) => {
                let part = self.part.unwrap_or_else(|| self.enter_part());
                self.part = Some(part);
                return self.statements.faces[part].push(sources.slice(piece));
            }
        }
        self.part = None;
    }

    fn enter_part(&mut self) -> usize {
        let (object, group, material) = (self.object, self.group, self.material);
        let part = self.keys.number((object, group, material));
        if part == self.scan.parts.len() {
            self.scan.parts.push(Part { object, group, material });
            self.statements.faces.push(Vec::new());
        }
        part
    }

    pub(super) fn finish(mut self, context: Context) -> Result<(Scan, Statements), Fault> {
        if let Some((line, cause)) = face::beyond(&self.largest, self.tally.counts) {
            return Err(Fault { line, cause });
        }
        let missing = elements::missing(context.has_texcoords, context.has_normals);
        self.statements.elements.extend(missing.map(|line| Bytes::from_static(line.as_bytes())));
        self.scan.full_color = self.tally.full_color(self.notes);
        if self.scan.parts.is_empty() {
            self.notes.add(String::new, "no faces");
        }
        Ok((self.scan, self.statements))
    }
}

fn named(names: &mut Names, name: &str) -> Option<usize> {
    (!name.is_empty()).then(|| names.number(name))
}
