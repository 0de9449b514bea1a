//! The action `run`.

use std::fs;
use std::path::{Path, PathBuf};

use super::ActionsResult;
use super::config::{Actions, Generated, Listed, RunKeys};
use crate::lab::LabError;
use crate::lab::bench::{Bench, RunRow, RunTable, Session, Setup, Subject};
use crate::lab::cooling::{Cooling, Limits, MAX_TEMPERATURE, TIMEOUT};
use crate::lab::thesis_files::SettingsFile;
use crate::render::{Camera, RenderOptions, Renderer, View};
use crate::scene::Scene;
use crate::verify::DeviceChoice;
use crate::verify::probe::Until;

/// Seconds that a run is timed for, as in the thesis.
const SECONDS: f64 = 10.0;

/// Frames of scenes with instances that move.
const FRAMES: u32 = 64;

/// Largest number of passes, and of frames.
const MOST_PASSES: u32 = 1_000_000;

/// What an action measures.
pub(super) struct Plan {
    scenes: Vec<SettingsFile>,
    environments: Vec<(SettingsFile, Vec<Setup>)>,
    views: Vec<View>,
}

impl Plan {
    /// Reads what an action names, before anything is measured.
    ///
    /// # Errors
    /// Fails on the first thing that is wrong.
    pub(super) fn of(
        keys: &RunKeys,
        action: &Listed,
        config: &Actions,
        generated: &[Generated],
    ) -> Result<Plan, LabError> {
        let out_of_range = |name: &str, range: &str| config.error(action, format!("`{name}` is not {range}"));
        match keys {
            RunKeys { seconds: Some(_), passes: Some(_), .. } => {
                return Err(config.error(action, "`seconds` and `passes` cannot both be given"));
            }
            RunKeys { seconds: Some(s), .. } if !(*s > 0.0 && *s <= 3600.0) => {
                return Err(out_of_range("seconds", "a number above 0 and up to 3600"));
            }
            RunKeys { passes: Some(n), .. } if !(1..=MOST_PASSES).contains(n) => {
                return Err(out_of_range("passes", "an integer from 1 to 1000000"));
            }
            RunKeys { frames: Some(n), .. } if *n > MOST_PASSES => {
                return Err(out_of_range("frames", "an integer from 0 to 1000000"));
            }
            RunKeys { max_temperature, cooling_timeout, .. } => {
                for (name, value) in [("max_temperature", max_temperature), ("cooling_timeout", cooling_timeout)] {
                    if value.is_some_and(|x| !(x >= 0.0 && x.is_finite())) {
                        return Err(out_of_range(name, "a number of at least 0"));
                    }
                }
            }
        }
        let environment = |file: SettingsFile| Setup::all_of(&file).map(|setups| (file, setups));
        let scenes = config.scenes(action, &keys.scenes, generated)?;
        let environments = config.environments(action, &keys.envs)?;
        Ok(Plan {
            scenes,
            environments: environments.into_iter().map(environment).collect::<Result<_, _>>()?,
            views: keys.pictures.iter().map(|name| view(name, action, config)).collect::<Result<_, _>>()?,
        })
    }

    /// Returns the number of runs.
    pub(super) fn runs(&self) -> usize {
        self.scenes.len() * self.environments.iter().map(|(_, setups)| setups.len()).sum::<usize>()
    }

    /// Returns the names of the swept keys.
    pub(super) fn swept(&self) -> impl Iterator<Item = String> + '_ {
        self.environments.iter().flat_map(|(file, _)| file.swept())
    }
}

fn view(name: &str, action: &Listed, config: &Actions) -> Result<View, LabError> {
    View::ALL.into_iter().find(|view| view.name() == name).ok_or_else(|| {
        let names = View::ALL.map(|view| format!("`{}`", view.name())).join(", ");
        config.error(action, format!("`pictures`: there is no view `{name}`; there are {names}"))
    })
}

/// The tables of all runs, created when the first one begins.
pub(super) struct Tables<'a> {
    folder: &'a Path,
    settings: Vec<String>,
    resume: bool,
    table: Option<RunTable>,
}

impl<'a> Tables<'a> {
    pub(super) fn new(folder: &'a Path, swept: impl Iterator<Item = String>, resume: bool) -> Tables<'a> {
        let mut settings: Vec<String> = swept.collect();
        settings.sort();
        settings.dedup();
        Tables { folder, settings, resume, table: None }
    }

    fn get(&mut self) -> Result<&mut RunTable, LabError> {
        if self.table.is_none() {
            self.table = Some(RunTable::create(self.folder, &self.settings, self.resume)?);
        }
        Ok(self.table.as_mut().expect("it was just created"))
    }
}

/// Where an action writes to.
struct Output<'o, 't> {
    tables: &'o mut Tables<'t>,
    result: &'o mut ActionsResult,
}

impl Output<'_, '_> {
    /// Writes a row that was not measured.
    fn fail(&mut self, row: RunRow) -> Result<(), LabError> {
        self.tables.get()?.append(&row)?;
        self.add(row);
        Ok(())
    }

    fn add(&mut self, row: RunRow) {
        let wrong = row.motion.as_ref().map_or(0, |motion| motion.wrong_hits);
        let wrong = (wrong > 0).then(|| format!("{wrong} rays of the last frame hit something else than they should"));
        let failed = row.failure.clone().into_iter().chain(wrong);
        self.result.failures.extend(failed.map(|why| format!("{} on {}: {why}", row.environment, row.scene)));
        self.result.rows.push(row);
    }
}

/// Runs all environments on all scenes. `tell` is told of each run before it begins.
///
/// # Errors
/// Fails if the device cannot be used or a file cannot be written.
pub(super) fn run(
    keys: &RunKeys,
    plan: &Plan,
    tables: &mut Tables,
    result: &mut ActionsResult,
    tell: &mut dyn FnMut(String),
) -> Result<(), LabError> {
    let mut runner = Runner::new(keys, plan)?;
    let mut output = Output { tables, result };
    for scene in &plan.scenes {
        for (environment, setups) in &plan.environments {
            match Subject::of(scene, Some(environment)) {
                Ok(subject) => {
                    let warnings = &mut output.result.warnings;
                    let new = subject.warnings.iter().filter(|w| !warnings.contains(w)).cloned().collect::<Vec<_>>();
                    warnings.extend(new);
                    runner.subject(&subject, setups, &plan.views, &mut output, tell)?;
                }
                Err(why) => {
                    let row = |setup: &Setup| RunRow::of_unread(scene, setup, &why.to_string());
                    setups.iter().map(row).try_for_each(|row| output.fail(row))?;
                }
            }
        }
    }
    result.notes.extend(runner.cooling.into_iter().flat_map(Cooling::into_notes));
    Ok(())
}

/// Returns the setups of each device, in their order.
fn by_device(setups: &[Setup]) -> Vec<(DeviceChoice, Vec<&Setup>)> {
    let mut all: Vec<(DeviceChoice, Vec<&Setup>)> = Vec::new();
    for setup in setups {
        match all.iter_mut().find(|(device, _)| *device == setup.device) {
            Some((_, of_device)) => of_device.push(setup),
            None => all.push((setup.device.clone(), vec![setup])),
        }
    }
    all
}

struct Runner {
    device: DeviceChoice,
    until: Until,
    seed: u64,
    frames: u32,
    benches: Vec<(DeviceChoice, Bench)>,
    /// `None` if nothing is traced on a device.
    cooling: Option<Cooling>,
}

impl Runner {
    fn new(keys: &RunKeys, plan: &Plan) -> Result<Runner, LabError> {
        let until = keys.passes.map_or(Until::Seconds(keys.seconds.unwrap_or(SECONDS)), Until::Passes);
        let device = keys.device.as_deref().map_or(DeviceChoice::Auto, DeviceChoice::from);
        let (seed, frames) = (keys.seed.unwrap_or(1), keys.frames.unwrap_or(FRAMES));
        let mut runner = Runner { device, until, seed, frames, benches: Vec::new(), cooling: None };
        for setup in plan.environments.iter().flat_map(|(_, setups)| setups) {
            runner.bench(&setup.device)?;
        }
        let limits = Limits {
            temperature: keys.max_temperature.unwrap_or(MAX_TEMPERATURE),
            timeout: keys.cooling_timeout.unwrap_or(TIMEOUT),
        };
        runner.cooling = Cooling::of(runner.benches.iter().map(|(_, bench)| &bench.machine), limits);
        Ok(runner)
    }

    /// Runs setups on a scene.
    fn subject(
        &mut self,
        subject: &Subject,
        setups: &[Setup],
        views: &[View],
        output: &mut Output,
        tell: &mut dyn FnMut(String),
    ) -> Result<(), LabError> {
        for (device, of_device) in by_device(setups) {
            let bench = self.bench(&device)?;
            let mut session = match Session::new(&self.benches[bench].1, subject) {
                Ok(session) => session,
                Err(why) => {
                    let row = |setup: &&Setup| RunRow::of_failed(subject, setup, &why);
                    of_device.iter().map(row).try_for_each(|row| output.fail(row))?;
                    continue;
                }
            };
            for setup in of_device {
                tell(format!("{} on {}", setup.name, subject.name));
                let row = match output.tables.get()?.known(&session.id(setup)).cloned() {
                    Some(row) => row,
                    None => {
                        self.cooling.iter_mut().for_each(Cooling::wait);
                        let row = session.run(setup).unwrap_or_else(|why| RunRow::of_failed(subject, setup, &why));
                        output.tables.get()?.append(&row)?;
                        row
                    }
                };
                draw(&session, setup, views, output.tables.folder, output.result)?;
                output.add(row);
            }
        }
        Ok(())
    }

    /// Returns the number of the bench of an environment's device, or else of the action's.
    fn bench(&mut self, of_setup: &DeviceChoice) -> Result<usize, LabError> {
        let device = if *of_setup == DeviceChoice::Auto { self.device.clone() } else { of_setup.clone() };
        if let Some(at) = self.benches.iter().position(|(of, _)| *of == device) {
            return Ok(at);
        }
        let bench = Bench { frames: self.frames, ..Bench::open(&device, self.until, self.seed)? };
        self.benches.push((device, bench));
        Ok(self.benches.len() - 1)
    }
}

/// Draws the layout of a setup. What surfaces look like is in the input, and does not depend on the layout.
fn draw(
    session: &Session,
    setup: &Setup,
    views: &[View],
    folder: &Path,
    result: &mut ActionsResult,
) -> Result<(), LabError> {
    let (shaded, of_layout): (Vec<View>, Vec<View>) = views.iter().partition(|view| **view == View::Shaded);
    if !shaded.is_empty() {
        draw_scene(session, setup, &session.subject.scene, &shaded, folder, result)?;
    }
    if !of_layout.is_empty() {
        draw_scene(session, setup, &session.lay_out(setup).stored, &of_layout, folder, result)?;
    }
    Ok(())
}

/// Draws views of a scene, which shows the model, with the instances.
fn draw_scene(
    session: &Session,
    setup: &Setup,
    scene: &Scene,
    views: &[View],
    folder: &Path,
    result: &mut ActionsResult,
) -> Result<(), LabError> {
    let subject = session.subject;
    let scene = subject.with_instances(scene);
    let camera = Camera::of(session.view().clone());
    let options = RenderOptions {
        size: setup.picture.size,
        samples: Some(setup.picture.samples),
        scale: setup.picture.heat_scale,
        light: subject.light,
        light_power: subject.light_power,
        ..RenderOptions::default()
    };
    fs::create_dir_all(folder).map_err(|e| LabError::file(folder, e))?;
    let pictures = Renderer::new(&subject.doc, &scene).and_then(|renderer| {
        let drawn = |&view| Ok((view, renderer.picture(view, &camera, &options)?));
        views.iter().map(drawn).collect::<Result<Vec<_>, _>>()
    });
    match pictures {
        Ok(pictures) => {
            for (view, picture) in pictures {
                let path = folder.join(picture_name(&subject.name, setup, view));
                fs::write(&path, picture.png()).map_err(|e| LabError::file(&path, e))?;
                result.figures.push(path);
            }
        }
        Err(why) => result.failures.push(format!("no pictures of {} on {}: {why}", setup.name, subject.name)),
    }
    Ok(())
}

/// Returns the name of a picture: of scene, environment, swept values and view.
fn picture_name(scene: &str, setup: &Setup, view: View) -> PathBuf {
    let swept = setup.swept.iter().map(|(name, value)| format!("{name}-{value}"));
    let words: Vec<String> =
        [scene.to_owned(), setup.name.clone()].into_iter().chain(swept).chain([view.name().to_owned()]).collect();
    PathBuf::from(plain(&words.join("-")) + ".png")
}

/// Returns a text as the name of a file: letters, digits, points and underscores stay.
pub(super) fn plain(text: &str) -> String {
    let of = |c: char| if c.is_ascii_alphanumeric() || c == '.' || c == '_' { c } else { '-' };
    let name: String = text.chars().map(of).collect();
    name.trim_start_matches(['.', '-']).to_owned()
}
