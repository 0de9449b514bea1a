//! Primitives: triangles in their own coordinates.

use super::accessor::Accessor;
use super::attributes::attribute_accessors;
use super::json::At;
use super::merge_key::merge_key;
use super::positions::Positions;
use super::references;
use crate::contents::{Mesh, Primitive, Triangles};
use crate::document::{Component, Document};
use crate::{Error, ReadOptions, Warning};

const TRIANGLES: usize = 4;
const TRIANGLE_STRIP: usize = 5;
const TRIANGLE_FAN: usize = 6;

/// Reads a mesh, and warns of what was left out.
pub(super) fn mesh(
    doc: &Document,
    at: &At<'_>,
    read: &Positions,
    options: ReadOptions,
) -> Result<(Mesh, Vec<Warning>), Error> {
    let mut warnings = Vec::new();
    let mut primitives = Vec::new();
    for primitive_at in at.list("primitives")? {
        primitives.push(primitive(doc, &primitive_at, read, options, &mut warnings)?);
    }
    Ok((Mesh { name: at.name(), primitives, hold: None }, warnings))
}

fn primitive(
    doc: &Document,
    at: &At<'_>,
    read: &Positions,
    options: ReadOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Primitive, Error> {
    let attributes = attribute_accessors(doc, at)?;
    let material = at.index("material", "materials", At::root(doc).count("materials"))?;
    let morphed = check_targets(doc, at, attributes.first().map_or(0, |(_, a)| a.count))?;
    let triangles = triangles(doc, at, &attributes, read, warnings)?;
    let triangles = triangles.map(|t| keep_finite(at, t, &attributes, options, warnings)).transpose()?;
    let in_mesh_units = references::in_mesh_units(doc, at.value);
    Ok(Primitive { material, triangles, morphed, in_mesh_units, merge_key: merge_key(at, &attributes) })
}

/// Checks the morph targets; returns whether there are any.
fn check_targets(doc: &Document, at: &At<'_>, vertices: usize) -> Result<bool, Error> {
    let targets = at.list("targets")?;
    for target in targets.clone() {
        for (_, index) in target.entries()? {
            let count = Accessor::referred(doc, &index)?.count;
            if count != vertices {
                return Err(index.error(format_args!("{count} vertices, but the primitive has {vertices}")));
            }
        }
    }
    Ok(targets.len() > 0)
}

/// Returns all triangles as stored, with strips and fans unrolled; `None` if the mode has none.
fn triangles(
    doc: &Document,
    at: &At<'_>,
    attributes: &[(&str, Accessor<'_>)],
    read: &Positions,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Triangles>, Error> {
    let mode = at.get("mode").map_or(Ok(TRIANGLES), |mode| mode.integer())?;
    let indices = at.get("indices").map(|index| indices(doc, &index)).transpose()?;
    if mode > TRIANGLE_FAN {
        return Err(at.error_at("mode", format_args!("there is no mode {mode}")));
    }
    let Some((_, position)) = attributes.iter().find(|(name, _)| *name == "POSITION") else {
        if mode >= TRIANGLES {
            warnings.push(at.warning("has no POSITION attribute, so there is nothing to trace"));
        }
        return Ok(None);
    };
    check_position(position)?;
    if let Some((accessor, indices)) = &indices {
        check_indices(accessor, indices, position.count)?;
    }
    if mode < TRIANGLES {
        return Ok(None);
    }
    let count = indices.as_ref().map_or(position.count, |(_, indices)| indices.len());
    if mode == TRIANGLES && count % 3 != 0 {
        warnings.push(at.warning(format_args!("{count} corners do not make whole triangles; the rest is ignored")));
    }
    let corners = match &indices {
        Some((_, indices)) => corners(mode, count, |i| indices[i]),
        None => corners(mode, count, |i| i as u32),
    };
    let number = position_accessor(at);
    let residuals = number.and_then(|accessor| doc.residuals.get(accessor)).cloned();
    Ok(Some(Triangles { positions: read.of(number, position), residuals, corners, kept: None }))
}

fn position_accessor(primitive: &At<'_>) -> Option<usize> {
    primitive.get("attributes")?.get("POSITION")?.integer().ok()
}

fn indices<'d>(doc: &'d Document, index: &At<'d>) -> Result<(Accessor<'d>, Vec<u32>), Error> {
    let accessor = Accessor::referred(doc, index)?;
    match accessor.scalars() {
        Some(indices) => Ok((accessor, indices)),
        None => Err(accessor.at.error("indices must be SCALAR and of an unsigned integer type")),
    }
}

fn check_position(position: &Accessor<'_>) -> Result<(), Error> {
    if position.kind != "VEC3" || position.element.component == Component::U32 {
        return Err(position.at.error("positions must be VEC3 of floats or of 8-bit or 16-bit integers"));
    }
    match u32::try_from(position.count) {
        Ok(_) => Ok(()),
        Err(_) => Err(position.at.error("more than 2^32 vertices")),
    }
}

/// Rejects indices past the vertices, and the largest index of their type, which means "restart" to a GPU.
fn check_indices(accessor: &Accessor<'_>, indices: &[u32], vertices: usize) -> Result<(), Error> {
    let Some(&largest) = indices.iter().max() else { return Ok(()) };
    if largest as usize >= vertices {
        return Err(accessor.at.error(format_args!("index {largest} is past the {vertices} vertices")));
    }
    let restart = match accessor.element.component {
        Component::U8 => u32::from(u8::MAX),
        Component::U16 => u32::from(u16::MAX),
        _ => u32::MAX,
    };
    if largest == restart {
        return Err(accessor.at.error(format_args!("index {largest} means primitive restart, which glTF forbids")));
    }
    Ok(())
}

/// Returns the vertices of each triangle in the order of section 3.7.2.1 of the glTF 2.0 specification.
fn corners(mode: usize, count: usize, vertex: impl Fn(usize) -> u32) -> Vec<[u32; 3]> {
    let strung = count.saturating_sub(2);
    match mode {
        TRIANGLE_STRIP => (0..strung).map(|i| [i, i + (1 + i % 2), i + (2 - i % 2)].map(&vertex)).collect(),
        TRIANGLE_FAN => (0..strung).map(|i| [i + 1, i + 2, 0].map(&vertex)).collect(),
        _ => (0..count / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2].map(&vertex)).collect(),
    }
}

/// Drops triangles with a corner that is not finite.
fn keep_finite(
    at: &At<'_>,
    mut triangles: Triangles,
    attributes: &[(&str, Accessor<'_>)],
    options: ReadOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Triangles, Error> {
    let finite = |p: &[f32; 3]| p.iter().all(|x| x.is_finite());
    if triangles.positions.iter().all(finite) {
        return Ok(triangles);
    }
    let positions = &triangles.positions;
    let whole = |corners: &[u32; 3]| corners.iter().all(|&v| finite(&positions[v as usize]));
    let kept: Vec<u32> = (0..).zip(&triangles.corners).filter(|(_, c)| whole(c)).map(|(i, _)| i).collect();
    let dropped = triangles.corners.len() - kept.len();
    if dropped == 0 {
        return Ok(triangles);
    }
    if options.strict {
        let position = attributes.iter().find(|(name, _)| *name == "POSITION").map_or(*at, |(_, a)| a.at);
        return Err(position.error(format_args!("{dropped} triangles of {at} have a corner that is not finite")));
    }
    warnings.push(at.warning(format_args!("{dropped} triangles with a corner that is not finite are left out")));
    triangles.corners = kept.iter().map(|&i| triangles.corners[i as usize]).collect();
    triangles.kept = Some(kept);
    Ok(triangles)
}
