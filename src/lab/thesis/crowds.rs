//! The setups with instances: 10^3, 10^4 and 10^5 copies of a model at random places.
//!
//! Rays are timed at the beginning of the motion, and then frame by frame while the instances move. The experiment
//! `[motion]` compares policies of refitting and rebuilding.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::measured::{Crowded, Measured};
use super::trials::Trial;
use super::{Experiments, Failure, pictures};
use crate::lab::bench::{Instances, LaidOut, RunRow, Session, Setup, Subject, read_instance};
use crate::motion::{Crowd, Deviating};
use crate::report::study::Figure;
use crate::scene::Scene;

/// Numbers of instances of the last experiment, and of the third.
const COMPARED: [usize; 2] = [1_000, 10_000];
const MOST: usize = 100_000;

/// A quick run has as many times fewer.
const QUICK: usize = 500;

/// Speed, way and turns of instances: shares of the diagonal of the scene per second and of it, and turns per second.
const SPEED: Deviating = Deviating { base: 0.05, deviation: 0.02 };
const DISTANCE: Deviating = Deviating { base: 0.1, deviation: 0.05 };
const TURNS: Deviating = Deviating { base: 0.1, deviation: 0.05 };

/// Frames from one rebuild of the TLAS to the next, so that refits and rebuilds are both timed; of a quick run.
const REBUILD_INTERVAL: u32 = 8;
const QUICK_INTERVAL: u32 = 2;

/// The model of instances, below the folder of scenes: the Stanford bunny, as in the thesis.
const MODEL: &str = "bunny/bunny.obj";

/// Returns the numbers of instances of the last experiment.
pub(super) fn compared(quick: bool) -> [usize; 2] {
    COMPARED.map(|count| if quick { count / QUICK } else { count })
}

/// Returns the number of instances of the third experiment.
pub(super) fn most(quick: bool) -> usize {
    if quick { MOST / QUICK } else { MOST }
}

/// Returns the number of runs with instances per scene.
pub(super) fn runs() -> usize {
    COMPARED.len() * Trial::COMPARED.len() + 2
}

/// Returns the numbers of instances of rows, ascending: those of the last experiment, then that of the third.
pub(super) fn counts(measured: &[Measured]) -> Vec<usize> {
    let all = measured.iter().flat_map(|scene| &scene.crowds).map(|crowded| crowded.instances);
    all.collect::<BTreeSet<_>>().into_iter().collect()
}

/// What rows of the instances without the scene are named.
pub(super) const ALONE: &str = "instances only";

/// What the names of rows with instances end with.
pub(super) fn suffix(instances: usize) -> String {
    format!(", {instances} instances")
}

/// Reads the model of instances; a quick run takes a scene instead if it is not at hand.
///
/// # Errors
/// Why there is none, in words.
pub(super) fn model(folder: &Path, quick: bool, otherwise: &Path) -> Result<Scene, String> {
    let bunny: PathBuf = folder.join(MODEL);
    let path = if bunny.is_file() || !quick { &bunny } else { otherwise };
    if !path.is_file() {
        return Err(format!("{}: no such file; it is the model of the instances", path.display()));
    }
    read_instance(path).map(|(model, _)| model).map_err(|e| e.to_string())
}

impl Experiments<'_, '_> {
    /// Runs the setups with instances on a scene, and draws them if asked for. `chosen` is what `bake` chooses without them.
    pub(super) fn crowds(
        &mut self,
        subject: &mut Subject,
        model: &Scene,
        chosen: &LaidOut,
        drawn: bool,
    ) -> Result<(Vec<Crowded>, Vec<Figure>), Failure> {
        let (quick, mut crowds, mut figures) = (self.options.quick, Vec::new(), Vec::new());
        let [few, many] = compared(quick);
        for instances in [few, many, most(quick)] {
            let copies = crowd(instances, &subject.scene).place(&subject.scene.core().bounds());
            subject.instances = Some(Instances { model: model.clone(), copies });
            let mut session = Session::new(self.bench, subject).map_err(Failure::Scene)?;
            let trials: Vec<Option<Trial>> = match instances == most(quick) {
                true => vec![Some(Trial::Single), None],
                false => Trial::COMPARED.map(Some).to_vec(),
            };
            for trial in trials {
                let row = self.crowded(&mut session, instances, trial, chosen)?;
                crowds.push(Crowded { instances, trial, row });
            }
            if drawn {
                figures.push(pictures::crowd(&session, instances, self.picture(), &self.options.out)?);
            }
        }
        Ok((crowds, figures))
    }

    fn crowded(
        &mut self,
        session: &mut Session,
        instances: usize,
        trial: Option<Trial>,
        chosen: &LaidOut,
    ) -> Result<RunRow, Failure> {
        let name = trial.map_or_else(|| ALONE.to_owned(), Trial::name) + &suffix(instances);
        let setup = self.setup(trial.unwrap_or(Trial::Single));
        let rebuild_interval = if self.options.quick { QUICK_INTERVAL } else { REBUILD_INTERVAL };
        let setup = Setup { name, rebuild_interval, ..setup };
        let step = format!("{}: {}", session.subject.name, setup.name);
        self.row(session, &setup, step, &mut |session| match trial {
            Some(Trial::Auto) => session.run_laid(&setup, chosen),
            Some(_) => session.run(&setup),
            None => session.run_alone(&setup),
        })
    }
}

fn crowd(instances: usize, scene: &Scene) -> Crowd {
    let diagonal = scene.core().bounds().diagonal();
    let scaled = |of: Deviating| Deviating { base: of.base * diagonal, deviation: of.deviation * diagonal };
    Crowd {
        copies: instances,
        animated: instances,
        speed: scaled(SPEED),
        distance: scaled(DISTANCE),
        turns: TURNS,
        seed: super::SEED,
    }
}

/// Creates the folder of figures.
pub(super) fn create(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|e| Failure::Output(crate::lab::LabError::file(folder, e)))
}
