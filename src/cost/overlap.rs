//! The overlap ratio.
//!
//! T. Bilák, "Scene optimization for RTX", master's thesis, Czech Technical University in Prague, 2024, chapter 5: sum
//! over all pairs of objects of the surface area of the intersection of their boxes, divided by the surface area of the
//! scene's box. Boxes are closed: if two boxes touch in a face, they overlap by both sides of a flat box, which
//! reproduces the values of the thesis's table 5.1.
//!
//! Each box queries a tree over all boxes for those after it in tree order, so the work is proportional to the number
//! of pairs. The ratio does not need to visit pairs in which one box encloses the other: sums stored in the nodes
//! replace them, so a million equal boxes take no longer than a million separate ones.

use rayon::prelude::*;

use crate::scene::Bounds;
use crate::tree::{Quality, Tree};

/// Two boxes that overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Index of the first box.
    pub a: u32,
    /// Index of the second box, above `a`.
    pub b: u32,
    /// Surface area of the intersection, in squared units.
    pub area: f64,
}

impl Pair {
    /// The order of [`worst_pairs`].
    fn worse_first(&self, other: &Pair) -> std::cmp::Ordering {
        other.area.total_cmp(&self.area).then((self.a, self.b).cmp(&(other.a, other.b)))
    }
}

/// Returns all pairs of boxes that share a point and whose intersection has a surface area above `min_area` (in squared
/// units), ordered by `a`, then `b`. Boxes that are empty or not finite overlap nothing.
pub fn pairs(boxes: &[Bounds], min_area: f64) -> Vec<Pair> {
    let index = Index::over(boxes);
    let found = |query: &Item, at: usize, stack: &mut Vec<u32>, found: &mut Vec<Pair>| {
        let common_area = |other: &Bounds| {
            let common = query.bounds.intersection(other);
            (!common.is_empty()).then(|| common.area()).filter(|&area| area > min_area)
        };
        let enter = |volume: &Volume| common_area(&volume.around).is_some();
        index.visit_later(at, stack, enter, |other| {
            if let Some(area) = common_area(&other.bounds) {
                found.push(Pair { a: query.id.min(other.id), b: query.id.max(other.id), area });
            }
        });
    };
    let mut pairs: Vec<Pair> = index.map_chunks(found).into_iter().flatten().collect();
    pairs.par_sort_unstable_by_key(|p| (p.a, p.b));
    pairs
}

/// Returns the `count` pairs of boxes with the largest intersections, worst first; of equal ones, those with the lowest
/// `a`, then the lowest `b`. Boxes that are empty or not finite and intersections without an area do not count.
pub fn worst_pairs(boxes: &[Bounds], count: usize) -> Vec<Pair> {
    let index = Index::over(boxes);
    let find = |query: &Item, at: usize, stack: &mut Vec<u32>, worst: &mut Vec<Pair>| {
        let pair = |other: &Bounds, id: u32| {
            let area = query.bounds.intersection(other).area();
            Pair { a: query.id.min(id), b: query.id.max(id), area }
        };
        let full = worst.len() == count;
        // The pairs found before bound the search; those of this query are added afterwards.
        let last = worst.last().copied().filter(|_| full);
        let counts = |p: &Pair| p.area > 0.0 && last.is_none_or(|last| Pair::worse_first(p, &last).is_lt());
        let mut found = Vec::new();
        index.visit_later(
            at,
            stack,
            |volume| counts(&pair(&volume.around, volume.lowest_id)),
            |other| {
                found.extend(Some(pair(&other.bounds, other.id)).filter(counts));
            },
        );
        keep_worst(worst, found, count);
    };
    let mut worst = Vec::new();
    index.map_chunks(find).into_iter().for_each(|of_chunk| keep_worst(&mut worst, of_chunk, count));
    worst
}

/// Returns for each box whether its intersection with any other one has a surface area above `min_area` (in squared
/// units, at least 0). Boxes that are empty or not finite overlap nothing. Stops at the first of a box's overlaps, so the
/// work does not follow the number of pairs.
pub fn overlapping(boxes: &[Bounds], min_area: f64) -> Vec<bool> {
    let index = Index::over(boxes);
    let find = |query: &Item, _: usize, stack: &mut Vec<u32>, found: &mut Vec<u32>| {
        let counts = |other: &Bounds| query.bounds.intersection(other).area() > min_area;
        if counts(&query.bounds) && index.any_other(query, stack, counts) {
            found.push(query.id);
        }
    };
    let mut overlapping = vec![false; boxes.len()];
    index.map_chunks(find).into_iter().flatten().for_each(|id| overlapping[id as usize] = true);
    overlapping
}

/// Merges pairs into a sorted list that keeps the worst.
fn keep_worst(worst: &mut Vec<Pair>, found: Vec<Pair>, count: usize) {
    if !found.is_empty() {
        worst.extend(found);
        worst.sort_unstable_by(Pair::worse_first);
        worst.truncate(count);
    }
}

/// Returns the sum of the surface areas of the intersections of all pairs of boxes, in squared units. Boxes that are
/// empty or not finite do not count.
pub fn shared_area(boxes: &[Bounds]) -> f64 {
    Index::over(boxes).shared_area()
}

/// Returns the sum of the surface areas of the intersections of all pairs of boxes, divided by the surface area of the
/// box around all boxes; at least 0, best 0, no upper limit. Boxes that are empty or not finite do not count; 0 if the
/// box around all boxes has no area. Does not model the contents of the boxes.
pub fn ratio(boxes: &[Bounds]) -> f64 {
    let index = Index::over(boxes);
    let scene = index.volumes.first().map_or(0.0, |root| root.around.area());
    super::share(index.shared_area(), scene)
}

/// A box and its index in the input.
struct Item {
    id: u32,
    bounds: Bounds,
}

/// Summary of the items below a node of the tree.
#[derive(Clone)]
struct Volume {
    /// The box around them.
    around: Bounds,
    /// Their intersection; may be empty.
    common: Bounds,
    /// Sum of their surface areas.
    area: f64,
    /// The first item, in tree order.
    first: u32,
    /// One past the last item.
    end: u32,
    /// The lowest index in the input.
    lowest_id: u32,
}

/// Boxes in tree order, with the tree over them.
struct Index {
    items: Vec<Item>,
    tree: Tree,
    /// Parallel to the nodes of the tree.
    volumes: Vec<Volume>,
}

/// Queries per task: fixed, so that sums round equally for any number of threads.
const CHUNK: usize = 512;

impl Index {
    fn over(boxes: &[Bounds]) -> Index {
        let mut tree = Tree::build_usable(boxes, Quality::Fast);
        let items: Vec<Item> = tree.order.iter().map(|&id| Item { id, bounds: boxes[id as usize] }).collect();
        tree.order = (0..items.len() as u32).collect();
        let volumes = tree.refit(|places| Volume::of(&items, places), Volume::join);
        Index { items, tree, volumes }
    }

    /// Runs a query for each item, with a stack for [`Index::visit_later`]; returns one result per chunk, in tree
    /// order.
    fn map_chunks<T: Default + Send>(&self, query: impl Fn(&Item, usize, &mut Vec<u32>, &mut T) + Sync) -> Vec<T> {
        let chunk = |(c, items): (usize, &[Item])| {
            let (mut stack, mut result) = (Vec::new(), T::default());
            for (i, item) in items.iter().enumerate() {
                query(item, c * CHUNK + i, &mut stack, &mut result);
            }
            result
        };
        self.items.par_chunks(CHUNK).enumerate().map(chunk).collect()
    }

    /// Visits the items after position `at`, except in nodes that `enter` rejects.
    fn visit_later(
        &self,
        at: usize,
        stack: &mut Vec<u32>,
        mut enter: impl FnMut(&Volume) -> bool,
        mut visit: impl FnMut(&Item),
    ) {
        stack.push(0);
        while let Some(n) = stack.pop() {
            let (node, volume) = (self.tree.nodes[n as usize], &self.volumes[n as usize]);
            if volume.end as usize <= at + 1 || !enter(volume) {
                continue;
            }
            if node.is_leaf() {
                self.items[(volume.first as usize).max(at + 1)..volume.end as usize].iter().for_each(&mut visit);
            } else {
                stack.extend([node.first + 1, node.first]);
            }
        }
    }

    /// Whether an item other than the query has a box that counts. A box that does not count must hold none that does.
    fn any_other(&self, query: &Item, stack: &mut Vec<u32>, counts: impl Fn(&Bounds) -> bool) -> bool {
        stack.clear();
        stack.push(0);
        while let Some(n) = stack.pop() {
            let (node, volume) = (self.tree.nodes[n as usize], &self.volumes[n as usize]);
            if !counts(&volume.around) {
                continue;
            }
            if !node.is_leaf() {
                stack.extend([node.first + 1, node.first]);
                continue;
            }
            let items = &self.items[volume.first as usize..volume.end as usize];
            if items.iter().any(|other| other.id != query.id && counts(&other.bounds)) {
                return true;
            }
        }
        false
    }

    /// Returns the sum of the surface areas of the intersections of all pairs.
    fn shared_area(&self) -> f64 {
        let add =
            |query: &Item, at, stack: &mut Vec<u32>, sum: &mut f64| *sum += self.shared_with_later(query, at, stack);
        self.map_chunks(add).iter().sum()
    }

    /// Returns the sum of the surface areas of an item's intersections with the items after its position.
    fn shared_with_later(&self, query: &Item, at: usize, stack: &mut Vec<u32>) -> f64 {
        let (mut whole, mut single) = (0.0, 0.0);
        let enter = |volume: &Volume| {
            if volume.first as usize > at {
                if query.bounds.contains(&volume.around) {
                    whole += volume.area;
                    return false;
                }
                if volume.common.contains(&query.bounds) {
                    whole += f64::from(volume.end - volume.first) * query.bounds.area();
                    return false;
                }
            }
            query.bounds.overlaps(&volume.around)
        };
        self.visit_later(at, stack, enter, |other| single += query.bounds.intersection(&other.bounds).area());
        whole + single
    }
}

impl Volume {
    /// Summarises the items of a leaf.
    fn of(items: &[Item], places: &[u32]) -> Volume {
        let first = places.first().map_or(0, |&p| p);
        let one = |&p: &u32| {
            let Item { id, bounds } = items[p as usize];
            Volume { around: bounds, common: bounds, area: bounds.area(), first: p, end: p + 1, lowest_id: id }
        };
        let none = Volume {
            around: Bounds::EMPTY,
            common: Bounds { min: Bounds::EMPTY.max, max: Bounds::EMPTY.min },
            area: 0.0,
            first,
            end: first,
            lowest_id: u32::MAX,
        };
        places.iter().map(one).fold(none, |all, one| Volume::join(&all, &one))
    }

    /// Summarises two neighbours in tree order.
    fn join(left: &Volume, right: &Volume) -> Volume {
        Volume {
            around: left.around.union(&right.around),
            common: left.common.intersection(&right.common),
            area: left.area + right.area,
            first: left.first,
            end: right.end,
            lowest_id: left.lowest_id.min(right.lowest_id),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, dvec3};
    use proptest::prelude::*;

    fn bounds(min: [f64; 3], max: [f64; 3]) -> Bounds {
        Bounds { min: min.into(), max: max.into() }
    }

    fn pairs_by_definition(boxes: &[Bounds], min_area: f64) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for (a, first) in boxes.iter().enumerate() {
            for (b, second) in boxes.iter().enumerate().skip(a + 1) {
                let area = first.intersection(second).area();
                if first.overlaps(second) && area > min_area {
                    pairs.push(Pair { a: a as u32, b: b as u32, area });
                }
            }
        }
        pairs
    }

    fn ratio_by_definition(boxes: &[Bounds]) -> f64 {
        let scene = boxes.iter().filter(|b| !b.is_empty()).fold(Bounds::EMPTY, |all, b| all.union(b)).area();
        let sum: f64 = pairs_by_definition(boxes, 0.0).iter().map(|p| p.area).sum();
        if scene > 0.0 { sum / scene } else { 0.0 }
    }

    /// Boxes with corners on a coarse grid, so that many are equal, nested, flat, or touching; some are empty.
    fn grid_boxes() -> impl Strategy<Value = Vec<Bounds>> {
        let corner = || [0..6i32, 0..6i32, 0..6i32].prop_map(|c| DVec3::from(c.map(f64::from)));
        let grid_box = (corner(), corner(), 0..10u32).prop_map(|(a, b, kind)| match kind {
            0 => Bounds { min: a, max: b },
            _ => Bounds::of([a, b]),
        });
        prop::collection::vec(grid_box, 0..120)
    }

    fn spread_boxes() -> impl Strategy<Value = Vec<Bounds>> {
        let corner = || [-1.0..1.0, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from);
        let spread_box = (corner(), corner(), 0.0..1.0).prop_map(|(a, b, size)| Bounds::of([a, a + size * b]));
        (prop::collection::vec(spread_box, 0..120), -30..=30i32).prop_map(|(boxes, exponent)| {
            let scale = 10f64.powi(exponent);
            boxes.into_iter().map(|b| Bounds { min: scale * b.min, max: scale * b.max }).collect()
        })
    }

    fn assert_near(actual: f64, expected: f64) {
        assert!((actual - expected).abs() <= 1e-12 * expected.abs(), "{actual} for {expected}");
    }

    proptest! {
        #[test]
        fn pairs_and_ratio_follow_the_definition_on_a_grid(boxes in grid_boxes(), min_area in -1..12) {
            let min_area = f64::from(min_area);
            prop_assert_eq!(pairs(&boxes, min_area), pairs_by_definition(&boxes, min_area));
            assert_near(ratio(&boxes), ratio_by_definition(&boxes));
        }

        #[test]
        fn pairs_and_ratio_follow_the_definition_at_any_scale(boxes in spread_boxes()) {
            prop_assert_eq!(pairs(&boxes, 0.0), pairs_by_definition(&boxes, 0.0));
            assert_near(ratio(&boxes), ratio_by_definition(&boxes));
        }
    }

    proptest! {
        #[test]
        fn the_worst_pairs_are_the_first_of_all(boxes in grid_boxes(), count in 1..20usize) {
            let mut all = pairs_by_definition(&boxes, 0.0);
            all.sort_by(Pair::worse_first);
            all.truncate(count);
            prop_assert_eq!(worst_pairs(&boxes, count), all);
        }
    }

    proptest! {
        #[test]
        fn overlapping_boxes_are_those_of_all_pairs(boxes in grid_boxes(), min_area in 0..12) {
            let min_area = f64::from(min_area);
            let mut expected = vec![false; boxes.len()];
            for Pair { a, b, .. } in pairs_by_definition(&boxes, min_area) {
                [a, b].into_iter().for_each(|i| expected[i as usize] = true);
            }
            prop_assert_eq!(overlapping(&boxes, min_area), expected);
        }
    }

    #[test]
    fn the_worst_of_equal_boxes_take_no_quadratic_time() {
        assert_eq!(overlapping(&vec![bounds([0.0; 3], [1.0; 3]); 100_000], 1.0), vec![true; 100_000]);
        let pairs = worst_pairs(&vec![bounds([0.0; 3], [1.0; 3]); 100_000], 3);
        assert_eq!(pairs.iter().map(|p| (p.a, p.b)).collect::<Vec<_>>(), [(0, 1), (0, 2), (0, 3)]);
    }

    #[test]
    fn half_shared_cubes_count_the_shared_box() {
        let boxes = [bounds([0.0; 3], [2.0; 3]), bounds([1.0, 0.0, 0.0], [3.0, 2.0, 2.0])];
        assert_eq!(pairs(&boxes, 0.0), [Pair { a: 0, b: 1, area: 16.0 }]);
        assert_eq!(ratio(&boxes), 16.0 / 32.0);
    }

    #[test]
    fn touching_faces_count_both_sides_and_touching_edges_nothing() {
        let boxes = [bounds([0.0; 3], [1.0; 3]), bounds([1.0, 0.0, 0.0], [2.0, 1.0, 1.0])];
        assert_eq!(ratio(&boxes), 2.0 / 10.0);
        let boxes = [bounds([0.0; 3], [1.0; 3]), bounds([1.0, 1.0, 0.0], [2.0, 2.0, 1.0])];
        assert_eq!(ratio(&boxes), 0.0);
        assert_eq!(pairs(&boxes, 0.0), []);
        assert_eq!(pairs(&boxes, -1.0), [Pair { a: 0, b: 1, area: 0.0 }]);
    }

    #[test]
    fn flat_boxes_have_two_sides() {
        let floor = bounds([0.0; 3], [4.0, 4.0, 0.0]);
        assert_eq!(ratio(&[floor, floor]), 1.0);
        assert_eq!(ratio(&[floor, bounds([1.0, 1.0, -1.0], [2.0, 2.0, 1.0])]), 2.0 / 64.0);
    }

    #[test]
    fn nothing_overlaps_where_nothing_has_an_area() {
        let point = bounds([3.0; 3], [3.0; 3]);
        for boxes in [vec![], vec![point], vec![point; 3], vec![Bounds::EMPTY; 2]] {
            assert_eq!(ratio(&boxes), 0.0);
            assert_eq!(pairs(&boxes, 0.0), []);
        }
    }

    #[test]
    fn boxes_that_are_not_finite_do_not_count() {
        let cube = bounds([0.0; 3], [1.0; 3]);
        let bad = [bounds([f64::NAN; 3], [1.0; 3]), bounds([0.0; 3], [f64::INFINITY; 3])];
        assert_eq!(ratio(&[bad[0], cube, bad[1], cube]), 1.0);
        assert_eq!(pairs(&[bad[0], cube, bad[1], cube], 0.0), [Pair { a: 1, b: 3, area: 6.0 }]);
        assert_eq!(ratio(&[bounds([-1e300; 3], [1e300; 3]); 2]), 0.0);
    }

    #[test]
    fn equal_and_nested_boxes_take_no_quadratic_time() {
        let n = 300_000;
        let equal = vec![bounds([0.0; 3], [1.0; 3]); n];
        assert_near(ratio(&equal), n as f64 * (n as f64 - 1.0) / 2.0);
        let nested: Vec<Bounds> =
            (1..=n).map(|i| Bounds { min: DVec3::splat(-(i as f64)), max: DVec3::splat(i as f64) }).collect();
        let expected: f64 = (1..=n).map(|i| (n - i) as f64 * (i as f64 / n as f64).powi(2)).sum();
        assert!((ratio(&nested) / expected - 1.0).abs() < 1e-9);
    }

    #[test]
    fn ratio_is_the_same_for_any_number_of_threads() {
        let at = |i: u32| dvec3(f64::from(i * 7919 % 1009), f64::from(i * 104_729 % 997), f64::from(i % 31)) / 37.0;
        let boxes: Vec<Bounds> = (0..5000).map(|i| Bounds { min: at(i), max: at(i) + DVec3::ONE }).collect();
        let with = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let one = with(1).install(|| (ratio(&boxes), pairs(&boxes, 0.1)));
        let three = with(3).install(|| (ratio(&boxes), pairs(&boxes, 0.1)));
        assert_eq!(one.0.to_bits(), three.0.to_bits());
        assert_eq!(one.1, three.1);
    }
}
