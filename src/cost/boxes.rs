//! Boxes per surface point.
//!
//! The number of instances that a ray starting or ending on a surface must enter at least: the ideal is one. After the
//! end-point overlap of T. Aila, T. Karras, S. Laine, "On Quality Metrics of Bounding Volume Hierarchies", High
//! Performance Graphics 2013, counted for the instances of a TLAS only.

use glam::DVec3;
use rayon::prelude::*;

use super::structure::Structure;
use crate::scene::Bounds;
use crate::tree::Tree;

/// Number of points that [`super::measure`] samples.
pub const POINTS: usize = 10_000;

/// How many instance boxes contain a random surface point. Best 1, no upper limit; 0 if there are no points. Does not
/// model the contents of the boxes or the order in which a ray meets them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoxesPerPoint {
    /// Mean over the points.
    pub mean: f64,
    /// The smallest number that at least 95 % of the points do not exceed.
    pub p95: f64,
    /// The largest number.
    pub max: f64,
}

impl BoxesPerPoint {
    /// Counts the boxes of a structure around each point. Boxes are closed, and a point outside by no more than
    /// rounding error counts as inside.
    pub fn of(structure: &Structure, points: &[DVec3]) -> BoxesPerPoint {
        let counter = BoxCounter::new(&structure.tlas, &structure.boxes);
        let mut counts: Vec<u32> = points.par_iter().map(|point| counter.around(*point)).collect();
        counts.sort_unstable();
        let Some(&max) = counts.last() else {
            return BoxesPerPoint::default();
        };
        let sum: u64 = counts.iter().map(|&c| u64::from(c)).sum();
        BoxesPerPoint {
            mean: sum as f64 / counts.len() as f64,
            p95: f64::from(counts[(counts.len() * 95).div_ceil(100) - 1]),
            max: f64::from(max),
        }
    }
}

/// Bound on the rounding error of a point relative to the largest coordinate: a few units in the last place of a
/// transform.
const ROUNDING: f64 = 1e-14;

/// The intersection of all boxes below a node of the tree, and their number.
#[derive(Clone)]
struct Shared {
    common: Bounds,
    boxes: u32,
}

impl Shared {
    /// Whether each of the boxes shares a point with `around`, even if they have none in common.
    fn all_touch(&self, around: &Bounds) -> bool {
        self.common.min.cmple(around.max).all() && around.min.cmple(self.common.max).all()
    }
}

/// Counts the boxes around points.
pub(crate) struct BoxCounter<'a> {
    tlas: &'a Tree,
    boxes: &'a [Bounds],
    nodes: Vec<Bounds>,
    shared: Vec<Shared>,
    /// By how much a point outside a box still counts as inside.
    margin: DVec3,
}

impl<'a> BoxCounter<'a> {
    /// Prepares to count boxes that a tree is built over.
    pub(crate) fn new(tlas: &'a Tree, boxes: &'a [Bounds]) -> BoxCounter<'a> {
        let nodes = tlas.bounds(boxes);
        let reach = nodes.first().map_or(0.0, |all| all.min.abs().max(all.max.abs()).max_element());
        BoxCounter { tlas, boxes, shared: shared_by_all(tlas, boxes), nodes, margin: DVec3::splat(ROUNDING * reach) }
    }

    /// Returns the number of boxes that contain a point.
    pub(crate) fn around(&self, point: DVec3) -> u32 {
        let around = Bounds { min: point - self.margin, max: point + self.margin };
        let mut count = 0;
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(n) = stack.pop() {
            let (node, shared) = (self.tlas.nodes[n as usize], &self.shared[n as usize]);
            if !self.nodes[n as usize].overlaps(&around) {
                continue;
            }
            if shared.all_touch(&around) {
                count += shared.boxes;
            } else if node.is_leaf() {
                let items = &self.tlas.order[node.items()];
                count += items.iter().filter(|&&i| self.boxes[i as usize].overlaps(&around)).count() as u32;
            } else {
                stack.extend([node.first, node.first + 1]);
            }
        }
        count
    }
}

/// Returns [`Shared`] of every node, so that a node whose boxes all touch a point is counted at once: a hundred
/// thousand equal boxes take no longer than separate ones.
fn shared_by_all(tlas: &Tree, boxes: &[Bounds]) -> Vec<Shared> {
    let everything = Bounds { min: Bounds::EMPTY.max, max: Bounds::EMPTY.min };
    let of_leaf = |items: &[u32]| Shared {
        common: items.iter().fold(everything, |all, &i| all.intersection(&boxes[i as usize])),
        boxes: items.len() as u32,
    };
    let join = |a: &Shared, b: &Shared| Shared { common: a.common.intersection(&b.common), boxes: a.boxes + b.boxes };
    tlas.refit(of_leaf, join)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::Quality;
    use glam::dvec3;
    use proptest::prelude::*;

    fn structure(boxes: Vec<Bounds>) -> Structure {
        Structure { tlas: Tree::build_usable(&boxes, Quality::Instances), boxes, blas: vec![] }
    }

    fn cube(min: DVec3, size: f64) -> Bounds {
        Bounds { min, max: min + size }
    }

    proptest! {
        #[test]
        fn counts_are_those_of_every_box_tested(
            corners in prop::collection::vec((0..9i32, 0..9i32, 0..9i32, 0..5i32), 0..60),
            points in prop::collection::vec((0..9i32, 0..9i32, 0..9i32), 1..40),
        ) {
            let point = |(x, y, z): (i32, i32, i32)| dvec3(x.into(), y.into(), z.into());
            let boxes: Vec<Bounds> =
                corners.iter().map(|&(x, y, z, s)| cube(point((x, y, z)), s.into())).collect();
            let points: Vec<DVec3> = points.into_iter().map(point).collect();
            let inside = |p: &DVec3| boxes.iter().filter(|b| b.overlaps(&cube(*p, 0.0))).count() as f64;
            let mut counts: Vec<f64> = points.iter().map(inside).collect();
            counts.sort_by(f64::total_cmp);
            let actual = BoxesPerPoint::of(&structure(boxes.clone()), &points);
            prop_assert!((actual.mean - counts.iter().sum::<f64>() / counts.len() as f64).abs() < 1e-12);
            prop_assert_eq!(actual.max, counts[counts.len() - 1]);
            let below = |limit: f64| counts.iter().filter(|&&c| c <= limit).count() * 20 >= counts.len() * 19;
            prop_assert!(below(actual.p95) && (actual.p95 == counts[0] || !below(actual.p95 - 1.0)));
        }
    }

    #[test]
    fn faces_belong_to_both_boxes_and_to_a_point_rounded_off_them() {
        let s = structure(vec![cube(DVec3::ZERO, 1.0), cube(DVec3::X, 1.0)]);
        let count = |p| BoxesPerPoint::of(&s, &[p]).mean;
        assert_eq!(count(dvec3(1.0, 0.5, 0.5)), 2.0);
        assert_eq!(count(dvec3(0.5, 1.0 + f64::EPSILON, 0.5)), 1.0);
        assert_eq!(count(dvec3(0.5, 1.0 + 1e-9, 0.5)), 0.0);
    }

    #[test]
    fn no_points_or_no_boxes_count_nothing() {
        assert_eq!(BoxesPerPoint::of(&structure(vec![cube(DVec3::ZERO, 1.0)]), &[]), BoxesPerPoint::default());
        assert_eq!(BoxesPerPoint::of(&structure(vec![]), &[DVec3::ZERO]), BoxesPerPoint::default());
    }
}
