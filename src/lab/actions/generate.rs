//! The action `generate`: scenes with instances at random places, some of them animated.

use std::fs;

use super::ActionsResult;
use super::config::{Actions, GenerateKeys, Generated, Listed, Params};
use super::run::plain;
use crate::lab::LabError;
use crate::lab::reading::{self, core_bounds};
use crate::lab::thesis_files::{MOST_INSTANCES, SettingsFile, Value};
use crate::motion::{Crowd, Deviating};
use crate::scene::Bounds;

/// Returns the scenes of an action: each chosen scene with each number of instances. Nothing is written.
///
/// # Errors
/// Fails if a parameter is missing or out of its range, or if a model is missing or cannot be read.
pub(super) fn scenes(
    keys: &GenerateKeys,
    action: &Listed,
    config: &Actions,
    earlier: &[Generated],
) -> Result<Vec<Generated>, LabError> {
    let named = config.scenes(action, &keys.scenes, earlier)?;
    let Checked { chosen, crowds } = checked(&keys.params, named.len()).map_err(|why| config.error(action, why))?;
    let mut generated: Vec<Generated> = Vec::new();
    for scene in chosen.iter().map(|&of| &named[of]) {
        let bounds = bounds(scene)?;
        for crowd in &crowds {
            let made = crowded(scene, crowd, &bounds);
            if earlier.iter().chain(&generated).any(|other| other.file_name == made.file_name) {
                return Err(config.error(action, format!("`{}` would be written twice", made.file_name)));
            }
            generated.push(made);
        }
    }
    Ok(generated)
}

/// Writes the scenes to the folder of results.
///
/// # Errors
/// Fails if a file cannot be written.
pub(super) fn write(scenes: &[Generated], result: &mut ActionsResult) -> Result<(), LabError> {
    fs::create_dir_all(&result.out).map_err(|e| LabError::file(&result.out, e))?;
    for Generated { file_name, scene } in scenes {
        result.scenes.push(scene.write_scene(&result.out, file_name)?);
    }
    Ok(())
}

/// Parameters that are in their ranges.
#[derive(Debug)]
struct Checked {
    /// Indices of scenes.
    chosen: Vec<usize>,
    crowds: Vec<Crowd>,
}

/// Checks the parameters for a number of scenes.
///
/// # Errors
/// Names the first parameter that is wrong, and what it has to be.
fn checked(params: &Params, scenes: usize) -> Result<Checked, String> {
    let Params { model_mask, n_all, n_anim_all, .. } = params;
    if model_mask.is_empty() {
        return Err("`model_mask` is an empty list".into());
    }
    for (i, of) in model_mask.iter().enumerate() {
        if *of >= scenes {
            return Err(format!("`model_mask` has {of}, not an index into the {scenes} scenes, which count from 0"));
        }
        if model_mask[..i].contains(of) {
            return Err(format!("`model_mask` has {of} twice"));
        }
    }
    if n_all.is_empty() || n_all.len() != n_anim_all.len() {
        let (all, animated) = (n_all.len(), n_anim_all.len());
        return Err(format!(
            "`n_all` and `n_anim_all` have {all} and {animated} numbers, not as many, and at least one"
        ));
    }
    let crowds = n_all.iter().zip(n_anim_all).map(|(&all, &animated)| crowd(params, all, animated));
    Ok(Checked { chosen: model_mask.clone(), crowds: crowds.collect::<Result<_, _>>()? })
}

/// Returns how to place a number of instances.
fn crowd(params: &Params, all: u64, animated: u64) -> Result<Crowd, String> {
    if all > MOST_INSTANCES {
        return Err(format!("`n_all` has {all}, not an integer from 0 to {MOST_INSTANCES}"));
    }
    if animated > all {
        return Err(format!("`n_anim_all` has {animated}, more than the {all} of `n_all`"));
    }
    let needed = |name: &str, value: Option<f64>| match value {
        None if animated > 0 => Err(format!("`{name}` is missing: {animated} instances are animated")),
        value => at_least_zero(name, value.unwrap_or(0.0)),
    };
    let Params { turns, turns_dev, .. } = *params;
    if !turns.is_finite() {
        return Err(format!("`turns` is {turns}, not a finite number"));
    }
    Ok(Crowd {
        copies: all as usize,
        animated: animated as usize,
        speed: Deviating { base: needed("v", params.v)?, deviation: needed("v_dev", params.v_dev)? },
        distance: Deviating { base: needed("d", params.d)?, deviation: needed("d_dev", params.d_dev)? },
        turns: Deviating { base: turns, deviation: at_least_zero("turns_dev", turns_dev)? },
        seed: params.seed.unwrap_or(1),
    })
}

fn at_least_zero(name: &str, value: f64) -> Result<f64, String> {
    match value >= 0.0 && value.is_finite() {
        true => Ok(value),
        false => Err(format!("`{name}` is {value}, not a number of at least 0")),
    }
}

/// Returns the box in which instances of a scene stand.
fn bounds(scene: &SettingsFile) -> Result<Bounds, LabError> {
    let model = |key| match scene.values(key) {
        [Value::Text(name)] => Ok(scene.beside(name)),
        _ => Err(scene.error(scene.line_of(key), format!("`{key}` is missing"))),
    };
    let instances = model("INSTANCE_FILE_NAME")?;
    if !instances.is_file() {
        return Err(LabError::file(&instances, "no such file; it is the model of the instances"));
    }
    let read = reading::read(&model("MODEL_FILE_NAME")?).map_err(LabError::Read)?;
    Ok(core_bounds(&read.scene))
}

/// Returns a scene with a crowd. Its name is that of the scene with the number of instances and, if not all are animated, of
/// those that are: as `san_miguel_1000.scn` in the thesis's listing 4.2.
fn crowded(scene: &SettingsFile, crowd: &Crowd, bounds: &Bounds) -> Generated {
    let animated = if crowd.animated == crowd.copies { String::new() } else { format!("_{}", crowd.animated) };
    let named = |stem: &str| format!("{stem}_{}{animated}", crowd.copies);
    let name = scene.in_words("scene_name").unwrap_or_else(|| scene.stem());
    let file_name = format!("{}.scn", plain(&named(&scene.stem())));
    Generated { file_name, scene: scene.with_instances(named(&name), crowd.place(bounds)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params(change: impl FnOnce(&mut Params)) -> Result<Checked, String> {
        let mut params = Params {
            model_mask: vec![1, 0],
            n_all: vec![10, 20],
            n_anim_all: vec![10, 5],
            v: Some(1.0),
            v_dev: Some(0.5),
            d: Some(2.0),
            d_dev: Some(0.0),
            turns: 0.0,
            turns_dev: 0.0,
            seed: None,
        };
        change(&mut params);
        checked(&params, 2)
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let wrong = |change: fn(&mut Params)| params(change).expect_err("wrong");
        assert_eq!(wrong(|p| p.model_mask.clear()), "`model_mask` is an empty list");
        assert_eq!(
            wrong(|p| p.model_mask = vec![2]),
            "`model_mask` has 2, not an index into the 2 scenes, which count from 0"
        );
        assert_eq!(wrong(|p| p.model_mask = vec![1, 1]), "`model_mask` has 1 twice");
        assert!(wrong(|p| p.n_all = vec![1]).starts_with("`n_all` and `n_anim_all` have 1 and 2 numbers"));
        assert!(wrong(|p| p.n_all = vec![10, 1 << 30]).contains("`n_all` has 1073741824, not an integer from 0 to"));
        assert_eq!(wrong(|p| p.n_anim_all = vec![11, 0]), "`n_anim_all` has 11, more than the 10 of `n_all`");
        assert_eq!(wrong(|p| p.v = None), "`v` is missing: 10 instances are animated");
        assert_eq!(wrong(|p| p.d_dev = None), "`d_dev` is missing: 10 instances are animated");
        assert_eq!(wrong(|p| p.v_dev = Some(-1.0)), "`v_dev` is -1, not a number of at least 0");
        assert_eq!(wrong(|p| p.d = Some(f64::INFINITY)), "`d` is inf, not a number of at least 0");
        assert_eq!(wrong(|p| p.turns = f64::NAN), "`turns` is NaN, not a finite number");
        let still = params(|p| (p.v, p.v_dev, p.d, p.d_dev, p.n_anim_all) = (None, None, None, None, vec![0, 0]));
        assert_eq!(still.expect("nothing moves").crowds[1].animated, 0);
    }
}
