//! What came of looking for copies, as numbers; [`crate::report`] puts it into words.

use std::collections::BTreeSet;

use super::CopiedMesh;

/// Whether copies are shared, and why.
#[derive(Clone, Debug, PartialEq)]
pub enum Sharing {
    /// No two meshes are alike.
    NoneAlike,
    /// Copies were not looked for: sharing them all would save at most this many predicted bytes.
    NotLookedFor(u64),
    /// Sharing the copies costs too much.
    TooLoose(Count, Looser),
    /// Sharing the copies, some left out, saves too little.
    SavesTooLittle(Saved),
    /// Copies are shared.
    Shared {
        /// What that saves.
        saved: Saved,
        /// Bytes of stored geometry saved.
        stored_bytes: u64,
    },
    /// Copies could be shared, but the input is written as it is.
    InputLeftAlone(Box<Sharing>),
    /// Copies could be shared, but the layout chosen writes all of them out.
    WrittenOut(Box<Sharing>),
}

/// What sharing copies saves.
#[derive(Clone, Debug, PartialEq)]
pub struct Saved {
    /// The copies shared.
    pub shared: Count,
    /// Predicted bytes of acceleration structures saved.
    pub as_bytes: u64,
    /// Copies left out, and what the cost is with them.
    pub left_out: Option<(Count, Looser)>,
}

/// Number of copies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Count {
    /// Meshes that are copies.
    pub copies: usize,
    /// Meshes of which they are copies.
    pub models: usize,
}

/// The predicted two-level cost with turned copies, whose boxes are looser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Looser {
    /// With the copies shared.
    pub cost: f64,
    /// Without.
    pub before: f64,
}

impl Sharing {
    /// Whether the output shares copies.
    pub fn is_applied(&self) -> bool {
        matches!(self, Sharing::Shared { .. })
    }
}

impl Count {
    /// Counts copies and their models.
    pub fn of(list: &[CopiedMesh]) -> Count {
        let models: BTreeSet<_> = list.iter().map(|copy| copy.model).collect();
        Count { copies: list.len(), models: models.len() }
    }
}
