//! The search for a ray's hit through both levels, in either precision.

use std::ops::ControlFlow;

use glam::Vec3;

use super::boxes::{BoxRay, Real, Stack, traverse};
use super::two_level::{Entry, TwoLevel};
use super::watertight::TriangleTest;

/// The stacks of both levels, reused between rays, and the steps of the last ray.
pub(super) struct Stacks<T> {
    top: Stack<T>,
    bottom: Stack<T>,
    pub(super) steps: Steps,
}

/// Traversal steps of a ray through both levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Steps {
    /// Number of inner nodes of the top tree.
    pub top: u32,
    /// Number of instances entered.
    pub entries: u32,
    /// Number of inner nodes of bottom trees.
    pub bottom: u32,
    /// Number of triangles tested.
    pub tests: u32,
}

impl Steps {
    /// Returns the total number of steps from node to node and into instances.
    pub fn total(&self) -> u64 {
        u64::from(self.top) + u64::from(self.entries) + u64::from(self.bottom)
    }
}

impl<T> Stacks<T> {
    pub(super) fn new(accel: &TwoLevel) -> Self {
        let [top, bottom] = accel.depth.map(Vec::with_capacity);
        Stacks { top, bottom, steps: Steps::default() }
    }
}

/// The range of the search: hits between `t_min` and `t_max`, excluding both.
#[derive(Clone, Copy)]
pub(super) struct Interval<T> {
    pub(super) t_min: T,
    pub(super) t_max: T,
    /// Whether to stop at the first hit found.
    pub(super) any: bool,
}

/// A hit, in scaled units.
#[derive(Clone, Copy)]
pub(super) struct Found<T> {
    pub(super) t: T,
    /// Index into the entries.
    pub(super) entry: usize,
    /// Index of the triangle in the mesh.
    pub(super) triangle: u32,
    /// Whether the front is hit, in the coordinates of the triangle test.
    pub(super) front: bool,
}

/// The ray in the coordinates of an instance: for the boxes, and for the triangles.
pub(super) struct Inside<T, X> {
    /// Distance by which the origin is moved along the ray; distances inside count from there.
    pub(super) start: T,
    pub(super) boxes: BoxRay<T>,
    pub(super) triangles: X,
}

/// Finds the nearest hit of a ray, or any. Of hits at the same distance, the one with the lowest instance and triangle
/// wins, so that the result does not depend on the shape of the trees. `enter` transforms the ray into an entry,
/// `corners` returns a triangle of an entry in the coordinates of [`Inside::triangles`], `counts` accepts hits.
pub(super) fn search<T: Real, X: TriangleTest<T>>(
    accel: &TwoLevel,
    ray: &BoxRay<T>,
    within: Interval<T>,
    stacks: &mut Stacks<T>,
    enter: impl Fn(usize, &Entry) -> Option<Inside<T, X>>,
    corners: impl Fn(&Entry, &[Vec3; 3]) -> [[T; 3]; 3],
    mut counts: impl FnMut(&Found<T>) -> bool,
) -> Option<Found<T>> {
    let mut best: Option<Found<T>> = None;
    let Stacks { top, bottom, steps } = stacks;
    *steps = Steps::default();
    let Steps { top: steps_top, entries, bottom: steps_bottom, tests } = steps;
    let _ = traverse(&accel.top, ray, [within.t_min, within.t_max], top, steps_top, |items| {
        for at in items {
            let entry = &accel.entries[at];
            let mesh = &accel.bottom[entry.mesh as usize];
            let Some(inside) = enter(at, entry) else { continue };
            *entries += 1;
            let (start, limit) = (inside.start, best.map_or(within.t_max, |b| b.t));
            let range = [within.t_min - start, limit - start];
            traverse(&mesh.nodes, &inside.boxes, range, bottom, steps_bottom, |items| {
                for i in items {
                    *tests += 1;
                    let Some(crossing) = inside.triangles.cross(corners(entry, &mesh.corners[i])) else { continue };
                    let found =
                        Found { t: start + crossing.t, entry: at, triangle: mesh.order[i], front: crossing.front };
                    let is_nearer = within.contains(found.t) && best.is_none_or(|b| found.is_before(&b, accel));
                    if is_nearer && counts(&found) {
                        best = Some(found);
                        if within.any {
                            return ControlFlow::Break(());
                        }
                    }
                }
                ControlFlow::Continue(best.map_or(within.t_max, |b| b.t) - start)
            })?;
        }
        ControlFlow::Continue(best.map_or(within.t_max, |b| b.t))
    });
    best
}

impl<T: Real> Interval<T> {
    fn contains(&self, t: T) -> bool {
        t > self.t_min && t < self.t_max
    }
}

impl<T: Real> Found<T> {
    fn is_before(&self, other: &Found<T>, accel: &TwoLevel) -> bool {
        let key = |f: &Found<T>| (accel.entries[f.entry].instance, f.triangle);
        self.t < other.t || self.t == other.t && key(self) < key(other)
    }
}
