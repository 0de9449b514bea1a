//! `v`, `vt` and `vn` statements, normalised for `tobj`.

use super::super::notes::Notes;
use super::super::text::{place, words};
use super::{needs_repair, repaired};

/// The normalised statements and how many of each kind there are.
#[derive(Debug, Default)]
pub(super) struct Elements {
    /// One `v` line each, with colours if `colored`.
    positions: String,
    others: String,
    counts: [i64; 3],
    colored: bool,
    /// The largest finite colour component.
    brightest: f32,
    /// Whether a colour component is no whole number.
    fractional: bool,
}

/// Stands for a colour that is missing.
const NO_COLOR: &str = " nan nan nan";

impl Elements {
    /// Number of positions, texture coordinates and normals so far.
    pub(super) fn counts(&self) -> [i64; 3] {
        self.counts
    }

    /// The normalised lines.
    pub(super) fn text(&self) -> &[u8] {
        self.positions.as_bytes()
    }

    /// Adds a statement. Colours and weights are parsed here, coordinates by `tobj`.
    pub(super) fn add(&mut self, key: &str, rest: &str, line: usize, notes: &mut Notes) -> Result<(), String> {
        let mended;
        let rest = if needs_repair(rest) {
            mended = repaired(rest);
            &mended
        } else {
            rest
        };
        match key {
            "v" => self.position(rest, line, notes),
            "vt" => self.texcoord(rest),
            _ => self.normal(rest),
        }
    }

    /// `x y z`, `x y z w` (divided by the weight, as `tobj` and most readers have it) or `x y z r g b`.
    fn position(&mut self, rest: &str, line: usize, notes: &mut Notes) -> Result<(), String> {
        let count = rest.split_whitespace().count();
        self.counts[0] += 1;
        self.positions.push_str("v ");
        match count {
            0..=2 => return Err(format!("a vertex has three coordinates, this one {count}")),
            3 => self.positions.push_str(rest),
            4 => self.positions.push_str(&weighted(rest)?),
            _ => self.positions.push_str(&first_words(rest, 3)),
        }
        if count >= 6 {
            self.color(rest)?;
        } else if self.colored {
            self.positions.push_str(NO_COLOR);
        }
        self.positions.push('\n');
        if count == 5 || count > 6 {
            notes.add(|| place(line), "vertices with extra numbers: only coordinates and colour are read");
        }
        Ok(())
    }

    /// Appends a colour to the position begun, which is the first to have one or not.
    fn color(&mut self, rest: &str) -> Result<(), String> {
        if !self.colored {
            self.colored = true;
            let begun = self.positions.rfind('\n').map_or(0, |end| end + 1);
            let line = self.positions.split_off(begun);
            self.positions = self.positions.replace('\n', &format!("{NO_COLOR}\n"));
            self.positions.push_str(&line);
        }
        for word in rest.split_whitespace().skip(3).take(3) {
            let value = number(word)?;
            if value.is_finite() {
                self.brightest = self.brightest.max(value);
                self.fractional |= value.fract() != 0.0;
            }
            self.positions.push(' ');
            self.positions.push_str(word);
        }
        Ok(())
    }

    fn texcoord(&mut self, rest: &str) -> Result<(), String> {
        self.counts[1] += 1;
        self.others.push_str("vt ");
        self.others.push_str(rest);
        match rest.split_whitespace().count() {
            0 => return Err("a texture coordinate has at least one number, this one none".to_owned()),
            1 => self.others.push_str(" 0"),
            _ => {}
        }
        self.others.push('\n');
        Ok(())
    }

    fn normal(&mut self, rest: &str) -> Result<(), String> {
        self.counts[2] += 1;
        let count = rest.split_whitespace().count();
        if count < 3 {
            return Err(format!("a normal has three coordinates, this one {count}"));
        }
        self.others.push_str("vn ");
        self.others.push_str(rest);
        self.others.push('\n');
        Ok(())
    }

    /// Appends what stands for missing texture coordinates and normals.
    pub(super) fn finish(&mut self, texcoords: bool, normals: bool) {
        if texcoords {
            self.others.push_str("vt nan nan\n");
        }
        if normals {
            self.others.push_str("vn nan nan nan\n");
        }
        self.positions.push_str(&std::mem::take(&mut self.others));
    }

    /// What colours are to be multiplied by: whole numbers up to 255 are taken for bytes.
    pub(super) fn color_scale(&self, notes: &mut Notes) -> f32 {
        match self.brightest {
            brightest if brightest <= 1.0 => 1.0,
            brightest if brightest <= 255.0 && !self.fractional => 1.0 / 255.0,
            _ => {
                notes.add(String::new, "vertex colours above 1 are cut to 1");
                1.0
            }
        }
    }
}

/// Whether the coordinates of a statement are numbers; other statements pass.
pub(super) fn check(key: &str, rest: &str) -> Result<(), String> {
    let count = match key {
        "v" | "vn" => 3,
        "vt" => 2,
        _ => return Ok(()),
    };
    let mended = repaired(rest);
    mended.split_whitespace().take(count).try_for_each(|word| number(word).map(drop))
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

fn number(word: &str) -> Result<f32, String> {
    word.parse().map_err(|_| format!("`{}` is not a number", shown(word)))
}

/// A word of the file, cut to a length that fits a message.
pub(super) fn shown(word: &str) -> String {
    match word.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &word[..end]),
        None => word.to_owned(),
    }
}
