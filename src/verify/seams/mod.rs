//! Rays aimed at edges and vertices where triangles of the input meet.
//!
//! A device finds every such ray if all triangles at the place are transformed alike: the test of S. Woop, C. Benthin,
//! I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, and those of devices, let no ray between two
//! triangles that share an edge. Across instances with different transforms each side is rounded in its own way, and
//! some rays pass in between. The same rays are traced through both files, so that each is its own control:
//! [`Seams::chance`] is an exact sign test of the rays that only one of the files lets through.

mod aim;
mod places;
#[cfg(test)]
pub(super) mod tests;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use self::aim::Aim;
use self::places::Place;
use super::rays::Ray;
use super::surface::pairs::Pairs;
use super::{Sides, VerifyOptions};
use crate::scene::{InstanceId, Scene, TriangleRef};

/// A file fails if it loses more rays than the input, and chance would do that less often than this.
pub const LEVEL: f64 = 1e-3;

/// Results of rays aimed at edges and vertices. A ray is *lost* if it hits nothing up to the place it is aimed at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Seams {
    /// Number of rays; 0 if no edge or vertex of the input is closed.
    pub rays: u64,
    /// Number of rays lost in the input.
    pub before_lost: u64,
    /// Number of rays lost in the output. Best 0, and at most `before_lost`.
    pub after_lost: u64,
    /// Lost rays per million in the input.
    pub before_lost_per_million: f64,
    /// Lost rays per million in the output.
    pub after_lost_per_million: f64,
    /// Number of rays lost in the output alone.
    pub opened: u64,
    /// Number of rays lost in the input alone.
    pub closed: u64,
    /// Of these rays, those aimed at places where several instances of the output meet; none if triangles are not
    /// matched.
    pub across_groups: SeamCount,
    /// Of the other rays, those aimed at places where several objects of the input meet.
    pub across_objects: SeamCount,
    /// Of the other rays, those aimed at places inside an object.
    pub inside: SeamCount,
}

/// Rays aimed at one class of places.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SeamCount {
    /// Number of rays.
    pub rays: u64,
    /// Number of rays lost in the input.
    pub before_lost: u64,
    /// Number of rays lost in the output.
    pub after_lost: u64,
}

/// A class of places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    /// Several instances of the output meet.
    AcrossGroups,
    /// Several objects of the input meet, in one instance of the output if it is known.
    AcrossObjects,
    /// All triangles belong to one object, in one instance of the output if it is known.
    Inside,
}

impl Class {
    const ALL: [Class; 3] = [Class::AcrossGroups, Class::AcrossObjects, Class::Inside];
}

/// Rays that should hit something, each with the class of the place it is aimed at.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Aimed {
    pub(crate) rays: Vec<Ray>,
    classes: Vec<Class>,
}

impl Aimed {
    /// Aims up to `options.rays_per_kind` rays at closed places of `before`, an equal share at each class. With
    /// `pairs`, places are also sought where groups of the output meet. `displacement` is the distance by which
    /// corners of the output may lie elsewhere, in world units.
    pub(crate) fn new(before: &Scene, pairs: Option<&Pairs>, displacement: f64, options: &VerifyOptions) -> Aimed {
        let count = options.rays_per_kind as usize;
        let places = places::find(before, count, options.seed);
        if places.is_empty() {
            return Aimed::default();
        }
        let aim = Aim::new(before, displacement, options.seed);
        let places: Vec<Place> = places.into_par_iter().filter(|place| aim.is_covered(place)).collect();
        let classes = classes(before, &places, pairs);
        aim.rays(&places, &classes, count)
    }
}

/// Returns the class of each place.
fn classes(before: &Scene, places: &[Place], pairs: Option<&Pairs>) -> Vec<Class> {
    let object = |at: &TriangleRef| (at.instance, before.mesh_of(InstanceId(at.instance)).locate(at.triangle).0);
    let all: Vec<TriangleRef> = places.iter().flat_map(|place| &place.triangles).copied().collect();
    let groups = pairs.map(|pairs| pairs.find(&all));
    let mut first = 0;
    let class = |place: &Place| {
        let range = first..first + place.triangles.len();
        first = range.end;
        // A triangle that is not found is as suspect as one in another group.
        let is_one_group = groups.as_ref().is_none_or(|groups| {
            let group = |at: &Option<TriangleRef>| at.map(|at| at.instance);
            let one = group(&groups[range.start]);
            one.is_some() && groups[range].iter().all(|at| group(at) == one)
        });
        let one = object(&place.triangles[0]);
        match place.triangles.iter().all(|at| object(at) == one) {
            _ if !is_one_group => Class::AcrossGroups,
            false => Class::AcrossObjects,
            true => Class::Inside,
        }
    };
    places.iter().map(class).collect()
}

impl Seams {
    /// Counts lost rays, given for each ray whether it hits anything in each file.
    pub(super) fn count(aimed: &Aimed, hit: Sides<&[bool]>) -> Seams {
        let mut seams = Seams::default();
        for ((class, &before), &after) in aimed.classes.iter().zip(hit.before).zip(hit.after) {
            seams.opened += u64::from(before && !after);
            seams.closed += u64::from(!before && after);
            let count = match class {
                Class::AcrossGroups => &mut seams.across_groups,
                Class::AcrossObjects => &mut seams.across_objects,
                Class::Inside => &mut seams.inside,
            };
            count.rays += 1;
            count.before_lost += u64::from(!before);
            count.after_lost += u64::from(!after);
        }
        for of in [seams.across_groups, seams.across_objects, seams.inside] {
            seams.rays += of.rays;
            seams.before_lost += of.before_lost;
            seams.after_lost += of.after_lost;
        }
        let per_million = |lost: u64| if seams.rays == 0 { 0.0 } else { 1e6 * lost as f64 / seams.rays as f64 };
        seams.before_lost_per_million = per_million(seams.before_lost);
        seams.after_lost_per_million = per_million(seams.after_lost);
        seams
    }

    /// Returns how likely chance alone loses as many rays in the output as were found, or more, if each ray that only
    /// one file lets through is as likely to be lost in either (W. J. Dixon, A. M. Mood, "The Statistical Sign Test",
    /// Journal of the American Statistical Association 41, 1946).
    pub fn chance(&self) -> f64 {
        at_least(self.opened, self.opened + self.closed)
    }

    /// Whether the output loses more rays than the input, beyond [`LEVEL`].
    pub fn is_worse(&self) -> bool {
        self.chance() < LEVEL
    }
}

/// Returns the probability of at least `heads` heads in `tosses` tosses of a fair coin; 1 if that is half or fewer.
fn at_least(heads: u64, tosses: u64) -> f64 {
    let tails = tosses - heads;
    if heads <= tails {
        return 1.0;
    }
    // The binomial coefficient, in logarithms as it overflows.
    let coefficient: f64 = (1..=tails).map(|i| ((heads + i) as f64 / i as f64).ln()).sum();
    let mut term = (coefficient - tosses as f64 * std::f64::consts::LN_2).exp();
    let mut sum = 0.0;
    for more in heads..=tosses {
        sum += term;
        term *= (tosses - more) as f64 / (more + 1) as f64;
        // Terms fall faster than a geometric series of this ratio.
        if term < 1e-12 * sum {
            break;
        }
    }
    sum
}

/// Returns a normal of a triangle, scaled so that products do not leave the range of numbers; not of length one.
fn scaled_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let size = ab.abs().max(ac.abs()).max_element();
    (ab / size).cross(ac / size)
}
