//! Redivides two neighbouring pieces at a time if that costs less.
//!
//! Like D. Cohen-Steiner, P. Alliez, M. Desbrun, "Variational Shape Approximation", SIGGRAPH 2004, this alternates
//! between shapes and their proxies, but for two pieces at a time, so that the sum never grows: the triangles of both
//! are cut across a few directions where the sum of the areas of the two boxes, each times its triangles, is least,
//! keeping the rotations of the boxes (in bins as in I. Wald, "On fast Construction of SAH-based Bounding Volume
//! Hierarchies", Interactive Ray Tracing 2007); then the boxes are rotated to fit their new contents.

use std::array::from_fn;
use std::ops::Range;

use glam::{DMat3, DVec3};

use super::pieces::{Cluster, Shaping};
use crate::scene::{Bounds, Mesh};

/// Number of bins along a direction.
const BINS: usize = 64;

/// Maximum number of rounds over all pairs, and of triangles of a mesh processed in all rounds together.
const MOST_ROUNDS: usize = 6;
const MOST_TRIANGLES: usize = 1 << 18;

/// A cut must save more than this share of the cost of two pieces.
const WORTH_A_CUT: f64 = 1e-3;

/// Redivides neighbours as long as that pays off.
pub(super) fn improve(mesh: &Mesh, clusters: &mut [Cluster], by: Shaping) {
    let rounds = (MOST_TRIANGLES / mesh.triangle_count().max(1)).min(MOST_ROUNDS);
    let mut changed = vec![true; clusters.len()];
    for _ in 0..rounds {
        let before = std::mem::replace(&mut changed, vec![false; clusters.len()]);
        for [a, b] in neighbours(clusters) {
            let is_new = [a, b].iter().any(|&i| before[i] || changed[i]);
            if is_new && divide(mesh, clusters, [a, b], by) {
                (changed[a], changed[b]) = (true, true);
            }
        }
        if !changed.contains(&true) {
            break;
        }
    }
}

/// Returns pairs, in ascending order, of clusters whose boxes overlap along the axes of either.
fn neighbours(clusters: &[Cluster]) -> Vec<[usize; 2]> {
    let span = |of: &Cluster, axes: &DMat3| Bounds::of(of.points.iter().map(|&p| *axes * p));
    let own: Vec<Bounds> = clusters.iter().map(|c| span(c, &c.axes)).collect();
    let meets = |a: usize, b: usize| own[a].overlaps(&span(&clusters[b], &clusters[a].axes));
    let pairs = (0..clusters.len()).flat_map(|a| (a + 1..clusters.len()).map(move |b| [a, b]));
    pairs.filter(|&[a, b]| meets(a, b) && meets(b, a)).collect()
}

/// Redivides two pieces; returns whether that paid off.
fn divide(mesh: &Mesh, clusters: &mut [Cluster], [a, b]: [usize; 2], by: Shaping) -> bool {
    let (one, other) = (&clusters[a], &clusters[b]);
    let (costs, count) = (one.cost() + other.cost(), one.triangles.len());
    let pair = Pair::new(mesh, one, other);
    let mut directions: Vec<DVec3> = [one, other].iter().flat_map(|c| (0..3).map(|i| c.axes.row(i))).collect();
    directions.push(pair.middle_of(count..pair.triangles.len()) - pair.middle_of(0..count));
    let cuts = directions.into_iter().filter_map(|along| pair.best_cut(along));
    let Some(best) = cuts.min_by(|a, b| a.cost.total_cmp(&b.cost)) else { return false };
    let most = (1.0 - WORTH_A_CUT) * costs;
    if best.cost >= most {
        return false;
    }
    let [near, far] = pair.sides(&best).map(|side| Cluster::near(mesh, side, &[one.axes, other.axes], by));
    let pays = near.cost() + far.cost() < most;
    if pays {
        (clusters[a], clusters[b]) = (near, far);
    }
    pays
}

/// The triangles of two pieces.
struct Pair {
    triangles: Vec<u32>,
    middles: Vec<DVec3>,
    /// Boxes of the triangles, along the axes of each piece.
    boxes: [Vec<Bounds>; 2],
}

/// Separates triangles whose middle lies in a bin before `bin` along a direction from the others.
struct Cut {
    cost: f64,
    along: DVec3,
    bin: usize,
}

impl Pair {
    fn new(mesh: &Mesh, one: &Cluster, other: &Cluster) -> Pair {
        let triangles: Vec<u32> = [one.triangles.as_slice(), &other.triangles].concat();
        let corners: Vec<[DVec3; 3]> = triangles.iter().map(|&t| mesh.corners(t).map(|p| p.as_dvec3())).collect();
        let along = |axes: &DMat3| corners.iter().map(|c| Bounds::of(c.map(|p| *axes * p))).collect();
        let boxes = [along(&one.axes), along(&other.axes)];
        let middles = corners.iter().map(|[a, b, c]| (a + b + c) / 3.0).collect();
        Pair { triangles, middles, boxes }
    }

    fn middle_of(&self, which: Range<usize>) -> DVec3 {
        let middles = &self.middles[which];
        middles.iter().sum::<DVec3>() / middles.len().max(1) as f64
    }

    /// Returns the bin of each triangle along a direction.
    fn bins(&self, along: DVec3) -> Vec<usize> {
        let at: Vec<f64> = self.middles.iter().map(|m| along.dot(*m)).collect();
        let (least, most) = at.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| (a.min(x), b.max(x)));
        at.iter().map(|x| (((x - least) / (most - least) * BINS as f64) as usize).min(BINS - 1)).collect()
    }

    /// Returns the cut of least cost across a direction.
    fn best_cut(&self, along: DVec3) -> Option<Cut> {
        let mut counts = [0usize; BINS];
        let mut boxes = [[Bounds::EMPTY; 2]; BINS];
        for (i, bin) in self.bins(along).into_iter().enumerate() {
            counts[bin] += 1;
            (0..2).for_each(|axes| boxes[bin][axes] = boxes[bin][axes].union(&self.boxes[axes][i]));
        }
        let costs = |bins: &mut dyn Iterator<Item = usize>| -> Vec<f64> {
            let (mut all, mut count) = ([Bounds::EMPTY; 2], 0);
            bins.map(|bin| {
                all = from_fn(|axes| all[axes].union(&boxes[bin][axes]));
                count += counts[bin];
                if count == 0 { f64::NAN } else { all[0].area().min(all[1].area()) * count as f64 }
            })
            .collect()
        };
        let (near, far) = (costs(&mut (0..BINS)), costs(&mut (0..BINS).rev()));
        let cut = |bin: usize| Cut { cost: near[bin - 1] + far[BINS - 1 - bin], along, bin };
        (1..BINS).map(cut).filter(|cut| cut.cost.is_finite()).min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// Returns the triangles on each side of a cut.
    fn sides(&self, cut: &Cut) -> [Vec<u32>; 2] {
        let (mut near, mut far) = (Vec::new(), Vec::new());
        for (&triangle, bin) in self.triangles.iter().zip(self.bins(cut.along)) {
            if bin < cut.bin { near.push(triangle) } else { far.push(triangle) }
        }
        [near, far]
    }
}

#[cfg(test)]
mod tests {
    use super::super::pieces::joined;
    use super::*;
    use crate::cost::segments::Boxed;
    use crate::layout::test_scenes::*;
    use crate::scene::Scene;
    use crate::tree::Quality;
    use glam::{DAffine3, Vec3};
    use std::f32::consts::{PI, TAU};

    const IMPROVED: Shaping = Shaping { turns: true, improves: true };

    const RINGS: usize = 160;
    const SIDES: usize = 12;

    /// A tube of radius 0.2 along three quarters of a circle of radius 2, in a plane oblique to the axes, its triangles
    /// shuffled.
    fn bent_tube() -> Vec<[Vec3; 3]> {
        let (x, y) = (Vec3::new(1.0, 2.0, 2.0) / 3.0, Vec3::new(2.0, 1.0, -2.0) / 3.0);
        let point = |ring: usize, side: usize| {
            let u = 1.5 * PI * ring as f32 / RINGS as f32;
            let v = TAU * (side % SIDES) as f32 / SIDES as f32;
            (2.0 + 0.2 * v.cos()) * (u.cos() * x + u.sin() * y) + 0.2 * v.sin() * x.cross(y)
        };
        let triangle = |i: usize| {
            let (r, s) = (i / 2 / SIDES, i / 2 % SIDES);
            let [a, b, c, d] = [point(r, s), point(r + 1, s), point(r + 1, s + 1), point(r, s + 1)];
            if i.is_multiple_of(2) { [a, b, c] } else { [a, c, d] }
        };
        let count = 2 * RINGS * SIDES;
        // 1,009 is a prime that does not divide the count.
        (0..count).map(|i| triangle(i * 1009 % count)).collect()
    }

    fn scene(triangles: Vec<[Vec3; 3]>) -> Scene {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("mesh", vec![(0, triangles)]);
        builder.place(mesh, "mesh", DAffine3::IDENTITY);
        builder.scene()
    }

    fn cost(clusters: &[Cluster]) -> f64 {
        clusters.iter().map(Cluster::cost).sum()
    }

    #[test]
    fn a_bent_tube_is_cut_along_its_length_whatever_the_order_of_its_triangles() {
        let scene = scene(bent_tube());
        let mesh = &scene.meshes[0];
        let stretch_of = |t: u32, count: usize| t as usize * 1009 % (2 * RINGS * SIDES) * count / (2 * RINGS * SIDES);
        for count in [8, 12, 16] {
            let stretch = |i: usize| (0..mesh.triangle_count() as u32).filter(|&t| stretch_of(t, count) == i).collect();
            let stretches: Vec<Cluster> = (0..count).map(|i| Cluster::near(mesh, stretch(i), &[], IMPROVED)).collect();
            let found = joined(mesh, &Boxed::of_mesh(mesh, Quality::Medium), &[count], IMPROVED).remove(0);
            assert_eq!(found.len(), count);
            assert!(cost(&found) < 1.1 * cost(&stretches), "{count}: {} {}", cost(&found), cost(&stretches));
        }
    }

    #[test]
    fn pieces_that_interleave_come_apart() {
        let scene = scene(row(Vec3::ZERO, 100));
        let mesh = &scene.meshes[0];
        let every_other = |i: u32| Cluster::near(mesh, (i..100).step_by(2).collect(), &[], IMPROVED);
        let mut clusters = [every_other(0), every_other(1)];
        let before = cost(&clusters);
        improve(mesh, &mut clusters, IMPROVED);
        assert!(cost(&clusters) < 0.6 * before, "{} of {before}", cost(&clusters));
        let mut sizes = clusters.map(|c| c.triangles.len());
        sizes.sort_unstable();
        assert!(sizes[0] + sizes[1] == 100 && sizes[0] > 40, "{sizes:?}");
    }

    #[test]
    fn what_cannot_be_divided_stays() {
        for corner in [Vec3::ZERO, Vec3::splat(1e30), Vec3::splat(1e-30), Vec3::NAN, Vec3::INFINITY] {
            let mut scene = scene(vec![[Vec3::ZERO; 3]; 20]);
            scene.meshes[0].geometries[0].positions = vec![corner; 60].into();
            let mesh = &scene.meshes[0];
            let half = |from: u32| Cluster::near(mesh, (from..from + 10).collect(), &[], IMPROVED);
            let mut clusters = [half(0), half(10)];
            improve(mesh, &mut clusters, IMPROVED);
            assert_eq!(clusters.map(|c| c.triangles.len()), [10, 10], "{corner}");
        }
    }
}
