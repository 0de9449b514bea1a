//! Values computed once, on first use.

use std::sync::OnceLock;

/// A value computed once, on first use, from the object that holds it. A clone computes its own, because the object
/// cloned with it may be changed.
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
