//! Pairs again where triangles lie closer together than corners may be off.
//!
//! There a triangle may have taken the partner of another one. An augmenting path (C. Berge, "Two theorems in graph
//! theory", PNAS 43, 1957) from a triangle of the output without partner leads, over partners that others hold, to one of
//! the input that nobody holds; along it, each holder passes on to its next partner.

use std::collections::{HashMap, HashSet, VecDeque};

use super::place::{Keep, Rule, Seeker};
use super::{CONSIDERED, all_triangles, corners::Fit, pairs::Pairs};
use crate::scene::TriangleRef;
use crate::verify::Sides;

/// More triangles without partner than this are no tangle.
const MOST_LEFT: usize = 1 << 12;
/// A path passes at most this many holders.
const LONGEST: usize = 16;
/// Triangles of the output that are considered in all.
const MOST_CONSIDERED: usize = 1 << 16;

/// A triangle of the output, its new partner in the input, and how both fit.
pub(super) type Repaired = (TriangleRef, TriangleRef, Fit);

/// Which triangles of the output may have which partners.
struct Graph {
    partners: HashMap<TriangleRef, Vec<(TriangleRef, Fit)>>,
    /// The triangle of the output that holds one of the input.
    holders: HashMap<TriangleRef, TriangleRef>,
}

/// Finds partners for triangles that are left over, `left`; returns all that get a new one.
pub(super) fn untangle(
    seeker: &Seeker,
    left: Sides<&[TriangleRef]>,
    tolerance: &(dyn Fn(u32) -> f64 + Sync),
    pairs: &Pairs,
) -> Vec<Repaired> {
    if left.before.is_empty() || left.after.is_empty() || left.before.len().max(left.after.len()) > MOST_LEFT {
        return Vec::new();
    }
    let mut graph = Graph::around(seeker, left.after, tolerance, pairs);
    let mut free: HashSet<TriangleRef> = left.before.iter().copied().collect();
    let mut repaired: HashMap<TriangleRef, (TriangleRef, Fit)> = HashMap::new();
    for &start in left.after {
        let path = graph.path(start, &free);
        free.retain(|at| path.last().is_none_or(|(_, end, _)| at != end));
        for (after, before, fit) in path {
            graph.holders.insert(before, after);
            repaired.insert(after, (before, fit));
        }
    }
    let mut repaired: Vec<Repaired> = repaired.into_iter().map(|(after, (before, fit))| (after, before, fit)).collect();
    repaired.sort_unstable_by_key(|(after, ..)| *after);
    repaired
}

impl Graph {
    /// Collects who may have whom, from the given triangles of the output on, over those that hold their partners.
    fn around(seeker: &Seeker, after: &[TriangleRef], tolerance: &(dyn Fn(u32) -> f64 + Sync), pairs: &Pairs) -> Graph {
        let rule = Rule { tolerance, same_side: true, keep: Keep::Every, most_considered: CONSIDERED };
        let all = all_triangles(seeker.scenes.before);
        let mut graph = Graph { partners: HashMap::new(), holders: HashMap::new() };
        let mut frontier = after.to_vec();
        for _ in 0..LONGEST {
            frontier.iter().for_each(|&at| drop(graph.partners.insert(at, Vec::new())));
            let matches = seeker.pair(Sides { before: &all, after: &frontier }, &rule);
            let mut met: Vec<TriangleRef> = Vec::new();
            for m in matches {
                let (at, partner) = (frontier[m.after as usize], all[m.before as usize]);
                graph.partners.entry(at).or_default().push((partner, m.fit));
                met.push(partner);
            }
            met.sort_unstable();
            met.dedup();
            met.retain(|partner| !graph.holders.contains_key(partner));
            let holders = pairs.find(&met);
            graph
                .holders
                .extend(met.into_iter().zip(&holders).filter_map(|(partner, holder)| Some((partner, (*holder)?))));
            frontier = holders.into_iter().flatten().filter(|at| !graph.partners.contains_key(at)).collect();
            if frontier.is_empty() || graph.partners.len() + frontier.len() > MOST_CONSIDERED {
                break;
            }
        }
        graph
    }

    /// Returns a shortest path as the new pairs along it, the one with the free partner last; empty if there is none.
    fn path(&self, start: TriangleRef, free: &HashSet<TriangleRef>) -> Vec<Repaired> {
        // How each partner was reached first.
        let mut reached: HashMap<TriangleRef, (TriangleRef, Fit)> = HashMap::new();
        let mut queue = VecDeque::from([start]);
        while let Some(at) = queue.pop_front() {
            for &(partner, fit) in self.partners.get(&at).into_iter().flatten() {
                if reached.contains_key(&partner) {
                    continue;
                }
                reached.insert(partner, (at, fit));
                if free.contains(&partner) {
                    return self.back(start, partner, &reached);
                }
                queue.extend(self.holders.get(&partner));
            }
        }
        Vec::new()
    }

    /// Follows a path from its free end back to its start.
    fn back(
        &self,
        start: TriangleRef,
        end: TriangleRef,
        reached: &HashMap<TriangleRef, (TriangleRef, Fit)>,
    ) -> Vec<Repaired> {
        let held: HashMap<TriangleRef, TriangleRef> =
            self.holders.iter().map(|(partner, holder)| (*holder, *partner)).collect();
        let mut path = Vec::new();
        let mut partner = end;
        loop {
            let (at, fit) = reached[&partner];
            path.push((at, partner, fit));
            if at == start {
                path.reverse();
                return path;
            }
            partner = held[&at];
        }
    }
}
