//! Waits for the GPU to cool down between runs, by NVIDIA's management library, which is loaded at run time.

use std::thread::sleep;
use std::time::{Duration, Instant};

use nvml_wrapper::Nvml;
use nvml_wrapper::enum_wrappers::device::TemperatureSensor;

/// Degrees Celsius to which a GPU cools down before a run, as in the thesis.
pub(super) const MAX_TEMPERATURE: f64 = 60.0;

/// Seconds after which a run begins even if the GPU is warmer.
pub(super) const TIMEOUT: f64 = 300.0;

/// Time between two looks at the temperature.
const INTERVAL: Duration = Duration::from_millis(500);

/// Reads the temperature of a GPU.
pub(super) trait Thermometer {
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
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Degrees Celsius.
    pub(super) temperature: f64,
    /// Seconds.
    pub(super) timeout: f64,
}

/// Waits between runs, and collects what to say about it, each sentence once.
pub(super) struct Cooling {
    thermometer: Option<Box<dyn Thermometer>>,
    limits: Limits,
    notes: Vec<String>,
}

impl Cooling {
    /// Opens the management library.
    pub(super) fn open(limits: Limits) -> Cooling {
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
    pub(super) fn wait(&mut self) {
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
    pub(super) fn into_notes(self) -> Vec<String> {
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
