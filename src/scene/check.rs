//! The invariants of a [`Scene`].
use super::Scene;

/// The first broken invariant of a scene, in words.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Broken(pub String);

impl Scene {
    /// Names the first broken invariant.
    ///
    /// # Errors
    /// Whatever the fields' descriptions promise and is not so.
    pub fn check(&self) -> Result<(), Broken> {
        todo!()
    }
}
