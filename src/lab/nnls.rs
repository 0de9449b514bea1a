//! Non-negative least squares.
//!
//! Solves the problem NNLS of C. Lawson, R. Hanson, "Solving Least Squares Problems", 1974, chapter 23: the solution is
//! that of ordinary least squares over the columns with coefficients above zero. Their algorithm moves from one set of
//! such columns to the next; here all sets are tried: four unknowns have fifteen, and the search cannot cycle.

/// A column counts as dependent on others if its residual after projection onto them is shorter than this share of its
/// length.
const DEPENDENT: f64 = 1e-9;

/// A larger set of columns must reduce the squared residual by this share of the squared right side to replace a
/// smaller one.
const NO_BETTER: f64 = 1e-12;

/// Returns the `x` without negative components that minimises the length of `rows * x - right`. If columns depend on
/// each other, some get zero. Rows beyond the shorter of the two arguments are ignored; all numbers must be finite.
pub(super) fn solve<const N: usize>(rows: &[[f64; N]], right: &[f64]) -> [f64; N] {
    let columns: [Vec<f64>; N] = std::array::from_fn(|c| rows.iter().zip(right).map(|(row, _)| row[c]).collect());
    let right = &right[..rows.len().min(right.len())];
    let all = dot(right, right);
    let (mut best, mut left) = ([0.0; N], all);
    let mut sets: Vec<u32> = (1..1 << N).collect();
    sets.sort_by_key(|set: &u32| (set.count_ones(), *set));
    for set in sets {
        let chosen: Vec<usize> = (0..N).filter(|c| set >> c & 1 == 1).collect();
        let Some((x, rest)) = least_squares(&columns, &chosen, right) else { continue };
        if x.iter().all(|x| *x >= 0.0) && rest < left - NO_BETTER * all {
            (best, left) = ([0.0; N], rest);
            chosen.iter().zip(x).for_each(|(&c, x)| best[c] = x);
        }
    }
    best
}

/// Solves ordinary least squares over the chosen columns, by modified Gram-Schmidt: returns the solution and the
/// squared length of the residual. `None` if the columns depend on each other.
fn least_squares(columns: &[Vec<f64>], chosen: &[usize], right: &[f64]) -> Option<(Vec<f64>, f64)> {
    let n = chosen.len();
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(n);
    let mut upper = vec![vec![0.0; n]; n];
    for (k, &c) in chosen.iter().enumerate() {
        let mut column = columns[c].clone();
        let whole = dot(&column, &column).sqrt();
        for (j, q) in basis.iter().enumerate() {
            upper[j][k] = dot(q, &column);
            subtract(&mut column, upper[j][k], q);
        }
        let length = dot(&column, &column).sqrt();
        if length.is_nan() || length <= DEPENDENT * whole {
            return None;
        }
        upper[k][k] = length;
        column.iter_mut().for_each(|x| *x /= length);
        basis.push(column);
    }
    let mut rest = right.to_vec();
    let mut x = vec![0.0; n];
    for (k, q) in basis.iter().enumerate() {
        x[k] = dot(q, &rest);
        subtract(&mut rest, x[k], q);
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| upper[k][j] * x[j]).sum();
        x[k] = (x[k] - known) / upper[k][k];
    }
    Some((x, dot(&rest, &rest)))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn subtract(from: &mut [f64], times: f64, what: &[f64]) {
    from.iter_mut().zip(what).for_each(|(x, q)| *x -= times * q);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn without_a_bound_it_is_least_squares() {
        let x = solve(&[[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]], &[1.0, 3.0, 5.0]);
        assert!((x[0] - 1.0).abs() < 1e-12 && (x[1] - 2.0).abs() < 1e-12, "{x:?}");
    }

    #[test]
    fn what_would_be_negative_is_zero_and_the_rest_adapts() {
        let x = solve(&[[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]], &[5.0, 3.0, 1.0]);
        assert_eq!(x[1], 0.0);
        assert!((x[0] - 3.0).abs() < 1e-12, "{x:?}");
        assert_eq!(solve(&[[1.0], [2.0]], &[-1.0, -2.0]), [0.0]);
    }

    #[test]
    fn equal_columns_share_one_price() {
        let x = solve(&[[1.0, 1.0, 0.0], [2.0, 2.0, 1.0], [3.0, 3.0, 5.0]], &[2.0, 4.0, 6.0]);
        assert!((x[0] + x[1] - 2.0).abs() < 1e-9 && x[2].abs() < 1e-9, "{x:?}");
    }

    #[test]
    fn nothing_known_costs_nothing() {
        assert_eq!(solve::<4>(&[], &[]), [0.0; 4]);
        assert_eq!(solve(&[[0.0, 0.0], [0.0, 0.0]], &[1.0, 2.0]), [0.0, 0.0]);
    }

    proptest! {
        /// The Kuhn-Tucker conditions, theorem 23.4 of Lawson and Hanson: no column has a positive component along the
        /// residual, and columns with coefficients above zero are orthogonal to it.
        #[test]
        fn no_step_within_the_bound_comes_closer(
            rows in prop::collection::vec((prop::array::uniform4(-9i8..9), -9i8..9), 0..12)
        ) {
            let right: Vec<f64> = rows.iter().map(|r| f64::from(r.1)).collect();
            let rows: Vec<[f64; 4]> = rows.iter().map(|r| r.0.map(f64::from)).collect();
            let x = solve(&rows, &right);
            let rest: Vec<f64> =
                rows.iter().zip(&right).map(|(row, b)| b - (0..4).map(|c| row[c] * x[c]).sum::<f64>()).collect();
            for (c, x) in x.into_iter().enumerate() {
                let slope: f64 = rows.iter().zip(&rest).map(|(row, rest)| row[c] * rest).sum();
                prop_assert!(x >= 0.0 && slope < 1e-3, "{c}: {x} {slope}");
                prop_assert!(x == 0.0 || slope.abs() < 1e-3, "{c}: {x} {slope}");
            }
        }
    }
}
