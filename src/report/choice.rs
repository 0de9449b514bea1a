//! Puts into words why a layout was chosen, the outcomes of the others, and remarks.

use std::fmt::{self, Display, Formatter};

use super::words::{counted, grouped, instances_stay};
use crate::choose::{Excess, GroupCause, Note, Origin, Outcome, Why};
use crate::methods::Method;
use crate::scene::{Hold, Pinned};

/// States that the input stays although it exceeds the bounds.
const INPUT_STAYS: &str = "no candidate keeps to all that is allowed, and the input stays";

impl Display for Excess {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match *self {
            Excess::Bytes { ratio, allowed } => {
                write!(f, "{} times the input's bytes, {allowed} allowed", above(ratio, allowed))
            }
            Excess::Triangles { count, allowed } => {
                write!(f, "a group of {}, {} allowed", counted(count, "triangle"), grouped(allowed.into()))
            }
            Excess::Extent { ratio, allowed } => {
                write!(f, "a group {} of the scene's length, {allowed} allowed", above(ratio, allowed))
            }
        }
    }
}

fn all(excess: &[Excess]) -> String {
    excess.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

/// Formats a ratio above a bound with as few decimal places as distinguish the two, but at least two.
fn above(ratio: f64, bound: f64) -> String {
    let digits = (2..6).find(|&digits| {
        let unit = 10f64.powi(digits);
        (ratio * unit).round() / unit > bound
    });
    format!("{ratio:.0$}", digits.unwrap_or(6) as usize)
}

impl Display for Why {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Why::AskedFor => f.write_str("asked for"),
            Why::Planned => f.write_str("as the plan says"),
            Why::NothingAllowed(input) => {
                let refusal = if input.is_empty() { "no candidate".to_owned() } else { all(input) };
                write!(f, "{INPUT_STAYS} as it is: {refusal}")
            }
            Why::MeasuredFastest(speedup) => {
                write!(f, "measured {speedup:.3} times as fast as the input in the views that choose, the fastest")
            }
            Why::MeasuredBestAllowed { speedup_ratio, input } => {
                write!(f, "measured {speedup_ratio:.3} times as fast as the input{}", best_allowed(input))
            }
            Why::NoneMeasuredFaster => {
                f.write_str("no candidate was measured faster than the input by more than the spread")
            }
            Why::NoneJudgedFaster(count) => write!(
                f,
                "{} measured faster than the input in the views that choose, but {} in the views that judge",
                if *count == 1 { "one candidate was".to_owned() } else { format!("{count} candidates were") },
                if *count == 1 { "was not, or was too slow in one," } else { "were not, or were too slow in one," },
            ),
            Why::FasterNotAllowed { plan, excess } => write!(
                f,
                "nothing within what is allowed was measured faster than the input by more than the spread; `{plan}` \
                 was: {}",
                all(excess)
            ),
            Why::PredictedCheapest { picoseconds, of_input } => {
                write!(f, "{}; nothing was measured", predicted(*picoseconds, *of_input))
            }
            Why::PredictedBestAllowed { picoseconds, of_input, input } => {
                let predicted = predicted(*picoseconds, *of_input);
                write!(f, "{predicted}{}; nothing was measured", best_allowed(input))
            }
            Why::NonePredictedCheaper => {
                f.write_str("nothing is predicted to cost clearly less than the input; nothing was measured")
            }
            Why::CheaperNotAllowed { plan, cost_ratio, excess } => write!(
                f,
                "nothing within what is allowed is predicted to cost clearly less than the input; `{plan}` would, at \
                 {cost_ratio:.2} of it: {}; nothing was measured",
                all(excess)
            ),
            Why::NotFasterWhenVerified(plan) => {
                write!(f, "{plan} was not faster than the input when it was verified")
            }
        }
    }
}

/// Why a candidate is chosen although the input may be better.
fn best_allowed(input: &[Excess]) -> String {
    format!(", the best within what is allowed; the input is not: {}", all(input))
}

fn predicted(of_candidate: f64, of_input: f64) -> String {
    let [candidate, input] = [of_candidate, of_input].map(picoseconds);
    format!("predicted to take {candidate} picoseconds per ray, the input {input}")
}

/// Formats picoseconds with the significant digits only.
fn picoseconds(cost: f64) -> String {
    match cost {
        c if c < 10.0 => format!("{c:.2}"),
        c if c < 100.0 => format!("{c:.1}"),
        c => format!("{c:.0}"),
    }
}

impl Display for Outcome {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Outcome::Chosen(why) => write!(f, "chosen: {why}"),
            Outcome::NotAllowed(excess) => f.write_str(&all(excess)),
            Outcome::Failed(why) => f.write_str(why),
            Outcome::AnotherFaster => f.write_str("another was measured faster"),
            Outcome::BrieflySlower => f.write_str("timed briefly to be slower than another of its kind"),
            Outcome::NotMeasured => f.write_str("not measured: predicted to cost more than those that were"),
            Outcome::SlowerThanInput => f.write_str("measured slower than the input"),
            Outcome::NotFasterThanInput => f.write_str("measured no faster than the input beyond the spread"),
            Outcome::SlowInAView(least) => {
                write!(f, "measured faster than the input, but {least:.3} times as fast in one view")
            }
            Outcome::NotFasterWhenJudged { speedup_ratio, least_view_ratio } => write!(
                f,
                "the fastest in the views that choose; in those that judge {speedup_ratio:.3} times as fast as the input, \
                 at least {least_view_ratio:.3}"
            ),
            Outcome::MoreBytes => f.write_str("as fast as the one chosen, which takes fewer bytes"),
            Outcome::SpeedOfChosen(ratio) => write!(f, "measured {ratio:.3} times as fast as the one chosen"),
            Outcome::AnotherChosen => f.write_str("another was chosen"),
            Outcome::TooCloseToInput { cost_ratio, least } => {
                write!(f, "predicted at {cost_ratio:.2} of the input: only less than {least} is worth a change")
            }
            Outcome::TooCloseToSingle { cost_ratio, least } => {
                write!(f, "predicted at {cost_ratio:.2} of `single`: only less than {least} is taken instead")
            }
            Outcome::CostOfChosen(ratio) => write!(f, "predicted to cost {ratio:.2} times as much as the one chosen"),
            Outcome::HeldBack { same_as, instances, max_position_error_ratio } => write!(
                f,
                "comes to `{same_as}`: {}, as written out vertices would move farther than \
                 {max_position_error_ratio:e} of the diagonal, or a ten-thousandth of their own",
                instances_stay(*instances)
            ),
            Outcome::NotFasterWhenVerified => f.write_str("the best at first, but not faster when it was verified"),
        }
    }
}

impl Display for Note {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Note::HeldBack { instances, max_position_error_ratio } => write!(
                f,
                "{} as before: written out, their vertices would move farther than {max_position_error_ratio:e} of \
                 the scene's diagonal, or a ten-thousandth of their own",
                instances_stay(*instances)
            ),
            Note::TooManyBytes { excess, origin } => {
                write!(f, "{} does not hold: {excess}: {}", option(excess), why_so_many(*origin))
            }
            Note::TooLarge { excess, group, name, others, cause } => {
                let size = match *excess {
                    Excess::Triangles { count, .. } => counted(count, "triangle"),
                    Excess::Bytes { ratio, allowed } | Excess::Extent { ratio, allowed } => {
                        format!("a side of {} of the scene's", above(ratio, allowed))
                    }
                };
                let name = match name.as_str() {
                    "" => format!("group {group}"),
                    name => format!("group `{name}`"),
                };
                let others = match others {
                    0 => String::new(),
                    n => format!(", and {} more likewise", counted(*n, "group")),
                };
                write!(f, "{} does not hold: {name} has {size}{others}: {cause}", option(excess))
            }
        }
    }
}

/// The option that sets a bound.
fn option(excess: &Excess) -> String {
    match excess {
        Excess::Bytes { allowed, .. } => format!("--max-bytes-ratio {allowed}"),
        Excess::Triangles { allowed, .. } => format!("--max-group-triangles {allowed}"),
        Excess::Extent { allowed, .. } => format!("--max-group-extent-ratio {allowed}"),
    }
}

fn why_so_many(origin: Origin) -> String {
    match origin {
        Origin::Asked(Method::Keep) => "`keep` changes nothing".to_owned(),
        Origin::Asked(method) => {
            format!("`{}` writes no instance out beyond it, but divides all the same", method.name())
        }
        Origin::Chosen(_) => "that is the input as it is, which always competes".to_owned(),
        Origin::NoneKeeps => INPUT_STAYS.to_owned(),
    }
}

impl Display for GroupCause {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match *self {
            GroupCause::Pinned(why) => write!(f, "it stays as it is: {}", words_of(why)),
            GroupCause::Opened(count) => write!(f, "it is placed {count} times, and a mesh is not opened further"),
            GroupCause::Shared(count) => write!(f, "its mesh is placed {count} times and stays whole"),
            GroupCause::InputStays => f.write_str(INPUT_STAYS),
            GroupCause::Indivisible => f.write_str("it is one triangle, or a leaf of the tree that is cut"),
            GroupCause::NotHeeded(method) => write!(f, "`{}` does not heed it", method.name()),
        }
    }
}

fn words_of(pinned: Pinned) -> &'static str {
    match pinned {
        Pinned::Animated => "it is animated",
        Pinned::Skinned => "it has a skin",
        Pinned::Morphed => "it has morph targets",
        Pinned::Protected => "--keep protects it",
        Pinned::OtherScene => "another scene of the file shows it too",
        Pinned::Held(hold) => words_of_hold(hold),
        Pinned::MeshUnits => "its material has a thickness in units of the mesh, which its transform scales",
        Pinned::Singular => "its transform is singular",
        Pinned::Precision => "written out, its vertices would move too far",
        Pinned::Seam => "an instance that stays continues its surface",
    }
}

fn words_of_hold(hold: Hold) -> &'static str {
    match hold {
        Hold::Extension => "it has an extension that holds for it as it is, or that is not known",
        Hold::Referred => "an extension refers to it",
        Hold::Joint => "it hangs on a joint of a skin",
        Hold::Attached => "it hangs on a camera or a light",
        Hold::MeshExtension => "its mesh has an extension that would be lost",
        Hold::Order => "an extension has data in the order of its triangles or vertices, or is not known",
        Hold::Matrix => "its vertices have matrices",
        Hold::NoRoom => "its extras leave no room to record where its triangles would be",
    }
}
