//! Compares animations by what they move and how.

use raykiln_formats::properties::{Animation, Channel, Property};

use super::super::Sides;
use super::DifferenceKind as Kind;
use super::curve::{self, Allowed};
use super::findings::Findings;
use super::nodes::Nodes;
use super::property::{Changed, Correspondence, same_number};

/// Values that differ by no more than this are equal, whatever their size.
const SAME_VALUE: f64 = 1e-6;

/// Returns for each node of the input whether an animation changes it.
pub(super) fn animated(animations: &[Animation], nodes: usize) -> Vec<bool> {
    let mut animated = vec![false; nodes];
    for channel in animations.iter().flat_map(|animation| &animation.channels) {
        if let Property::Node(node) = channel.target {
            animated.get_mut(node).into_iter().for_each(|flag| *flag = true);
        }
    }
    animated
}

/// Compares all animations.
pub(super) fn compare(
    animations: &Sides<Vec<Animation>>,
    nodes: &Nodes,
    same: &dyn Correspondence,
    allowed: Allowed,
    found: &mut Findings,
) {
    let Sides { before, after } = animations;
    let mut free: Vec<&Animation> = after.iter().collect();
    for (i, animation) in before.iter().enumerate() {
        let name = animation.name.clone().unwrap_or_else(|| format!("animation {i}"));
        let named = free.iter().position(|other| other.name == animation.name);
        let first = || (before.len() == after.len() && !free.is_empty()).then_some(0);
        match named.or_else(first) {
            Some(at) => Both { name, animations: [animation, free.remove(at)], nodes, same, allowed }.compare(found),
            None => found.object(Kind::AnimationMissing, &name),
        }
    }
    for animation in free {
        found.object(Kind::AnimationAdded, animation.name.as_deref().unwrap_or("without a name"));
    }
}

/// An animation of the input and the same of the output.
struct Both<'a> {
    name: String,
    animations: [&'a Animation; 2],
    nodes: &'a Nodes,
    same: &'a dyn Correspondence,
    allowed: Allowed,
}

impl Both<'_> {
    fn compare(&self, found: &mut Findings) {
        let [before, after] = self.animations;
        let mut free: Vec<&Channel> = after.channels.iter().collect();
        for channel in &before.channels {
            let is_same = |other: &&Channel| other.path == channel.path && self.move_the_same(channel, other);
            match free.iter().position(is_same) {
                Some(at) => self.keys(channel, free.remove(at), found),
                None => self.change(Kind::ChannelMissing, self.target(channel), ["moved", "not moved"], found),
            }
        }
        for channel in free {
            let target = format!("{}.{}", channel.target.short(), channel.path);
            self.change(Kind::ChannelAdded, target, ["not moved", "moved"], found);
        }
        let [b, a] = self.animations.map(|animation| Property::Object(animation.more.clone()));
        found.properties(Kind::AnimationData, Some(&self.name), "animation", [Some(&b), Some(&a)], self.same);
        if before.name != after.name {
            let [before, after] = self.animations.map(|animation| animation.name.clone());
            found.property(Kind::AnimationName, Some(&self.name), Changed { path: "name".into(), before, after });
        }
    }

    fn move_the_same(&self, before: &Channel, after: &Channel) -> bool {
        match (&before.target, &after.target) {
            (Property::Node(b), Property::Node(a)) => self.nodes.are_same(*b, *a),
            (Property::Material(b), Property::Material(a)) => self.same.materials(*b, *a),
            (before, after) => before == after,
        }
    }

    /// Compares interpolation, times and values.
    fn keys(&self, before: &Channel, after: &Channel, found: &mut Findings) {
        let text = |channel: &Channel| format!("{} keys, {}", channel.times.len(), channel.interpolation);
        let are_same = before.interpolation == after.interpolation
            && are_close(&before.times, &after.times)
            && are_close(&before.values, &after.values);
        if !are_same {
            let moves_alike = curve::are_same(before, after, self.allowed);
            let kind = if moves_alike { Kind::AnimationResampled } else { Kind::AnimationKeys };
            self.change(kind, self.target(before), [&text(before), &text(after)], found);
        }
    }

    fn target(&self, channel: &Channel) -> String {
        match channel.target {
            Property::Node(node) => format!("{}.{}", self.nodes.name(node), channel.path),
            ref other => format!("{}.{}", other.short(), channel.path),
        }
    }

    fn change(&self, kind: Kind, path: String, [before, after]: [&str; 2], found: &mut Findings) {
        let changed = Changed { path, before: Some(before.into()), after: Some(after.into()) };
        found.property(kind, Some(&self.name), changed);
    }
}

fn are_close(before: &[f64], after: &[f64]) -> bool {
    let is_close = |(b, a): (&f64, &f64)| same_number(*b, *a) || (b - a).abs() <= SAME_VALUE;
    before.len() == after.len() && before.iter().zip(after).all(is_close)
}
