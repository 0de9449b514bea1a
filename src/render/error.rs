//! [`RenderError`].

use super::boxes::MOST_BOXES;
use super::camera::BadCamera;
use super::options::{MOST_PIXELS, MOST_SAMPLES, MOST_SIDE};
use crate::verify::DeviceError;

/// Why a picture cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// There is nothing to see.
    #[error("the scene holds no triangles")]
    Empty,
    /// The picture has no pixels or too many.
    #[error("a picture of {}x{} pixels: each side must be from 1 to {MOST_SIDE}, and there may be at most {MOST_PIXELS} pixels", size[0], size[1])]
    Size {
        /// Width and height.
        size: [u32; 2],
    },
    /// The number of samples is out of range.
    #[error("{0} samples per pixel: the number must be from 1 to {MOST_SAMPLES}")]
    Samples(u32),
    /// The end of the scale is not a positive number.
    #[error("the scale must end at a finite number above 0, not at {0}")]
    Scale(f64),
    /// The brightness of the light is not a number of at least 0.
    #[error("the brightness of the light must be a finite number of at least 0, not {0}")]
    LightPower(f64),
    /// There are too many boxes to be told apart.
    #[error("{}; at most {MOST_BOXES} are drawn", too_many(*count, *depth))]
    Boxes {
        /// Their number; one more than the largest if it is not known.
        count: usize,
        /// Their depth; `None` for the boxes of instances.
        depth: Option<u32>,
    },
    /// The camera shows nothing.
    #[error(transparent)]
    Camera(#[from] BadCamera),
    /// The device that traces the rays failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

fn too_many(count: usize, depth: Option<u32>) -> String {
    match depth {
        Some(depth) => format!("at depth {depth} the tree has at least {count} boxes"),
        None => format!("the scene has {count} instances with a box each"),
    }
}
