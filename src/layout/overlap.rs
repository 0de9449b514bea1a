//! `overlap`.
use super::{Layout, Options};
use crate::scene::Scene;

pub(super) fn overlap(scene: &Scene, options: &Options) -> Layout {
    super::per_object::per_object(scene, options)
}
