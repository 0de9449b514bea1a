//! `samples/*/expect.toml`.

use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// A sample and its expectations.
pub(crate) struct Sample {
    pub(crate) name: String,
    /// The scene file.
    pub(crate) scene: PathBuf,
    pub(crate) expectation: Expectation,
}

/// An `expect.toml`. The keys of `input`, `before` and `after` are those of the JSON report.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Expectation {
    /// The scene's file name.
    scene: String,
    pub(crate) input: BTreeMap<String, Number>,
    pub(crate) before: BTreeMap<String, Number>,
    /// Surface areas by material name.
    #[serde(default)]
    pub(crate) areas: BTreeMap<String, Number>,
    pub(crate) bake: Vec<Bake>,
}

/// The expected result of one `raykiln bake` run.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bake {
    pub(crate) method: String,
    /// Further arguments.
    #[serde(default)]
    pub(crate) args: Vec<String>,
    /// The layout is the input's; if the file format is too, so is every byte.
    #[serde(default)]
    pub(crate) unchanged: bool,
    /// Values of `input` that differ because of the arguments.
    #[serde(default)]
    pub(crate) input: BTreeMap<String, Number>,
    #[serde(default)]
    pub(crate) after: BTreeMap<String, Number>,
    /// Triangles per mesh that a node of the output places, in ascending order.
    pub(crate) group_triangles: Option<Vec<usize>>,
}

/// An exact number, or the smallest and largest allowed.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum Number {
    Exactly(f64),
    Between([f64; 2]),
}

impl Number {
    pub(crate) fn allows(self, value: f64) -> bool {
        match self {
            Number::Exactly(expected) => value == expected,
            Number::Between([low, high]) => (low..=high).contains(&value),
        }
    }
}

impl Bake {
    /// The arguments that follow input and output.
    pub(crate) fn arguments(&self) -> Vec<&str> {
        ["--method", &self.method].into_iter().chain(self.args.iter().map(String::as_str)).collect()
    }
}

/// All samples, sorted by name.
pub(crate) fn samples() -> Vec<Sample> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples");
    let entries = fs::read_dir(&folder).expect("samples/ is there").map(|e| e.expect("readable").path());
    let mut folders: Vec<PathBuf> = entries.filter(|p| p.is_dir()).collect();
    folders.sort();
    folders.iter().map(|f| sample(f)).collect()
}

fn sample(folder: &Path) -> Sample {
    let file = folder.join("expect.toml");
    let text = fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let expectation: Expectation = toml::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let name = folder.file_name().expect("a name").to_string_lossy().into_owned();
    Sample { name, scene: folder.join(&expectation.scene), expectation }
}
