//! [`Pairs`]: which placed triangle of the input lies where a placed triangle of the output does.

use rayon::prelude::*;

use super::numbering::Numbering;
use crate::scene::{Scene, TriangleRef};

/// The triangle of the input in the place of one of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The triangle of the input.
    pub at: TriangleRef,
    /// Corner `k` of the output's triangle lies where corner `(k + turn) % 3` of the input's does, both in the order of
    /// [`Scene::world_corners`]; 0 to 2.
    pub turn: u32,
}

/// For each placed triangle of the output, the one of the input in the same place; each of the input's is in at most one
/// pair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pairs {
    /// Of the triangles of the output.
    numbering: Numbering,
    /// The instance of the input, and its triangle with the turn in the two highest bits.
    of: Vec<[u32; 2]>,
}

/// Marks a triangle without partner.
const NONE: [u32; 2] = [u32::MAX; 2];
/// A mesh has fewer triangles than this.
const TURN: u32 = 1 << 30;

impl Pairs {
    /// Pairs nothing of a scene's triangles.
    pub fn none(after: &Scene) -> Pairs {
        let numbering = Numbering::of(after);
        Pairs { of: vec![NONE; numbering.total()], numbering }
    }

    /// Returns the partner of a triangle of the output; `None` if it has none.
    pub fn get(&self, after: TriangleRef) -> Option<Pair> {
        let [instance, packed] = self.of[self.numbering.index(after)];
        let at = TriangleRef { instance, triangle: packed % TURN };
        ([instance, packed] != NONE).then_some(Pair { at, turn: packed / TURN })
    }

    /// Sets the partner of a triangle of the output.
    pub fn set(&mut self, after: TriangleRef, pair: Pair) {
        let index = self.numbering.index(after);
        self.of[index] = packed(pair);
    }

    /// Takes away the partner of a triangle of the output.
    pub(super) fn clear(&mut self, after: TriangleRef) {
        let index = self.numbering.index(after);
        self.of[index] = NONE;
    }

    /// Returns the number of triangles with a partner.
    pub fn count(&self) -> u64 {
        self.of.iter().filter(|&&of| of != NONE).count() as u64
    }

    /// Returns the triangles of the output without partner, in order.
    pub fn unpaired(&self) -> Vec<TriangleRef> {
        let of_instance = |(i, range): (u32, &[usize])| {
            let of = &self.of[range[0]..range[1]];
            (0..)
                .zip(of)
                .filter(|(_, of)| **of == NONE)
                .map(|(t, _)| TriangleRef { instance: i, triangle: t })
                .collect()
        };
        let ranges: Vec<(u32, &[usize])> = (0..).zip(self.numbering.starts.windows(2)).collect();
        let found: Vec<Vec<TriangleRef>> = ranges.into_par_iter().map(of_instance).collect();
        found.concat()
    }

    /// Returns the triangles of the output that are paired with the given ones of the input.
    pub fn find(&self, wanted: &[TriangleRef]) -> Vec<Option<TriangleRef>> {
        if wanted.is_empty() {
            return Vec::new();
        }
        let mut sorted = wanted.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        let which = |&[instance, packed]: &[u32; 2]| {
            let at = TriangleRef { instance, triangle: packed % TURN };
            ([instance, packed] != NONE).then(|| sorted.binary_search(&at).ok()).flatten()
        };
        let found = self.of.par_iter().enumerate().filter_map(|(index, of)| Some((which(of)?, index)));
        let mut places = vec![None; sorted.len()];
        for (which, index) in found.collect::<Vec<_>>() {
            places[which] = Some(self.numbering.triangle(index));
        }
        wanted.iter().map(|w| sorted.binary_search(w).ok().and_then(|which| places[which])).collect()
    }

    /// Splits the pairs into the given numbers of consecutive triangles, to be set in parallel.
    pub(super) fn split(&mut self, counts: impl IntoIterator<Item = usize>) -> Vec<PairsMut<'_>> {
        let mut rest = self.of.as_mut_slice();
        let mut part = |count| {
            let (part, others) = std::mem::take(&mut rest).split_at_mut(count);
            rest = others;
            PairsMut(part)
        };
        counts.into_iter().map(&mut part).collect()
    }
}

/// Consecutive triangles of the output.
pub(super) struct PairsMut<'a>(&'a mut [[u32; 2]]);

impl PairsMut<'_> {
    /// Sets the partner of the triangle with this index.
    pub(super) fn set(&mut self, index: usize, pair: Pair) {
        self.0[index] = packed(pair);
    }
}

fn packed(pair: Pair) -> [u32; 2] {
    [pair.at.instance, pair.turn * TURN + pair.at.triangle]
}

#[cfg(test)]
mod tests {
    use super::super::super::test_scenes::room;
    use super::*;

    #[test]
    fn what_is_set_can_be_had() {
        let scene = room();
        let mut pairs = Pairs::none(&scene);
        let (here, there) = (TriangleRef { instance: 1, triangle: 2 }, TriangleRef { instance: 3, triangle: 4 });
        assert_eq!((pairs.get(here), pairs.count()), (None, 0));
        pairs.set(here, Pair { at: there, turn: 2 });
        assert_eq!(pairs.get(here), Some(Pair { at: there, turn: 2 }));
        assert_eq!(pairs.count(), 1);
        assert_eq!(pairs.find(&[here, there, there]), [None, Some(here), Some(here)]);
        let unpaired = pairs.unpaired();
        assert!(unpaired.len() as u64 + 1 == scene.triangles_placed() && !unpaired.contains(&here));
        pairs.clear(here);
        assert_eq!(pairs, Pairs::none(&scene));
    }
}
