//! `overlap`.
use super::{Layout, Options};
use crate::scene::Scene;

pub(super) fn overlap(_scene: &Scene, _options: &Options) -> Layout {
    todo!()
}
