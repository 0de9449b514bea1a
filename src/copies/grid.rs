//! Triangles by place, to find the one that a triangle goes to.

use glam::{DAffine3, DVec3};
use rustc_hash::FxHashMap;

use super::shape::Shape;

/// Which triangle of the copy a triangle of the model is, and which of its corners the first one is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pair {
    pub(super) triangle: u32,
    pub(super) turn: u8,
}

impl Pair {
    /// The copy's corners in the order of the model's; a mirroring reverses it.
    pub(super) fn corners(self, mirrored: bool) -> [usize; 3] {
        let t = usize::from(self.turn);
        if mirrored { [t, (t + 2) % 3, (t + 1) % 3] } else { [t, (t + 1) % 3, (t + 2) % 3] }
    }
}

/// Work that may be done on a pair of meshes, in triangles compared.
pub(super) struct Budget(pub(super) u64);

impl Budget {
    /// Takes some off; `None` when it is used up.
    pub(super) fn spend(&mut self, work: u64) -> Option<()> {
        self.0 = self.0.checked_sub(work)?;
        Some(())
    }
}

/// Triangles a wrong motion is tried on before all are.
const PROBES: usize = 8;

/// The triangles of a copy by the middle of their corners.
pub(super) struct Grid<'a> {
    copy: &'a Shape<'a>,
    /// How far corners may be off.
    slack: f64,
    width: f64,
    origin: DVec3,
    /// Number of each cell that holds triangles.
    cells: FxHashMap<[i64; 3], u32>,
    /// Where each cell's triangles start in `triangles`, and their number.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

fn middle(corners: &[DVec3; 3]) -> DVec3 {
    (corners[0] + corners[1] + corners[2]) / 3.0
}

impl<'a> Grid<'a> {
    pub(super) fn new(copy: &'a Shape<'a>, slack: f64) -> Grid<'a> {
        // Cells never so small that their numbers overflow.
        let width = (2.0 * slack).max(1e-9 * copy.spread).max(f64::MIN_POSITIVE);
        let mut grid = Grid {
            copy,
            slack,
            width,
            origin: copy.center,
            cells: FxHashMap::default(),
            starts: Vec::new(),
            triangles: Vec::new(),
        };
        let mut keyed: Vec<([i64; 3], u32)> =
            copy.corners.iter().zip(0..).map(|(corners, i)| (grid.cell(middle(corners)), i)).collect();
        keyed.sort_unstable();
        for run in keyed.chunk_by(|a, b| a.0 == b.0) {
            grid.cells.insert(run[0].0, grid.starts.len() as u32);
            grid.starts.push(grid.triangles.len() as u32);
            grid.triangles.extend(run.iter().map(|(_, triangle)| triangle));
        }
        grid.starts.push(grid.triangles.len() as u32);
        grid
    }

    fn cell(&self, point: DVec3) -> [i64; 3] {
        ((point - self.origin) / self.width).floor().to_array().map(|c| c as i64)
    }

    /// The cells that hold what may be meant by a point.
    fn cells_near(&self, point: DVec3) -> impl Iterator<Item = usize> {
        let (low, high) = (self.cell(point - self.slack), self.cell(point + self.slack));
        let range = move |axis: usize| low[axis]..=high[axis];
        range(0)
            .flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| [x, y, z])))
            .filter_map(|cell| self.cells.get(&cell).map(|&number| number as usize))
    }

    /// Gives every triangle of the model, moved, the nearest free one of the copy with the same keys and the same side
    /// in front; `None` where one finds none.
    pub(super) fn pair(&self, model: &Shape, motion: &DAffine3, budget: &mut Budget) -> Option<Vec<Pair>> {
        let count = model.corners.len();
        let mirrored = motion.matrix3.determinant() < 0.0;
        let mut free = Free { used: Vec::new(), heads: Vec::new() };
        for probe in 0..PROBES.min(count) {
            self.nearest(model, probe * count / PROBES.min(count), motion, mirrored, &mut free, budget)?;
        }
        free = Free { used: vec![false; count], heads: self.starts.clone() };
        let mut pairs = Vec::with_capacity(count);
        for triangle in 0..count {
            let pair = self.nearest(model, triangle, motion, mirrored, &mut free, budget)?;
            free.used[pair.triangle as usize] = true;
            pairs.push(pair);
        }
        Some(pairs)
    }

    fn nearest(
        &self,
        model: &Shape,
        triangle: usize,
        motion: &DAffine3,
        mirrored: bool,
        free: &mut Free,
        budget: &mut Budget,
    ) -> Option<Pair> {
        let moved = model.corners[triangle].map(|p| motion.transform_point3(p));
        let mut best: Option<(f64, Pair)> = None;
        for cell in self.cells_near(middle(&moved)) {
            for at in free.skip_used(cell, self)..self.starts[cell + 1] as usize {
                budget.spend(1)?;
                let other = self.triangles[at];
                if free.is_used(other) {
                    continue;
                }
                for turn in 0..3 {
                    let pair = Pair { triangle: other, turn };
                    if let Some(distance) = self.distance(&moved, &model.keys[triangle], pair, mirrored)
                        && best.is_none_or(|(least, _)| distance < least)
                    {
                        best = Some((distance, pair));
                    }
                }
                if best.is_some_and(|(distance, _)| distance == 0.0) {
                    return best.map(|(_, pair)| pair);
                }
            }
        }
        best.map(|(_, pair)| pair)
    }

    /// How far the farthest corner is off, if the triangles may be the same.
    fn distance(&self, moved: &[DVec3; 3], keys: &[u64; 3], pair: Pair, mirrored: bool) -> Option<f64> {
        let (corners, other_keys) =
            (&self.copy.corners[pair.triangle as usize], &self.copy.keys[pair.triangle as usize]);
        let order = pair.corners(mirrored);
        if (0..3).any(|i| keys[i] != other_keys[order[i]]) {
            return None;
        }
        let distance = (0..3).map(|i| moved[i].distance(corners[order[i]])).fold(0.0, f64::max);
        (distance <= self.slack).then_some(distance)
    }
}

/// The triangles of a copy that have no partner yet.
struct Free {
    /// Empty where all are free.
    used: Vec<bool>,
    /// The first place in each cell that may be free.
    heads: Vec<u32>,
}

impl Free {
    fn is_used(&self, triangle: u32) -> bool {
        self.used.get(triangle as usize).is_some_and(|used| *used)
    }

    /// The first place of a cell that may be free: of very many triangles in one place each is looked at once.
    fn skip_used(&mut self, cell: usize, grid: &Grid) -> usize {
        let Some(head) = self.heads.get_mut(cell) else { return grid.starts[cell] as usize };
        while *head < grid.starts[cell + 1] && self.used[grid.triangles[*head as usize] as usize] {
            *head += 1;
        }
        *head as usize
    }
}
