//! Mode 2: indices as differences to one of two that came before.

use super::varint::{Reader, difference, push_number, zigzag};
use super::{Fault, version};

const HEADER: u8 = 0xD0;
/// Zeros after the last index.
const TAIL: usize = 4;

/// Returns the `count` indices of a stream.
pub(super) fn decode(stream: &[u8], count: usize) -> Result<Vec<u32>, Fault> {
    version(stream, HEADER)?;
    let body = stream[1..].len().checked_sub(TAIL).map(|end| &stream[1..=end]);
    // Each index takes a byte or more.
    let body = body.filter(|body| body.len() >= count).ok_or(Fault::Short)?;
    let mut reader = Reader::new(body);
    let mut last = [0_u32; 2];
    let mut indices = Vec::with_capacity(count);
    for _ in 0..count {
        let number = reader.number()?;
        let baseline = &mut last[number as usize & 1];
        *baseline = baseline.wrapping_add(difference(number >> 1));
        indices.push(*baseline);
    }
    reader.finish()?;
    Ok(indices)
}

/// Returns the stream of indices.
pub(super) fn encode(indices: &[u32]) -> Vec<u8> {
    /// Differences from here on take two bytes: two bits of a number are sign and baseline.
    const FAR: u32 = 30;
    let mut stream = vec![HEADER | 1];
    let mut last = [0_u32; 2];
    let mut current = 0;
    for &index in indices {
        let distance = index.wrapping_sub(last[current]).cast_signed().unsigned_abs();
        current ^= usize::from(distance >= FAR);
        let number = zigzag(index.wrapping_sub(last[current]));
        push_number(&mut stream, number << 1 | current as u32);
        last[current] = index;
    }
    stream.extend([0; TAIL]);
    stream
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stream of the reference encoder's tests.
    const STREAM: [u8; 12] = [0xD1, 0x00, 0x04, 0xCD, 0x01, 0x04, 0x07, 0x98, 0x1F, 0x00, 0x00, 0x00];

    #[test]
    fn indices_of_the_reference_encoder_are_decoded() {
        let stream = [&STREAM[..], &[0]].concat();
        assert_eq!(decode(&stream, 6), Ok(vec![0, 1, 51, 2, 49, 1000]));
    }

    #[test]
    fn streams_of_another_length_are_refused() {
        let stream = [&STREAM[..], &[0]].concat();
        assert_eq!(decode(&stream, 5), Err(Fault::Long(2)));
        assert_eq!(decode(&stream, 7), Err(Fault::Short));
        assert_eq!(decode(&stream, 9), Err(Fault::Short));
        assert_eq!(decode(&stream, usize::MAX), Err(Fault::Short));
        assert_eq!(decode(&[0xD1], 0), Err(Fault::Short));
        assert_eq!(decode(&[], 0), Err(Fault::Short));
        assert_eq!(decode(&[0xE1, 0, 0, 0, 0], 0), Err(Fault::Header(0xE1)));
    }

    #[test]
    fn indices_are_decoded_as_they_were_encoded() {
        for indices in [vec![], vec![7], vec![0, 1, 51, 2, 49, 1000], vec![0, 1 << 29, 3, (1 << 29) + 5, 0]] {
            assert_eq!(decode(&encode(&indices), indices.len()), Ok(indices));
        }
    }

    #[test]
    fn streams_are_those_of_the_reference_encoder() {
        assert_eq!(encode(&[0, 1, 51, 2, 49, 1000]), [&STREAM[..], &[0]].concat());
    }
}
