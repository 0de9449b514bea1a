//! Motions that may map a mesh to another with vertices and triangles in a different order.
//!
//! Two corners of the model, together with the mean of all corners, determine a motion up to mirroring. They are chosen
//! far out, so that errors stay small, and rare: as different from other corners as possible in properties that no
//! motion changes. Each pair of matching corners of the copy gives two motions. A symmetric shape has no rare corners,
//! but nearly every pair is then right.

use std::hash::Hasher;

use glam::{DAffine3, DMat3, DVec3};
use rustc_hash::{FxHashMap, FxHashSet, FxHasher};

use super::grid::Budget;
use super::shape::Shape;
use super::signature::sides;

/// The distance of the first anchor from the middle is at least this share of the farthest corner's.
const FAR: f64 = 0.5;

/// The distance of the second anchor from the line through the middle and the first anchor is at least this share of
/// the farthest corner's.
const ASIDE: f64 = 0.3;

/// Points whose triangle with the middle is thinner than this are considered collinear with it.
const ON_A_LINE: f64 = 1e-6;

/// Lengths of the model that differ by less than this, in units of the spread, are considered equal when counting
/// rarity.
const ALIKE: f64 = 1e-3;

/// Properties of a corner that no motion or reordering changes; lengths in units of the spread.
#[derive(Clone, Copy)]
struct Feature {
    key: u64,
    /// Distance from the middle, the shorter and the longer adjacent side, the opposite side.
    lengths: [f64; 4],
    /// Position relative to the middle.
    at: DVec3,
}

impl Feature {
    fn looks_like(&self, model: &Feature, slack: f64) -> bool {
        let alike = |(a, b): (&f64, &f64)| (a - b).abs() <= slack * (1.0 + b);
        self.key == model.key && self.lengths.iter().zip(&model.lengths).all(alike)
    }

    fn class(&self) -> u64 {
        let mut hasher = FxHasher::default();
        hasher.write_u64(self.key);
        self.lengths.iter().for_each(|l| hasher.write_i64((l / ALIKE) as i64));
        hasher.finish()
    }
}

fn features(shape: &Shape) -> impl Iterator<Item = Feature> {
    shape.corners.iter().zip(&shape.keys).flat_map(move |(corners, keys)| {
        let all = keys.iter().fold(0, |sum: u64, k| sum.wrapping_add(*k));
        let sides = sides(corners).map(|s| s / shape.spread);
        (0..3).map(move |i| {
            let at = (corners[i] - shape.center) / shape.spread;
            let (a, b) = (sides[(i + 1) % 3], sides[(i + 2) % 3]);
            Feature { key: all ^ keys[i].rotate_left(17), lengths: [at.length(), a.min(b), a.max(b), sides[i]], at }
        })
    })
}

/// Calls `attempt` with motions that map `model` to `copy` as far as two corners determine, until it succeeds. `slack`
/// is how far corners of the copy may deviate.
pub(super) fn first_success<T>(
    model: &Shape,
    copy: &Shape,
    slack: f64,
    budget: &mut Budget,
    mut attempt: impl FnMut(&DAffine3, &mut Budget) -> Option<T>,
) -> Option<T> {
    let anchors = anchors(model)?;
    let slack = 4.0 * slack / copy.spread + 1e-9;
    let [first, second] = anchors.map(|anchor| lookalikes(copy, &anchor, slack));
    let angle = anchors[0].at.dot(anchors[1].at);
    let reach = 1.0 + anchors[0].lengths[0] + anchors[1].lengths[0];
    for &p in &first {
        for &q in &second {
            budget.spend(1)?;
            if (p.dot(q) - angle).abs() > slack * reach {
                continue;
            }
            for mirrored in [false, true] {
                let motion = motion(model, copy, anchors.map(|a| a.at), [p, q], mirrored);
                if let Some(found) = motion.and_then(|motion| attempt(&motion, budget)) {
                    return Some(found);
                }
            }
        }
    }
    None
}

/// Returns two corners that determine a motion; `None` if all corners lie on a line through the middle.
fn anchors(model: &Shape) -> Option<[Feature; 2]> {
    let all: Vec<Feature> = features(model).collect();
    let mut counts: FxHashMap<u64, u32> = FxHashMap::default();
    all.iter().for_each(|f| *counts.entry(f.class()).or_default() += 1);
    let rarest = |far_out: &dyn Fn(&Feature) -> f64, share: f64| -> Option<Feature> {
        let farthest = all.iter().map(far_out).fold(0.0, f64::max);
        let suitable = all.iter().filter(|f| far_out(f) >= share * farthest && farthest > ON_A_LINE);
        suitable.min_by_key(|f| counts[&f.class()]).copied()
    };
    let first = rarest(&|f| f.lengths[0], FAR)?;
    let second = rarest(&|f| first.at.cross(f.at).length(), ASIDE)?;
    Some([first, second])
}

/// Returns the positions of the corners that match an anchor, without duplicates.
fn lookalikes(copy: &Shape, anchor: &Feature, slack: f64) -> Vec<DVec3> {
    let mut places = FxHashSet::default();
    let alike = features(copy).filter(|f| f.looks_like(anchor, slack));
    alike.filter(|f| places.insert(f.at.to_array().map(f64::to_bits))).map(|f| f.at).collect()
}

/// Returns the similarity that maps the middle to the middle and the anchors as close to their targets as possible.
fn motion(model: &Shape, copy: &Shape, from: [DVec3; 2], to: [DVec3; 2], mirrored: bool) -> Option<DAffine3> {
    let basis = |[p, q]: [DVec3; 2], side: f64| -> Option<DMat3> {
        let x = p.try_normalize()?;
        let y = q.reject_from_normalized(x).try_normalize()?;
        Some(DMat3::from_cols(x, y, side * x.cross(y)))
    };
    let turn = basis(to, if mirrored { -1.0 } else { 1.0 })? * basis(from, 1.0)?.transpose();
    let linear = turn * (copy.spread / model.spread);
    Some(DAffine3::from_mat3_translation(linear, copy.center - linear * model.center))
}
