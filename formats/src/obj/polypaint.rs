//! Vertex colours that ZBrush writes as comments: `#MRGB` and eight hexadecimal digits per vertex (mask, red, green, blue),
//! in the order of the vertices, over any number of lines.

use std::fmt::Write;

use rayon::prelude::*;

use super::notes::Notes;
use super::text;

const KEY: &str = "#MRGB";

/// Appends the colours to the vertices, whose lines have none then.
pub(super) fn apply(texts: &mut [String], notes: &mut Notes) {
    if !texts.par_iter().any(|text| text.contains(KEY)) {
        return;
    }
    let colors: Vec<[u8; 3]> = texts.iter().flat_map(|text| text.lines()).flat_map(colors).collect();
    let mut rest = colors.iter();
    let mut vertices = 0;
    for text in texts {
        *text = painted(text, &mut rest, &mut vertices);
    }
    if colors.len() != vertices {
        let message = format!("{KEY} comments colour {} vertices, the file has {vertices}", colors.len());
        notes.add(String::new, &message);
    }
}

/// Returns the colours of a line.
fn colors(line: &str) -> impl Iterator<Item = [u8; 3]> + '_ {
    let digits = line.trim_start().strip_prefix(KEY).unwrap_or_default().trim();
    let color = |bytes: &[u8]| {
        let hex = u32::from_str_radix(std::str::from_utf8(bytes).ok()?, 16).ok()?;
        let [_, r, g, b] = hex.to_be_bytes();
        Some([r, g, b])
    };
    digits.as_bytes().chunks_exact(8).filter_map(color)
}

/// Returns a text with the next colours behind its vertices.
fn painted<'c>(text: &str, colors: &mut impl Iterator<Item = &'c [u8; 3]>, vertices: &mut usize) -> String {
    let mut out = String::with_capacity(text.len() * 2);
    for line in text.split_inclusive('\n') {
        let statement = line.trim_start();
        if !statement
            .get(..2)
            .is_some_and(|start| start.eq_ignore_ascii_case("v ") || start.eq_ignore_ascii_case("v\t"))
        {
            out.push_str(line);
            continue;
        }
        *vertices += 1;
        match colors.next() {
            Some(color) if text::words(statement).count() == 4 => {
                let words: Vec<&str> = text::words(statement).collect();
                out.push_str(&words.join(" "));
                for &component in color {
                    let _ = write!(out, " {:.6}", f64::from(component) / 255.0);
                }
                out.push('\n');
            }
            _ => out.push_str(line),
        }
    }
    out
}
