//! The pass "find copies": meshes that are copies of others become instances of them.

use std::collections::BTreeSet;
use std::time::Instant;

use raykiln_formats::Document;
use serde_json::Value;

use super::{BakeOptions, measure_with};
use crate::choose::Choice;
use crate::copies::{self, Copies, Likeness};
use crate::cost::Metrics;
use crate::cost::mesh_trees::MeshTrees;
use crate::report::Pass;
use crate::scene::Scene;
use crate::words::{bytes, counted};

/// Whether copies are looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FindCopies {
    /// For `auto`; the other methods restructure what the file holds, as it holds it.
    #[default]
    ByMethod,
    /// Whatever the method.
    Always(Likeness),
    /// Never.
    Off,
}

impl FindCopies {
    fn likeness(self, method: Choice) -> Option<Likeness> {
        match (self, method) {
            (FindCopies::Off, _) => None,
            (FindCopies::Always(likeness), _) => Some(likeness),
            (FindCopies::ByMethod, Choice::Auto) => Some(Likeness::Rigid),
            (FindCopies::ByMethod, Choice::Method(_)) => None,
        }
    }
}

/// Predicted cost that sharing may add, over the input's: what it saves is memory.
const MOST_COST_RATIO: f64 = 1.01;

/// Share of the input's predicted bytes of acceleration structures that `auto` must save to share at all.
const LEAST_SAVED_RATIO: f64 = 0.05;

/// Bytes that `auto` must save besides: what devices allocate at least at a time (see rule RK009 of `inspect`).
const LEAST_SAVED_BYTES: u64 = 64 << 10;

/// Lets meshes stand in for their copies, unless their looser boxes cost too much or hardly any memory is saved.
/// Returns the metrics of the scene with them, and what was done; nothing where the options leave the pass out.
pub(super) fn share(
    doc: &Document,
    scene: &mut Scene,
    trees: &MeshTrees,
    before: &Metrics,
    options: &BakeOptions,
) -> (Metrics, Option<Pass>) {
    let start = Instant::now();
    let Some(likeness) = options.copies.likeness(options.choose.method) else { return (before.clone(), None) };
    let max_position_error_ratio = options.verify.max_position_error_ratio;
    let least_saved_bytes = if options.copies == FindCopies::ByMethod { least_saved_bytes(before) } else { 0 };
    let found = copies::find(doc, scene, &copies::Options { likeness, max_position_error_ratio, least_saved_bytes });
    let (metrics, applied, reason) = match (found.list.as_slice(), found.most_saved_bytes) {
        ([], Some(0) | None) => (before.clone(), false, "no two meshes are alike".to_owned()),
        ([], Some(most)) => {
            let reason = format!("sharing copies, if there are any, would save {} at most", bytes(most));
            (before.clone(), false, reason)
        }
        _ => apply(doc, scene, trees, before, &found, options),
    };
    (metrics, Some(Pass { name: "find copies", applied, reason, seconds: start.elapsed().as_secs_f64() }))
}

/// The pass as it came out: where the input is left alone after all, it stays without.
pub(super) fn as_written(pass: Pass, unchanged: bool) -> Pass {
    match pass.applied && unchanged {
        true => Pass { applied: false, reason: format!("{}; but the input is left alone", pass.reason), ..pass },
        false => pass,
    }
}

/// Predicted bytes of acceleration structures that `auto` must save to share at all.
fn least_saved_bytes(before: &Metrics) -> u64 {
    LEAST_SAVED_BYTES.max((LEAST_SAVED_RATIO * before.as_bytes() as f64).ceil() as u64)
}

fn apply(
    doc: &Document,
    scene: &mut Scene,
    trees: &MeshTrees,
    before: &Metrics,
    found: &Copies,
    options: &BakeOptions,
) -> (Metrics, bool, String) {
    let [copies, models] = [found.list.len(), found.models()];
    let words = match copies {
        1 => "1 mesh is a copy of another".to_owned(),
        _ => format!("{} are copies of {models}", counted(copies, "mesh")),
    };
    let blas_per = options.verify.build.blas_per;
    copies::apply(scene, found);
    let metrics = measure_with(scene, trees, blas_per);
    if metrics.two_level_cost > MOST_COST_RATIO * before.two_level_cost {
        copies::undo(scene);
        let (with, without) = (metrics.two_level_cost, before.two_level_cost);
        let reason = format!("{words}, but turned boxes are looser: predicted cost {with:.2} against {without:.2}");
        return (before.clone(), false, reason);
    }
    let as_bytes = [before, &metrics].map(Metrics::as_bytes);
    let saved = as_bytes[0].saturating_sub(as_bytes[1]);
    if options.copies == FindCopies::ByMethod && saved < least_saved_bytes(before) {
        copies::undo(scene);
        return (before.clone(), false, format!("{words}, but sharing them saves only {}", bytes(saved)));
    }
    let stored = bytes(stored_bytes(doc, scene, found));
    let reason = format!(
        "{words}; sharing saves {stored} of stored geometry and {} of predicted acceleration structures",
        bytes(saved)
    );
    (metrics, true, reason)
}

/// Bytes of the accessors that only the copies' meshes use.
fn stored_bytes(doc: &Document, scene: &Scene, found: &Copies) -> u64 {
    let copies: BTreeSet<u64> = found.list.iter().map(|c| u64::from(scene.meshes[c.mesh.0 as usize].source)).collect();
    let (mut dropped, mut kept) = (BTreeSet::new(), BTreeSet::new());
    for (mesh, number) in doc.json["meshes"].as_array().into_iter().flatten().zip(0..) {
        let users = if copies.contains(&number) { &mut dropped } else { &mut kept };
        for primitive in mesh["primitives"].as_array().into_iter().flatten() {
            let attributes = primitive["attributes"].as_object().into_iter().flat_map(|a| a.values());
            users.extend(attributes.chain(primitive.get("indices")).filter_map(Value::as_u64));
        }
    }
    dropped.difference(&kept).map(|&accessor| accessor_bytes(&doc.json["accessors"][accessor as usize])).sum()
}

fn accessor_bytes(accessor: &Value) -> u64 {
    let components = match accessor["type"].as_str() {
        Some("SCALAR") => 1,
        Some("VEC2") => 2,
        Some("VEC3") => 3,
        _ => 4,
    };
    let size = match accessor["componentType"].as_u64() {
        Some(5120 | 5121) => 1,
        Some(5122 | 5123) => 2,
        _ => 4,
    };
    accessor["count"].as_u64().unwrap_or(0).saturating_mul(components * size)
}
