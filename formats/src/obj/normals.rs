//! Normals of smoothing groups.
//!
//! The normal of a vertex is the sum of the normals of the faces of its group around it, each times the area of the face
//! and its angle at the vertex (G. Thürmer, C. Wüthrich, "Computing Vertex Normals from Polygonal Facets", 1998, weigh
//! by the angle; the area favours large faces over bevels). Faces around a vertex are those of one object with a corner
//! at its position. Outside of groups faces are flat.

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::mesh::arities;
use super::scan::{Kind, Scan};
use super::shift;
use crate::ObjNormals;

/// Consecutive faces of a part in one smoothing group; group 0 is flat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub(super) group: u32,
    pub(super) faces: usize,
}

/// Position and smoothing group of a vertex.
type Place = ([u64; 3], u32);

/// Adds or removes normals as the options say.
pub(super) fn apply(scan: &Scan, models: &mut [tobj::Mesh], which: ObjNormals) {
    let has_groups = scan.parts.iter().flat_map(|part| &part.smoothing).any(|run| run.group > 0);
    match which {
        ObjNormals::Keep if !has_groups => return,
        ObjNormals::Keep => {}
        ObjNormals::Generate | ObjNormals::None => models.iter_mut().for_each(|mesh| {
            mesh.normals = Vec::new();
            mesh.normal_indices = Vec::new();
        }),
    }
    if which != ObjNormals::None {
        let everywhere = (!has_groups).then_some(1);
        let objects = objects(scan);
        let around: Vec<FxHashMap<Place, DVec3>> =
            objects.par_iter().map(|parts| sums(scan, models, parts, everywhere)).collect();
        let mut of_part = vec![0; models.len()];
        for (object, parts) in objects.iter().enumerate() {
            parts.iter().for_each(|&part| of_part[part] = object);
        }
        models.par_iter_mut().zip(&scan.parts).zip(of_part).for_each(|((mesh, part), object)| {
            if part.kind == Kind::Faces {
                complete(mesh, &part.smoothing, everywhere, &around[object]);
            }
        });
    }
}

/// The parts of each object.
fn objects(scan: &Scan) -> Vec<Vec<usize>> {
    let mut index = FxHashMap::default();
    let mut out: Vec<Vec<usize>> = Vec::new();
    for (at, part) in scan.parts.iter().enumerate() {
        let object = *index.entry(part.object).or_insert(out.len());
        if object == out.len() {
            out.push(Vec::new());
        }
        out[object].push(at);
    }
    out
}

/// The smoothing group of each face.
fn groups(runs: &[Run], everywhere: Option<u32>) -> impl Iterator<Item = u32> + '_ {
    runs.iter().flat_map(move |run| std::iter::repeat_n(everywhere.unwrap_or(run.group), run.faces))
}

/// The weighted normals around each place of an object.
fn sums(scan: &Scan, models: &[tobj::Mesh], parts: &[usize], everywhere: Option<u32>) -> FxHashMap<Place, DVec3> {
    let mut out = FxHashMap::default();
    for &at in parts.iter().filter(|&&at| scan.parts[at].kind == Kind::Faces) {
        let (mesh, part) = (&models[at], &scan.parts[at]);
        let positions: Vec<DVec3> = shift::positions(mesh).collect();
        let mut start = 0;
        for (count, group) in arities(mesh).zip(groups(&part.smoothing, everywhere)) {
            let face = &mesh.indices[start..start + count];
            start += count;
            if group == 0 {
                continue;
            }
            let corners: Vec<DVec3> = face.iter().map(|&i| positions[i as usize]).collect();
            let area = area_vector(&corners);
            for (corner, &position) in corners.iter().enumerate() {
                let weighted = area * angle(&corners, corner);
                if weighted.is_finite() {
                    *out.entry((bits(position), group)).or_insert(DVec3::ZERO) += weighted;
                }
            }
        }
    }
    out
}

/// Gives a normal to each face that lacks one, if a face of the part is smooth.
fn complete(mesh: &mut tobj::Mesh, runs: &[Run], everywhere: Option<u32>, around: &FxHashMap<Place, DVec3>) {
    if groups(runs, everywhere).all(|group| group == 0) {
        return;
    }
    let positions: Vec<DVec3> = shift::positions(mesh).collect();
    let counts: Vec<usize> = arities(mesh).collect();
    let lacking = mesh.normal_indices.is_empty();
    if lacking {
        mesh.normal_indices = vec![0; mesh.indices.len()];
    }
    let is_missing = |mesh: &tobj::Mesh, corner: usize| {
        let at = 3 * mesh.normal_indices[corner] as usize;
        lacking || mesh.normals.get(at..at + 3).is_none_or(|n| !DVec3::from_slice(n).is_finite())
    };
    let mut numbers: FxHashMap<(u32, u32), u32> = FxHashMap::default();
    let mut start = 0;
    for (&count, group) in counts.iter().zip(groups(runs, everywhere)) {
        let corners = start..start + count;
        start += count;
        if !corners.clone().any(|corner| is_missing(mesh, corner)) {
            continue;
        }
        let outline: Vec<DVec3> = corners.clone().map(|corner| positions[mesh.indices[corner] as usize]).collect();
        let flat = area_vector(&outline);
        let mut own = None;
        for corner in corners {
            let vertex = mesh.indices[corner];
            let smooth = around.get(&(bits(positions[vertex as usize]), group)).filter(|n| n.try_normalize().is_some());
            mesh.normal_indices[corner] = match smooth {
                Some(&normal) => *numbers.entry((vertex, group)).or_insert_with(|| push(&mut mesh.normals, normal)),
                None => *own.get_or_insert_with(|| push(&mut mesh.normals, flat)),
            };
        }
    }
}

/// Appends a normal and returns its index.
fn push(normals: &mut Vec<f64>, normal: DVec3) -> u32 {
    normals.extend(normal.normalize_or_zero().to_array());
    (normals.len() / 3 - 1) as u32
}

fn bits(position: DVec3) -> [u64; 3] {
    // Adding 0 makes -0 equal to 0.
    position.to_array().map(|x| (x + 0.0).to_bits())
}

/// Half the sum of the cross products around an outline: its normal times its area.
fn area_vector(corners: &[DVec3]) -> DVec3 {
    let origin = corners[0];
    0.5 * corners.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin)).sum::<DVec3>()
}

/// The angle of an outline at a corner in radians.
fn angle(corners: &[DVec3], at: usize) -> f64 {
    let count = corners.len();
    let (before, after) = (corners[(at + count - 1) % count] - corners[at], corners[(at + 1) % count] - corners[at]);
    before.cross(after).length().atan2(before.dot(after))
}
