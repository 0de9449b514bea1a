//! Vendor guidance as rules. Ids and numbers follow the vendors' guides: NVIDIA, "Best Practices for Using NVIDIA RTX
//! Ray Tracing", updated 2022; the DXR and Vulkan specifications; Epic's hardware ray tracing guide; the Omniverse
//! asset validator; AMD's RDNA performance guide.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use glam::DVec3;

use crate::cost::bytes;
use crate::report::{Broken, Finding, OverlappingPair, Severity};
use crate::scene::{Mesh, Scene};

/// A pair is reported if its overlap over the area of the scene's core exceeds this (the skip threshold of the thesis).
const OVERLAP_RATIO: f64 = 0.005;
const MOST_ACCELERATION_STRUCTURES: usize = 300_000;
const MOST_INSTANCES_CONSOLE: usize = 100_000;
const MOST_INSTANCES: usize = 1 << 24;
const MOST_GEOMETRIES: usize = 1 << 24;
const MOST_TRIANGLES: usize = 1 << 29;
const LARGEST_COORDINATE: f64 = 8e6;
const SMALLEST_EXTENT: f64 = 1e-3;
/// Ratio of a transform's largest to smallest axis above which its box counts as loose.
const LOOSE_SCALE: f64 = 4.0;

/// The rules that are checked; docs/inspect.md also lists those that are not.
pub(super) const CHECKED: [&str; 9] = ["RK001", "RK003", "RK008", "RK010", "RK011", "RK012", "RK013", "RK015", "RK016"];

/// All findings, ordered by rule id.
pub(super) fn findings(scene: &Scene, worst: &[OverlappingPair]) -> Vec<Finding> {
    let mut found = overlapping(worst, !scene.core().is_whole());
    found.extend(duplicates(scene));
    found.extend(scene.meshes.iter().filter_map(degenerate));
    found.extend(limits(scene));
    found.extend(loose_transforms(scene));
    found.extend(far_from_origin(scene));
    found.extend(tiny(scene));
    found
}

fn overlapping(worst: &[OverlappingPair], of_core: bool) -> Vec<Finding> {
    worst
        .iter()
        .filter(|p| p.overlap_ratio > OVERLAP_RATIO)
        .map(|p| {
            let broken = Broken::Overlap { other: &p.b, ratio: p.overlap_ratio, of_core };
            Finding::new("RK001", Severity::Warning, &p.a, &broken)
        })
        .collect()
}

/// Meshes with equal vertices and triangles that could be shared.
fn duplicates(scene: &Scene) -> Option<Finding> {
    let mut by_content: BTreeMap<u64, Vec<&Mesh>> = BTreeMap::new();
    for mesh in scene.meshes.iter() {
        by_content.entry(content_hash(mesh)).or_default().push(mesh);
    }
    let (mut copies, mut saved) = (0, 0);
    for meshes in by_content.into_values() {
        let equal = meshes.iter().skip(1).filter(|m| same_content(meshes[0], m)).count();
        copies += equal;
        saved += equal as u64 * bytes::blas(meshes[0].triangle_count() as u64);
    }
    let broken = Broken::Repeated { meshes: copies, saved_bytes: saved };
    (copies > 0).then(|| Finding::new("RK003", Severity::Warning, "", &broken))
}

fn content_hash(mesh: &Mesh) -> u64 {
    let mut hasher = DefaultHasher::new();
    for g in &mesh.geometries {
        g.material.hash(&mut hasher);
        bytemuck::cast_slice::<_, u8>(&g.positions).hash(&mut hasher);
        g.triangles.hash(&mut hasher);
    }
    hasher.finish()
}

fn same_content(a: &Mesh, b: &Mesh) -> bool {
    let pairs = || a.geometries.iter().zip(&b.geometries);
    a.geometries.len() == b.geometries.len()
        && pairs().all(|(x, y)| x.material == y.material && x.positions == y.positions && x.triangles == y.triangles)
}

fn degenerate(mesh: &Mesh) -> Option<Finding> {
    let flat = |corners: [glam::Vec3; 3]| {
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        (b - a).cross(c - a) == DVec3::ZERO
    };
    let count: usize =
        mesh.geometries.iter().map(|g| (0..g.triangles.len()).filter(|&t| flat(g.corners(t))).count()).sum();
    (count > 0).then(|| Finding::new("RK008", Severity::Info, &mesh.name, &Broken::NoArea { triangles: count }))
}

fn limits(scene: &Scene) -> Vec<Finding> {
    let instances = scene.instances.len();
    let geometries = scene.meshes.iter().map(|m| m.geometries.len()).max().unwrap_or(0);
    let triangles = scene.meshes.iter().map(Mesh::triangle_count).max().unwrap_or(0);
    let over = |rule, severity, count: usize, most: usize, what: &'static str| {
        (count > most).then(|| Finding::new(rule, severity, "", &Broken::TooMany { count, what, most }))
    };
    [
        over("RK010", Severity::Error, instances, MOST_INSTANCES, "instances"),
        over("RK010", Severity::Error, geometries, MOST_GEOMETRIES, "geometries in one mesh"),
        over("RK010", Severity::Error, triangles, MOST_TRIANGLES, "triangles in one mesh"),
        over("RK011", Severity::Warning, scene.meshes.len(), MOST_ACCELERATION_STRUCTURES, "acceleration structures"),
        over("RK012", Severity::Warning, instances, MOST_INSTANCES_CONSOLE, "instances"),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Instances whose transform stretches or shears, reported as one finding.
fn loose_transforms(scene: &Scene) -> Option<Finding> {
    let stretch = |m: glam::DMat3| {
        let (shortest, longest) = singular_range(&m);
        longest / shortest
    };
    let loose = || scene.instances.iter().filter(|i| stretch(i.transform.matrix3) > LOOSE_SCALE);
    let first = loose().next()?;
    let broken = Broken::Loose { instances: loose().count(), factor: LOOSE_SCALE };
    Some(Finding::new("RK013", Severity::Info, first.display_name(), &broken))
}

/// The smallest and largest singular value of a matrix: square roots of the eigenvalues of its Gram matrix, in closed
/// form (O. K. Smith, "Eigenvalues of a symmetric 3x3 matrix", 1961).
fn singular_range(m: &glam::DMat3) -> (f64, f64) {
    let gram = m.transpose() * *m;
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    let deviation = gram - glam::DMat3::from_diagonal(DVec3::splat(mean));
    let squares = [deviation.x_axis, deviation.y_axis, deviation.z_axis].map(|c| c.length_squared());
    let p = (squares.iter().sum::<f64>() / 6.0).sqrt();
    if p == 0.0 {
        return (mean.sqrt(), mean.sqrt());
    }
    let angle = ((deviation * (1.0 / p)).determinant() / 2.0).clamp(-1.0, 1.0).acos() / 3.0;
    let largest = mean + 2.0 * p * angle.cos();
    let smallest = mean + 2.0 * p * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    (smallest.max(0.0).sqrt(), largest.max(0.0).sqrt())
}

fn far_from_origin(scene: &Scene) -> Option<Finding> {
    let all = scene.bounds();
    let farthest = all.min.abs().max(all.max.abs()).max_element();
    let broken = Broken::Far { farthest, most: LARGEST_COORDINATE };
    (farthest > LARGEST_COORDINATE).then(|| Finding::new("RK015", Severity::Warning, "", &broken))
}

fn tiny(scene: &Scene) -> Option<Finding> {
    let tiny =
        || scene.instances.iter().zip(scene.instance_boxes()).filter(|(_, b)| b.size().max_element() < SMALLEST_EXTENT);
    let (first, _) = tiny().next()?;
    let broken = Broken::Tiny { instances: tiny().count(), least: SMALLEST_EXTENT };
    Some(Finding::new("RK016", Severity::Info, first.display_name(), &broken))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::scene::{Geometry, Instance, MeshId};
    use glam::{DAffine3, DMat3, Vec3};

    fn scene(transforms: &[DAffine3]) -> Scene {
        let geometry = Geometry {
            positions: Arc::from([Vec3::ZERO, Vec3::X, Vec3::Y]),
            triangles: vec![[0, 1, 2]],
            ..Geometry::default()
        };
        let mesh = Mesh { name: "tri".into(), geometries: vec![geometry], ..Mesh::default() };
        let instance = |(i, t): (usize, &DAffine3)| Instance {
            name: String::new(),
            node: i as u32,
            source_node: i as u32,
            source_copy: None,
            source_index: 0,
            copy: 0,
            mesh: MeshId(i as u32),
            transform: *t,
            pinned: None,
        };
        Scene {
            meshes: vec![mesh; transforms.len()].into(),
            instances: transforms.iter().enumerate().map(instance).collect(),
            ..Scene::default()
        }
    }

    fn rules(scene: &Scene) -> Vec<&'static str> {
        findings(scene, &[]).iter().map(|f| f.rule).collect()
    }

    #[test]
    fn a_plain_triangle_breaks_no_rule() {
        assert!(rules(&scene(&[DAffine3::IDENTITY])).is_empty());
    }

    #[test]
    fn each_fault_is_found_by_its_rule() {
        assert_eq!(rules(&scene(&[DAffine3::IDENTITY; 2])), ["RK003"]);
        assert_eq!(rules(&scene(&[DAffine3::from_scale(DVec3::new(9.0, 1.0, 1.0))])), ["RK013"]);
        assert_eq!(rules(&scene(&[DAffine3::from_translation(DVec3::X * 9e6)])), ["RK015"]);
        assert_eq!(rules(&scene(&[DAffine3::from_scale(DVec3::splat(1e-4))])), ["RK016"]);
        let mut flat = scene(&[DAffine3::IDENTITY]);
        Arc::make_mut(&mut flat.meshes[0].geometries[0].positions)[2] = Vec3::X * 2.0;
        assert_eq!(rules(&flat), ["RK008"]);
    }

    #[test]
    fn singular_values_of_a_turned_scale_are_its_factors() {
        let turned = DMat3::from_rotation_x(0.3) * DMat3::from_diagonal(DVec3::new(0.5, 2.0, 3.0));
        let (smallest, largest) = singular_range(&turned);
        assert!((smallest - 0.5).abs() < 1e-9 && (largest - 3.0).abs() < 1e-9, "{smallest} {largest}");
        assert_eq!(singular_range(&DMat3::IDENTITY), (1.0, 1.0));
    }
}
