//! Whole-program tests: run the built binary on files. One file per topic, but one binary for all, so that it links
//! once.

mod common;
mod copies;

mod arrows;
mod auto;
mod bad_input;
mod batch;
mod bounds;
mod cache;
mod candidates;
mod cli;
mod compressed;
mod dependencies;
mod determinism;
#[cfg(feature = "vulkan")]
mod device_hits;
mod device_pictures;
#[cfg(feature = "vulkan")]
mod devices;
#[cfg(target_os = "linux")]
mod endings;
#[cfg(feature = "lab")]
mod extreme;
mod far_from_origin;
mod faults;
mod finite;
mod inspect;
mod instancing;
#[cfg(feature = "lab")]
mod lab;
#[cfg(feature = "lab")]
mod motion;
mod mutations;
mod obj;
mod page;
mod peers;
mod plans;
mod records;
mod render;
mod reports;
mod roundtrip;
mod samples;
mod second_reader;
mod store;
mod thesis;
mod validator;
mod verify;
