//! `bvh`.
use super::{Layout, Options};
use crate::scene::Scene;

pub(super) fn bvh(_scene: &Scene, _options: &Options) -> Layout {
    todo!()
}
