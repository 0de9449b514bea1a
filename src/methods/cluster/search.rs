//! Local search: joins groups, divides groups, and moves parts to groups they overlap, if that lowers the cost.
//!
//! The dynamic programme only knows groups that are subtrees of one tree, and units that leave it whole. Better
//! solutions are searched among neighbours until no change saves anything or [`ROUNDS`] are over: a group is *divided*
//! if entering its parts costs less than the nodes shared by them; two groups are *joined*, in the frame of the larger,
//! if one entry saves more than the common tree costs; a part of a group that makes its box large *moves* to a group
//! that it lies in. Costs are upper bounds: trees are refitted and put below new roots, although a new tree would be
//! cheaper. Neighbours are close in the order of a tree over the groups, and pairs that are each other's best are
//! joined at the same time, as D. Meister, J. Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume
//! Hierarchy Construction", IEEE Transactions on Visualization and Computer Graphics 24(3), 2018, build a tree.

use rayon::prelude::*;

use super::Limits;
use super::dynamic_programming::{self, Group, Known};
use super::facts::{LENGTHS, facts};
use super::refit::Refit;
use super::soup::{Soup, Turned};
use crate::cost::sah::TRAVERSAL;
use crate::methods::pieces::longest_axis;
use crate::parallel;
use crate::scene::Bounds;
use crate::tree::{Quality, Tree};

/// Maximum number of rounds of changes.
const ROUNDS: usize = 4;

/// Number of groups next in tree order that a group may be joined with or give a part to.
const NEIGHBOURS: usize = 8;

/// Larger groups are neither divided nor searched for parts: their trees take too long to build, and the dynamic
/// programme has already considered them whole.
const MOST: usize = 1 << 16;

/// Number of levels of a group's tree whose nodes may move.
const LEVELS: usize = 2;

/// A change must save more than this share of the cost of what it changes.
const WORTH: f64 = 1e-3;

/// A part may move if the area of the box of the rest is below this share.
const SHRINKS: f64 = 0.9;

/// A group and its cost.
#[derive(Clone)]
struct Member {
    group: Group,
    fit: Fit,
}

/// How well some triangles fit a frame.
#[derive(Clone, Copy)]
struct Fit {
    /// Their box in the frame.
    bounds: Bounds,
    /// The world box of that box, which rays meet.
    world: Bounds,
    /// The cost of a tree over them.
    inside: f64,
}

/// A search over the groups of some triangles.
struct Search<'a> {
    soup: &'a Soup,
    limits: &'a Limits,
}

/// Divides groups in frames of their own as far as that costs less.
pub(super) fn divide_turned(soup: &Soup, groups: Vec<Group>, base: &Turned, limits: &Limits) -> Vec<Group> {
    let search = Search { soup, limits };
    let divided = |group: Group| match group.frame == *base {
        true => vec![group],
        false => search.divide_along(search.member(group)).into_iter().map(|member| member.group).collect(),
    };
    groups.into_par_iter().flat_map_iter(divided).collect()
}

/// Returns groups that cost no more than those given, measured by the areas of boxes.
pub(super) fn improve(soup: &Soup, groups: Vec<Group>, limits: &Limits) -> Vec<Group> {
    let search = Search { soup, limits };
    let mut members: Vec<Member> = groups.into_par_iter().map(|group| search.member(group)).collect();
    if limits.divide {
        let divide = |member| search.divide(member).into_iter().flat_map(|part| search.divide_along(part));
        members = members.into_par_iter().flat_map_iter(divide).collect();
    }
    for _ in 0..ROUNDS {
        sort(&mut members);
        let moved = search.move_parts(&mut members);
        let joined = search.join(&mut members);
        if !moved && !joined {
            break;
        }
    }
    members.into_iter().map(|member| member.group).collect()
}

/// Sorts members in the order of a tree over them, unless their boxes are too large for a tree.
fn sort(members: &mut Vec<Member>) {
    let boxes: Vec<Bounds> = members.iter().map(|member| member.fit.world).collect();
    let tree = Tree::build_usable(&boxes, Quality::Instances);
    if tree.order.len() == members.len() {
        let mut old: Vec<Option<Member>> = std::mem::take(members).into_iter().map(Some).collect();
        members.extend(tree.order.iter().filter_map(|&i| old[i as usize].take()));
    }
}

impl Search<'_> {
    fn member(&self, group: Group) -> Member {
        Member { fit: self.fit(&group.items, &group.frame), group }
    }

    fn fit(&self, items: &[u32], frame: &Turned) -> Fit {
        let boxes = self.boxes(items, frame);
        let tree = Tree::build(&boxes, Quality::Fast);
        let fitted = Refit::default().part(&tree, 0, |i| boxes[i as usize]);
        Fit { bounds: fitted.bounds, world: frame.out(&fitted.bounds), inside: fitted.cost }
    }

    fn boxes(&self, items: &[u32], frame: &Turned) -> Vec<Bounds> {
        items.iter().map(|&t| self.soup.bounds_in(frame, t)).collect()
    }

    /// Returns the cost of a group with this fit.
    fn cost(&self, fit: &Fit) -> f64 {
        self.limits.leaving_cost() * fit.world.area() + fit.inside
    }

    /// Returns the parts of a group if their entries cost less than what they share, else the group.
    fn divide(&self, member: Member) -> Vec<Member> {
        let Group { items, frame } = &member.group;
        if items.len() > MOST || items.len() < 2 {
            return vec![member];
        }
        let mut tree = Tree::build(&self.boxes(items, frame), Quality::Medium);
        tree.order.iter_mut().for_each(|i| *i = items[*i as usize]);
        let facts = facts(self.soup, &tree, frame);
        let own = vec![None; facts.len()];
        let known = Known { tree: &tree, facts: &facts, own: &own, base: *frame, fewest: self.limits.min_turned };
        let (groups, cost) = dynamic_programming::cut(&known, self.limits);
        let whole = self.limits.entry_cost * facts[0].loose + facts[0].inside;
        match cost < (1.0 - WORTH) * whole {
            true => groups.into_iter().map(|group| self.member(group)).collect(),
            false => vec![member],
        }
    }

    /// Returns a group in a frame of its own divided along its longest side into as many parts of equally many triangles
    /// as pay: the world box of a long part that lies diagonally is large. A tree seldom divides it there.
    fn divide_along(&self, member: Member) -> Vec<Member> {
        let Group { items, frame } = &member.group;
        if *frame == Turned::NOT || items.len() > MOST {
            return vec![member];
        }
        let axis = longest_axis(&member.fit.bounds);
        let place = |&t: &u32| self.soup.bounds_in(frame, t).center()[axis];
        let mut sorted: Vec<(f64, u32)> = items.iter().map(|t| (place(t), *t)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let part =
            |part: &[(f64, u32)]| self.member(Group { items: part.iter().map(|&(_, t)| t).collect(), frame: *frame });
        let mut best = (self.cost(&member.fit), vec![member.clone()]);
        for &lengths in &LENGTHS[1..] {
            let count = items.len().div_ceil(lengths as usize);
            if count < self.limits.min_turned.max(1) as usize {
                break;
            }
            let parts: Vec<Member> = sorted.chunks(count).map(part).collect();
            let cost = parts.iter().map(|part| self.cost(&part.fit)).sum::<f64>();
            if cost < (1.0 - WORTH) * best.0 {
                best = (cost, parts);
            }
        }
        best.1
    }

    /// Joins neighbours that gain most from each other; returns whether there were any.
    fn join(&self, members: &mut Vec<Member>) -> bool {
        let count = members.len();
        let with_next = |i: usize| -> Vec<Option<(Fit, f64)>> {
            (i + 1..count.min(i + 1 + NEIGHBOURS)).map(|j| self.joined(&members[i], &members[j])).collect()
        };
        let found: Vec<Vec<Option<(Fit, f64)>>> = parallel::map(count, &with_next);
        let mut best: Vec<(f64, usize)> = vec![(0.0, usize::MAX); count];
        for (i, found) in found.iter().enumerate() {
            for (found, j) in found.iter().zip(i + 1..) {
                let gain = found.map_or(0.0, |(_, gain)| gain);
                for (of, with) in [(i, j), (j, i)] {
                    if gain > best[of].0 {
                        best[of] = (gain, with);
                    }
                }
            }
        }
        let mut gone = vec![false; count];
        for i in 0..count {
            let j = best[i].1;
            let is_mutual = j != usize::MAX && i < j && best[j].1 == i;
            if let Some((fit, _)) = found[i].get(j.wrapping_sub(i + 1)).copied().flatten().filter(|_| is_mutual) {
                let [one, other] = [i, j].map(|at| std::mem::take(&mut members[at].group.items));
                let keeps_frame = one.len() >= other.len();
                let frame = members[if keeps_frame { i } else { j }].group.frame;
                let items = if keeps_frame { [one, other].concat() } else { [other, one].concat() };
                members[i] = Member { group: Group { items, frame }, fit };
                gone[j] = true;
            }
        }
        let mut gone = gone.into_iter();
        members.retain(|_| !gone.next().unwrap_or(false));
        members.len() < count
    }

    /// Returns how two groups, joined, fit the frame of the larger (the first of equal ones), and what that saves;
    /// `None` if it saves nothing.
    fn joined(&self, one: &Member, other: &Member) -> Option<(Fit, f64)> {
        let is_larger = one.group.items.len() >= other.group.items.len();
        let (large, small) = if is_larger { (one, other) } else { (other, one) };
        let triangles = large.group.items.len() + small.group.items.len();
        let world = large.fit.world.union(&small.fit.world);
        let most = self.limits.leaving_cost() * (large.fit.world.area() + small.fit.world.area() - world.area());
        if most <= 0.0 || !self.limits.allow(triangles as u32, world.size().max_element()) {
            return None;
        }
        let apart = self.cost(&large.fit) + self.cost(&small.fit);
        let frame = large.group.frame;
        if !self.may_change_frame(&small.group.items, &small.group.frame, &frame) {
            return None;
        }
        let known = if small.group.frame == frame { small.fit } else { self.fit(&small.group.items, &frame) };
        let with = with(large, &known)?;
        let gain = apart - self.cost(&with);
        (gain > WORTH * apart).then_some((with, gain))
    }

    /// Whether some triangles may be stored in another frame: only whole components, or seams would open.
    fn may_change_frame(&self, items: &[u32], from: &Turned, to: &Turned) -> bool {
        from == to || self.soup.components.are_closed(items)
    }

    /// Moves parts that make a group's box large into neighbours; returns whether there were any.
    fn move_parts(&self, members: &mut [Member]) -> bool {
        let moves: Vec<Option<Move>> = parallel::map(members.len(), &|i| self.best_move(members, i));
        let mut touched = vec![false; members.len()];
        for (i, found) in moves.into_iter().enumerate() {
            if let Some(found) = found
                && !touched[i]
                && !touched[found.to]
            {
                (touched[i], touched[found.to]) = (true, true);
                members[i] = found.without;
                members[found.to].group.items.extend(found.items);
                members[found.to].fit = found.with;
            }
        }
        touched.contains(&true)
    }

    /// Returns the part of a group that is best moved to a neighbour.
    fn best_move(&self, members: &[Member], at: usize) -> Option<Move> {
        let member = &members[at];
        let mut best: Option<Move> = None;
        for part in self.parts(member) {
            let saved = self.cost(&member.fit) - self.cost(&part.without.fit);
            for to in (at.saturating_sub(NEIGHBOURS)..members.len().min(at + 1 + NEIGHBOURS)).filter(|&to| to != at) {
                let home = &members[to];
                if TRAVERSAL * home.fit.bounds.area() >= saved || !home.fit.world.overlaps(&part.world) {
                    continue;
                }
                if !self.may_change_frame(&part.items, &member.group.frame, &home.group.frame) {
                    continue;
                }
                let Some(with) = with(home, &self.fit(&part.items, &home.group.frame)) else { continue };
                let gain = saved - (self.cost(&with) - self.cost(&home.fit));
                let triangles = home.group.items.len() + part.items.len();
                let is_allowed = self.limits.allow(triangles as u32, with.world.size().max_element());
                let least = WORTH * self.cost(&member.fit);
                if is_allowed && gain > best.as_ref().map_or(least, |best| best.gain) {
                    best = Some(Move { to, gain, items: part.items.clone(), without: part.without.clone(), with });
                }
            }
        }
        best
    }

    /// Returns the parts of a group without which its box is smaller.
    fn parts(&self, member: &Member) -> Vec<Part> {
        let Group { items, frame } = &member.group;
        if items.len() > MOST || items.len() < 2 {
            return Vec::new();
        }
        let boxes = self.boxes(items, frame);
        let tree = Tree::build(&boxes, Quality::Fast);
        let bounds = tree.bounds(&boxes);
        let mut parts = Vec::new();
        let mut nodes = vec![(0u32, Bounds::EMPTY, 0)];
        while let Some((at, beside, level)) = nodes.pop() {
            let node = &tree.nodes[at as usize];
            if level > 0 && beside.area() < SHRINKS * member.fit.bounds.area() {
                parts.extend(self.part(member, &tree.order, tree.items_below(at)));
            }
            if level < LEVELS && !node.is_leaf() {
                let [a, b] = [node.first, node.first + 1];
                nodes.push((a, beside.union(&bounds[b as usize]), level + 1));
                nodes.push((b, beside.union(&bounds[a as usize]), level + 1));
            }
        }
        parts
    }

    /// Returns the part of a group given by a range of an order of its triangles.
    fn part(&self, member: &Member, order: &[u32], range: std::ops::Range<usize>) -> Option<Part> {
        let Group { items, frame } = &member.group;
        let of = |order: &[u32]| -> Vec<u32> { order.iter().map(|&i| items[i as usize]).collect() };
        let stays = [of(&order[..range.start]), of(&order[range.end..])].concat();
        if stays.len() < self.limits.min_turned as usize {
            return None;
        }
        let items = of(&order[range]);
        let world = items.iter().fold(Bounds::EMPTY, |all, &t| all.union(&self.soup.bounds_in(&Turned::NOT, t)));
        Some(Part { without: self.member(Group { items: stays, frame: *frame }), items, world })
    }
}

/// A part that a group may lose.
struct Part {
    items: Vec<u32>,
    /// Its box in world space.
    world: Bounds,
    /// The group without it.
    without: Member,
}

/// A move of a part of a group to a neighbour.
struct Move {
    to: usize,
    gain: f64,
    items: Vec<u32>,
    /// The group without the part.
    without: Member,
    /// How the neighbour fits with the part.
    with: Fit,
}

/// Returns how a group fits its frame when triangles with the fit `more` are added below a new root.
fn with(member: &Member, more: &Fit) -> Option<Fit> {
    let bounds = member.fit.bounds.union(&more.bounds);
    let inside = member.fit.inside + more.inside + TRAVERSAL * bounds.area();
    inside.is_finite().then(|| Fit { bounds, world: member.group.frame.out(&bounds), inside })
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3, Vec3};
    use rustc_hash::FxHashSet;

    use super::*;
    use crate::layout::builder::objects;
    use crate::layout::test_scenes::SceneBuilder;
    use crate::methods::ClusterOptions;
    use crate::methods::cluster::Purpose;
    use crate::scene::InstanceId;

    /// Piles of eight triangles at these points: triangles in one place are never better divided.
    fn piles(at: &[Vec3]) -> Soup {
        let pile = |at: Vec3| {
            let layer = |i: i32| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| at + p + Vec3::Z * 0.01 * i as f32);
            (0..8).map(layer).collect()
        };
        let mut builder = SceneBuilder::default();
        at.iter().for_each(|&at| builder.object("pile", 0, pile(at)));
        let scene = builder.scene();
        let all: Vec<_> = (0..at.len() as u32).map(InstanceId).collect();
        Soup::new(&scene, &objects(&scene, all), Some(&FxHashSet::default()))
    }

    fn limits(entry_cost: f64) -> Limits {
        Limits::of(
            &ClusterOptions { min_turned_triangles: 1, ..ClusterOptions::default() },
            Purpose::Groups { entry_cost },
            2.0,
        )
    }

    fn group(items: std::ops::Range<u32>) -> Group {
        Group { items: items.collect(), frame: Turned::NOT }
    }

    /// Returns the triangles of the improved groups, with each group and the list of groups sorted.
    fn found(soup: &Soup, groups: Vec<Group>, limits: &Limits) -> Vec<Vec<u32>> {
        let mut found: Vec<Vec<u32>> = improve(soup, groups, limits).into_iter().map(|group| group.items).collect();
        found.iter_mut().for_each(|items| items.sort_unstable());
        found.sort();
        found
    }

    #[test]
    fn groups_in_one_place_are_joined() {
        let soup = piles(&[Vec3::ZERO, Vec3::Y * 0.01]);
        let limits = limits(5.0);
        assert_eq!(found(&soup, vec![group(0..8), group(8..16)], &limits), [(0..16).collect::<Vec<_>>()]);
    }

    #[test]
    fn groups_far_apart_stay_apart() {
        let soup = piles(&[Vec3::ZERO, Vec3::Y * 50.0]);
        let apart = [(0..8).collect::<Vec<_>>(), (8..16).collect()];
        assert_eq!(found(&soup, vec![group(0..8), group(8..16)], &limits(5.0)), apart);
    }

    #[test]
    fn a_group_of_two_places_is_divided_if_it_may_be() {
        let soup = piles(&[Vec3::ZERO, Vec3::new(1.0, 50.0, 20.0)]);
        let apart = [(0..8).collect::<Vec<_>>(), (8..16).collect()];
        assert_eq!(found(&soup, vec![group(0..16)], &limits(0.1)), apart);
        let whole = Limits { divide: false, ..limits(0.1) };
        assert_eq!(found(&soup, vec![group(0..16)], &whole), [(0..16).collect::<Vec<_>>()]);
    }

    #[test]
    fn a_part_moves_to_where_it_lies() {
        let soup = piles(&[Vec3::ZERO, Vec3::new(0.0, 50.0, 20.0), Vec3::new(0.0, 50.01, 20.0)]);
        let limits = Limits { divide: false, ..limits(5.0) };
        let better = [(0..8).collect::<Vec<_>>(), (8..24).collect()];
        assert_eq!(found(&soup, vec![group(0..16), group(16..24)], &limits), better);
    }

    #[test]
    fn bounds_are_kept() {
        let soup = piles(&[Vec3::ZERO, Vec3::Y * 0.01]);
        let small = Limits { max_triangles: 8, ..limits(5.0) };
        assert_eq!(found(&soup, vec![group(0..8), group(8..16)], &small).len(), 2);
        let short = Limits { max_extent: 0.1, ..limits(5.0) };
        assert_eq!(found(&soup, vec![group(0..8), group(8..16)], &short).len(), 2);
    }

    #[test]
    fn nothing_costs_more_than_before() {
        let at = |i: u32| Vec3::new((i * 7 % 13) as f32, (i * 5 % 11) as f32, (i * 3 % 7) as f32) * 0.05;
        let soup = piles(&(0..40).map(at).collect::<Vec<_>>());
        let turned = Turned::by(DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.5));
        let frame = |i: u32| if i.is_multiple_of(3) { turned } else { Turned::NOT };
        let groups = || (0..40).map(|i| Group { frame: frame(i), ..group(8 * i..8 * i + 8) }).collect::<Vec<_>>();
        let mut joined = false;
        for entry_cost in [0.5, 2.0, 8.0, 100.0] {
            let limits = limits(entry_cost);
            let search = Search { soup: &soup, limits: &limits };
            let cost = |groups: Vec<Group>| -> f64 {
                groups.into_iter().map(|g| search.member(g)).map(|m| search.cost(&m.fit)).sum()
            };
            let better = improve(&soup, groups(), &limits);
            let mut all: Vec<u32> = better.iter().flat_map(|g| g.items.clone()).collect();
            all.sort_unstable();
            assert_eq!(all, (0..320).collect::<Vec<_>>());
            let [before, after] = [cost(groups()), cost(better)];
            joined |= after < 0.999 * before;
            assert!(after <= (1.0 + 1e-12) * before, "{after} {before}");
        }
        assert!(joined, "nothing was ever better");
    }

    #[test]
    fn no_group_is_no_work() {
        assert!(improve(&piles(&[Vec3::ZERO]), Vec::new(), &limits(5.0)).is_empty());
    }
}
