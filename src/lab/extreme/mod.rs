//! `lab generate extreme`: stiff and extreme scenes, each with the outcome that a bake of it must have.
//! `docs/extreme.md` lists them; `tests/program/extreme.rs` holds every method to them.

mod coordinates;
mod shapes;
mod structure;
mod transforms;
mod triangles;
mod values;

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use raykiln_formats::staging::{Folder, Hold};
use raykiln_formats::unchecked::File;
use serde::Serialize;

use super::LabError;
use crate::report::json::to_json;
use crate::verify::random::Random;

/// The largest error of a position over the size of the scene that [`Outcome::Bounded`] allows: the default of
/// `--max-position-error-ratio`.
pub const BOUND: f64 = 1e-6;

/// What a bake of a case must end in, with any method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "outcome", content = "message")]
#[non_exhaustive]
pub enum Outcome {
    /// The same surfaces; no method moves a corner.
    Exact,
    /// The same surfaces; no method moves a corner by more than the default of `--max-position-error-ratio`.
    Bounded,
    /// Exit status 2; the error contains this text. Nothing is left behind.
    Refused(&'static str),
    /// The same surfaces; what cannot be traced is left out, with a warning that contains this text.
    Dropped(&'static str),
    /// All triangles are compared, within the same bound, but rays in single precision cannot tell some objects from what
    /// is beside them. Of files in which triangles do not name their sources, `verify` says "cannot tell", with exit
    /// status 1.
    CannotTell,
}

/// An extreme scene.
#[derive(Debug)]
pub struct Case {
    /// Its name, which is that of its file without the extension.
    pub name: &'static str,
    /// What is extreme about it.
    pub what: &'static str,
    /// What a bake of it must end in.
    pub outcome: Outcome,
    /// Whether it is generated only if large cases are asked for.
    pub large: bool,
    make: fn(&mut File, &mut Random),
}

impl Case {
    const fn new(name: &'static str, what: &'static str, outcome: Outcome, make: fn(&mut File, &mut Random)) -> Case {
        Case { name, what, outcome, large: false, make }
    }

    const fn large(self) -> Case {
        Case { large: true, ..self }
    }

    /// Writes its GLB file, byte for byte the same for the same seed.
    ///
    /// # Errors
    /// Fails if the file cannot be written.
    pub fn write(&self, path: &Path, seed: u64) -> io::Result<()> {
        let mut out = BufWriter::new(fs::File::create(path)?);
        self.file(seed).write(&mut out)?;
        out.flush()
    }

    fn file(&self, seed: u64) -> File {
        let mut file = File::default();
        let stream = self.name.bytes().fold(0_u64, |sum, byte| sum.wrapping_mul(31).wrapping_add(byte.into()));
        (self.make)(&mut file, &mut Random::at(seed, stream, 0));
        file
    }
}

/// All cases, in groups: a heading and its cases.
pub const GROUPS: [(&str, &[Case]); 5] = [
    ("Coordinates", coordinates::CASES),
    ("Triangles", triangles::CASES),
    ("Transforms", transforms::CASES),
    ("Structure", structure::CASES),
    ("Values", values::CASES),
];

/// Returns all cases.
pub fn cases() -> impl Iterator<Item = &'static Case> {
    GROUPS.iter().flat_map(|(_, cases)| *cases)
}

/// An entry of `cases.json`.
#[derive(Serialize)]
struct Listed {
    name: &'static str,
    file: String,
    what: &'static str,
    #[serde(flatten)]
    outcome: Outcome,
}

/// Writes a GLB file for each case into a folder, which is created if it does not exist, and the list `cases.json`.
/// `progress` receives each case's name before its file is made. Returns the number of cases.
///
/// # Errors
/// Fails if the folder cannot be created or written to; then it is as it was before.
pub fn generate(out: &Path, seed: u64, large: bool, progress: &mut dyn FnMut(&str)) -> Result<usize, LabError> {
    let parent = super::output::parent(out);
    let folder = Folder::new_in(parent).map_err(|e| LabError::file(parent, e))?;
    let wanted: Vec<&Case> = cases().filter(|case| large || !case.large).collect();
    let mut names = Vec::new();
    for case in &wanted {
        progress(case.name);
        let name = format!("{}.glb", case.name);
        case.write(&folder.path().join(&name), seed).map_err(|e| LabError::file(&out.join(&name), e))?;
        names.push(name);
    }
    let listed = wanted.iter().zip(&names).map(|(case, file)| Listed {
        name: case.name,
        file: file.clone(),
        what: case.what,
        outcome: case.outcome,
    });
    let list = to_json(&listed.collect::<Vec<_>>());
    names.push("cases.json".to_owned());
    fs::write(folder.path().join("cases.json"), list).map_err(|e| LabError::file(&out.join("cases.json"), e))?;
    put_in_place(&folder, out, &names)?;
    Ok(wanted.len())
}

fn put_in_place(folder: &Folder, out: &Path, names: &[String]) -> Result<(), LabError> {
    let _hold = Hold::new();
    fs::create_dir_all(out).map_err(|e| LabError::file(out, e))?;
    for name in names {
        fs::rename(folder.path().join(name), out.join(name)).map_err(|e| LabError::file(&out.join(name), e))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn bytes(case: &Case, seed: u64) -> Vec<u8> {
        let mut bytes = Vec::new();
        case.file(seed).write(&mut bytes).expect("memory can be written to");
        bytes
    }

    #[test]
    fn names_are_unique_and_the_same_seed_gives_the_same_bytes() {
        let small: Vec<&Case> = cases().filter(|case| !case.large).collect();
        assert_eq!(cases().map(|case| case.name).collect::<BTreeSet<_>>().len(), cases().count());
        let differs = |case: &&&Case| bytes(case, 1) != bytes(case, 2);
        assert!(small.iter().filter(differs).count() > 5, "the seed changes some scenes");
        assert!(small.iter().all(|case| bytes(case, 1) == bytes(case, 1)));
    }
}
