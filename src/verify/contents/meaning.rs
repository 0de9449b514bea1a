//! Compares nodes and what they carry.

use std::collections::{BTreeMap, BTreeSet};

use glam::DAffine3;
use raykiln_formats::properties::{NodeContent, Property, Skin};

use super::super::{Side, Sides};
use super::findings::Findings;
use super::nodes::{Nodes, stem};
use super::property::{Changed, Correspondence, changes, same_number, same_numbers};
use super::{DifferenceKind as Kind, Inputs};

/// Entries of two matrices that differ by no more than this share of the largest entry are equal.
const SAME_ENTRY: f64 = 2e-6;

/// A missing name is an error if there are at least this many names for each that is missing.
const KEPT_NAMES: usize = 4;

/// What nodes are compared with.
pub(super) struct Meaning<'a> {
    pub(super) inputs: &'a Inputs<'a>,
    pub(super) nodes: &'a Nodes,
    pub(super) contents: Sides<Vec<NodeContent>>,
    skins: Sides<&'a [Skin]>,
    /// Nodes of the input that are joints.
    joints: BTreeSet<usize>,
    pub(super) same: &'a dyn Correspondence,
    /// The largest distance between the places of a node, in world units.
    pub(super) distance: f64,
    /// For each node of the input, whether an animation moves it.
    pub(super) animated: Vec<bool>,
}

impl<'a> Meaning<'a> {
    pub(super) fn of(
        inputs: &'a Inputs<'a>,
        nodes: &'a Nodes,
        same: &'a dyn Correspondence,
        skins: Sides<&'a [Skin]>,
        distance: f64,
        animated: Vec<bool>,
    ) -> Meaning<'a> {
        let contents = inputs.documents.zip(nodes.hierarchies.as_ref());
        let contents = contents.map(|(doc, all)| (0..all.nodes.len()).map(|node| doc.node_content(node)).collect());
        let joints = skins.before.iter().flat_map(|skin| &skin.joints).copied().collect();
        Meaning { inputs, nodes, contents, skins, joints, same, distance, animated }
    }

    /// Compares all nodes.
    pub(super) fn compare(&self, found: &mut Findings) {
        for before in 0..self.nodes.after.len() {
            match self.nodes.after[before] {
                Some(after) => self.node(before, after, found),
                None => self.missing(before, found),
            }
        }
        self.cameras_and_lights(found);
        self.names(found);
    }

    fn node(&self, before: usize, after: usize, found: &mut Findings) {
        let name = self.nodes.name(before);
        let (b, a) = (&self.contents.before[before], &self.contents.after[after]);
        self.place(before, after, found);
        self.parent(before, after, found);
        let property = |kind, path: &str, [b, a]: [Option<&Property>; 2], found: &mut Findings| {
            found.properties(kind, Some(&name), path, [b, a], self.same);
        };
        property(Kind::NodeExtras, "extras", [b.extras.as_ref(), a.extras.as_ref()], found);
        let told = |key: &&String| !LIGHTS.contains(&key.as_str());
        for key in b.extensions.keys().chain(a.extensions.keys()).filter(told).collect::<BTreeSet<_>>() {
            let path = format!("extensions.{key}");
            property(Kind::NodeExtension, &path, [b.extensions.get(key), a.extensions.get(key)], found);
        }
        if !are_same_weights(b.weights.as_deref(), a.weights.as_deref()) {
            let [b, a] = [b, a].map(|content| content.weights.as_ref().map(|weights| format!("{weights:?}")));
            found.property(Kind::MorphWeights, Some(&name), Changed { path: "weights".into(), before: b, after: a });
        }
        let skin = |side: Side, node: usize| self.nodes.get(side, node).skin;
        let skins = Sides { before: skin(Side::Before, before), after: skin(Side::After, after) }.zip(self.skins);
        let skins = skins.map(|(skin, all)| skin.and_then(|skin| all.get(skin)));
        if let Some(changed) = self.skin(skins.before, skins.after) {
            found.property(Kind::Skin, Some(&name), changed);
        }
        self.placed_mesh(before, after, found);
    }

    /// Compares the place of a node in the world.
    fn place(&self, before: usize, after: usize, found: &mut Findings) {
        let (b, a) = (self.nodes.world.before[before], self.nodes.world.after[after]);
        if self.are_in_one_place(&b, &a) {
            return;
        }
        // The geometry shows whether a mesh is in its place: tools that quantise put the scale into the node.
        let carries = |side: Side, node: usize| {
            let (content, node) = (&self.contents[side][node], self.nodes.get(side, node));
            content.camera.is_some()
                || !content.extensions.is_empty()
                || !node.children.is_empty()
                || node.mesh.is_none()
        };
        let acts = self.animated[before] || self.joints.contains(&before);
        let kind = if acts || carries(Side::Before, before) || carries(Side::After, after) {
            Kind::NodeMoved
        } else {
            Kind::NodeRescaled
        };
        let text = |m: &DAffine3| Some(format!("{:?}", m.to_cols_array()));
        found.property(
            kind,
            Some(&self.nodes.name(before)),
            Changed { path: "world transform".into(), before: text(&b), after: text(&a) },
        );
    }

    fn are_in_one_place(&self, before: &DAffine3, after: &DAffine3) -> bool {
        let [b, a] = [before, after].map(|m| m.matrix3.to_cols_array());
        let largest = b.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let are_turned = b.iter().zip(&a).any(|(b, a)| (b - a).abs() > SAME_ENTRY * largest);
        let reach = before.translation.abs().max_element();
        !are_turned && before.translation.distance(after.translation) <= self.distance.max(SAME_ENTRY * reach)
    }

    /// Compares what a node is below.
    fn parent(&self, before: usize, after: usize, found: &mut Findings) {
        let nodes = self.nodes;
        let b = nodes.get(Side::Before, before).parent;
        let a = nodes.get(Side::After, after).parent;
        if b.and_then(|parent| nodes.after[parent]) == a && (b.is_none() || a.is_some()) {
            return;
        }
        let animated = |side: Side, node: usize| {
            let mut above = nodes.above(side, node);
            above.find(|&at| match side {
                Side::Before => self.animated[at],
                Side::After => nodes.before[at].is_some_and(|at| self.animated[at]),
            })
        };
        let moves_alike = animated(Side::Before, before).and_then(|at| nodes.after[at]) == animated(Side::After, after);
        let kind = if nodes.are_numbered || !moves_alike { Kind::NodeReparented } else { Kind::NodeRegrouped };
        let name = |side: Side, node: Option<usize>| {
            node.map(|node| nodes.get(side, node).name.clone().unwrap_or_else(|| format!("node {node}")))
        };
        let changed = Changed { path: "parent".into(), before: name(Side::Before, b), after: name(Side::After, a) };
        found.property(kind, Some(&nodes.name(before)), changed);
    }

    /// Says of a node that it is missing.
    fn missing(&self, before: usize, found: &mut Findings) {
        let content = &self.contents.before[before];
        let acts = self.nodes.get(Side::Before, before).skin.is_some() || self.animated[before];
        let says = content.extensions.keys().any(|key| !LIGHTS.contains(&key.as_str()));
        let kind = match (acts || says, content.extras.is_some()) {
            (true, _) => Kind::NodeLost,
            (false, true) => Kind::NodeGoneWithExtras,
            (false, false) => Kind::NodeGone,
        };
        found.object(kind, &self.nodes.name(before));
    }

    /// Compares skins by their joints.
    fn skin(&self, before: Option<&Skin>, after: Option<&Skin>) -> Option<Changed> {
        let text = |skin: Option<&Skin>, what: &str| skin.map(|skin| format!("{} {what}", skin.joints.len()));
        let differs =
            |path: &str| Changed { path: path.into(), before: text(before, "joints"), after: text(after, "joints") };
        let (b, a) = match (before, after) {
            (None, None) => return None,
            (Some(b), Some(a)) => (b, a),
            _ => return Some(differs("skin")),
        };
        let mapped: Vec<Option<usize>> = b.joints.iter().map(|&joint| self.nodes.after[joint]).collect();
        let places: Vec<Option<usize>> =
            mapped.iter().map(|joint| a.joints.iter().position(|other| Some(*other) == *joint)).collect();
        if a.joints.len() != b.joints.len() || places.contains(&None) {
            return Some(differs("skin.joints"));
        }
        if b.skeleton.map(|node| self.nodes.after[node]) != a.skeleton.map(Some) {
            return Some(differs("skin.skeleton"));
        }
        let matrix = |skin: &Skin, joint: usize| {
            let all = &skin.inverse_bind_matrices;
            all.get(16 * joint..16 * joint + 16).map_or(IDENTITY.to_vec(), <[f64]>::to_vec)
        };
        let is_off = |(b_joint, a_joint): (usize, &Option<usize>)| {
            let other = a_joint.map(|joint| matrix(a, joint)).unwrap_or_default();
            !same_numbers(&matrix(b, b_joint), &other)
        };
        places.iter().enumerate().any(is_off).then(|| differs("skin.inverseBindMatrices"))
    }

    /// Compares what the meshes say that two nodes place.
    fn placed_mesh(&self, before: usize, after: usize, found: &mut Findings) {
        let Some(mesh) = self.nodes.get(Side::Before, before).mesh else { return };
        let told = self.inputs.documents.before.mesh_content(mesh);
        let name = self.nodes.name(before);
        let record = self.contents.after[after].placed_mesh.as_ref();
        let now = self.nodes.get(Side::After, after).mesh.map(|mesh| self.inputs.documents.after.mesh_content(mesh));
        let extras = match record {
            Some(record) => record.get("extras").cloned(),
            None => now.as_ref().and_then(|now| now.extras.clone()),
        };
        found.properties(
            Kind::MeshExtras,
            Some(&name),
            "mesh.extras",
            [told.extras.as_ref(), extras.as_ref()],
            self.same,
        );
        for (key, extension) in &told.extensions {
            let other = now.as_ref().and_then(|now| now.extensions.get(key));
            let path = format!("mesh.extensions.{key}");
            found.properties(Kind::MeshExtension, Some(&name), &path, [Some(extension), other], self.same);
        }
        let told_now = record.and_then(|record| record.get("name")).map(|name| match name {
            Property::Text(name) => name.clone(),
            other => other.short(),
        });
        let name_now = told_now.or_else(|| now.and_then(|now| now.name));
        if told.name.is_some() && told.name != name_now {
            let changed = Changed { path: "mesh.name".into(), before: told.name, after: name_now };
            found.property(Kind::MeshName, Some(&name), changed);
        }
    }

    /// Compares cameras and lights.
    fn cameras_and_lights(&self, found: &mut Findings) {
        self.carried([Kind::Camera, Kind::CameraAdded], camera, found);
        self.carried([Kind::Light, Kind::LightAdded], light, found);
    }

    /// Compares what nodes carry: it must be there with the same properties, at the same node or else in the same place.
    fn carried(&self, kinds: [Kind; 2], of: fn(&NodeContent) -> Option<&Property>, found: &mut Findings) {
        let all = |side: Side| -> Vec<(usize, &Property)> {
            let contents = self.contents[side].iter().enumerate();
            contents.filter_map(|(node, content)| Some((node, of(content)?))).collect()
        };
        let mut free = all(Side::After);
        for (node, property) in all(Side::Before) {
            let is_there = |(after, other): &(usize, &Property)| {
                let (b, a) = (&self.nodes.world.before[node], &self.nodes.world.after[*after]);
                self.are_in_one_place(b, a) && changes(property, other, self.same).is_empty()
            };
            let matched = self.nodes.after[node];
            let own = free.iter().position(|at| Some(at.0) == matched);
            // A node that is found may be animated: another in its place would move otherwise.
            let other = || free.iter().position(is_there).filter(|_| matched.is_none());
            let now = own.or_else(other).map(|at| free.remove(at).1);
            let values = [Some(property), now];
            let name = self.nodes.name(node);
            found.properties_by(|path| kind_of(kinds[0], path), Some(&name), kinds[0].name(), values, self.same);
        }
        for (node, property) in free {
            let changed = Changed { path: format!("nodes[{node}]"), before: None, after: Some(property.short()) };
            found.property(kinds[1], None, changed);
        }
    }

    /// Compares the names of nodes that are found by number, or by a name that differs in its number.
    fn names(&self, found: &mut Findings) {
        let matched = || self.nodes.after.iter().enumerate().filter_map(|(b, a)| Some((b, (*a)?)));
        let both = |(before, after): (usize, usize)| {
            (&self.nodes.get(Side::Before, before).name, &self.nodes.get(Side::After, after).name)
        };
        let kept = matched().map(both).filter(|(b, a)| b.is_some() && b == a).count();
        let dropped = matched().map(both).filter(|(b, a)| b.is_some() && a.is_none()).count();
        // A tool leaves out all names, or those of the nodes that it makes anew.
        let are_left_out = kept < KEPT_NAMES * dropped;
        for at in matched() {
            let (b, a) = both(at);
            let kind = match (b, a) {
                _ if b == a => continue,
                (Some(_), None) if are_left_out => Kind::NamesGone,
                (Some(b), Some(a)) if stem(b) == stem(a) && !self.nodes.are_numbered => Kind::NameNumbered,
                _ => Kind::NodeRenamed,
            };
            let changed = Changed { path: "name".into(), before: b.clone(), after: a.clone() };
            found.property(kind, Some(&self.nodes.name(at.0)), changed);
        }
    }

    /// Compares scenes by the nodes that they show.
    pub(super) fn scenes(&self, found: &mut Findings) {
        let Sides { before, after } = &self.nodes.hierarchies;
        for (i, scene) in before.scenes.iter().enumerate() {
            let name = scene.name.clone().unwrap_or_else(|| format!("scene {i}"));
            let by_name = || after.scenes.iter().find(|s| s.name == scene.name && s.name.is_some());
            let by_number = || after.scenes.get(i).filter(|_| before.scenes.len() == after.scenes.len());
            let Some(now) = by_number().or_else(by_name).or_else(|| after.scenes.get(i)) else {
                found.object(Kind::SceneMissing, &name);
                continue;
            };
            self.shown(&name, Sides { before: &scene.roots, after: &now.roots }, found);
            let [b, a] = [scene, now].map(|s| Property::Object(s.more.clone()));
            found.properties(Kind::SceneData, Some(&name), "scene", [Some(&b), Some(&a)], self.same);
            if scene.name.is_some() && scene.name != now.name {
                let changed = Changed { path: "name".into(), before: scene.name.clone(), after: now.name.clone() };
                found.property(Kind::SceneName, Some(&name), changed);
            }
        }
        if before.default.min(before.scenes.len()) != after.default.min(after.scenes.len()) {
            let [b, a] = [before, after].map(|h| Some(h.default.to_string()));
            found.property(Kind::DefaultScene, None, Changed { path: "scene".into(), before: b, after: a });
        }
    }

    /// Compares the nodes that a scene shows: those of the input that are found must be shown, and no others of it.
    fn shown(&self, scene: &str, roots: Sides<&Vec<usize>>, found: &mut Findings) {
        let shown = |side: Side| self.nodes.below(side, roots[side].clone()).collect::<BTreeSet<usize>>();
        let [before, after] = Side::BOTH.map(shown);
        let expected: BTreeMap<usize, usize> =
            before.iter().filter_map(|&node| Some((self.nodes.after[node]?, node))).collect();
        for (after_node, node) in &expected {
            if !after.contains(after_node) {
                let told = Changed { path: self.nodes.name(*node), before: Some("shown".into()), after: None };
                found.property(Kind::SceneNodes, Some(scene), told);
            }
        }
        for node in after.iter().filter_map(|&node| self.nodes.before[node]).filter(|node| !before.contains(node)) {
            let told = Changed { path: self.nodes.name(node), before: None, after: Some("shown".into()) };
            found.property(Kind::SceneNodes, Some(scene), told);
        }
    }
}

/// Returns the kind of a difference of a camera or light by the path of the property.
fn kind_of(kind: Kind, path: &str) -> Kind {
    if path.ends_with(".znear") || path.ends_with(".zfar") { Kind::CameraClipping } else { kind }
}

/// Extensions that are compared as lights.
const LIGHTS: [&str; 1] = ["KHR_lights_punctual"];

fn camera(content: &NodeContent) -> Option<&Property> {
    content.camera.as_ref()
}

fn light(content: &NodeContent) -> Option<&Property> {
    content.extensions.get(LIGHTS[0])
}

/// The matrix of a joint without one of its own.
const IDENTITY: [f64; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

fn are_same_weights(before: Option<&[f64]>, after: Option<&[f64]>) -> bool {
    let [b, a] = [before, after].map(Option::unwrap_or_default);
    (0..b.len().max(a.len())).all(|i| same_number(b.get(i).copied().unwrap_or(0.0), a.get(i).copied().unwrap_or(0.0)))
}
