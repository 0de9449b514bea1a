//! Proves that a written file shows what the input shows.

pub mod cpu;
