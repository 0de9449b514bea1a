//! Findings in words.

use super::{Broken, Cost, Work};
use crate::report::words::{bytes, counted, grouped, plural};

/// What is wrong; `count` objects break the rule.
pub(super) fn message(broken: &Broken, count: u64) -> String {
    let n = |what: &str| counted(count as usize, what);
    let has = |one: &'static str, many: &'static str| if count == 1 { one } else { many };
    match broken {
        Broken::Overlap { worst: [a, b], ratio, of_core, .. } => {
            let of = if *of_core { "area of the scene's core" } else { "scene's area" };
            let overlap = has("overlaps", "overlap");
            format!(
                "{} {overlap} others heavily; worst, the box of `{a}` that of `{b}` by {ratio:.4} of the {of}",
                n("object")
            )
        }
        Broken::EmptySpace { filled, parts, .. } => {
            format!(
                "{} {} of parts far apart; of the box of the worst, {} boxes fill {filled:.3} by surface area",
                n("mesh"),
                has("consists", "consist"),
                grouped(*parts as u64)
            )
        }
        Broken::Repeated { models, other_material, .. } => repeated(count, *models, *other_material),
        Broken::MovingParts { triangles, joints, .. } => format!(
            "{} of {} each follow only one of {}",
            counted(*triangles as usize, "triangle"),
            n("skinned mesh"),
            counted(*joints, "joint")
        ),
        Broken::Shell { area_ratio, .. } => format!(
            "{} {} the scene; the largest box has {} times the surface area of the rest's",
            n("object"),
            has("encloses", "enclose"),
            times(*area_ratio)
        ),
        Broken::Needles { triangles, worst, mean, .. } => needles(count, *triangles, *mean, *worst),
        Broken::NotOpaque { area_ratio, opaque_all_the_same, .. } => not_opaque(*area_ratio, opaque_all_the_same),
        Broken::Degenerate { triangles, not_finite } => degenerate(*triangles, *not_finite, count),
        Broken::Small { .. } => format!("the BLASes of {} are smaller than an allocation of 64 KiB", n("mesh")),
        Broken::TooMany { count, what, most, .. } => {
            format!("{} {what}; at most {} are advised", grouped(*count), grouped(*most))
        }
        Broken::Loose { factor, .. } => format!(
            "{} {} stretched or sheared, up to {factor:.1}:1, which makes their boxes loose",
            n("instance"),
            has("is", "are")
        ),
        Broken::Outlier { area_ratio } => format!(
            "{} {} far outside the rest: the scene's box has {} times the surface area of its core's",
            n("object"),
            has("lies", "lie"),
            times(*area_ratio)
        ),
        Broken::Far { farthest, step, of_size } => format!(
            "coordinates of {} reach {farthest:.3e}, where single precision has steps of {step:.1e} units, {of_size:.1e} of an \
             object's size",
            n("instance")
        ),
        Broken::Tiny { ratio, .. } => format!(
            "{} {} smaller than {ratio:.0e} of the diagonal of the scene's core",
            n("instance"),
            has("is", "are")
        ),
        Broken::Nested { assemblies, depth, .. } => nested(count, *assemblies, *depth),
    }
}

fn needles(count: u64, triangles: u64, mean: f64, worst: f64) -> String {
    format!(
        "{} of {} {} long, thin and diagonal: they cover {mean:.4} of the surface area of their boxes in the mean, {worst:.1e} at \
         least",
        counted(triangles as usize, "triangle"),
        counted(count as usize, "mesh"),
        be(triangles as usize)
    )
}

fn nested(count: u64, assemblies: usize, depth: usize) -> String {
    let nested = if depth > 1 { format!(", nested {depth} deep") } else { String::new() };
    format!(
        "{} of several meshes {} placed {} times{nested}",
        counted(assemblies, "assembly"),
        be(assemblies),
        grouped(count)
    )
}

fn be(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

/// A ratio with as many digits as matter.
fn times(ratio: f64) -> String {
    if ratio < 100.0 {
        format!("{ratio:.1}")
    } else if ratio < 1e6 {
        grouped(ratio as u64)
    } else {
        format!("{ratio:.1e}")
    }
}

fn repeated(count: u64, models: usize, other_material: bool) -> String {
    let repeat = if count == 1 { "repeats" } else { "repeat" };
    let others = if models == 1 { "one other".to_owned() } else { format!("{} others", grouped(models as u64)) };
    let but = if other_material { ", with other materials" } else { "" };
    format!("{} {repeat} {others}{but}", counted(count as usize, "mesh"))
}

fn not_opaque(area_ratio: f64, opaque_all_the_same: &[String]) -> String {
    let share = format!("{area_ratio:.3} of the scene's triangles, by area, are not opaque");
    if opaque_all_the_same.is_empty() {
        return share;
    }
    let names: Vec<String> = opaque_all_the_same.iter().take(3).map(|name| format!("`{name}`")).collect();
    let more = opaque_all_the_same.len().saturating_sub(names.len());
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!(
        "{share}; alpha is 1 everywhere in the {} {}{more}",
        plural(opaque_all_the_same.len(), "material"),
        names.join(", ")
    )
}

fn degenerate(triangles: u64, not_finite: usize, meshes: u64) -> String {
    let have = if triangles == 1 { "has" } else { "have" };
    let flat =
        format!("{} of {} {have} no area", counted(triangles as usize, "triangle"), counted(meshes as usize, "mesh"));
    match (triangles, not_finite) {
        (_, 0) => flat,
        (0, _) => format!("{} had corners that are not finite", counted(not_finite, "mesh")),
        _ => format!("{flat}; {} had corners that are not finite", counted(not_finite, "mesh")),
    }
}

/// What it costs, and how that was computed.
pub(super) fn cost(broken: &Broken) -> Cost {
    let (per_ray, work) = per_ray(broken).unzip();
    let bytes = bytes_of(broken);
    let by_areas = "per ray through the scene's core, by surface areas";
    let text = match (per_ray, bytes) {
        (Some(amount), _) => {
            format!("{} {} {by_areas}", amount_of(amount), words_of(work.unwrap_or(Work::InstanceEntries)))
        }
        (None, Some(_)) => words_of_bytes(broken, bytes.unwrap_or(0)),
        (None, None) => words_without_number(broken).to_owned(),
    };
    Cost { per_ray, work, bytes, text }
}

fn amount_of(amount: f64) -> String {
    if amount >= 100.0 { grouped(amount.round() as u64) } else { format!("{amount:.3}") }
}

fn words_of(work: Work) -> &'static str {
    match work {
        Work::Overlaps => "pairs of boxes entered at one place,",
        Work::InstanceEntries => "instance entries (of about 5 tree nodes each)",
        Work::TriangleTests => "triangle tests that miss",
        Work::AnyHitCalls => "any-hit calls, or stops of the traversal,",
    }
}

fn per_ray(broken: &Broken) -> Option<(f64, Work)> {
    match *broken {
        Broken::Overlap { per_ray, .. } => Some((per_ray, Work::Overlaps)),
        Broken::EmptySpace { per_ray, .. } | Broken::Shell { per_ray, .. } | Broken::Loose { per_ray, .. } => {
            Some((per_ray, Work::InstanceEntries))
        }
        Broken::Needles { per_ray, .. } => Some((per_ray, Work::TriangleTests)),
        Broken::NotOpaque { per_ray, .. } => Some((per_ray, Work::AnyHitCalls)),
        _ => None,
    }
}

fn bytes_of(broken: &Broken) -> Option<u64> {
    match *broken {
        Broken::Repeated { saved_bytes, .. } => Some(saved_bytes),
        Broken::Small { lost, .. } => Some(lost),
        Broken::Degenerate { triangles, .. } => Some(crate::cost::bytes::COMPACTED_BLAS_BYTES_PER_TRIANGLE * triangles),
        Broken::MovingParts { bytes, .. } | Broken::Tiny { bytes, .. } | Broken::Nested { bytes, .. } => Some(bytes),
        _ => None,
    }
}

fn words_of_bytes(broken: &Broken, amount: u64) -> String {
    let size = bytes(amount);
    match *broken {
        Broken::MovingParts { .. } => format!("{size} of BLASes, as predicted, to rebuild or refit in each frame"),
        Broken::Small { aligned, .. } => {
            format!("{size} if each is allocated alone; {} by alignment alone, as predicted", bytes(aligned))
        }
        Broken::Nested { saved, .. } => {
            format!("{size} of TLAS, as predicted: {}", counted(saved as usize, "instance"))
        }
        Broken::Tiny { .. } => format!("{size} of BLASes and TLAS, as predicted"),
        _ => format!("{size} of BLASes, as predicted"),
    }
}

fn words_without_number(broken: &Broken) -> &'static str {
    match broken {
        Broken::Outlier { .. } => {
            "every ray, 3 to 5 times as slow where builders divide space by the scene's box, by the source; not predicted"
        }
        Broken::Far { .. } => "precision, not speed: hits are off by about the step above",
        Broken::TooMany { rule: super::Rule::Limits, .. } => "a device refuses to build it",
        _ => "time to build the TLAS and to enter instances; not predicted",
    }
}

/// What a person can do.
pub(super) fn by_hand(broken: &Broken) -> String {
    match broken {
        Broken::Repeated { other_material: true, .. } => {
            "build one BLAS for them and look the material up by the index of the instance; in the file, let their \
             primitives refer to the same accessors"
                .to_owned()
        }
        Broken::NotOpaque { opaque_all_the_same, .. } if opaque_all_the_same.is_empty() => {
            "cut leaves and the like out along their outline, or use opacity micromaps".to_owned()
        }
        _ => broken.rule().by_hand().to_owned(),
    }
}

/// What the program does.
pub(super) fn by_bake(broken: &Broken) -> String {
    match broken {
        Broken::Repeated { other_material: true, .. } => {
            "bake leaves them as they are: a copy must have the same material".to_owned()
        }
        Broken::Repeated { shared_by_bake: false, .. } => {
            "`auto` leaves them: it shares copies from 64 KiB on; `--copies rigid` always shares them".to_owned()
        }
        _ => broken.rule().by_bake().to_owned(),
    }
}
