//! Chooses the point around which the positions of each part are stored.
//!
//! Positions of an OBJ file are decimals; glTF stores 32-bit floats. Far from the origin rounding would destroy the shape
//! of small objects, so these are stored relative to a point near their middle, which becomes the translation of their
//! nodes. Parts that share a position form a *connected set* and share that point: two sides of an edge that were rounded
//! relative to different points would no longer meet.

use glam::DVec3;
use rayon::prelude::*;

/// The largest share of a set's size by which rounding may move a corner before the set is stored around its middle: the
/// relative rounding error of a 32-bit float.
const MOST_ERROR_RATIO: f64 = 1.0 / (1 << 24) as f64;

/// Returns for each part the point that its positions are stored relative to. Every component is exactly a 32-bit float.
/// Zero where rounding moves no corner of the connected set farther than 2^-24 of the diagonal of the set's box, and
/// where nothing would be gained. Positions beyond the range of 32-bit floats are not considered.
pub(super) fn shifts(parts: &[tobj::Mesh]) -> Vec<DVec3> {
    let plain: Vec<Extent> = parts.par_iter().map(|part| Extent::of(part, DVec3::ZERO)).collect();
    // A set is at least as large as each of its parts, so if no part needs a shift, no set does.
    if !plain.iter().any(Extent::is_coarse) {
        return vec![DVec3::ZERO; parts.len()];
    }
    let sets = connected_sets(parts);
    let of_sets = of_sets(&sets, &plain);
    let wanted: Vec<DVec3> = sets.iter().map(|&set| of_sets[set].shift()).collect();
    let shifted: Vec<Extent> = parts.par_iter().zip(&wanted).map(|(part, &shift)| Extent::of(part, shift)).collect();
    let shifted = self::of_sets(&sets, &shifted);
    let helps = |set: usize| shifted[set].error < of_sets[set].error;
    sets.iter().zip(wanted).map(|(&set, shift)| if helps(set) { shift } else { DVec3::ZERO }).collect()
}

/// Whether a position can be stored as 32-bit floats; false for NaN and infinity.
pub(super) fn is_storable(position: DVec3) -> bool {
    position.as_vec3().is_finite()
}

/// Returns the positions of a part in the order of the file.
pub(super) fn positions(part: &tobj::Mesh) -> impl Iterator<Item = DVec3> + '_ {
    part.positions.chunks_exact(3).map(DVec3::from_slice)
}

/// The box around some positions, and the largest distance by which rounding moves one of them.
#[derive(Clone, Copy, Debug)]
struct Extent {
    min: DVec3,
    max: DVec3,
    error: f64,
}

impl Extent {
    const EMPTY: Extent = Extent { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY, error: 0.0 };

    /// Returns the extent of a part that is stored relative to `shift`.
    fn of(part: &tobj::Mesh, shift: DVec3) -> Extent {
        positions(part)
            .filter(|p| is_storable(*p))
            .fold(Extent::EMPTY, |all, p| {
                let own = p - shift;
                let error = own.as_vec3().as_dvec3().distance_squared(own);
                all.with(Extent { min: p, max: p, error })
            })
            .rooted()
    }

    fn with(self, other: Extent) -> Extent {
        Extent { min: self.min.min(other.min), max: self.max.max(other.max), error: self.error.max(other.error) }
    }

    fn rooted(self) -> Extent {
        Extent { error: self.error.sqrt(), ..self }
    }

    /// Returns the diagonal of the box; 0 if there are no positions.
    fn size(&self) -> f64 {
        (self.max - self.min).max(DVec3::ZERO).length()
    }

    fn is_coarse(&self) -> bool {
        self.error > MOST_ERROR_RATIO * self.size()
    }

    /// Returns the point near the middle that positions should be stored relative to.
    fn shift(&self) -> DVec3 {
        if !self.is_coarse() {
            return DVec3::ZERO;
        }
        let size = self.size();
        DVec3::from_array((0.5 * (self.min + self.max)).to_array().map(|middle| on_grid(middle, size)))
    }
}

/// Rounds a coordinate to a multiple of a power of two that is at most an eighth of `size`, or, if 32-bit floats of that
/// magnitude are coarser, to the nearest of these.
fn on_grid(middle: f64, size: f64) -> f64 {
    const SMALLEST: f64 = f32::from_bits(1) as f64;
    let step = power_of_two_at_most(middle.abs()) * f64::from(f32::EPSILON);
    let grid = power_of_two_at_most(size / 8.0).max(step).max(SMALLEST);
    (middle / grid).round() * grid
}

/// Returns the largest power of two that is not larger than a positive number; 0 for 0.
fn power_of_two_at_most(x: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    f64::from_bits(x.to_bits() & EXPONENT)
}

/// Unites the extents of the parts of each set; indexed by set.
fn of_sets(sets: &[usize], parts: &[Extent]) -> Vec<Extent> {
    let mut all = vec![Extent::EMPTY; parts.len()];
    for (&set, part) in sets.iter().zip(parts) {
        all[set] = all[set].with(*part);
    }
    all
}

/// Returns for each part the first part of its connected set.
fn connected_sets(parts: &[tobj::Mesh]) -> Vec<usize> {
    // Adding 0 makes -0 equal to 0.
    let key = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let mut corners: Vec<([u64; 3], u32)> = (0u32..)
        .zip(parts)
        .flat_map(|(number, part)| positions(part).filter(|p| is_storable(*p)).map(move |p| (key(p), number)))
        .collect();
    corners.par_sort_unstable();
    let mut first: Vec<usize> = (0..parts.len()).collect();
    for pair in corners.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        join(&mut first, pair[0].1 as usize, pair[1].1 as usize);
    }
    (0..parts.len()).map(|part| find(&mut first, part)).collect()
}

/// Joins the sets of two parts.
fn join(first: &mut [usize], a: usize, b: usize) {
    let (a, b) = (find(first, a), find(first, b));
    first[a.max(b)] = a.min(b);
}

/// Returns the first part of a set, and shortens the way to it.
fn find(first: &mut [usize], mut part: usize) -> usize {
    while first[part] != part {
        first[part] = first[first[part]];
        part = first[part];
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(positions: &[[f64; 3]]) -> tobj::Mesh {
        tobj::Mesh { positions: positions.concat(), ..tobj::Mesh::default() }
    }

    fn square(corner: DVec3, side: f64) -> tobj::Mesh {
        part(
            &[[0.0, 0.0], [side, 0.0], [0.0, side], [side, side]].map(|[x, y]| (corner + DVec3::new(x, y, 0.0)).into()),
        )
    }

    fn is_single(shift: DVec3) -> bool {
        shift.as_vec3().as_dvec3() == shift
    }

    #[test]
    fn a_part_around_the_origin_stays_where_it_is() {
        let around = square(DVec3::new(-0.3, -1.1, 0.7), 2.3);
        assert_eq!(shifts(&[around, square(DVec3::new(1e6, 0.5, 3.0), 7.0)]), [DVec3::ZERO; 2]);
    }

    #[test]
    fn a_small_part_far_away_is_stored_around_its_middle() {
        for corner in [DVec3::new(500_000.07, 5_400_000.33, 200.1), DVec3::new(5.13, -4.07, 0.9), DVec3::splat(1e30)] {
            let side = 0.1 * (corner.length() / 5.0).min(1.0);
            let [shift] = shifts(&[square(corner, side)])[..] else { panic!("one part") };
            assert!(is_single(shift));
            let step = (corner.abs().max_element() * f64::from(f32::EPSILON)).max(side / 4.0);
            assert!(shift.distance(corner) <= 2.0 * step + side, "{corner} {shift}");
        }
    }

    #[test]
    fn parts_that_share_a_position_share_the_shift() {
        let [a, b, c] = [0.0, 0.1, 0.3].map(|x| square(DVec3::new(500_000.07 + x, 33.3, 0.1), 0.1));
        let meeting = part(&[[500_000.07 + 0.1, 33.3, 0.1], [500_000.19, 33.37, 0.2], [500_000.17, 33.5, 0.2]]);
        let found = shifts(&[a, c, b, meeting]);
        assert_eq!((found[0], found[2]), (found[3], found[3]));
        assert_ne!(found[0], found[1]);
        assert!(found.iter().all(|shift| is_single(*shift) && *shift != DVec3::ZERO));
    }

    #[test]
    fn a_part_of_a_large_surface_needs_no_shift_of_its_own() {
        let large = square(DVec3::new(-1000.1, -1000.3, 0.0), 2000.7);
        let patch = part(&[[-1000.1 + 2000.7, -1000.3, 0.0], [1000.5, -1000.2, 0.1], [1000.4, -1000.3, 0.1]]);
        assert_eq!(shifts(&[large.clone(), patch.clone()]), [DVec3::ZERO; 2]);
        assert_ne!(shifts(&[patch])[0], DVec3::ZERO);
    }

    #[test]
    fn what_single_precision_cannot_hold_moves_nothing() {
        let mut far = square(DVec3::new(-0.3, -1.1, 0.7), 2.3);
        far.positions.extend([1e300, 0.0, 0.0, f64::NAN, 1.0, 2.0, 1e39, 0.0, 0.0]);
        assert_eq!(shifts(&[far]), [DVec3::ZERO]);
        assert_eq!(shifts(&[part(&[]), part(&[[f64::INFINITY; 3]])]), [DVec3::ZERO; 2]);
    }

    #[test]
    fn a_shift_that_gains_nothing_is_left_out() {
        // Denormal numbers are as coarse around any point.
        assert_eq!(shifts(&[square(DVec3::splat(1.7e-44), 3.1e-45)]), [DVec3::ZERO]);
    }

    #[test]
    fn grids_are_powers_of_two() {
        assert_eq!([0.0, 1.0, 3.9, 0.3].map(power_of_two_at_most), [0.0, 1.0, 2.0, 0.25]);
        assert_eq!(on_grid(1000.3, 100.0), 1000.0);
        assert_eq!(on_grid(16_777_217.3, 0.1), 16_777_218.0);
        assert_eq!(on_grid(f64::from(f32::MAX), 1.0), f64::from(f32::MAX));
        assert_eq!(on_grid(0.0, 0.0), 0.0);
    }
}
