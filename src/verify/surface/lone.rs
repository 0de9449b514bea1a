//! Pairs triangles that are alone in their cubes, as most are, without sorting: the input's triangles go into a table by
//! hash, and the output's are looked up in their own order, in which neighbours mostly lie near each other in the input
//! too. Which thread comes first decides nothing: a pair counts only if both lists have one triangle in the cube.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

use crate::parallel;

/// Triangles that one thread handles at a time.
const CHUNK: usize = 1 << 14;
const NONE: u32 = u32::MAX;
const SEVERAL: u32 = u32::MAX - 1;

/// Returns the pairs of one triangle each, as indices into `before` and `after`, which hold the hashes of cubes. No more
/// than 2^32 - 2 of each. Takes 24 bytes per triangle of the input and 8 per triangle of the output.
pub(super) fn pair(before: &[u64], after: &[u64]) -> Vec<[u32; 2]> {
    let table = Table::new(before);
    let claims: Vec<AtomicU32> = before.iter().map(|_| AtomicU32::new(NONE)).collect();
    let wanted: Vec<Vec<u32>> = map_chunks(after.len(), &|chunk| {
        let wanted = chunk.map(|i| {
            let at = table.only(after[i]);
            if at != NONE && claims[at as usize].compare_exchange(NONE, i as u32, Relaxed, Relaxed).is_err() {
                claims[at as usize].store(SEVERAL, Relaxed);
            }
            at
        });
        wanted.collect()
    });
    let pairs: Vec<Vec<[u32; 2]>> = parallel::map(wanted.len(), &|chunk| {
        let claimed = |&(i, at): &(u32, u32)| at != NONE && claims[at as usize].load(Relaxed) == i;
        let all = ((chunk * CHUNK) as u32..).zip(wanted[chunk].iter().copied());
        all.filter(claimed).map(|(i, at)| [at, i]).collect()
    });
    pairs.concat()
}

/// Triangles by the hash of their cube. The highest bits of a hash number a bucket, the 32 lowest tell its cubes apart.
/// Different cubes that agree in both count as one.
struct Table {
    /// Where each bucket ends; it starts where the one before ends.
    ends: Vec<AtomicU32>,
    /// The lowest bits of a hash, and the index of the triangle: in each bucket in the order in which threads came.
    entries: Vec<AtomicU64>,
    /// How far to shift a hash for the number of its bucket.
    shift: u32,
}

impl Table {
    fn new(hashes: &[u64]) -> Table {
        let bits = hashes.len().next_power_of_two().ilog2().max(1);
        let shift = u64::BITS - bits;
        let ends: Vec<AtomicU32> = (0..1usize << bits).map(|_| AtomicU32::new(0)).collect();
        map_chunks(hashes.len(), &|chunk| {
            for i in chunk {
                ends[(hashes[i] >> shift) as usize].fetch_add(1, Relaxed);
            }
        });
        let mut start = 0;
        for end in &ends {
            start += end.swap(start, Relaxed);
        }
        let entries: Vec<AtomicU64> = hashes.iter().map(|_| AtomicU64::new(0)).collect();
        map_chunks(hashes.len(), &|chunk| {
            for i in chunk {
                let at = ends[(hashes[i] >> shift) as usize].fetch_add(1, Relaxed);
                entries[at as usize].store(hashes[i] << 32 | i as u64, Relaxed);
            }
        });
        Table { ends, entries, shift }
    }

    /// Returns the only triangle in a cube; `NONE` if there is none, or several.
    fn only(&self, hash: u64) -> u32 {
        let bucket = (hash >> self.shift) as usize;
        let start = if bucket > 0 { self.ends[bucket - 1].load(Relaxed) } else { 0 };
        let entries = &self.entries[start as usize..self.ends[bucket].load(Relaxed) as usize];
        let mut found = entries.iter().map(|entry| entry.load(Relaxed)).filter(|entry| entry >> 32 == hash << 32 >> 32);
        match (found.next(), found.next()) {
            (Some(entry), None) => entry as u32,
            _ => NONE,
        }
    }
}

/// Computes a value for each chunk of `count` elements, in order.
pub(super) fn map_chunks<T: Send>(count: usize, value: &(dyn Fn(std::ops::Range<usize>) -> T + Sync)) -> Vec<T> {
    parallel::map(count.div_ceil(CHUNK), &|chunk| value(chunk * CHUNK..count.min((chunk + 1) * CHUNK)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_alone_on_both_sides_is_paired() {
        let hash = |x: u64| x.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let before: Vec<u64> = [1, 2, 2, 3, 4, 5].map(hash).to_vec();
        let after: Vec<u64> = [5, 3, 3, 2, 6, 1].map(hash).to_vec();
        assert_eq!(pair(&before, &after), [[5, 0], [0, 5]]);
        assert!(pair(&[], &after).is_empty() && pair(&before, &[]).is_empty());
    }

    #[test]
    fn many_triangles_are_paired_in_the_order_of_the_output() {
        let hash = |x: u64| x.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(17);
        let count = 5 * CHUNK as u64 / 2;
        let before: Vec<u64> = (0..count).map(hash).collect();
        let after: Vec<u64> = (0..count).map(|i| hash(count - 1 - i)).collect();
        let expected: Vec<[u32; 2]> = (0..count as u32).map(|i| [count as u32 - 1 - i, i]).collect();
        assert_eq!(pair(&before, &after), expected);
    }

    #[test]
    fn buckets_of_many_triangles_are_searched_whole() {
        // All hashes share their highest bits.
        let before: Vec<u64> = (0..1000).collect();
        assert_eq!(pair(&before, &[7, 2000, 999]), [[7, 0], [999, 2]]);
    }
}
