//! glTF 2.0 and GLB.

pub(crate) mod accessor;
pub(crate) mod alpha;
mod animation;
pub(crate) mod attributes;
pub(crate) mod binary;
pub(crate) mod compact;
mod compressed;
pub(crate) mod contents;
mod cut;
pub(crate) mod edit;
pub(crate) mod extensions;
mod images;
pub(crate) mod json;
mod limits;
mod merge_key;
mod node;
pub(crate) mod outline;
mod pack;
mod positions;
mod primitive;
pub(crate) mod properties;
mod provenance;
pub(crate) mod read;
pub(crate) mod references;
pub(crate) mod staged;
mod uri;
pub(crate) mod write;
