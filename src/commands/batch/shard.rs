//! Divides assets among tasks, so that each takes about the same time.

/// Returns, for each of some predicted durations, the number of its shard, from 0. Each, from the longest on, goes to the shard
/// with the least so far (R. L. Graham, "Bounds on Multiprocessing Timing Anomalies", 1969: at most 4/3 of the best). Ties are
/// broken by position, so that all tasks divide alike.
///
/// # Panics
/// If there are no shards.
pub fn divide(seconds: &[f64], shards: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..seconds.len()).collect();
    order.sort_by(|&a, &b| seconds[b].total_cmp(&seconds[a]).then(a.cmp(&b)));
    let mut sums = vec![0.0; shards];
    let mut of = vec![0; seconds.len()];
    for i in order {
        let least = (0..shards).min_by(|&a, &b| f64::total_cmp(&sums[a], &sums[b])).expect("there are shards");
        of[i] = least;
        sums[least] += seconds[i];
    }
    of
}

/// Returns the predicted duration of each shard.
///
/// # Panics
/// If there are no shards.
pub fn sums(seconds: &[f64], shards: usize) -> Vec<f64> {
    let mut sums = vec![0.0; shards];
    divide(seconds, shards).into_iter().zip(seconds).for_each(|(shard, seconds)| sums[shard] += seconds);
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_take_about_the_same_time() {
        assert_eq!(divide(&[1.0, 5.0, 1.0, 1.0, 2.0], 2), [1, 0, 1, 1, 1]);
        assert_eq!(divide(&[1.0; 4], 2), [0, 1, 0, 1]);
        assert_eq!(divide(&[3.0], 4), [0]);
        assert!(divide(&[], 3).is_empty());
        assert_eq!(sums(&[1.0, 5.0, 1.0, 1.0, 2.0], 2), [5.0, 5.0]);
    }
}
