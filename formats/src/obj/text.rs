//! The text of OBJ and MTL files: encodings, lines, words.

use std::borrow::Cow;
use std::str::Split;

use super::notes::Notes;

/// One statement: a trimmed line that is neither empty nor a comment, continuations joined.
#[derive(Debug)]
pub(super) struct Line<'a> {
    /// Number of its first line, from 1.
    pub(super) number: usize,
    text: Cow<'a, str>,
}

impl<'a> Line<'a> {
    /// The keyword and the rest of the line, trimmed.
    pub(super) fn text(&self) -> (&str, &str) {
        cut(&self.text)
    }

    /// As [`Line::text`], for a rest that outlives the line.
    pub(super) fn into_text(self) -> (Cow<'a, str>, Cow<'a, str>) {
        match self.text {
            Cow::Borrowed(text) => {
                let (key, rest) = cut(text);
                (Cow::Borrowed(key), Cow::Borrowed(rest))
            }
            Cow::Owned(text) => {
                let (key, rest) = cut(&text);
                (Cow::Owned(key.to_owned()), Cow::Owned(rest.to_owned()))
            }
        }
    }
}

fn cut(text: &str) -> (&str, &str) {
    let (key, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (key, rest.trim_start())
}

/// The statements of a text, in order. A backslash at the end of a line continues it, but not that of a comment:
/// comments hold Windows paths more often than continuations.
pub(super) fn lines(text: &str) -> Lines<'_> {
    Lines { rest: text.split('\n'), number: 0 }
}

/// See [`lines`].
pub(super) struct Lines<'a> {
    rest: Split<'a, char>,
    number: usize,
}

impl<'a> Lines<'a> {
    fn raw(&mut self) -> Option<&'a str> {
        self.number += 1;
        self.rest.next().map(str::trim)
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
            let raw = self.raw()?;
            let number = self.number;
            if raw.is_empty() || raw.starts_with('#') {
                continue;
            }
            let text = if raw.ends_with('\\') { Cow::Owned(self.continued(raw)) } else { Cow::Borrowed(raw) };
            return Some(Line { number, text });
        }
    }
}

/// How a line is named in errors and warnings.
pub(super) fn place(line: usize) -> String {
    format!("line {line}")
}

/// The words of a statement of numbers, without a comment behind them.
pub(super) fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split_whitespace().take_while(|word| !word.starts_with('#'))
}

/// The bytes of a file as text: UTF-8, UTF-16 where a byte order mark says so, else Latin-1. A file whose only line
/// ends are carriage returns gets line feeds.
pub(super) fn decode(bytes: Vec<u8>, notes: &mut Notes) -> String {
    let text = match bytes.as_slice() {
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xEF, 0xBB, 0xBF, rest @ ..] => utf8(rest.to_vec(), notes),
        _ => utf8(bytes, notes),
    };
    if text.contains('\r') && !text.contains('\n') { text.replace('\r', "\n") } else { text }
}

fn utf8(bytes: Vec<u8>, notes: &mut Notes) -> String {
    String::from_utf8(bytes).unwrap_or_else(|error| {
        notes.add(String::new, "text that is not UTF-8 is read as Latin-1");
        error.as_bytes().iter().map(|&byte| char::from(byte)).collect()
    })
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}
