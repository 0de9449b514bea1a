//! Puts notes into words.

use std::fmt::{self, Display, Formatter};

use raykiln_formats::edit::CannotPrune;

use super::words::{counted, plural};
use crate::cost::Metrics;
use crate::emit::{self, Copied};
use crate::layout::{Changed, Limit, Meshes, Note, Stay};
use crate::verify::Sides;

impl Display for Note {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Note::OverlapNotLowered { of_input } => {
                write!(f, "no round lowers the overlap ratio below the {of_input:.3} of the input")
            }
            Note::NothingSplit { allowed, objects } => write!(
                f,
                "no object is split: {allowed} tree nodes are allowed, and the {objects} objects have one each"
            ),
            Note::BeyondLimit { instances, meshes, limit } => {
                let what = [plural(*instances as usize, "instance"), plural(*meshes, "mesh")];
                let why = match limit {
                    Limit::Bytes => "the bytes allowed would be exceeded",
                    Limit::Triangles => "too many triangles would have to be written out",
                };
                write!(f, "{instances} {} of {meshes} {} stay as they are: {why}", what[0], what[1])
            }
            Note::Changed(changed) => changed.fmt(f),
            Note::ChangedLikewise(meshes) => write!(f, "instances of {} likewise", counted(*meshes, "further mesh")),
            Note::Stay { of, instances, why } => {
                let whose = match of {
                    Meshes::All => String::new(),
                    Meshes::One(name) => format!("`{name}`: "),
                    Meshes::Several(count) => format!("{}: ", counted(*count, "mesh")),
                };
                write!(f, "{whose}{} stay: {why}", counted(*instances, "instance"))
            }
        }
    }
}

impl Display for Changed {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let Changed { mesh, baked, opened, pieces, kept, boxes_per_ray, cost_ratio } = self;
        let instances = |count: usize| counted(count, "instance");
        let mut parts = Vec::new();
        if *baked > 0 {
            parts.push(format!("{} baked", instances(*baked)));
        }
        if *opened > 0 {
            parts.push(match pieces {
                1 => format!("{} stored in a frame that fits the mesh", instances(*opened)),
                pieces => format!("{} opened into {pieces} pieces", instances(*opened)),
            });
        }
        if *kept > 0 {
            parts.push(format!("{} kept", instances(*kept)));
        }
        write!(
            f,
            "`{mesh}`: {}: a ray that meets them enters {boxes_per_ray:.1} of their boxes before it ends; predicted to \
             cost {:.0} % less",
            parts.join(", "),
            100.0 * (1.0 - cost_ratio)
        )
    }
}

impl Display for Stay {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Stay::Apart => f.write_str("no two instance boxes overlap"),
            Stay::Rare => f.write_str("too few rays meet them to tell what would pay"),
            Stay::Bytes { allowed } => {
                write!(f, "more than the {allowed:.0} bytes allowed beyond the input's would be needed")
            }
            Stay::NoGain => f.write_str("neither opening nor baking them is predicted to gain enough"),
        }
    }
}

impl Display for emit::Note {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            emit::Note::NothingPruned(CannotPrune(extension)) => {
                write!(f, "no node was pruned: the extension {extension} may refer to it")
            }
            emit::Note::NoRoomForRecord => f.write_str(
                "there is no record of provenance: the extras of the file are not an object; --record sidecar has room",
            ),
            emit::Note::MayReferToData(extension) => {
                write!(f, "unused data stays in the file: the extension {extension} may refer to it")
            }
        }
    }
}

impl Display for Copied {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let Copied { nodes, copies, stay } = *self;
        let stay = match stay {
            0 => String::new(),
            1 => {
                "; 1 stays a node, as no translation, rotation and scale come close enough to its transform".to_owned()
            }
            n => {
                format!("; {n} stay nodes, as no translation, rotation and scale come close enough to their transforms")
            }
        };
        match nodes {
            0 => write!(f, "no two instances of one mesh can become copies of one node{stay}"),
            _ => write!(
                f,
                "{} are copies of {}: {} fewer place a mesh{stay}",
                counted(copies, "instance"),
                counted(nodes, "node"),
                counted(copies - nodes, "node")
            ),
        }
    }
}

/// Compares the costs of layouts built as one BLAS per primitive with those of one per mesh.
pub(crate) fn built_per_primitive(metrics: Sides<&Metrics>, of_meshes: Sides<&Metrics>) -> String {
    let costs = |of: Sides<&Metrics>| {
        let Sides { before, after } = of.map(|m| format!("{:.2} in {} BLASes", m.two_level_cost, m.mesh_groups));
        format!("{before} before, {after} after")
    };
    format!(
        "built as one BLAS per primitive, the two-level cost is {}; as one BLAS per mesh, {}",
        costs(metrics),
        costs(of_meshes)
    )
}

/// Why nothing was timed.
pub(crate) const EQUAL_FILES: &str = "both files are equal: nothing was timed";
