//! What pictures ask of rays: answered on the CPU at once, or on a device in batches.
//!
//! A picture asks for one ray after the other, and each depends on the answers before; a device traces many rays at once.
//! On a device a sample is therefore computed repeatedly, each time with the answers known so far, until it asks for a ray
//! that has not been traced. The rays that the samples wait for are traced together. As a sample depends on its answers
//! alone, its last run computes what it would have on the CPU, by the same code.

use rayon::prelude::*;

use super::frame::{BATCH, Sample};
use crate::verify::batch::BatchTracer;
use crate::verify::cpu::{self, CpuTracer};
use crate::verify::rays::Ray;
use crate::verify::{DeviceError, Hit};

/// What traces the rays of a picture.
pub(super) enum Tracing<'t> {
    Cpu(CpuTracer<'t>),
    Device(&'t dyn BatchTracer),
}

/// Answers the questions of one sample after the other on one thread.
pub(super) enum Probe<'p> {
    Cpu(cpu::Probe<'p>),
    Device(&'p mut Answers),
}

impl Probe<'_> {
    /// Returns the first hit of a ray that `counts` accepts, which is asked in no particular order.
    pub(super) fn closest(&mut self, ray: &Ray, counts: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        match self {
            Probe::Cpu(probe) => probe.closest(ray, counts),
            Probe::Device(answers) => answers.closest(ray, counts),
        }
    }

    /// Returns a hit of a ray that `counts` accepts, not necessarily the first; `counts` is asked about each hit at most
    /// once.
    pub(super) fn any(&mut self, ray: &Ray, counts: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        match self {
            Probe::Cpu(probe) => probe.any(ray, counts),
            Probe::Device(answers) => answers.closest(ray, counts),
        }
    }

    /// Puts all hits of a ray into `hits`, nearest first.
    pub(super) fn all(&mut self, ray: &Ray, hits: &mut Vec<Hit>) {
        hits.clear();
        match self {
            Probe::Cpu(probe) => {
                // No hit is accepted, so all are found.
                probe.closest(ray, |hit| {
                    hits.push(*hit);
                    false
                });
                hits.sort_unstable_by(Hit::nearer);
            }
            Probe::Device(answers) => hits.extend(answers.all(ray)),
        }
    }
}

/// What is known of the rays of one sample.
#[derive(Default)]
pub(super) struct Answers {
    known: Vec<Answer>,
    /// The next one to be given.
    next: usize,
    /// The ray that is asked for and not known.
    wanted: Option<Question>,
}

enum Answer {
    First(Option<Hit>),
    All(Vec<Hit>),
}

#[derive(Clone, Copy)]
enum Question {
    First(Ray),
    All(Ray),
}

impl Answers {
    /// Returns the next answer. Without it, what the sample computes is discarded, so any value will do.
    fn next(&mut self, question: Question) -> Option<&Answer> {
        if self.wanted.is_none() && self.next == self.known.len() {
            self.wanted = Some(question);
        }
        if self.wanted.is_some() {
            return None;
        }
        self.next += 1;
        self.known.get(self.next - 1)
    }

    /// Most rays end at their first hit; only the others need all of them.
    fn closest(&mut self, ray: &Ray, mut counts: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let Some(&Answer::First(Some(first))) = self.next(Question::First(*ray)) else { return None };
        if counts(&first) {
            return Some(first);
        }
        let is_other = |hit: &&Hit| (hit.instance, hit.triangle) != (first.instance, first.triangle);
        self.all(ray).iter().filter(is_other).find(|hit| counts(hit)).copied()
    }

    fn all(&mut self, ray: &Ray) -> &[Hit] {
        match self.next(Question::All(*ray)) {
            Some(Answer::All(hits)) => hits,
            _ => &[],
        }
    }
}

/// A sample and how far it is.
struct Run<T> {
    sample: Sample,
    answers: Answers,
    value: Option<T>,
}

/// Computes something of samples whose rays a device traces.
///
/// # Errors
/// Fails if the device does.
pub(super) fn on_device<T: Send>(
    device: &dyn BatchTracer,
    samples: impl Iterator<Item = Sample>,
    of_sample: &(impl Fn(&mut Probe, &Sample) -> T + Sync),
) -> Result<Vec<T>, DeviceError> {
    let mut runs: Vec<Run<T>> =
        samples.map(|sample| Run { sample, answers: Answers::default(), value: None }).collect();
    loop {
        runs.par_iter_mut().with_min_len(BATCH).filter(|run| run.value.is_none()).for_each(|run| {
            run.answers.next = 0;
            let value = of_sample(&mut Probe::Device(&mut run.answers), &run.sample);
            run.value = run.answers.wanted.is_none().then_some(value);
        });
        if !answer(device, &mut runs)? {
            return Ok(runs.into_iter().filter_map(|run| run.value).collect());
        }
    }
}

/// Traces the rays that are asked for; returns whether there were any.
fn answer<T>(device: &dyn BatchTracer, runs: &mut [Run<T>]) -> Result<bool, DeviceError> {
    let (mut first, mut all) = (Vec::new(), Vec::new());
    for run in runs.iter() {
        match run.answers.wanted {
            Some(Question::First(ray)) => first.push(ray),
            Some(Question::All(ray)) => all.push(ray),
            None => {}
        }
    }
    let is_any = !(first.is_empty() && all.is_empty());
    let mut first = device.closest(&first)?.into_iter().map(Answer::First);
    let mut all = device.all(&all)?.into_iter().map(Answer::All);
    for run in runs {
        let answer = match run.answers.wanted.take() {
            Some(Question::First(_)) => first.next(),
            Some(Question::All(_)) => all.next(),
            None => None,
        };
        run.answers.known.extend(answer);
    }
    Ok(is_any)
}
