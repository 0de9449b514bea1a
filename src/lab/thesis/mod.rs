//! The experiments of the thesis, repeated: T. Bilák, "Scene optimization for RTX", master's thesis, Czech Technical
//! University in Prague, 2024, chapter 5. `docs/thesis.md` has the results.
//!
//! [`thesis`] finds the scenes of table 5.1, runs every trial on each, and writes rows, figures, and a page with the
//! thesis's numbers beside those measured.

mod claims;
mod crowds;
mod figures;
mod measured;
mod numbers;
mod page;
mod pictures;
mod redraw;
mod scenes;
mod tables;
mod trials;

use std::path::PathBuf;

use super::LabError;
use super::bench::{Bench, PictureSetup, RunRow, RunTable, Session, Setup, Subject};
use super::cooling::{Cooling, Limits};
use crate::choose::plans::Effort;
use crate::scene::Scene;
use crate::verify::DeviceChoice;
use crate::verify::probe::Until;
use measured::Measured;
use numbers::{SAN_MIGUEL, SIBENIK};
pub use redraw::redraw;
use scenes::Found;
use trials::Trial;

/// What to repeat.
#[derive(Clone, Debug)]
pub struct ThesisOptions {
    /// The folder with the scenes, each in a folder of its own.
    pub scenes: PathBuf,
    /// The folder for rows, figures and pages; it is created if it does not exist.
    pub out: PathBuf,
    /// Whether to trace few rays, once, through small scenes if those of the thesis are not at hand.
    pub quick: bool,
    /// Seconds that each trial is timed for; above 0. Has no effect if `quick`.
    pub seconds: f64,
    /// What traces.
    pub device: DeviceChoice,
    /// When a run may begin on a GPU. Has no effect if `quick`.
    pub limits: Limits,
    /// Whether rows of an earlier run that are already in `out` are kept instead of measured again.
    pub resume: bool,
}

/// What was repeated.
#[derive(Clone, Debug, Default)]
pub struct ThesisResult {
    /// Number of rows.
    pub rows: usize,
    /// Scenes and figures that could not be made, with the causes.
    pub failures: Vec<String>,
    /// What was not done as asked for, in words.
    pub notes: Vec<String>,
    /// What the readers of the scenes repaired or omitted.
    pub warnings: Vec<String>,
    /// The page.
    pub page: PathBuf,
}

/// How far an experiment is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// Runs that are done.
    pub done: usize,
    /// All runs.
    pub of: usize,
    /// The next one.
    pub name: String,
}

/// Width and height of the picture whose rays are timed; of a quick run.
const QUICK_SIZE: [u32; 2] = [32, 18];

/// Frames in which instances move; of a quick run.
const FRAMES: u32 = 64;
const QUICK_FRAMES: u32 = 3;

/// Seed of the rays.
const SEED: u64 = 1;

/// Runs all experiments. `progress` is told of each trial before it begins. A scene that fails is named, and the others
/// are measured nevertheless.
///
/// # Errors
/// Fails if no scene is found, the device cannot be used, or a file cannot be written. Rows measured until then are kept.
pub fn thesis(options: &ThesisOptions, progress: &mut dyn FnMut(&Step)) -> Result<ThesisResult, LabError> {
    let found = scenes::find(&options.scenes, options.quick)?;
    let until = if options.quick { Until::Passes(1) } else { Until::Seconds(options.seconds) };
    let frames = if options.quick { QUICK_FRAMES } else { FRAMES };
    let bench = Bench { frames, ..Bench::open(&options.device, until, SEED)? };
    let table = RunTable::create(&options.out, &[], options.resume)?;
    let cooling = Cooling::of([&bench.machine].into_iter().filter(|_| !options.quick), options.limits);
    let result = ThesisResult::default();
    let mut study = Experiments { options, bench: &bench, table, cooling, result, step: 0, steps: 0, progress };
    let smallest = found.iter().min_by_key(|scene| scene.file.metadata().map_or(0, |m| m.len()));
    let model = smallest.map(|scene| crowds::model(&options.scenes, options.quick, &scene.file));
    let model = model.and_then(|model| model.map_err(|why| study.result.failures.push(why)).ok());
    let per_scene = Trial::all().len() + model.as_ref().map_or(0, |_| crowds::runs());
    study.steps = found.len() * per_scene;
    let mut measured = Vec::new();
    let mut fragments = Vec::new();
    let [fragmented, crowded] = [SAN_MIGUEL, SIBENIK].map(|of| pictures::chosen(of, &found));
    for (i, scene) in found.iter().enumerate() {
        study.step = i * per_scene;
        match study.scene(scene, model.as_ref(), [i == fragmented, i == crowded]) {
            Ok((of_scene, drawn)) => {
                measured.push(of_scene);
                fragments.extend(drawn);
            }
            Err(Failure::Scene(why)) => study.result.failures.push(format!("{}: {why}", scene.name)),
            Err(Failure::Output(why)) => return Err(why),
        }
    }
    let mut result = study.result;
    result.notes.extend(study.cooling.into_iter().flat_map(Cooling::into_notes));
    result.rows = measured.iter().map(|scene| scene.trials.len() + scene.crowds.len()).sum();
    result.page = page::write(&measured, fragments, &result.failures, &options.out)?;
    Ok(result)
}

/// Why a scene is not measured.
enum Failure {
    /// It cannot be: the others can.
    Scene(String),
    /// Nothing can be written.
    Output(LabError),
}

/// States what of a run failed.
fn failures_of(row: &RunRow) -> Vec<String> {
    let wrong = row.motion.as_ref().map_or(0, |motion| motion.wrong_hits);
    let wrong = (wrong > 0).then(|| format!("{wrong} rays of the last frame hit something else than they should"));
    let why = row.failure.clone().into_iter().chain(wrong);
    why.map(|why| format!("{}, {}: {why}", row.scene, row.environment)).collect()
}

struct Experiments<'o, 'p> {
    options: &'o ThesisOptions,
    bench: &'o Bench,
    table: RunTable,
    /// `None` if runs do not wait.
    cooling: Option<Cooling>,
    result: ThesisResult,
    step: usize,
    steps: usize,
    progress: &'p mut dyn FnMut(&Step),
}

/// The pictures of figures 5.2 and 5.6.
type Fragments = Vec<crate::report::study::Figure>;

impl Experiments<'_, '_> {
    /// Runs all trials of a scene, and draws its layouts if asked for.
    fn scene(
        &mut self,
        found: &Found,
        model: Option<&Scene>,
        [fragmented, crowded]: [bool; 2],
    ) -> Result<(Measured, Fragments), Failure> {
        let in_words = |e: LabError| Failure::Scene(e.to_string());
        (self.progress)(&Step { done: self.step, of: self.steps, name: found.name.clone() });
        let mut subject = Subject::read(&found.model, &found.file).map_err(in_words)?;
        subject.name.clone_from(&found.name);
        self.result.warnings.append(&mut subject.warnings);
        let mut session = Session::new(self.bench, &subject).map_err(Failure::Scene)?;
        let mut measured = Measured { found: found.clone(), trials: Vec::new(), crowds: Vec::new() };
        // `bake` chooses without the instances, and what it chooses takes long: once per scene.
        let mut chosen = None;
        for trial in Trial::all() {
            let setup = self.setup(trial);
            let mut measure = |session: &mut Session| match trial {
                Trial::Auto => {
                    let laid = chosen.insert(session.lay_out(&setup));
                    session.run_laid(&setup, laid)
                }
                _ => session.run(&setup),
            };
            let name = format!("{}: {}", found.name, trial.name());
            let row = self.row(&mut session, &setup, name, &mut measure)?;
            measured.trials.push((trial, row));
        }
        let mut drawn = match fragmented {
            true => pictures::fragments(&session, self.picture(), &self.options.out)?,
            false => Vec::new(),
        };
        if let Some(model) = model {
            let chosen = chosen.unwrap_or_else(|| session.lay_out(&self.setup(Trial::Auto)));
            drop(session);
            let (crowds, figures) = self.crowds(&mut subject, model, &chosen, crowded)?;
            measured.crowds = crowds;
            drawn.extend(figures);
        }
        Ok((measured, drawn))
    }

    /// Returns the row of a setup: that of an earlier run, or as it is measured now.
    fn row(
        &mut self,
        session: &mut Session,
        setup: &Setup,
        name: String,
        measure: &mut dyn FnMut(&mut Session) -> Result<RunRow, String>,
    ) -> Result<RunRow, Failure> {
        (self.progress)(&Step { done: self.step, of: self.steps, name });
        self.step += 1;
        let row = match self.table.known(&session.id(setup)) {
            Some(row) => row.clone(),
            None => {
                self.cooling.iter_mut().for_each(Cooling::wait);
                let row = measure(session).map_err(Failure::Scene)?;
                self.table.append(&row).map_err(Failure::Output)?;
                row
            }
        };
        self.result.failures.extend(failures_of(&row));
        Ok(row)
    }

    fn setup(&self, trial: Trial) -> Setup {
        let mut setup = trial.setup(self.picture());
        if self.options.quick {
            setup.bake.choose.effort = Effort::new(0);
        }
        setup
    }

    fn picture(&self) -> PictureSetup {
        let defaults = PictureSetup::default();
        if self.options.quick { PictureSetup { size: QUICK_SIZE, ..defaults } } else { defaults }
    }
}
