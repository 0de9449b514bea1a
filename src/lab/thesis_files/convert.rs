//! Converts scene and environment files to TOML and back.

use std::fs;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use super::{Section, SettingsFile, Sort, lines, read_sections, sections};
use crate::lab::LabError;
use crate::lab::config::Source;

/// What was converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Converted {
    /// Comments, which are not carried over.
    pub comments: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sections {
    #[serde(default)]
    scene: Vec<Spanned<Section>>,
    #[serde(default)]
    env: Vec<Spanned<Section>>,
}

/// Converts a `.scn` or `.env` file to a `.toml` file or back, by the extensions. What the file says stays the same;
/// comments are lost.
///
/// # Errors
/// Fails if the extensions are not one of `.scn` and `.env`, and `.toml`, if the input is wrong, if the output cannot
/// state it, or if the output cannot be written. Then nothing is written.
pub fn convert(input: &Path, output: &Path) -> Result<Converted, LabError> {
    let is_toml = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let text = fs::read_to_string(input).map_err(|e| LabError::file(input, e))?;
    let (text, comments) = match (Sort::of(input), Sort::of(output)) {
        (Some(sort), None) if is_toml(output) => {
            let (file, comments) = lines::parse(sort, input, &text)?;
            (sections::write(&[file]), comments)
        }
        (None, Some(sort)) if is_toml(input) => {
            let comments = text.lines().filter(|line| line.trim_start().starts_with('#')).count();
            (lines::write(&only(sort, input, &text)?)?, comments)
        }
        _ => return Err(LabError::file(output, "one file has to be .toml, the other .scn or .env")),
    };
    fs::write(output, text).map_err(|e| LabError::file(output, e))?;
    Ok(Converted { comments })
}

/// Returns the only section of a TOML file.
fn only(sort: Sort, path: &Path, text: &str) -> Result<SettingsFile, LabError> {
    let source = Source::new(path, text);
    let read: Sections = toml::from_str(text).map_err(|e| source.error(e.span(), e.message()))?;
    let (wanted, others) = match sort {
        Sort::Scene => (read.scene, read.env),
        Sort::Environment => (read.env, read.scene),
    };
    let extra = wanted.get(1).or(others.first());
    match (wanted.first(), extra) {
        (Some(first), None) => {
            read_sections(&source, path, sort, std::slice::from_ref(first)).map(|mut one| one.remove(0))
        }
        (_, Some(extra)) => {
            let cause = format!("a .{} file holds one section `{}` and no other", sort.extension(), sort.section());
            Err(source.error(Some(extra.span()), cause))
        }
        (None, None) => Err(LabError::file(path, format!("there is no section `[[{}]]`", sort.section()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "SCENE_NAME=a room = 3\nMODEL_FILE_NAME=room.obj\nCAMERA_POSITION=0.1 -2 3e-7\nANIMATE_CAMERA=1\n\
                         INSTANCE_COUNT=2\nANIM_INSTANCE_COUNT=1\nLIGHT_POWER=1.5\n0.5 1 2\n1 2 3\n1 0 0 0.25 4 0.125 0\n";
    const ENVIRONMENT: &str = "BUILD_FLAGS=6\nSCENE_REBUILD_INTEREVAL=8\nENVIRONMENT_NAME=multi\nSOM_THRESHOLD=0.1\n\
                               MIN_SIZE=8\nSINGLE_GAS=0\nNODES_TO_TRIS=0.001\n";

    fn parsed(sort: Sort, text: &str) -> SettingsFile {
        lines::parse(sort, Path::new("x"), text).expect("sound").0
    }

    #[test]
    fn files_survive_the_way_to_toml_and_back() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (sort, text) in [(Sort::Scene, SCENE), (Sort::Environment, ENVIRONMENT)] {
            let at = |name: &str| folder.path().join(format!("{name}.{}", sort.extension()));
            let toml = folder.path().join("x.toml");
            fs::write(at("a"), format!("# one\n{text}")).expect("writable");
            assert_eq!(convert(&at("a"), &toml).expect("sound"), Converted { comments: 1 });
            convert(&toml, &at("b")).expect("sound");
            let written = fs::read_to_string(at("b")).expect("text");
            assert_eq!(parsed(sort, &written), parsed(sort, text), "{written}");
            convert(&at("b"), &toml).expect("sound");
            convert(&toml, &at("c")).expect("sound");
            assert_eq!(fs::read_to_string(at("c")).expect("text"), written);
        }
    }

    #[test]
    fn the_misspelt_key_is_the_right_one() {
        let right = ENVIRONMENT.replace("INTEREVAL", "INTERVAL");
        assert_eq!(parsed(Sort::Environment, ENVIRONMENT), parsed(Sort::Environment, &right));
        let both = format!("{ENVIRONMENT}SCENE_REBUILD_INTERVAL=8\n");
        let error = lines::parse(Sort::Environment, Path::new("x"), &both).expect_err("twice").to_string();
        assert_eq!(error, "x:8: `SCENE_REBUILD_INTERVAL` is given twice, first in line 2");
    }

    #[test]
    fn what_only_toml_can_state_is_refused_by_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (text, words) in [
            ("[[env]]\nsom_threshold = [0.2, 0.5]\n", "x.toml:2: `SOM_THRESHOLD` has several values"),
            ("[[env]]\nmethod = 'cluster'\n", "x.toml:2: `method` cannot be stated in .env files"),
            ("[[env]]\n[[env]]\n", "x.toml:2: a .env file holds one section `env` and no other"),
            ("[[scene]]\n", "x.toml:1: a .env file holds one section"),
            ("[[env]]\nenvironment_name = \"a\\nb\"\n", "x.toml:2: `ENVIRONMENT_NAME` has line ends"),
            ("[[env]]\nwidht = 3\n", "x.toml:2: unknown key `widht` in `env`"),
            ("[[env]]\nwidth = 3.5\n", "x.toml:2: `WIDTH` is `3.5`, not an integer from 1 to 16384"),
            ("[[env]]\nwidth = []\n", "x.toml:2: `width` is an empty list"),
            ("", "x.toml: there is no section `[[env]]`"),
        ] {
            let [toml, env] = ["x.toml", "x.env"].map(|name| folder.path().join(name));
            fs::write(&toml, text).expect("writable");
            let error = convert(&toml, &env).expect_err(text).to_string();
            assert!(error.contains(words), "{error}");
            assert!(!env.exists(), "nothing is left behind");
        }
    }

    #[test]
    fn errors_name_line_and_cause() {
        for (sort, text, words) in [
            (Sort::Scene, "SCENE_NAM=x", "x:1: there is no key `SCENE_NAM` in .scn files; there are `SCENE_NAME`"),
            (Sort::Scene, "\n\nCAMERA_POI=1 2", "x:3: `CAMERA_POI` is `1 2`, not three numbers"),
            (Sort::Scene, "LIGHT_SIZE=-1", "x:1: `LIGHT_SIZE` is `-1`, not a number of at least 0"),
            (Sort::Scene, "SCENE_NAME=", "x:1: `SCENE_NAME` is ``, not a text"),
            (Sort::Scene, "1 2 3 4", "x:1: `1 2 3 4` is neither `KEY=VALUE` nor three numbers"),
            (Sort::Scene, "1 0 0 1 -1 0 0", "x:1: distance of an animation is -1"),
            (Sort::Scene, "1 0 0 1 1 1 0", "x:1: phase of an animation is 1"),
            (Sort::Scene, "INSTANCE_COUNT=2\n1 2 3", "x:1: `INSTANCE_COUNT` is 2, but the file lists 1 positions"),
            (
                Sort::Scene,
                "INSTANCE_COUNT=1\nANIM_INSTANCE_COUNT=2",
                "x:2: `ANIM_INSTANCE_COUNT` is 2, more than the 1",
            ),
            (Sort::Environment, "WIDTH=0", "x:1: `WIDTH` is `0`, not an integer from 1 to 16384"),
            (Sort::Environment, "BUILD_FLAGS=12", "x:1: `BUILD_FLAGS` is `12`, not a sum of build flags"),
            (Sort::Environment, "USE_BVH=yes", "x:1: `USE_BVH` is `yes`, not 0 or 1"),
            (Sort::Environment, "SOM_THRESHOLD=NaN", "x:1: `SOM_THRESHOLD` is `NaN`, not a number of at least 0"),
            (Sort::Environment, "SCENE_NAME=x", "x:1: there is no key `SCENE_NAME` in .env files"),
        ] {
            let error = lines::parse(sort, Path::new("x"), text).expect_err(text).to_string();
            assert!(error.starts_with(words), "{error}");
        }
    }
}
