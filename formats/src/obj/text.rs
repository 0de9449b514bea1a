//! Text of OBJ and MTL files: encodings, lines, words.

use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;
use std::str::Split;
use std::string::FromUtf8Error;

use rayon::prelude::*;

use super::notes::Notes;

/// One statement: a trimmed line that is neither empty nor a comment, with continuations joined.
#[derive(Debug)]
pub(super) struct Line<'a> {
    /// Number of its first line, from 1.
    pub(super) number: usize,
    /// Its range in the text, including line ends.
    pub(super) range: Range<usize>,
    text: Cow<'a, str>,
}

impl<'a> Line<'a> {
    /// Returns the keyword and the rest of the line, trimmed.
    pub(super) fn text(&self) -> (&str, &str) {
        cut(&self.text)
    }

    /// Whether it appears verbatim in the text, not continued over several lines.
    pub(super) fn is_verbatim(&self) -> bool {
        matches!(self.text, Cow::Borrowed(_))
    }
}

fn cut(text: &str) -> (&str, &str) {
    let (key, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (key, rest.trim_start())
}

/// Returns the statements of a text, in order. A backslash at the end of a line continues it, except in a comment,
/// because comments end in Windows paths more often than in continuations.
pub(super) fn lines(text: &str) -> Lines<'_> {
    Lines { rest: text.split('\n'), number: 0, offset: 0 }
}

/// See [`lines`].
pub(super) struct Lines<'a> {
    rest: Split<'a, char>,
    number: usize,
    /// Start of the next line.
    offset: usize,
}

impl<'a> Lines<'a> {
    fn raw(&mut self) -> Option<&'a str> {
        let raw = self.rest.next()?;
        self.number += 1;
        self.offset += raw.len() + 1;
        Some(raw.trim())
    }

    fn continued(&mut self, first: &str) -> String {
        let mut joined = first.to_owned();
        while joined.ends_with('\\') {
            joined.pop();
            let Some(next) = self.raw() else { break };
            joined.push(' ');
            joined.push_str(next);
        }
        joined.truncate(joined.trim_end().len());
        joined
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        loop {
            let start = self.offset;
            let raw = self.raw()?;
            let number = self.number;
            if raw.is_empty() || raw.starts_with('#') {
                continue;
            }
            let text = if raw.ends_with('\\') { Cow::Owned(self.continued(raw)) } else { Cow::Borrowed(raw) };
            return Some(Line { number, range: start..self.offset, text });
        }
    }
}

/// Returns the place of a line for errors and warnings.
pub(super) fn place(line: usize) -> String {
    format!("line {line}")
}

/// Returns the words of a statement of numbers, without a trailing comment.
pub(super) fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split_whitespace().take_while(|word| !word.starts_with('#'))
}

/// Size of a block of a file in bytes; lines without end make larger blocks.
const BLOCK: usize = 1 << 20;

/// Reads a file in blocks of whole statements, which can be processed in parallel and freed one by one.
pub(super) fn read_blocks(mut file: impl Read) -> std::io::Result<Vec<Vec<u8>>> {
    let (mut blocks, mut block) = (Vec::new(), Vec::new());
    loop {
        let more = BLOCK.max(block.len());
        block.reserve_exact(more);
        if (&mut file).take(more as u64).read_to_end(&mut block)? == 0 {
            break;
        }
        if let Some(end) = end_of_statement(&block) {
            let rest = block.split_off(end);
            blocks.push(std::mem::replace(&mut block, rest));
        }
    }
    if !block.is_empty() {
        blocks.push(block);
    }
    Ok(blocks)
}

/// Returns the last line feed that certainly ends a statement, in any encoding that includes ASCII: one preceded by a
/// printable ASCII character other than a backslash.
fn end_of_statement(bytes: &[u8]) -> Option<usize> {
    let mut end = bytes.len();
    loop {
        end = bytes[..end].iter().rposition(|&byte| byte == b'\n')?;
        let before = bytes[..end].trim_ascii_end();
        let last = *before.last()?;
        if last.is_ascii_graphic() && last != b'\\' {
            return Some(end + 1);
        }
        end = before.len();
    }
}

/// Decodes the blocks of a file: UTF-8, UTF-16 if there is a byte order mark, otherwise Latin-1. If carriage returns
/// are the only line ends, they are replaced by line feeds.
pub(super) fn decode(mut blocks: Vec<Vec<u8>>, notes: &mut Notes) -> Vec<String> {
    let mut texts = match blocks.first().map(Vec::as_slice) {
        Some([0xFE, 0xFF, ..]) => vec![utf16(&blocks.concat()[2..], u16::from_be_bytes)],
        Some([0xFF, 0xFE, ..]) => vec![utf16(&blocks.concat()[2..], u16::from_le_bytes)],
        Some([0xEF, 0xBB, 0xBF, ..]) => {
            blocks[0].drain(..3);
            utf8(blocks, notes)
        }
        _ => utf8(blocks, notes),
    };
    if let [text] = texts.as_mut_slice()
        && text.contains('\r')
        && !text.contains('\n')
    {
        *text = text.replace('\r', "\n");
    }
    texts
}

fn utf8(blocks: Vec<Vec<u8>>, notes: &mut Notes) -> Vec<String> {
    let texts: Vec<_> = blocks.into_par_iter().map(String::from_utf8).collect();
    if texts.iter().all(Result::is_ok) {
        return texts.into_iter().flatten().collect();
    }
    notes.add(String::new, "text that is not UTF-8 is read as Latin-1");
    let bytes = texts.into_iter().map(|text| text.map_or_else(FromUtf8Error::into_bytes, String::into_bytes));
    bytes.map(|bytes| bytes.into_iter().map(char::from).collect()).collect()
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}
