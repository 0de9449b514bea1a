//! MTL files, read by `tobj` after each statement has been checked, because `tobj` rejects a whole file, or panics, at
//! a colour that is not three numbers.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::encoding;
use super::files::{Files, without_comment};
use super::notes::Notes;
use super::scan::Names;
use super::text::{self, place, words};

/// A material as defined in an MTL file.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    /// The values that `tobj` understood.
    pub(super) values: tobj::Material,
    /// All statements, including malformed ones: keyword in its usual case, and rest of the line.
    pub(super) statements: Vec<(String, String)>,
    /// The folder of the MTL file.
    pub(super) folder: PathBuf,
    /// What the library means by `d` and `Tr`.
    pub(super) opacity: Opacity,
}

/// What a library means by `d` and `Tr`. Exporters disagree on `Tr`, and some write `d 0` for opaque; a library of which
/// nothing could be seen is never meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Opacity {
    /// Whether `Tr` is opacity: one of the materials has `Tr 1` and no `d`.
    pub(super) tr_is_opacity: bool,
    /// Whether `d` is to be ignored: all materials have `d 0`.
    pub(super) d_is_ignored: bool,
}

impl Opacity {
    fn of(materials: &[tobj::Material]) -> Opacity {
        let tr = |material: &tobj::Material| material.unknown_param.get("Tr")?.parse::<f32>().ok();
        let tr_is_opacity = materials.iter().any(|m| m.dissolve.is_none() && tr(m) == Some(1.0));
        let d_is_ignored = !materials.is_empty() && materials.iter().all(|m| m.dissolve == Some(0.0));
        Opacity { tr_is_opacity, d_is_ignored }
    }
}

/// The materials of all MTL files of an OBJ file, by name. If a name is defined more than once, the first definition is
/// used (Wavefront, "Advanced Visualizer Manual", appendix B1, `mtllib`).
#[derive(Debug, Default)]
pub(super) struct Libraries {
    definitions: HashMap<String, Definition>,
    /// Names that are defined with a comment behind them, by the name without it.
    commented: HashMap<String, String>,
    /// The first defined of the names that differ only in case, by their form in lower case.
    any_case: HashMap<String, String>,
}

impl Libraries {
    /// Loads the MTL files that the statements (line and rest of line) refer to, each once. If a library is missing or
    /// none is named, and one of the materials `used` is not defined, the library named like the model is taken.
    pub(super) fn load(statements: &[(usize, String)], used: &Names, files: &mut Files, notes: &mut Notes) -> Self {
        let mut out = Libraries::default();
        let mut loaded = HashSet::new();
        let mut missing = false;
        for (line, written) in statements {
            let found = library_files(written, *line, files, notes);
            missing |= found.is_empty();
            for file in found {
                if loaded.insert(file.clone()) {
                    out.add(&file, files, notes);
                }
            }
        }
        let undefined = used.iter().any(|name| !name.is_empty() && out.get(name).is_none());
        if undefined && (missing || statements.is_empty()) {
            out.add_namesake(files, notes, |file| loaded.insert(file.to_owned()));
        }
        out
    }

    /// Loads the library that is named like the model, if it is new.
    fn add_namesake(&mut self, files: &mut Files, notes: &mut Notes, is_new: impl FnOnce(&Path) -> bool) {
        if let Some(file) = files.namesake().filter(|file| is_new(file)) {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            notes.add(String::new, &format!("material library `{name}`, named like the model, is taken"));
            self.add(&file, files, notes);
        }
    }

    /// Returns the definition with the given name, and that name; a comment behind it is left out if the whole is not
    /// defined, and its letters may be of another case if that is not, either.
    pub(super) fn get<'n>(&self, name: &'n str) -> Option<(&'n str, &Definition)> {
        let commented = |name: &str| self.commented.get(name).and_then(|whole| self.definitions.get(whole));
        let exact = |name: &str| self.definitions.get(name).or_else(|| commented(name));
        let of = |name: &'n str| exact(name).map(|definition| (name, definition));
        let any_case = |name: &'n str| {
            let defined = self.any_case.get(&name.to_lowercase())?;
            self.definitions.get(defined).map(|definition| (name, definition))
        };
        of(name).or_else(|| of(without_comment(name)?)).or_else(|| any_case(name))
    }

    fn add(&mut self, file: &Path, files: &mut Files, notes: &mut Notes) {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let bytes = match std::fs::read(file) {
            Ok(bytes) => bytes,
            Err(cause) => return notes.add(|| name, &format!("material library cannot be read: {cause}")),
        };
        if files.is_outside(file) {
            notes.add(|| name.clone(), "material library read from outside the folder of the model");
        }
        let folder = file.parent().unwrap_or(Path::new("")).to_owned();
        let text = text(bytes, &folder, files, notes);
        let checked = Checked::of(&text, &name, notes);
        // Every statement has been checked; if an error still occurs, only this library is left out.
        let Ok((materials, _)) = tobj::load_mtl_buf(&mut checked.text.as_bytes()) else {
            return notes.add(|| name, "material library cannot be read");
        };
        let opacity = Opacity::of(&materials);
        for (values, (written, statements)) in materials.into_iter().zip(checked.materials) {
            if let Some(name) = without_comment(&written) {
                self.commented.entry(name.to_owned()).or_insert_with(|| written.clone());
            }
            self.any_case.entry(written.to_lowercase()).or_insert_with(|| written.clone());
            match self.definitions.entry(written) {
                Entry::Vacant(free) => {
                    _ = free.insert(Definition { values, statements, folder: folder.clone(), opacity });
                }
                Entry::Occupied(first) => {
                    let message = format!("material `{}` defined again: the first definition counts", first.key());
                    notes.add(|| name.clone(), &message);
                }
            }
        }
    }
}

/// Returns the text of a library in a folder; the first that is not UTF-8 decides the code page of the scene.
pub(super) fn text(bytes: Vec<u8>, folder: &Path, files: &mut Files, notes: &mut Notes) -> String {
    let code_page = |blocks: &[Vec<u8>]| {
        let texts: Vec<&[u8]> = blocks.iter().map(Vec::as_slice).collect();
        let found = files.encoding.unwrap_or_else(|| encoding::of_texts(&texts, folder, files));
        files.encoding = Some(found);
        found
    };
    text::decode(vec![bytes], code_page, notes).concat()
}

/// Returns the files of an `mtllib` statement: all its words as one name if such a file exists, otherwise as few names
/// as there are files for. Names without a file cause a warning.
pub(super) fn library_files(written: &str, line: usize, files: &mut Files, notes: &mut Notes) -> Vec<PathBuf> {
    const MOST_WORDS: usize = 64;
    let folder = files.folder.clone();
    if let Some(file) = files.find(&folder, written) {
        return vec![file];
    }
    let written = without_comment(written).unwrap_or(written);
    let unescaped = written.replace("\\ ", "\u{0}");
    let names: Vec<String> = unescaped.split_whitespace().map(|word| word.replace('\u{0}', " ")).collect();
    let (mut out, mut start) = (Vec::new(), 0);
    while start < names.len() {
        let longest = names.len().min(start + MOST_WORDS);
        let found = (start + 1..=longest)
            .rev()
            .find_map(|end| files.find_exactly(&folder, &names[start..end].join(" ")).map(|file| (file, end)));
        match found {
            Some((file, end)) => {
                out.push(file);
                start = end;
            }
            None => {
                notes.add(|| place(line), &format!("material library `{}` not found", names[start]));
                start += 1;
            }
        }
    }
    out
}

/// The statements of an MTL file in a form that `tobj` can read: materials named by number, values checked.
#[derive(Default)]
struct Checked {
    text: String,
    /// Name and statements of each material.
    materials: Vec<(String, Vec<(String, String)>)>,
}

impl Checked {
    fn of(text: &str, file: &str, notes: &mut Notes) -> Self {
        let mut out = Checked::default();
        for line in text::lines(text) {
            let at = || format!("{file}, {}", place(line.number));
            let (key, rest) = line.text();
            if key.eq_ignore_ascii_case("newmtl") {
                let _ = writeln!(out.text, "newmtl {}", out.materials.len());
                out.materials.push((rest.to_owned(), Vec::new()));
                continue;
            }
            let Some((_, statements)) = out.materials.last_mut() else {
                notes.add(at, "material statements before the first `newmtl` ignored");
                continue;
            };
            let key = canonical(key);
            match checked(key, rest) {
                Some(values) => {
                    let _ = writeln!(out.text, "{key} {values}");
                }
                None => notes.add(at, &format!("`{key}` cannot be read: kept in extras only")),
            }
            statements.push((key.to_owned(), rest.to_owned()));
        }
        out
    }
}

/// Returns keywords in the case used by `tobj` and [`super::material`], and other words for them as those; unknown ones
/// as written.
fn canonical(key: &str) -> &str {
    const KNOWN: [&str; 34] = [
        "Ka",
        "Kd",
        "Ks",
        "Ke",
        "Ns",
        "Ni",
        "d",
        "Tr",
        "Tf",
        "illum",
        "Pr",
        "Pm",
        "Ps",
        "Pc",
        "Pcr",
        "aniso",
        "anisor",
        "map_Ka",
        "map_Kd",
        "map_Ks",
        "map_Ke",
        "map_Ns",
        "map_d",
        "map_Bump",
        "map_Pr",
        "map_Pm",
        "map_Ps",
        "map_Kn",
        "bump",
        "norm",
        "disp",
        "decal",
        "refl",
        "sharpness",
    ];
    const OTHER_WORDS: [(&str, &str); 6] = [
        ("map_opacity", "map_d"),
        ("map_emissive", "map_Ke"),
        ("map_normal", "norm"),
        ("map_norm", "norm"),
        ("map_disp", "disp"),
        ("map_refl", "refl"),
    ];
    let known = KNOWN.into_iter().map(|known| (known, known)).chain(OTHER_WORDS);
    known.into_iter().find(|(word, _)| word.eq_ignore_ascii_case(key)).map_or(key, |(_, known)| known)
}

/// Returns the values of a statement in the form `tobj` reads; `None` if they do not suit the keyword.
fn checked(key: &str, rest: &str) -> Option<String> {
    match key {
        "Ka" | "Kd" | "Ks" | "Ke" => color(rest),
        "Ns" | "Ni" | "d" | "Tr" | "Pr" | "Pm" | "Ps" | "Pc" | "Pcr" | "aniso" | "anisor" => {
            let first = words(rest).find(|word| *word != "-halo")?;
            finite(first).then(|| first.to_owned())
        }
        "illum" => words(rest).next().filter(|word| word.parse::<u8>().is_ok()).map(str::to_owned),
        _ => (!rest.is_empty()).then(|| rest.to_owned()),
    }
}

/// Parses three numbers; a single number represents three equal ones.
fn color(rest: &str) -> Option<String> {
    let values: Vec<&str> = words(rest).take(3).collect();
    if !values.iter().all(|word| finite(word)) {
        return None;
    }
    match values[..] {
        [all] => Some(format!("{all} {all} {all}")),
        [r, g, b] => Some(format!("{r} {g} {b}")),
        _ => None,
    }
}

fn finite(word: &str) -> bool {
    word.parse::<f32>().is_ok_and(f32::is_finite)
}
