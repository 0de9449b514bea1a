//! Numbers by which equal positions are found.

use glam::DVec3;

/// Returns a number that equal positions share, both zeros being equal. Unequal positions share one with a chance of
/// 2^-64: a caller that must tell them apart compares them afterwards.
pub(crate) fn position_key(position: DVec3) -> u64 {
    // Adding zero turns -0 into 0.
    let bits = position.to_array().map(|x| (x + 0.0).to_bits());
    // Odd factors: the fractions of the square roots of 2, 3 and 5.
    let factors = [0x6a09_e667_f3bc_c909u64, 0xbb67_ae85_84ca_a73b, 0x3c6e_f372_fe94_f82b];
    let [x, y, z] = std::array::from_fn(|axis| bits[axis].wrapping_mul(factors[axis]));
    // The finaliser of MurmurHash3 (A. Appleby).
    let mut key = x ^ y.rotate_left(21) ^ z.rotate_left(42);
    key = (key ^ (key >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    key = (key ^ (key >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    key ^ (key >> 33)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_zeros_are_one_position_and_neighbours_are_not() {
        assert_eq!(position_key(DVec3::new(0.0, 1.0, 2.0)), position_key(DVec3::new(-0.0, 1.0, 2.0)));
        assert_ne!(position_key(DVec3::new(1.0, 2.0, 3.0)), position_key(DVec3::new(1.0 + f64::EPSILON, 2.0, 3.0)));
        assert_ne!(position_key(DVec3::new(1.0, 2.0, 3.0)), position_key(DVec3::new(2.0, 1.0, 3.0)));
    }
}
