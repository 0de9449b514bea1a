//! Polygons of five and more corners: a constrained Delaunay triangulation (`spade`) of the outline in its own plane,
//! from which each triangle is taken as often as the outline winds around it.
//!
//! The winding numbers come from crossing the outline, edge by edge, from outside (as in J. Shewchuk, "Triangle:
//! Engineering a 2D Quality Mesh Generator", 1996, section 3, but counted, so that edges walked both ways cancel).

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use spade::handles::{DirectedEdgeHandle, FixedDirectedEdgeHandle, FixedVertexHandle};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use super::area_vector;

type Cdt = ConstrainedDelaunayTriangulation<Point2<f64>>;
type Edge<'a> = DirectedEdgeHandle<'a, Point2<f64>, (), spade::CdtEdge<()>, ()>;

/// Tolerance for the area vector of the triangles against the outline's, relative to the square of its extent.
const AREA_TOLERANCE: f64 = 1e-6;

/// Triangulates an outline; `None` if it crosses itself, has no plane, or is not finite.
pub(super) fn triangulate(corners: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let plane = Plane::of(corners)?;
    let outline = Outline::of(corners.iter().map(|&corner| plane.project(corner)));
    let mut cdt = Cdt::bulk_load_cdt(outline.points.clone(), Vec::new()).ok()?;
    let walk = Walk::along(&outline, &mut cdt)?;
    let windings = walk.windings(&cdt);
    let owners = walk.owners(&outline, &cdt);

    let mut triangles = Vec::with_capacity(corners.len() - 2);
    for face in cdt.inner_faces() {
        let winding = windings[face.fix().index()];
        let [a, b, c] = face.adjacent_edges().map(|edge| owners.corner(&outline, edge));
        let triangle = if winding < 0 { [a, c, b] } else { [a, b, c] };
        for _ in 0..winding.unsigned_abs() {
            // A simple outline of n corners encloses at most n - 2 triangles; a tangled one has no bound.
            if triangles.len() == corners.len() - 2 {
                return None;
            }
            triangles.push(triangle);
        }
    }
    plane.keeps_area(corners, &triangles).then_some(triangles)
}

/// The plane of an outline, scaled so that the outline fits the unit square.
struct Plane {
    origin: DVec3,
    u: DVec3,
    v: DVec3,
    /// A power of two, so that scaling is exact.
    scale: f64,
    area: DVec3,
}

impl Plane {
    fn of(corners: &[DVec3]) -> Option<Self> {
        let origin = corners[0];
        let extent = corners.iter().map(|&corner| (corner - origin).abs().max_element()).fold(0.0, f64::max);
        let finite = corners.iter().all(|corner| corner.is_finite());
        let area = area_vector(corners);
        // Coordinates have 24 bits: below this, the plane of the outline is due to rounding.
        if !finite || extent <= 0.0 || area.length() <= 1e-9 * extent * extent {
            return None;
        }
        // For an axis-aligned normal, this gives exactly the two other axes, and collinear corners stay collinear.
        let (u, v) = (area / area.abs().max_element()).normalize().any_orthonormal_pair();
        let (u, v) = if u.cross(v).dot(area) < 0.0 { (v, u) } else { (u, v) };
        Some(Plane { origin, u, v, scale: (-extent.log2().ceil()).exp2(), area })
    }

    fn project(&self, corner: DVec3) -> DVec2 {
        let offset = (corner - self.origin) * self.scale;
        // `spade` rejects numbers below 2^-142, which zero can replace.
        let flushed = |x: f64| if x.abs() < 1e-40 { 0.0 } else { x };
        DVec2::new(flushed(offset.dot(self.u)), flushed(offset.dot(self.v)))
    }

    fn keeps_area(&self, corners: &[DVec3], triangles: &[[usize; 3]]) -> bool {
        let area = |&[a, b, c]: &[usize; 3]| (corners[b] - corners[a]).cross(corners[c] - corners[a]) * 0.5;
        let sum: DVec3 = triangles.iter().map(area).sum();
        let tolerance = AREA_TOLERANCE / (self.scale * self.scale);
        !triangles.is_empty() && (sum - self.area).length() <= tolerance
    }
}

/// An outline in its plane.
struct Outline {
    /// Its distinct points.
    points: Vec<Point2<f64>>,
    /// The point of each corner.
    point_of: Vec<usize>,
    /// The first corner at each point.
    first: Vec<usize>,
    /// Whether several corners lie at one point.
    repeats: bool,
}

impl Outline {
    fn of(corners: impl Iterator<Item = DVec2>) -> Self {
        let mut out = Outline { points: Vec::new(), point_of: Vec::new(), first: Vec::new(), repeats: false };
        let mut seen = HashMap::new();
        for (corner, at) in corners.enumerate() {
            let next = out.points.len();
            let point = *seen.entry([at.x.to_bits(), at.y.to_bits()]).or_insert(next);
            if point == next {
                out.points.push(Point2::new(at.x, at.y));
                out.first.push(corner);
            }
            out.repeats |= point != next;
            out.point_of.push(point);
        }
        out
    }
}

/// The outline as edges of the triangulation.
struct Walk {
    /// For each undirected edge, how often the outline traverses it forwards minus backwards.
    weight: Vec<i32>,
    /// For each directed edge, the corner at which the outline enters it.
    entered_from: Vec<Option<usize>>,
}

impl Walk {
    /// Inserts the outline's edges into the triangulation; `None` if two of them cross.
    fn along(outline: &Outline, cdt: &mut Cdt) -> Option<Self> {
        let count = outline.point_of.len();
        let mut walk =
            Walk { weight: vec![0; cdt.num_undirected_edges()], entered_from: vec![None; cdt.num_directed_edges()] };
        for corner in 0..count {
            let (from, to) = (outline.point_of[corner], outline.point_of[(corner + 1) % count]);
            if from == to {
                continue;
            }
            let edges = cdt.try_add_constraint(FixedVertexHandle::from_index(from), FixedVertexHandle::from_index(to));
            walk.entered_from[edges.first()?.index()] = Some(corner);
            for edge in edges {
                walk.weight[edge.as_undirected().index()] += if is_forward(edge) { 1 } else { -1 };
            }
        }
        Some(walk)
    }

    /// Returns the outline's winding number around each face (by outer index): zero for the outer face, and one more to
    /// the left of each traversed edge than to its right.
    fn windings(&self, cdt: &Cdt) -> Vec<i32> {
        let mut windings = vec![None; cdt.num_all_faces()];
        let mut open = vec![cdt.outer_face().fix()];
        windings[cdt.outer_face().index()] = Some(0);
        let mut edges_of: Vec<Vec<Edge<'_>>> = vec![Vec::new(); cdt.num_all_faces()];
        for edge in cdt.directed_edges() {
            edges_of[edge.face().index()].push(edge);
        }
        while let Some(face) = open.pop() {
            let here = windings[face.index()].unwrap_or(0);
            for edge in &edges_of[face.index()] {
                let beyond = edge.rev().face();
                if windings[beyond.index()].is_none() {
                    windings[beyond.index()] = Some(here - self.forth(edge.fix()));
                    open.push(beyond.fix());
                }
            }
        }
        windings.into_iter().map(|winding| winding.unwrap_or(0)).collect()
    }

    fn forth(&self, edge: FixedDirectedEdgeHandle) -> i32 {
        let weight = self.weight[edge.as_undirected().index()];
        if is_forward(edge) { weight } else { -weight }
    }

    /// Returns, for each directed edge, the corner that the triangle to its left has at the edge's start. At a point of
    /// several corners, each corner owns the area counter-clockwise of the edge on which the outline leaves it.
    fn owners(&self, outline: &Outline, cdt: &Cdt) -> Owners {
        if !outline.repeats {
            return Owners(Vec::new());
        }
        let mut owners = vec![None; cdt.num_directed_edges()];
        for vertex in cdt.vertices() {
            let mut current = None;
            for _ in 0..2 {
                for edge in vertex.out_edges() {
                    current = self.entered_from[edge.fix().index()].or(current);
                    owners[edge.fix().index()] = current;
                }
            }
        }
        Owners(owners)
    }
}

/// See [`Walk::owners`]; empty if each point has one corner.
struct Owners(Vec<Option<usize>>);

impl Owners {
    fn corner(&self, outline: &Outline, edge: Edge<'_>) -> usize {
        let owner = self.0.get(edge.fix().index()).copied().flatten();
        owner.unwrap_or(outline.first[edge.from().fix().index()])
    }
}

/// Whether the edge has the direction that counts as forwards for its undirected edge.
fn is_forward(edge: FixedDirectedEdgeHandle) -> bool {
    edge.as_undirected().as_directed() == edge
}
