//! `bake --export-candidates`, `time` and `bake --plan`: layouts written by one machine, timed by another, chosen by a third.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::schema::assert_conforms;
use crate::common::{Ran, folder_names, raykiln, samples};
use serde_json::Value;
use tempfile::TempDir;

/// Part of the name of Mesa's software driver, which `tests/install_vulkan.sh` installs.
#[cfg(feature = "vulkan")]
const SOFTWARE: &str = "llvmpipe";
const FEW_RAYS: [&str; 6] = ["--rays", "500", "--repeats", "3", "--views", "2"];

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// Exports the candidates of a sample to `candidates` of a folder.
fn export(scene: &Path, folder: &Path, more: &[&str]) -> Ran {
    let (output, to) = (folder.join("out.glb"), folder.join("candidates"));
    let fixed = ["bake", text(scene), "-o", text(&output), "--export-candidates", text(&to)];
    raykiln(fixed.iter().chain(&["--device", "cpu", "--quiet"]).chain(&FEW_RAYS).chain(more))
}

fn follow(scene: &Path, output: &Path, plan: &Path) -> Ran {
    raykiln(["bake", text(scene), "-o", text(output), "--plan", text(plan), "--device", "cpu", "--quiet"])
}

fn list(folder: &Path) -> Value {
    let text = fs::read_to_string(folder.join("candidates/candidates.json")).expect("there is a list");
    let list = serde_json::from_str(&text).expect("JSON");
    assert_conforms(&list);
    list
}

#[test]
fn each_candidate_is_written_as_its_plan_would_write_it() {
    for name in ["overlapping", "copies"] {
        let folder = TempDir::new().expect("a folder");
        let ran = export(&sample(name), folder.path(), &["--effort", "2", "--max-bytes-ratio", "9"]);
        assert_eq!(ran.status, 0, "{}", ran.stderr);
        let list = list(folder.path());
        let candidates = list["candidates"].as_array().expect("candidates");
        assert!(candidates.len() > 2 && candidates[0]["name"] == "keep", "{name}: {list}");
        assert_eq!(folder_names(&folder.path().join("candidates")).len(), 2 * candidates.len() + 1);
        for candidate in candidates {
            let of = |key: &str| folder.path().join("candidates").join(candidate[key].as_str().expect("a name"));
            let again = folder.path().join("again.glb");
            let ran = follow(&sample(name), &again, &of("plan"));
            assert_eq!(ran.status, 0, "{name}: {candidate}: {}", ran.stderr);
            assert!(
                fs::read(again).expect("written") == fs::read(of("file")).expect("exported"),
                "{name}: {candidate}"
            );
        }
    }
}

#[test]
fn what_cannot_be_exported_or_timed_is_refused() {
    let folder = TempDir::new().expect("a folder");
    let to = folder.path().join("candidates");
    fs::create_dir(&to).expect("created");
    fs::write(to.join("mine.txt"), "mine").expect("written");
    let refused = |ran: Ran, words: &str| {
        assert_eq!(ran.status, 2, "{words}: {}", ran.stderr);
        assert!(ran.stderr.contains(words), "{words}: {}", ran.stderr);
    };
    let scene = sample("overlapping");
    refused(export(&scene, folder.path(), &[]), "is not a folder of candidates");
    assert_eq!(folder_names(folder.path()), ["candidates"]);
    fs::remove_dir_all(&to).expect("removed");
    refused(export(&scene, folder.path(), &["--method", "single"]), "--method auto");
    refused(raykiln(["time", text(&to)]), "candidates.json");
    for _ in 0..2 {
        assert_eq!(export(&scene, folder.path(), &["--effort", "1"]).status, 0);
    }
    refused(raykiln(["time", text(&to), "--device", "cpu"]), "no Vulkan device");
    refused(follow(&scene, &folder.path().join("again.glb"), &to), "run `raykiln time` on it");
    assert_eq!(folder_names(folder.path()), ["candidates", "out.glb"]);
    let changed =
        fs::read_to_string(to.join("candidates.json")).expect("a list").replace("\"1.glb\"", "\"../out.glb\"");
    fs::write(to.join("candidates.json"), changed).expect("written");
    refused(raykiln(["time", text(&to)]), "outside of its folder");
}

#[cfg(feature = "vulkan")]
#[test]
fn the_winner_of_a_device_is_what_the_plan_writes() {
    let folder = TempDir::new().expect("a folder");
    let scene = sample("woven");
    assert_eq!(export(&scene, folder.path(), &["--effort", "1"]).status, 0);
    let to = folder.path().join("candidates");
    let ran = raykiln(["time", text(&to), "--device", SOFTWARE, "--json"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(ran.stderr.contains("winner: "), "{}", ran.stderr);
    let list = list(folder.path());
    assert_eq!(ran.json(), list);
    assert!(list["device"]["name"].as_str().is_some_and(|name| name.contains(SOFTWARE)), "{list}");
    let candidates = list["candidates"].as_array().expect("candidates");
    assert!(candidates[1..].iter().all(|candidate| candidate["speed"]["speedup_ratio"].as_f64() > Some(0.0)), "{list}");
    let winner = &candidates[list["winner"].as_u64().expect("a winner") as usize];
    let again = folder.path().join("again.glb");
    let ran = follow(&scene, &again, &to);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let exported = to.join(winner["file"].as_str().expect("a file"));
    assert!(fs::read(&again).expect("written") == fs::read(exported).expect("exported"), "{winner}");
    let plan: Value =
        serde_json::from_str(&fs::read_to_string(to.join("winner.plan.json")).expect("a plan")).expect("JSON");
    assert_conforms(&plan);
    assert_eq!(plan["decision"]["decided_by"], "measurement");
}
