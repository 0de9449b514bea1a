//! Things that move: crowds of animated instances, a camera that revolves, and a scene at any time.
//!
//! [`Crowd`] places copies of a model at random and gives some of them an [`Animation`]; [`MovingScene`] adds them to a
//! scene and moves them; [`Orbit`] is the camera. Everything is a function of seed and time, in double precision, the
//! same for any number of threads. `docs/motion.md` defines every number. This is the moving part of the experiments of
//! T. Bilak, "Scene optimization for RTX", master's thesis, Czech Technical University, 2024, chapters 4.4 and 5.

pub mod advice;
mod animation;
mod crowd;
pub mod frames;
mod moving_scene;
mod orbit;
mod rig;

pub use animation::{Animation, BadAnimation};
pub use crowd::{Crowd, Deviating, PlacedCopies};
pub use moving_scene::MovingScene;
pub use orbit::Orbit;
pub use rig::{Playing, Rig};
