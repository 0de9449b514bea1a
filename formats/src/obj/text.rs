//! Text of OBJ and MTL files: encodings, lines, words.

use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;
use std::str::Split;
use std::string::FromUtf8Error;

use encoding_rs::Encoding;
use rayon::prelude::*;

use super::encoding;
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

/// Returns the statements of a text, in order. A backslash at the end of a line continues a statement that consists of
/// numbers; comments and names end in Windows paths more often than in continuations.
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
            if self.rest.clone().next().is_none_or(begins_statement) {
                break;
            }
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
            let continues = raw.ends_with('\\') && has_numbers(cut(raw).0);
            let text = if continues { Cow::Owned(self.continued(raw)) } else { Cow::Borrowed(raw) };
            return Some(Line { number, range: start..self.offset, text });
        }
    }
}

/// Whether a statement of this keyword consists of numbers.
fn has_numbers(key: &str) -> bool {
    const KEYS: [&str; 25] = [
        "v", "vt", "vn", "vp", "f", "fo", "l", "p", "curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp",
        "con", "bmat", "deg", "step", "ka", "kd", "ks", "ke", "tf",
    ];
    let key = key.trim_end_matches('\\');
    KEYS.iter().any(|known| known.eq_ignore_ascii_case(key))
}

/// Whether a line begins a statement: if so it does not continue the one before, whatever that ends in.
fn begins_statement(line: &str) -> bool {
    let key = cut(line.trim()).0;
    let names = ["o", "g", "s", "usemtl", "mtllib", "newmtl", "end"];
    has_numbers(key) || names.iter().any(|known| known.eq_ignore_ascii_case(key))
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

/// Returns the end of the last line that certainly ends a statement, in any encoding that includes ASCII: one whose
/// last character is printable ASCII other than a backslash.
fn end_of_statement(bytes: &[u8]) -> Option<usize> {
    let mut end = bytes.len();
    loop {
        let ends_line = |at: usize| match bytes[at] {
            b'\n' => true,
            b'\r' => bytes.get(at + 1).is_some_and(|&next| next != b'\n'),
            _ => false,
        };
        end = (0..end).rposition(ends_line)?;
        let before = bytes[..end].trim_ascii_end();
        let last = *before.last()?;
        if last.is_ascii_graphic() && last != b'\\' {
            return Some(end + 1);
        }
        end = before.len();
    }
}

/// Decodes the blocks of a file: UTF-8, UTF-16, or else the code page that `code_page` decides. Afterwards every line
/// ends in a line feed.
pub(super) fn decode(
    blocks: Vec<Vec<u8>>,
    code_page: impl FnOnce(&[Vec<u8>]) -> &'static Encoding,
    notes: &mut Notes,
) -> Vec<String> {
    let mut blocks = encoding::without_mark(blocks);
    blocks.par_iter_mut().for_each(|block| end_lines(block));
    let texts: Vec<_> = blocks.into_par_iter().map(String::from_utf8).collect();
    if texts.iter().all(Result::is_ok) {
        return texts.into_iter().flatten().collect();
    }
    let bytes = texts.into_iter().map(|text| text.map_or_else(FromUtf8Error::into_bytes, String::into_bytes));
    let blocks: Vec<Vec<u8>> = bytes.collect();
    let encoding = code_page(&blocks);
    notes.add(String::new, &format!("text that is not UTF-8 is read as {}", encoding.name()));
    encoding::decoded(&blocks, encoding)
}

/// Replaces carriage returns that end a line by themselves with line feeds.
fn end_lines(text: &mut [u8]) {
    let mut at = 0;
    while let Some(next) = text[at..].iter().position(|&byte| byte == b'\r') {
        at += next + 1;
        if text.get(at) != Some(&b'\n') {
            text[at - 1] = b'\n';
        }
    }
}
