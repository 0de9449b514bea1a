//! Runs one environment on one scene: makes the layout, builds it, and times the rays of a picture through it.

mod measure;
mod moving;
mod row;
mod setup;
mod subject;
mod table;
#[cfg(test)]
mod tests;

pub(super) use measure::{Bench, LaidOut, Session};
pub use moving::MotionRun;
pub use row::{KindRun, RunRow};
pub(super) use setup::{PictureSetup, Setup};
pub(super) use subject::{Instances, Subject, read_instance};
pub(super) use table::{NAMES as RUN_TABLES, RunTable, read as read_rows};
