//! What the keys of a scene mean: the models, the camera, the light and the instances.

use std::path::Path;

use glam::DVec3;
use raykiln_formats::Document;

use crate::lab::LabError;
use crate::lab::motion::joined;
use crate::lab::reading::{self, ReadScene};
use crate::lab::thesis_files::{SettingsFile, Value};
use crate::motion::{MovingScene, Orbit, PlacedCopies};
use crate::scene::Scene;
use crate::verify::rays::shot::Light;
use crate::verify::view::View;

/// Places of a camera that moves.
const CAMERA_PLACES: usize = 8;

/// Seconds in which a camera that moves takes its places, as long as a timed run of the thesis.
const CAMERA_SECONDS: f64 = 10.0;

/// Diagonal of the box of an instance over that of the scene's model. The thesis only says that instances are scaled in
/// proportion to the model.
const INSTANCE_SIZE: f64 = 0.02;

/// A scene to measure.
pub(in crate::lab) struct Subject {
    pub(in crate::lab) name: String,
    /// The model's path as the scene names it.
    pub(in crate::lab) model: String,
    pub(in crate::lab) doc: Document,
    /// The model, without instances.
    pub(in crate::lab) scene: Scene,
    /// The camera; `None` for the automatic one.
    pub(in crate::lab) orbit: Option<Orbit>,
    /// The places of the camera that primary rays come from; empty for the automatic one.
    pub(in crate::lab) views: Vec<View>,
    pub(in crate::lab) light: Option<Light>,
    /// Brightness of the light over the default.
    pub(in crate::lab) light_power: Option<f64>,
    pub(in crate::lab) instances: Option<Instances>,
    /// What readers repaired or omitted.
    pub(in crate::lab) warnings: Vec<String>,
}

/// Instances of another model.
pub(in crate::lab) struct Instances {
    /// Their model.
    pub(in crate::lab) model: Scene,
    /// Where they stand, in scene units, and how the first ones move.
    pub(in crate::lab) copies: PlacedCopies,
}

impl Subject {
    /// Reads the scene that a scene file describes; `environment` may hold the lists of instances instead.
    ///
    /// # Errors
    /// Fails if there is no model, if a file cannot be read or has no triangles, or if instances are missing.
    pub(in crate::lab) fn of(file: &SettingsFile, environment: Option<&SettingsFile>) -> Result<Subject, LabError> {
        let [Value::Text(model)] = file.values("MODEL_FILE_NAME") else {
            return Err(file.error(file.line_of("MODEL_FILE_NAME"), "`MODEL_FILE_NAME` is missing"));
        };
        let mut subject = Subject::read(model, &file.beside(model))?;
        if let [Value::Text(name)] = file.values("SCENE_NAME") {
            subject.name.clone_from(name);
        }
        subject.instances = instances(file, environment, &mut subject.warnings)?;
        subject.orbit = orbit(file, &subject.scene);
        subject.views = subject.orbit.map_or(Ok(Vec::new()), |orbit| views(file, &orbit))?;
        if let [Value::Vector(corner)] = file.values("LIGHT_ORIGIN") {
            let size = if let [Value::Number(size)] = file.values("LIGHT_SIZE") { *size } else { 1.0 };
            subject.light = Some(Light { corner: DVec3::from_array(*corner), size });
        }
        if let [Value::Number(power)] = file.values("LIGHT_POWER") {
            subject.light_power = Some(*power);
        }
        Ok(subject)
    }

    /// Reads a model without more.
    ///
    /// # Errors
    /// Fails if it cannot be read or has no triangles.
    pub(in crate::lab) fn read(name: &str, path: &Path) -> Result<Subject, LabError> {
        let ReadScene { doc, scene, warnings } = reading::read(path).map_err(LabError::Read)?;
        let stem = Path::new(name).file_stem().map_or_else(|| name.to_owned(), |s| s.to_string_lossy().into_owned());
        Ok(Subject {
            name: stem,
            model: name.to_owned(),
            doc,
            scene,
            orbit: None,
            views: Vec::new(),
            light: None,
            light_power: None,
            instances: None,
            warnings,
        })
    }

    /// Returns a scene, which shows the model, with the instances added at their places.
    pub(in crate::lab) fn with_instances(&self, scene: &Scene) -> Scene {
        self.moving(scene).scene().clone()
    }

    /// Returns a scene, which shows the model, with the instances added, such that they can move.
    pub(super) fn moving(&self, scene: &Scene) -> MovingScene {
        match &self.instances {
            Some(Instances { model, copies }) => {
                MovingScene::new(scene, model, INSTANCE_SIZE * self.scene.bounds().diagonal(), copies.clone())
            }
            None => MovingScene::new(scene, &Scene::default(), 1.0, PlacedCopies::default()),
        }
    }

    /// Whether instances move.
    pub(super) fn moves(&self) -> bool {
        self.instances.as_ref().is_some_and(|of| !of.copies.animations.is_empty())
    }
}

/// Returns the instances: as many as the scene states, at the first places of the list.
fn instances(
    file: &SettingsFile,
    environment: Option<&SettingsFile>,
    warnings: &mut Vec<String>,
) -> Result<Option<Instances>, LabError> {
    let whole = |name, otherwise: usize| match file.values(name) {
        [Value::Whole(n)] => *n as usize,
        _ => otherwise,
    };
    let lists = [Some(file), environment].into_iter().flatten().find(|f| !f.positions.is_empty()).unwrap_or(file);
    let count = whole("INSTANCE_COUNT", lists.positions.len());
    let animated = whole("ANIM_INSTANCE_COUNT", lists.animations.len());
    let [Value::Text(name)] = file.values("INSTANCE_FILE_NAME") else {
        return match count {
            0 => Ok(None),
            _ => Err(file.error(file.line_of("INSTANCE_COUNT"), "`INSTANCE_FILE_NAME` is missing")),
        };
    };
    for (key, what, count, listed) in [
        ("INSTANCE_COUNT", "positions", count, lists.positions.len()),
        ("ANIM_INSTANCE_COUNT", "animations", animated, lists.animations.len()),
    ] {
        if listed < count {
            let cause = format!("`{key}` is {count}, but {listed} {what} are listed; the action `generate` makes them");
            return Err(file.error(file.line_of(key), cause));
        }
    }
    let (model, of_reader) = read_instance(&file.beside(name))?;
    warnings.extend(of_reader);
    let positions = lists.positions[..count].iter().copied().map(DVec3::from_array).collect();
    let copies = PlacedCopies { positions, animations: lists.animations[..animated].to_vec() };
    Ok(Some(Instances { model, copies }))
}

/// Reads a model of instances, with all that may be joined in one mesh; also returns what its reader repaired or omitted.
///
/// # Errors
/// Fails if it cannot be read or has no triangles.
pub(in crate::lab) fn read_instance(path: &Path) -> Result<(Scene, Vec<String>), LabError> {
    let ReadScene { scene, warnings, .. } = reading::read(path).map_err(LabError::Read)?;
    Ok((joined(&scene), warnings))
}

/// Returns the camera that a scene states, which stands still if the scene does not move it.
fn orbit(file: &SettingsFile, scene: &Scene) -> Option<Orbit> {
    let [Value::Vector(position)] = file.values("CAMERA_POSITION") else { return None };
    let interest = match file.values("CAMERA_POI") {
        [Value::Vector(poi)] => DVec3::from_array(*poi),
        _ => scene.core().bounds().center(),
    };
    let frequency = match (file.values("ANIMATE_CAMERA"), file.values("CAMERA_ROTATION_SPEED")) {
        ([Value::Flag(true)], [Value::Number(speed)]) => *speed,
        _ => 0.0,
    };
    Some(Orbit { position: DVec3::from_array(*position), interest, frequency })
}

/// Returns the places of a camera that rays come from.
fn views(file: &SettingsFile, orbit: &Orbit) -> Result<Vec<View>, LabError> {
    let places = if orbit.frequency != 0.0 { CAMERA_PLACES } else { 1 };
    let view = |i: usize| orbit.view(CAMERA_SECONDS * i as f64 / places as f64);
    let views: Option<Vec<View>> = (0..places).map(view).collect();
    let cause = "the camera looks nowhere: `CAMERA_POSITION` and `CAMERA_POI` are the same point";
    views.ok_or_else(|| file.error(file.line_of("CAMERA_POSITION"), cause))
}
