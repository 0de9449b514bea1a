//! The vendor rules: id, subject, number, source, severity and remedies. docs/inspect.md shows the same table; a test
//! keeps both in step.

use super::Severity;

/// A vendor rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Rule {
    /// BLASes whose boxes overlap heavily should be one BLAS.
    Overlap,
    /// A BLAS with much empty space in its box should be divided.
    EmptySpace,
    /// Equal meshes should be one mesh.
    Copies,
    /// Parts that move independently belong in BLASes of their own.
    MovingParts,
    /// A sky or other shell should not be in the TLAS with the scene.
    Shell,
    /// Triangles should not be long and thin, especially not diagonal.
    Needles,
    /// Triangles should be opaque if they can be.
    Opacity,
    /// Triangles should have an area, and finite corners.
    Degenerate,
    /// Tiny BLASes waste memory.
    SmallStructures,
    /// Limits of the interfaces.
    Limits,
    /// There should not be too many acceleration structures.
    Structures,
    /// There should not be too many instances.
    Instances,
    /// Instances should not be stretched or sheared.
    LooseBoxes,
    /// No object should be far outside the rest.
    Outlier,
    /// Coordinates should not be so large that single precision is coarse.
    FarFromOrigin,
    /// Instances should not be tiny.
    Tiny,
    /// Instances should not be nested.
    Nesting,
}

/// What is said of a rule.
struct About {
    id: &'static str,
    title: &'static str,
    asks: &'static str,
    source: &'static str,
    severity: Severity,
    by_hand: &'static str,
    by_bake: &'static str,
}

impl Rule {
    /// All rules, in the order of their ids.
    pub const ALL: [Rule; 17] = [
        Rule::Overlap,
        Rule::EmptySpace,
        Rule::Copies,
        Rule::MovingParts,
        Rule::Shell,
        Rule::Needles,
        Rule::Opacity,
        Rule::Degenerate,
        Rule::SmallStructures,
        Rule::Limits,
        Rule::Structures,
        Rule::Instances,
        Rule::LooseBoxes,
        Rule::Outlier,
        Rule::FarFromOrigin,
        Rule::Tiny,
        Rule::Nesting,
    ];

    /// Returns the rule with an id such as `RK001`; upper and lower case do not matter.
    pub fn by_id(id: &str) -> Option<Rule> {
        Rule::ALL.into_iter().find(|rule| rule.id().eq_ignore_ascii_case(id))
    }

    /// Its id, such as `RK001`.
    pub fn id(self) -> &'static str {
        self.about().id
    }

    /// Its subject in a few words.
    pub fn title(self) -> &'static str {
        self.about().title
    }

    /// What it asks for, with its number.
    pub fn asks(self) -> &'static str {
        self.about().asks
    }

    /// Who says so.
    pub fn source(self) -> &'static str {
        self.about().source
    }

    /// The highest severity of its findings.
    pub fn severity(self) -> Severity {
        self.about().severity
    }

    /// What a person can do if it is broken.
    pub fn by_hand(self) -> &'static str {
        self.about().by_hand
    }

    /// What `raykiln bake` does if it is broken.
    pub fn by_bake(self) -> &'static str {
        self.about().by_bake
    }

    fn about(self) -> &'static About {
        &ABOUT[self as usize]
    }
}

const NVIDIA: &str = "NVIDIA, \"Best Practices for Using NVIDIA RTX Ray Tracing\", 2022";

/// In the order of [`Rule::ALL`].
const ABOUT: [About; Rule::ALL.len()] = [
    About {
        id: "RK001",
        title: "overlapping boxes",
        asks: "BLASes whose boxes overlap heavily should be one BLAS: no pair beyond 0.005 of the surface area of the scene's core",
        source: NVIDIA,
        severity: Severity::Warning,
        by_hand: "join objects that lie in one place into one mesh, or cut objects that reach into each other",
        by_bake: "`auto` tries to merge them (`single`, `cluster`) and to cut them (`overlap`, `bvh`), and writes what is faster",
    },
    About {
        id: "RK002",
        title: "empty space in a box",
        asks: "a BLAS with much empty space in its box should be divided: parts should fill at least 0.5 of its surface area",
        source: "NVIDIA 2022; Arm, Lumen guide, chapter 6",
        severity: Severity::Warning,
        by_hand: "make a mesh of its own of each part that lies apart from the others",
        by_bake: "`auto` tries to cut meshes that are placed once (`bvh`, `cluster`) and to open instances, and writes what is faster",
    },
    About {
        id: "RK003",
        title: "meshes that repeat others",
        asks: "equal meshes should be one mesh, also if they are moved, rotated or mirrored: from 0.05 of the predicted bytes on",
        source: "NVIDIA 2022; Arm, Lumen guide, chapter 5",
        severity: Severity::Warning,
        by_hand: "make nodes that refer to one mesh",
        by_bake: "pass \"find copies\" shares one mesh unless that costs speed or the fastest layout writes copies out; copies on moving nodes stay",
    },
    About {
        id: "RK004",
        title: "parts that move independently",
        asks: "parts that move independently belong in BLASes of their own: no skinned mesh should be rigid in 0.9 of its triangles",
        source: NVIDIA,
        severity: Severity::Warning,
        by_hand: "make a mesh on a node of its own of each part that follows one joint: it need not be rebuilt in each frame",
        by_bake: "bake leaves it as it is: skinned meshes stay",
    },
    About {
        id: "RK005",
        title: "shell around the scene",
        asks: "no sky dome or other shell in the TLAS with the scene: no box of few triangles with 4 times the surface area of the rest",
        source: "NVIDIA 2022; Epic, hardware ray tracing guide",
        severity: Severity::Warning,
        by_hand: "take the sky out of the TLAS: evaluate it in the miss shader, or trace it in a TLAS of its own",
        by_bake: "pass \"isolate\" of `single` and `cluster` keeps it out of the groups of the scene; it stays in the TLAS",
    },
    About {
        id: "RK006",
        title: "long thin triangles",
        asks: "no long thin triangles, especially not diagonal ones: from 0.02 of the surface area of their box on",
        source: "NVIDIA 2022; AMD, Radeon Raytracing Analyzer",
        severity: Severity::Warning,
        by_hand: "divide them along their length, or turn the mesh so that they lie along its axes and undo that in its node",
        by_bake: "bake changes no triangle; `cluster` stores groups along axes of their own if that makes their boxes smaller",
    },
    About {
        id: "RK007",
        title: "triangles that are not opaque",
        asks: "opaque wherever possible, and apart from what is not",
        source: "NVIDIA 2022; Arm",
        severity: Severity::Warning,
        by_hand: "set `alphaMode` to `OPAQUE` in materials whose alpha is 1 everywhere; cut leaves out along their outline",
        by_bake: "bake changes no material; pass \"split opacity\" of `single` and `cluster` puts such triangles into groups of their own",
    },
    About {
        id: "RK008",
        title: "triangles without an area",
        asks: "no triangle without an area and no corner that is not finite",
        source: "NVIDIA 2022; DXR specification",
        severity: Severity::Note,
        by_hand: "delete them",
        by_bake: "bake leaves triangles without an area; those with corners that are not finite are dropped when they are read",
    },
    About {
        id: "RK009",
        title: "tiny acceleration structures",
        asks: "static BLASes should be compacted and share allocations: each takes a multiple of 256 bytes, an allocation 64 KiB",
        source: "NVIDIA 2022; DXR specification; RTXMU",
        severity: Severity::Note,
        by_hand: "compact static BLASes and allocate them from one buffer, or merge objects",
        by_bake: "merges objects if that is faster (`single`, `cluster`); compaction and allocation are up to the program that builds",
    },
    About {
        id: "RK010",
        title: "limits of the interfaces",
        asks: "at most 2^24 instances, and 2^24 geometries and 2^29 triangles per BLAS",
        source: "DXR and Vulkan specifications",
        severity: Severity::Error,
        by_hand: "divide the scene, or the mesh",
        by_bake: "merges instances, or divides meshes with `--max-group-triangles`",
    },
    About {
        id: "RK011",
        title: "number of acceleration structures",
        asks: "at most 300,000 acceleration structures",
        source: "Omniverse asset validator",
        severity: Severity::Warning,
        by_hand: "merge objects, or make equal meshes one",
        by_bake: "merges objects (`single`, `cluster`) and shares copies (pass \"find copies\")",
    },
    About {
        id: "RK012",
        title: "number of instances",
        asks: "at most 100,000 instances (30 frames per second on consoles)",
        source: "Epic, hardware ray tracing guide",
        severity: Severity::Warning,
        by_hand: "merge instances that lie together, or leave far ones out",
        by_bake: "merges instances within `--max-bytes-ratio` (`single`, `cluster`)",
    },
    About {
        id: "RK013",
        title: "loose boxes of stretched instances",
        asks: "no instance stretched or sheared by more than 4:1 whose box has 1.25 times the surface area of its triangles' box",
        source: "AMD, RDNA performance guide",
        severity: Severity::Note,
        by_hand: "apply the scale to the vertices of the mesh",
        by_bake: "writes the triangles out if the instance is merged (`single`, `cluster`), which makes the box tight",
    },
    About {
        id: "RK014",
        title: "objects far outside the rest",
        asks: "no object farther from the middle than 4 times the distance within which 0.999 of the triangles lie",
        source: "OptiX developer forum, thread 285771",
        severity: Severity::Warning,
        by_hand: "delete it, or move it to where it is needed",
        by_bake: "pass \"isolate\" of `single` and `cluster` keeps it out of the groups of the scene; it stays where it is",
    },
    About {
        id: "RK015",
        title: "coordinates far from the origin",
        asks: "no coordinate beyond 8e6 units, and none stored in steps of more than 0.001 of the size of its object",
        source: "OptiX developer forum; Omniverse asset validator",
        severity: Severity::Warning,
        by_hand: "move the scene to the origin",
        by_bake: "stores vertices about the centres of groups, but leaves the scene where it is, and rays lose the same precision",
    },
    About {
        id: "RK016",
        title: "tiny objects",
        asks: "no instance smaller than 1e-5 of the diagonal of the scene's core (1e-3 units, whatever the unit, in the original)",
        source: "Omniverse asset validator",
        severity: Severity::Note,
        by_hand: "merge them with what they lie on, or delete them",
        by_bake: "merges them with their neighbours if that is faster (`single`, `cluster`)",
    },
    About {
        id: "RK017",
        title: "nested instances",
        asks: "no assembly of several meshes placed as a whole: it is flattened to two levels",
        source: "OptiX developer forum, thread 283898; Hart 2019",
        severity: Severity::Note,
        by_hand: "make one mesh of the meshes of the assembly and place that",
        by_bake: "merges instances within `--max-bytes-ratio` (`single`, `cluster`), but makes no mesh of an assembly",
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_numbered_in_order() {
        for (number, rule) in (1..).zip(Rule::ALL) {
            assert_eq!(rule.id(), format!("RK{number:03}"));
            assert_eq!(Rule::by_id(&rule.id().to_lowercase()), Some(rule));
        }
        assert_eq!(Rule::by_id("RK018"), None);
    }

    #[test]
    fn the_documentation_has_each_rule_as_it_is_checked() {
        let documented = include_str!("../../../docs/inspect.md");
        for rule in Rule::ALL {
            let cells = [rule.id(), rule.asks(), rule.source(), rule.severity().name(), rule.by_hand(), rule.by_bake()];
            let row = format!("| {} |", cells.join(" | "));
            assert!(documented.contains(&row), "docs/inspect.md lacks the row\n{row}");
        }
    }
}
