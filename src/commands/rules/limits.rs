//! RK010: the limits of the interfaces (DXR and Vulkan specifications), RK011: about 300,000 acceleration structures
//! (Omniverse asset validator: Omniverse RTX shows no more), and RK012: 100,000 instances for 30 frames per second on
//! consoles (Epic's hardware ray tracing guide).

use super::Subject;
use crate::report::{Broken, Finding, Objects, Rule};
use crate::scene::Mesh;

const MOST_INSTANCES: u64 = 1 << 24;
const MOST_GEOMETRIES: u64 = 1 << 24;
const MOST_TRIANGLES: u64 = 1 << 29;
const MOST_STRUCTURES: u64 = 300_000;
const MOST_INSTANCES_CONSOLE: u64 = 100_000;

/// Counts what limits apply to.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    instances: u64,
    /// Largest number of geometries of a mesh.
    geometries: u64,
    /// Largest number of triangles of a mesh.
    triangles: u64,
    structures: u64,
}

/// Compares counts with limits.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let meshes = &subject.scene.meshes;
    exceeded(&Counts {
        instances: subject.scene.instances.len() as u64,
        geometries: meshes.iter().map(|m| m.geometries.len()).max().unwrap_or(0) as u64,
        triangles: meshes.iter().map(Mesh::triangle_count).max().unwrap_or(0) as u64,
        structures: meshes.len() as u64,
    })
}

fn exceeded(counts: &Counts) -> Vec<Finding> {
    let over = |rule, count: u64, most: u64, what: &'static str| {
        (count > most).then(|| Finding::new(Objects::default(), &Broken::TooMany { rule, count, what, most }))
    };
    let found = [
        over(Rule::Limits, counts.instances, MOST_INSTANCES, "instances"),
        over(Rule::Limits, counts.geometries, MOST_GEOMETRIES, "geometries in one mesh"),
        over(Rule::Limits, counts.triangles, MOST_TRIANGLES, "triangles in one mesh"),
        over(Rule::Structures, counts.structures, MOST_STRUCTURES, "acceleration structures"),
        over(Rule::Instances, counts.instances, MOST_INSTANCES_CONSOLE, "instances"),
    ];
    found.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Severity;

    fn rules(counts: Counts) -> Vec<(&'static str, Severity)> {
        exceeded(&counts).iter().map(|finding| (finding.rule.id(), finding.severity)).collect()
    }

    #[test]
    fn counts_beyond_a_limit_are_found() {
        let none = Counts::default();
        assert_eq!(rules(Counts { geometries: MOST_GEOMETRIES + 1, ..none }), [("RK010", Severity::Error)]);
        assert_eq!(rules(Counts { triangles: MOST_TRIANGLES + 1, ..none }), [("RK010", Severity::Error)]);
        assert_eq!(rules(Counts { structures: MOST_STRUCTURES + 1, ..none }), [("RK011", Severity::Warning)]);
        assert_eq!(rules(Counts { instances: MOST_INSTANCES_CONSOLE + 1, ..none }), [("RK012", Severity::Warning)]);
        let most = rules(Counts { instances: MOST_INSTANCES + 1, ..none });
        assert_eq!(most, [("RK010", Severity::Error), ("RK012", Severity::Warning)]);
    }

    #[test]
    fn counts_at_a_limit_are_not() {
        let at = Counts {
            instances: MOST_INSTANCES_CONSOLE,
            geometries: MOST_GEOMETRIES,
            triangles: MOST_TRIANGLES,
            structures: MOST_STRUCTURES,
        };
        assert_eq!(rules(at), []);
    }
}
