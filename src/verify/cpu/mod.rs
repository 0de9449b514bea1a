//! Tracing on the CPU.

mod boxes;
mod reference;
mod search;
mod tracer;
mod two_level;
mod watertight;

#[cfg(test)]
mod tests;

pub use reference::{Reference, TrueHit};
pub use search::Steps;
pub use tracer::CpuTracer;
pub use two_level::TwoLevel;
