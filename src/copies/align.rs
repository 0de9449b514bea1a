//! Decides whether a mesh is a copy of another, checking each vertex and triangle.

use glam::{DAffine3, DMat3, DVec3};

use super::anchors;
use super::fit::{rounded, similarity, snapped};
use super::grid::{Budget, Grid, Pair};
use super::shape::Shape;
use super::signature::bar;

/// Anchors deviate by the tolerance, and the motion they determine by this multiple of it.
const ANCHOR_ERROR: f64 = 8.0;

/// Maximum number of triangle comparisons for a pair of meshes: per triangle, and in addition for any pair; beyond it,
/// the meshes do not count as copies.
const WORK: [u64; 2] = [64, 20_000];

/// How one mesh is a copy of another.
pub(super) struct Alignment {
    /// Copy from model; each coefficient is exactly a 32-bit float.
    pub(super) motion: DAffine3,
    /// For each triangle of the model, that of the copy.
    pub(super) triangles: Vec<u32>,
}

/// Two meshes with the same number of triangles, and how far corners of the copy may deviate.
struct Task<'a> {
    model: &'a Shape<'a>,
    copy: &'a Shape<'a>,
    tolerance: f64,
    /// Whether a motion is allowed.
    moves: bool,
}

/// Returns how `copy` is a copy of `model`, if it is: with triangles in the same order, else in any order. `distances`
/// are those of the model, as returned by [`Shape::distances`].
pub(super) fn align(model: &Shape, distances: &[f64], copy: &Shape, tolerance: f64, moves: bool) -> Option<Alignment> {
    let task = Task { model, copy, tolerance, moves };
    if model.corners.len() != copy.corners.len() || model.properties != copy.properties {
        return None;
    }
    let found = task.in_order();
    let resembles = || distances.iter().zip(copy.distances()).all(|(&a, b)| task.are_as_long(a, b));
    found.or_else(|| if resembles() { task.reordered() } else { None })
}

impl Task<'_> {
    /// Aligns triangles in the same order; in mirrored ones, the corners run in the opposite direction, starting at any
    /// of them.
    fn in_order(&self) -> Option<Alignment> {
        let hypotheses = [(false, 0), (true, 0), (true, 1), (true, 2)];
        let considered = if self.moves { &hypotheses[..] } else { &hypotheses[..1] };
        considered.iter().find_map(|&(mirrored, turn)| {
            let order = Pair { triangle: 0, turn }.corners(mirrored);
            let same = |(a, b): (&[u64; 3], &[u64; 3])| (0..3).all(|i| a[i] == b[order[i]]);
            let as_far = |(a, b): (&[DVec3; 3], &[DVec3; 3])| {
                (0..3).all(|i| self.are_as_long(self.model.distance(a[i]), self.copy.distance(b[order[i]])))
            };
            let (model, copy) = (self.model, self.copy);
            if !model.keys.iter().zip(&copy.keys).all(same) || !model.corners.iter().zip(&copy.corners).all(as_far) {
                return None;
            }
            let pairs = (0..self.model.corners.len() as u32).map(|triangle| Pair { triangle, turn }).collect();
            self.settle(pairs, mirrored)
        })
    }

    /// Whether two distances from the middle, in units of the spread, differ by no more than the tolerance allows.
    fn are_as_long(&self, of_model: f64, of_copy: f64) -> bool {
        (of_model - of_copy).abs() <= bar(self.tolerance / self.copy.unit(), of_copy)
    }

    /// Aligns triangles in any order.
    fn reordered(&self) -> Option<Alignment> {
        let (model, copy) = (self.model, self.copy);
        if !(model.spread > 0.0 && copy.spread > 0.0) {
            return None;
        }
        let count = model.corners.len() as u64;
        let mut budget = Budget(WORK[0].saturating_mul(count).saturating_add(WORK[1]));
        let slack = ANCHOR_ERROR * self.tolerance + 1e-12 * (copy.spread + copy.center.length());
        let grid = Grid::new(copy, slack);
        let attempt = |motion: &DAffine3, budget: &mut Budget| {
            let pairs = grid.pair(model, motion, budget)?;
            self.settle(pairs, motion.matrix3.determinant() < 0.0)
        };
        if model.center.distance(copy.center) <= slack
            && let Some(found) = attempt(&DAffine3::IDENTITY, &mut budget)
        {
            return Some(found);
        }
        if !self.moves {
            return None;
        }
        anchors::first_success(model, copy, slack, &mut budget, attempt)
    }

    /// Finds the best motion for paired triangles; `None` if it or anything else does not agree closely enough.
    fn settle(&self, pairs: Vec<Pair>, mirrored: bool) -> Option<Alignment> {
        let motion = self.motion(&pairs, mirrored)?;
        self.agrees(&pairs, &motion, mirrored)
            .then(|| Alignment { motion, triangles: pairs.into_iter().map(|pair| pair.triangle).collect() })
    }

    /// Returns the motion, as stored in a file, that moves all corners to within the tolerance; the identity if that
    /// suffices.
    fn motion(&self, pairs: &[Pair], mirrored: bool) -> Option<DAffine3> {
        let is_near = |(p, q): (DVec3, DVec3)| p.distance(q) <= self.tolerance;
        if !mirrored && self.corners(pairs, mirrored).all(is_near) {
            return Some(DAffine3::IDENTITY);
        }
        if !self.moves {
            return None;
        }
        let best = similarity(self.corners(pairs, mirrored), mirrored)?;
        let candidates = [snapped(&best, self.model.center), best];
        let measured = candidates.iter().filter_map(rounded).map(|m| (self.error(pairs, &m, mirrored), m));
        let (error, motion) = measured.reduce(|a, b| if b.0 < a.0 { b } else { a })?;
        (error <= self.tolerance).then_some(motion)
    }

    /// Pairs the corners of the model with those of the copy.
    fn corners<'s>(&'s self, pairs: &'s [Pair], mirrored: bool) -> impl Iterator<Item = (DVec3, DVec3)> + Clone + 's {
        self.model.corners.iter().zip(pairs).flat_map(move |(corners, pair)| {
            let (order, others) = (pair.corners(mirrored), &self.copy.corners[pair.triangle as usize]);
            (0..3).map(move |i| (corners[i], others[order[i]]))
        })
    }

    /// Returns the largest deviation of a corner.
    fn error(&self, pairs: &[Pair], motion: &DAffine3, mirrored: bool) -> f64 {
        self.corners(pairs, mirrored).map(|(p, q)| motion.transform_point3(p).distance(q)).fold(0.0, f64::max)
    }

    /// Whether everything except the positions agrees.
    fn agrees(&self, pairs: &[Pair], motion: &DAffine3, mirrored: bool) -> bool {
        let scale = motion.matrix3.determinant().abs().cbrt();
        let turn = motion.matrix3 * (1.0 / scale);
        let along = motion.matrix3.x_axis.x;
        let is_turned = mirrored || motion.matrix3 != DMat3::from_diagonal(DVec3::splat(along)) || along < 0.0;
        let turn = is_turned.then_some(&turn);
        pairs.iter().enumerate().all(|(triangle, pair)| {
            let other = pair.triangle as usize;
            let corner =
                |(i, at): (usize, usize)| self.model.corner_agrees([triangle, i], self.copy, [other, at], turn);
            self.model.kind_agrees(triangle, self.copy, other)
                && pair.corners(mirrored).into_iter().enumerate().all(corner)
        })
    }
}
