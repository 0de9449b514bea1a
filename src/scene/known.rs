//! What is computed once, when it is first asked for.

use std::sync::OnceLock;

/// A value computed once, when it is first asked for, from what holds it. A clone computes its own, for what it is cloned
/// with may be changed.
#[derive(Debug)]
pub struct Known<T>(OnceLock<T>);

impl<T> Known<T> {
    pub(super) fn get_or(&self, compute: impl FnOnce() -> T) -> &T {
        self.0.get_or_init(compute)
    }
}

impl<T> Default for Known<T> {
    fn default() -> Self {
        Known(OnceLock::new())
    }
}

impl<T> Clone for Known<T> {
    fn clone(&self) -> Self {
        Known::default()
    }
}
