//! Inspects a scene: what it consists of, what it costs, and which vendor rules it breaks.

use crate::commands::measure::measure_with;
use crate::commands::rules;
use crate::commands::source::Source;
use crate::cost::mesh_trees::MeshTrees;
use crate::cost::overlap::{self, Pair};
use crate::layout::BlasPer;
use crate::motion::advice;
use crate::report::html::Shown;
use crate::report::{Input, InspectReport, OverlappingPair, Rule};
use crate::scene::{self, LoadOptions, Scene};
use crate::verify::sight::DeviceError;

/// Number of pairs to list.
const WORST: usize = 10;

/// Inspects a file without changing it.
///
/// # Errors
/// Fails if the input cannot be read.
pub fn inspect(source: Source, options: &LoadOptions) -> Result<InspectReport, raykiln_formats::Error> {
    inspect_and_show(source, options, false).map(|(report, _)| report)
}

/// Like [`inspect`]; also gathers what a page shows of the scene, if asked for.
///
/// # Errors
/// Like [`inspect`].
pub fn inspect_and_show(
    source: Source,
    options: &LoadOptions,
    show: bool,
) -> Result<(InspectReport, Option<Shown>), raykiln_formats::Error> {
    let doc = source.read(options)?;
    let (scene, warnings) = scene::load(&doc, options)?;
    let trees = MeshTrees::build(&scene);
    let before = measure_with(&scene, &trees, BlasPer::Mesh);
    let report = InspectReport {
        schema: InspectReport::SCHEMA,
        raykiln_version: env!("CARGO_PKG_VERSION"),
        input: Input::of(doc.path.clone(), doc.file_bytes(), &scene),
        rules_checked: Rule::ALL.to_vec(),
        findings: rules::findings(&doc, &scene, &trees, before.as_bytes()),
        motion: advice::advise(&doc, &scene)?,
        before,
        worst_pairs: worst_pairs_of(&scene),
        device_error: DeviceError::of(&scene),
        warnings: doc.warnings.iter().chain(&warnings).map(ToString::to_string).collect(),
    };
    Ok((report, show.then(|| Shown::of(&scene).with_pictures((&doc, &scene, &trees), None))))
}

/// The pairs of instances of the scene's core that overlap most, worst first.
fn worst_pairs_of(scene: &Scene) -> Vec<OverlappingPair> {
    let area = scene.core().bounds().area();
    let boxes = scene.core().instance_boxes(scene);
    overlap::worst_pairs(&boxes, WORST).iter().map(|p| named(scene, p, area)).collect()
}

fn named(scene: &Scene, pair: &Pair, area: f64) -> OverlappingPair {
    let name = |i: u32| scene.instances[i as usize].display_name();
    OverlappingPair { a: name(pair.a), b: name(pair.b), overlap_ratio: pair.area / area }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::measure::measure_as_is;
    use crate::layout::test_scenes::heaps;
    use crate::scene::Bounds;
    use glam::DVec3;

    fn cube(at: f64, size: f64) -> Bounds {
        Bounds { min: DVec3::splat(at), max: DVec3::splat(at + size) }
    }

    #[test]
    fn the_worst_pair_comes_first_and_the_list_is_short() {
        let mut boxes: Vec<Bounds> = (0..40).map(|i| cube(f64::from(i), 1.1)).collect();
        boxes.push(cube(20.0, 3.0));
        let pairs = overlap::worst_pairs(&boxes, WORST);
        assert_eq!(pairs.len(), WORST);
        assert_eq!(pairs[0].b, 40);
        assert!(pairs.is_sorted_by(|x, y| x.area >= y.area));
    }

    #[test]
    fn a_dome_and_a_far_object_hide_no_overlap() {
        let [plain, exceptional] = [heaps(0), heaps(2)];
        let [before, after] = [&plain, &exceptional].map(measure_as_is);
        assert_eq!(before.core_overlap_ratio, before.overlap_ratio);
        assert!(after.overlap_ratio < 0.01 * before.overlap_ratio, "{} {}", after.overlap_ratio, before.overlap_ratio);
        assert_eq!(after.core_overlap_ratio, before.core_overlap_ratio);
        assert_eq!(worst_pairs_of(&plain), worst_pairs_of(&exceptional));
    }
}
