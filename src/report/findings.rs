//! The vendor rules that a scene breaks, in words.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

use super::words::{bytes, counted, grouped};

/// A vendor rule that a scene breaks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Finding {
    /// Id of the rule, such as `RK001`.
    pub rule: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// The object at fault, or empty for the whole scene.
    pub object: String,
    /// What is wrong, in words.
    pub message: String,
}

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Worth knowing.
    Info,
    /// Costs speed or memory.
    Warning,
    /// A device rejects or ignores it.
    Error,
}

/// How a rule is broken.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Broken<'a> {
    /// The box of an object overlaps that of another, by this share of the scene's area.
    /// `of_core`: the core is smaller than the scene.
    Overlap { other: &'a str, ratio: f64, of_core: bool },
    /// This many meshes repeat others exactly; sharing would save this many bytes.
    Repeated { meshes: usize, saved_bytes: u64 },
    /// This many triangles have no area.
    NoArea { triangles: usize },
    /// There are more of something than advised.
    TooMany { count: usize, what: &'static str, most: usize },
    /// This many instances are stretched or sheared by more than this factor.
    Loose { instances: usize, factor: f64 },
    /// Coordinates exceed the range in which single precision is fine enough.
    Far { farthest: f64, most: f64 },
    /// This many instances are smaller than this.
    Tiny { instances: usize, least: f64 },
}

impl Finding {
    /// States how an object, or the scene if `object` is empty, breaks a rule.
    pub(crate) fn new(rule: &'static str, severity: Severity, object: impl Into<String>, broken: &Broken) -> Finding {
        Finding { rule, severity, object: object.into(), message: broken.to_string() }
    }
}

impl Display for Broken<'_> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match *self {
            Broken::Overlap { other, ratio, of_core } => {
                let of = if of_core { "area of the scene's core" } else { "scene's area" };
                write!(f, "its box overlaps that of `{other}` by {ratio:.4} of the {of}")
            }
            Broken::Repeated { meshes, saved_bytes } => {
                let repeat = if meshes == 1 { "mesh repeats" } else { "meshes repeat" };
                let (count, saved) = (grouped(meshes as u64), bytes(saved_bytes));
                write!(f, "{count} {repeat} another one exactly; sharing would save {saved} of BLASes")
            }
            Broken::NoArea { triangles } => {
                let have = if triangles == 1 { "has" } else { "have" };
                write!(f, "{} {have} no area", counted(triangles, "triangle"))
            }
            Broken::TooMany { count, what, most } => {
                write!(f, "{} {what}; at most {} are advised", grouped(count as u64), grouped(most as u64))
            }
            Broken::Loose { instances: 1, factor } => {
                write!(f, "stretched or sheared more than {factor}:1, which makes its box loose")
            }
            Broken::Loose { instances, factor } => write!(
                f,
                "{} are stretched or sheared more than {factor}:1, which makes their boxes loose; this is the first",
                counted(instances, "instance")
            ),
            Broken::Far { farthest, most } => {
                write!(f, "coordinates reach {farthest:.3e}; beyond {most:.0e} single precision is coarse")
            }
            Broken::Tiny { instances: 1, least } => write!(f, "smaller than {least} units: merge or drop it"),
            Broken::Tiny { instances, least } => write!(
                f,
                "{} are smaller than {least} units: merge or drop them; this is the first",
                counted(instances, "instance")
            ),
        }
    }
}
