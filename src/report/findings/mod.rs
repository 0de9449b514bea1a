//! The vendor rules that a scene breaks, what that costs and what to do about it.
//!
//! [`crate::commands`] measures how a rule is broken (`Broken`, numbers and names only); the sentences are made here.

mod policy;
mod rule;
mod sarif;
mod words;

pub use policy::{FailOn, NoSuchRule};
pub use rule::Rule;
pub use sarif::to_sarif;

use serde::{Serialize, Serializer};

/// A vendor rule that a scene breaks. Objects that break a rule in the same way are one finding.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Finding {
    /// The rule; serialized by its id, such as `RK001`.
    pub rule: Rule,
    /// How much it matters.
    pub severity: Severity,
    /// The rule's subject in a few words.
    pub title: &'static str,
    /// The first of the objects at fault, or empty for the whole scene.
    pub object: String,
    /// Names of the first objects at fault, each once; at most [`Finding::MOST_NAMES`]. Worst first if the rule has a
    /// measure of how bad an object is, else in the order of the file.
    pub objects: Vec<String>,
    /// Number of objects at fault: nodes or meshes, as `message` says; 0 for the whole scene.
    pub count: u64,
    /// What is wrong.
    pub message: String,
    /// What it costs.
    pub cost: Cost,
    /// What a person can do about it.
    pub by_hand: String,
    /// What `raykiln bake` does about it.
    pub by_bake: String,
    /// Whether the output of a bake breaks the rule no more, or less severely; `None` without an output.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gone_after: Option<bool>,
}

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Worth knowing.
    Note,
    /// Costs speed or memory.
    Warning,
    /// A device rejects or ignores it.
    Error,
}

impl Severity {
    /// All severities, least first.
    pub const ALL: [Severity; 3] = [Severity::Note, Severity::Warning, Severity::Error];

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Error => "error",
        }
    }
}

/// What a broken rule costs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Cost {
    /// Expected amount of `work` per ray that crosses the core of the scene, at least 0; `None` if the cost is not one per
    /// ray. By surface areas: a ray that meets a convex box meets a convex part of it with the probability that is the
    /// ratio of their surface areas (M. W. Crofton, "On the Theory of Local Probability", 1868). Does not model
    /// occlusion.
    pub per_ray: Option<f64>,
    /// The work that `per_ray` counts.
    pub work: Option<Work>,
    /// Bytes of acceleration structures that could be saved, as predicted; `None` if it costs no memory.
    pub bytes: Option<u64>,
    /// The cost in words, with how it was computed.
    pub text: String,
}

/// Work that rays cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Work {
    /// Pairs of overlapping boxes entered at the same place.
    Overlaps,
    /// Instances entered.
    InstanceEntries,
    /// Triangles tested.
    TriangleTests,
    /// Any-hit shaders called.
    AnyHitCalls,
}

/// How a rule is broken: numbers and names.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Broken {
    /// Boxes of instances overlap; the worst two by `ratio` of the area of the core. `of_core`: the core is smaller than
    /// the scene.
    Overlap { worst: [String; 2], ratio: f64, of_core: bool, per_ray: f64 },
    /// Meshes whose parts lie far apart: of the box of the worst, its `parts` boxes fill `filled` by surface area.
    EmptySpace { filled: f64, parts: usize, per_ray: f64 },
    /// Meshes repeat `models` others, also moved; `other_material`: only their materials differ.
    Repeated { models: usize, saved_bytes: u64, other_material: bool, shared_by_bake: bool },
    /// Triangles of skinned meshes each move rigidly with one of several joints.
    MovingParts { triangles: u64, joints: usize, bytes: u64 },
    /// Objects enclose the scene; the largest box has this many times the surface area of the core's.
    Shell { area_ratio: f64, per_ray: f64 },
    /// Long thin triangles whose boxes are almost empty. `worst`, `mean`: area over that of the box.
    Needles { triangles: u64, worst: f64, mean: f64, per_ray: f64 },
    /// Triangles that are not opaque; of these materials, alpha is 1 everywhere all the same.
    NotOpaque { area_ratio: f64, per_ray: f64, opaque_all_the_same: Vec<String> },
    /// Triangles without an area, and meshes with triangles whose corners are not finite.
    Degenerate { triangles: u64, not_finite: usize },
    /// BLASes smaller than the unit of allocation. `lost`: bytes lost if each is allocated alone; `aligned`: by alignment
    /// alone.
    Small { lost: u64, aligned: u64 },
    /// There are more of something than `most`.
    TooMany { rule: Rule, count: u64, what: &'static str, most: u64 },
    /// Instances are stretched or sheared, the worst by `factor`, so that their boxes are loose.
    Loose { factor: f64, per_ray: f64 },
    /// Objects far from the rest; the scene's box has this many times the surface area of the core's.
    Outlier { area_ratio: f64 },
    /// Coordinates so large that stored positions are `step` units apart, at worst `of_size` of an object's size.
    Far { farthest: f64, step: f64, of_size: f64 },
    /// Instances smaller than `ratio` of the core's diagonal.
    Tiny { ratio: f64, bytes: u64 },
    /// Assemblies of several meshes that are placed as a whole: `saved` instances fewer if each was one mesh.
    Nested { assemblies: usize, depth: usize, saved: u64, bytes: u64 },
}

/// The objects of a finding: how many there are, and the names of the first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Objects {
    count: u64,
    names: Vec<String>,
}

impl Objects {
    /// Adds an object; its name is computed only if it is needed.
    pub(crate) fn add(&mut self, name: impl FnOnce() -> String) {
        self.count += 1;
        self.mention(name);
    }

    /// Names an object that is counted elsewhere.
    pub(crate) fn mention(&mut self, name: impl FnOnce() -> String) {
        if self.names.len() < Finding::MOST_NAMES {
            let name = name();
            if !self.names.contains(&name) {
                self.names.push(name);
            }
        }
    }

    /// Sets the number of objects, of which some are named.
    pub(crate) fn counted(self, count: u64) -> Objects {
        Objects { count, ..self }
    }

    /// How many there are.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// Whether there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }
}

impl<N: Into<String>> FromIterator<N> for Objects {
    fn from_iter<I: IntoIterator<Item = N>>(names: I) -> Objects {
        let mut objects = Objects::default();
        names.into_iter().for_each(|name| objects.add(|| name.into()));
        objects
    }
}

impl Finding {
    /// Number of objects that a finding names.
    pub const MOST_NAMES: usize = 10;

    /// States how objects, or the scene if there are none, break a rule.
    pub(crate) fn new(objects: Objects, broken: &Broken) -> Finding {
        let rule = broken.rule();
        Finding {
            rule,
            severity: broken.severity(),
            title: rule.title(),
            object: objects.names.first().cloned().unwrap_or_default(),
            message: words::message(broken, objects.count),
            cost: words::cost(broken),
            by_hand: words::by_hand(broken),
            by_bake: words::by_bake(broken),
            gone_after: None,
            objects: objects.names,
            count: objects.count,
        }
    }
}

/// Says of each finding about the input of a bake whether the output still breaks its rule as severely.
pub(crate) fn compare_with_output(input: &mut [Finding], output: &[Finding]) {
    for finding in input {
        let remains = output.iter().any(|o| o.rule == finding.rule && o.severity >= finding.severity);
        finding.gone_after = Some(!remains);
    }
}

impl Broken {
    /// The rule that is broken.
    pub(crate) fn rule(&self) -> Rule {
        match self {
            Broken::Overlap { .. } => Rule::Overlap,
            Broken::EmptySpace { .. } => Rule::EmptySpace,
            Broken::Repeated { .. } => Rule::Copies,
            Broken::MovingParts { .. } => Rule::MovingParts,
            Broken::Shell { .. } => Rule::Shell,
            Broken::Needles { .. } => Rule::Needles,
            Broken::NotOpaque { .. } => Rule::Opacity,
            Broken::Degenerate { .. } => Rule::Degenerate,
            Broken::Small { .. } => Rule::SmallStructures,
            Broken::TooMany { rule, .. } => *rule,
            Broken::Loose { .. } => Rule::LooseBoxes,
            Broken::Outlier { .. } => Rule::Outlier,
            Broken::Far { .. } => Rule::FarFromOrigin,
            Broken::Tiny { .. } => Rule::Tiny,
            Broken::Nested { .. } => Rule::Nesting,
        }
    }

    /// How much it matters: as the rule says, or less if nothing is wrong with the scene itself.
    fn severity(&self) -> Severity {
        match self {
            Broken::Repeated { other_material: true, .. } => Severity::Note,
            Broken::NotOpaque { opaque_all_the_same, .. } if opaque_all_the_same.is_empty() => Severity::Note,
            Broken::Degenerate { not_finite, .. } if *not_finite > 0 => Severity::Warning,
            _ => self.rule().severity(),
        }
    }
}

impl Serialize for Rule {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.id())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_objects_of_one_name_are_counted_and_named_once() {
        let objects: Objects = std::iter::repeat_n("Sphere", 98).collect();
        let finding = Finding::new(objects, &Broken::Degenerate { triangles: 196, not_finite: 0 });
        assert_eq!((finding.count, finding.objects.as_slice()), (98, ["Sphere".to_owned()].as_slice()));
        assert_eq!(finding.object, "Sphere");
        assert!(finding.message.contains("196 triangles of 98 meshes"), "{}", finding.message);
    }

    #[test]
    fn findings_of_the_output_tell_which_are_gone() {
        let degenerate = Finding::new(Objects::default(), &Broken::Degenerate { triangles: 1, not_finite: 0 });
        let worse = Finding::new(Objects::default(), &Broken::Degenerate { triangles: 1, not_finite: 1 });
        let tiny = Finding::new(Objects::default(), &Broken::Tiny { ratio: 1e-6, bytes: 1 });
        let mut input = [degenerate.clone(), worse, tiny];
        compare_with_output(&mut input, &[degenerate]);
        assert_eq!(input.map(|finding| finding.gone_after), [Some(false), Some(true), Some(true)]);
    }

    #[test]
    fn only_the_first_names_are_kept() {
        let finding = Finding::new((0..50).map(|i| i.to_string()).collect(), &Broken::Tiny { ratio: 1e-6, bytes: 1 });
        assert_eq!((finding.count, finding.objects.len()), (50, Finding::MOST_NAMES));
    }
}
