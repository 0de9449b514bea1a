//! `v`, `vt` and `vn` statements, normalised for `tobj`.

use std::borrow::Cow;

use super::super::notes::Notes;
use super::super::text::{Line, words};
use super::pieces::{Piece, push};
use super::{needs_repair, repaired};

/// Number of elements of each kind, and statistics of their colours.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    /// Number of positions, texture coordinates and normals.
    pub(super) counts: [i64; 3],
    /// Whether a position has a colour.
    pub(super) colored: bool,
    /// The largest finite colour component.
    brightest: f32,
    /// Whether a colour component is not an integer.
    fractional: bool,
}

impl Tally {
    /// Adds the elements of another range of text.
    pub(super) fn add(&mut self, other: &Tally) {
        for (count, more) in self.counts.iter_mut().zip(other.counts) {
            *count += more;
        }
        self.colored |= other.colored;
        self.brightest = self.brightest.max(other.brightest);
        self.fractional |= other.fractional;
    }

    /// Returns the divisor of colours: integers up to 255 are treated as bytes, beyond as words of 16 bits.
    pub(super) fn full_color(&self, notes: &mut Notes) -> f32 {
        match self.brightest {
            brightest if brightest <= 1.0 => 1.0,
            brightest if brightest <= 255.0 && (!self.fractional || brightest >= CERTAINLY_BYTES) => 255.0,
            brightest if brightest <= 65_535.0 && !self.fractional => 65_535.0,
            _ => {
                notes.add(String::new, "vertex colours above 1 are cut to 1");
                1.0
            }
        }
    }
}

/// A colour component that no light is that bright for, but a byte is.
const CERTAINLY_BYTES: f32 = 16.0;

/// The element statements of a block for `tobj`.
#[derive(Debug, Default)]
pub(super) struct Elements {
    pub(super) tally: Tally,
    pub(super) pieces: Vec<Piece>,
    /// Whether every position must have a colour.
    pub(super) color_all: bool,
    /// Whether a malformed normal or texture coordinate is a fault.
    pub(super) strict: bool,
    /// Whether `tobj` could not parse the text, so that its numbers are checked here.
    pub(super) check: bool,
}

/// Represents a missing colour.
const NO_COLOR: &str = " nan nan nan";

/// The part of a statement that was not read, to be noted.
type Unread = Option<&'static str>;

impl Elements {
    /// Adds a statement; what `tobj` must not read as it is goes to `mended`. Colours and weights are parsed here,
    /// coordinates by `tobj`.
    pub(super) fn add(&mut self, key: &str, line: &Line<'_>, mended: &mut String) -> Result<Unread, String> {
        let (written, rest) = line.text();
        let repaired = needs_repair(rest).then(|| repaired(key, rest));
        let verbatim = line.is_verbatim() && repaired.is_none() && key == written;
        let rest = repaired.as_deref().unwrap_or(rest);
        let start = mended.len();
        let mut unread = None;
        let plain = match key {
            "v" => self.position(rest, verbatim, mended, &mut unread)?,
            _ => match self.attribute(key, rest, verbatim, mended) {
                Err(_) if !self.strict => {
                    unread = Some("malformed texture coordinates and normals count as missing");
                    mended.push_str(if key == "vt" { NO_TEXCOORD } else { NO_NORMAL });
                    false
                }
                done => done?,
            },
        };
        push(
            &mut self.pieces,
            if plain { Piece::text(line.range.clone()) } else { Piece::mended(start..mended.len()) },
        );
        Ok(unread)
    }

    fn attribute(&mut self, key: &str, rest: &str, verbatim: bool, out: &mut String) -> Result<bool, String> {
        let start = out.len();
        let done = match key {
            "vt" => self.texcoord(rest, verbatim, out),
            _ => self.normal(rest, verbatim, out),
        };
        let checked = if self.check { done.and_then(|plain| check(key, rest).map(|()| plain)) } else { done };
        checked.inspect_err(|_| out.truncate(start))
    }

    /// Parses `x y z`, `x y z w` (divided by the weight, as `tobj` and most readers do) or `x y z r g b`. Returns
    /// whether `tobj` may read it as it is.
    fn position(&mut self, rest: &str, verbatim: bool, out: &mut String, unread: &mut Unread) -> Result<bool, String> {
        let count = word_count(rest);
        self.tally.counts[0] += 1;
        if self.check {
            check("v", rest)?;
        }
        let coordinates = match count {
            0..=2 => return Err(format!("a vertex has three coordinates, this one {count}")),
            3 => Cow::Borrowed(rest),
            4 => Cow::Owned(weighted(rest)?),
            _ => Cow::Owned(first_words(rest, 3)),
        };
        if count >= 6 {
            self.color(rest)?;
        }
        if verbatim && (count == 6 || count == 3 && !self.color_all) {
            return Ok(true);
        }
        out.extend(["v ", &coordinates]);
        if count >= 6 {
            rest.split_whitespace().skip(3).take(3).for_each(|word| out.extend([" ", word]));
        } else if self.color_all {
            out.push_str(NO_COLOR);
        }
        out.push('\n');
        *unread = match count {
            7 if alpha_of(rest) < 1.0 => Some("alpha of vertex colours left out"),
            5 | 8.. => Some("vertices with extra numbers: only coordinates and colour are read"),
            _ => None,
        };
        Ok(false)
    }

    fn color(&mut self, rest: &str) -> Result<(), String> {
        self.tally.colored = true;
        for word in rest.split_whitespace().skip(3).take(3) {
            let value = number(word)? as f32;
            if value.is_finite() {
                self.tally.brightest = self.tally.brightest.max(value);
                self.tally.fractional |= value.fract() != 0.0;
            }
        }
        Ok(())
    }

    fn texcoord(&mut self, rest: &str, verbatim: bool, out: &mut String) -> Result<bool, String> {
        self.tally.counts[1] += 1;
        let one = match word_count(rest) {
            0 => return Err("a texture coordinate has at least one number, this one none".to_owned()),
            count => count == 1,
        };
        if verbatim && !one {
            return Ok(true);
        }
        out.extend(["vt ", rest, if one { " 0\n" } else { "\n" }]);
        Ok(false)
    }

    fn normal(&mut self, rest: &str, verbatim: bool, out: &mut String) -> Result<bool, String> {
        self.tally.counts[2] += 1;
        let count = word_count(rest);
        if count < 3 {
            return Err(format!("a normal has three coordinates, this one {count}"));
        }
        if !verbatim {
            out.extend(["vn ", rest, "\n"]);
        }
        Ok(verbatim)
    }
}

/// Represents a missing texture coordinate and a missing normal.
const NO_TEXCOORD: &str = "vt nan nan\n";
const NO_NORMAL: &str = "vn nan nan nan\n";

/// Returns the seventh number of a position; 1 if it is malformed.
fn alpha_of(rest: &str) -> f64 {
    rest.split_whitespace().nth(6).and_then(|word| word.parse().ok()).unwrap_or(1.0)
}

/// Returns the elements that represent missing texture coordinates and normals; they come after all others.
pub(super) fn missing(texcoords: bool, normals: bool) -> impl Iterator<Item = &'static str> {
    [texcoords.then_some(NO_TEXCOORD), normals.then_some(NO_NORMAL)].into_iter().flatten()
}

/// Checks that the coordinates of a statement are numbers; other statements pass.
pub(super) fn check(key: &str, rest: &str) -> Result<(), String> {
    let count = match key {
        "v" | "vn" => 3,
        "vt" => 2,
        _ => return Ok(()),
    };
    let mended = repaired(key, rest);
    mended.split_whitespace().take(count).try_for_each(|word| number(word).map(drop))
}

fn word_count(rest: &str) -> usize {
    if !rest.is_ascii() {
        return rest.split_whitespace().count();
    }
    let (mut count, mut blank) = (0, true);
    for byte in rest.bytes() {
        let next = matches!(byte, b'\t'..=b'\r' | b' ');
        count += usize::from(blank && !next);
        blank = next;
    }
    count
}

fn first_words(rest: &str, count: usize) -> String {
    rest.split_whitespace().take(count).collect::<Vec<_>>().join(" ")
}

fn weighted(rest: &str) -> Result<String, String> {
    let [x, y, z, w] = {
        let mut values = [0.0; 4];
        for (value, word) in values.iter_mut().zip(words(rest)) {
            *value = number(word)?;
        }
        values
    };
    match w {
        0.0 => Err("the weight of a vertex is zero".to_owned()),
        1.0 => Ok(first_words(rest, 3)),
        _ => Ok(format!("{:e} {:e} {:e}", x / w, y / w, z / w)),
    }
}

fn number(word: &str) -> Result<f64, String> {
    word.parse().map_err(|_| format!("`{}` is not a number", shown(word)))
}

/// Returns a word of the file, shortened for messages.
pub(super) fn shown(word: &str) -> String {
    match word.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &word[..end]),
        None => word.to_owned(),
    }
}
