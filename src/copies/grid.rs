//! A spatial grid of triangles, to find the image of a triangle.

use std::ops::Range;

use glam::{DAffine3, DVec3};
use rustc_hash::FxHashMap;

use super::shape::Shape;

/// The triangle of the copy that corresponds to a triangle of the model, and the corner that corresponds to its first
/// one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pair {
    pub(super) triangle: u32,
    pub(super) turn: u8,
}

impl Pair {
    /// Returns the copy's corners in the order of the model's; mirroring reverses it.
    pub(super) fn corners(self, mirrored: bool) -> [usize; 3] {
        let t = usize::from(self.turn);
        if mirrored { [t, (t + 2) % 3, (t + 1) % 3] } else { [t, (t + 1) % 3, (t + 2) % 3] }
    }
}

/// The remaining work for a pair of meshes, in triangle comparisons.
pub(super) struct Budget(pub(super) u64);

impl Budget {
    /// Subtracts work; `None` if too little is left.
    pub(super) fn spend(&mut self, work: u64) -> Option<()> {
        self.0 = self.0.checked_sub(work)?;
        Some(())
    }
}

/// Number of triangles on which a motion is tested before all are.
const PROBES: usize = 8;

/// The triangles of a copy by the mean of their corners. Indistinguishable triangles form a class, so that only one of
/// very many in the same place is examined.
pub(super) struct Grid<'a> {
    copy: &'a Shape<'a>,
    /// How far corners may deviate.
    slack: f64,
    width: f64,
    /// The classes of each non-empty cell.
    cells: FxHashMap<[i64; 3], Range<u32>>,
    /// Start of each class in `triangles`, followed by their number.
    classes: Vec<u32>,
    triangles: Vec<u32>,
}

fn middle(corners: &[DVec3; 3]) -> DVec3 {
    (corners[0] + corners[1] + corners[2]) / 3.0
}

impl<'a> Grid<'a> {
    pub(super) fn new(copy: &'a Shape<'a>, slack: f64) -> Grid<'a> {
        // Cells are large enough for their numbers not to overflow.
        let width = (2.0 * slack).max(1e-9 * copy.spread).max(f64::MIN_POSITIVE);
        let mut grid =
            Grid { copy, slack, width, cells: FxHashMap::default(), classes: Vec::new(), triangles: Vec::new() };
        let mut keyed: Vec<([i64; 3], u32)> =
            copy.corners.iter().zip(0..).map(|(corners, i)| (grid.cell(middle(corners)), i)).collect();
        let identity = |triangle: u32| {
            let corners = copy.corners[triangle as usize].map(|p| p.to_array().map(f64::to_bits));
            (corners, copy.keys[triangle as usize])
        };
        keyed
            .sort_unstable_by(|a, b| a.0.cmp(&b.0).then_with(|| identity(a.1).cmp(&identity(b.1))).then(a.1.cmp(&b.1)));
        for cell in keyed.chunk_by(|a, b| a.0 == b.0) {
            let first = grid.classes.len() as u32;
            for class in cell.chunk_by(|a, b| identity(a.1) == identity(b.1)) {
                grid.classes.push(grid.triangles.len() as u32);
                grid.triangles.extend(class.iter().map(|(_, triangle)| triangle));
            }
            grid.cells.insert(cell[0].0, first..grid.classes.len() as u32);
        }
        grid.classes.push(grid.triangles.len() as u32);
        grid
    }

    fn cell(&self, point: DVec3) -> [i64; 3] {
        ((point - self.copy.center) / self.width).floor().to_array().map(|c| c as i64)
    }

    /// Returns the classes in the cells that may contain a match for a point.
    fn near(&self, point: DVec3) -> impl Iterator<Item = usize> {
        let (low, high) = (self.cell(point - self.slack), self.cell(point + self.slack));
        let range = move |axis: usize| low[axis]..=high[axis];
        let cells = range(0).flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| [x, y, z])));
        cells.filter_map(|cell| self.cells.get(&cell)).flat_map(|c| c.start as usize..c.end as usize)
    }

    /// Pairs each triangle of the model, moved, with the nearest free one of the copy that has the same keys and
    /// orientation; `None` if one has no match.
    pub(super) fn pair(&self, model: &Shape, motion: &DAffine3, budget: &mut Budget) -> Option<Vec<Pair>> {
        let count = model.corners.len();
        let probes = PROBES.min(count);
        for probe in 0..probes {
            self.nearest(model, probe * count / probes, motion, &self.classes, budget)?;
        }
        let mut free = self.classes.clone();
        let mut pairs = Vec::with_capacity(count);
        for triangle in 0..count {
            let (class, turn) = self.nearest(model, triangle, motion, &free, budget)?;
            pairs.push(Pair { triangle: self.triangles[free[class] as usize], turn });
            free[class] += 1;
        }
        Some(pairs)
    }

    /// Returns the class of the nearest triangle and its turn; `free` holds the start of the free triangles in each
    /// class.
    fn nearest(
        &self,
        model: &Shape,
        triangle: usize,
        motion: &DAffine3,
        free: &[u32],
        budget: &mut Budget,
    ) -> Option<(usize, u8)> {
        let mirrored = motion.matrix3.determinant() < 0.0;
        let moved = model.corners[triangle].map(|p| motion.transform_point3(p));
        let mut best: Option<(f64, (usize, u8))> = None;
        for class in self.near(middle(&moved)) {
            budget.spend(1)?;
            if free[class] == self.classes[class + 1] {
                continue;
            }
            for turn in 0..3 {
                let pair = Pair { triangle: self.triangles[free[class] as usize], turn };
                if let Some(distance) = self.distance(&moved, &model.keys[triangle], pair, mirrored)
                    && best.is_none_or(|(least, _)| distance < least)
                {
                    best = Some((distance, (class, turn)));
                }
            }
        }
        best.map(|(_, found)| found)
    }

    /// Returns the largest deviation of a corner; `None` if the triangles cannot match.
    fn distance(&self, moved: &[DVec3; 3], keys: &[u64; 3], pair: Pair, mirrored: bool) -> Option<f64> {
        let at = pair.triangle as usize;
        let (corners, other_keys, order) = (&self.copy.corners[at], &self.copy.keys[at], pair.corners(mirrored));
        if (0..3).any(|i| keys[i] != other_keys[order[i]]) {
            return None;
        }
        let distance = (0..3).map(|i| moved[i].distance(corners[order[i]])).fold(0.0, f64::max);
        (distance <= self.slack).then_some(distance)
    }
}
