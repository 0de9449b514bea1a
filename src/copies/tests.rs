//! Generated classes of copies, and of meshes that are not copies.

use std::f64::consts::TAU;

use fastrand::Rng;
use glam::{DAffine3, DQuat, DVec3, dvec3};
use raykiln_formats::Document;
use raykiln_formats::document::Kind;
use serde_json::{Value, json};

use super::*;
use crate::scene::{self, LoadOptions, TriangleRef};

/// A mesh to write.
#[derive(Clone, Default)]
struct Solid {
    positions: Vec<DVec3>,
    /// As many as positions, or none.
    normals: Vec<DVec3>,
    texcoords: Vec<[f32; 2]>,
    triangles: Vec<[usize; 3]>,
    material: usize,
    extras: Value,
}

impl Solid {
    fn new(positions: Vec<DVec3>, triangles: Vec<[usize; 3]>) -> Solid {
        Solid { positions, triangles, ..Solid::default() }
    }

    /// Gives each triangle its own corners, normals and texture coordinates.
    fn with_attributes(self) -> Solid {
        let mut full = Solid { material: self.material, ..Solid::default() };
        for (i, t) in self.triangles.iter().enumerate() {
            let corners = t.map(|v| self.positions[v]);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            full.positions.extend(corners);
            full.normals.extend([normal; 3]);
            let u = i as f32 / 64.0;
            full.texcoords.extend([[u, 0.0], [u, 1.0], [u, 0.5]]);
            full.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        full
    }

    fn moved(mut self, by: &DAffine3) -> Solid {
        let mirrored = by.matrix3.determinant() < 0.0;
        self.positions.iter_mut().for_each(|p| *p = by.transform_point3(*p).as_vec3().as_dvec3());
        self.normals.iter_mut().for_each(|n| *n = by.transform_vector3(*n).normalize_or_zero().as_vec3().as_dvec3());
        if mirrored {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        self
    }

    /// Shuffles vertices, triangles and the corners of each.
    fn shuffled(&self, random: &mut Rng) -> Solid {
        let mut order: Vec<usize> = (0..self.positions.len()).collect();
        random.shuffle(&mut order);
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(new, &old)| place[old] = new);
        let pick = |list: &[DVec3]| if list.is_empty() { Vec::new() } else { order.iter().map(|&v| list[v]).collect() };
        let mut solid = Solid { positions: pick(&self.positions), normals: pick(&self.normals), ..self.clone() };
        if !self.texcoords.is_empty() {
            solid.texcoords = order.iter().map(|&v| self.texcoords[v]).collect();
        }
        for t in &mut solid.triangles {
            *t = t.map(|v| place[v]);
            t.rotate_left(random.usize(..3));
        }
        random.shuffle(&mut solid.triangles);
        solid
    }
}

fn blob(random: &mut Rng) -> Solid {
    let point = |r: &mut Rng| dvec3(r.f64(), r.f64(), r.f64()).as_vec3().as_dvec3();
    let positions: Vec<DVec3> = (0..40).map(|_| point(random)).collect();
    Solid::new(positions, (0..60).map(|_| [(); 3].map(|()| random.usize(..40))).collect())
}

fn cube() -> Solid {
    let corner = |i: usize| dvec3((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) - 0.5;
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Solid::new((0..8).map(corner).collect(), triangles)
}

/// A tube of `n` sides, or with more rings in the profile, any surface of revolution.
fn turned(n: usize, profile: &[(f64, f64)]) -> Solid {
    let at = |ring: usize, i: usize| {
        let (radius, height) = profile[ring];
        let angle = TAU * i as f64 / n as f64;
        dvec3(radius * angle.cos(), radius * angle.sin(), height)
    };
    let positions = (0..profile.len()).flat_map(|ring| (0..n).map(move |i| at(ring, i))).collect();
    let quad = |ring: usize, i: usize| {
        let [a, b, c, d] = [ring * n + i, ring * n + (i + 1) % n, (ring + 1) * n + (i + 1) % n, (ring + 1) * n + i];
        [[a, b, c], [a, c, d]]
    };
    let triangles = (0..profile.len() - 1).flat_map(|ring| (0..n).flat_map(move |i| quad(ring, i))).collect();
    Solid::new(positions, triangles)
}

fn sphere() -> Solid {
    let profile: Vec<(f64, f64)> = (0..=8).map(|i| (TAU * f64::from(i) / 16.0).sin_cos()).collect();
    turned(16, &profile)
}

fn plane() -> Solid {
    let positions = (0..36).map(|i| dvec3(f64::from(i % 6), f64::from(i / 6), 0.0)).collect();
    let quad = |i: usize| {
        let at = i / 5 * 6 + i % 5;
        [[at, at + 1, at + 7], [at, at + 7, at + 6]]
    };
    Solid::new(positions, (0..25).flat_map(quad).collect())
}

fn shapes() -> Vec<(&'static str, Solid)> {
    let mut random = Rng::with_seed(1);
    vec![
        ("blob", blob(&mut random)),
        ("cube", cube()),
        ("prism", turned(5, &[(1.0, 0.0), (1.0, 2.0)])),
        ("cylinder", turned(24, &[(1.0, -1.0), (1.0, 1.0)])),
        ("cone", turned(12, &[(1.0, 0.0), (0.0, 1.0)])),
        ("sphere", sphere()),
        ("plane", plane()),
        ("triangle", Solid::new(vec![DVec3::ZERO, DVec3::X, dvec3(0.3, 0.7, 0.0)], vec![[0, 1, 2]])),
        ("regular triangle", turned(3, &[(1.0, 0.0), (0.0, 0.0)])),
    ]
}

/// Accessors, views and bytes of a document under construction.
#[derive(Default)]
struct Writer {
    accessors: Vec<Value>,
    views: Vec<Value>,
    bytes: Vec<u8>,
}

impl Writer {
    fn push(&mut self, data: &[u8], component: u32, kind: &str, count: usize) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": data.len()}));
        self.bytes.extend(data);
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": component, "count": count, "type": kind
        }));
        self.accessors.len() - 1
    }

    fn vectors(&mut self, list: &[DVec3]) -> usize {
        let data: Vec<[f32; 3]> = list.iter().map(|p| p.as_vec3().to_array()).collect();
        self.push(bytemuck::cast_slice(&data), 5126, "VEC3", list.len())
    }

    fn mesh(&mut self, solid: &Solid) -> Value {
        let mut attributes = json!({"POSITION": self.vectors(&solid.positions)});
        if !solid.normals.is_empty() {
            attributes["NORMAL"] = self.vectors(&solid.normals).into();
        }
        if !solid.texcoords.is_empty() {
            let data = bytemuck::cast_slice(&solid.texcoords);
            attributes["TEXCOORD_0"] = self.push(data, 5126, "VEC2", solid.texcoords.len()).into();
        }
        let indices: Vec<u32> = solid.triangles.iter().flatten().map(|&v| v as u32).collect();
        let indices = self.push(bytemuck::cast_slice(&indices), 5125, "SCALAR", indices.len());
        let mut mesh =
            json!({"primitives": [{"attributes": attributes, "indices": indices, "material": solid.material}]});
        if !solid.extras.is_null() {
            mesh["extras"] = solid.extras.clone();
        }
        mesh
    }
}

/// A document that places each mesh once, with the identity.
fn document(solids: &[Solid]) -> Document {
    let mut writer = Writer::default();
    let meshes: Vec<Value> = solids.iter().map(|s| writer.mesh(s)).collect();
    // Placed by different transforms, solids that share corners are not connected.
    let place = |mesh: usize| json!({"mesh": mesh, "translation": [mesh as f64 / 1024.0, 0.0, 0.0]});
    let nodes: Vec<Value> = (0..solids.len()).map(place).collect();
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}],
        "nodes": nodes, "meshes": meshes, "materials": [{"name": "a"}, {"name": "b"}],
        "accessors": writer.accessors, "bufferViews": writer.views, "buffers": [{"byteLength": writer.bytes.len()}]
    });
    let buffers = vec![writer.bytes.into()];
    Document {
        json,
        buffers,
        path: "test.gltf".into(),
        kind: Kind::Gltf,
        warnings: Vec::new(),
        in_memory: None,
        residuals: Default::default(),
        sidecar: None,
    }
}

const RIGID: Options = Options {
    likeness: Likeness::Rigid,
    materials: Materials::Same,
    max_position_error_ratio: 1e-6,
    least_saved_bytes: 0,
};
const EXACT: Options = Options { likeness: Likeness::Exact, ..RIGID };

fn load(doc: &Document) -> Scene {
    scene::load(doc, &LoadOptions::default()).expect("the document is sound").0
}

/// Returns the copies among some meshes; asserts that their stand-ins show the same triangles.
fn copies(solids: &[Solid], options: &Options) -> Copies {
    copies_in(&document(solids), options)
}

fn copies_in(doc: &Document, options: &Options) -> Copies {
    let before = load(doc);
    let found = find(doc, &before, options);
    let scene = before.overlaid(&found.overlay(&before));
    assert_eq!(scene.check(), Ok(()));
    let limit = options.max_position_error_ratio * before.bounds().diagonal();
    for i in 0..scene.instances.len() as u32 {
        for triangle in 0..scene.mesh_of(crate::scene::InstanceId(i)).triangle_count() as u32 {
            let at = TriangleRef { instance: i, triangle };
            let origin = TriangleRef { instance: i, triangle: scene.origin(at).triangle };
            let (now, then) = (scene.world_corners(at), before.world_corners(origin));
            let near = |turn: usize| (0..3).all(|c| now[c].distance(then[(c + turn) % 3]) <= limit);
            assert!((0..3).any(near), "{now:?} stands in for {then:?}");
        }
    }
    found
}

fn any_motion(random: &mut Rng, side: f64) -> DAffine3 {
    let turn = DQuat::from_xyzw(random.f64() - 0.5, random.f64() - 0.5, random.f64() - 0.5, random.f64() + 0.1);
    let place = 3.0 * dvec3(random.f64(), random.f64(), random.f64());
    let scale = 0.5 + random.f64();
    DAffine3::from_scale_rotation_translation(dvec3(scale * side, scale, scale), turn.normalize(), place)
}

/// Returns all kinds of copies of a mesh.
fn variants(solid: &Solid, random: &mut Rng) -> Vec<(&'static str, Solid)> {
    let turn = DAffine3::from_quat(DQuat::from_axis_angle(dvec3(1.0, 2.0, 3.0).normalize(), 1.0));
    let [motion, mirroring] = [1.0, -1.0].map(|side| any_motion(random, side));
    let moved = |by: &DAffine3| solid.clone().moved(by);
    vec![
        ("identical", solid.clone()),
        ("in another order", solid.shuffled(random)),
        ("moved", moved(&DAffine3::from_translation(dvec3(1.0, 2.0, 3.0)))),
        ("turned", moved(&turn)),
        ("turned by a quarter", moved(&DAffine3::from_rotation_z(TAU / 4.0))),
        ("scaled", moved(&DAffine3::from_scale(DVec3::splat(1.7)))),
        ("mirrored", moved(&DAffine3::from_scale(dvec3(1.0, -1.0, 1.0)))),
        ("turned, moved and scaled", moved(&motion)),
        ("turned, moved, scaled and mirrored", moved(&mirroring)),
        ("turned in another order", moved(&motion).shuffled(random)),
        ("mirrored in another order", moved(&mirroring).shuffled(random)),
    ]
}

#[test]
fn every_copy_is_found() {
    let mut random = Rng::with_seed(2);
    for (name, solid) in shapes() {
        for (kind, base) in [("plain", solid.clone()), ("with attributes", solid.clone().with_attributes())] {
            for (way, copy) in variants(&base, &mut random) {
                let found = copies(&[base.clone(), copy], &RIGID);
                assert_eq!(found.list.len(), 1, "{name} {kind}, {way}");
            }
        }
    }
}

#[test]
fn copies_of_many_kinds_in_one_file_find_their_own_model() {
    let mut random = Rng::with_seed(3);
    let mut solids = Vec::new();
    let mut class = Vec::new();
    for (number, (_, solid)) in shapes().into_iter().enumerate() {
        for (_, variant) in variants(&solid.with_attributes(), &mut random) {
            solids.push(variant);
            class.push(number);
        }
    }
    let found = copies(&solids, &RIGID);
    assert_eq!(Count::of(&found.list).models, shapes().len());
    assert_eq!(found.list.len(), solids.len() - shapes().len());
    assert!(found.list.iter().all(|c| class[c.mesh.0 as usize] == class[c.model.0 as usize]));
}

#[test]
fn exact_copies_are_those_that_need_no_motion() {
    let mut random = Rng::with_seed(4);
    for (name, solid) in shapes() {
        let base = solid.with_attributes();
        for (way, copy) in variants(&base, &mut random) {
            let found = copies(&[base.clone(), copy], &EXACT);
            let expected = ["identical", "in another order"].contains(&way);
            assert_eq!(found.list.len(), usize::from(expected), "{name}, {way}");
            assert!(found.list.iter().all(|c| c.motion == DAffine3::IDENTITY));
        }
    }
}

#[test]
fn what_is_left_out_is_looked_through_for_exact_copies_of_it_and_of_its_model() {
    let mut random = Rng::with_seed(5);
    let base = blob(&mut random).with_attributes();
    let turned = base.clone().moved(&any_motion(&mut random, 1.0));
    let solids = [base.clone(), turned.clone(), turned.shuffled(&mut random), base.shuffled(&mut random), turned];
    let doc = document(&solids);
    let scene = load(&doc);
    let found = find(&doc, &scene, &RIGID);
    assert_eq!((found.list.len(), Count::of(&found.list).models), (4, 1));
    let exact = find_exact_among(&doc, &scene, &found.list, 1e-6);
    let pairs = |copies: &Copies| copies.list.iter().map(|c| (c.mesh.0, c.model.0)).collect::<Vec<_>>();
    let of_model = |model: u32| pairs(&exact).iter().filter(|(_, m)| *m == model).count();
    let model = found.list[0].model.0;
    assert_eq!((exact.list.len(), Count::of(&exact.list).models), (3, 2), "{:?}", pairs(&exact));
    assert!(exact.list.iter().all(|c| c.mesh.0 != model), "a model stays one");
    assert_eq!(of_model(model), if [0, 3].contains(&model) { 1 } else { 2 });
    assert!(find_exact_among(&doc, &scene, &[], 1e-6).list.is_empty());
}

#[test]
fn equal_meshes_are_found_among_many_that_nearly_resemble_them() {
    let mut random = Rng::with_seed(6);
    // Corners deviate by up to about three times the tolerance: too much for copies, too little for signatures.
    let pair = |_| {
        let mut off = || 1.5e-3 * random.f64();
        let corner = |i: u32| dvec3(2.5 * f64::from(i / 2), f64::from(i % 2) * (0.1 + off()), off());
        let positions: Vec<DVec3> = (0..6).map(corner).collect();
        [(); 2].map(|()| Solid::new(positions.clone(), vec![[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]]))
    };
    let solids: Vec<Solid> = (0..80).flat_map(pair).collect();
    let rigid = Options { max_position_error_ratio: 1e-4, ..RIGID };
    let (doc, roles) = (document(&solids), vec![Role::Any; solids.len()]);
    let scene = load(&doc);
    let all: Vec<MeshId> = (0..solids.len() as u32).map(MeshId).collect();
    let search = Search { doc: &doc, scene: &scene, options: &rigid, roles: &roles, connected: connected(&scene) };
    let groups = by_key(signature::of_all(&doc, &scene, &all, &rigid));
    assert!(groups.into_values().any(|group| search.group(group).given_up), "not all are compared");
    let [rigid, exact] = [rigid, EXACT].map(|options| find(&doc, &scene, &options));
    assert_eq!((exact.list.len(), Count::of(&exact.list).models), (80, 80));
    // Pairs that are near enough to be copies add to the number.
    let is_paired = |pair: u32| rigid.list.iter().any(|c| c.mesh.0 / 2 == pair);
    assert!(rigid.list.len() >= 80 && (0..80).all(is_paired), "{}", rigid.list.len());
}

/// Returns variants of a mesh that are not copies.
fn faults(solid: &Solid) -> Vec<(&'static str, Solid)> {
    let changed = |change: &dyn Fn(&mut Solid)| {
        let mut other = solid.clone();
        change(&mut other);
        other
    };
    let mut random = Rng::with_seed(5);
    let noise: Vec<DVec3> =
        (0..solid.positions.len()).map(|_| dvec3(random.f64(), random.f64(), random.f64()) * 2e-3).collect();
    vec![
        ("noisy", changed(&|s| s.positions.iter_mut().zip(&noise).for_each(|(p, n)| *p += *n))),
        ("one vertex off", changed(&|s| s.positions[1].x += 2e-3)),
        ("stretched", changed(&|s| s.positions.iter_mut().for_each(|p| p.x *= 1.01))),
        ("another material", changed(&|s| s.material = 1)),
        ("another texture coordinate", changed(&|s| s.texcoords[2][0] += 1e-6)),
        ("texture coordinates exchanged", changed(&|s| s.texcoords.swap(0, 3))),
        ("another normal", changed(&|s| s.normals[0] = s.normals[0].any_orthonormal_vector())),
        ("inside out", changed(&|s| s.triangles.iter_mut().for_each(|t| t.swap(1, 2)))),
        ("one triangle turned over", changed(&|s| s.triangles[0].swap(0, 1))),
        ("a triangle twice", changed(&|s| s.triangles[0] = s.triangles[1])),
        ("other extras", changed(&|s| s.extras = json!({"collides": true}))),
    ]
}

#[test]
fn what_differs_is_no_copy() {
    let mut random = Rng::with_seed(6);
    for (name, solid) in shapes().into_iter().filter(|(_, s)| s.triangles.len() > 6) {
        let base = solid.with_attributes();
        for (fault, other) in faults(&base) {
            for (way, variant) in variants(&other, &mut random) {
                let found = copies(&[base.clone(), variant], &RIGID);
                assert!(found.list.is_empty(), "{name} {fault}, {way}");
            }
        }
    }
}

#[test]
fn plain_solids_that_differ_are_no_copies() {
    let mut random = Rng::with_seed(7);
    let mut chiral = blob(&mut random);
    chiral.triangles.truncate(30);
    let mut inside_out = chiral.clone();
    inside_out.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    assert!(copies(&[chiral, inside_out.shuffled(&mut random)], &RIGID).list.is_empty());
    let mut other_diagonal = cube();
    (other_diagonal.triangles[0], other_diagonal.triangles[1]) = ([0, 4, 2], [4, 6, 2]);
    assert!(copies(&[cube(), other_diagonal], &RIGID).list.is_empty());
}

#[test]
fn noise_within_the_tolerance_makes_copies_and_beyond_it_none() {
    let mut random = Rng::with_seed(8);
    for (noise, expected) in [(0.3, 1), (6.0, 0)] {
        let base = blob(&mut random);
        let budget = 1e-6 * 2.0;
        let mut noisy = base.shuffled(&mut random).moved(&DAffine3::from_rotation_x(1.0));
        for p in &mut noisy.positions {
            *p += (dvec3(random.f64(), random.f64(), random.f64()) - 0.5).normalize() * noise * budget;
        }
        assert_eq!(copies(&[base, noisy], &RIGID).list.len(), expected, "{noise} of the budget");
    }
}

#[test]
fn normals_must_be_the_same_where_nothing_turns_and_nearly_so_where_it_does() {
    let base = cube().with_attributes();
    let mut nearly = base.clone();
    nearly.normals.iter_mut().for_each(|n| *n = (*n + DVec3::splat(1e-4)).normalize());
    assert!(copies(&[base.clone(), nearly.clone()], &RIGID).list.is_empty());
    let turned = nearly.moved(&DAffine3::from_rotation_x(0.5));
    assert_eq!(copies(&[base, turned], &RIGID).list.len(), 1);
}

#[test]
fn pinned_meshes_are_models_and_never_copies() {
    let mut doc = document(&[cube(), cube(), cube()]);
    doc.json["nodes"][1]["extensions"] = json!({"ACME_unknown": {}});
    let found = copies_in(&doc, &RIGID);
    assert_eq!(found.list.iter().map(|c| (c.mesh.0, c.model.0)).collect::<Vec<_>>(), [(0, 1), (2, 1)]);
}

#[test]
fn meshes_with_points_or_morph_targets_take_no_part() {
    let mut doc = document(&[cube(), cube()]);
    let mut points = doc.json["meshes"][1]["primitives"][0].clone();
    points["mode"] = json!(0);
    doc.json["meshes"][1]["primitives"].as_array_mut().expect("primitives").push(points);
    assert!(copies_in(&doc, &RIGID).list.is_empty());
    let mut doc = document(&[cube(), cube()]);
    doc.json["meshes"][1]["primitives"][0]["targets"] = json!([{"POSITION": 0}]);
    assert!(copies_in(&doc, &RIGID).list.is_empty());
}

#[test]
fn degenerate_meshes_are_no_trouble() {
    let point = Solid::new(vec![DVec3::ONE; 3], vec![[0, 1, 2]; 2]);
    let line = Solid::new((0..4).map(|i| DVec3::X * f64::from(i)).collect(), vec![[0, 1, 2], [1, 2, 3]]);
    let huge = cube().moved(&DAffine3::from_scale(DVec3::splat(1e30)));
    let tiny = cube().moved(&DAffine3::from_scale(DVec3::splat(1e-30)));
    assert_eq!(copies(&[point.clone(), point], &RIGID).list.len(), 1);
    assert_eq!(copies(&[line.clone(), line], &RIGID).list.len(), 1);
    assert_eq!(copies(&[huge.clone(), huge], &RIGID).list.len(), 1);
    assert_eq!(copies(&[tiny.clone(), tiny], &RIGID).list.len(), 1);
    assert_eq!(copies(&[cube()], &RIGID).list.len(), 0);
    for ratio in [0.0, f64::INFINITY, 1e300] {
        let options = Options { max_position_error_ratio: ratio, ..RIGID };
        assert_eq!(find_in(&[cube(), cube()], &options), 1, "{ratio}");
    }
}

fn find_in(solids: &[Solid], options: &Options) -> usize {
    let doc = document(solids);
    find(&doc, &load(&doc), options).list.len()
}

#[test]
fn very_many_equal_triangles_in_one_place_take_linear_time() {
    let mut random = Rng::with_seed(9);
    let mut solid = blob(&mut random);
    solid.triangles.extend(vec![solid.triangles[0]; 20_000]);
    let copy = solid.shuffled(&mut random).moved(&DAffine3::from_rotation_x(1.0));
    assert_eq!(find_in(&[solid, copy], &RIGID), 1);
}

#[test]
fn the_copies_are_the_same_for_any_number_of_threads() {
    let mut random = Rng::with_seed(10);
    let solids: Vec<Solid> = (0..60)
        .map(|i| cube().moved(&any_motion(&mut random, if i % 2 == 0 { 1.0 } else { -1.0 })).shuffled(&mut random))
        .collect();
    let doc = document(&solids);
    let scene = load(&doc);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| format!("{:?}", find(&doc, &scene, &RIGID)))
    };
    assert_eq!(with(1), with(3));
    assert_eq!(find(&doc, &scene, &RIGID).list.len(), 59);
}
