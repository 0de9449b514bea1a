//! The overlap ratio.

use crate::scene::Bounds;

/// Two boxes that overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Index of the first box.
    pub a: u32,
    /// Index of the second box, above `a`.
    pub b: u32,
    /// Surface area of the intersection.
    pub area: f64,
}

/// All pairs of boxes whose intersection has a surface area above `min_area`, ordered by `a`, then `b`.
pub fn pairs(_boxes: &[Bounds], _min_area: f64) -> Vec<Pair> {
    todo!()
}

/// Sum of the surface areas of the intersections of all pairs of boxes over the surface area of the box around all.
pub fn ratio(_boxes: &[Bounds]) -> f64 {
    todo!()
}
