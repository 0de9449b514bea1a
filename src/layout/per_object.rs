//! `per_object`.
use super::{Layout, Options};
use crate::scene::Scene;

pub(super) fn per_object(_scene: &Scene, _options: &Options) -> Layout {
    todo!()
}
