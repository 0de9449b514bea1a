//! Raykiln bakes scenes for hardware ray tracing.
//!
//! The modules stand in the order of the data flow; arrows run one way, top to bottom:
//! [`scene`] (what a ray tracer sees), [`copies`] (meshes that are copies of others), [`cost`] (trees and metrics),
//! [`layout`] (which triangles share a BLAS), [`emit`] (a layout made into a document), [`verify`] (rays through before
//! and after), [`report`], [`choose`] (which layout to write), the commands [`bake`], [`mod@compare`], [`inspect`] and
//! [`lab`], and [`cli`].
//! Reading and writing files is the crate `raykiln-formats`.

pub mod bake;
pub mod choose;
pub mod cli;
pub mod compare;
pub mod copies;
pub mod cost;
pub mod emit;
pub mod inspect;
pub mod lab;
pub mod layout;
pub mod report;
pub mod scene;
pub mod verify;
mod words;
