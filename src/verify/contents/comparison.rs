//! [`Comparison`]: compares one attribute of two vertices.

use std::borrow::Cow;

use glam::{DAffine2, DMat3, DVec2, DVec3};
use raykiln_formats::document::Attribute;

use super::super::Sides;
use super::DifferenceKind;

/// A vertex of each file.
pub(super) type Vertices = Sides<u32>;

/// How one attribute of the vertices of two objects is compared.
pub(super) struct Comparison<'a> {
    /// What differs if they do.
    pub(super) kind: DifferenceKind,
    /// The attribute's semantic.
    pub(super) name: String,
    /// The largest deviation allowed.
    pub(super) allowed: f64,
    pub(super) how: How<'a>,
}

/// The values of an attribute: those of the file, or one for all vertices.
#[derive(Clone, Copy)]
pub(super) enum Values<'a> {
    Of(&'a Attribute<'a>),
    All([f64; 4]),
}

/// How a vector of a mesh becomes one of the world.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Turn {
    pub(super) matrix: DMat3,
    /// -1 if the handedness of tangents changes.
    pub(super) side: f64,
}

/// How deviations are measured.
pub(super) enum How<'a> {
    /// The attribute is missing in one file.
    Missing,
    /// The largest difference of a component, over the larger value if that exceeds 1 and `is_relative`.
    Numbers { values: Sides<Values<'a>>, is_relative: bool },
    /// As `Numbers`, of texture coordinates after their transforms.
    Texcoords { values: Sides<Values<'a>>, transforms: Sides<DAffine2> },
    /// The angle between directions; a half turn if the handedness differs.
    Directions { values: Sides<Values<'a>>, turns: Sides<Turn>, is_tangent: bool },
    /// The angle between directions displaced by a morph target.
    Displaced { base: Sides<Values<'a>>, values: Sides<Values<'a>>, turns: Sides<Turn> },
    /// The distance between displacements.
    Displacements { values: Sides<Values<'a>>, turns: Sides<Turn> },
    /// The largest difference of the weight of a joint.
    Weights(Box<Sides<Influences<'a>>>),
}

/// The joints that move a vertex.
#[derive(Clone)]
pub(super) struct Influences<'a> {
    /// Joints and weights, four each.
    pub(super) sets: Vec<(&'a Attribute<'a>, &'a Attribute<'a>)>,
    /// What each joint is, the same numbers for the same joints of both files.
    pub(super) joints: Cow<'a, [u32]>,
}

impl Values<'_> {
    fn get(&self, vertex: u32) -> [f64; 4] {
        match self {
            Values::Of(attribute) => attribute.numbers(vertex),
            Values::All(value) => *value,
        }
    }
}

/// Whether both values are stored alike, bit for bit.
fn are_stored_alike(values: &Sides<Values<'_>>, at: Vertices) -> bool {
    match values {
        Sides { before: Values::Of(b), after: Values::Of(a) } => {
            b.element == a.element && b.bytes(at.before) == a.bytes(at.after)
        }
        _ => false,
    }
}

fn both(values: &Sides<Values<'_>>, at: Vertices) -> Sides<[f64; 4]> {
    Sides { before: values.before.get(at.before), after: values.after.get(at.after) }
}

impl Comparison<'_> {
    /// Returns how far the attribute of the output is off; infinite if it is not comparable.
    pub(super) fn deviation(&self, at: Vertices) -> f64 {
        match &self.how {
            How::Missing => f64::INFINITY,
            How::Numbers { values, is_relative } => {
                if are_stored_alike(values, at) {
                    0.0
                } else {
                    off(both(values, at), *is_relative)
                }
            }
            How::Texcoords { values, transforms } => {
                if are_stored_alike(values, at) && transforms.before == transforms.after {
                    return 0.0;
                }
                let moved = both(values, at).zip(*transforms).map(|([u, v, ..], transform)| {
                    let DVec2 { x, y } = transform.transform_point2(DVec2::new(u, v));
                    [x, y, 0.0, 0.0]
                });
                off(moved, true)
            }
            How::Directions { values, turns, is_tangent } => {
                if are_stored_alike(values, at) && turns.before == turns.after {
                    return 0.0;
                }
                directions(both(values, at), turns, *is_tangent)
            }
            How::Displaced { base, values, turns } => {
                if [base, values].iter().all(|values| are_stored_alike(values, at)) && turns.before == turns.after {
                    return 0.0;
                }
                let sum =
                    both(base, at).zip(both(values, at)).map(|(b, d)| [b[0] + d[0], b[1] + d[1], b[2] + d[2], 1.0]);
                directions(sum, turns, false)
            }
            How::Displacements { values, turns } => {
                if are_stored_alike(values, at) && turns.before == turns.after {
                    return 0.0;
                }
                let moved = both(values, at).zip(*turns).map(|(v, turn)| turn.matrix * vector(v));
                known(moved.before.distance(moved.after))
            }
            How::Weights(influences) => weights(influences, at),
        }
    }
}

fn vector([x, y, z, _]: [f64; 4]) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A deviation that is not a number is not comparable.
fn known(deviation: f64) -> f64 {
    if deviation.is_nan() { f64::INFINITY } else { deviation }
}

/// Returns the largest difference of a component; numbers that are not are equal to each other.
fn off(values: Sides<[f64; 4]>, is_relative: bool) -> f64 {
    let component = |(b, a): (f64, f64)| {
        let scale = if is_relative { b.abs().max(a.abs()).max(1.0) } else { 1.0 };
        match b == a || b.is_nan() && a.is_nan() {
            true => 0.0,
            false => known((b - a).abs() / scale),
        }
    };
    values.before.into_iter().zip(values.after).map(component).fold(0.0, f64::max)
}

/// Returns the angle between two directions in the world in radians; 0 if both are zero.
fn directions(values: Sides<[f64; 4]>, turns: &Sides<Turn>, is_tangent: bool) -> f64 {
    let world = values.zip(*turns).map(|(value, turn)| unit(turn.matrix * vector(value)));
    let hand = values.zip(*turns).map(|(value, turn)| value[3] * turn.side > 0.0);
    if is_tangent && hand.before != hand.after {
        return std::f64::consts::PI;
    }
    match (world.before, world.after) {
        (Some(b), Some(a)) => b.cross(a).length().atan2(b.dot(a)),
        (None, None) => 0.0,
        _ => f64::INFINITY,
    }
}

/// Returns the unit vector of a direction of any length; `None` for zero and what is not finite.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (largest > 0.0 && v.is_finite()).then(|| (v / largest).normalize())
}

/// Returns the largest difference of the weight of a joint.
fn weights(influences: &Sides<Influences<'_>>, at: Vertices) -> f64 {
    let [before, after] =
        [(&influences.before, at.before), (&influences.after, at.after)].map(|(of, vertex)| of.at(vertex));
    let weight =
        |list: &[(u32, f64)], joint: u32| list.iter().filter(|(j, _)| *j == joint).map(|(_, w)| w).sum::<f64>();
    let joints = before.iter().chain(&after).map(|(joint, _)| *joint);
    joints.map(|joint| known((weight(&before, joint) - weight(&after, joint)).abs())).fold(0.0, f64::max)
}

impl Influences<'_> {
    /// Returns the joints of a vertex with their weights, without those of no weight.
    fn at(&self, vertex: u32) -> Vec<(u32, f64)> {
        let of_set = |(joints, weights): &(&Attribute<'_>, &Attribute<'_>)| {
            let both = joints.numbers(vertex).into_iter().zip(weights.numbers(vertex)).take(weights.element.components);
            both.filter(|(_, weight)| *weight != 0.0).collect::<Vec<_>>()
        };
        let identity = |joint: f64| self.joints.get(joint as usize).copied().unwrap_or(u32::MAX);
        self.sets.iter().flat_map(of_set).map(|(joint, weight)| (identity(joint), weight)).collect()
    }
}
