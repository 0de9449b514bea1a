//! Character encodings of OBJ and MTL files, which say nothing of theirs.
//!
//! The files of one scene share an encoding. UTF-16 is told by its mark or by its zero bytes, UTF-8 by being valid.
//! Anything else was written in the code page of some system: the one that spells names of files that exist, or else
//! the one that the letters resemble (`chardetng`).

use std::path::Path;

use chardetng::{EncodingDetector, Iso2022JpDetection, Utf8Detection};
use encoding_rs::{
    BIG5, EUC_JP, EUC_KR, Encoding, GBK, IBM866, ISO_8859_2, KOI8_R, SHIFT_JIS, UTF_16BE, UTF_16LE, WINDOWS_1250,
    WINDOWS_1251, WINDOWS_1252, WINDOWS_1253, WINDOWS_1254,
};
use rayon::prelude::*;

use super::files::Files;
use super::texture::Statement;

/// Code pages that are tried on names of files, in this order.
pub(super) const CODE_PAGES: [&Encoding; 14] = [
    GBK,
    SHIFT_JIS,
    BIG5,
    EUC_KR,
    EUC_JP,
    WINDOWS_1251,
    IBM866,
    KOI8_R,
    WINDOWS_1252,
    WINDOWS_1250,
    ISO_8859_2,
    WINDOWS_1253,
    WINDOWS_1254,
    encoding_rs::MACINTOSH,
];

/// Number of bytes that decide whether a text without a mark is UTF-16.
const SAMPLE: usize = 4096;

/// Returns the blocks of a text in UTF-8 or in a code page: without a byte order mark, UTF-16 converted.
pub(super) fn without_mark(mut blocks: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
    let Some(first) = blocks.first_mut() else { return blocks };
    let (utf16, mark) = match first.as_slice() {
        [0xFE, 0xFF, ..] => (UTF_16BE, 2),
        [0xFF, 0xFE, ..] => (UTF_16LE, 2),
        [0xEF, 0xBB, 0xBF, ..] => {
            first.drain(..3);
            return blocks;
        }
        text => match utf16_by_zeros(text) {
            Some(encoding) => (encoding, 0),
            None => return blocks,
        },
    };
    let text = utf16.decode_without_bom_handling(&blocks.concat()[mark..]).0.into_owned();
    vec![text.into_bytes()]
}

/// Whether every other byte of the start is zero, as in UTF-16 of ASCII characters.
fn utf16_by_zeros(text: &[u8]) -> Option<&'static Encoding> {
    let sample = &text[..text.len().min(SAMPLE)];
    let zeros = |odd: usize| sample.iter().skip(odd).step_by(2).filter(|&&byte| byte == 0).count();
    let (even, odd, pairs) = (zeros(0), zeros(1), sample.len() / 2);
    match pairs {
        0..=3 => None,
        _ if odd * 4 >= pairs * 3 && even * 8 <= pairs => Some(UTF_16LE),
        _ if even * 4 >= pairs * 3 && odd * 8 <= pairs => Some(UTF_16BE),
        _ => None,
    }
}

/// Returns the text in a code page; characters that it lacks become replacement characters.
pub(super) fn decoded(blocks: &[Vec<u8>], encoding: &'static Encoding) -> Vec<String> {
    blocks.par_iter().map(|block| encoding.decode_without_bom_handling(block).0.into_owned()).collect()
}

/// Decides the encoding of a scene whose OBJ text is not UTF-8, from this text and the libraries that it names in ASCII.
pub(super) fn of_scene(texts: &[Vec<u8>], files: &mut Files) -> &'static Encoding {
    let folder = files.folder.clone();
    let mut all: Vec<Vec<u8>> = Vec::new();
    for text in texts {
        for (key, rest) in statements(text).filter(|(key, _)| key.eq_ignore_ascii_case(b"mtllib")) {
            let name = std::str::from_utf8(rest).ok().filter(|name| key.is_ascii() && name.is_ascii());
            all.extend(name.and_then(|name| files.find(&folder, name)).and_then(|file| std::fs::read(file).ok()));
        }
    }
    let texts: Vec<&[u8]> = texts.iter().chain(&all).map(Vec::as_slice).collect();
    of_texts(&texts, &folder, files)
}

/// Decides the encoding of texts that are not UTF-8 and name files relative to a folder.
pub(super) fn of_texts(texts: &[&[u8]], folder: &Path, files: &mut Files) -> &'static Encoding {
    let names: Vec<&[u8]> = texts
        .iter()
        .flat_map(|text| statements(text))
        .filter(|(key, rest)| !rest.is_ascii() && names_file(key))
        .map(|(_, rest)| rest)
        .collect();
    detect(texts, &names, |name| files.find(folder, &Statement::parse(name).file).is_some())
}

/// Returns keyword and rest of the lines of a text.
fn statements(text: &[u8]) -> impl Iterator<Item = (&[u8], &[u8])> {
    text.split(|&byte| byte == b'\n').map(|line| {
        let line = line.trim_ascii();
        let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
        (&line[..end], line[end..].trim_ascii())
    })
}

/// Whether the keyword of a statement precedes the name of a file.
fn names_file(key: &[u8]) -> bool {
    let key = key.to_ascii_lowercase();
    key.starts_with(b"map_") || [&b"mtllib"[..], b"bump", b"norm", b"disp", b"decal", b"refl"].contains(&key.as_slice())
}

/// Returns the encoding of texts that are not UTF-8. `names` are names of files as written there; `exists` tells
/// whether there is a file of a name.
fn detect(texts: &[&[u8]], names: &[&[u8]], mut exists: impl FnMut(&str) -> bool) -> &'static Encoding {
    let likely = resembling(texts);
    let mut best = (0, likely);
    for encoding in std::iter::once(likely).chain(CODE_PAGES) {
        let spelled = |name: &&&[u8]| {
            let name = encoding.decode_without_bom_handling_and_without_replacement(name);
            name.is_some_and(|name| exists(&name))
        };
        let found = names.iter().filter(spelled).count();
        if found > best.0 {
            best = (found, encoding);
        }
    }
    best.1
}

/// Returns the encoding that the lines with letters beyond ASCII resemble.
fn resembling(texts: &[&[u8]]) -> &'static Encoding {
    const MOST_BYTES: usize = 1 << 16;
    let mut detector = EncodingDetector::new(Iso2022JpDetection::Deny);
    let mut fed = 0;
    let lines = texts.iter().flat_map(|text| text.split_inclusive(|&byte| byte == b'\n'));
    for line in lines.filter(|line| !line.is_ascii()) {
        if fed < MOST_BYTES {
            detector.feed(line, false);
            fed += line.len();
        }
    }
    detector.feed(b"\n", true);
    detector.guess(None, Utf8Detection::Deny)
}
