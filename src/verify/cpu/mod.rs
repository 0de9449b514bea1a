//! Tracing on the CPU.
