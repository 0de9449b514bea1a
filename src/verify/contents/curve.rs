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
    are_few
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

/// Returns the value of a curve at a time; `None` if it is a spline or its keys are malformed.
fn value(channel: &Channel, time: f64) -> Option<Vec<f64>> {
    let (times, values) = (&channel.times, &channel.values);
    let size = values.len().checked_div(times.len()).filter(|size| *size > 0)?;
    let key = |i: usize| values.get(i * size..(i + 1) * size);
    let next = times.partition_point(|t| *t <= time);
    let (first, second) = (next.saturating_sub(1), next.min(times.len() - 1));
    match channel.interpolation.as_str() {
        "STEP" => Some(key(first)?.to_vec()),
        "LINEAR" if first == second => Some(key(first)?.to_vec()),
        "LINEAR" => {
            let share = (time - times[first]) / (times[second] - times[first]);
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
