//! The animation that a glTF file brings with it: nodes, skins and morph targets at any time (glTF 2.0, sections 3.7.3.3 and
//! 3.11).

mod body;
mod playing;
#[cfg(test)]
mod tests;

use glam::{DAffine3, DQuat, DVec3};
use raykiln_formats::properties::{Animation, Channel, Property, RestPose, Skin};
use raykiln_formats::{Document, Error};

use crate::scene::Scene;
use crate::verify::contents::curve;
use body::Body;
pub use playing::Playing;

/// An animation of a document and what it moves in the document's scene.
#[derive(Clone, Debug)]
pub struct Rig {
    /// Name of the animation, or empty.
    pub name: String,
    /// Time of the last key, after which the animation begins again.
    pub seconds: f64,
    nodes: Vec<Joint>,
    /// All nodes, parents before their children.
    order: Vec<usize>,
    /// What moves nodes or changes the weights of their morph targets, with the node.
    channels: Vec<(usize, Channel)>,
    skins: Vec<Skin>,
    /// The instances that move as a whole.
    placed: Vec<Placed>,
    /// The instances that deform.
    bodies: Vec<Body>,
}

/// A node of the document.
#[derive(Clone, Debug)]
struct Joint {
    parent: Option<usize>,
    /// Parent from node, at rest.
    local: DAffine3,
    rest: RestPose,
}

/// An instance that moves as a whole.
#[derive(Clone, Copy, Debug)]
struct Placed {
    /// Index into the document's scene.
    instance: u32,
    node: usize,
    /// Node from mesh.
    copy: DAffine3,
}

/// Where all nodes are at a time.
struct Pose {
    /// World from node.
    worlds: Vec<DAffine3>,
    /// The weights of morph targets that are animated.
    weights: Vec<Option<Vec<f64>>>,
}

impl Rig {
    /// Reads an animation of a document; `scene` is that of the document. `None` if there is no such animation or nothing in
    /// the scene moves by it.
    ///
    /// # Errors
    /// See [`Document::contents`].
    pub fn read(doc: &Document, scene: &Scene, animation: usize) -> Result<Option<Rig>, Error> {
        match doc.animations().into_iter().nth(animation) {
            Some(animation) => Rig::of(doc, scene, animation),
            None => Ok(None),
        }
    }

    /// Like [`Rig::read`], of an animation that was read.
    pub(super) fn of(doc: &Document, scene: &Scene, animation: Animation) -> Result<Option<Rig>, Error> {
        let nodes = doc.hierarchy()?.nodes;
        let channels: Vec<(usize, Channel)> = animation.channels.into_iter().filter_map(of_node).collect();
        let ends = channels.iter().filter_map(|(_, channel)| channel.times.last().copied());
        let joints = nodes.iter().zip(doc.rest_poses()?);
        let mut rig = Rig {
            name: animation.name.unwrap_or_default(),
            seconds: ends.fold(0.0, f64::max),
            nodes: joints.map(|(n, rest)| Joint { parent: n.parent, local: n.local, rest }).collect(),
            order: in_order(&nodes.iter().map(|node| node.parent).collect::<Vec<_>>()),
            channels,
            skins: doc.skins(),
            placed: Vec::new(),
            bodies: Vec::new(),
        };
        let moves = rig.moving_nodes();
        for (index, instance) in (0u32..).zip(&scene.instances) {
            let node = instance.node as usize;
            let morphs = rig.channels.iter().any(|(of, channel)| *of == node && channel.path == "weights");
            if nodes[node].skin.is_some() || morphs {
                rig.bodies.push(Body::read(doc, scene, index, nodes[node].skin));
            }
            if moves[node] && nodes[node].skin.is_none() {
                let copies = nodes[node].copies.as_ref();
                let copy = copies.map_or(DAffine3::IDENTITY, |copies| copies[instance.copy as usize]);
                rig.placed.push(Placed { instance: index, node, copy });
            }
        }
        Ok(Some(rig).filter(|rig| !rig.placed.is_empty() || !rig.bodies.is_empty()))
    }

    /// Returns for each node whether the animation moves it, by itself or through an ancestor.
    fn moving_nodes(&self) -> Vec<bool> {
        let mut moves = vec![false; self.nodes.len()];
        self.channels.iter().filter(|(_, c)| c.path != "weights").for_each(|(node, _)| moves[*node] = true);
        for &node in &self.order {
            moves[node] |= self.nodes[node].parent.is_some_and(|parent| moves[parent]);
        }
        moves
    }

    /// Returns the instances of the document's scene that move as a whole.
    pub fn placed(&self) -> impl Iterator<Item = u32> + '_ {
        self.placed.iter().map(|placed| placed.instance)
    }

    /// Returns the instances of the document's scene that deform.
    pub fn deforming(&self) -> impl Iterator<Item = u32> + '_ {
        self.bodies.iter().map(|body| body.instance)
    }

    /// Returns where all nodes are at a time in seconds.
    fn pose(&self, time: f64) -> Pose {
        let time = if self.seconds > 0.0 { time.rem_euclid(self.seconds) } else { 0.0 };
        let mut poses: Vec<Option<RestPose>> = vec![None; self.nodes.len()];
        let mut weights = vec![None; self.nodes.len()];
        for (node, channel) in &self.channels {
            let Some(value) = curve::value(channel, time) else { continue };
            if channel.path == "weights" {
                weights[*node] = Some(value);
            } else {
                change(poses[*node].get_or_insert(self.nodes[*node].rest), &channel.path, &value);
            }
        }
        let mut worlds = vec![DAffine3::IDENTITY; self.nodes.len()];
        for &node in &self.order {
            let local = poses[node].map_or(self.nodes[node].local, |pose| {
                DAffine3::from_scale_rotation_translation(pose.scale, pose.rotation, pose.translation)
            });
            worlds[node] = self.nodes[node].parent.map_or(local, |parent| worlds[parent] * local);
        }
        Pose { worlds, weights }
    }
}

/// Returns the node of a channel that moves one or changes its weights.
fn of_node(channel: Channel) -> Option<(usize, Channel)> {
    let is_known = ["translation", "rotation", "scale", "weights"].contains(&channel.path.as_str());
    match channel.target {
        Property::Node(node) if is_known => Some((node, channel)),
        _ => None,
    }
}

/// Sets a part of a pose.
fn change(pose: &mut RestPose, path: &str, value: &[f64]) {
    match (path, value) {
        ("translation", &[x, y, z]) => pose.translation = DVec3::new(x, y, z),
        ("scale", &[x, y, z]) => pose.scale = DVec3::new(x, y, z),
        ("rotation", &[x, y, z, w]) => {
            let rotation = DQuat::from_xyzw(x, y, z, w);
            if rotation.length() > 0.0 {
                pose.rotation = rotation.normalize();
            }
        }
        _ => {}
    }
}

/// Returns nodes with parents before their children; there are no cycles.
fn in_order(parents: &[Option<usize>]) -> Vec<usize> {
    let mut children = vec![Vec::new(); parents.len()];
    let mut order = Vec::with_capacity(parents.len());
    for (node, parent) in parents.iter().enumerate() {
        match parent {
            Some(parent) => children[*parent].push(node),
            None => order.push(node),
        }
    }
    let mut next = 0;
    while next < order.len() {
        order.extend_from_slice(&children[order[next]]);
        next += 1;
    }
    order
}
