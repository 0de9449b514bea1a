//! Raykiln bakes scenes for hardware ray tracing.
//!
//! The modules stand in the order of the data flow; arrows run one way, top to bottom:
//! [`scene`] (what a ray tracer sees), [`cost`] (trees and metrics), [`layout`] (which triangles share a BLAS),
//! [`bake`] (a layout made into a document), [`verify`] (rays through before and after), [`report`], [`cli`].
//! Reading and writing files is the crate `raykiln-formats`.

pub mod bake;
pub mod cli;
pub mod compare;
pub mod cost;
pub mod emit;
pub mod inspect;
pub mod layout;
pub mod report;
pub mod scene;
pub mod verify;
