//! Puts into words what a verification found, and what was not done as requested.

use std::fmt::{self, Display, Formatter};

use serde::{Serialize, Serializer};

use super::words::{counted, grouped};
use crate::verify::regrouped::Regrouped;
use crate::verify::seams::Seams;
use crate::verify::sight::CannotTell;
use crate::verify::{Failure, FaultKind, Mismatch, Note, OpaqueTextures, Side, Target, Verification, WhyCpu, Wrong};

impl Display for Verification {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match &self.structure {
            _ if !self.passed() => {
                let failures: Vec<String> = self.failures.iter().map(ToString::to_string).collect();
                f.write_str(&failures.join("; "))
            }
            Some(structure) => {
                write!(f, "{} triangles and {} rays agree", grouped(structure.triangles_after), grouped(self.rays))
            }
            None => write!(f, "{} rays agree", grouped(self.rays)),
        }
    }
}

impl Serialize for Failure {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Failure::Triangles { fault, count, first } => match (first, count) {
                (Some(first), 1) => write!(f, "1 triangle {fault}: {first}"),
                (Some(first), n) => write!(f, "{n} triangles {fault}, the first {first}"),
                (None, n) => write!(f, "{n} triangles {fault}"),
            },
            Failure::Moved { count, farthest, distance, suggested_max_position_error_ratio } => {
                let farthest = farthest.as_ref().map(|at| format!(", the farthest {at}")).unwrap_or_default();
                write!(f, "{} moved, by up to {distance:.3e} units{farthest}", counted(*count as usize, "triangle"))?;
                match suggested_max_position_error_ratio {
                    Some(ratio) => write!(f, " (the same with `--max-position-error-ratio {ratio:e}`)"),
                    None => Ok(()),
                }
            }
            Failure::Differs(difference) => write!(f, "{difference}"),
            Failure::Regrouped(found) => f.write_str(&regrouped(found)),
            Failure::Rays { mismatches, rays, examples } => {
                let examples: Vec<String> = examples.iter().map(ToString::to_string).collect();
                write!(f, "{mismatches} of {rays} rays see something else: {}", examples.join("; "))
            }
            Failure::Seams(seams) => f.write_str(&cracks(seams)),
            Failure::FarHits { far_hits, rays } => write!(
                f,
                "cannot tell: {} of {} rays hit another surface in the output, or nothing, which rounding may explain",
                grouped(*far_hits),
                grouped(*rays)
            ),
            Failure::Untouched { touched_area_ratio } => {
                write!(f, "cannot tell: rays touched only {:.2} % of the area", 100.0 * touched_area_ratio)
            }
            Failure::NothingHit => f.write_str("cannot tell: no ray hits anything in either file"),
            Failure::CannotTell(what) => write!(f, "cannot tell: {what}"),
        }
    }
}

impl Display for CannotTell {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let names: Vec<String> = self.names.iter().map(|name| format!("`{name}`")).collect();
        let more = match self.objects - self.names.len() {
            0 => String::new(),
            more => format!(" and {} more", grouped(more as u64)),
        };
        write!(
            f,
            "rays in single precision cannot tell {} from what is beside {}: {}{more}",
            counted(self.objects, "object"),
            if self.objects == 1 { "it" } else { "them" },
            names.join(", ")
        )
    }
}

impl Display for Mismatch {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let Mismatch { kind, ray, wrong, shown, truth } = self;
        let shown = shown.as_ref().map(|shown| format!(" ({shown})")).unwrap_or_default();
        let truth = truth.as_ref().map_or("nothing".to_owned(), ToString::to_string);
        write!(f, "{kind:?} ray {ray}: the output shows {wrong}{shown}, the input {truth}")
    }
}

impl Display for Target {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Target::Triangle(name) => f.write_str(name),
            Target::Surface { material, distance } => write!(f, "material {material} at distance {distance:.6}"),
        }
    }
}

impl Display for Wrong {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        f.write_str(match self {
            Wrong::Nothing => "nothing",
            Wrong::UnknownTriangle => "a triangle that the input does not have",
            Wrong::MovedTriangle => "a triangle that lies elsewhere",
            Wrong::BackOfTriangle => "the other side of a triangle",
            Wrong::LostTriangle => "not the triangle that is missing",
            Wrong::TriangleBehind => "a triangle behind the one that is hit",
            Wrong::MovedSurface => "a surface that lies elsewhere",
            Wrong::BackOfSurface => "the other side of a surface",
            Wrong::SurfaceBehind => "a surface behind the one that is hit",
            Wrong::Material => "another material",
            Wrong::MaterialInPlace => "another material in the same place",
        })
    }
}

impl Display for FaultKind {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        f.write_str(match self {
            FaultKind::Missing => "missing",
            FaultKind::Repeated => "repeated",
            FaultKind::Unknown => "unknown",
            FaultKind::WrongMaterial => "of another material",
            FaultKind::Flipped => "flipped",
            FaultKind::Moved => "moved",
            FaultKind::Elsewhere => "recorded as another one",
        })
    }
}

/// Says which BLAS groups are not what they were.
fn regrouped(found: &Regrouped) -> String {
    let kinds = [
        (&found.merged, "object of the output has", "objects of the output have", "triangles of several objects"),
        (&found.split, "object is", "objects are", "split into several"),
        (&found.unshared, "mesh is", "meshes are", "no longer shared by the objects that place it"),
    ];
    let said = kinds.into_iter().filter_map(|(found, one, many, what)| {
        let (count, first) = found.as_ref()?;
        let objects = if *count == 1 { one } else { many };
        Some(format!("{count} {objects} {what}, the first at {first}"))
    });
    format!("the layout is another: {}", said.collect::<Vec<_>>().join("; "))
}

impl Display for Note {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Note::OnCpu(why) => write!(f, "rays are traced on the CPU: {why}"),
            Note::NotInTurns(why) => write!(
                f,
                "the structures of input and output were built and timed one after the other, not in turns: {why}; \
                 speeds may have drifted in between by more than the spread"
            ),
            Note::ByLook => {
                f.write_str("not every material has a name in both files: materials are matched by their look")
            }
            Note::CannotTell(what) => write!(f, "{what}; the exact comparison can"),
            Note::RecordedElsewhere(count, first) => write!(
                f,
                "{} not the one that the output records, the first {first}",
                are(*count)
            ),
            Note::RecordOfAnotherInput => f.write_str(
                "the record of provenance leads to another input: triangles are compared by their place alone",
            ),
            Note::StaleRecord => f.write_str(
                "the record of provenance is stale, as the file was changed after the bake: triangles are compared by their \
                 place alone",
            ),
            Note::DamagedRecord(cause) => {
                write!(f, "the record of provenance cannot be used: {cause}; triangles are compared by their place alone")
            }
            Note::Seams(seams) => write!(f, "{}; corners are off, as allowed", cracks(seams)),
            Note::Differs(difference) => write!(f, "{difference}"),
            Note::Degenerate(side, count, first) => write!(
                f,
                "only the {} has {} without area, which no ray sees, the first {first}",
                file(*side),
                counted(*count as usize, "triangle")
            ),
            Note::OpaqueTextures(side, textures) => write!(f, "{}: {textures}", file(*side)),
        }
    }
}

fn cracks(seams: &Seams) -> String {
    format!(
        "the surface has cracks: of {} rays aimed at shared edges and vertices, {} pass through the output and {} through \
         the input",
        grouped(seams.rays),
        grouped(seams.after_lost),
        grouped(seams.before_lost)
    )
}

fn file(side: Side) -> &'static str {
    match side {
        Side::Before => "input",
        Side::After => "output",
    }
}

fn are(triangles: u64) -> String {
    format!("{} {}", counted(triangles as usize, "triangle"), if triangles == 1 { "is" } else { "are" })
}

impl Display for WhyCpu {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            WhyCpu::Failed(why) => f.write_str(why),
            WhyCpu::NoDevice => f.write_str("no Vulkan device can trace rays"),
            WhyCpu::OnlySoftware(drivers) => {
                let drivers: Vec<String> = drivers.iter().map(|name| format!("`{name}`")).collect();
                write!(f, "no Vulkan device but the software driver {} can trace rays", drivers.join(", "))
            }
        }
    }
}

impl Display for OpaqueTextures {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let more = match self.more {
            0 => String::new(),
            n => format!("; and {n} more"),
        };
        let named = self.named.join("; ");
        write!(f, "timed rays take these textures of alpha-tested materials for opaque: {named}{more}")
    }
}
