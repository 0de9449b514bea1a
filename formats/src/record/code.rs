//! The bytes of a record, see `docs/provenance.md`: unsigned integers of variable length (LEB128), differences where
//! neighbours are alike, and the whole compressed (zlib).

use std::io::{Read, Write};

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;

use super::{GeometryHash, Origins, Placed, Record, Source};

const UNKNOWN: u64 = 0;
const SAME: u64 = 1;
const EACH: u64 = 2;

/// Returns the compressed bytes of a record, but for the hash of its input.
pub(crate) fn encode(record: &Record) -> Vec<u8> {
    let mut out = Writer(Vec::new());
    out.number(record.nodes.len() as u64);
    for (at, node) in record.nodes.iter().enumerate() {
        out.number(node.map_or(0, |node| 1 + zigzag(i64::from(node) - at as i64)));
    }
    out.number(record.lists.len() as u64);
    for list in &record.lists {
        out.number(list.len() as u64);
        list.iter().for_each(|origins| out.origins(origins));
    }
    out.number(record.placed.len() as u64);
    let mut last = Placed { node: 0, copy: 0, list: 0, input: None, stands_in: false };
    for placed in &record.placed {
        out.number(u64::from(placed.node - last.node));
        out.number(u64::from(placed.copy));
        out.difference(placed.list, last.list);
        out.number(u64::from(placed.stands_in) + 2 * u64::from(placed.input.is_some()));
        if let Some((node, copy)) = placed.input {
            out.difference(node, placed.node);
            out.number(u64::from(copy));
        }
        last = *placed;
    }
    let mut compressed = ZlibEncoder::new(Vec::new(), Compression::best());
    compressed.write_all(&out.0).and_then(|()| compressed.finish()).expect("memory can be written to")
}

/// Reads a record of `input` from its compressed bytes, which may not become more than `most` uncompressed ones.
///
/// # Errors
/// Says what is wrong with the bytes.
pub(crate) fn decode(input: GeometryHash, bytes: &[u8], most: u64) -> Result<Record, &'static str> {
    let mut plain = Vec::new();
    let read = ZlibDecoder::new(bytes).take(most.saturating_add(1)).read_to_end(&mut plain);
    read.map_err(|_| "its origins cannot be decompressed")?;
    if plain.len() as u64 > most {
        return Err("its origins are larger than those of any file of this size");
    }
    let mut bytes = Reader(&plain);
    let nodes = bytes.list(|bytes, at| match bytes.number()? {
        0 => Ok(None),
        node => add(at, unzigzag(node - 1)).map(Some),
    })?;
    let lists = bytes.list(|bytes, _| bytes.list(|bytes, _| bytes.origins()))?;
    let mut last = (0, 0);
    let placed = bytes.list(|bytes, _| {
        let node = add(last.0, i64::try_from(bytes.number()?).map_err(|_| TOO_LARGE)?)?;
        let copy = bytes.small()?;
        let list = bytes.difference(last.1)?;
        let flags = bytes.number()?;
        let input = (flags & 2 != 0).then(|| Ok::<_, &str>((bytes.difference(node)?, bytes.small()?))).transpose()?;
        last = (node, list);
        Ok(Placed { node, copy, list, input, stands_in: flags & 1 != 0 })
    })?;
    let record = Record { input, nodes, lists, placed };
    match bytes.0.is_empty() {
        true => check(&record).map(|()| record),
        false => Err("there is something after its end"),
    }
}

/// Rejects a record that refers to what it does not have.
fn check(record: &Record) -> Result<(), &'static str> {
    let is_sorted = record.placed.is_sorted_by(|a, b| (a.node, a.copy) < (b.node, b.copy));
    let is_there = |placed: &Placed| (placed.list as usize) < record.lists.len();
    match is_sorted && record.placed.iter().all(is_there) {
        true => Ok(()),
        false => Err("its nodes are out of order or out of range"),
    }
}

const ENDS_EARLY: &str = "its origins end early";
const TOO_LARGE: &str = "a number in it is too large";

struct Writer(Vec<u8>);

impl Writer {
    fn number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.0.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.0.push(number as u8);
    }

    fn difference(&mut self, number: u32, from: u32) {
        self.number(zigzag(i64::from(number) - i64::from(from)));
    }

    fn sources(&mut self, sources: &[Source]) {
        let mut last = Source { node: None, copy: 0, mesh: 0, primitive: 0 };
        for source in sources {
            let node = source.node.map_or(0, |node| 1 + zigzag(i64::from(node) - i64::from(last.node.unwrap_or(0))));
            self.number(node);
            self.number(u64::from(source.copy));
            self.difference(source.mesh, last.mesh);
            self.number(u64::from(source.primitive));
            last = *source;
        }
    }

    fn origins(&mut self, origins: &Origins) {
        match origins {
            Origins::Unknown => self.number(UNKNOWN),
            Origins::Same(source) => {
                self.number(SAME);
                self.sources(&[*source]);
            }
            Origins::Each { sources, triangles } => {
                self.number(EACH);
                self.number(sources.len() as u64);
                self.sources(sources);
                self.triangles(sources.len(), triangles);
            }
        }
    }

    /// Numbers the triangles through all sources, and writes how far each is from the one after the last.
    fn triangles(&mut self, sources: usize, triangles: &[[u32; 2]]) {
        let mut spans = vec![0_u64; sources];
        for &[source, triangle] in triangles {
            let span = &mut spans[source as usize];
            *span = (*span).max(u64::from(triangle) + 1);
        }
        spans.iter().for_each(|&span| self.number(span));
        let starts = starts(&spans);
        self.number(triangles.len() as u64);
        let mut next = 0;
        for &[source, triangle] in triangles {
            let number = starts[source as usize] + u64::from(triangle);
            self.number(zigzag(number as i64 - next as i64));
            next = number + 1;
        }
    }
}

/// Returns the number of the first triangle of each source, followed by the total.
fn starts(spans: &[u64]) -> Vec<u64> {
    let mut next = 0;
    let mut starts: Vec<u64> = Vec::with_capacity(spans.len() + 1);
    for span in spans {
        starts.push(next);
        next += span;
    }
    starts.push(next);
    starts
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn number(&mut self) -> Result<u64, &'static str> {
        let mut number = 0;
        for shift in (0..63).step_by(7) {
            let (&byte, rest) = self.0.split_first().ok_or(ENDS_EARLY)?;
            self.0 = rest;
            number |= u64::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err(TOO_LARGE)
    }

    fn small(&mut self) -> Result<u32, &'static str> {
        u32::try_from(self.number()?).map_err(|_| TOO_LARGE)
    }

    fn difference(&mut self, from: u32) -> Result<u32, &'static str> {
        add(from, unzigzag(self.number()?))
    }

    /// Reads a count, and as many elements, each of at least a byte.
    fn list<T>(
        &mut self,
        mut element: impl FnMut(&mut Self, u32) -> Result<T, &'static str>,
    ) -> Result<Vec<T>, &'static str> {
        let count = self.small()?;
        if count as usize > self.0.len() {
            return Err(ENDS_EARLY);
        }
        (0..count).map(|at| element(self, at)).collect()
    }

    fn source(&mut self, last: &mut Source) -> Result<Source, &'static str> {
        let node = match self.number()? {
            0 => None,
            node => Some(add(last.node.unwrap_or(0), unzigzag(node - 1))?),
        };
        let copy = self.small()?;
        let mesh = self.difference(last.mesh)?;
        *last = Source { node, copy, mesh, primitive: self.small()? };
        Ok(*last)
    }

    fn origins(&mut self) -> Result<Origins, &'static str> {
        let mut last = Source { node: None, copy: 0, mesh: 0, primitive: 0 };
        match self.number()? {
            UNKNOWN => Ok(Origins::Unknown),
            SAME => Ok(Origins::Same(self.source(&mut last)?)),
            EACH => {
                let sources = self.list(|bytes, _| bytes.source(&mut last))?;
                let triangles = self.triangles(sources.len())?;
                Ok(Origins::Each { sources, triangles })
            }
            _ => Err("it has origins of a kind that is not known"),
        }
    }

    fn triangles(&mut self, sources: usize) -> Result<Vec<[u32; 2]>, &'static str> {
        let spans: Vec<u64> = (0..sources).map(|_| self.small().map(u64::from)).collect::<Result<_, _>>()?;
        let starts = starts(&spans);
        let (mut next, mut source) = (0_i64, 0);
        self.list(|bytes, _| {
            let number = next.checked_add(unzigzag(bytes.number()?)).ok_or(TOO_LARGE)?;
            next = number.checked_add(1).ok_or(TOO_LARGE)?;
            let number = u64::try_from(number).map_err(|_| "a triangle of it is out of range")?;
            let is_in = |source: usize| starts.get(source..source + 2).is_some_and(|s| (s[0]..s[1]).contains(&number));
            if !is_in(source) {
                source = starts.partition_point(|&start| start <= number).wrapping_sub(1);
            }
            match is_in(source) {
                true => Ok([source as u32, (number - starts[source]) as u32]),
                false => Err("a triangle of it is out of range"),
            }
        })
    }
}

fn add(number: u32, difference: i64) -> Result<u32, &'static str> {
    i64::from(number).checked_add(difference).and_then(|sum| u32::try_from(sum).ok()).ok_or(TOO_LARGE)
}

/// Maps small numbers of either sign to small numbers.
fn zigzag(number: i64) -> u64 {
    ((number << 1) ^ (number >> 63)) as u64
}

fn unzigzag(number: u64) -> i64 {
    (number >> 1) as i64 ^ -((number & 1) as i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn source() -> impl Strategy<Value = Source> {
        (proptest::option::of(0..9_u32), 0..3_u32, any::<u32>(), 0..4_u32).prop_map(|(node, copy, mesh, primitive)| {
            Source { node, copy: if node.is_some() { copy } else { 0 }, mesh, primitive }
        })
    }

    fn origins() -> impl Strategy<Value = Origins> {
        let each = proptest::collection::vec(source(), 1..4).prop_flat_map(|sources| {
            let triangle = (0..sources.len() as u32, 0..=u32::MAX - 1).prop_map(|(source, number)| [source, number]);
            let triangles = proptest::collection::vec(triangle, 0..9);
            triangles.prop_map(move |triangles| Origins::Each { sources: sources.clone(), triangles })
        });
        prop_oneof![Just(Origins::Unknown), source().prop_map(Origins::Same), each]
    }

    fn record() -> impl Strategy<Value = Record> {
        let lists = proptest::collection::vec(proptest::collection::vec(origins(), 0..3), 1..4);
        let nodes = proptest::collection::vec(proptest::option::of(any::<u32>()), 0..6);
        let of_node = (proptest::option::of((any::<u32>(), 0..3_u32)), any::<bool>());
        let placed = proptest::collection::btree_map((any::<u32>(), any::<u32>()), of_node, 0..6);
        (nodes, lists, placed).prop_map(|(nodes, lists, placed)| {
            let count = lists.len() as u32;
            let placed = placed.into_iter().map(|((node, copy), (input, stands_in))| Placed {
                node,
                copy,
                list: copy % count,
                input,
                stands_in,
            });
            Record { input: GeometryHash([7; 32]), nodes, placed: placed.collect(), lists }
        })
    }

    proptest! {
        #[test]
        fn a_record_that_is_read_is_the_one_that_was_written(record in record()) {
            let bytes = encode(&record);
            prop_assert_eq!(decode(record.input, &bytes, 1 << 20), Ok(record));
        }

        #[test]
        fn damaged_bytes_are_refused_or_read_as_a_record_that_is_sound(record in record(), at: usize, byte: u8) {
            let mut plain = Vec::new();
            ZlibDecoder::new(&encode(&record)[..]).read_to_end(&mut plain).unwrap();
            let at = at % plain.len();
            plain[at] = byte;
            let mut damaged = ZlibEncoder::new(Vec::new(), Compression::fast());
            damaged.write_all(&plain).unwrap();
            if let Ok(read) = decode(record.input, &damaged.finish().unwrap(), 1 << 20) {
                prop_assert!(read.placed.iter().all(|placed| (placed.list as usize) < read.lists.len()));
            }
        }
    }

    #[test]
    fn origins_that_grow_beyond_the_limit_are_refused() {
        let triangles = vec![[0, 0]; 100_000];
        let source = Source { node: None, copy: 0, mesh: 0, primitive: 0 };
        let lists = vec![vec![Origins::Each { sources: vec![source], triangles }]];
        let bytes = encode(&Record { lists, ..Record::default() });
        assert!(bytes.len() < 1000);
        assert!(decode(GeometryHash::default(), &bytes, 1 << 20).is_ok());
        let refused = decode(GeometryHash::default(), &bytes, 99_999);
        assert_eq!(refused, Err("its origins are larger than those of any file of this size"));
        assert!(decode(GeometryHash::default(), &bytes[..bytes.len() / 2], 1 << 20).is_err());
    }
}
