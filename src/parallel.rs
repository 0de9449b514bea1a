//! The granularity of parallel loops.
//!
//! A command runs inside one thread pool (`cli`), so that a parallel loop starts on a thread of the pool. Loops over
//! expensive elements (meshes, groups, rays) are split down to single elements; loops over cheap ones (vertices, boxes)
//! process at least [`CHEAP_ELEMENTS`] at a time.

/// Minimum number of cheap elements per task: a loop over fewer than twice as many runs on the thread that starts it.
/// Waking a sleeping thread takes 5 to 50 microseconds, as long as processing some hundred boxes or vertices.
pub(crate) const CHEAP_ELEMENTS: usize = 512;
