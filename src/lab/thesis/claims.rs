//! What the thesis says of its figures, set beside what was measured.

use super::measured::{Measured, standing_for};
use super::numbers::{CHOSEN, NODE_RATIOS, SAN_MIGUEL, SCENES, SKIP_THRESHOLDS, SOM_THRESHOLDS};
use super::tables::number;
use super::trials::Trial;

/// States which of some trials is the fastest on a scene, and how that compares with the thesis's.
fn fastest(scene: &Measured, trials: &[Trial], thesis: Option<Trial>, name: fn(Trial) -> String) -> Option<String> {
    let found = scene.fastest(trials)?;
    let speed = |trial: Trial| scene.speed(trial).map_or(0.0, |speed| speed.0);
    let of_scene = &scene.found.name;
    let Some(expected) = thesis else {
        return Some(format!("On {of_scene}, {} is the fastest.", name(found)));
    };
    let (expected_name, ratio) = (name(expected), number(speed(found) / speed(expected)));
    Some(match () {
        () if found == expected => format!("On {of_scene}, {expected_name} is the fastest here as in the thesis."),
        () if scene.are_alike(found, expected) => format!(
            "On {of_scene}, {expected_name} is the fastest in the thesis; here it cannot be told from {}.",
            name(found)
        ),
        () if scene.speed(expected).is_none() => {
            format!("On {of_scene}, {expected_name} is the fastest in the thesis; here it was not timed.")
        }
        () => format!(
            "On {of_scene}, {expected_name} is the fastest in the thesis; here {} is, {ratio} times as fast.",
            name(found)
        ),
    })
}

/// Experiment 1.
pub(super) fn bvh(measured: &[Measured]) -> Vec<String> {
    let trials = NODE_RATIOS.map(Trial::Bvh);
    let of_scene = |scene: &Measured| {
        let thesis = (scene.found.of == Some(SAN_MIGUEL)).then_some(Trial::Bvh(CHOSEN.0));
        fastest(scene, &trials, thesis, Trial::name)
    };
    measured.iter().filter_map(of_scene).collect()
}

/// Experiment 2, skip thresholds: the thesis finds 0.005 the fastest on Powerplant and San Miguel.
pub(super) fn skip(measured: &[Measured]) -> Vec<String> {
    let trials = SKIP_THRESHOLDS.map(|skip| Trial::Overlap { skip, som: CHOSEN.2 });
    let chosen = Trial::Overlap { skip: CHOSEN.1, som: CHOSEN.2 };
    let name = |trial: Trial| {
        if let Trial::Overlap { skip, .. } = trial { format!("skip threshold {skip}") } else { trial.name() }
    };
    let of_scene = |scene: &Measured| {
        let thesis = scene.found.of.filter(|&of| of >= SAN_MIGUEL - 1).map(|_| chosen);
        fastest(scene, &trials, thesis, name)
    };
    measured.iter().filter_map(of_scene).chain(measured.iter().filter_map(|scene| overlap(scene, chosen))).collect()
}

/// States whether the reduction lowers the overlap, which in the thesis it does not on Sponza and Powerplant.
fn overlap(scene: &Measured, chosen: Trial) -> Option<String> {
    let [before, after] = [Trial::PerObject, chosen].map(|trial| scene.row(trial).map(|row| row.overlap_ratio));
    let (before, after) = (before?, after?);
    let rises_in_thesis = scene.found.of.map(|of| ["Sponza", "Powerplant"].contains(&SCENES[of].name));
    let word = |rises: bool| if rises { "raises" } else { "lowers" };
    let rises = after > before;
    let name = &scene.found.name;
    if number(before) == number(after) {
        return Some(format!(
            "With skip threshold 0.005, the reduction leaves the overlap ratio of {name} at {}.",
            number(before)
        ));
    }
    Some(match rises_in_thesis {
        Some(in_thesis) if in_thesis != rises => format!(
            "With skip threshold 0.005, the reduction {} the overlap ratio of {name} in the thesis; here it {} it, from {} \
             to {}.",
            word(in_thesis),
            word(rises),
            number(before),
            number(after)
        ),
        _ => format!(
            "With skip threshold 0.005, the reduction {} the overlap ratio of {name} from {} to {}{}.",
            word(rises),
            number(before),
            number(after),
            if rises_in_thesis.is_some() { ", as in the thesis" } else { "" }
        ),
    })
}

/// Experiment 2, split-or-merge thresholds: the thesis finds 0.5 the fastest, and no difference on Sponza.
pub(super) fn som(measured: &[Measured]) -> Vec<String> {
    let trials = SOM_THRESHOLDS.map(|som| Trial::Overlap { skip: CHOSEN.1, som });
    let name = |trial: Trial| {
        if let Trial::Overlap { som, .. } = trial { format!("SoM threshold {som}") } else { trial.name() }
    };
    let chosen = Trial::Overlap { skip: CHOSEN.1, som: CHOSEN.2 };
    let of_scene = |scene: &Measured| {
        let is_sponza = scene.found.of.is_some_and(|of| SCENES[of].name == "Sponza");
        let thesis = (scene.found.of.is_some() && !is_sponza).then_some(chosen);
        let text = fastest(scene, &trials, thesis, name)?;
        Some(if is_sponza { format!("{text} In the thesis every threshold is as fast on Sponza.") } else { text })
    };
    measured.iter().filter_map(of_scene).collect()
}

/// Experiment 4: in the thesis one BLAS is the fastest but on the static Sponza, where the overlap reduction is.
pub(super) fn methods(measured: &[Measured]) -> Vec<String> {
    let (_, skip, som) = CHOSEN;
    let of_thesis = &Trial::COMPARED[..Trial::OF_THESIS];
    let of_scene = |scene: &Measured| {
        let thesis = scene.found.of.map(|of| match SCENES[of].name {
            "Sponza" => Trial::Overlap { skip, som },
            _ => Trial::Single,
        });
        let among_four = fastest(scene, of_thesis, thesis, Trial::name)?;
        let best = scene.fastest(of_thesis)?;
        let own = match (scene.speed(Trial::Auto), scene.speed(best)) {
            (Some(own), Some(best_speed)) => format!(
                " What `bake` chooses is {} times as fast as the best of the thesis's methods, {}.",
                number(own.0 / best_speed.0),
                best.name()
            ),
            _ => String::new(),
        };
        Some(among_four + &own)
    };
    measured.iter().filter_map(of_scene).collect()
}

/// States which scene stands for San Miguel.
pub(super) fn stand_in(measured: &[Measured]) -> Option<String> {
    let scene = standing_for(SAN_MIGUEL, measured).filter(|scene| scene.found.of != Some(SAN_MIGUEL))?;
    Some(format!("San Miguel is not at hand: {} stands for it, which has the most triangles.", scene.found.name))
}

/// Experiment 3: in the thesis, every scene with 10^5 instances is about as fast as the instances alone.
pub(super) fn crowds(measured: &[Measured], instances: usize) -> Vec<String> {
    let of_scene = |scene: &Measured| {
        let [with, alone] = [Some(Trial::Single), None].map(|trial| scene.crowd(instances, trial));
        let ratio = with?.0 / alone?.0;
        let agrees = (ABOUT..=1.0 / ABOUT).contains(&ratio);
        let beside =
            if agrees { "about as fast, as in the thesis" } else { "where the thesis finds about the same speed" };
        let (name, ratio) = (&scene.found.name, number(ratio));
        Some(format!(
            "{name} with {instances} instances is traced {ratio} times as fast as the instances alone, {beside}."
        ))
    };
    measured.iter().filter_map(of_scene).collect()
}

/// Speeds whose ratio is between this and its reciprocal are "roughly the same".
const ABOUT: f64 = 0.8;
