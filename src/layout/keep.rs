//! `keep`.
use super::{Layout, Options};
use crate::scene::Scene;

pub(super) fn keep(_scene: &Scene, _options: &Options) -> Layout {
    todo!()
}
