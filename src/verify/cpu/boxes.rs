//! Trees of boxes, and their traversal by a ray.
//!
//! The slab test is conservative (it misses no box that the ray enters) because it moves the ray's origin apart for
//! near and far planes, as in S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013;
//! rays in the plane of a side are treated as in T. Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013.

use std::ops::{Add, ControlFlow, Div, Mul, Neg, Range, Sub};

use glam::DVec3;

use crate::scene::Bounds;
use crate::tree::{Node, Tree};

/// The number type that a ray is traced in: `f32` as on a device, `f64` for the truth.
pub(super) trait Real:
    Copy
    + PartialOrd
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + From<f32>
{
    /// Padding of boxes for rounding errors, in multiples of the largest coordinate in a slab test.
    const PAD: Self;

    /// Returns `ab - cd`, with the right sign even if the plain expression is exactly zero.
    fn difference_of_products(a: Self, b: Self, c: Self, d: Self) -> Self;
    /// Whether the sign bit is set, including that of a zero.
    fn is_negative(self) -> bool;
    /// Returns the nearest number of this type.
    fn nearest(x: f64) -> Self;
    /// Returns the same number in double precision.
    fn exact(self) -> f64;
}

impl Real for f32 {
    const PAD: f32 = 4.0 * f32::EPSILON;

    fn difference_of_products(a: f32, b: f32, c: f32, d: f32) -> f32 {
        let rounded = a * b - c * d;
        if rounded == 0.0 { (f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d)) as f32 } else { rounded }
    }

    fn is_negative(self) -> bool {
        self.is_sign_negative()
    }

    fn nearest(x: f64) -> f32 {
        x as f32
    }

    fn exact(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    const PAD: f64 = 64.0 * f64::EPSILON;

    fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
        a * b - c * d
    }

    fn is_negative(self) -> bool {
        self.is_sign_negative()
    }

    fn nearest(x: f64) -> f64 {
        x
    }

    fn exact(self) -> f64 {
        self
    }
}

/// Returns the larger of two numbers; the first if the second is NaN.
pub(super) fn larger<T: PartialOrd>(a: T, b: T) -> T {
    if b > a { b } else { a }
}

/// A node of a [`Tree`] with its box.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct BoxNode {
    pub(super) min: [f32; 3],
    /// Inner node: first of two adjacent children. Leaf: first item, in tree order.
    pub(super) first: u32,
    pub(super) max: [f32; 3],
    /// Number of items of a leaf; 0 for an inner node.
    pub(super) count: u32,
}

impl BoxNode {
    pub(super) fn items(&self) -> Range<usize> {
        self.first as usize..self.first as usize + self.count as usize
    }

    pub(super) fn bounds(&self) -> Bounds {
        let exact = |corner: [f32; 3]| DVec3::from(corner.map(f64::from));
        Bounds { min: exact(self.min), max: exact(self.max) }
    }
}

/// Returns the nodes of a tree with their boxes, which are rounded outward.
pub(super) fn boxed(tree: &Tree, bounds: &[Bounds]) -> Vec<BoxNode> {
    let boxed = |(node, bounds): (&Node, &Bounds)| BoxNode {
        min: bounds.min.to_array().map(round_down),
        first: node.first,
        max: bounds.max.to_array().map(|x| -round_down(-x)),
        count: node.count,
    };
    tree.nodes.iter().zip(bounds).map(boxed).collect()
}

/// Computes the boxes of nodes anew from the boxes of their items, rounded outward, and keeps the tree as it is.
pub(super) fn refit(nodes: &mut [BoxNode], of_items: impl Fn(Range<usize>) -> Bounds) {
    // Children come after their parent.
    for at in (0..nodes.len()).rev() {
        let node = nodes[at];
        let (min, max) = if node.count > 0 {
            let bounds = of_items(node.items());
            (bounds.min.to_array().map(round_down), bounds.max.to_array().map(|x| -round_down(-x)))
        } else {
            let [left, right] = [nodes[node.first as usize], nodes[node.first as usize + 1]];
            let least = std::array::from_fn(|i| left.min[i].min(right.min[i]));
            (least, std::array::from_fn(|i| left.max[i].max(right.max[i])))
        };
        (nodes[at].min, nodes[at].max) = (min, max);
    }
}

/// Returns the largest `f32` not above a number.
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

/// A ray prepared for the slab test.
pub(super) struct BoxRay<T> {
    /// Origin, moved so that the near planes come nearer.
    near_origin: [T; 3],
    /// Origin, moved so that the far planes move away.
    far_origin: [T; 3],
    inverse: [T; 3],
    negative: [bool; 3],
}

impl<T: Real> BoxRay<T> {
    /// Prepares a ray for which all boxes count as larger by `pad` on each side.
    pub(super) fn new(origin: [T; 3], direction: [T; 3], pad: T) -> Self {
        let negative = direction.map(T::is_negative);
        let moved = |by: T| std::array::from_fn(|i| origin[i] + if negative[i] { -by } else { by });
        BoxRay {
            near_origin: moved(pad),
            far_origin: moved(-pad),
            inverse: direction.map(|d| T::from(1.0) / d),
            negative,
        }
    }

    /// Returns the distance at which the ray enters the box, at least `t_min`; `None` if it misses the box, leaves it
    /// before `t_min`, or enters it after `t_max`. NaN, from a ray in the plane of a side, sets no bound.
    fn enter(&self, node: &BoxNode, t_min: T, t_max: T) -> Option<T> {
        let (mut enter, mut leave) = (t_min, t_max);
        for i in 0..3 {
            let (near, far) = if self.negative[i] { (node.max[i], node.min[i]) } else { (node.min[i], node.max[i]) };
            enter = larger(enter, (T::from(near) - self.near_origin[i]) * self.inverse[i]);
            let out = (T::from(far) - self.far_origin[i]) * self.inverse[i];
            leave = if out < leave { out } else { leave };
        }
        (enter <= leave).then_some(enter)
    }
}

/// Nodes to be visited later, and the distances at which the ray enters them.
pub(super) type Stack<T> = Vec<(u32, T)>;

/// Visits the leaves a ray enters within a range of distances, near ones first. `visit` takes the items of a leaf and
/// returns the new end of the range, or stops the traversal. The stack is reused between rays. Adds the number of inner nodes
/// passed to `passed`.
pub(super) fn traverse<T: Real>(
    nodes: &[BoxNode],
    ray: &BoxRay<T>,
    [t_min, mut t_max]: [T; 2],
    stack: &mut Stack<T>,
    passed: &mut u32,
    mut visit: impl FnMut(Range<usize>) -> ControlFlow<(), T>,
) -> ControlFlow<()> {
    stack.clear();
    if let Some(enter) = nodes.first().and_then(|root| ray.enter(root, t_min, t_max)) {
        stack.push((0, enter));
    }
    while let Some((at, enter)) = stack.pop() {
        if enter > t_max {
            continue;
        }
        let mut node = &nodes[at as usize];
        while node.count == 0 {
            *passed += 1;
            let (left, right) = (node.first, node.first + 1);
            let enter_left = ray.enter(&nodes[left as usize], t_min, t_max);
            let enter_right = ray.enter(&nodes[right as usize], t_min, t_max);
            let next = match (enter_left, enter_right) {
                (Some(l), Some(r)) if l <= r => {
                    stack.push((right, r));
                    left
                }
                (Some(l), Some(_)) => {
                    stack.push((left, l));
                    right
                }
                (Some(_), None) => left,
                (None, Some(_)) => right,
                (None, None) => break,
            };
            node = &nodes[next as usize];
        }
        if node.count > 0 {
            t_max = visit(node.items())?;
        }
    }
    ControlFlow::Continue(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: BoxNode = BoxNode { min: [0.0; 3], first: 0, max: [1.0; 3], count: 1 };

    fn enters(origin: [f32; 3], direction: [f32; 3]) -> bool {
        BoxRay::new(origin, direction, 0.0).enter(&UNIT, 0.0, f32::MAX).is_some()
    }

    #[test]
    fn rays_in_the_plane_of_a_side_enter() {
        for zero in [0.0, -0.0] {
            for side in [0.0, 1.0] {
                assert!(enters([-1.0, side, 0.5], [1.0, zero, zero]));
                assert!(enters([2.0, side, side], [-1.0, zero, zero]));
            }
            assert!(!enters([-1.0, 1.1, 0.5], [1.0, zero, zero]));
            assert!(!enters([-1.0, -0.1, 0.5], [1.0, zero, zero]));
        }
    }

    #[test]
    fn boxes_behind_the_origin_are_not_entered() {
        assert!(!enters([2.0, 0.5, 0.5], [1.0, 0.0, 0.0]));
        assert!(enters([0.5, 0.5, 0.5], [1.0, 0.0, 0.0]));
    }

    #[test]
    fn padding_widens_boxes() {
        let ray = BoxRay::new([-1.0f32, 1.01, 0.5], [1.0, 0.0, 0.0], 0.02);
        assert!(ray.enter(&UNIT, 0.0, f32::MAX).is_some());
    }

    #[test]
    fn rounding_is_outward() {
        let bounds = [Bounds { min: DVec3::splat(0.1), max: DVec3::splat(0.7) }];
        let tree = Tree::build(&bounds, crate::tree::Quality::Medium);
        let nodes = boxed(&tree, &bounds);
        assert!(f64::from(nodes[0].min[0]) <= 0.1 && f64::from(nodes[0].max[0]) >= 0.7);
        assert!(round_down(1e300) == f32::MAX && round_down(-1e300) == f32::NEG_INFINITY);
    }
}
