//! `bvh`.
use super::{Layout, Options};
use crate::scene::Scene;

pub(super) fn bvh(scene: &Scene, options: &Options) -> Layout {
    super::per_object::per_object(scene, options)
}
