//! Every layout of every scene: what rays meet in it, and how long they take.

use super::config::Config;
use super::rows::{KindRow, Row};
use crate::choose::model::Class;
use crate::choose::{Candidate, Duplicate, Evaluated, Evaluator, written};
use crate::commands::measure::measure_with;
use crate::cost::mesh_trees::MeshTrees;
use crate::layout::{BlasPer, as_built};
use crate::scene::Scene;
use crate::verify::weights::Weights;
use crate::verify::{Machine, PerKind, RaceResult, Timing, VerifyOptions, race_on_cpu};

/// A row for each layout of a scene, in the order of the plans; those that come to what an earlier one came to share its
/// row.
///
/// # Errors
/// Why the device cannot take the scene, in words.
pub(super) fn measure(
    name: &str,
    scene: &Scene,
    machine: &Machine,
    class: Class,
    config: &Config,
) -> Result<Vec<Row>, String> {
    let Evaluated { candidates, duplicates, .. } = evaluate(scene, class, config);
    let blas_per = config.verify.build.blas_per;
    let mut rows: Vec<Row> = candidates.iter().map(|candidate| predicted(name, scene, candidate, blas_per)).collect();
    for Duplicate { plan, same_as, .. } in duplicates {
        rows[same_as].same_as.push(plan.to_string());
    }

    let scene_of = written(scene, candidates.iter().map(|candidate| &candidate.laid).collect());
    // Prices are fitted to all kinds of rays, whatever they count for elsewhere.
    let verify = VerifyOptions { weights: Weights(PerKind::of(|_| 1.0)), ..config.verify.clone() };
    let laps = match machine.race(scene, candidates.len(), &scene_of, Timing::Full, &verify) {
        Some(laps) => laps?,
        None => race_on_cpu(scene, candidates.len(), &scene_of, &verify).into_iter().map(Ok).collect(),
    };
    let (device, kind) = machine.name();
    for (row, lap) in rows.iter_mut().zip(laps) {
        (row.device, row.device_kind) = (device.to_owned(), kind);
        match lap {
            Ok(lap) => time(row, &lap, &verify.weights),
            Err(why) => row.failure = Some(why),
        }
    }
    Ok(rows)
}

/// Evaluates the plans as `bake` does, with rays of all kinds.
fn evaluate(scene: &Scene, class: Class, config: &Config) -> Evaluated {
    let trees = MeshTrees::build(scene);
    let evaluator = Evaluator {
        trees: &trees,
        two_level_cost: measure_with(scene, &trees, config.verify.build.blas_per).two_level_cost,
        rays_per_kind: config.counted_rays,
        all_kinds: true,
        class,
        verify: &config.verify,
    };
    evaluator.evaluate(scene, &config.plans)
}

/// What is known of a layout without a device.
fn predicted(name: &str, scene: &Scene, candidate: &Candidate, blas_per: BlasPer) -> Row {
    let Candidate { plan, laid, predicted, .. } = candidate;
    let built = as_built(scene, &laid.layout, blas_per);
    let triangles = |group: u32| built.groups[group as usize].content.triangle_count(scene) as u64;
    Row {
        scene: name.to_owned(),
        layout: plan.id.to_string(),
        triangles: built.placements.iter().map(|placement| triangles(placement.group)).sum(),
        groups: built.groups.len() as u64,
        instances: built.placements.len() as u64,
        two_level_cost: predicted.two_level_cost,
        predicted_bytes: predicted.as_bytes,
        position_error_ratio: laid.position_error_ratio,
        kinds: predicted.kinds.map(KindRow::of),
        ..Row::default()
    }
}

/// Adds what a device measured.
fn time(row: &mut Row, lap: &RaceResult, weights: &Weights) {
    let finite = |x: f64| x.is_finite().then_some(x);
    let kinds = lap.views.kinds(weights);
    for (kind, of) in row.kinds.iter_mut() {
        let speed = &kinds[kind];
        if speed.after_mrays_per_s > 0.0 {
            // A million rays a second are a ray a microsecond.
            of.picoseconds = finite(1e6 / speed.after_mrays_per_s);
            of.speedup_ratio = finite(speed.speedup_ratio);
            of.spread_ratio = finite(speed.spread_ratio);
        }
    }
    row.built_bytes = lap.built.map(|b| b.blas_bytes_compacted.unwrap_or(b.blas_bytes).saturating_add(b.tlas_bytes));
}
