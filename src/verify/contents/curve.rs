//! Whether two animations of one target move it alike, though their keys differ: tools set keys anew.

use raykiln_formats::properties::Channel;

/// How far values of two curves may be off.
#[derive(Clone, Copy)]
pub(super) struct Allowed {
    /// Of translations.
    pub(super) distance: f64,
    /// Of rotations, in radians.
    pub(super) angle: f64,
    /// Of weights of morph targets, and of scales over their size.
    pub(super) weight: f64,
}

/// Times at which two curves are compared, at most.
const MOST_TIMES: usize = 1 << 14;

/// Whether two curves of one path have the same values at all keys of both, and in the middle between each two.
/// Splines are not compared.
pub(super) fn are_same(before: &Channel, after: &Channel, allowed: Allowed) -> bool {
    let mut times: Vec<f64> = before.times.iter().chain(after.times.iter()).copied().collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let middles: Vec<f64> = times.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let are_few = times.len() <= MOST_TIMES && !times.is_empty();
    let is_spline = [before, after].iter().any(|channel| channel.interpolation == SPLINE);
    are_few
        && !is_spline
        && times.into_iter().chain(middles).all(|time| match (value(before, time), value(after, time)) {
            (Some(b), Some(a)) => b.len() == a.len() && are_near(&before.path, &b, &a, allowed),
            _ => false,
        })
}

fn are_near(path: &str, before: &[f64], after: &[f64], allowed: Allowed) -> bool {
    let distance = |sign: f64| before.iter().zip(after).map(|(b, a)| (b - sign * a).powi(2)).sum::<f64>().sqrt();
    match path {
        "translation" => distance(1.0) <= allowed.distance,
        // A quaternion and its negative are one rotation; a small angle is twice their distance.
        "rotation" => 2.0 * distance(1.0).min(distance(-1.0)) <= allowed.angle,
        _ => {
            let size = before.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
            distance(1.0) <= allowed.weight * size
        }
    }
}

/// Interpolation by cubic splines.
const SPLINE: &str = "CUBICSPLINE";

/// Returns the value of a curve at a time, which is that of the first or last key outside of its keys; `None` if its keys
/// are malformed.
pub(crate) fn value(channel: &Channel, time: f64) -> Option<Vec<f64>> {
    let (times, values) = (&channel.times, &channel.values);
    let size = values.len().checked_div(times.len()).filter(|size| *size > 0)?;
    let key = |i: usize| values.get(i * size..(i + 1) * size);
    let next = times.partition_point(|t| *t <= time);
    let (first, second) = (next.saturating_sub(1), next.min(times.len() - 1));
    let share = (time - times[first]) / (times[second] - times[first]);
    match channel.interpolation.as_str() {
        SPLINE if first == second => Some(key(first)?.get(size / 3..size / 3 * 2)?.to_vec()),
        SPLINE => Some(splined([key(first)?, key(second)?], times[second] - times[first], share)),
        "STEP" => Some(key(first)?.to_vec()),
        "LINEAR" if first == second => Some(key(first)?.to_vec()),
        "LINEAR" => {
            let (from, to) = (key(first)?, key(second)?);
            Some(if channel.path == "rotation" {
                turned(from, to, share)
            } else {
                mixed(from, to, [1.0 - share, share])
            })
        }
        _ => None,
    }
}

/// Interpolates between two keys, each of which holds in-tangents, values and out-tangents (glTF 2.0, appendix C.5).
fn splined([from, to]: [&[f64]; 2], duration: f64, t: f64) -> Vec<f64> {
    let n = from.len() / 3;
    let (t2, t3) = (t * t, t * t * t);
    let weights =
        [2.0 * t3 - 3.0 * t2 + 1.0, duration * (t3 - 2.0 * t2 + t), 3.0 * t2 - 2.0 * t3, duration * (t3 - t2)];
    let one = |i: usize| {
        weights[0] * from[n + i] + weights[1] * from[2 * n + i] + weights[2] * to[n + i] + weights[3] * to[i]
    };
    (0..n).map(one).collect()
}

fn mixed(from: &[f64], to: &[f64], shares: [f64; 2]) -> Vec<f64> {
    from.iter().zip(to).map(|(f, t)| shares[0] * f + shares[1] * t).collect()
}

/// Interpolates between quaternions on the shorter arc (glTF 2.0, appendix C.4).
fn turned(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    let dot: f64 = from.iter().zip(to).map(|(f, t)| f * t).sum();
    let angle = dot.abs().min(1.0).acos();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    if angle < 1e-6 {
        return mixed(from, to, [1.0 - share, sign * share]);
    }
    mixed(from, to, [((1.0 - share) * angle).sin() / angle.sin(), sign * (share * angle).sin() / angle.sin()])
}

#[cfg(test)]
mod tests {
    use raykiln_formats::properties::Property;

    use super::*;

    const ALLOWED: Allowed = Allowed { distance: 1e-3, angle: 1e-3, weight: 1e-3 };

    fn channel(path: &str, times: &[f64], values: &[f64]) -> Channel {
        Channel {
            target: Property::Node(0),
            path: path.into(),
            interpolation: "LINEAR".into(),
            times: times.into(),
            values: values.into(),
        }
    }

    #[test]
    fn keys_in_between_change_nothing() {
        let line = channel("translation", &[0.0, 2.0], &[0.0, 0.0, 0.0, 2.0, 4.0, 6.0]);
        let more = channel("translation", &[0.0, 1.0, 2.0], &[0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 2.0, 4.0, 6.0]);
        let bent = channel("translation", &[0.0, 1.0, 2.0], &[0.0, 0.0, 0.0, 1.0, 2.1, 3.0, 2.0, 4.0, 6.0]);
        assert!(are_same(&line, &more, ALLOWED) && !are_same(&line, &bent, ALLOWED));
        let step = Channel { interpolation: "STEP".into(), ..line.clone() };
        assert!(!are_same(&line, &step, ALLOWED));
        let empty = channel("translation", &[], &[]);
        assert!(!are_same(&line, &empty, ALLOWED) && !are_same(&empty, &empty, ALLOWED));
    }

    #[test]
    fn splines_pass_their_keys_with_their_tangents() {
        let mut spline = channel("translation", &[1.0, 3.0], &[9.0, 0.0, 2.0, 2.0, 4.0, 9.0]);
        spline.interpolation = "CUBICSPLINE".into();
        let at = |time| value(&spline, time).expect("sound")[0];
        // With tangents of 2 at both ends, the curve is the line of slope 2.
        assert_eq!([0.0, 1.0, 1.5, 2.0, 3.0, 4.0].map(at), [0.0, 0.0, 1.0, 2.0, 4.0, 4.0]);
        assert!(!are_same(&spline, &spline, ALLOWED));
        spline.values = [9.0, 0.0, 0.0, 0.0, 4.0, 9.0].into();
        assert_eq!(value(&spline, 1.5), Some(vec![0.625]));
    }

    #[test]
    fn outside_of_its_keys_a_curve_keeps_its_end() {
        for interpolation in ["STEP", "LINEAR"] {
            let mut curve = channel("scale", &[1.0, 2.0], &[5.0, 5.0, 5.0, 7.0, 7.0, 7.0]);
            curve.interpolation = interpolation.into();
            let at = |time| value(&curve, time).expect("sound")[0];
            assert_eq!([0.0, 1.0, 2.0, 3.0].map(at), [5.0, 5.0, 7.0, 7.0], "{interpolation}");
        }
    }

    #[test]
    fn rotations_follow_the_arc() {
        let (half, quarter) = (std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_PI_8);
        let turn = channel("rotation", &[0.0, 2.0], &[0.0, 0.0, 0.0, 1.0, 0.0, half, 0.0, half]);
        let middle = [0.0, -quarter.sin(), 0.0, -quarter.cos()];
        let keys = [&[0.0, 0.0, 0.0, 1.0][..], &middle, &[0.0, half, 0.0, half]].concat();
        assert!(are_same(&turn, &channel("rotation", &[0.0, 1.0, 2.0], &keys), ALLOWED));
        let other = [&[0.0, 0.0, 0.0, 1.0][..], &[0.0, 0.5, 0.0, 0.75_f64.sqrt()], &[0.0, half, 0.0, half]].concat();
        assert!(!are_same(&turn, &channel("rotation", &[0.0, 1.0, 2.0], &other), ALLOWED));
    }
}
