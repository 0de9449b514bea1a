//! glTF 2.0 and GLB.

pub(crate) mod attributes;
pub(crate) mod contents;
pub(crate) mod edit;
pub(crate) mod read;
pub(crate) mod write;
