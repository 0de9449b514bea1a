//! Compares points and lines, which the scenes do not hold: by place, in all scenes of the files.

use std::collections::HashMap;

use glam::{DAffine3, DVec3};
use raykiln_formats::Document;
use raykiln_formats::properties::Strokes;

use super::super::{Side, Sides};
use super::findings::Findings;
use super::nodes::Nodes;
use super::property::{Changed, Correspondence};
use super::{Compared, DifferenceKind as Kind, Inputs};

/// Rounding of a corner of the output, over its largest coordinate.
const ROUNDING: f64 = 1.0 / (1 << 22) as f64;

/// Points and lines that are sought by place, at most: 1 GB of them.
const MOST: usize = 1 << 24;

/// A point or a line in the world; both ends of a point are the same.
#[derive(Clone, Copy)]
struct Stroke {
    ends: [DVec3; 2],
    corners: usize,
    material: Option<usize>,
    node: usize,
}

/// Compares all points and lines; `distance` is how far an end may be off.
pub(super) fn compare(
    inputs: &Inputs<'_>,
    nodes: &Nodes,
    same: &dyn Correspondence,
    distance: f64,
    compared: &mut Compared,
    found: &mut Findings,
) {
    let meshes = inputs.documents.map(Document::strokes);
    let unchanged = unchanged(nodes, &meshes, same);
    let is_sought = Sides { before: &unchanged.before, after: &unchanged.after };
    let found_in = |side: Side| strokes(nodes, side, &meshes[side], is_sought[side]);
    let (Some(before), Some(after)) = (found_in(Side::Before), found_in(Side::After)) else {
        let (before, after) = (Some("too many to compare".into()), None);
        return found.property(
            Kind::StrokesNotCompared,
            None,
            Changed { path: "points and lines".into(), before, after },
        );
    };
    compared.points_and_lines = meshes.before.iter().flatten().map(|s| (s.vertices.len() / s.corners) as u64).sum();
    let mut free = Grid::of(after, reach(&before).mul_add(ROUNDING, distance));
    for stroke in &before {
        let kind = if free.take(stroke, |material| same.materials(stroke.material, material)) {
            continue;
        } else if free.take(stroke, |_| true) {
            Kind::StrokeMaterial
        } else {
            Kind::StrokeMissing
        };
        missing(kind, stroke.corners, Some(&nodes.name(stroke.node)), found);
    }
    for stroke in free.left() {
        missing(Kind::StrokeAdded, stroke.corners, None, found);
    }
}

/// For each node of both files whether its points and lines are those of the same node of the other, in the same places:
/// they need not be sought.
fn unchanged(nodes: &Nodes, meshes: &Sides<Vec<Vec<Strokes>>>, same: &dyn Correspondence) -> Sides<Vec<bool>> {
    let mut unchanged = nodes.world.as_ref().map(|world| vec![false; world.len()]);
    let mut known: HashMap<[usize; 2], bool> = HashMap::new();
    for (before, after) in nodes.after.iter().enumerate().filter_map(|(before, after)| Some((before, (*after)?))) {
        let (b, a) = (nodes.get(Side::Before, before), nodes.get(Side::After, after));
        let (Some(mesh_b), Some(mesh_a)) = (b.mesh, a.mesh) else { continue };
        let are_equal = |known: &mut HashMap<_, _>| {
            let look = || are_equal(&meshes.before[mesh_b], &meshes.after[mesh_a], same);
            *known.entry([mesh_b, mesh_a]).or_insert_with(look)
        };
        let are_placed_alike = nodes.world.before[before] == nodes.world.after[after] && b.copies == a.copies;
        if are_placed_alike && are_equal(&mut known) {
            (unchanged.before[before], unchanged.after[after]) = (true, true);
        }
    }
    unchanged
}

/// Whether two meshes have equal points and lines in the same order.
fn are_equal(before: &[Strokes], after: &[Strokes], same: &dyn Correspondence) -> bool {
    let is_equal = |(b, a): (&Strokes, &Strokes)| {
        let are_alike = b.corners == a.corners && b.vertices == a.vertices && b.positions == a.positions;
        are_alike && same.materials(b.material, a.material)
    };
    before.len() == after.len() && before.iter().zip(after).all(is_equal)
}

fn missing(kind: Kind, corners: usize, object: Option<&str>, found: &mut Findings) {
    let path = if corners == 1 { "points" } else { "lines" };
    found.property(kind, object, Changed { path: path.into(), before: None, after: None });
}

/// Returns the largest coordinate.
fn reach(strokes: &[Stroke]) -> f64 {
    strokes.iter().flat_map(|stroke| stroke.ends).map(|end| end.abs().max_element()).fold(0.0, f64::max)
}

/// Returns the points and lines that nodes place, but for those that are known to be unchanged; `None` if they are too
/// many.
fn strokes(nodes: &Nodes, side: Side, meshes: &[Vec<Strokes>], unchanged: &[bool]) -> Option<Vec<Stroke>> {
    let mut all = Vec::new();
    for (number, world) in nodes.world[side].iter().enumerate().filter(|(node, _)| !unchanged[*node]) {
        let node = nodes.get(side, number);
        for primitive in node.mesh.map_or(&[][..], |mesh| &meshes[mesh]) {
            for copy in node.copies.as_deref().unwrap_or(&[DAffine3::IDENTITY]) {
                if all.len() + primitive.vertices.len() > MOST {
                    return None;
                }
                all.extend(placed(primitive, *world * *copy, number));
            }
        }
    }
    Some(all)
}

fn placed(primitive: &Strokes, world: DAffine3, node: usize) -> impl Iterator<Item = Stroke> {
    let place = move |v: u32| world.transform_point3(DVec3::from_array(primitive.positions[v as usize]));
    let Strokes { corners, material, .. } = *primitive;
    primitive.vertices.chunks_exact(corners).map(move |vertices| {
        let ends = [place(vertices[0]), place(vertices[corners - 1])];
        Stroke { ends, corners, material, node }
    })
}

/// Strokes by the cell that their middle is in.
struct Grid {
    cell: f64,
    distance: f64,
    cells: HashMap<[i64; 3], Vec<Stroke>>,
}

impl Grid {
    /// Cells are four times as large as `distance`, so that what is near is in a cell next to it.
    fn of(strokes: Vec<Stroke>, distance: f64) -> Grid {
        let mut grid = Grid { cell: (4.0 * distance).max(f64::MIN_POSITIVE), distance, cells: HashMap::new() };
        for stroke in strokes {
            grid.cells.entry(grid.cell_of(&stroke, DVec3::ZERO)).or_default().push(stroke);
        }
        grid
    }

    fn cell_of(&self, stroke: &Stroke, off: DVec3) -> [i64; 3] {
        let middle = (stroke.ends[0] + stroke.ends[1]) / 2.0;
        ((middle + off) / self.cell).floor().to_array().map(|x| x as i64)
    }

    /// Removes a stroke in the place of another whose material is as wanted; returns whether there was one.
    fn take(&mut self, stroke: &Stroke, is_wanted: impl Fn(Option<usize>) -> bool) -> bool {
        let near = |a: DVec3, b: DVec3| a.distance(b) <= self.distance;
        let is_same = |other: &Stroke| {
            let ([a, b], [c, d]) = (stroke.ends, other.ends);
            let are_near = near(a, c) && near(b, d) || near(a, d) && near(b, c);
            stroke.corners == other.corners && are_near && is_wanted(other.material)
        };
        let mut cells = (0..8).map(|i| self.cell_of(stroke, self.corner(i)));
        let found = cells.find_map(|cell| Some((cell, self.cells.get(&cell)?.iter().position(is_same)?)));
        let taken = found.and_then(|(cell, at)| Some(self.cells.get_mut(&cell)?.swap_remove(at)));
        taken.is_some()
    }

    /// Returns a corner of the box of what is near.
    fn corner(&self, i: u32) -> DVec3 {
        let off = |axis: u32| if i >> axis & 1 == 0 { -self.distance } else { self.distance };
        DVec3::new(off(0), off(1), off(2))
    }

    /// Returns all that were not taken.
    fn left(self) -> impl Iterator<Item = Stroke> {
        self.cells.into_values().flatten()
    }
}
