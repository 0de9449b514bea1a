//! Times tracers of one layout in turns with the input, so that rows of layouts that are traced minutes apart compare.
//!
//! Each round times the input first and last; the ratio of a tracer to the mean of both cancels a drift of the machine's
//! speed, as in [`crate::verify::speed`]. The median ratio times the input's own time, which is measured once, is the
//! time of the tracer.

use crate::verify::PerKind;
use crate::verify::probe::{Pass, Probe};
use crate::verify::rays::{Ray, RayKind};
use crate::verify::speed::median;
use crate::verify::weights::Weights;

/// The input as its tracers are timed with.
pub(in crate::lab) struct Pace<'a> {
    probe: Box<dyn Probe + 'a>,
    rays: PerKind<Vec<Ray>>,
    /// Seconds of each kind through the input.
    seconds: PerKind<f64>,
    repeats: u32,
}

impl<'a> Pace<'a> {
    /// Times the input.
    ///
    /// # Errors
    /// Those of the tracer.
    pub(in crate::lab) fn new(
        probe: Box<dyn Probe + 'a>,
        rays: PerKind<Vec<Ray>>,
        repeats: u32,
    ) -> Result<Self, String> {
        let seconds = PerKind::try_of(|kind| {
            if rays[kind].is_empty() {
                return Ok(0.0);
            }
            let mut pass = probe.pass(kind, &rays[kind])?;
            pass()?;
            let times: Result<Vec<f64>, String> = (0..repeats.max(1)).map(|_| seconds(&mut pass)).collect();
            times.map(|times| median(&times))
        })?;
        Ok(Pace { probe, rays, seconds, repeats: repeats.max(1) })
    }

    /// Returns the nanoseconds per ray of each tracer, weighted over the kinds.
    ///
    /// # Errors
    /// Those of the tracers.
    pub(super) fn nanoseconds(&self, probes: &[&dyn Probe], weights: &Weights) -> Result<Vec<f64>, String> {
        let kinds = self.kinds(probes)?;
        let of_probe = |i: usize| weights.mean(&kinds.each_ref().map(|times| times[i]));
        Ok((0..probes.len()).map(of_probe).collect())
    }

    /// Returns the nanoseconds per ray of each kind and tracer.
    ///
    /// # Errors
    /// Those of the tracers.
    pub(in crate::lab) fn kinds(&self, probes: &[&dyn Probe]) -> Result<PerKind<Vec<f64>>, String> {
        PerKind::try_of(|kind| self.of_kind(kind, probes))
    }

    fn of_kind(&self, kind: RayKind, probes: &[&dyn Probe]) -> Result<Vec<f64>, String> {
        let rays = &self.rays[kind];
        if rays.is_empty() {
            return Ok(vec![0.0; probes.len()]);
        }
        let mut ratios = vec![Vec::new(); probes.len()];
        let passes: Result<Vec<Pass>, String> = probes.iter().map(|probe| probe.pass(kind, rays)).collect();
        let (mut passes, mut of_input) = (passes?, self.probe.pass(kind, rays)?);
        for pass in &mut passes {
            pass()?;
        }
        let mut before = seconds(&mut of_input)?;
        for _ in 0..self.repeats {
            let times: Result<Vec<f64>, String> = passes.iter_mut().map(seconds).collect();
            let after = seconds(&mut of_input)?;
            let around = 0.5 * (before + after);
            ratios.iter_mut().zip(times?).for_each(|(ratios, time)| ratios.push(time / around));
            before = after;
        }
        let nanoseconds = 1e9 * self.seconds[kind] / rays.len() as f64;
        Ok(ratios.iter().map(|ratios| median(ratios) * nanoseconds).collect())
    }
}

/// Returns the seconds of a pass; a clock that did not advance counts as one nanosecond.
fn seconds(pass: &mut Pass<'_>) -> Result<f64, String> {
    Ok(pass()?.max(1e-9))
}
