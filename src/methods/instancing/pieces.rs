//! Pieces into which the instances of a mesh may be opened, each stored in the frame that fits it best.
//!
//! Opening instances is from C. Benthin, S. Woop, I. Wald, A. Áfra, "Improved Two-Level BVHs using Partial
//! Re-Braiding", High Performance Graphics 2017, applied to the file. Unlike there, all instances of a mesh share the
//! pieces, so the pieces need not be nodes of one tree, nor have boxes along the axes of the mesh: small parts are
//! joined bottom-up, always the two for which the surface area heuristic's sum grows least (B. Walter, K. Bala, M.
//! Kulkarni, K. Pingali, "Fast Agglomerative Clustering for Rendering", Interactive Ray Tracing 2008), with the areas
//! of rotated boxes; after every few joins, neighbours are redivided ([`super::improve`]). The instance undoes the
//! frame of a piece, which costs no bytes.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DVec3};

use super::cut::Cuts;
use super::improve::improve;
use crate::cost::segments::Boxed;
use crate::layout::builder::Part;
use crate::layout::seams::Components;
use crate::scene::{Bounds, Mesh};
use crate::tree::Quality;

/// Numbers of pieces that a mesh may be opened into. One piece is the mesh itself, rotated.
pub(super) const PIECES: [u32; 12] = [1, 2, 4, 6, 8, 12, 16, 20, 24, 32, 48, 64];

/// Maximum number of small parts that pieces are made of.
const PARTS: usize = 192;

/// Share of the clusters that remain at each improvement, and the number of clusters from which on they are improved.
const KEPT_AT_ONCE: f64 = 0.75;
const FIRST_IMPROVED: usize = 96;

/// Number of nearby parts tried as partners of a part.
const PARTNERS: usize = 8;

/// Number of directions in which the outermost points of a part represent it.
const DIRECTIONS: usize = 25;

/// Up to this many pieces, the result of joining without improvement is also tried: a smaller sum of areas does not
/// always mean that rays meet fewer of so few pieces.
const MOST_JOINED: u32 = 8;

/// A rotated box is used if its area is below this share of that of the box along the axes of the mesh.
const WORTH_A_TURN: f64 = 0.97;

/// Maximum number of triangles for which trees are built over all numbers of pieces of a mesh; fewer numbers are tried
/// for larger meshes.
const MOST_TRIANGLES: usize = 1 << 21;

/// A piece with a tree over its triangles, in its frame.
pub(super) struct Piece {
    pub(super) part: Part,
    pub(super) tree: Boxed,
}

/// The clusters of a mesh for each number of pieces in [`PIECES`]; they are costly to find, and the same whatever an
/// entry costs.
pub(super) struct Shapes {
    components: Components,
    /// Whether boxes are rotated: only whole components may turn, as pieces of one component would part at their seams.
    turns: bool,
    /// The numbers wanted and their clusters.
    of: Vec<(u32, Vec<Cluster>)>,
}

/// Returns the numbers of pieces to try for a mesh, no more than `most`; only the number `only` if given.
pub(super) fn numbers(mesh: &Mesh, most: usize, only: Option<u32>) -> Vec<u32> {
    let tried = (MOST_TRIANGLES / mesh.triangle_count().max(1)).max(1);
    let every = PIECES.len().div_ceil(tried);
    let wanted = only.map_or_else(|| PIECES.into_iter().rev().step_by(every).collect(), |only| vec![only]);
    wanted.into_iter().filter(|&k| k as usize <= most).collect()
}

impl Shapes {
    /// Finds the clusters. Frames are the identity unless the mesh `turns`. No more than `most` pieces; only the number
    /// `only` if given, which is then none of [`PIECES`].
    pub(super) fn of(mesh: &Mesh, tree: &Boxed, most: usize, turns: bool, only: Option<u32>) -> Shapes {
        let components = Components::of_mesh(mesh);
        let wanted = only.map_or_else(|| PIECES.into_iter().rev().collect(), |only| vec![only]);
        let wanted: Vec<u32> = wanted.into_iter().filter(|&k| k as usize <= most && (k > 1 || turns)).collect();
        let few: Vec<u32> = wanted.iter().copied().filter(|k| (2..=MOST_JOINED).contains(k)).collect();
        let shaping = |improves: bool| Shaping { turns: turns && components.len() > 1, improves };
        let joined = [(&few, false), (&wanted, true)].map(|(numbers, improves)| {
            let numbers: Vec<usize> = numbers.iter().map(|&k| k as usize).collect();
            joined(mesh, tree, &numbers, shaping(improves))
        });
        let of = joined.into_iter().flatten().map(|clusters| (clusters.len() as u32, clusters)).collect();
        Shapes { components, turns, of }
    }

    /// Returns the indices of the clusters for these numbers of pieces.
    pub(super) fn indices(&self, numbers: &[u32]) -> Vec<usize> {
        (0..self.of.len()).filter(|&i| numbers.contains(&self.of[i].0)).collect()
    }

    /// Returns the pieces that some clusters make; none if they are the mesh as it is.
    pub(super) fn pieces(&self, mesh: &Mesh, index: usize) -> Vec<Piece> {
        let clusters = self.of[index].1.clone();
        let turns = self.turns && self.components.len() > 1;
        let whole = match turns {
            true => with_whole_components(mesh, clusters, &self.components, Shaping { turns, improves: false }),
            false => clusters,
        };
        let piece = |cluster: Cluster| {
            let turns = self.turns && self.components.are_closed(&cluster.triangles);
            cluster.piece(mesh, turns)
        };
        let pieces: Vec<Piece> = whole.into_iter().map(piece).collect();
        match pieces.as_slice() {
            [one] if one.part.frame == DAffine3::IDENTITY => Vec::new(),
            _ => pieces,
        }
    }
}

/// Moves each component to the cluster that holds most of it, the first of equal ones, unless it is larger than clusters
/// are on average: what is divided among clusters cannot turn.
fn with_whole_components(mesh: &Mesh, clusters: Vec<Cluster>, components: &Components, by: Shaping) -> Vec<Cluster> {
    let mut held: BTreeMap<(u32, usize), usize> = BTreeMap::new();
    for (at, cluster) in clusters.iter().enumerate() {
        cluster.triangles.iter().for_each(|&t| *held.entry((components.component(t), at)).or_default() += 1);
    }
    let largest = mesh.triangle_count() / clusters.len().max(1);
    let mut homes: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
    for (&(component, at), &count) in &held {
        let (home, most) = homes.entry(component).or_insert((at, 0));
        if count > *most {
            (*home, *most) = (at, count);
        }
    }
    let mut triangles: Vec<Vec<u32>> = vec![Vec::new(); clusters.len()];
    for (at, cluster) in clusters.iter().enumerate() {
        for &t in &cluster.triangles {
            let component = components.component(t);
            let home = if components.size(component) <= largest { homes[&component].0 } else { at };
            triangles[home].push(t);
        }
    }
    let moved = |(cluster, triangles): (Cluster, Vec<u32>)| match triangles == cluster.triangles {
        true => cluster,
        false => Cluster::near(mesh, triangles, &[cluster.axes], by),
    };
    clusters.into_iter().zip(triangles).filter(|(_, triangles)| !triangles.is_empty()).map(moved).collect()
}

/// How to form clusters.
#[derive(Clone, Copy)]
pub(super) struct Shaping {
    /// Whether boxes are rotated.
    pub(super) turns: bool,
    /// Whether neighbours are redivided. If so, ties for the outermost point of a part go to the first point, else to
    /// the last: different parts are then joined, so the two ways differ if many parts are equally good.
    pub(super) improves: bool,
}

/// Some triangles and their rotated box.
#[derive(Clone)]
pub(super) struct Cluster {
    pub(super) triangles: Vec<u32>,
    /// Their outermost points.
    pub(super) points: Vec<DVec3>,
    /// Box from mesh.
    pub(super) axes: DMat3,
    /// Area of the box.
    area: f64,
}

/// Returns the clusters for each wanted number, in descending order.
///
/// Clusters are improved along the way, because joined parts never separate again.
pub(super) fn joined(mesh: &Mesh, tree: &Boxed, wanted: &[usize], by: Shaping) -> Vec<Vec<Cluster>> {
    let parts = Cuts::of_equal_parts(tree, PARTS);
    let mut clusters: Vec<Cluster> = parts.into_iter().map(|t| Cluster::new(mesh, t, by)).collect();
    let mut found = Vec::new();
    for &wanted in wanted {
        while clusters.len() > wanted.max(1) {
            let kept = if by.improves { (KEPT_AT_ONCE * clusters.len() as f64) as usize } else { 0 };
            let next = wanted.max(1).max(kept);
            clusters = Joining::new(clusters, by).join_to(next);
            if by.improves && next <= FIRST_IMPROVED {
                improve(mesh, &mut clusters, by);
            }
        }
        if clusters.len() == wanted {
            found.push(clusters.clone());
        }
    }
    found
}

/// Clusters being joined.
struct Joining {
    clusters: Vec<Option<Cluster>>,
    /// For each cluster, its best partner and the cost added by joining them.
    best: Vec<Option<(f64, usize)>>,
    left: usize,
    by: Shaping,
}

impl Joining {
    fn new(clusters: Vec<Cluster>, by: Shaping) -> Joining {
        let left = clusters.len();
        let clusters = clusters.into_iter().map(Some).collect();
        let mut joining = Joining { clusters, best: vec![None; left], left, by };
        (0..left).for_each(|i| joining.best[i] = joining.best_partner(i));
        joining
    }

    /// Joins clusters until only `count` are left.
    fn join_to(mut self, count: usize) -> Vec<Cluster> {
        while self.left > count && self.join_next() {}
        self.clusters.into_iter().flatten().collect()
    }

    /// Joins the two clusters that are cheapest to join, the first of equal ones; returns false if no two are left.
    fn join_next(&mut self) -> bool {
        let found = self.best.iter().enumerate().filter_map(|(i, best)| best.map(|(cost, partner)| (cost, i, partner)));
        let Some((_, a, b)) = found.min_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1))) else { return false };
        let (keep, drop) = (a.min(b), a.max(b));
        let (Some(one), Some(other)) = (self.clusters[keep].take(), self.clusters[drop].take()) else { return false };
        self.clusters[keep] = Some(one.join(other, self.by));
        self.best[drop] = None;
        self.left -= 1;
        for i in 0..self.clusters.len() {
            let is_stale = self.best[i].is_none_or(|(_, partner)| partner == keep || partner == drop);
            if self.clusters[i].is_some() && (i == keep || is_stale) {
                self.best[i] = self.best_partner(i);
            }
        }
        true
    }

    /// Returns the partner of a cluster for which the sum grows least, among those with the most promising axis-aligned
    /// boxes.
    fn best_partner(&self, at: usize) -> Option<(f64, usize)> {
        let of = self.clusters[at].as_ref()?;
        let around = Bounds::of(of.points.iter().copied());
        let growth = |other: &Cluster| around.union(&Bounds::of(other.points.iter().copied())).area() - other.area;
        let others = self.clusters.iter().enumerate().filter(|(i, _)| *i != at);
        let mut near: Vec<(f64, usize)> = others.filter_map(|(i, c)| Some((growth(c.as_ref()?), i))).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.truncate(PARTNERS);
        let cost = |&(_, i): &(f64, usize)| Some((of.cost_of_joining(self.clusters[i].as_ref()?, self.by), i));
        near.iter().filter_map(cost).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    }
}

impl Cluster {
    fn new(mesh: &Mesh, triangles: Vec<u32>, by: Shaping) -> Cluster {
        let corners: Vec<DVec3> = triangles.iter().flat_map(|&t| mesh.corners(t)).map(|p| p.as_dvec3()).collect();
        let points = outermost(&corners, by);
        let (area, axes) = best_axes(&points, &[], by.turns);
        Cluster { triangles, points, axes, area }
    }

    fn join(self, other: Cluster, by: Shaping) -> Cluster {
        let both = [self.points, other.points].concat();
        let (area, axes) = best_axes(&both, &[self.axes, other.axes], by.turns);
        let triangles = [self.triangles, other.triangles].concat();
        Cluster { triangles, points: outermost(&both, by), axes, area }
    }

    /// Like [`Cluster::new`], for triangles near clusters whose axes are given.
    pub(super) fn near(mesh: &Mesh, triangles: Vec<u32>, given: &[DMat3], by: Shaping) -> Cluster {
        let mut cluster = Cluster::new(mesh, triangles, by);
        if by.turns {
            let (_, axes) = best_axes(&cluster.points, &[given, &[cluster.axes]].concat(), true);
            cluster.axes = refined(&cluster.points, axes);
            cluster.area = area(&cluster.points, &cluster.axes);
        }
        cluster
    }

    /// Returns the area times the number of triangles.
    pub(super) fn cost(&self) -> f64 {
        self.area * self.triangles.len() as f64
    }

    /// Returns the growth of the sum of areas, each times its triangles.
    fn cost_of_joining(&self, other: &Cluster, by: Shaping) -> f64 {
        let both = [self.points.as_slice(), &other.points].concat();
        let (area, _) = best_axes(&both, &[self.axes, other.axes], by.turns);
        let (a, b) = (self.triangles.len() as f64, other.triangles.len() as f64);
        area * (a + b) - self.cost() - other.cost()
    }

    /// Returns the piece in a frame around its middle, or unrotated if rotation gains too little.
    fn piece(mut self, mesh: &Mesh, turns: bool) -> Piece {
        self.triangles.sort_unstable();
        let corners: Vec<DVec3> = self.triangles.iter().flat_map(|&t| mesh.corners(t)).map(|p| p.as_dvec3()).collect();
        let along = Bounds::of(corners.iter().copied());
        let axes =
            if turns { refined(&self.points, best_axes(&self.points, &[self.axes], true).1) } else { DMat3::IDENTITY };
        // The rows of a rotation are the columns of its inverse.
        let rotation = DMat3::from_cols_array(&axes.transpose().to_cols_array().map(|c| f64::from(c as f32)));
        let into = DAffine3::from_mat3(rotation).inverse();
        let turned = Bounds::of(corners.iter().map(|&p| into.transform_point3(p)));
        let middle = rotation * turned.center();
        let frame = DAffine3 { matrix3: rotation, translation: middle.as_vec3().as_dvec3() };
        let pays = turned.area() < WORTH_A_TURN * along.area() && frame.is_finite();
        let frame = if pays { frame } else { DAffine3::IDENTITY };
        let into = frame.inverse();
        let boxes: Vec<Bounds> =
            corners.chunks_exact(3).map(|c| Bounds::of(c.iter().map(|&p| into.transform_point3(p)))).collect();
        Piece { part: Part { triangles: self.triangles, frame }, tree: Boxed::build(&boxes, Quality::Medium) }
    }
}

/// Returns the outermost points in directions distributed evenly over half a sphere (R. Swinbank, R. Purser, "Fibonacci
/// Grids", 2006), without duplicates.
fn outermost(points: &[DVec3], by: Shaping) -> Vec<DVec3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    let direction = |i: usize| {
        let z = (i as f64 + 0.5) / DIRECTIONS as f64;
        let (sin, cos) = (golden * i as f64).sin_cos();
        DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z)
    };
    let mut found = Vec::with_capacity(2 * DIRECTIONS);
    for along in (0..DIRECTIONS).map(direction).filter(|_| !points.is_empty()) {
        let (mut least, mut most) = ((f64::INFINITY, 0), (f64::NEG_INFINITY, 0));
        for (i, &point) in points.iter().enumerate() {
            let at = along.dot(point);
            if at < least.0 {
                least = (at, i);
            }
            if at > most.0 || (at == most.0 && !by.improves) {
                most = (at, i);
            }
        }
        found.extend([least.1, most.1]);
    }
    found.sort_unstable();
    found.dedup();
    found.into_iter().map(|i| points[i]).collect()
}

/// Returns the axes of least box area among those of the mesh, those given, and the principal axes of the points
/// rotated about each of them.
fn best_axes(points: &[DVec3], given: &[DMat3], turns: bool) -> (f64, DMat3) {
    let mut best = (area(points, &DMat3::IDENTITY), DMat3::IDENTITY);
    if !turns {
        return best;
    }
    let principal = principal_axes(points);
    let about = |axis: DVec3| (0..6).map(move |i| DMat3::from_axis_angle(axis, f64::from(i) * PI / 12.0));
    let turned = DVec3::AXES.into_iter().flat_map(about).map(|by| by * principal);
    for axes in given.iter().copied().chain(turned) {
        let area = area(points, &axes);
        if area < best.0 {
            best = (area, axes);
        }
    }
    best
}

/// Rotates axes step by step as long as the box shrinks (R. Hooke, T. Jeeves, "Direct Search Solution of Numerical and
/// Statistical Problems", Journal of the ACM 8(2), 1961).
fn refined(points: &[DVec3], axes: DMat3) -> DMat3 {
    let (mut best, mut step) = ((area(points, &axes), axes), 0.2);
    while step > 1e-4 {
        let before = best.0;
        for axis in DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
            let turned = DMat3::from_axis_angle(axis, step) * best.1;
            let area = area(points, &turned);
            if area < best.0 {
                best = (area, turned);
            }
        }
        if best.0 >= before {
            step *= 0.5;
        }
    }
    best.1
}

fn area(points: &[DVec3], axes: &DMat3) -> f64 {
    Bounds::of(points.iter().map(|&p| *axes * p)).area()
}

/// Returns the directions of largest, middle and smallest spread of the points, as rows: eigenvectors of their
/// covariance, by the rotations of C. Jacobi, "Über ein leichtes Verfahren", Journal für die reine und angewandte
/// Mathematik 30, 1846.
fn principal_axes(points: &[DVec3]) -> DMat3 {
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let mut spread = DMat3::ZERO;
    for &p in points {
        let d = p - middle;
        spread += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    let mut axes = DMat3::IDENTITY;
    for (i, j) in [(0, 1), (0, 2), (1, 2)].repeat(6) {
        let angle = 0.5 * (2.0 * spread.col(j)[i]).atan2(spread.col(i)[i] - spread.col(j)[j]);
        let (sin, cos) = angle.sin_cos();
        let mut turn = DMat3::IDENTITY;
        (turn.col_mut(i)[i], turn.col_mut(i)[j]) = (cos, sin);
        (turn.col_mut(j)[i], turn.col_mut(j)[j]) = (-sin, cos);
        spread = turn.transpose() * spread * turn;
        axes *= turn;
    }
    axes.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::Scene;
    use glam::Vec3;

    /// Parallel rods in a row, rotated by `turned`.
    fn rods(count: usize, turned: DMat3) -> Scene {
        let rod = |i: usize| -> Vec<[Vec3; 3]> {
            let at = |x: f64, y: f64| (turned * DVec3::new(x, y + 3.0 * i as f64, 0.0)).as_vec3();
            let quad = |k: usize| {
                let (a, b) = (0.25 * k as f64, 0.25 * (k + 1) as f64);
                [[at(a, 0.0), at(b, 0.0), at(b, 0.1)], [at(a, 0.0), at(b, 0.1), at(a, 0.1)]]
            };
            (0..40).flat_map(quad).collect()
        };
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("rods", vec![(0, (0..count).flat_map(rod).collect())]);
        builder.place(mesh, "rods", DAffine3::IDENTITY);
        builder.scene()
    }

    fn of(scene: &Scene, turns: bool) -> Vec<Vec<Piece>> {
        let mesh = &scene.meshes[0];
        let shapes = Shapes::of(mesh, &Boxed::of_mesh(mesh, Quality::Medium), 64, turns, None);
        let indices = shapes.indices(&numbers(mesh, 64, None));
        let mut levels: Vec<Vec<Piece>> = indices.into_iter().map(|index| shapes.pieces(mesh, index)).collect();
        levels.retain(|pieces| !pieces.is_empty());
        levels.sort_by_key(Vec::len);
        levels
    }

    fn turned() -> DMat3 {
        DMat3::from_euler(glam::EulerRot::XYZ, 0.4, 0.5, 0.7)
    }

    #[test]
    fn every_number_of_pieces_holds_every_triangle_once() {
        let scene = rods(4, turned());
        let levels = of(&scene, true);
        assert!(levels.len() > 5 && levels.is_sorted_by_key(Vec::len));
        for pieces in levels {
            let mut all: Vec<u32> = pieces.iter().flat_map(|p| p.part.triangles.clone()).collect();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..320));
            assert!(pieces.iter().all(|p| p.part.triangles.is_sorted() && !p.part.triangles.is_empty()));
        }
    }

    #[test]
    fn four_turned_rods_are_four_pieces_in_tight_boxes() {
        let scene = rods(4, turned());
        let four = of(&scene, true).into_iter().find(|l| l.len() == 4).expect("four pieces");
        for piece in four {
            assert_eq!(piece.part.triangles.len(), 80);
            assert!(piece.tree.bounds[0].area() < 1.2 * 2.0 * 10.0 * 0.1, "{:?}", piece.tree.bounds[0]);
            let frame = piece.part.frame.to_cols_array();
            assert!(frame.iter().all(|&c| f64::from(c as f32) == c) && piece.part.frame.matrix3.determinant() > 0.0);
        }
    }

    #[test]
    fn what_lies_along_the_axes_or_must_not_turn_is_not_turned() {
        for (axes, turns) in [(DMat3::IDENTITY, true), (turned(), false)] {
            let levels = of(&rods(4, axes), turns);
            assert!(levels.len() > 4 && levels[0].len() > 1, "the mesh itself is not a piece");
            assert!(levels.iter().flatten().all(|p| p.part.frame == DAffine3::IDENTITY));
        }
    }

    #[test]
    fn points_lines_and_extreme_sizes_do_no_harm() {
        for scale in [0.0f32, 1e-30, 1e-20, 1e18, 1e30] {
            for direction in [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 2.0, 3.0)] {
                let mut builder = SceneBuilder::default();
                let at = |i: usize| (direction * i as f32 + Vec3::Z * (i % 3) as f32) * scale;
                let mesh = builder.mesh("m", vec![(0, (0..200).map(|i| [at(i), at(i + 1), at(i + 2)]).collect())]);
                builder.place(mesh, "m", DAffine3::IDENTITY);
                for pieces in of(&builder.scene(), true) {
                    assert_eq!(pieces.iter().map(|p| p.part.triangles.len()).sum::<usize>(), 200);
                }
            }
        }
    }
}
