//! When loops run in parallel.
//!
//! A command runs inside one thread pool (`cli`), so that a parallel loop starts on a thread of the pool. Loops over heavy
//! elements (meshes, groups, rays) are split down to single elements; loops over cheap ones (vertices, boxes) take
//! [`CHEAP_ELEMENTS`] at a time.

/// Fewest cheap elements per task: a loop over fewer than twice as many runs on the thread that starts it. To wake a
/// sleeping thread takes 5 to 50 microseconds, which is what some hundred boxes or vertices take.
pub(crate) const CHEAP_ELEMENTS: usize = 512;
