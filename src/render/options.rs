//! [`RenderOptions`].

use super::{ColourMap, Masks, RenderError, View};
use crate::scene::LoadOptions;
pub use crate::verify::rays::shot::Light;

/// Largest width or height of a picture, in pixels.
pub const MOST_SIDE: u32 = 16_384;
/// Largest number of pixels: a picture takes up to 24 bytes of memory per pixel.
pub const MOST_PIXELS: u64 = 1 << 25;
/// Largest number of samples per pixel.
pub const MOST_SAMPLES: u32 = 4096;

/// How to draw a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples per pixel; `None` for [`View::default_samples`].
    pub samples: Option<u32>,
    /// Seed of the samples.
    pub seed: u64,
    /// Colours of values.
    pub colours: ColourMap,
    /// The value with the last colour of the scale; `None` to take it from the picture.
    pub scale: Option<f64>,
    /// Boxes: the depth of the nodes whose boxes are drawn, counted from the root of the TLAS through its leaves into the
    /// BLASes; `None` for the boxes of the instances.
    pub depth: Option<u32>,
    /// Boxes: what is visible.
    pub masks: Masks,
    /// How the files are read.
    pub load: LoadOptions,
    /// Shaded: the area light; `None` for one that suits the scene.
    pub light: Option<Light>,
    /// Shaded: brightness of the light over the default; at least 0. `None` for a picture as bright as it needs: a dark one
    /// then gets more light.
    pub light_power: Option<f64>,
}

impl Default for RenderOptions {
    fn default() -> RenderOptions {
        RenderOptions {
            size: [1280, 720],
            samples: None,
            seed: 1,
            colours: ColourMap::default(),
            scale: None,
            depth: None,
            masks: Masks::default(),
            load: LoadOptions::default(),
            light: None,
            light_power: None,
        }
    }
}

impl RenderOptions {
    /// Checks the options for a view, before any work is done.
    ///
    /// # Errors
    /// The first option that is out of range.
    pub fn check(&self, view: View) -> Result<(), RenderError> {
        self.checked(view).map(drop)
    }

    /// Returns the number of samples per pixel for a view.
    ///
    /// # Errors
    /// The first option that is out of range.
    pub(super) fn checked(&self, view: View) -> Result<u32, RenderError> {
        let size = self.size;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let samples = self.samples.unwrap_or_else(|| view.default_samples());
        match () {
            () if pixels == 0 || pixels > MOST_PIXELS || size[0].max(size[1]) > MOST_SIDE => {
                Err(RenderError::Size { size })
            }
            () if samples == 0 || samples > MOST_SAMPLES => Err(RenderError::Samples(samples)),
            () => match self.scale {
                Some(scale) if !(scale > 0.0 && scale.is_finite()) => Err(RenderError::Scale(scale)),
                _ => match self.light_power {
                    Some(power) if !(power >= 0.0 && power.is_finite()) => Err(RenderError::LightPower(power)),
                    _ => Ok(samples),
                },
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_out_of_range_are_refused() {
        let checked = |options: RenderOptions| options.checked(View::Groups);
        let sized = |size| RenderOptions { size, ..RenderOptions::default() };
        assert_eq!(checked(sized([1, MOST_SIDE])), Ok(4));
        for size in [[0, 9], [9, 0], [MOST_SIDE + 1, 1], [MOST_SIDE, MOST_SIDE]] {
            assert_eq!(checked(sized(size)), Err(RenderError::Size { size }));
        }
        for samples in [0, MOST_SAMPLES + 1] {
            let options = RenderOptions { samples: Some(samples), ..RenderOptions::default() };
            assert_eq!(checked(options), Err(RenderError::Samples(samples)));
        }
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(checked(RenderOptions { scale: Some(scale), ..RenderOptions::default() }).is_err());
        }
    }
}
