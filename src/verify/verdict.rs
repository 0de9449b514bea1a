//! The rules by which a file passes or fails; `docs/verification.md` states them for users.
//!
//! A file fails if
//! - the exact comparison ([`surface`]) finds a triangle missing, repeated, unknown, of another material,
//!   flipped or moved by more than the position error allowed, or (if asked) recorded as another one,
//! - a ray hits something else in it than in the input, and neither rounding nor a tie explains that, or
//! - more rays aimed at its edges and vertices are lost than in the input, by more than chance explains
//!   ([`Seams::is_worse`]); a note if the user allows larger position errors than a bake makes, and the file has them.
//!
//! Rounding explains a difference if the ray passes the edge of the triangle at issue within the slack, the sum of
//! - what single precision may move a ray beside an edge ([`Magnitude::slack`](super::rounding::Magnitude::slack)), and
//! - the largest position error found in the instance, up to the one allowed (in the output only).
//!
//! A slack larger than a tenth of the smaller object concerned excuses nothing: then the rays cannot tell
//! ([`CannotTell`]). If the exact comparison can, that is a note; if only rays were asked, the file fails.
//!
//! A hit's distance must be right within what the slack can do to it ([`window`](super::approach::Approach::window)).
//! A tie is a triangle at the distance of the true hit, within the same bounds.

use raykiln_formats::record::Provenance;
use serde::Serialize;

use super::accuracy::Accuracy;
use super::build::Structures;
use super::compare::Tally;
use super::contents::{ContentsReport, Severity};
use super::errors::{ErrorReport, Histogram};
use super::identity::{Relation, relation};
use super::regrouped::Regrouped;
use super::seams::Seams;
use super::sight::CannotTell;
use super::speed::KindSpeed;
use super::structure::{Fault, Structure, allowed_error};
use super::tracing::Seen;
use super::view_speeds::ViewSpeeds;
use super::views::ViewReport;
use super::weights::{Overall, Weights};
use super::work::{Work, WorkPerRay};
use super::{Exact, Failure, FaultKind, Matching, Note, PerKind, Side, Sides, VerifyOptions, surface};
use crate::scene::Scene;

/// Results of verifying a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verification {
    /// The device that traced the rays.
    pub device: String,
    /// Description of where the primary rays of the first view came from.
    pub view: String,
    /// The views that rays came from.
    pub views: Vec<ViewReport>,
    /// Number of rays of all kinds.
    pub rays: u64,
    /// Number of rays that hit something in the input.
    pub hits: u64,
    /// Number of rays that hit something else than in the input, beyond what rounding explains. Best 0.
    pub mismatches: u64,
    /// Number of rays that pass so close to an edge that rounding decided what they hit, and decided it differently.
    pub silhouettes: u64,
    /// Number of rays that hit a different one of several triangles in the same place.
    pub ties: u64,
    /// Number of rays whose hit is missing, or moved by more than 1e-4 of half the scene's diagonal.
    pub far_hits: u64,
    /// Number of rays for which the tracer itself was wrong: it missed the truth in the input, or in both files alike.
    pub tracer_faults: u64,
    /// What rays could not tell.
    pub cannot_tell: CannotTell,
    /// Rays aimed at edges and vertices, which are in none of the other numbers.
    pub seams: Seams,
    /// Errors over the size of the scene and of objects, and of groups beside their bounds.
    pub errors: ErrorReport,
    /// Largest distance error of the output's hits against the truth, over the distance (or over a thousandth of half
    /// the scene's diagonal if that is more).
    pub max_relative_distance_error: f64,
    /// Root mean square of these errors.
    pub rms_relative_distance_error: f64,
    /// The error that 99.9 % of the output's hits do not exceed, within an eighth of an octave.
    pub p999_relative_distance_error: f64,
    /// Like `max_relative_distance_error`, for the input's hits.
    pub before_max_relative_distance_error: f64,
    /// Like `rms_relative_distance_error`, for the input's hits.
    pub before_rms_relative_distance_error: f64,
    /// How the distance errors of both are distributed.
    pub distance_error_histogram: Histogram,
    /// Largest distance of a corner from its place over the diagonal of the input's box; NaN (`null` in JSON) if only
    /// surfaces were compared.
    pub position_error_ratio: f64,
    /// What the speeds are: seconds measured, or steps counted.
    pub speed_by: SpeedBy,
    /// Speed by ray kind, over the views that judge.
    pub kinds: PerKind<KindSpeed>,
    /// Speed in each view that judges.
    #[serde(skip)]
    pub speeds: ViewSpeeds,
    /// The seconds that the timed rays took over all views, for each repeat.
    pub seconds: PerKind<Sides<Vec<f64>>>,
    /// Steps per ray, if they decide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<PerKind<Sides<WorkPerRay>>>,
    /// Speed by the seconds measured, if steps decide instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_kinds: Option<PerKind<KindSpeed>>,
    /// What the device built; `None` on the CPU.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub structures: Option<Structures>,
    /// Share of the input's area that is in triangles that rays hit; `None` unless only surfaces were compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub touched_area_ratio: Option<f64>,
    /// The exact comparison; `None` if only surfaces were compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub structure: Option<Structure>,
    /// The comparison of what the files mean beyond the places of triangles; `None` if only surfaces were compared, or if
    /// the output is the input byte for byte.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contents: Option<ContentsReport>,
    /// Why the file fails; empty if it passes.
    pub failures: Vec<Failure>,
    /// Deviations from what was requested, such as tracing on the CPU; for the report's own notes.
    #[serde(skip)]
    pub notes: Vec<Note>,
}

/// What speeds are based on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SpeedBy {
    /// Nothing: no ray was timed.
    #[default]
    Nothing,
    /// Seconds on a device.
    Seconds,
    /// Steps of rays on the CPU, at fixed prices.
    Steps,
}

impl Verification {
    /// The speed over all ray kinds and the views that judge.
    pub fn overall(&self, weights: &Weights) -> Overall {
        self.speeds.overall(weights)
    }

    /// What tracing the output costs in accuracy.
    pub fn accuracy(&self) -> Accuracy {
        Accuracy {
            max_relative_distance_error: self.max_relative_distance_error,
            p999_relative_distance_error: self.p999_relative_distance_error,
            rms_relative_distance_error: self.rms_relative_distance_error,
            lost_per_million: self.seams.after_lost_per_million,
        }
    }

    /// Whether the output shows the same as the input.
    pub fn passed(&self) -> bool {
        self.failures.is_empty()
    }
}

/// Applies the rules; without an `exact` comparison, only the traced rays count.
pub(super) fn judge(
    scenes: Sides<&Scene>,
    seen: Seen,
    exact: Option<&Exact>,
    cannot_tell: CannotTell,
    options: &VerifyOptions,
) -> Verification {
    let structure = exact.map(|exact| exact.structure.clone());
    let contents = exact.and_then(|exact| exact.contents.clone());
    let touched_area_ratio = structure.is_none().then(|| surface::share_of_area(scenes.before, &seen.tally.touched));
    let mut found = Found { failures: Vec::new(), notes: seen.notes };
    found.exactly(scenes, structure.as_ref(), contents.as_ref(), options);
    found.by_rays(scenes, &seen.tally, seen.seams, structure.as_ref(), touched_area_ratio, options);
    let regrouped = exact.filter(|_| options.same_groups).map(|exact| Regrouped::of(scenes, &exact.pairs));
    found.failures.extend(regrouped.filter(|found| !found.is_none()).map(Failure::Regrouped));
    match structure {
        _ if cannot_tell.is_nothing() => {}
        Some(_) => found.notes.push(Note::CannotTell(cannot_tell.clone())),
        None => found.failures.push(Failure::CannotTell(cannot_tell.clone())),
    }
    let Found { failures, notes } = found;
    let Seen { tally, timed, .. } = seen;
    let allowed = allowed_error(scenes.before, options.max_position_error_ratio);
    Verification {
        device: seen.device,
        view: seen.views.first().map_or("nothing to see".into(), |view| view.name.clone()),
        views: ViewReport::all(&seen.views, &timed.speeds.views(&options.weights)),
        rays: tally.rays,
        hits: tally.hits,
        mismatches: tally.mismatches,
        silhouettes: tally.silhouettes,
        ties: tally.ties,
        far_hits: tally.far_hits,
        tracer_faults: tally.tracer_faults,
        cannot_tell,
        seams: seen.seams,
        errors: ErrorReport::new(scenes, structure.as_ref(), &tally, allowed),
        max_relative_distance_error: tally.after.max,
        rms_relative_distance_error: tally.after.rms(),
        p999_relative_distance_error: tally.after.p999(),
        before_max_relative_distance_error: tally.before.max,
        before_rms_relative_distance_error: tally.before.rms(),
        distance_error_histogram: Histogram::of(&tally),
        position_error_ratio: structure.as_ref().map_or(f64::NAN, |s| s.position_error_ratio),
        speed_by: match &timed.counted {
            Some(_) => SpeedBy::Steps,
            None if timed.speeds.0.is_empty() => SpeedBy::Nothing,
            None => SpeedBy::Seconds,
        },
        kinds: timed.speeds.kinds(&options.weights),
        speeds: timed.speeds,
        seconds: timed.seconds,
        steps: timed.counted.as_ref().map(|counted| counted.work.map(|both| both.as_ref().map(Work::per_ray))),
        measured_kinds: timed.counted.map(|counted| counted.measured),
        structures: seen.structures,
        touched_area_ratio,
        structure,
        contents,
        failures,
        notes,
    }
}

/// Why a file fails, and what else is worth knowing.
struct Found {
    failures: Vec<Failure>,
    notes: Vec<Note>,
}

impl Found {
    /// Adds what the exhaustive comparison says.
    fn exactly(
        &mut self,
        scenes: Sides<&Scene>,
        structure: Option<&Structure>,
        contents: Option<&ContentsReport>,
        options: &VerifyOptions,
    ) {
        self.failures.extend(structure.into_iter().flat_map(|s| structure_failures(s, options)));
        for difference in contents.into_iter().flat_map(|contents| &contents.differences) {
            match difference.severity {
                Severity::Error => self.failures.push(Failure::Differs(difference.clone())),
                Severity::Note => self.notes.push(Note::Differs(difference.clone())),
            }
        }
        self.notes.extend(record_note(scenes));
        let records = relation(scenes.before, scenes.after) == Relation::Leads;
        self.notes.extend(structure.into_iter().flat_map(|s| structure_notes(s, records, options)));
    }

    /// Adds what rays say; they must say more, given the share of the area that they touched, if nothing else does.
    fn by_rays(
        &mut self,
        scenes: Sides<&Scene>,
        tally: &Tally,
        seams: Seams,
        structure: Option<&Structure>,
        touched_area_ratio: Option<f64>,
        options: &VerifyOptions,
    ) {
        self.failures.extend(ray_failure(tally));
        if seams.is_worse() {
            match moved_as_allowed(structure, options) {
                true => self.notes.push(Note::Seams(seams)),
                false => self.failures.push(Failure::Seams(seams)),
            }
        }
        let is_blind = tally.hits == 0 && scenes.before.triangles_placed().max(scenes.after.triangles_placed()) > 0;
        if let Some(share) = touched_area_ratio.filter(|_| self.failures.is_empty()) {
            self.failures.extend(if is_blind { Some(Failure::NothingHit) } else { blindness(tally, share) });
        }
    }
}

fn structure_failures(structure: &Structure, options: &VerifyOptions) -> Vec<Failure> {
    let of_kind = |(fault, found): (FaultKind, &Fault)| Failure::Triangles {
        fault,
        count: found.count,
        first: found.first.clone(),
    };
    let record = (FaultKind::Elsewhere, &structure.record.elsewhere);
    let must_be_right = options.matching == Matching::Identity;
    let faults = structure.faults().into_iter().chain(must_be_right.then_some(record));
    let found = faults.filter(|(kind, found)| found.count > 0 && *kind != FaultKind::Moved);
    let mut failures: Vec<Failure> = found.map(of_kind).collect();
    failures.extend((structure.moved.count > 0).then(|| Failure::Moved {
        count: structure.moved.count,
        farthest: structure.moved.first.clone(),
        distance: structure.farthest_moved,
        suggested_max_position_error_ratio: structure.suggested_max_position_error_ratio,
    }));
    failures
}

/// Whether corners are farther off than a bake may move them, because the user allows it: then cracks of that width are
/// allowed, too.
fn moved_as_allowed(structure: Option<&Structure>, options: &VerifyOptions) -> bool {
    let usual = VerifyOptions::default().max_position_error_ratio;
    let moved = structure.map_or(options.max_position_error_ratio, |structure| structure.position_error_ratio);
    moved > usual && options.max_position_error_ratio > usual
}

/// Rays alone do not say "the same" if more of a million than this many continue to another surface.
const MOST_FAR_PER_MILLION: u64 = 3;

/// Rays alone do not say "the same" if they touch less than this share of the input's area.
const LEAST_TOUCHED: f64 = 0.05;

/// Why rays alone cannot tell, given the share of the area that they touched.
fn blindness(tally: &Tally, touched_area_ratio: f64) -> Option<Failure> {
    let Tally { far_hits, rays, .. } = *tally;
    if far_hits * 1_000_000 > MOST_FAR_PER_MILLION * rays {
        return Some(Failure::FarHits { far_hits, rays });
    }
    (touched_area_ratio < LEAST_TOUCHED).then_some(Failure::Untouched { touched_area_ratio })
}

/// What is wrong with the record of the output, which was therefore not followed.
fn record_note(scenes: Sides<&Scene>) -> Option<Note> {
    match scenes.after.provenance {
        Provenance::Stale => Some(Note::StaleRecord),
        Provenance::Damaged(cause) => Some(Note::DamagedRecord(cause)),
        _ if relation(scenes.before, scenes.after) == Relation::OtherInput => Some(Note::RecordOfAnotherInput),
        _ => None,
    }
}

/// What is worth knowing about the triangles, but no fault.
fn structure_notes(structure: &Structure, records: bool, options: &VerifyOptions) -> Vec<Note> {
    let degenerate = Side::BOTH.into_iter().filter_map(|side| {
        let Fault { count, first } = &structure.degenerate[side];
        Some(Note::Degenerate(side, *count, first.clone()?))
    });
    let elsewhere = &structure.record.elsewhere;
    let is_note = records && options.matching != Matching::Identity;
    let first = elsewhere.first.clone().filter(|_| is_note);
    let record = first.map(|first| Note::RecordedElsewhere(elsewhere.count, first));
    degenerate.chain(record).collect()
}

fn ray_failure(tally: &Tally) -> Option<Failure> {
    let Tally { mismatches, rays, .. } = *tally;
    (mismatches > 0).then(|| Failure::Rays { mismatches, rays, examples: tally.examples.clone() })
}

/// The result of a bake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Verdict {
    /// The output traces faster than the input by more than the spread, and in no view slower than allowed.
    #[serde(rename = "faster")]
    Faster,
    /// The output was restructured, but does not trace faster by more than the spread.
    #[serde(rename = "not faster")]
    NotFaster,
    /// The output is the input.
    #[serde(rename = "left alone")]
    LeftAlone,
    /// Nothing differs that rays can tell, but they cannot tell everything, and nothing else was compared.
    #[serde(rename = "cannot tell")]
    CannotTell,
    /// Verification failed; there is no output.
    #[serde(rename = "failed")]
    Failed,
}

/// Decides the result. Faster means: over ray kinds and judging views, by more than the uncertainty of the speedup, and
/// in no judging view slower than allowed.
pub(crate) fn verdict(verification: &Verification, options: &VerifyOptions, unchanged: bool) -> Verdict {
    if !verification.passed() {
        let unclear = verification.failures.iter().all(Failure::is_unclear);
        return if unclear { Verdict::CannotTell } else { Verdict::Failed };
    }
    if unchanged {
        return Verdict::LeftAlone;
    }
    let is_faster = verification.overall(&options.weights).is_never_slower(options.least_view_ratio);
    if is_faster { Verdict::Faster } else { Verdict::NotFaster }
}
