//! Times candidates that were exported where there was no device.

use std::path::Path;
use std::sync::Mutex;

use super::CommandError;
use crate::choose::{NotTimed, RacedContenders, race_contenders};
use crate::report::exported::CandidatesFile;
use crate::report::plan::PlannedDevice;
use crate::scene::{self, LoadOptions, Scene};
use crate::verify::{Machine, MachineKind, VerifyOptions};

/// Why candidates cannot be timed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TimeError {
    /// A file cannot be read, or the selected device cannot trace rays.
    #[error(transparent)]
    Command(#[from] CommandError),
    /// There is no device.
    #[error(
        "no Vulkan device of this machine traces rays, and times of the CPU say nothing about one: see `raykiln devices`"
    )]
    NoDevice,
    /// The device cannot take the input.
    #[error("{device} cannot take the input: {why}")]
    Refused {
        /// The device.
        device: String,
        /// Its reason.
        why: String,
    },
}

/// Times the candidates of a folder on the device of the options, and fills in the list.
///
/// # Errors
/// Fails if a candidate cannot be read, or there is no device that can take the input.
pub fn time(folder: &Path, list: &mut CandidatesFile, options: &VerifyOptions) -> Result<(), TimeError> {
    let machine = Machine::open(&options.device).map_err(CommandError::from)?;
    let (name, kind) = machine.name();
    if kind == MachineKind::Cpu {
        return Err(TimeError::NoDevice);
    }
    let input = load(&folder.join(&list.candidates[0].file))?;
    let contenders = &list.candidates[1..];
    let as_bytes: Vec<u64> = contenders.iter().map(|entry| entry.as_bytes).collect();
    // Scenes are read one after the other, as they are timed.
    let failure = Mutex::new(None);
    let scene_of = |i: usize| match load(&folder.join(&contenders[i].file)) {
        Ok(scene) => scene,
        Err(why) => {
            failure.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(why);
            Scene::default()
        }
    };
    let raced = match contenders {
        [] => Ok(RacedContenders::default()),
        _ => race_contenders(&input, scene_of, &as_bytes, !list.input_may_win, &machine, options),
    };
    if let Some(why) = failure.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
        return Err(why.into());
    }
    let raced = raced.map_err(|why| match why {
        NotTimed::Failed(why) => TimeError::Refused { device: name.to_owned(), why },
        _ => TimeError::NoDevice,
    })?;
    list.fill_in(&raced, PlannedDevice::new(name, kind, machine.driver()));
    Ok(())
}

fn load(file: &Path) -> Result<Scene, CommandError> {
    let doc = raykiln_formats::read(file)?;
    Ok(scene::load(&doc, &LoadOptions::default())?.0)
}
