//! The granularity of parallel loops.
//!
//! A command runs inside one thread pool (`cli`), so that a parallel loop starts on a thread of the pool. Loops over
//! expensive elements (meshes, groups, rays) are split down to single elements; loops over cheap ones (vertices, boxes)
//! process at least [`CHEAP_ELEMENTS`] at a time. A loop by [`map`] or [`map_each`] compiles to a twentieth of the code of
//! `collect`, which is generic over all that it does.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

/// Minimum number of cheap elements per task: a loop over fewer than twice as many runs on the thread that starts it.
/// Waking a sleeping thread takes 5 to 50 microseconds, as long as processing some hundred boxes or vertices.
pub(crate) const CHEAP_ELEMENTS: usize = 512;

/// Computes a value for each of `count` expensive elements, given its index; the values are in order.
pub(crate) fn map<T: Send>(count: usize, value: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    let values: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    for_each(count, &|i| *values[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(value(i)));
    let value = |value: Mutex<Option<T>>| value.into_inner().unwrap_or_else(PoisonError::into_inner);
    values.into_iter().map(|of| value(of).expect("computed above")).collect()
}

/// Computes a value for each of many expensive elements; the values are in order.
pub(crate) fn map_each<S: Sync, T: Send>(of: &[S], value: &(dyn Fn(&S) -> T + Sync)) -> Vec<T> {
    map(of.len(), &|i| value(&of[i]))
}

fn for_each(count: usize, act: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(act);
}
