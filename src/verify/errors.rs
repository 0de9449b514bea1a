//! Errors of stored positions and of the hits that a tracer reports: by ray, by object of the input, by group of the
//! output.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::Serialize;

use super::Sides;
use super::compare::Tally;
use super::rounding::{self, SINGLE};
use super::structure::{Structure, reference_length};
use crate::scene::{InstanceId, Scene};

/// The largest errors of the classes of a [`Histogram`]; the last class has none.
const UP_TO: [f64; 10] = [1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Classes of a [`Histogram`].
const CLASSES: usize = UP_TO.len() + 1;

/// Groups listed in [`ErrorReport::worst_groups`].
const LISTED: usize = 16;

/// How relative distance errors are distributed, by decades.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Histogram {
    /// The largest error of each class; none for the last one.
    pub up_to: Vec<Option<f64>>,
    /// How many hits are in each class.
    #[serde(flatten)]
    pub hits: Sides<[u64; CLASSES]>,
}

impl Histogram {
    /// Of the hits that a comparison measured.
    pub(super) fn of(tally: &Tally) -> Histogram {
        let hits = Sides { before: tally.before.by_decade, after: tally.after.by_decade };
        Histogram { up_to: UP_TO.into_iter().map(Some).chain([None]).collect(), hits }
    }
}

/// Classes of an octave of errors, from 2^-64 to 1, by which [`Errors::p999`] is found.
const IN_AN_OCTAVE: usize = 8;

/// Octaves of these classes.
const OCTAVES: usize = 64;

/// Returns the root mean square of errors; 0 if there are none.
pub(crate) fn root_mean_square(errors: &[f64]) -> f64 {
    // Relative to the largest, so that squares neither overflow nor vanish.
    let largest = errors.iter().copied().fold(0.0, f64::max);
    if largest == 0.0 {
        return 0.0;
    }
    let squares: f64 = errors.iter().map(|error| (error / largest).powi(2)).sum();
    largest * (squares / errors.len() as f64).sqrt()
}

/// Returns the number that 99.9 % of the numbers do not exceed; 0 if there are none.
pub(crate) fn percentile_999(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_unstable_by(f64::total_cmp);
    let at = (numbers.len() * 999).div_ceil(1000);
    numbers.get(at.saturating_sub(1)).copied().unwrap_or(0.0)
}

/// The error of one hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HitError {
    /// Distance error over the distance, or over a thousandth of the scene's radius if that is more.
    pub(super) relative: f64,
    /// Distance error, in world units.
    pub(super) distance: f64,
    /// The instance of the input that is hit, and the distance error over the diagonal of its box.
    pub(super) object: (u32, f64),
}

/// Distance errors relative to the truth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Number of hits measured.
    pub count: u64,
    /// Largest relative error.
    pub max: f64,
    sum_of_squares: f64,
    /// How many are in each class of [`Histogram`].
    pub(super) by_decade: [u64; CLASSES],
    /// How many are in each class of eighths of octaves.
    fine: Fine,
    /// Largest error, in world units.
    pub(super) largest: f64,
    /// The instance of the input with the largest error over its size, and that ratio.
    pub(super) worst_object: Option<(u32, f64)>,
}

impl Errors {
    /// Returns the root mean square of the relative errors; 0 without hits.
    pub fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.sum_of_squares / self.count as f64).sqrt() }
    }

    /// Returns the relative error that 99.9 % of the hits do not exceed, rounded up to an eighth of an octave, but at most
    /// the largest error.
    pub fn p999(&self) -> f64 {
        let mut left = (self.count * 999).div_ceil(1000);
        let is_reached = |count: &u64| {
            let reached = *count >= left;
            left = left.saturating_sub(*count);
            reached
        };
        match self.fine.0.iter().position(is_reached) {
            Some(0) | None => 0.0,
            Some(class) if class == OCTAVES * IN_AN_OCTAVE => self.max,
            Some(class) => upper_end(class).min(self.max),
        }
    }

    pub(super) fn record(&mut self, error: HitError) {
        self.count += 1;
        self.max = self.max.max(error.relative);
        self.sum_of_squares += error.relative * error.relative;
        self.by_decade[UP_TO.iter().position(|most| error.relative <= *most).unwrap_or(UP_TO.len())] += 1;
        self.fine.0[fine_class(error.relative)] += 1;
        self.largest = self.largest.max(error.distance);
        self.worsen((error.object.1 > 0.0).then_some(error.object));
    }

    fn worsen(&mut self, object: Option<(u32, f64)>) {
        if object.map(|(_, ratio)| ratio) > self.worst_object.map(|(_, ratio)| ratio) {
            self.worst_object = object;
        }
    }

    pub(super) fn add(&mut self, other: Errors) {
        self.count += other.count;
        self.max = self.max.max(other.max);
        self.sum_of_squares += other.sum_of_squares;
        self.by_decade.iter_mut().zip(other.by_decade).for_each(|(all, more)| *all += more);
        self.largest = self.largest.max(other.largest);
        self.fine.0.iter_mut().zip(other.fine.0).for_each(|(all, more)| *all += more);
        self.worsen(other.worst_object);
    }
}

/// Numbers of errors: of those below 2^-64, then of each eighth of an octave.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fine([u64; OCTAVES * IN_AN_OCTAVE + 1]);

impl Default for Fine {
    fn default() -> Fine {
        Fine([0; OCTAVES * IN_AN_OCTAVE + 1])
    }
}

fn fine_class(error: f64) -> usize {
    let at = (error.log2() + OCTAVES as f64) * IN_AN_OCTAVE as f64;
    // Of zero, the logarithm is infinite; casts saturate.
    (at.floor() + 1.0).clamp(0.0, (OCTAVES * IN_AN_OCTAVE) as f64) as usize
}

/// Returns the largest error of a class of [`Fine`].
fn upper_end(class: usize) -> f64 {
    (class as f64 / IN_AN_OCTAVE as f64 - OCTAVES as f64).exp2()
}

/// How far hits of one group lie off the planes of their triangles, in world units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct OffPlane {
    hits: u64,
    largest: f64,
    /// The bound of the hit with the largest error.
    bound: f64,
    /// The largest error over its bound.
    share: f64,
}

impl OffPlane {
    pub(super) fn of_hit(off: f64, bound: f64) -> OffPlane {
        OffPlane { hits: 1, largest: off, bound, share: if off > 0.0 { off / bound } else { 0.0 } }
    }
}

/// [`OffPlane`] for each mesh of the output that was hit.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct OffPlanes(BTreeMap<u32, OffPlane>);

impl OffPlanes {
    pub(super) fn record(&mut self, mesh: u32, of: OffPlane) {
        let all = self.0.entry(mesh).or_default();
        all.hits += of.hits;
        // The larger bound of equal errors, so that the order does not matter.
        if (of.largest, of.bound) > (all.largest, all.bound) {
            (all.largest, all.bound) = (of.largest, of.bound);
        }
        all.share = all.share.max(of.share);
    }

    pub(super) fn add(&mut self, other: OffPlanes) {
        other.0.into_iter().for_each(|(mesh, of)| self.record(mesh, of));
    }
}

/// An error in world units, over the size of the scene, and over the size of an object of the input.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ErrorSizes {
    /// The largest, in world units.
    pub max: f64,
    /// The same over the diagonal of the input's box.
    pub ratio_of_scene: f64,
    /// The largest ratio of such an error to the diagonal of the box of the object it occurs at.
    pub ratio_of_object: f64,
    /// That object, by the name of its node; `None` without an error.
    pub object: Option<String>,
}

impl ErrorSizes {
    pub(super) fn new(before: &Scene, max: f64, worst: Option<(u32, f64)>) -> ErrorSizes {
        ErrorSizes {
            max,
            ratio_of_scene: (max / reference_length(before)).min(f64::MAX),
            ratio_of_object: worst.map_or(0.0, |(_, ratio)| ratio),
            object: worst.map(|(object, _)| before.instances[object as usize].display_name()),
        }
    }
}

/// The errors of one group, with the bounds that the derivation in `docs/accuracy.md` gives; in world units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroupErrors {
    /// Name of the mesh.
    pub name: String,
    /// The largest distance of a corner from its place; `None` if only surfaces were compared.
    pub position_error: Option<f64>,
    /// Its bound: what rounding the stored positions once may cost. For copies of another mesh, the error allowed.
    pub position_error_bound: f64,
    /// Number of rays that hit the group and whose error was measured.
    pub hits: u64,
    /// The largest distance of a reported hit from the plane of the triangle hit.
    pub hit_error: f64,
    /// The bound of the hit with that distance.
    pub hit_error_bound: f64,
    /// The largest such distance over its bound, at most 1.
    pub largest_share_of_bound: f64,
}

/// Errors of positions and hits.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ErrorReport {
    /// Of positions of the output; `None` if only surfaces were compared.
    pub position: Option<ErrorSizes>,
    /// Of the distances to the hits.
    pub distance: Sides<ErrorSizes>,
    /// The groups of the output with hits that may be off farthest for their size, at most 16.
    pub worst_groups: Vec<GroupErrors>,
}

impl ErrorReport {
    /// Of what a comparison of two scenes found; `allowed` is the largest allowed position error, in world units.
    pub(super) fn new(
        scenes: Sides<&Scene>,
        structure: Option<&Structure>,
        tally: &Tally,
        allowed: f64,
    ) -> ErrorReport {
        let Sides { before, after } = scenes;
        let distance = |of: &Errors| ErrorSizes::new(before, of.largest, of.worst_object);
        let position = |of: &Structure| {
            ErrorSizes::new(before, of.max_position_error, of.worst_object.map(|(object, ratio)| (object.0, ratio)))
        };
        ErrorReport {
            position: structure.map(position),
            distance: Sides { before: distance(&tally.before), after: distance(&tally.after) },
            worst_groups: worst_groups(after, structure, &tally.off_planes, allowed),
        }
    }
}

fn worst_groups(after: &Scene, structure: Option<&Structure>, off: &OffPlanes, allowed: f64) -> Vec<GroupErrors> {
    let mut places = vec![Vec::new(); after.meshes.len()];
    (0u32..).zip(&after.instances).for_each(|(i, instance)| places[instance.mesh.0 as usize].push(InstanceId(i)));
    let over_size = |mesh: u32, bound: f64| {
        let sizes = places[mesh as usize].iter().map(|i| after.instance_boxes()[i.0 as usize].diagonal());
        bound / sizes.fold(f64::INFINITY, f64::min)
    };
    let mut worst: Vec<(f64, u32, &OffPlane)> =
        off.0.iter().map(|(&mesh, of)| (over_size(mesh, of.bound), mesh, of)).collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    worst.truncate(LISTED);
    let of_group = |(_, mesh, of): (f64, u32, &OffPlane)| {
        let places = &places[mesh as usize];
        let largest = |of: &dyn Fn(InstanceId) -> f64| places.iter().map(|&i| of(i)).fold(0.0, f64::max);
        GroupErrors {
            name: match after.meshes[mesh as usize].name.as_str() {
                "" => format!("mesh {}", after.meshes[mesh as usize].source),
                name => name.to_owned(),
            },
            position_error: structure.map(|structure| largest(&|i| structure.of_instances[i.0 as usize])),
            position_error_bound: largest(&|i| position_bound(after, i, allowed)),
            hits: of.hits,
            hit_error: of.largest,
            hit_error_bound: of.bound.min(f64::MAX),
            largest_share_of_bound: of.share,
        }
    };
    worst.into_iter().map(of_group).collect()
}

/// Returns how far corners of an instance may be from their places: each is rounded once, in the coordinates of the
/// mesh. A copy found of another mesh, or one placed by attributes in single precision, may be as far as `allowed`.
pub(super) fn position_bound(scene: &Scene, instance: InstanceId, allowed: f64) -> f64 {
    let of = &scene.instances[instance.0 as usize];
    let there = rounding::absolute(&of.transform.matrix3);
    let reach = scene.meshes[of.mesh.0 as usize].reach();
    let in_double = |largest: DVec3| 8.0 * f64::EPSILON * (there * largest + of.transform.translation.abs());
    let rounded = (SINGLE * (there * reach) + in_double(reach)).length();
    let placed = scene.provenance.record().and_then(|record| record.placed(of.node, of.copy));
    let stands_in = placed.is_some_and(|placed| placed.stands_in);
    if stands_in || scene.is_copied(of.node) { rounded.max(allowed) } else { rounded }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(relative: impl IntoIterator<Item = f64>) -> Errors {
        let mut all = Errors::default();
        relative
            .into_iter()
            .for_each(|relative| all.record(HitError { relative, distance: relative, object: (0, 0.0) }));
        all
    }

    #[test]
    fn percentile_is_rounded_up_by_less_than_an_eighth_of_an_octave() {
        let numbers: Vec<f64> = (1..=10_000).map(|i| 1e-9 * f64::from(i)).collect();
        let exact = percentile_999(numbers.clone());
        assert_eq!(exact, 9990.0 * 1e-9);
        let found = errors(numbers).p999();
        assert!(found >= exact && found < 1.0906 * exact, "{found} for {exact}");
    }

    #[test]
    fn small_errors_have_a_mean() {
        assert_eq!(root_mean_square(&[]), 0.0);
        assert!((root_mean_square(&[3e-200, 4e-200]) - 12.5f64.sqrt() * 1e-200).abs() < 1e-210);
    }

    #[test]
    fn percentiles_of_nothing_and_of_zeros_are_zero() {
        assert_eq!([percentile_999(Vec::new()), errors([]).p999(), errors([0.0; 5]).p999()], [0.0; 3]);
        assert_eq!([percentile_999(vec![3.0]), errors([3.0]).p999()], [3.0; 2]);
        assert_eq!(errors([f64::MAX]).p999(), f64::MAX);
    }

    #[test]
    fn parts_add_up_to_the_whole() {
        let (mut first, second) = (errors([1e-9, 1e-3]), errors([1e-5]));
        first.add(second);
        assert_eq!(first, errors([1e-9, 1e-3, 1e-5]));
    }
}
