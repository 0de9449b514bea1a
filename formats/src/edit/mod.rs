//! Changes to a [`Document`](crate::Document): meshes, nodes, accessors and what the program records in `extras.raykiln`.
//!
//! The methods of `Document` that this module adds are the only way in which the program edits glTF. Meshes, primitives,
//! nodes and accessors are named by their index in the file. A document must have passed
//! [`Document::contents`](crate::Document::contents); a method that is given an index which does not exist panics.

mod accessors;
mod meshes;
mod nodes;
mod prune;
mod record;

pub use accessors::{Compacted, NewAccessor, Target};
pub use meshes::NewPrimitive;
pub use nodes::{CopyAttributes, NewNode};
pub use prune::CannotPrune;
pub use record::RecordPlace;
pub(crate) use record::{has_room, raykiln_extras};
