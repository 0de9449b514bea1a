//! Benchmarks of the metrics.

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DAffine3, DVec3, Vec3, dvec3};
use raykiln::cost::{measure, overlap};
use raykiln::layout::{Content, Group, Layout, Placement};
use raykiln::scene::{Bounds, Geometry, Instance, InstanceId, Mesh, MeshId, Scene};

/// A reproducible pseudo-random number from 0 to 1 for each index.
fn noise(index: u32) -> f64 {
    let mixed = (index ^ (index >> 16)).wrapping_mul(0x045d_9f3b);
    let mixed = (mixed ^ (mixed >> 16)).wrapping_mul(0x045d_9f3b);
    f64::from(mixed ^ (mixed >> 16)) / f64::from(u32::MAX)
}

fn noise3(index: u32) -> DVec3 {
    dvec3(noise(3 * index), noise(3 * index + 1), noise(3 * index + 2))
}

/// Boxes in the unit cube with edges up to `size`.
fn boxes(count: u32, size: f64) -> Vec<Bounds> {
    let at = |i| Bounds { min: noise3(i), max: noise3(i) + size * noise3(i + count) };
    (0..count).map(at).collect()
}

/// A wavy sheet of `2 * n * n` triangles.
fn sheet(n: u32) -> Mesh {
    let vertex = |i: u32| {
        let (x, y) = ((i % (n + 1)) as f32 / n as f32, (i / (n + 1)) as f32 / n as f32);
        Vec3::new(x, y, 0.2 * (9.0 * x).sin() * (7.0 * y).cos())
    };
    let square = |i: u32| {
        let a = i / n * (n + 1) + i % n;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    let geometry = Geometry {
        positions: (0..(n + 1) * (n + 1)).map(vertex).collect(),
        triangles: (0..n * n).flat_map(square).collect(),
        ..Geometry::default()
    };
    Mesh { geometries: vec![geometry], ..Mesh::default() }
}

/// Rotated and translated instances of `meshes` sheets of `2 * n * n` triangles, in the layout of the input.
fn sheets(meshes: u32, n: u32, instances: u32) -> (Scene, Layout) {
    let turned = |i: u32| DAffine3::from_rotation_z(6.0 * noise(i)) * DAffine3::from_rotation_x(6.0 * noise(i + 1));
    let instance = |i: u32| Instance {
        name: String::new(),
        node: i,
        copy: 0,
        mesh: MeshId(i % meshes),
        transform: DAffine3::from_translation(20.0 * noise3(i)) * turned(i),
        pinned: None,
    };
    let group = |m| Group { name: String::new(), content: Content::Kept(MeshId(m)) };
    let scene = Scene {
        meshes: (0..meshes).map(|_| sheet(n)).collect::<Vec<_>>().into(),
        instances: (0..instances).map(instance).collect(),
        ..Scene::default()
    };
    let place = |(i, instance): (usize, &Instance)| Placement {
        group: instance.mesh.0,
        instance: Some(InstanceId(i as u32)),
        transform: instance.transform,
    };
    let layout = Layout {
        groups: (0..meshes).map(group).collect(),
        placements: scene.instances.iter().enumerate().map(place).collect(),
        ..Layout::default()
    };
    (scene, layout)
}

fn metrics(c: &mut Criterion) {
    let mut group = c.benchmark_group("cost");
    group.sample_size(10);
    for size in [0.02, 0.1] {
        let boxes = boxes(100_000, size);
        let pairs = overlap::pairs(&boxes, 0.0).len();
        group.bench_function(format!("overlap ratio, 100,000 boxes, {pairs} pairs"), |b| {
            b.iter(|| overlap::ratio(&boxes));
        });
    }
    let equal = vec![Bounds { min: DVec3::ZERO, max: DVec3::ONE }; 1_000_000];
    group.bench_function("overlap ratio, 1,000,000 equal boxes", |b| b.iter(|| overlap::ratio(&equal)));
    let (scene, layout) = sheets(100, 64, 10_000);
    group.bench_function("measure, 10,000 instances of 100 meshes of 8,192 triangles", |b| {
        b.iter(|| measure(&scene, &layout));
    });
    group.finish();
}

criterion_group!(benches, metrics);
criterion_main!(benches);
