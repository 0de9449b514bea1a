//! Rotates an OBJ file: turns an axis-aligned scene into one that is not.

use glam::{DMat3, DVec3, EulerRot};
use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::Path;

/// The rotation used for the measurements.
const DEGREES: DVec3 = DVec3::new(30.0, 20.0, 45.0);

/// Runs `turned IN OUT [--degrees X,Y,Z]`.
pub(crate) fn run(arguments: &[String]) -> Result<(), String> {
    let (input, output, degrees) = match arguments {
        [input, output] => (input, output, DEGREES),
        [input, output, option, degrees] if option == "--degrees" => (input, output, parse(degrees)?),
        _ => return Err("turned takes IN.obj OUT.obj [--degrees X,Y,Z]".into()),
    };
    if Path::new(input).canonicalize().is_ok_and(|path| Path::new(output).canonicalize().is_ok_and(|o| o == path)) {
        return Err(format!("{output}: it is the input"));
    }
    let reader = BufReader::new(File::open(input).map_err(|e| format!("{input}: {e}"))?);
    let writer = BufWriter::new(File::create(output).map_err(|e| format!("{output}: {e}"))?);
    copy(reader, writer, &rotation(degrees)).map_err(|e| format!("{input}: {e}"))
}

fn parse(degrees: &str) -> Result<DVec3, String> {
    let angles: Option<Vec<f64>> = degrees.split(',').map(|angle| angle.trim().parse().ok()).collect();
    match angles.as_deref() {
        Some(&[x, y, z]) if [x, y, z].iter().all(|a| a.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("--degrees {degrees}: three numbers are wanted, such as 30,20,45")),
    }
}

/// The rotation about x, then y, then z.
fn rotation(degrees: DVec3) -> DMat3 {
    let [x, y, z] = degrees.to_array().map(f64::to_radians);
    DMat3::from_euler(EulerRot::ZYX, z, y, x)
}

/// Copies lines, rotating `v` and `vn` lines.
fn copy(mut from: impl BufRead, mut to: impl Write, turn: &DMat3) -> io::Result<()> {
    let mut line = Vec::new();
    for number in 1.. {
        line.clear();
        if from.read_until(b'\n', &mut line)? == 0 {
            break;
        }
        let turned = turned(&line, turn).map_err(|why| io::Error::other(format!("line {number}: {why}")))?;
        to.write_all(turned.as_deref().unwrap_or(&line))?;
    }
    to.flush()
}

/// A line with its first three numbers rotated and rounded to single precision; `None` unless it is a `v` or `vn` line.
fn turned(line: &[u8], turn: &DMat3) -> Result<Option<Vec<u8>>, &'static str> {
    let mut rest = line;
    let keyword = word(&mut rest);
    if keyword != b"v" && keyword != b"vn" {
        return Ok(None);
    }
    let mut number = || std::str::from_utf8(word(&mut rest)).ok()?.parse::<f64>().ok();
    let (Some(x), Some(y), Some(z)) = (number(), number(), number()) else {
        return Err("three numbers are wanted in one line");
    };
    let [x, y, z] = (*turn * DVec3::new(x, y, z)).as_vec3().to_array();
    let mut turned = [keyword, format!(" {x} {y} {z}").as_bytes()].concat();
    turned.extend_from_slice(rest);
    Ok(Some(turned))
}

/// Removes the next word from a line, together with the white space before it.
fn word<'l>(line: &mut &'l [u8]) -> &'l [u8] {
    let start = line.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(line.len());
    let after = &line[start..];
    let (word, rest) = after.split_at(after.iter().position(u8::is_ascii_whitespace).unwrap_or(after.len()));
    *line = rest;
    word
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(text: &str, degrees: [f64; 3]) -> Result<String, String> {
        let mut out = Vec::new();
        copy(text.as_bytes(), &mut out, &rotation(degrees.into())).map_err(|e| e.to_string())?;
        Ok(String::from_utf8(out).expect("text"))
    }

    #[test]
    fn only_positions_and_normals_change() {
        let text = "mtllib a b.mtl\r\n# v 1 2 3\nv  1 2 3 0.5 0.5 1\r\n\tvn 0 0 1\nvt 1 0\nf 1//1 1//1 1//1";
        let expected = "mtllib a b.mtl\r\n# v 1 2 3\nv -2 1 3 0.5 0.5 1\r\nvn 0 0 1\nvt 1 0\nf 1//1 1//1 1//1";
        assert_eq!(turn(text, [0.0, 0.0, 90.0]).expect("an OBJ file"), expected);
    }

    #[test]
    fn x_turns_first_and_z_last() {
        assert!((rotation(DVec3::new(90.0, 90.0, 0.0)) * DVec3::Y - DVec3::X).length() < 1e-12);
        assert!((rotation(DVec3::new(0.0, 90.0, 90.0)) * DVec3::Z - DVec3::Y).length() < 1e-12);
        assert!((rotation(DEGREES).determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn broken_lines_and_angles_are_named() {
        assert_eq!(turn("v 0 0 0\nv 1 x 0\n", [0.0; 3]), Err("line 2: three numbers are wanted in one line".into()));
        assert_eq!(turn("v 0 \\\n 0 0\n", [0.0; 3]), Err("line 1: three numbers are wanted in one line".into()));
        assert!(["1,2", "1,2,nan", "a,b,c", ""].iter().all(|angles| parse(angles).is_err()));
        assert_eq!(parse("1, 2,-3"), Ok(DVec3::new(1.0, 2.0, -3.0)));
    }
}
