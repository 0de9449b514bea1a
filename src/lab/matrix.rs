//! Every layout of every scene: what rays meet in it, and how long they take.

use glam::DVec3;

use super::config::Config;
use super::rows::{KindRow, Row};
use crate::choose::model::{Class, Counts};
use crate::choose::plans::Plan;
use crate::choose::{Laid, lay_out, segments};
use crate::cost::mesh_trees::MeshTrees;
use crate::layout;
use crate::methods::Cache;
use crate::scene::Scene;
use crate::verify::cpu::{CpuTracer, Reference, TwoLevel};
use crate::verify::rays::{self, RayKind, Rays};
use crate::verify::weights::Weights;
use crate::verify::{Machine, PerKind, RaceResult, Timing, VerifyOptions, race_on_cpu};

/// Layouts that come to the same, by the names of their plans.
struct Entry {
    names: Vec<String>,
    laid: Laid,
}

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
    let trees = TwoLevel::build_to_count(scene, &MeshTrees::default());
    let rays = rays::generate(scene, &Reference::new(&trees), config.counted_rays, config.verify.seed);
    let plans = segments::given(&config.plans, &trees, &rays, &config.verify.weights, DVec3::ZERO);
    drop(trees);
    let entries = lay_out_all(scene, &plans, config);
    let mut rows: Vec<Row> = entries.iter().map(|entry| predict(name, scene, entry, &rays, class)).collect();

    let scene_of = |i: usize| entries[i].laid.written(scene);
    // Prices are fitted to all kinds of rays, whatever they count for elsewhere.
    let verify = VerifyOptions { weights: Weights(PerKind::of(|_| 1.0)), ..config.verify.clone() };
    let laps = match machine.race(scene, entries.len(), scene_of, Timing::Full, &verify) {
        Some(laps) => laps?,
        None => race_on_cpu(scene, entries.len(), scene_of, &verify).into_iter().map(Ok).collect(),
    };
    let (device, kind) = machine.name();
    for (row, lap) in rows.iter_mut().zip(laps) {
        (row.device, row.device_kind) = (device.to_owned(), kind);
        match lap {
            Ok(lap) => time(row, &lap),
            Err(why) => row.failure = Some(why),
        }
    }
    Ok(rows)
}

fn lay_out_all(scene: &Scene, plans: &[Plan], config: &Config) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut cache = Cache::serving(plans.iter().map(|plan| &plan.options));
    for plan in plans {
        let laid = lay_out(&mut cache, scene, plan, config.verify.max_position_error_ratio);
        match entries.iter_mut().find(|e| e.laid.is_same(&laid)) {
            Some(same) => same.names.push(plan.id.to_string()),
            None => entries.push(Entry { names: vec![plan.id.to_string()], laid }),
        }
    }
    entries
}

/// What is known of a layout without a device.
fn predict(name: &str, scene: &Scene, entry: &Entry, rays: &Rays, class: Class) -> Row {
    let stored = layout::stored(scene, &entry.laid.layout);
    let trees = TwoLevel::build_to_count(&stored, &MeshTrees::default());
    let tracer = CpuTracer::new(&trees);
    let prices = class.prices();
    let row = |kind: RayKind| {
        let counts = Counts::of(&tracer, &rays.kinds[kind], kind);
        KindRow { predicted_picoseconds: prices[kind].of(&counts), ..KindRow::of(&counts) }
    };
    Row {
        scene: name.to_owned(),
        layout: entry.names[0].clone(),
        same_as: entry.names[1..].to_vec(),
        triangles: stored.triangles_placed(),
        groups: stored.meshes.len() as u64,
        instances: stored.instances.len() as u64,
        two_level_cost: trees.cost(scene.bounds().area()),
        predicted_bytes: entry.laid.layout.as_bytes(scene),
        position_error_ratio: entry.laid.position_error_ratio,
        kinds: PerKind::of(row),
        ..Row::default()
    }
}

/// Adds what a device measured.
fn time(row: &mut Row, lap: &RaceResult) {
    let finite = |x: f64| x.is_finite().then_some(x);
    for (kind, of) in row.kinds.iter_mut() {
        let speed = &lap.kinds[kind];
        if speed.after_mrays_per_s > 0.0 {
            // A million rays a second are a ray a microsecond.
            of.picoseconds = finite(1e6 / speed.after_mrays_per_s);
            of.speedup_ratio = finite(speed.speedup_ratio);
            of.spread_ratio = finite(speed.spread_ratio);
        }
    }
    row.built_bytes = lap.built.map(|b| b.blas_bytes_compacted.unwrap_or(b.blas_bytes).saturating_add(b.tlas_bytes));
}
