//! Areas weighted by what rays meet, instead of lines.
//!
//! SAH estimates the probability that a line that meets a node's box also meets that of its child as the ratio of their
//! areas (J. Goldsmith, J. Salmon, "Automatic Creation of Object Hierarchies for Ray Tracing", IEEE Computer Graphics
//! and Applications 7(5), 1987). But rays start and end on surfaces, and few reach what is occluded. So the share of
//! ray segments that continue from a node to its child is used instead; if few reach the node, it is drawn towards the
//! ratio of areas as if [`PRIOR`] more segments had followed that. Areas become *met areas*, all relative to the
//! root's.

use std::cell::Cell;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering::Relaxed};

use glam::DAffine3;
use rayon::prelude::*;

use super::facts::{Facts, Own, OwnFrames};
use super::soup::{Soup, Turned};
use super::units::Unit;
use crate::cost::sah::{INTERSECTION, TRAVERSAL};
use crate::cost::segments::{Boxed, Segment};
use crate::scene::Bounds;
use crate::tree::{Quality, Tree};

/// Weight of the area ratio, in segments.
const PRIOR: f64 = 8.0;

/// Segments processed per round.
const BLOCK: usize = 64;

/// Number of boxes met after which no further segments are processed.
const MOST_MET: usize = 1 << 25;

/// Ratio of what rays meet to what lines would, for each node.
pub(super) struct MetAreas {
    /// For its box.
    of_box: Vec<f64>,
    /// For the cost of its contents.
    of_inside: Vec<f64>,
    facts: Vec<Facts>,
}

impl MetAreas {
    /// Measures a tree over some triangles of a soup in the frame `base`.
    pub(super) fn new(soup: &Soup, tree: &Tree, facts: &[Facts], base: &Turned, segments: &[Segment]) -> MetAreas {
        let around = |items: &[u32]| items.iter().fold(Bounds::EMPTY, |all, &t| all.union(&soup.bounds_in(base, t)));
        let boxed = Boxed { bounds: tree.refit(around, Bounds::union), tree: tree.clone() };
        let counts = counts_of_nodes(&boxed, segments, &soup.seen_in(base));
        let mut of_box = vec![1.0; facts.len()];
        for (at, node) in tree.nodes.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
            for child in [node.first as usize, node.first as usize + 1] {
                let lines = ratio(facts[child].area, facts[at].area, 0.0);
                let rays = (f64::from(counts[child]) + PRIOR * lines) / (f64::from(counts[at]) + PRIOR);
                of_box[child] = of_box[at] * ratio(rays, lines, 1.0);
            }
        }
        MetAreas::scaled(tree, facts, of_box)
    }

    /// Scales the facts by the ratio for each box and recomputes costs.
    fn scaled(tree: &Tree, facts: &[Facts], of_box: Vec<f64>) -> MetAreas {
        let mut met = MetAreas { of_inside: vec![1.0; facts.len()], facts: facts.to_vec(), of_box };
        for (at, node) in tree.nodes.iter().enumerate().rev() {
            let below = (!node.is_leaf()).then(|| [met.facts[node.first as usize], met.facts[node.first as usize + 1]]);
            let (fact, of_box) = (&mut met.facts[at], met.of_box[at]);
            (fact.area, fact.loose, fact.world_area) =
                (of_box * fact.area, of_box * fact.loose, of_box * fact.world_area);
            fact.inside = match below {
                None => INTERSECTION * f64::from(fact.triangles) * fact.area,
                Some([a, b]) => TRAVERSAL * fact.area + a.inside + b.inside,
            };
            met.of_inside[at] = ratio(fact.inside, facts[at].inside, 1.0);
        }
        met
    }

    /// Returns the facts measured by rays.
    pub(super) fn facts(&self) -> &[Facts] {
        &self.facts
    }

    /// Like [`MetAreas::facts`].
    pub(super) fn into_facts(self) -> Vec<Facts> {
        self.facts
    }

    /// Returns the frames of nodes measured by rays: another frame saves the same share of what rays meet as of what
    /// lines meet.
    pub(super) fn own(&self, own: &[Option<Box<Own>>]) -> OwnFrames {
        let scaled = |at: usize, own: &Own| Own {
            inside: self.of_inside[at] * own.inside,
            loose: self.of_box[at] * own.loose,
            ..*own
        };
        let cut_by_rays = |(at, own): (usize, &Option<Box<Own>>)| own.as_deref().map(|own| Box::new(scaled(at, own)));
        own.iter().enumerate().map(cut_by_rays).collect()
    }

    /// Returns units measured by rays: their share of the tree and their cost in their own frame.
    pub(super) fn units(&self, units: &[Unit], shares: &[f64], soup: &Soup, segments: &[Segment]) -> Vec<Unit> {
        let boxes: Vec<Bounds> = units.iter().map(|unit| unit.world).collect();
        let (counts, used) = counts_of_boxes(&boxes, segments, &soup.seen_in(&Turned::NOT));
        let root = self.facts.first().map_or(0.0, |fact| fact.loose);
        let cut_by_rays = |(unit, count): (&Unit, u32)| {
            let share: f64 = unit.items.iter().map(|&t| shares[t as usize]).sum();
            let lines = ratio(unit.own.loose, root, 0.0);
            let met = (f64::from(count) + PRIOR * lines) / (used as f64 + PRIOR);
            let own = Own { inside: unit.own.inside * ratio(share, unit.share, 1.0), loose: root * met, ..unit.own };
            Unit { own, share, ..unit.clone() }
        };
        units.iter().zip(counts).map(cut_by_rays).collect()
    }
}

/// Returns `a / b`, or `otherwise` if that is undefined.
fn ratio(a: f64, b: f64, otherwise: f64) -> f64 {
    if b > 0.0 && b.is_finite() && a.is_finite() { a / b } else { otherwise }
}

/// Counts the segments that meet the box of each node; `into` transforms them to the coordinates of the boxes.
fn counts_of_nodes(tree: &Boxed, segments: &[Segment], into: &DAffine3) -> Vec<u32> {
    let visit = |segment: &Segment, meet: &dyn Fn(u32)| {
        tree.visit(&mut segment.under(into), |node, _| meet(node as u32));
    };
    count(tree.tree.nodes.len(), segments, visit).0
}

/// Counts the segments that meet each box; also returns how many segments were processed.
fn counts_of_boxes(boxes: &[Bounds], segments: &[Segment], into: &DAffine3) -> (Vec<u32>, usize) {
    let tree = Boxed::build(boxes, Quality::Instances);
    count(boxes.len(), segments, |segment, meet| {
        tree.visit(&mut segment.under(into), |node, segment| {
            tree.items(node).iter().filter(|&&item| segment.meets(&boxes[item as usize])).for_each(|&item| meet(item));
        });
    })
}

/// Counts how often each of `things` is met; also returns how many segments were processed: an even sample if all would
/// meet more than [`MOST_MET`] things in total, as when very many boxes overlap in one place.
fn count(things: usize, segments: &[Segment], visit: impl Fn(&Segment, &dyn Fn(u32)) + Sync) -> (Vec<u32>, usize) {
    // Integer sums do not depend on their order.
    let counts: Vec<AtomicU32> = (0..things).map(|_| AtomicU32::new(0)).collect();
    let (rounds, met, mut used) = (segments.len().div_ceil(BLOCK), AtomicUsize::new(0), 0);
    for round in 0..rounds {
        let block: Vec<&Segment> = segments.iter().skip(round).step_by(rounds).collect();
        block.par_iter().for_each(|segment| {
            let own = Cell::new(0);
            visit(segment, &|thing| {
                counts[thing as usize].fetch_add(1, Relaxed);
                own.set(own.get() + 1);
            });
            met.fetch_add(own.get(), Relaxed);
        });
        used += block.len();
        if met.load(Relaxed) > MOST_MET {
            break;
        }
    }
    (counts.into_iter().map(AtomicU32::into_inner).collect(), used)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::facts::facts;
    use super::*;
    use crate::layout::builder::{Object, objects};
    use crate::layout::test_scenes::{SceneBuilder, row};
    use crate::scene::{InstanceId, Scene};

    /// Two rows of triangles far apart along x, the second half as long, with their tree and its facts.
    struct Known {
        soup: Soup,
        tree: Tree,
        facts: Vec<Facts>,
    }

    fn known() -> Known {
        let mut builder = SceneBuilder::default();
        builder.object("near", 0, row(glam::Vec3::ZERO, 8));
        builder.object("far", 0, row(glam::Vec3::X * 100.0, 4));
        let scene: Scene = builder.scene();
        let objects: Vec<Object> = objects(&scene, [0, 1].map(InstanceId));
        let soup = Soup::new(&scene, &objects, None);
        let tree = Tree::build_from(soup.len(), Quality::Medium, &|t| soup.bounds_in(&Turned::NOT, t));
        let facts = facts(&soup, &tree, &Turned::NOT);
        Known { soup, tree, facts }
    }

    fn met(known: &Known, segments: &[Segment]) -> MetAreas {
        MetAreas::new(&known.soup, &known.tree, &known.facts, &Turned::NOT, segments)
    }

    /// Returns the node of all triangles of the first row, and that of the second.
    fn rows(known: &Known) -> [usize; 2] {
        [8, 4].map(|n| (0..known.facts.len()).find(|&at| known.facts[at].triangles == n).expect("a row is a node"))
    }

    #[test]
    fn without_rays_areas_count() {
        let known = known();
        let met = met(&known, &[]);
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b;
        assert!(met.facts().iter().zip(&known.facts).all(|(a, b)| close(a.area, b.area) && close(a.inside, b.inside)));
    }

    #[test]
    fn what_rays_do_not_come_to_costs_nothing() {
        let known = known();
        let [near, far] = rows(&known);
        let up = |x: f64| Segment::new(DVec3::new(x, 0.3, -1.0), DVec3::Z, 2.0);
        let segments: Vec<Segment> = (0..4000).map(|i| up(f64::from(i % 8) + 0.3)).collect();
        let met = met(&known, &segments);
        let share = |at: usize| met.facts()[at].area / met.facts()[0].area;
        assert!(share(near) > 0.99 && share(far) < 0.01, "{} {}", share(near), share(far));
        let costs = [near, far].map(|at| met.facts()[at].inside / known.facts[at].inside);
        assert!(costs[0] > 50.0 * costs[1], "{costs:?}");
    }

    #[test]
    fn work_is_bounded_and_what_is_looked_at_is_spread() {
        let segments: Vec<Segment> = (0..1000).map(|i| Segment::new(DVec3::X * f64::from(i), DVec3::Z, 1.0)).collect();
        let (counts, used) = count(1, &segments, |_, meet| (0..MOST_MET as u32 / 80).for_each(|_| meet(0)));
        assert!((64..200).contains(&used), "{used}");
        assert_eq!(counts[0] as usize, used * (MOST_MET / 80));
        let around = |i: u32| DVec3::X * f64::from(i);
        let boxes: Vec<Bounds> = (0..1000).map(|i| Bounds { min: around(i) - 0.1, max: around(i) + 0.1 }).collect();
        let (counts, used) = counts_of_boxes(&boxes, &segments, &DAffine3::IDENTITY);
        assert!(used == 1000 && counts.iter().all(|&count| count == 1));
    }

    #[test]
    fn a_frame_of_its_own_saves_the_same_share() {
        let known = known();
        let [near, _] = rows(&known);
        let up = Segment::new(DVec3::new(0.3, 0.3, -1.0), DVec3::Z, 2.0);
        let met = met(&known, &[up; 100]);
        let mut own = vec![None; known.facts.len()];
        let (inside, loose) = (0.5 * known.facts[near].inside, known.facts[near].loose);
        let half = Own { frame: Turned::NOT, inside, loose, bounds: Bounds::EMPTY };
        own[near] = Some(Box::new(half));
        let found = met.own(&own)[near].take().expect("there was one");
        assert!((found.inside / met.facts()[near].inside - 0.5).abs() < 1e-12);
        assert!((found.loose / met.facts()[near].loose - 1.0).abs() < 1e-12);
    }

    #[test]
    fn units_are_entered_by_the_rays_that_meet_them() {
        let known = known();
        let up = Segment::new(DVec3::new(0.3, 0.3, -1.0), DVec3::Z, 2.0);
        let met = met(&known, &[up; 1000]);
        let world = |from: f64, to: f64| {
            let seen = known.soup.seen_in(&Turned::NOT);
            Bounds::of([DVec3::new(from, 0.0, 0.0), DVec3::new(to, 1.0, 0.0)].map(|p| seen.transform_point3(p)))
        };
        let unit = |items: std::ops::Range<u32>, world: Bounds| Unit {
            own: Own { frame: Turned::NOT, inside: 1.0, loose: world.area(), bounds: world },
            share: 1.0,
            items: items.collect(),
            world,
        };
        let units = [unit(0..8, world(0.0, 8.0)), unit(8..12, world(100.0, 104.0))];
        let found = met.units(&units, &[0.25; 12], &known.soup, &[up; 1000]);
        let root = met.facts()[0].loose;
        assert!(found[0].own.loose > 0.99 * root && found[1].own.loose < 0.01 * root);
        assert_eq!([found[0].share, found[1].share], [2.0, 1.0]);
        assert_eq!([found[0].own.inside, found[1].own.inside], [2.0, 1.0]);
    }
}
