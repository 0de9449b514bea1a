//! What an earlier bake recorded in `extras.raykiln` of a primitive.

use serde_json::Value;

use super::attributes::scalars;
use super::json::{At, unsigned};
use crate::Document;
use crate::contents::{Provenance, Source};

/// The provenance of a primitive with `triangles` triangles in the file.
///
/// # Errors
/// Says what is wrong with a record that cannot be used.
pub(super) fn provenance(doc: &Document, primitive: &At<'_>, triangles: usize) -> Result<Option<Provenance>, String> {
    let Some(record) = primitive.get("extras").and_then(|extras| extras.get("raykiln")) else { return Ok(None) };
    if let Some(source) = record.get("source") {
        return same(&source).map(Some).ok_or_else(|| "\"source\" is malformed".to_owned());
    }
    let Some(found) = record.get("provenance") else { return Ok(None) };
    let sources = found.get("sources").and_then(|at| at.value.as_array()).ok_or("\"sources\" is missing")?;
    let sources: Option<Vec<Source>> = sources.iter().map(source).collect();
    let sources = sources.ok_or("a source is malformed")?;
    let accessor = found.get("runs").and_then(|at| unsigned(at.value)).ok_or("\"runs\" is missing")?;
    let numbers = scalars(doc, accessor).ok_or("\"runs\" is no sound accessor of unsigned integers")?;
    let runs = runs(&numbers, sources.len(), triangles)?;
    Ok(Some(Provenance::Runs { sources, runs }))
}

fn same(source: &At<'_>) -> Option<Provenance> {
    let number = |key| source.value.get(key).and_then(small);
    Some(Provenance::Same { mesh: number("mesh")?, primitive: number("primitive")? })
}

/// `[node, copy, mesh, primitive]`, the node possibly null.
fn source(value: &Value) -> Option<Source> {
    let [node, copy, mesh, primitive] = value.as_array()?.as_slice() else { return None };
    let node = if node.is_null() { None } else { Some(small(node)?) };
    Some(Source { node, copy: small(copy)?, mesh: small(mesh)?, primitive: small(primitive)? })
}

fn small(value: &Value) -> Option<u32> {
    unsigned(value).and_then(|n| u32::try_from(n).ok())
}

fn runs(numbers: &[u32], sources: usize, triangles: usize) -> Result<Vec<[u32; 3]>, String> {
    let (runs, []) = numbers.as_chunks::<3>() else { return Err("\"runs\" does not hold triples".to_owned()) };
    let mut total = 0_usize;
    for &[source, first, count] in runs {
        if source as usize >= sources || first.checked_add(count).is_none() {
            return Err(format!("the run ({source}, {first}, {count}) is out of range"));
        }
        total += count as usize;
    }
    match total == triangles {
        true => Ok(runs.to_vec()),
        false => Err(format!("the runs count {total} triangles, the primitive has {triangles}")),
    }
}
