//! Shared helpers: running the program, samples, inline files, and an independent glTF reader.

mod damage;
mod expect;
mod files;
mod program;
pub(crate) mod schema;
mod section;
mod surface;

pub(crate) use damage::Opened;
pub(crate) use expect::{Bake, Number, Sample, samples};
pub(crate) use files::{folder_names, glb, gltf, triangle, with_record, write};
pub(crate) use program::{Ran, bake, methods, raykiln};
pub(crate) use section::assert_section;
pub(crate) use surface::{Surface, json_of};
