//! Reads points and lines.

use std::collections::HashMap;
use std::sync::Arc;

use super::super::accessor::Accessor;
use super::super::json::{At, unsigned};
use crate::Document;
use crate::properties::Strokes;

const POINTS: usize = 0;
const LINE_LOOP: usize = 2;
const LINE_STRIP: usize = 3;
const TRIANGLES: usize = 4;

/// Positions of accessors, each read once.
type Positions = HashMap<usize, Arc<[[f64; 3]]>>;

pub(crate) fn strokes(doc: &Document) -> Vec<Vec<Strokes>> {
    let mut positions = Positions::new();
    let of_mesh = |mesh: At<'_>| {
        let all = mesh.list("primitives").into_iter().flatten().enumerate();
        all.filter_map(|(primitive, at)| read(doc, primitive, &at, &mut positions)).collect()
    };
    At::root(doc).list("meshes").into_iter().flatten().map(of_mesh).collect()
}

fn read(doc: &Document, primitive: usize, at: &At<'_>, known: &mut Positions) -> Option<Strokes> {
    let number = |key| at.get(key).and_then(|value| unsigned(value.value));
    let mode = number("mode").filter(|mode| *mode < TRIANGLES)?;
    let accessor = unsigned(at.get("attributes")?.get("POSITION")?.value)?;
    let read = || Accessor::read(doc, accessor).map(|a| a.vectors_f64::<3>()).unwrap_or_default().into();
    let positions = known.entry(accessor).or_insert_with(read).clone();
    let vertices = match at.get("indices") {
        Some(index) => Accessor::referred(doc, &index).ok()?.scalars()?,
        None => (0..positions.len() as u32).collect(),
    };
    let corners = if mode == POINTS { 1 } else { 2 };
    Some(Strokes { primitive, material: number("material"), corners, vertices: unrolled(mode, vertices), positions })
}

/// Returns the two ends of each line; points stay as they are.
fn unrolled(mode: usize, vertices: Vec<u32>) -> Vec<u32> {
    let mut lines: Vec<u32> = match mode {
        LINE_LOOP | LINE_STRIP => vertices.windows(2).flatten().copied().collect(),
        POINTS => return vertices,
        _ => return vertices[..vertices.len() / 2 * 2].to_vec(),
    };
    if let (LINE_LOOP, [first, .., last]) = (mode, &vertices[..]) {
        lines.extend([*last, *first]);
    }
    lines
}
