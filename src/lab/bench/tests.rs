//! Every key of scene and environment files, by what it changes.

use std::fs;
use std::path::Path;

use tempfile::TempDir;

use super::{Bench, RunRow, Session, Setup, Subject};
use crate::lab::thesis_files::SettingsFile;
use crate::verify::build::Prefer;
use crate::verify::probe::Until;
use crate::verify::rays::shot::Light;
use crate::verify::{DeviceChoice, random::Random};

/// An OBJ file of three overlapping objects of 60 small triangles each, and one of two.
fn model() -> String {
    let mut text = String::new();
    let mut vertices = 0;
    for (object, (x, count)) in [(0.0, 60), (1.0, 60), (1.5, 60), (0.5, 2)].into_iter().enumerate() {
        text += &format!("o object{object}\n");
        for i in 0..count {
            let mut random = Random::at(7, object as u64, i);
            let [a, b, c] = [random.unit(), random.unit(), random.unit()].map(|u| 2.0 * u);
            for [dx, dy, dz] in [[0.0; 3], [0.2, 0.0, 0.1], [0.0, 0.2, 0.1]] {
                text += &format!("v {} {} {}\n", x + a + dx, b + dy, c + dz);
            }
            text += &format!("f {} {} {}\n", vertices + 1, vertices + 2, vertices + 3);
            vertices += 3;
        }
    }
    text
}

const SCENE: &str = "MODEL_FILE_NAME=model.obj\nCAMERA_POSITION=1.5 1 6\nCAMERA_POI=1.5 1 1\n";
const ENVIRONMENT: &str = "WIDTH=12\nHEIGHT=8\n";

/// Two instances, of which one flies to and fro.
const MOVING: &str = "INSTANCE_FILE_NAME=small.obj\nINSTANCE_COUNT=2\nANIM_INSTANCE_COUNT=1\n\
                      1.5 1 3\n1 1 3\n1 0 0 6 1 0.1 0.5\n";

/// Lines that are added to a scene and to an environment.
struct Files {
    folder: TempDir,
}

impl Files {
    fn new() -> Files {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("model.obj"), model()).expect("writable");
        fs::write(folder.path().join("small.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("writable");
        Files { folder }
    }

    fn read(&self, name: &str, text: &str) -> SettingsFile {
        let path = self.folder.path().join(name);
        fs::write(&path, text).expect("writable");
        SettingsFile::read(&path).expect("sound")
    }

    fn subject(&self, scene: &str) -> Subject {
        Subject::of(&self.read("x.scn", &format!("{SCENE}{scene}")), None).expect("a scene")
    }

    fn setup(&self, environment: &str) -> Setup {
        let file = self.read("x.env", &format!("{ENVIRONMENT}{environment}"));
        Setup::all_of(&file).expect("sound").remove(0)
    }

    fn run(&self, scene: &str, environment: &str) -> RunRow {
        let bench = Bench::open(&DeviceChoice::Cpu, Until::Passes(1), 1).expect("the CPU");
        let subject = self.subject(scene);
        let mut session = Session::new(&bench, &subject).expect("a scene");
        session.run(&self.setup(environment)).expect("a run")
    }
}

fn environment(text: &str) -> RunRow {
    Files::new().run("", text)
}

fn rays(row: &RunRow, kind: &str) -> u64 {
    row.kinds.get(kind).map_or(0, |run| run.rays)
}

#[test]
fn names_are_those_of_the_outputs() {
    let row = Files::new().run("SCENE_NAME=a room\n", "ENVIRONMENT_NAME=my way\n");
    assert_eq!((row.scene.as_str(), row.environment.as_str(), row.model.as_str()), ("a room", "my way", "model.obj"));
    let row = environment("");
    assert_eq!((row.scene.as_str(), row.environment.as_str()), ("model", "per-object"));
}

#[test]
fn single_gas_use_bvh_and_thresholds_choose_the_method() {
    let method = |text: &str| {
        let row = environment(text);
        (row.method, row.meshes)
    };
    assert_eq!(method("SINGLE_GAS=1\n"), ("single".into(), 1));
    assert_eq!(method("SINGLE_GAS=0\n"), ("per-object".into(), 4));
    let (bvh, pieces) = method("USE_BVH=1\nNODES_TO_TRIS=0.2\n");
    assert!(bvh == "bvh" && pieces > 4, "{pieces}");
    assert_eq!(method("USE_BVH=0\nSOM_THRESHOLD=0.5\n").0, "overlap");
}

#[test]
fn nodes_to_tris_sets_the_number_of_pieces() {
    let pieces = |ratio: &str| environment(&format!("USE_BVH=1\nNODES_TO_TRIS={ratio}\n")).meshes;
    assert!(pieces("0.001") == 4 && pieces("0.05") < pieces("0.4"));
}

#[test]
fn min_size_keeps_small_objects_whole() {
    let pieces = |size: u32| environment(&format!("USE_BVH=1\nNODES_TO_TRIS=10\nMIN_SIZE={size}\n")).meshes;
    assert!(pieces(60) == 4 && pieces(30) > 4 && pieces(4) > pieces(30));
}

#[test]
fn thresholds_of_the_overlap_reduction_change_its_layout() {
    let layout = |text: &str| {
        let row = environment(text);
        (row.meshes, row.overlap_ratio.to_bits())
    };
    let base = layout("SOM_THRESHOLD=0.5\nSKIP_OVERLAP_THRESHOLD=0.005\n");
    assert_ne!(layout("SOM_THRESHOLD=0.05\nSKIP_OVERLAP_THRESHOLD=0.005\n"), base, "more pairs merge");
    assert_ne!(layout("SOM_THRESHOLD=0.5\nSKIP_OVERLAP_THRESHOLD=0.9\n"), base, "more pairs are skipped");
    assert_ne!(
        layout("SOM_THRESHOLD=0.5\nSKIP_OVERLAP_THRESHOLD=0.005\nOVERLAP_THRESHOLD=100\n"),
        base,
        "it ends early"
    );
}

#[test]
fn the_picture_sets_the_rays() {
    let row = environment("");
    assert_eq!((row.size, rays(&row, "primary")), ([12, 8], 96));
    let (shadow, diffuse) = (rays(&row, "shadow"), rays(&row, "diffuse"));
    assert!(shadow > 0 && shadow == diffuse, "{shadow} {diffuse}");
    assert_eq!(rays(&environment("PIXEL_SAMPLES=3\n"), "primary"), 288);
    assert_eq!(rays(&environment("LIGHT_SAMPLES=2\n"), "shadow"), 2 * shadow);
    assert_eq!(rays(&environment("SECONDARY_RAYS=0\n"), "diffuse"), 0);
    assert_eq!(rays(&environment("SECONDARY_RAYS=1\n"), "diffuse"), diffuse);
}

#[test]
fn build_flags_are_those_of_optix() {
    let files = Files::new();
    let build = |flags: u32| files.setup(&format!("BUILD_FLAGS={flags}\n")).bake.verify.build;
    let of = |flags| (build(flags).prefer, build(flags).allow_update, build(flags).compact);
    assert_eq!(of(0), (Prefer::None, false, false));
    assert_eq!(of(1 + 4), (Prefer::FastTrace, true, false));
    assert_eq!(of(2 + 8), (Prefer::FastBuild, false, true));
    assert_eq!(environment("BUILD_FLAGS=10\n").build_flags, 10);
}

#[test]
fn the_tlas_is_rebuilt_every_so_many_frames_and_refitted_in_between() {
    let files = Files::new();
    let subject = files.subject(MOVING);
    let moved = |environment: &str| {
        let bench = Bench { frames: 9, ..Bench::open(&DeviceChoice::Cpu, Until::Passes(1), 1).expect("the CPU") };
        let mut session = Session::new(&bench, &subject).expect("a scene");
        let row = session.run(&files.setup(environment)).expect("a run");
        let motion = row.motion.expect("it moves");
        assert_eq!((motion.frames, motion.wrong_hits, motion.series.len()), (9, 0, 9));
        assert_eq!(motion.refit_ms.is_some(), motion.rebuilds < 9);
        assert!(motion.rebuild_ms.is_some() && motion.mrays_per_s > 0.0);
        (motion.rebuild_interval, motion.rebuilds)
    };
    assert_eq!(moved(""), (1, 9));
    assert_eq!(moved("SCENE_REBUILD_INTERVAL=4\n"), (4, 3));
    assert_eq!(moved("SCENE_REBUILD_INTEREVAL=8\n"), (8, 2));
    assert_eq!(moved("SCENE_REBUILD_INTERVAL=0\n"), (0, 1));
}

#[test]
fn what_does_not_move_has_no_frames() {
    let files = Files::new();
    let bench = Bench { frames: 3, ..Bench::open(&DeviceChoice::Cpu, Until::Passes(1), 1).expect("the CPU") };
    for scene in ["", "INSTANCE_FILE_NAME=small.obj\nINSTANCE_COUNT=1\n0 1 2\n"] {
        let subject = files.subject(scene);
        let row = Session::new(&bench, &subject).expect("a scene").run(&files.setup("")).expect("a run");
        assert_eq!(row.motion, None);
    }
}

#[test]
fn the_camera_stands_where_the_scene_says_and_turns_about_what_it_says() {
    let files = Files::new();
    let away = files.run("", "");
    let row = Files::new();
    let from_behind = "CAMERA_POSITION=1.5 1 -500\nMODEL_FILE_NAME=model.obj\nCAMERA_POI=1.5 1 -900\n";
    let subject = Subject::of(&row.read("y.scn", from_behind), None).expect("a scene");
    let bench = Bench::open(&DeviceChoice::Cpu, Until::Passes(1), 1).expect("the CPU");
    let nothing = Session::new(&bench, &subject).expect("a scene").run(&row.setup("")).expect("a run");
    assert!(rays(&away, "shadow") > 0 && rays(&nothing, "shadow") == 0, "it looks away");
    let still = files.subject("ANIMATE_CAMERA=0\nCAMERA_ROTATION_SPEED=0.1\n");
    let moving = files.subject("ANIMATE_CAMERA=1\nCAMERA_ROTATION_SPEED=0.1\n");
    let slower = files.subject("ANIMATE_CAMERA=1\nCAMERA_ROTATION_SPEED=0.05\n");
    assert_eq!((still.views.len(), moving.views.len()), (1, 8));
    assert!(moving.views[0] == still.views[0] && moving.views[3] != slower.views[3]);
}

#[test]
fn the_light_is_where_the_scene_says() {
    let subject = Files::new().subject("LIGHT_ORIGIN=1 5 2\nLIGHT_SIZE=0.5\nLIGHT_POWER=3\n");
    assert_eq!(subject.light, Some(Light { corner: glam::DVec3::new(1.0, 5.0, 2.0), size: 0.5 }));
    assert_eq!(subject.light_power, Some(3.0));
}

#[test]
fn instances_of_another_model_are_added_at_their_places() {
    let lines =
        "INSTANCE_FILE_NAME=small.obj\nINSTANCE_COUNT=2\nANIM_INSTANCE_COUNT=1\n0.5 1 2\n-9 2 3\n1 0 0 0.25 4 0.1 0\n";
    let files = Files::new();
    let row = files.run(lines, "SINGLE_GAS=1\n");
    assert_eq!((row.instances, row.added_instances, row.animated_instances), (3, 2, 1));
    let subject = files.subject(lines);
    let scene = subject.with_instances(&subject.scene);
    let box_of = |i: usize| scene.instance_boxes()[scene.instances.len() - 2 + i];
    // It moves: at the beginning it has done a tenth of its way of 4 there and back.
    assert!(box_of(0).center().distance(glam::DVec3::new(0.5 + 0.8, 1.0, 2.0)) < 1e-9);
    assert!(box_of(1).center().distance(glam::DVec3::new(-9.0, 2.0, 3.0)) < 1e-9);
    let ratio = box_of(0).diagonal() / subject.scene.bounds().diagonal();
    assert!((ratio - 0.02).abs() < 1e-6, "{ratio}");
    let one = lines.replace("COUNT=2", "COUNT=1").replace("-9 2 3\n", "");
    assert_eq!(files.run(&one, "SINGLE_GAS=1\n").instances, 2);
}

#[test]
fn lists_of_instances_may_stand_in_the_environment() {
    let files = Files::new();
    let scene = files.read("x.scn", &format!("{SCENE}INSTANCE_FILE_NAME=small.obj\nINSTANCE_COUNT=1\n"));
    let environment = files.read("x.env", "1 2 3\n");
    let subject = Subject::of(&scene, Some(&environment)).expect("a scene");
    assert_eq!(subject.instances.expect("one").copies.positions, [glam::DVec3::new(1.0, 2.0, 3.0)]);
}

#[test]
fn scenes_that_lack_something_are_refused_with_the_line() {
    let files = Files::new();
    for (text, words) in [
        ("SCENE_NAME=x", "x.scn:1: `MODEL_FILE_NAME` is missing"),
        ("MODEL_FILE_NAME=no.obj", "no.obj"),
        ("MODEL_FILE_NAME=model.obj\nINSTANCE_COUNT=3", "x.scn:2: `INSTANCE_FILE_NAME` is missing"),
        (
            "MODEL_FILE_NAME=model.obj\nINSTANCE_FILE_NAME=small.obj\nINSTANCE_COUNT=3",
            "x.scn:3: `INSTANCE_COUNT` is 3, but 0 positions are listed",
        ),
        ("MODEL_FILE_NAME=model.obj\nCAMERA_POI=1 2 3\nCAMERA_POSITION=1 2 3", "x.scn:3: the camera looks nowhere"),
    ] {
        let file = files.read("x.scn", text);
        let error = Subject::of(&file, None).err().expect(text).to_string();
        assert!(error.contains(words), "{error}");
    }
    let large = files.read("x.env", "WIDTH=16384\nHEIGHT=16384\n");
    assert!(Setup::all_of(&large).expect_err("too large").to_string().contains("x.env:1: the picture takes 268435456"));
}

#[test]
fn lists_of_values_are_swept_in_order() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("x.toml");
    let text = "[[env]]\nsom_threshold = [0.2, 0.8]\nmethod = ['overlap', 'cluster']\nwidth = 4\n";
    let setups = read_toml(&path, text);
    let words: Vec<Vec<String>> =
        setups.iter().map(|setup| setup.swept.iter().map(|(_, value)| value.clone()).collect()).collect();
    assert_eq!(words, [["0.2", "overlap"], ["0.2", "cluster"], ["0.8", "overlap"], ["0.8", "cluster"]]);
    assert_eq!(setups[2].bake.choose.layout.overlap.split_or_merge_ratio, 0.8);
    assert_eq!(setups[3].bake.choose.method.name(), "cluster");
}

fn read_toml(path: &Path, text: &str) -> Vec<Setup> {
    use crate::lab::config::Source;
    use crate::lab::thesis_files::{Section, Sort, read_sections};
    #[derive(serde::Deserialize)]
    struct File {
        env: Vec<toml::Spanned<Section>>,
    }
    let file: File = toml::from_str(text).expect("TOML");
    let sections = read_sections(&Source::new(path, text), path, Sort::Environment, &file.env).expect("sound");
    Setup::all_of(&sections[0]).expect("sound")
}
