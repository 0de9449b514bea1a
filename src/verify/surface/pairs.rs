//! [`Pairs`]: which placed triangle of the input lies where a placed triangle of the output does.

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
    /// The first triangle of each instance of the output, and their number.
    starts: Vec<usize>,
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
        let counts = after.instances.iter().map(|i| after.meshes[i.mesh.0 as usize].triangle_count());
        let starts: Vec<usize> = std::iter::once(0)
            .chain(counts.scan(0, |sum, count| {
                *sum += count;
                Some(*sum)
            }))
            .collect();
        let of = vec![NONE; starts.last().copied().unwrap_or(0)];
        Pairs { starts, of }
    }

    /// Returns the partner of a triangle of the output; `None` if it has none.
    pub fn get(&self, after: TriangleRef) -> Option<Pair> {
        let [instance, packed] = self.of[self.index(after)];
        let at = TriangleRef { instance, triangle: packed % TURN };
        ([instance, packed] != NONE).then_some(Pair { at, turn: packed / TURN })
    }

    /// Sets the partner of a triangle of the output.
    pub fn set(&mut self, after: TriangleRef, pair: Pair) {
        let index = self.index(after);
        self.of[index] = [pair.at.instance, pair.turn * TURN + pair.at.triangle];
    }

    /// Returns the number of triangles with a partner.
    pub fn count(&self) -> u64 {
        self.of.iter().filter(|&&of| of != NONE).count() as u64
    }

    fn index(&self, after: TriangleRef) -> usize {
        self.starts[after.instance as usize] + after.triangle as usize
    }
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
    }
}
