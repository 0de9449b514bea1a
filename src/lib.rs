//! Raykiln bakes scenes for hardware ray tracing: it reads OBJ or glTF, decides which triangles share a bottom-level
//! acceleration structure (BLAS), writes glTF whose structure says so, and verifies what it wrote.
//!
//! A bake of a file, and a bake of bytes in memory:
//!
//! ```
//! use raykiln::{BakeOptions, DeviceChoice, Verdict};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let output = folder.path().join("baked.glb");
//! let mut options = BakeOptions::default();
//! options.verify.device = DeviceChoice::Cpu;
//! # (options.verify.rays_per_kind, options.verify.timed_rays_per_kind, options.verify.repeats) = (500, Some(500), 1);
//! let report = raykiln::bake("samples/staggered/scene.glb", &output, &options)?;
//! println!(
//!     "{}: two-level cost {:.2}, was {:.2}",
//!     report.method.chosen, report.after.two_level_cost, report.before.two_level_cost
//! );
//! # assert_ne!(report.verdict, Verdict::Failed);
//! # assert!(output.exists());
//!
//! let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
//! let baked = raykiln::bake_bytes("triangle.obj", triangle, &options)?;
//! assert!(baked.glb.is_some_and(|glb| glb.starts_with(b"glTF")));
//! # Ok(())
//! # }
//! ```
//!
//! The items on this page are the public interface. Options have defaults and public fields, which a program sets one
//! by one; options, reports and errors may gain fields and variants. Without the feature `cli`, the program and its
//! dependencies are omitted; without `lab`, the experiments; without `vulkan`, the devices: rays are then traced on the
//! CPU.
//!
//! The modules are public for the tools of this project and may change. They are listed in the order of the data flow;
//! dependencies point one way, from later to earlier modules: [`scene`] (what a ray tracer sees), [`tree`] (trees over
//! boxes), [`layout`] (which triangles share a BLAS), [`cost`] (metrics), [`methods`] (how layouts are made),
//! [`mod@verify`] (traces rays through input and output), [`copies`] (meshes that are copies of others), [`emit`]
//! (turns a layout into a document), [`cache`] (results on disk), [`choose`] (which layout to write), [`render`] (pictures), [`report`],
//! [`commands`], [`lab`] and [`cli`].
//! The crate `raykiln-formats` reads and writes files.

pub mod cache;
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
pub mod motion;
mod parallel;
pub mod render;
pub mod report;
pub mod scene;
pub mod tree;
pub mod verify;

pub use choose::model::Class as DeviceClass;
pub use choose::plans::Effort;
pub use choose::{Choice, ChooseOptions};
pub use commands::CommandError;
pub use commands::bake::{BakeOptions, FindCopies};
pub use commands::calls::{BakedBytes, bake, bake_bytes, inspect, inspect_bytes, verify};
pub use commands::verify::MatchBy;
pub use methods::Method;
pub use raykiln_formats::{Error as FileError, ErrorKind};
pub use report::{BakeReport, InspectReport, VerifyReport};
pub use scene::LoadOptions;
pub use verify::VerifyOptions;
pub use verify::device::{DeviceChoice, DeviceError};
pub use verify::rays::RayKind;
pub use verify::verdict::Verdict;
pub use verify::weights::Weights;
