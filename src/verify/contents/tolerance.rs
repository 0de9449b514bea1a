//! [`Tolerance`]: how far attributes may be off.

/// How far attributes of a corner may be off before they differ.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tolerance {
    /// Largest displacement of a morph target, over the diagonal of the scene.
    pub position_ratio: f64,
    /// Largest angle between normals or tangents, in radians.
    pub angle: f64,
    /// Largest difference of a texture coordinate, in units of the texture (times the coordinate if that exceeds 1).
    pub texcoord: f64,
    /// Largest difference of a component of a color, from 0 to 1.
    pub color: f64,
    /// Largest difference of a joint's weight, from 0 to 1.
    pub weight: f64,
}

/// Displacements up to this share of the scene are rounding, not quantisation.
const EXACT: f64 = 1e-6;

impl Tolerance {
    /// Returns the tolerance that suits an allowed displacement of positions, over the diagonal of the scene. Up to 1e-6
    /// it is that of rounding once to single precision, and for directions twice what a copy of a mesh may be off
    /// (`copies::TURNED`); above that, it is what tools lose by default: normals of 8 bits, texture
    /// coordinates of 12, colors and weights of 8.
    pub fn for_positions(position_ratio: f64) -> Tolerance {
        if position_ratio <= EXACT {
            return Tolerance { position_ratio, angle: 1e-3, texcoord: 1e-6, color: 1e-6, weight: 1e-6 };
        }
        Tolerance { position_ratio, angle: 0.02, texcoord: 1.0 / 4096.0, color: 1.0 / 255.0, weight: 2.0 / 255.0 }
    }
}

impl Default for Tolerance {
    fn default() -> Self {
        Tolerance::for_positions(EXACT)
    }
}
