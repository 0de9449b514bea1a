//! glTF 2.0 and GLB.

mod accessor;
mod animation;
pub(crate) mod attributes;
mod binary;
pub(crate) mod contents;
pub(crate) mod edit;
mod extensions;
mod json;
mod merge_key;
mod node;
mod primitive;
mod provenance;
pub(crate) mod read;
mod uri;
pub(crate) mod write;
