//! Mode 0: elements of any kind, as differences of their bytes to those of the element before.
//!
//! Elements are coded in blocks; in each block the first bytes of all elements come first, then all second bytes, and so
//! on, in groups of 16 with one width of bits each.

use super::varint::Reader;
use super::{Fault, version};

const HEADER: u8 = 0xA0;
/// Most bytes and elements of a block.
const BLOCK_BYTES: usize = 8192;
const BLOCK: usize = 256;
/// Differences that share a width.
const GROUP: usize = 16;
/// Least bytes of the tail, by version.
const TAIL: [usize; 2] = [32, 24];

/// Widths of differences in bits, by the two bits in the header of a group.
const WIDTHS_0: [u32; 4] = [0, 2, 4, 8];
/// The same in version 1, by the control mode of the byte.
const WIDTHS_1: [[u32; 4]; 2] = [[0, 1, 2, 4], [1, 2, 4, 8]];

/// Differences of one byte of all elements of a block, padded to whole groups.
type Column = [u8; BLOCK];

/// How the four bytes of a channel follow from those of the element before.
#[derive(Clone, Copy)]
enum Channel {
    /// Differences of bytes.
    Bytes,
    /// Differences of two 16-bit integers.
    Shorts,
    /// Exclusive or of 32-bit integers, rotated to the right by so many bits.
    Xor(u32),
}

/// The parts of a stream.
struct Stream<'a> {
    version: u8,
    body: &'a [u8],
    /// The element before the first.
    first: &'a [u8],
    channels: Vec<Channel>,
}

/// Returns the elements of a stream: `count` of `stride` bytes each; `stride` is a multiple of 4 up to 256.
pub(super) fn decode(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Fault> {
    let parts = parts(stream, stride)?;
    let block = block_elements(stride);
    check_length(&parts, count, stride)?;
    let mut elements = vec![0; count * stride];
    let mut last: Vec<[u8; 4]> = parts.first.as_chunks().0.to_vec();
    let mut body = Reader::new(parts.body);
    for target in elements.chunks_mut(block * stride) {
        decode_block(&parts, &mut body, target, stride, &mut last)?;
    }
    body.finish()?;
    Ok(elements)
}

fn parts(stream: &[u8], stride: usize) -> Result<Stream<'_>, Fault> {
    let version = version(stream, HEADER)?;
    let channels = if version == 0 { 0 } else { stride / 4 };
    let tail = stride + channels;
    let body = stream[1..].len().checked_sub(tail.max(TAIL[usize::from(version)])).ok_or(Fault::Short)?;
    let (first, codes) = stream[stream.len() - tail..].split_at(stride);
    let channels = match version {
        0 => vec![Channel::Bytes; stride / 4],
        _ => codes.iter().map(|code| channel(*code)).collect::<Result<_, _>>()?,
    };
    Ok(Stream { version, body: &stream[1..=body], first, channels })
}

fn channel(code: u8) -> Result<Channel, Fault> {
    match (code & 15, code >> 4) {
        (0, 0) => Ok(Channel::Bytes),
        (1, 0) => Ok(Channel::Shorts),
        (2, bits) => Ok(Channel::Xor(bits.into())),
        _ => Err(Fault::Channel(code)),
    }
}

/// Returns the number of elements of all blocks but the last.
fn block_elements(stride: usize) -> usize {
    (BLOCK_BYTES / stride / GROUP * GROUP).min(BLOCK)
}

/// Refuses streams that are shorter than the headers of their blocks, before memory is allocated for the elements.
fn check_length(parts: &Stream<'_>, count: usize, stride: usize) -> Result<(), Fault> {
    let headers = |elements: usize| match parts.version {
        0 => stride * elements.div_ceil(GROUP).div_ceil(4),
        _ => stride / 4,
    };
    let block = block_elements(stride);
    let rest = count % block;
    let last = if rest == 0 { 0 } else { headers(rest) };
    let least = (count / block).checked_mul(headers(block)).and_then(|all| all.checked_add(last));
    if least.is_some_and(|least| least <= parts.body.len()) { Ok(()) } else { Err(Fault::Short) }
}

/// Decodes the elements of a block; `last` is the element before them, and then their last one.
fn decode_block(
    parts: &Stream<'_>,
    body: &mut Reader<'_>,
    target: &mut [u8],
    stride: usize,
    last: &mut [[u8; 4]],
) -> Result<(), Fault> {
    let count = target.len() / stride;
    let controls = if parts.version == 0 { &[] } else { body.bytes(stride / 4)? };
    let mut columns: [Column; 4] = [[0; BLOCK]; 4];
    for (i, (channel, last)) in parts.channels.iter().zip(last).enumerate() {
        let control = controls.get(i).copied();
        for (byte, column) in columns.iter_mut().enumerate() {
            read_column(body, control.map(|c| c >> (2 * byte) & 3), &mut column[..], count)?;
        }
        let slots = target.chunks_exact_mut(stride).filter_map(|element| element[4 * i..].first_chunk_mut());
        accumulate(*channel, &columns, slots, last);
    }
    Ok(())
}

/// Reads the differences of one byte of `count` elements; `control` is its control mode, if the version has them.
fn read_column(body: &mut Reader<'_>, control: Option<u8>, column: &mut [u8], count: usize) -> Result<(), Fault> {
    let widths = match control {
        None => &WIDTHS_0,
        Some(mode @ 0..=1) => &WIDTHS_1[usize::from(mode)],
        Some(2) => {
            column[..count].fill(0);
            return Ok(());
        }
        Some(_) => {
            column[..count].copy_from_slice(body.bytes(count)?);
            return Ok(());
        }
    };
    let groups = count.div_ceil(GROUP);
    let header = body.bytes(groups.div_ceil(4))?;
    for (i, group) in column.as_chunks_mut::<GROUP>().0[..groups].iter_mut().enumerate() {
        let width = widths[usize::from(header[i / 4] >> (2 * (i % 4)) & 3)];
        read_group(body, width, group)?;
    }
    Ok(())
}

fn read_group(body: &mut Reader<'_>, width: u32, group: &mut [u8; GROUP]) -> Result<(), Fault> {
    match width {
        0 => group.fill(0),
        8 => group.copy_from_slice(body.bytes(GROUP)?),
        1 => {
            let bits = body.bytes(2)?;
            (0..GROUP).for_each(|i| group[i] = bits[i / 8] >> (i % 8) & 1);
        }
        2 => {
            let bits = body.bytes(4)?;
            (0..GROUP).for_each(|i| group[i] = bits[i / 4] >> (6 - 2 * (i % 4)) & 3);
        }
        _ => {
            let bits = body.bytes(8)?;
            (0..GROUP).for_each(|i| group[i] = bits[i / 2] >> (4 - 4 * (i % 2)) & 15);
        }
    }
    if !matches!(width, 0 | 8) {
        // Whatever has all its bits set follows as a whole byte.
        let all_bits = (1 << width) - 1;
        for difference in group.iter_mut().filter(|difference| **difference == all_bits) {
            *difference = body.byte()?;
        }
    }
    Ok(())
}

/// Adds up the differences of a channel.
fn accumulate<'t>(
    channel: Channel,
    columns: &[Column; 4],
    slots: impl Iterator<Item = &'t mut [u8; 4]>,
    last: &mut [u8; 4],
) {
    let [a, b, c, d] = columns;
    let differences = (0..BLOCK).map(|i| [a[i], b[i], c[i], d[i]]);
    let slots = slots.zip(differences);
    match channel {
        Channel::Bytes => slots.for_each(|(slot, difference)| {
            (0..4).for_each(|i| last[i] = last[i].wrapping_add(unzigzag_8(difference[i])));
            *slot = *last;
        }),
        Channel::Shorts => slots.for_each(|(slot, [a, b, c, d])| {
            let add = |old: [u8; 2], difference: [u8; 2]| {
                u16::from_le_bytes(old).wrapping_add(unzigzag_16(u16::from_le_bytes(difference))).to_le_bytes()
            };
            let ([e, f], [g, h]) = (add([last[0], last[1]], [a, b]), add([last[2], last[3]], [c, d]));
            *last = [e, f, g, h];
            *slot = *last;
        }),
        Channel::Xor(bits) => slots.for_each(|(slot, difference)| {
            let change = u32::from_le_bytes(difference).rotate_right(bits);
            *last = (u32::from_le_bytes(*last) ^ change).to_le_bytes();
            *slot = *last;
        }),
    }
}

fn unzigzag_8(v: u8) -> u8 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

fn unzigzag_16(v: u16) -> u16 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

/// Returns the stream of elements of `stride` bytes, version 0.
pub(super) fn encode(elements: &[u8], stride: usize) -> Vec<u8> {
    let mut stream = vec![HEADER];
    let first = elements.get(..stride).map_or_else(|| vec![0; stride], <[u8]>::to_vec);
    let mut last = first.clone();
    for block in elements.chunks(block_elements(stride) * stride) {
        for (byte, last) in last.iter_mut().enumerate() {
            let mut column = [0; BLOCK];
            let values = block[byte..].iter().step_by(stride);
            for (difference, value) in column.iter_mut().zip(values) {
                *difference = zigzag_8(value.wrapping_sub(*last));
                *last = *value;
            }
            write_column(&mut stream, &column, block.len() / stride);
        }
    }
    stream.resize(stream.len() + TAIL[0].saturating_sub(stride), 0);
    stream.extend(first);
    stream
}

/// Writes the differences of one byte of `count` elements, each group in the width that takes the fewest bytes.
fn write_column(stream: &mut Vec<u8>, column: &Column, count: usize) {
    let groups = &column.as_chunks::<GROUP>().0[..count.div_ceil(GROUP)];
    let header = stream.len();
    stream.resize(header + groups.len().div_ceil(4), 0);
    for (i, group) in groups.iter().enumerate() {
        let mode = (0..4).min_by_key(|mode| group_bytes(group, WIDTHS_0[*mode])).unwrap_or(3);
        stream[header + i / 4] |= (mode as u8) << (2 * (i % 4));
        write_group(stream, group, WIDTHS_0[mode]);
    }
}

/// Returns the bytes that a group takes in a width; more than any other if it does not fit.
fn group_bytes(group: &[u8; GROUP], width: u32) -> usize {
    match width {
        0 if group.iter().all(|difference| *difference == 0) => 0,
        0 => usize::MAX,
        8 => GROUP,
        _ => 2 * width as usize + group.iter().filter(|difference| u32::from(**difference) >= (1 << width) - 1).count(),
    }
}

fn write_group(stream: &mut Vec<u8>, group: &[u8; GROUP], width: u32) {
    match width {
        0 => {}
        8 => stream.extend(group),
        _ => {
            let all_bits = (1 << width) - 1;
            for packed in group.chunks(8 / width as usize) {
                stream.push(packed.iter().fold(0, |bits, difference| bits << width | difference.min(&all_bits)));
            }
            stream.extend(group.iter().filter(|difference| **difference >= all_bits));
        }
    }
}

fn zigzag_8(v: u8) -> u8 {
    (v << 1) ^ (v >> 7).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshopt::testing::hex;

    fn words(words: &[u32]) -> Vec<u8> {
        words.iter().flat_map(|w| w.to_le_bytes()).collect()
    }

    /// Streams and elements of the reference decoder's tests.
    const POSITIONS: [u16; 24] =
        [0, 0, 0, 0, 0, 0, 300, 0, 0, 0, 500, 0, 0, 300, 0, 0, 0, 500, 300, 300, 0, 0, 500, 500];
    const POSITIONS_0: &str = "a0013f0000005857580126000000010c00000058010800000000000000013f0000001718170126000000010c000000170108 \
             0000000000000000000000000000000000000000000000000000000000000000000000";
    const POSITIONS_1: &str =
        "a1eeaaee004b4b4b00004b00007d7d7d00007d00000000000000000000000000000000000000000000620062";

    fn positions() -> Vec<u8> {
        POSITIONS.iter().flat_map(|x| x.to_le_bytes()).collect()
    }

    #[test]
    fn both_versions_of_positions_are_decoded() {
        assert_eq!(decode(&hex(POSITIONS_0), 4, 12), Ok(positions()));
        assert_eq!(decode(&hex(POSITIONS_1), 4, 12), Ok(positions()));
    }

    #[test]
    fn differences_of_16_bits_are_decoded() {
        let stream = hex(
            "a19999012aaaaaaa0204444444433333330206666666666666660208888888877777770000000000000000000000000000f8 \
             00f800f000f0000101",
        );
        let elements = decode(&stream, 16, 8).expect("sound");
        let [first, last] = [&elements[..8], &elements[120..]];
        assert_eq!(first, [248, 0, 248, 0, 240, 0, 240, 0]);
        assert_eq!(last, [7, 1, 250, 0, 29, 1, 244, 0]);
    }

    #[test]
    fn rotated_differences_of_32_bits_are_decoded() {
        let stream = hex(
            "a1ababfaff0002020200a5c23a00abf9570095428500ddca6d00ac1a50005c99fe004d0c3900000000000000007000000000 \
             80070c22263b8600001200",
        );
        let expected = [
            0,
            112,
            201_818_112,
            2_252_023_330,
            1,
            29,
            1_188_167_680,
            1_600_748_723,
            2,
            126,
            1_739_489_280,
            1_696_368_920,
            3,
            155,
            621_084_672,
            1_218_163_169,
        ];
        assert_eq!(decode(&stream, 4, 16), Ok(words(&expected)));
    }

    #[test]
    fn streams_of_another_length_are_refused() {
        for (stream, least) in [(hex(POSITIONS_0), 33), (hex(POSITIONS_1), 25)] {
            for end in 0..stream.len() {
                let fault = decode(&stream[..end], 4, 12).expect_err("cut off");
                assert!(end >= least || fault == Fault::Short, "{end}: {fault}");
            }
            let longer = [&stream[..stream.len() - 15], &[0; 16]].concat();
            assert!(decode(&longer, 4, 12).is_err());
            assert!(decode(&stream, 300, 12).is_err());
        }
    }

    #[test]
    fn nothing_is_allocated_for_elements_that_the_stream_cannot_hold() {
        for count in [1 << 40, usize::MAX] {
            assert_eq!(decode(&hex(POSITIONS_1), count, 12), Err(Fault::Short));
        }
    }

    #[test]
    fn unknown_channels_are_refused() {
        for code in [3, 0x10, 0x21, 0x13] {
            let mut stream = hex(POSITIONS_1);
            *stream.last_mut().expect("a byte") = code;
            assert_eq!(decode(&stream, 4, 12), Err(Fault::Channel(code)));
        }
    }

    #[test]
    fn no_elements_need_no_blocks() {
        let stream = [&[0xA0][..], &[0; 32]].concat();
        assert_eq!(decode(&stream, 0, 16), Ok(Vec::new()));
        assert_eq!(decode(&stream, 1, 16), Err(Fault::Short));
        assert_eq!(decode(&[&stream[..], &[0]].concat(), 0, 16), Err(Fault::Long(1)));
    }

    #[test]
    fn elements_are_decoded_as_they_were_encoded() {
        for stride in [4, 12, 16, 64, 256] {
            for count in [0, 1, 15, 16, 17, 255, 256, 257, 1000] {
                // Constant, slowly changing and random bytes.
                let byte = |i: usize| match i % 4 {
                    0 => 7,
                    1 => (i / stride) as u8,
                    2 => (i / stride / 3 % 5) as u8,
                    _ => (i.wrapping_mul(0x9E37_79B9) >> 13) as u8,
                };
                let elements: Vec<u8> = (0..count * stride).map(byte).collect();
                assert_eq!(decode(&encode(&elements, stride), count, stride), Ok(elements), "{count} of {stride}");
            }
        }
    }

    #[test]
    fn streams_are_those_of_the_reference_encoder() {
        assert_eq!(encode(&positions(), 12), hex(POSITIONS_0));
    }
}
