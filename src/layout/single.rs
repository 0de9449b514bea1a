//! `single`.
use super::{Layout, Options};
use crate::scene::Scene;

pub(super) fn single(_scene: &Scene, _options: &Options) -> Layout {
    todo!()
}
