//! Reads points and lines.

use super::super::accessor::Accessor;
use super::super::json::{At, unsigned};
use super::element;
use crate::Document;
use crate::properties::Strokes;

const POINTS: usize = 0;
const LINE_LOOP: usize = 2;
const LINE_STRIP: usize = 3;
const TRIANGLES: usize = 4;

pub(crate) fn strokes(doc: &Document, mesh: usize) -> Vec<Strokes> {
    let list = element(doc, "meshes", mesh).and_then(|mesh| mesh.get("primitives"));
    let all = list.and_then(|list| list.elements().ok()).into_iter().flatten().enumerate();
    all.filter_map(|(primitive, at)| read(doc, primitive, &at)).collect()
}

fn read(doc: &Document, primitive: usize, at: &At<'_>) -> Option<Strokes> {
    let number = |key| at.get(key).and_then(|value| unsigned(value.value));
    let mode = number("mode").filter(|mode| *mode < TRIANGLES)?;
    let positions = Accessor::referred(doc, &at.get("attributes")?.get("POSITION")?).ok()?.vectors_f64::<3>();
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
