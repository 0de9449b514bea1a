//! OBJ files far from the origin: every method keeps what their decimals say, and reports how far reading was off.

use crate::common::{Ran, Surface, bake, json_of, methods, raykiln};
use glam::DVec3;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A point in UTM coordinates, in metres.
const UTM: DVec3 = DVec3::new(500_000.075, 5_400_000.327, 200.073);

/// An OBJ text under construction, and its triangles as the decimals say.
#[derive(Default)]
struct Obj {
    text: String,
    vertices: Vec<DVec3>,
    triangles: Vec<[DVec3; 3]>,
}

impl Obj {
    /// Adds a vertex of three decimals; returns its number in the file.
    fn vertex(&mut self, at: DVec3) -> usize {
        let decimals = at.to_array().map(|x| format!("{x:.3}"));
        let _ = writeln!(self.text, "v {}", decimals.join(" "));
        self.vertices.push(decimals.map(|x| x.parse().unwrap()).into());
        self.vertices.len()
    }

    fn face(&mut self, corners: [usize; 3]) {
        let _ = writeln!(self.text, "f {} {} {}", corners[0], corners[1], corners[2]);
        self.triangles.push(corners.map(|c| self.vertices[c - 1]));
    }

    fn cube(&mut self, corner: DVec3, side: f64) {
        const FACES: [[usize; 4]; 6] =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let bit = |i: usize, axis: usize| f64::from(i >> axis & 1 == 1);
        let first = self.vertices.len() + 1;
        (0..8).for_each(|i| {
            self.vertex(corner + side * DVec3::new(bit(i, 0), bit(i, 1), bit(i, 2)));
        });
        for [a, b, c, d] in FACES {
            self.face([a, b, c].map(|i| first + i));
            self.face([a, c, d].map(|i| first + i));
        }
    }

    /// Forty cubes of 0.1 m over 12 m, in one object.
    fn cubes() -> Obj {
        let mut obj = Obj::default();
        for i in 0..40 {
            let at = DVec3::new(f64::from(i % 11) * 1.11, f64::from(i % 7) * 0.41, f64::from(i / 13));
            obj.cube(UTM + at, 0.1);
        }
        obj
    }

    /// A kerb of three steps, 5 cm high.
    fn kerb() -> Obj {
        let mut obj = Obj { text: "o kerb\n".into(), ..Obj::default() };
        for step in 0..6 {
            let (x, z) = (0.12 * f64::from((step + 1) / 2), 0.05 * f64::from(step / 2 + 1));
            [0.0, 2.4].into_iter().for_each(|y| {
                obj.vertex(UTM + DVec3::new(x, y, z));
            });
        }
        for step in 0..5 {
            let first = 2 * step + 1;
            obj.face([first, first + 2, first + 1]);
            obj.face([first + 1, first + 2, first + 3]);
        }
        obj
    }

    fn size(&self) -> f64 {
        let reach = |pick: fn(DVec3, DVec3) -> DVec3| self.vertices.iter().copied().reduce(pick).unwrap();
        reach(DVec3::max).distance(reach(DVec3::min))
    }

    fn write(&self, folder: &Path) -> PathBuf {
        let path = folder.join("scene.obj");
        fs::write(&path, &self.text).unwrap();
        path
    }

    /// Asserts that a file shows each triangle once, with every corner within `tolerance` of its decimals.
    fn assert_shown_by(&self, file: &Path, tolerance: f64, what: &str) {
        let mut shown = Surface::of_input(file).corners();
        assert_eq!(shown.len(), self.triangles.len(), "{what}");
        for triangle in &self.triangles {
            let off = |[a, b, c]: &[DVec3; 3]| {
                let turned = [[a, b, c], [b, c, a], [c, a, b]];
                let farthest = |t: [&DVec3; 3]| (0..3).map(|i| t[i].distance(triangle[i])).fold(0.0, f64::max);
                turned.map(farthest).into_iter().fold(f64::INFINITY, f64::min)
            };
            let nearest = (0..shown.len()).min_by(|&i, &j| off(&shown[i]).total_cmp(&off(&shown[j]))).unwrap();
            assert!(off(&shown[nearest]) <= tolerance, "{what}: {triangle:?} is {} off", off(&shown[nearest]));
            shown.swap_remove(nearest);
        }
    }
}

fn verify(before: &Path, after: &Path) -> Ran {
    let (before, after) = (before.to_str().unwrap(), after.to_str().unwrap());
    let fixed = ["--match", "identity", "--device", "cpu", "--rays", "1000", "--repeats", "1", "--json"];
    raykiln([&["verify", before, after][..], &fixed].concat())
}

#[test]
fn every_method_keeps_each_corner_where_its_decimals_put_it() {
    for (name, obj) in [("cubes", Obj::cubes()), ("kerb", Obj::kerb())] {
        let folder = TempDir::new().unwrap();
        let input = obj.write(folder.path());
        let output = folder.path().join("out.glb");
        for method in methods().into_iter().chain(["auto"]) {
            let report = bake(&input, &output, &["--method", method]);
            obj.assert_shown_by(&output, 1e-6 * obj.size().min(1.0), &format!("{name} {method}"));
            let read = &report["input"]["reading_error"];
            let ratio = read["ratio_of_object"].as_f64().expect("a ratio");
            assert!(ratio > 0.0 && ratio < 1e-7 && read["max"].as_f64() < Some(1e-6), "{name} {method}: {read}");
            assert!(report["verify"]["position_error_ratio"].as_f64() < Some(1.2e-7), "{name} {method}");
        }
    }
}

#[test]
fn verify_holds_a_file_against_the_decimals() {
    let folder = TempDir::new().unwrap();
    let obj = Obj::cubes();
    let input = obj.write(folder.path());
    let output = folder.path().join("out.glb");
    bake(&input, &output, &["--method", "keep"]);
    let ran = verify(&input, &output);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let report = ran.json();
    let error = report["verify"]["structure"]["max_position_error"].as_f64().expect("an error");
    let read = report["input"]["reading_error"]["max"].as_f64().expect("an error");
    // What is kept is off by what reading cost, up to the rounding of places in double precision.
    assert!(read > 1e-8 && (error - read).abs() < 1e-8, "{error} {read}");

    // As any reader that rounds to single precision would have it.
    let rounded = folder.path().join("rounded.obj");
    let mut text = String::new();
    for line in obj.text.lines() {
        match line.strip_prefix("v ") {
            Some(numbers) => {
                let numbers = numbers.split(' ').map(|x| f64::from(x.parse::<f32>().unwrap()).to_string());
                let _ = writeln!(text, "v {}", numbers.collect::<Vec<_>>().join(" "));
            }
            None => text += &format!("{line}\n"),
        }
    }
    fs::write(&rounded, text).unwrap();
    let ran = verify(&input, &rounded);
    assert_eq!(ran.status, 1, "{}", ran.stdout);
    let structure = &ran.json()["verify"]["structure"];
    let counts = ["moved", "missing", "flipped"].map(|fault| structure[fault]["count"].as_u64().expect("a number"));
    assert_eq!(counts.iter().sum::<u64>(), obj.triangles.len() as u64, "{counts:?}");
}

#[test]
fn parts_of_one_surface_stay_joined_500_km_from_the_origin() {
    let (mut obj, count) = (Obj { text: "o wall\n".into(), ..Obj::default() }, 12);
    for i in 0..count {
        let at = |y: f64| UTM + DVec3::new(0.13 * i as f64, y, 0.01 * (i * i) as f64);
        [0.0, 0.37].into_iter().for_each(|y| {
            obj.vertex(at(y));
        });
    }
    for i in 0..count - 1 {
        let _ = writeln!(obj.text, "usemtl {}", if i < count / 2 { "left" } else { "right" });
        let first = 2 * i + 1;
        obj.face([first, first + 2, first + 1]);
        obj.face([first + 1, first + 2, first + 3]);
    }
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("out.glb");
    bake(&obj.write(folder.path()), &output, &["--method", "keep"]);
    let json = json_of(&output);
    let placed: Vec<_> = json["nodes"].as_array().unwrap().iter().filter(|n| n["mesh"].is_u64()).collect();
    assert_eq!(placed.len(), 2);
    assert!(placed[0]["translation"].is_array());
    assert_eq!(placed[0]["translation"], placed[1]["translation"]);
    // The two vertices of the seam occur on both sides, bit for bit alike.
    let corners = Surface::of_input(&output).corners();
    let mut distinct: Vec<[u64; 3]> = corners.iter().flatten().map(|p| p.to_array().map(f64::to_bits)).collect();
    distinct.sort_unstable();
    distinct.dedup();
    assert_eq!(distinct.len(), 2 * count);
}

#[test]
fn a_limit_of_zero_refuses_nothing_that_reading_alone_moved() {
    let mut obj = Obj::default();
    obj.cube(DVec3::new(0.123, 0.457, -0.789), 0.3);
    obj.text += "o other\n";
    obj.cube(DVec3::new(5.123, 4.457, -0.789), 0.1);
    let folder = TempDir::new().unwrap();
    let (input, output) = (obj.write(folder.path()), folder.path().join("out.glb"));
    for method in methods() {
        let report = bake(&input, &output, &["--method", method, "--max-position-error-ratio", "0"]);
        let [error, read] =
            [&report["verify"]["structure"]["max_position_error"], &report["input"]["reading_error"]["max"]]
                .map(|error| error.as_f64().expect("an error"));
        assert!(error > 0.0 && error <= read + 1e-14, "{method}: {error} {read}");
    }
}

#[test]
fn decimals_that_single_precision_holds_cost_nothing() {
    let mut obj = Obj::default();
    obj.cube(DVec3::new(0.5, 0.25, -1.0), 2.0);
    let folder = TempDir::new().unwrap();
    let report = bake(&obj.write(folder.path()), &folder.path().join("out.glb"), &["--method", "single"]);
    assert!(report["input"]["reading_error"].is_null());
    assert_eq!(report["verify"]["position_error_ratio"], 0.0);
}
