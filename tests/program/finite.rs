//! Every number in every JSON report is finite. JSON has no word for the others: they would be written as `null`, which
//! the schemas allow only where a value may be absent; [`Ran::json`](crate::common::Ran::json) checks that.

use crate::common::{bake, methods, raykiln};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Two objects of some triangles each, as an OBJ with one vertex per line.
fn obj(folder: &Path, name: &str, vertices: &[[f64; 3]]) -> PathBuf {
    let half = vertices.len() / 6 * 3;
    let mut text = String::new();
    for (i, [x, y, z]) in vertices.iter().enumerate() {
        if i == 0 || i == half {
            text += &format!("o object{i}\n");
        }
        text += &format!("v {x:e} {y:e} {z:e}\n");
        if i % 3 == 2 {
            text += &format!("f {} {} {}\n", i - 1, i, i + 1);
        }
    }
    let file = folder.join(format!("{name}.obj"));
    fs::write(&file, text).expect("a file");
    file
}

/// Twelve triangles in two heaps.
fn heaps(scale: f64, offset: f64) -> Vec<[f64; 3]> {
    let corner = |i: usize| [(i * 5 % 7) as f64, (i * 3 % 11) as f64, (i * 7 % 13) as f64].map(|x| scale * x + offset);
    (0..36).map(corner).collect()
}

/// Scenes whose areas, ratios or costs could be divisions by zero or overflow.
fn extremes() -> Vec<(&'static str, Vec<[f64; 3]>)> {
    let mut far = heaps(1.0, 0.0);
    far.extend(heaps(1.0, 1e11));
    let mut domed = heaps(1.0, 0.0);
    domed.extend([[-1e9, -1e9, -1e9], [1e9, -1e9, 0.0], [1e9, 1e9, 1e9]]);
    let flat = heaps(1.0, 0.0).iter().map(|p| [p[0], p[1], 0.0]).collect();
    let line = heaps(1.0, 0.0).iter().map(|p| [p[0], 0.0, 0.0]).collect();
    let point = vec![[1.0, 2.0, 3.0]; 12];
    vec![
        ("huge", heaps(1e30, 0.0)),
        ("tiny", heaps(1e-30, 0.0)),
        ("denormal", heaps(1e-41, 0.0)),
        ("far", far),
        ("domed", domed),
        ("flat", flat),
        ("line", line),
        ("point", point),
    ]
}

#[test]
fn every_number_of_inspect_bake_and_verify_is_finite() {
    let folder = TempDir::new().expect("a folder");
    for (name, vertices) in extremes() {
        let input = obj(folder.path(), name, &vertices);
        let inspected = raykiln(["inspect", input.to_str().expect("UTF-8"), "--json"]);
        assert_eq!(inspected.status, 0, "{name}: {}", inspected.stderr);
        assert!(inspected.json()["before"]["core_overlap_ratio"].is_number(), "{name}");
        for method in methods() {
            let output = folder.path().join(format!("{name}-{method}.glb"));
            let report = bake(&input, &output, &["--method", method]);
            assert_ne!(report["verdict"], "failed", "{name} {method}");
        }
        let output = folder.path().join(format!("{name}-overlap.glb"));
        let files = [&input, &output].map(|file| file.to_str().expect("UTF-8"));
        let verified = raykiln(["verify", files[0], files[1], "--json", "--device", "cpu", "--rays", "2000"]);
        assert!(verified.status <= 1, "{name}: {}", verified.stderr);
        assert_eq!(verified.json()["schema"], "raykiln.verify/1", "{name}");
    }
}
