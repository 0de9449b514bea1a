//! Reads what an earlier bake recorded in `extras.raykiln` of primitives and nodes.

use std::collections::HashMap;
use std::sync::Arc;

use serde_json::Value;

use super::attributes::scalars;
use super::json::{At, unsigned};
use crate::contents::{CopyOf, NodeSource, Provenance, Source, TriangleOrder};
use crate::{Document, Warning};

/// Returns the provenance of a primitive with `triangles` triangles in the file.
///
/// # Errors
/// Describes why a record cannot be used.
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
    let numbers = scalars(doc, accessor).ok_or("\"runs\" is not a sound accessor of unsigned integers")?;
    let runs = runs(&numbers, sources.len(), triangles)?;
    Ok(Some(Provenance::Runs { sources, runs }))
}

/// Reads the sources of nodes. Nodes that refer to the same accessor share its contents.
pub(super) struct NodeSources<'d> {
    doc: &'d Document,
    orders: HashMap<usize, Option<Arc<TriangleOrder>>>,
}

impl<'d> NodeSources<'d> {
    pub(super) fn new(doc: &'d Document) -> Self {
        NodeSources { doc, orders: HashMap::new() }
    }

    /// Returns the source of a node; an unusable record of a copy is reported and left out.
    pub(super) fn of(&mut self, node: &At<'_>, warnings: &mut Vec<Warning>) -> Option<NodeSource> {
        let source = node.get("extras")?.get("raykiln")?.get("source")?;
        let number = small(source.get("node")?.value)?;
        let copy_of = self.copy_of(&source).unwrap_or_else(|cause| {
            warnings.push(node.warning(format_args!("the record of an earlier bake is ignored: {cause}")));
            None
        });
        Some(NodeSource { node: number, copy_of })
    }

    /// Returns the source of each copy of a node; empty if it is not recorded, or if the record cannot be used, which
    /// is reported.
    pub(super) fn of_copies(&mut self, node: &At<'_>, copies: usize, warnings: &mut Vec<Warning>) -> Vec<NodeSource> {
        let record = node.get("extras").and_then(|e| e.get("raykiln")).and_then(|r| r.get("source"));
        let Some((source, nodes)) = record.and_then(|s| Some((s, s.get("nodes")?))) else { return Vec::new() };
        self.read_copies(&source, &nodes, copies).unwrap_or_else(|cause| {
            warnings.push(node.warning(format_args!("the record of an earlier bake is ignored: {cause}")));
            Vec::new()
        })
    }

    fn read_copies(&mut self, source: &At<'_>, nodes: &At<'_>, copies: usize) -> Result<Vec<NodeSource>, &'static str> {
        let doc = self.doc;
        let numbers = |at: &At<'_>| {
            let numbers = unsigned(at.value).and_then(|accessor| scalars(doc, accessor));
            numbers.filter(|n| n.len() == copies).ok_or("it does not hold a number for every copy")
        };
        let nodes = numbers(nodes)?;
        let Some(meshes) = source.get("meshes") else {
            return Ok(nodes.into_iter().map(|node| NodeSource { node, copy_of: None }).collect());
        };
        let order = self.order(source)?;
        let copy_of = |mesh| Some(CopyOf { mesh, order: order.clone() });
        let both = nodes.into_iter().zip(numbers(&meshes)?);
        Ok(both.map(|(node, mesh)| NodeSource { node, copy_of: copy_of(mesh) }).collect())
    }

    fn copy_of(&mut self, source: &At<'_>) -> Result<Option<CopyOf>, &'static str> {
        let Some(mesh) = source.get("mesh") else { return Ok(None) };
        let mesh = small(mesh.value).ok_or("\"mesh\" is malformed")?;
        Ok(Some(CopyOf { mesh, order: self.order(source)? }))
    }

    /// Returns the order that `runs` of a source refers to; `None` if there is no such property.
    fn order(&mut self, source: &At<'_>) -> Result<Option<Arc<TriangleOrder>>, &'static str> {
        let Some(runs) = source.get("runs") else { return Ok(None) };
        let accessor = unsigned(runs.value).ok_or("\"runs\" is malformed")?;
        let doc = self.doc;
        let order = self.orders.entry(accessor).or_insert_with(|| order(doc, accessor).map(Arc::new)).clone();
        order.map(Some).ok_or("\"runs\" is not a sound accessor of pairs of unsigned integers")
    }
}

fn order(doc: &Document, accessor: usize) -> Option<TriangleOrder> {
    let numbers = scalars(doc, accessor)?;
    let (runs, []) = numbers.as_chunks::<2>() else { return None };
    TriangleOrder::new(runs.to_vec())
}

fn same(source: &At<'_>) -> Option<Provenance> {
    let number = |key| source.value.get(key).and_then(small);
    Some(Provenance::Same { mesh: number("mesh")?, primitive: number("primitive")? })
}

/// Parses `[node, copy, mesh, primitive]`; the node may be null.
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
