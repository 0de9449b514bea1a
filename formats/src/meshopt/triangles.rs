//! Mode 1: triangles, each by an edge and a vertex that were met recently where it can.
//!
//! Based, as the reference implementation is, on F. Giesen, "Simple lossless index buffer compression & follow-up" (2013)
//! and C. Stokes, "Vertex cache optimised index buffer compression" (2014).

use super::varint::{Reader, difference, push_number, zigzag};
use super::{Fault, version};

const HEADER: u8 = 0xE0;
/// Entries of the table at the end.
const TABLE: usize = 16;

/// The last 16 values; those that were never pushed are [`u32::MAX`], an index that no accessor may hold.
struct Recent<T> {
    values: [T; 16],
    next: usize,
}

impl<T: Copy> Recent<T> {
    fn new(none: T) -> Self {
        Recent { values: [none; 16], next: 0 }
    }

    /// Returns a value by its age; 0 is the last one pushed.
    #[inline]
    fn get(&self, age: u8) -> T {
        self.values[self.next.wrapping_sub(1 + usize::from(age)) & 15]
    }

    #[inline]
    fn push(&mut self, value: T) {
        self.values[self.next] = value;
        self.next = (self.next + 1) & 15;
    }
}

/// The state of a decoder between triangles.
struct Decoder<'a> {
    data: Reader<'a>,
    /// The index that comes next if vertices come in order.
    next: u32,
    /// The last index that was given by number.
    last: u32,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
    /// From which code on a third vertex is not a recent one: 15 in version 0, 13 in version 1.
    first_free: u8,
}

/// Returns the `count` triangles of a stream.
pub(super) fn decode(stream: &[u8], count: usize) -> Result<Vec<[u32; 3]>, Fault> {
    let first_free = if version(stream, HEADER)? == 0 { 15 } else { 13 };
    // Each triangle takes a byte or more.
    let (codes, rest) = stream[1..].split_at_checked(count).ok_or(Fault::Short)?;
    let (data, table) = rest.split_last_chunk::<TABLE>().ok_or(Fault::Short)?;
    if let Some(byte) = table.iter().find(|byte| **byte >> 4 == 15 || **byte & 15 == 15) {
        return Err(Fault::Table(*byte));
    }
    let mut decoder = Decoder {
        data: Reader::new(data),
        next: 0,
        last: 0,
        edges: Recent::new([u32::MAX; 2]),
        vertices: Recent::new(u32::MAX),
        first_free,
    };
    let mut triangles = Vec::with_capacity(count);
    for &code in codes {
        triangles.push(match code {
            0xF0..=0xFD => decoder.corners(0, table[usize::from(code & 15)])?,
            0xFE | 0xFF => decoder.corners_in_full(code)?,
            _ => decoder.beside_edge(code)?,
        });
    }
    decoder.data.finish()?;
    Ok(triangles)
}

impl Decoder<'_> {
    /// A triangle beside a recent edge.
    #[inline]
    fn beside_edge(&mut self, code: u8) -> Result<[u32; 3], Fault> {
        let [a, b] = self.edges.get(code >> 4);
        let c = match code & 15 {
            0 => self.in_order(),
            recent if recent < self.first_free => self.vertices.get(recent),
            13 => self.given(self.last.wrapping_sub(1)),
            14 => self.given(self.last.wrapping_add(1)),
            _ => self.by_difference()?,
        };
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok([a, b, c])
    }

    /// A triangle whose code is followed by a byte for its second and third corner.
    fn corners_in_full(&mut self, code: u8) -> Result<[u32; 3], Fault> {
        let others = self.data.byte()?;
        if others == 0 {
            self.next = 0;
        }
        self.corners(if code == 0xFE { 0 } else { 15 }, others)
    }

    /// A triangle of three corners by their codes. Corners in order come first, then those by difference; the recent ones
    /// are as they were before this triangle.
    #[inline]
    fn corners(&mut self, first: u8, others: u8) -> Result<[u32; 3], Fault> {
        let codes = [first, others >> 4, others & 15];
        let mut corners = [0; 3];
        for (corner, code) in corners.iter_mut().zip(codes) {
            *corner = match code {
                0 => {
                    let vertex = self.next;
                    self.next = vertex.wrapping_add(1);
                    vertex
                }
                // Filled in below.
                15 => 0,
                recent => self.vertices.get(recent - 1),
            };
        }
        for (corner, _) in corners.iter_mut().zip(codes).filter(|(_, code)| *code == 15) {
            self.last = self.last.wrapping_add(difference(self.data.number()?));
            *corner = self.last;
        }
        for (&corner, _) in corners.iter().zip(codes).filter(|(_, code)| [0, 15].contains(code)) {
            self.vertices.push(corner);
        }
        let [a, b, c] = corners;
        [[b, a], [c, b], [a, c]].into_iter().for_each(|edge| self.edges.push(edge));
        Ok(corners)
    }

    /// The vertex after the highest so far.
    #[inline]
    fn in_order(&mut self) -> u32 {
        let vertex = self.next;
        self.next = vertex.wrapping_add(1);
        self.vertices.push(vertex);
        vertex
    }

    fn by_difference(&mut self) -> Result<u32, Fault> {
        let number = self.data.number()?;
        Ok(self.given(self.last.wrapping_add(difference(number))))
    }

    fn given(&mut self, vertex: u32) -> u32 {
        self.last = vertex;
        self.vertices.push(vertex);
        vertex
    }
}

/// Codes of the second and third corner that are frequent in usual meshes, as the reference encoder has them.
const FREQUENT: [u8; TABLE] =
    [0x00, 0x76, 0x87, 0x56, 0x67, 0x78, 0xA9, 0x86, 0x65, 0x89, 0x68, 0x98, 0x01, 0x69, 0, 0];

/// The state of an encoder between triangles.
struct Encoder {
    codes: Vec<u8>,
    data: Vec<u8>,
    next: u32,
    last: u32,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
}

/// Returns the stream of triangles, version 1. The decoded ones may begin at another of their corners.
pub(super) fn encode(triangles: &[[u32; 3]]) -> Vec<u8> {
    let mut encoder = Encoder {
        codes: Vec::with_capacity(triangles.len()),
        data: Vec::new(),
        next: 0,
        last: 0,
        edges: Recent::new([u32::MAX; 2]),
        vertices: Recent::new(u32::MAX),
    };
    for triangle in triangles {
        match encoder.shared_edge(*triangle) {
            Some((age, corners)) => encoder.beside_edge(age, corners),
            None => encoder.corners(*triangle),
        }
    }
    [&[HEADER | 1][..], &encoder.codes, &encoder.data, &FREQUENT].concat()
}

impl Encoder {
    /// Returns the age of the youngest edge of the last 15 that is one of the triangle's, and the corners from it on.
    fn shared_edge(&self, [a, b, c]: [u32; 3]) -> Option<(u8, [u32; 3])> {
        let turned = [[a, b, c], [b, c, a], [c, a, b]];
        (0..15).find_map(|age| {
            let edge = self.edges.get(age);
            let corners = turned.into_iter().find(|corners| corners[..2] == edge)?;
            Some((age, corners))
        })
    }

    fn beside_edge(&mut self, edge: u8, [a, b, c]: [u32; 3]) {
        let recent = (1..13).find(|age| self.vertices.get(*age) == c);
        let code = match recent {
            Some(age) => age,
            None if c == self.next => {
                self.next = self.next.wrapping_add(1);
                0
            }
            None if c.wrapping_add(1) == self.last => 13,
            None if c == self.last.wrapping_add(1) => 14,
            None => 15,
        };
        self.codes.push(edge << 4 | code);
        if code == 15 {
            push_number(&mut self.data, zigzag(c.wrapping_sub(self.last)));
        }
        if code >= 13 {
            self.last = c;
        }
        if recent.is_none() {
            self.vertices.push(c);
        }
        self.edges.push([c, b]);
        self.edges.push([a, c]);
    }

    /// Codes a triangle by its three corners, beginning at the one that comes next in order, if there is one.
    fn corners(&mut self, [a, b, c]: [u32; 3]) {
        let [a, b, c] = if b == self.next {
            [b, c, a]
        } else if c == self.next {
            [c, a, b]
        } else {
            [a, b, c]
        };
        let is_restart = [a, b, c] == [0, 1, 2] && self.next > 0;
        if is_restart {
            self.next = 0;
            self.vertices = Recent::new(u32::MAX);
        }
        let first = if self.is_next(a) { 0 } else { 15 };
        let others = [b, c].map(|corner| (0..14).find(|age| self.vertices.get(*age) == corner));
        let [second, third] = [(b, others[0]), (c, others[1])].map(|(corner, recent)| match recent {
            Some(age) => age + 1,
            None if self.is_next(corner) => 0,
            None => 15,
        });
        let others = second << 4 | third;
        let frequent = FREQUENT[..14].iter().position(|code| *code == others);
        match frequent.filter(|_| first == 0 && !is_restart) {
            Some(position) => self.codes.push(0xF0 | position as u8),
            None => {
                self.codes.push(0xFE | first & 1);
                self.data.push(others);
            }
        }
        for (corner, code) in [(a, first), (b, second), (c, third)] {
            if code == 15 {
                push_number(&mut self.data, zigzag(corner.wrapping_sub(self.last)));
                self.last = corner;
            }
            if code == 0 || code == 15 {
                self.vertices.push(corner);
            }
        }
        [[b, a], [c, b], [a, c]].into_iter().for_each(|edge| self.edges.push(edge));
    }

    /// Whether a vertex is the next in order; if so, the one after it is next.
    fn is_next(&mut self, vertex: u32) -> bool {
        let is_next = vertex == self.next;
        self.next = self.next.wrapping_add(u32::from(is_next));
        is_next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Streams of the reference encoder's tests: version 0 and version 1.
    const STREAM_0: [u8; 27] = [
        0xE0, 0xF0, 0x10, 0xFE, 0xFF, 0xF0, 0x0C, 0xFF, 0x02, 0x02, 0x02, 0x00, 0x76, 0x87, 0x56, 0x67, 0x78, 0xA9,
        0x86, 0x65, 0x89, 0x68, 0x98, 0x01, 0x69, 0x00, 0x00,
    ];
    const STREAM_1: [u8; 24] = [
        0xE1, 0xF0, 0x10, 0xFE, 0x1F, 0x3D, 0x00, 0x0A, 0x00, 0x76, 0x87, 0x56, 0x67, 0x78, 0xA9, 0x86, 0x65, 0x89,
        0x68, 0x98, 0x01, 0x69, 0x00, 0x00,
    ];

    #[test]
    fn triangles_of_version_0_are_decoded() {
        let expected = vec![[0, 1, 2], [2, 1, 3], [4, 6, 5], [7, 8, 9]];
        assert_eq!(decode(&STREAM_0, 4), Ok(expected));
    }

    #[test]
    fn triangles_of_version_1_are_decoded() {
        let expected = vec![[0, 1, 2], [2, 1, 3], [0, 1, 2], [2, 1, 5], [2, 1, 4]];
        assert_eq!(decode(&STREAM_1, 5), Ok(expected));
    }

    #[test]
    fn streams_of_another_length_are_refused() {
        for end in 0..STREAM_1.len() {
            assert!(decode(&STREAM_1[..end], 5).is_err(), "{end}");
        }
        assert_eq!(decode(&[&STREAM_1[..], &[0]].concat(), 5), Err(Fault::Long(1)));
        assert_eq!(decode(&STREAM_1, usize::MAX), Err(Fault::Short));
        assert_eq!(decode(&[], 0), Err(Fault::Short));
        assert_eq!(decode(&[0xD1; 20], 0), Err(Fault::Header(0xD1)));
    }

    #[test]
    fn tables_of_corners_by_difference_are_refused() {
        let mut stream = STREAM_1;
        stream[20] = 0x1F;
        assert_eq!(decode(&stream, 5), Err(Fault::Table(0x1F)));
    }

    /// Triangles that begin at their least corner.
    fn from_least(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
        let turned = |[a, b, c]: &[u32; 3]| [[*a, *b, *c], [*b, *c, *a], [*c, *a, *b]];
        triangles.iter().map(|t| *turned(t).iter().min().expect("three")).collect()
    }

    #[test]
    fn triangles_are_decoded_as_they_were_encoded_but_for_their_first_corner() {
        let strip: Vec<[u32; 3]> = (0..40).map(|i| [i, i + 1, i + 2]).collect();
        let scattered: Vec<[u32; 3]> =
            (0..90_u32).map(|i| [i * 7919 % 83, i * 104_729 % 89 + 83, i % 5 + 200]).collect();
        let again = [&strip[..], &scattered, &[[0, 1, 2], [0, 1, 2], [2, 1, 0], [5, 5, 5]], &strip].concat();
        for triangles in [strip, scattered, again, vec![]] {
            let decoded = decode(&encode(&triangles), triangles.len()).expect("sound");
            assert_eq!(from_least(&decoded), from_least(&triangles));
            assert_eq!(encode(&decoded).len(), encode(&triangles).len());
        }
    }

    #[test]
    fn streams_are_those_of_the_reference_encoder() {
        let triangles = [[0, 1, 2], [2, 1, 3], [0, 1, 2], [2, 1, 5], [2, 1, 4]];
        assert_eq!(encode(&triangles), STREAM_1);
    }
}
