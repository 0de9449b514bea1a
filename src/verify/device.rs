//! The tracer of a verification: a Vulkan device or the CPU.

#[cfg(feature = "vulkan")]
use super::{
    Tracers, WhyCpu,
    cpu::{Reference, TwoLevel},
    verify_with,
    vulkan::{Device, DeviceInfo, Error, Options, Pipelines, Vulkan, VulkanTracer, Wanted},
};
use serde::Serialize;

use super::batch::BatchTracer;
#[cfg(feature = "vulkan")]
use super::build::BuildOptions;
use super::{Exact, Note, Sides, Verification, VerifyOptions, verify_on_cpu};
use crate::cost::mesh_trees::MeshTrees;
use crate::scene::Scene;

/// The device to trace on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum DeviceChoice {
    /// The first hardware device that can trace rays, or the CPU if there is none.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// The Vulkan device at this position in the list.
    Index(usize),
    /// The first Vulkan device whose name contains this text, ignoring case.
    Name(String),
}

impl From<&str> for DeviceChoice {
    fn from(word: &str) -> DeviceChoice {
        match (word, word.parse()) {
            ("auto", _) => DeviceChoice::Auto,
            ("cpu", _) => DeviceChoice::Cpu,
            (_, Ok(index)) => DeviceChoice::Index(index),
            (name, Err(_)) => DeviceChoice::Name(name.to_owned()),
        }
    }
}

/// A requested device cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("--device: {reason}")]
pub struct DeviceError {
    reason: String,
    /// Whether the scene is too large for it.
    lacks_room: bool,
}

#[cfg(feature = "vulkan")]
impl From<Error> for DeviceError {
    fn from(error: Error) -> DeviceError {
        let lacks_room = matches!(error, Error::OutOfMemory { .. } | Error::Limit { .. });
        DeviceError { reason: error.to_string(), lacks_room }
    }
}

/// The kind of a [`Machine`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum MachineKind {
    /// A Vulkan hardware device.
    Gpu,
    /// A Vulkan driver that runs on the CPU.
    #[serde(rename = "software driver")]
    SoftwareDriver,
    /// The tracer of this program.
    #[default]
    Cpu,
}

impl MachineKind {
    /// Returns the name used in reports.
    pub fn name(self) -> &'static str {
        match self {
            MachineKind::Gpu => "gpu",
            MachineKind::SoftwareDriver => "software driver",
            MachineKind::Cpu => "cpu",
        }
    }
}

/// A device to trace on.
#[derive(Debug)]
pub struct Machine {
    #[cfg(feature = "vulkan")]
    pub(super) device: Option<Device>,
    /// Whether the device was requested explicitly, so that its failure is an error.
    #[cfg(feature = "vulkan")]
    named: bool,
    notes: Vec<Note>,
}

#[cfg(feature = "vulkan")]
impl Machine {
    /// Opens the chosen device; [`DeviceChoice::Auto`] falls back to the CPU.
    ///
    /// # Errors
    /// Fails if a requested device does not exist or cannot trace rays.
    pub fn open(choice: &DeviceChoice) -> Result<Machine, DeviceError> {
        let wanted = match choice {
            DeviceChoice::Cpu => return Ok(Machine { device: None, named: false, notes: Vec::new() }),
            DeviceChoice::Auto => {
                return Ok(match open_hardware() {
                    Ok(device) => Machine { device: Some(device), named: false, notes: Vec::new() },
                    Err(why) => Machine { device: None, named: false, notes: vec![Note::OnCpu(why)] },
                });
            }
            DeviceChoice::Index(index) => Wanted::Index(*index),
            DeviceChoice::Name(name) => Wanted::Name(name.clone()),
        };
        let device = Vulkan::load(Options::from_env()).and_then(|vulkan| vulkan.open(&wanted));
        Ok(Machine { device: Some(device?), named: true, notes: Vec::new() })
    }

    /// Returns the name and kind of the device.
    pub fn name(&self) -> (&str, MachineKind) {
        match self.device.as_ref().map(Device::info) {
            None => ("CPU", MachineKind::Cpu),
            Some(info) if info.is_software => (&info.name, MachineKind::SoftwareDriver),
            Some(info) => (&info.name, MachineKind::Gpu),
        }
    }

    /// Returns name and version of the driver; empty for the CPU.
    pub fn driver(&self) -> &str {
        self.device.as_ref().map_or("", |device| &device.info().driver)
    }

    /// Wraps an opened device; `named` says whether to treat it as requested explicitly.
    #[cfg(test)]
    pub(super) fn of(device: Device, named: bool) -> Machine {
        Machine { device: Some(device), named, notes: Vec::new() }
    }

    /// Returns the peak use of device memory, in bytes.
    #[cfg(test)]
    pub(super) fn device_peak(&self) -> u64 {
        self.device.as_ref().map_or(0, Device::peak_memory)
    }

    /// Like [`Machine::verify`] of the second scene against the first, with given trees of their meshes, and the
    /// results of comparing them exhaustively.
    ///
    /// # Errors
    /// See [`Machine::verify`].
    pub fn verify_with(
        &self,
        scenes: Sides<&Scene>,
        trees: Sides<&MeshTrees>,
        exact: Option<&Exact>,
        options: &VerifyOptions,
    ) -> Result<Verification, DeviceError> {
        let mut notes = self.notes.clone();
        let found = match self.device.as_ref().map(|device| verify_on(device, scenes, trees.before, exact, options)) {
            None => verify_on_cpu(scenes, trees, exact, options),
            Some(Ok((found, note))) => {
                notes.extend(note);
                found
            }
            Some(Err(e)) => {
                notes.push(self.excused(e.into())?);
                verify_on_cpu(scenes, trees, exact, options)
            }
        };
        let notes = [notes, found.notes].concat();
        Ok(Verification { notes, ..found })
    }

    /// Draws with the device's tracers of some scenes, or with none on the CPU; returns also what was done otherwise than
    /// asked. If the device cannot handle the scenes, the CPU does.
    ///
    /// # Errors
    /// See [`Machine::verify`].
    pub fn draw_with<R>(
        &self,
        scenes: &[&Scene],
        mut draw: impl FnMut(&[&dyn BatchTracer]) -> Result<R, DeviceError>,
    ) -> Result<(R, Vec<Note>), DeviceError> {
        let mut notes = self.notes.clone();
        let Some(device) = &self.device else { return Ok((draw(&[])?, notes)) };
        match draw_on(device, scenes, &mut draw) {
            Ok(drawn) => Ok((drawn, notes)),
            Err(e) => {
                notes.push(self.excused(e)?);
                Ok((draw(&[])?, notes))
            }
        }
    }

    /// Returns the note on a failure of the device after which the CPU takes over.
    ///
    /// # Errors
    /// The failure itself, if the device was requested and the scene is not too large for it.
    fn excused(&self, failure: DeviceError) -> Result<Note, DeviceError> {
        if self.named && !failure.lacks_room { Err(failure) } else { Ok(Note::OnCpu(WhyCpu::Failed(failure.reason))) }
    }
}

#[cfg(feature = "vulkan")]
fn draw_on<R>(
    device: &Device,
    scenes: &[&Scene],
    draw: &mut impl FnMut(&[&dyn BatchTracer]) -> Result<R, DeviceError>,
) -> Result<R, DeviceError> {
    let pipelines = Pipelines::new(device)?;
    let build = |scene: &&Scene| VulkanTracer::new(&pipelines, scene, BuildOptions::default());
    let tracers = scenes.iter().map(build).collect::<Result<Vec<_>, _>>()?;
    let tracers: Vec<&dyn BatchTracer> = tracers.iter().map(|tracer| tracer as &dyn BatchTracer).collect();
    draw(&tracers)
}

#[cfg(feature = "vulkan")]
fn open_hardware() -> Result<Device, WhyCpu> {
    let failed = |e: Error| WhyCpu::Failed(e.to_string());
    let vulkan = Vulkan::load(Options::from_env()).map_err(failed)?;
    let devices = vulkan.devices().map_err(failed)?;
    match devices.iter().find(|d| d.can_trace() && !d.is_software) {
        Some(device) => vulkan.open(&Wanted::Index(device.index)).map_err(failed),
        None => Err(no_hardware(&devices)),
    }
}

#[cfg(feature = "vulkan")]
fn no_hardware(devices: &[DeviceInfo]) -> WhyCpu {
    let software: Vec<String> = devices.iter().filter(|d| d.can_trace()).map(|d| d.name.clone()).collect();
    if software.is_empty() { WhyCpu::NoDevice } else { WhyCpu::OnlySoftware(software) }
}

/// Verifies on a device; adds a note if both layouts do not fit its memory at once. The reference trees are built while
/// the device builds its own.
#[cfg(feature = "vulkan")]
fn verify_on(
    device: &Device,
    scenes: Sides<&Scene>,
    trees_before: &MeshTrees,
    exact: Option<&Exact>,
    options: &VerifyOptions,
) -> Result<(Verification, Option<Note>), Error> {
    let Sides { before, after } = scenes;
    std::thread::scope(|scope| {
        let trees = scope.spawn(|| TwoLevel::build_with(before, trees_before));
        let pipelines = Pipelines::new(device)?;
        let build = |scene| VulkanTracer::new(&pipelines, scene, options.build);
        let both = build(before).and_then(|first| Ok(Sides { before: first, after: build(after)? }));
        let trees = trees.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        let reference = Reference::new(&trees);
        let verify = |tracers: Tracers<'_, _>| verify_with(scenes, exact, &reference, tracers, options);
        match both.and_then(|both| verify(Tracers::Together(both.as_ref()))) {
            Err(why @ Error::OutOfMemory { .. }) => {
                let found = verify(Tracers::OneByOne(Sides { before: &|| build(before), after: &|| build(after) }))?;
                Ok((found, Some(Note::NotInTurns(why.to_string()))))
            }
            found => Ok((found?, None)),
        }
    })
}

#[cfg(not(feature = "vulkan"))]
impl Machine {
    /// Opens the CPU.
    ///
    /// # Errors
    /// Fails for any other device.
    pub fn open(choice: &DeviceChoice) -> Result<Machine, DeviceError> {
        match choice {
            DeviceChoice::Auto | DeviceChoice::Cpu => Ok(Machine { notes: Vec::new() }),
            _ => {
                let reason = "this program was built without Vulkan; use `auto` or `cpu`".into();
                Err(DeviceError { reason, lacks_room: false })
            }
        }
    }

    /// Returns the name and kind of the device.
    pub fn name(&self) -> (&str, MachineKind) {
        ("CPU", MachineKind::Cpu)
    }

    /// Returns name and version of the driver; empty for the CPU.
    pub fn driver(&self) -> &str {
        ""
    }

    /// Like [`Machine::verify`] of the second scene against the first, with given trees of their meshes, and the
    /// results of comparing them exhaustively.
    ///
    /// # Errors
    /// None.
    pub fn verify_with(
        &self,
        scenes: Sides<&Scene>,
        trees: Sides<&MeshTrees>,
        exact: Option<&Exact>,
        options: &VerifyOptions,
    ) -> Result<Verification, DeviceError> {
        Ok(Verification { notes: self.notes.clone(), ..verify_on_cpu(scenes, trees, exact, options) })
    }

    /// Draws on the CPU.
    ///
    /// # Errors
    /// None of its own.
    pub fn draw_with<R>(
        &self,
        _scenes: &[&Scene],
        mut draw: impl FnMut(&[&dyn BatchTracer]) -> Result<R, DeviceError>,
    ) -> Result<(R, Vec<Note>), DeviceError> {
        Ok((draw(&[])?, self.notes.clone()))
    }
}

impl Machine {
    /// Verifies `after` against `before`. If the device cannot hold the structures of both, it handles them one after
    /// the other; if it cannot handle the scenes at all, the CPU does. A note says so.
    ///
    /// # Errors
    /// Fails if a requested device fails for another reason.
    pub fn verify(&self, before: &Scene, after: &Scene, options: &VerifyOptions) -> Result<Verification, DeviceError> {
        let (none, scenes) = (&MeshTrees::default(), Sides { before, after });
        let exact = Exact::of_scenes(scenes, options);
        self.verify_with(scenes, Sides { before: none, after: none }, exact.as_ref(), options)
    }

    /// What it does otherwise than asked.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }
}

/// Lists the Vulkan devices of this machine.
///
/// # Errors
/// Describes why Vulkan is not available.
#[cfg(feature = "vulkan")]
pub fn list() -> Result<Vec<DeviceInfo>, String> {
    let listed = Vulkan::load(Options::from_env()).and_then(|vulkan| vulkan.devices());
    listed.map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_choose_a_device() {
        assert_eq!(DeviceChoice::from("auto"), DeviceChoice::Auto);
        assert_eq!(DeviceChoice::from("cpu"), DeviceChoice::Cpu);
        assert_eq!(DeviceChoice::from("2"), DeviceChoice::Index(2));
        assert_eq!(DeviceChoice::from("llvmpipe"), DeviceChoice::Name("llvmpipe".into()));
    }

    #[test]
    fn a_device_that_is_not_there_is_an_error_by_its_name() {
        let error = Machine::open(&DeviceChoice::Name("no such device".into())).expect_err("there is none");
        assert!(error.to_string().starts_with("--device: "), "{error}");
    }

    #[test]
    fn the_cpu_needs_no_excuse() {
        let found = Machine::open(&DeviceChoice::Cpu)
            .and_then(|m| m.verify(&Scene::default(), &Scene::default(), &VerifyOptions::default()))
            .expect("nothing can fail");
        assert!(found.passed() && found.notes.is_empty());
    }
}
