//! Raykiln bakes scenes for hardware ray tracing.
//!
//! The modules stand in the order of the data flow; arrows run one way, from the last to the first: [`scene`] (what a
//! ray tracer sees), [`tree`] (trees over boxes), [`layout`] (which triangles share a BLAS), [`cost`] (metrics),
//! [`methods`] (how layouts are made), [`verify`] (rays through before and after), [`copies`] (meshes that are copies of
//! others), [`emit`] (a layout made into a document), [`choose`] (which layout to write), [`report`], [`commands`],
//! [`lab`] and [`cli`].
//! Reading and writing files is the crate `raykiln-formats`.

pub mod choose;
#[cfg(feature = "cli")]
pub mod cli;
pub mod commands;
pub mod copies;
pub mod cost;
pub mod emit;
#[cfg(feature = "lab")]
pub mod lab;
pub mod layout;
pub mod methods;
mod parallel;
pub mod report;
pub mod scene;
pub mod tree;
pub mod verify;
mod words;
