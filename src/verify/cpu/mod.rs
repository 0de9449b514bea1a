//! Tracing on the CPU.

mod arithmetic;
mod boxes;
mod fast;
mod moving;
mod reference;
mod search;
mod tracer;
mod two_level;
mod watertight;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_of_arithmetic;

pub(crate) use moving::{Bottoms, MovingTop};
pub use reference::{Reference, TrueHit};
pub use search::Steps;
pub use tracer::{ComputingTracer, CpuTracer, Precision, Probe};
pub use two_level::{LevelBox, TwoLevel};
