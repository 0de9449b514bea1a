//! [`Manifest`]: the file `raykiln.toml`, which says which assets are baked how.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use globset::{Glob, GlobBuilder, GlobMatcher};
use serde::Deserialize;

/// Options of bakes by their long names, each with its values; a switch has the value `true`.
pub type BakeWords = BTreeMap<String, Vec<String>>;

/// The default name of an output.
const OUTPUT: &str = "{folder}/{stem}.glb";

/// A manifest: where assets are, and rules for them.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Manifest {
    /// Patterns of assets, relative to the manifest's folder.
    #[serde(default)]
    pub inputs: Vec<String>,
    /// The folder that is mirrored, relative to the manifest's folder.
    pub root: Option<PathBuf>,
    /// The folder of outputs, relative to the manifest's folder.
    pub out: Option<PathBuf>,
    /// Rules; all that apply to an asset do, in this order.
    #[serde(default, rename = "rule")]
    pub rules: Vec<Rule>,
}

/// What is said about the assets that a pattern names.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Rule {
    /// A pattern of names of assets.
    #[serde(deserialize_with = "matcher")]
    pub glob: GlobMatcher,
    /// Options of `bake` by their long names.
    #[serde(default)]
    pub options: BTreeMap<String, Setting>,
    /// The name of the output, in which `{folder}`, `{stem}` and `{extension}` stand for those of the asset.
    pub output: Option<String>,
    /// Whether the assets are left out.
    pub skip: Option<bool>,
    /// The longest that a bake may take, in seconds.
    pub max_seconds: Option<f64>,
    /// The most memory that a bake may take.
    pub max_memory: Option<String>,
    /// The most bytes that an output may have.
    pub max_output_bytes: Option<String>,
}

/// The value of an option.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum Setting {
    /// A switch, or an option with the value `true` or `false`.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number.
    Number(f64),
    /// A word.
    Text(String),
    /// Several values of an option that may be repeated.
    List(Vec<Setting>),
}

impl Setting {
    /// The values as words.
    fn words(&self) -> Vec<String> {
        match self {
            Setting::Bool(value) => vec![value.to_string()],
            Setting::Integer(value) => vec![value.to_string()],
            Setting::Number(value) => vec![value.to_string()],
            Setting::Text(value) => vec![value.clone()],
            Setting::List(values) => values.iter().flat_map(Setting::words).collect(),
        }
    }
}

fn matcher<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<GlobMatcher, D::Error> {
    let text = String::deserialize(deserializer)?;
    let glob: Result<Glob, _> = GlobBuilder::new(&text).literal_separator(true).build();
    glob.map(|glob| glob.compile_matcher()).map_err(serde::de::Error::custom)
}

/// What a bake may use.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Budget {
    /// Seconds.
    pub seconds: Option<f64>,
    /// Bytes of memory.
    pub memory: Option<u64>,
    /// Bytes of the output.
    pub output_bytes: Option<u64>,
}

/// What the rules say about one asset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ruled {
    /// Options of the bake.
    pub options: BakeWords,
    /// The name of the output below the folder of outputs.
    pub output: String,
    /// Whether it is left out.
    pub skip: bool,
    /// What the bake may use.
    pub budget: Budget,
}

impl Manifest {
    /// Reads a manifest; paths in it become relative to the current folder. `size` reads sizes.
    ///
    /// # Errors
    /// Fails if the file cannot be read, or is not of this form.
    pub fn read(file: &Path, size: impl Fn(&str) -> Result<u64, String>) -> Result<Manifest, String> {
        let text = std::fs::read_to_string(file).map_err(|e| e.to_string())?;
        let mut manifest: Manifest = toml::from_str(&text).map_err(|e| e.to_string())?;
        for rule in &manifest.rules {
            for (key, value) in [("max-memory", &rule.max_memory), ("max-output-bytes", &rule.max_output_bytes)] {
                value.as_deref().map(&size).transpose().map_err(|why| format!("{key} {why}"))?;
            }
            if rule.max_seconds.is_some_and(|seconds| seconds <= 0.0 || seconds.is_nan()) {
                return Err("max-seconds must be above 0".into());
            }
        }
        let folder = file.parent().unwrap_or(Path::new(""));
        let beside = |path: &Path| folder.join(path);
        let pattern = |text: &String| glob_of_folder(folder) + text;
        manifest.inputs = manifest.inputs.iter().map(pattern).collect();
        manifest.root = manifest.root.as_deref().map(beside);
        manifest.out = manifest.out.as_deref().map(beside);
        Ok(manifest)
    }

    /// Applies the rules to an asset. `given` are options that hold unless a rule says otherwise.
    pub fn ruled(&self, name: &str, given: &BakeWords, size: impl Fn(&str) -> Result<u64, String>) -> Ruled {
        let mut ruled = Ruled { options: given.clone(), output: OUTPUT.into(), ..Ruled::default() };
        let size = |text: &Option<String>| text.as_deref().and_then(|text| size(text).ok());
        for rule in self.rules.iter().filter(|rule| rule.glob.is_match(name)) {
            ruled.options.extend(rule.options.iter().map(|(option, value)| (option.clone(), value.words())));
            ruled.output = rule.output.clone().unwrap_or(ruled.output);
            ruled.skip = rule.skip.unwrap_or(ruled.skip);
            ruled.budget.seconds = rule.max_seconds.or(ruled.budget.seconds);
            ruled.budget.memory = size(&rule.max_memory).or(ruled.budget.memory);
            ruled.budget.output_bytes = size(&rule.max_output_bytes).or(ruled.budget.output_bytes);
        }
        ruled.output = named(&ruled.output, name);
        ruled
    }
}

/// A folder as the start of a pattern.
fn glob_of_folder(folder: &Path) -> String {
    match folder.to_string_lossy() {
        text if text.is_empty() => String::new(),
        text => format!("{}/", glob::Pattern::escape(&text)),
    }
}

/// Fills in the name of an output.
fn named(template: &str, asset: &str) -> String {
    let (folder, file) = asset.rsplit_once('/').unwrap_or(("", asset));
    let (stem, extension) = file.rsplit_once('.').unwrap_or((file, ""));
    let name = template.replace("{folder}", folder).replace("{stem}", stem).replace("{extension}", extension);
    name.trim_start_matches('/').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(text: &str) -> Result<u64, String> {
        text.parse().map_err(|_| "is bad".to_owned())
    }

    fn read(text: &str) -> Result<Manifest, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("raykiln.toml");
        std::fs::write(&file, text).expect("writable");
        Manifest::read(&file, size)
    }

    #[test]
    fn later_rules_override_earlier_ones_key_by_key() {
        let manifest = read(
            r#"
            inputs = ["assets/**/*.glb"]
            [[rule]]
            glob = "**"
            options = { method = "single", prune = true, keep = ["a*", "b"] }
            max-seconds = 10
            max-output-bytes = "99"
            [[rule]]
            glob = "props/*.glb"
            options = { method = "auto", effort = 3, min-area-ratio = 0.5 }
            output = "small/{folder}/{stem}.{extension}"
            [[rule]]
            glob = "props/no.glb"
            skip = true
            "#,
        )
        .expect("it is read");
        let given = BakeWords::from([("seed".into(), vec!["4".into()])]);
        let ruled = manifest.ruled("props/chair.glb", &given, size);
        let option = |name: &str| ruled.options[name].join(" ");
        let found = ["method", "prune", "keep", "effort", "min-area-ratio", "seed"].map(option);
        assert_eq!(found, ["auto", "true", "a* b", "3", "0.5", "4"]);
        assert_eq!((ruled.output.as_str(), ruled.skip), ("small/props/chair.glb", false));
        assert_eq!(
            (ruled.budget.seconds, ruled.budget.memory, ruled.budget.output_bytes),
            (Some(10.0), None, Some(99))
        );
        assert!(manifest.ruled("props/no.glb", &given, size).skip);
        let deep = manifest.ruled("props/deep/chair.obj", &given, size);
        assert_eq!(
            (deep.options["method"].join(" ").as_str(), deep.output.as_str()),
            ("single", "props/deep/chair.glb")
        );
        assert!(manifest.inputs[0].ends_with("/assets/**/*.glb"));
    }

    #[test]
    fn a_manifest_of_another_form_is_refused() {
        for text in
            ["in = 1", "[[rule]]\nglob = \"[\"", "[[rule]]\nglob = \"*\"\nmax-memory = \"x\"", "[[rule]]\nskip = true"]
        {
            assert!(read(text).is_err(), "{text}");
        }
        assert_eq!(named("{folder}/{stem}.glb", "plain"), "plain.glb");
    }
}
