//! Waits for the GPU to cool down between runs, by NVIDIA's management library, which is loaded at run time.

use std::thread::sleep;
use std::time::{Duration, Instant};

use nvml_wrapper::Nvml;
use nvml_wrapper::enum_wrappers::device::TemperatureSensor;

use crate::verify::{Machine, MachineKind};

/// Degrees Celsius to which a GPU cools down before a run, as in the thesis.
pub(in crate::lab) const MAX_TEMPERATURE: f64 = 60.0;

/// Seconds after which a run begins even if the GPU is warmer.
pub(in crate::lab) const TIMEOUT: f64 = 300.0;

/// Time between two looks at the temperature.
const INTERVAL: Duration = Duration::from_millis(500);

/// Reads the temperature of a GPU.
pub(in crate::lab) trait Thermometer {
    /// Returns the temperature of the warmest GPU in degrees Celsius; `None` if it cannot be read.
    fn celsius(&self) -> Option<f64>;
}

impl Thermometer for Nvml {
    fn celsius(&self) -> Option<f64> {
        let count = self.device_count().ok()?;
        let of = |i| self.device_by_index(i).ok()?.temperature(TemperatureSensor::Gpu).ok().map(f64::from);
        (0..count).filter_map(of).max_by(f64::total_cmp)
    }
}

/// When a run may begin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Degrees Celsius to which the GPU cools down before a run; at least 0.
    pub temperature: f64,
    /// Seconds after which a run begins even if the GPU is warmer; at least 0.
    pub timeout: f64,
}

impl Default for Limits {
    /// Those of the thesis, with a limit on the time.
    fn default() -> Limits {
        Limits { temperature: MAX_TEMPERATURE, timeout: TIMEOUT }
    }
}

/// Waits between runs, and collects what to say about it, each sentence once.
pub(in crate::lab) struct Cooling {
    thermometer: Option<Box<dyn Thermometer>>,
    limits: Limits,
    notes: Vec<String>,
}

impl Cooling {
    /// Opens the management library if anything is traced on a GPU.
    pub(in crate::lab) fn of<'m>(machines: impl IntoIterator<Item = &'m Machine>, limits: Limits) -> Option<Cooling> {
        let is_gpu = |machine: &Machine| machine.name().1 == MachineKind::Gpu;
        machines.into_iter().any(is_gpu).then(|| Cooling::open(limits))
    }

    /// Opens the management library.
    fn open(limits: Limits) -> Cooling {
        match Nvml::init() {
            Ok(nvml) => Cooling::with(Some(Box::new(nvml)), limits),
            Err(why) => {
                let mut cooling = Cooling::with(None, limits);
                cooling
                    .notes
                    .push(format!("runs do not wait for the GPU to cool down: its temperature is unknown ({why})"));
                cooling
            }
        }
    }

    fn with(thermometer: Option<Box<dyn Thermometer>>, limits: Limits) -> Cooling {
        Cooling { thermometer, limits, notes: Vec::new() }
    }

    /// Waits until the GPU is cool enough, or as long as allowed.
    pub(in crate::lab) fn wait(&mut self) {
        self.wait_by(&mut || sleep(INTERVAL));
    }

    fn wait_by(&mut self, pause: &mut dyn FnMut()) {
        let Some(thermometer) = &self.thermometer else { return };
        let start = Instant::now();
        while let Some(celsius) = thermometer.celsius().filter(|celsius| *celsius > self.limits.temperature) {
            if start.elapsed().as_secs_f64() >= self.limits.timeout {
                let Limits { temperature, timeout } = self.limits;
                let note = format!("a run began at {celsius} C, above {temperature} C, after {timeout} s of waiting");
                self.notes.push(note);
                return;
            }
            pause();
        }
    }

    /// Returns what to say about the waiting.
    pub(in crate::lab) fn into_notes(self) -> Vec<String> {
        self.notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;
    use std::rc::Rc;

    struct Falling(Rc<Cell<f64>>);

    impl Thermometer for Falling {
        fn celsius(&self) -> Option<f64> {
            Some(self.0.get())
        }
    }

    fn waiting(timeout: f64) -> (u32, Vec<String>) {
        let (celsius, mut pauses) = (Rc::new(Cell::new(63.0)), 0);
        let limits = Limits { temperature: 60.0, timeout };
        let mut cooling = Cooling::with(Some(Box::new(Falling(celsius.clone()))), limits);
        cooling.wait_by(&mut || {
            pauses += 1;
            celsius.set(celsius.get() - 1.0);
        });
        (pauses, cooling.into_notes())
    }

    #[test]
    fn a_run_waits_until_the_gpu_is_cool_or_time_is_up() {
        assert_eq!(waiting(1e9), (3, Vec::new()));
        let (pauses, notes) = waiting(0.0);
        assert_eq!((pauses, notes), (0, vec!["a run began at 63 C, above 60 C, after 0 s of waiting".into()]));
    }

    #[test]
    fn without_a_thermometer_nothing_waits() {
        let mut cooling = Cooling::with(None, Limits { temperature: 60.0, timeout: 1.0 });
        cooling.wait_by(&mut || panic!("it waits"));
        assert!(cooling.into_notes().is_empty());
    }
}
