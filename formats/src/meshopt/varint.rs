//! Numbers of one to five bytes, seven bits each, the lowest first (LEB128).

use super::Fault;

/// Reads bytes and numbers one after the other.
pub(super) struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Reader { rest: bytes }
    }

    /// Returns the next bytes.
    #[inline]
    pub(super) fn bytes(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        let (bytes, rest) = self.rest.split_at_checked(count).ok_or(Fault::Short)?;
        self.rest = rest;
        Ok(bytes)
    }

    #[inline]
    pub(super) fn byte(&mut self) -> Result<u8, Fault> {
        let (byte, rest) = self.rest.split_first().ok_or(Fault::Short)?;
        self.rest = rest;
        Ok(*byte)
    }

    /// Returns the next number; bits beyond 32 are ignored.
    #[inline]
    pub(super) fn number(&mut self) -> Result<u32, Fault> {
        let mut number = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err(Fault::Number)
    }

    /// Fails if bytes are left.
    pub(super) fn finish(self) -> Result<(), Fault> {
        if self.rest.is_empty() { Ok(()) } else { Err(Fault::Long(self.rest.len())) }
    }
}

/// Returns the signed difference that an unsigned number stands for, modulo 2^32.
#[inline]
pub(super) fn difference(zigzag: u32) -> u32 {
    (zigzag >> 1) ^ (zigzag & 1).wrapping_neg()
}

/// Appends a number.
pub(super) fn push_number(bytes: &mut Vec<u8>, mut number: u32) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Returns the unsigned number that stands for a signed difference, see [`difference`].
pub(super) fn zigzag(difference: u32) -> u32 {
    (difference << 1) ^ (difference >> 31).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_their_lowest_bits_first() {
        let mut reader = Reader::new(&[0x7F, 0x81, 0x04, 0xFF, 0xA0, 0x05, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F]);
        assert_eq!([(); 4].map(|()| reader.number()), [Ok(0x7F), Ok(0x201), Ok(0x1_507F), Ok(u32::MAX)]);
        assert_eq!(reader.finish(), Ok(()));
    }

    #[test]
    fn numbers_that_do_not_end_are_refused() {
        assert_eq!(Reader::new(&[0x80; 9]).number(), Err(Fault::Number));
        assert_eq!(Reader::new(&[0x80; 4]).number(), Err(Fault::Short));
    }

    #[test]
    fn numbers_and_differences_are_read_as_they_were_written() {
        for number in [0, 1, 0x7F, 0x80, 0x3FFF, 0x4000, 1 << 28, u32::MAX - 1, u32::MAX] {
            let mut bytes = Vec::new();
            push_number(&mut bytes, number);
            assert_eq!(Reader::new(&bytes).number(), Ok(number));
            assert_eq!(difference(zigzag(number)), number);
        }
    }

    #[test]
    fn odd_numbers_are_negative() {
        assert_eq!([0, 1, 2, 3, u32::MAX].map(|n| difference(n) as i32), [0, -1, 1, -2, i32::MIN]);
    }
}
