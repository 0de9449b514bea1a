//! Top-down division of very many boxes into parts small enough to process at once.
//!
//! I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", IEEE Symposium on Interactive Ray Tracing
//! 2007: a node is split at the boundary of a few centroid bins where the cost of the two sides is least. Parts are
//! then processed in parallel; peak memory is that of a few parts.

use glam::DVec3;
use rayon::prelude::*;

use super::{Node, Tree};
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::Bounds;

/// Bins along each axis.
const BINS: usize = 32;

/// Items per parallel task.
const CHUNK: usize = 1 << 13;

/// Parts below this depth are halved, which limits the depth of any tree to about this plus the logarithm of the number
/// of items.
const DEEP: u32 = 32;

/// Divides items with finite, non-empty boxes into parts of at most `largest`, in parallel; applies `leaf` to each part
/// and `join` to the results of two neighbouring parts.
pub(super) fn divide<T: Send>(
    members: Vec<u32>,
    largest: usize,
    bounds: &(dyn Fn(u32) -> Bounds + Sync),
    leaf: &(impl Fn(Vec<u32>) -> T + Sync),
    join: &(impl Fn(T, T) -> T + Sync),
) -> T {
    below(members, 0, &Division { largest, bounds, leaf, join })
}

/// How to divide items.
struct Division<'a, L, J> {
    largest: usize,
    bounds: &'a (dyn Fn(u32) -> Bounds + Sync),
    leaf: &'a L,
    join: &'a J,
}

fn below<T, L, J>(members: Vec<u32>, depth: u32, by: &Division<L, J>) -> T
where
    T: Send,
    L: Fn(Vec<u32>) -> T + Sync,
    J: Fn(T, T) -> T + Sync,
{
    if members.len() <= by.largest {
        return (by.leaf)(members);
    }
    let (left, right) = in_two(members, depth, by.bounds);
    let (left, right) = rayon::join(|| below(left, depth + 1, by), || below(right, depth + 1, by));
    (by.join)(left, right)
}

/// Divides members in two; each side keeps the order of the members.
fn in_two(members: Vec<u32>, depth: u32, bounds: &(dyn Fn(u32) -> Bounds + Sync)) -> (Vec<u32>, Vec<u32>) {
    let around = |chunk: &[u32]| Bounds::of(chunk.iter().map(|&i| bounds(i).center()));
    let centers = members.par_chunks(CHUNK).map(around).reduce(|| Bounds::EMPTY, |a, b| a.union(&b));
    let grid = Grid::over(&centers);
    let bins_of = |chunk: &[u32]| Bins::of(chunk.iter().map(|&i| bounds(i)), &grid);
    let split = (depth < DEEP)
        .then(|| members.par_chunks(CHUNK).map(bins_of).reduce(|| Bins::EMPTY, Bins::join).best())
        .flatten();
    let Some(split) = split else { return halves(members, &centers, bounds) };
    let goes_left: Vec<bool> =
        members.par_iter().with_min_len(CHEAP_ELEMENTS).map(|&i| grid.bin(&bounds(i))[split.axis] < split.at).collect();
    let side = |left: bool| members.iter().zip(&goes_left).filter(|m| *m.1 == left).map(|m| *m.0).collect();
    (side(true), side(false))
}

/// Halves members along the longest axis of their centres, regardless of cost.
fn halves(members: Vec<u32>, centers: &Bounds, bounds: &dyn Fn(u32) -> Bounds) -> (Vec<u32>, Vec<u32>) {
    let axis = centers.size().max_position();
    let along = |i: u32| bounds(i).center()[axis];
    let mut left = members;
    let middle = left.len() / 2;
    left.select_nth_unstable_by(middle, |&a, &b| along(a).total_cmp(&along(b)).then(a.cmp(&b)));
    let mut right = left.split_off(middle);
    left.sort_unstable();
    right.sort_unstable();
    (left, right)
}

/// Maps centres to bins.
struct Grid {
    min: DVec3,
    bins_per_unit: DVec3,
}

impl Grid {
    fn over(centers: &Bounds) -> Grid {
        // An axis without extent has one bin.
        let bins_per_unit = centers.size().to_array().map(|size| BINS as f64 / size);
        let bins_per_unit = bins_per_unit.map(|n| if n.is_finite() { n } else { 0.0 });
        Grid { min: centers.min, bins_per_unit: DVec3::from(bins_per_unit) }
    }

    fn bin(&self, bounds: &Bounds) -> [usize; 3] {
        let at = (bounds.center() - self.min) * self.bins_per_unit;
        at.to_array().map(|x| (x as usize).min(BINS - 1))
    }
}

/// Contents of the bins along each axis.
struct Bins([[Bin; BINS]; 3]);

#[derive(Clone, Copy)]
struct Bin {
    bounds: Bounds,
    count: u32,
}

impl Bin {
    const EMPTY: Bin = Bin { bounds: Bounds::EMPTY, count: 0 };

    fn join(&mut self, other: &Bin) {
        self.bounds = self.bounds.union(&other.bounds);
        self.count += other.count;
    }

    /// Area times number of items.
    fn cost(&self) -> f64 {
        self.bounds.area() * f64::from(self.count)
    }
}

impl Bins {
    const EMPTY: Bins = Bins([[Bin::EMPTY; BINS]; 3]);

    fn of(boxes: impl Iterator<Item = Bounds>, grid: &Grid) -> Bins {
        let mut bins = Bins::EMPTY;
        for bounds in boxes {
            let one = Bin { bounds, count: 1 };
            bins.0.iter_mut().zip(grid.bin(&bounds)).for_each(|(axis, at)| axis[at].join(&one));
        }
        bins
    }

    fn join(mut self, other: Bins) -> Bins {
        self.0.as_flattened_mut().iter_mut().zip(other.0.as_flattened()).for_each(|(bin, other)| bin.join(other));
        self
    }

    /// Returns the split of least cost; `None` if all centres coincide.
    fn best(&self) -> Option<Split> {
        let splits = (0..3).flat_map(|axis| (1..BINS).map(move |at| (axis, at)));
        let priced = splits.filter_map(|(axis, at)| Some((self.price(axis, at)?, Split { axis, at })));
        priced.reduce(|a, b| if b.0 < a.0 { b } else { a }).map(|(_, split)| split)
    }

    /// Returns the cost of both sides of a split; `None` if one side is empty.
    fn price(&self, axis: usize, at: usize) -> Option<f64> {
        let side = |bins: &[Bin]| {
            let mut all = Bin::EMPTY;
            bins.iter().for_each(|bin| all.join(bin));
            all
        };
        let (left, right) = self.0[axis].split_at(at);
        let (left, right) = (side(left), side(right));
        (left.count > 0 && right.count > 0).then(|| left.cost() + right.cost())
    }
}

/// A split: bins from `at` on go right.
struct Split {
    axis: usize,
    at: usize,
}

/// Joins two non-empty trees below a new root.
pub(super) fn joined(left: Tree, right: Tree) -> Tree {
    let (of_left, items) = (left.nodes.len() as u32, left.order.len() as u32);
    let moved = |node: &Node, inner: u32, leaf: u32| match node.is_leaf() {
        true => Node { first: node.first + leaf, ..*node },
        false => Node { first: node.first + inner, ..*node },
    };
    // The two roots are adjacent: nodes below the left root move by two, those below the right root by the size of the
    // left tree plus one.
    let mut nodes = Vec::with_capacity(1 + left.nodes.len() + right.nodes.len());
    nodes.push(Node { first: 1, count: 0 });
    nodes.push(moved(&left.nodes[0], 2, 0));
    nodes.push(moved(&right.nodes[0], of_left + 1, items));
    nodes.extend(left.nodes[1..].iter().map(|node| moved(node, 2, 0)));
    nodes.extend(right.nodes[1..].iter().map(|node| moved(node, of_left + 1, items)));
    let mut order = left.order;
    order.extend(right.order);
    Tree { nodes, order }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::Quality;
    use glam::dvec3;

    fn parts(boxes: &[Bounds], largest: usize) -> Vec<Vec<u32>> {
        let join = |mut a: Vec<Vec<u32>>, b: Vec<Vec<u32>>| {
            a.extend(b);
            a
        };
        divide((0..boxes.len() as u32).collect(), largest, &|i| boxes[i as usize], &|part| vec![part], &join)
    }

    fn assert_each_once(parts: &[Vec<u32>], count: u32, largest: usize) {
        assert!(parts.iter().all(|part| (1..=largest).contains(&part.len()) && part.is_sorted()));
        let mut all = parts.concat();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..count));
    }

    fn unit_box(min: DVec3) -> Bounds {
        Bounds { min, max: min + DVec3::ONE }
    }

    #[test]
    fn heaps_that_lie_apart_are_told_apart() {
        let boxes: Vec<Bounds> =
            (0..300).map(|i| unit_box(dvec3(f64::from(i % 7), 0.0, f64::from(i % 3) * 100.0))).collect();
        let found = parts(&boxes, 120);
        assert_each_once(&found, 300, 120);
        assert_eq!(found.len(), 3);
        assert!(found.iter().all(|part| part.iter().all(|i| i % 3 == part[0] % 3)));
    }

    #[test]
    fn equal_points_are_halved() {
        let points = vec![Bounds { min: DVec3::ONE, max: DVec3::ONE }; 1000];
        let found = parts(&points, 10);
        assert_each_once(&found, 1000, 10);
        assert!(found.iter().all(|part| part.len() >= 7));
    }

    #[test]
    fn parts_of_very_different_sizes_end() {
        let boxes: Vec<Bounds> = (0..1000).map(|i| unit_box(DVec3::splat(2f64.powi(i / 3)))).collect();
        assert_each_once(&parts(&boxes, 1), 1000, 1);
    }

    #[test]
    fn two_trees_join_below_one_root() {
        let boxes =
            (0..5000).map(|i| unit_box(dvec3(f64::from(i * 7919 % 101), f64::from(i % 97), 0.0))).collect::<Vec<_>>();
        let half = |range: std::ops::Range<usize>| {
            let mut tree = Tree::build(&boxes[range.clone()], Quality::Medium);
            tree.order.iter_mut().for_each(|i| *i += range.start as u32);
            tree
        };
        let (left, right) = (half(0..1234), half(1234..5000));
        let tree = joined(left.clone(), right.clone());
        assert_eq!(tree.items_below(1), 0..1234);
        assert_eq!(tree.order, [left.order.clone(), right.order.clone()].concat());
        let costs = [&left, &right].map(|t| t.bounds(&boxes).iter().map(Bounds::area).sum::<f64>());
        let all = tree.bounds(&boxes);
        assert_eq!(all[0], boxes.iter().fold(Bounds::EMPTY, |a, b| a.union(b)));
        let below: f64 = all[1..].iter().map(Bounds::area).sum();
        assert!((below / (costs[0] + costs[1]) - 1.0).abs() < 1e-12);
    }
}
