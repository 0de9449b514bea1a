//! Which nodes and meshes must stay as they are, and which nodes are not part of the scene.

use std::collections::BTreeMap;

use serde_json::Value;

use super::guess::{self, Pointed};
use super::{List, Owner, core, of_object, paths, table};
use crate::contents::Hold;
use crate::edit::has_room;
use crate::extension_names::*;
use crate::gltf::json::unsigned;
use crate::{Document, Warning};

/// What must stay, and what is not shown.
pub(in crate::gltf) struct Holds {
    /// By node, why it keeps its mesh and its place, with all nodes below it.
    pub(in crate::gltf) nodes: Vec<Option<Hold>>,
    /// By mesh, why it stays whole.
    pub(in crate::gltf) meshes: Vec<Option<Hold>>,
    /// By node, whether it is not shown, with all nodes below it.
    pub(in crate::gltf) hidden: Vec<bool>,
    /// Which extensions are not known, and what stays because of them.
    pub(in crate::gltf) warnings: Vec<Warning>,
}

/// Concludes what must stay in a document.
pub(in crate::gltf) fn holds(doc: &Document) -> Holds {
    let json = &doc.json;
    let count = |list: &str| json.get(list).and_then(Value::as_array).map_or(0, Vec::len);
    let nodes = vec![None; count("nodes")];
    let meshes = vec![None; count("meshes")];
    let hidden = vec![false; nodes.len()];
    let mut finder =
        Finder { nodes, meshes, hidden, accessors: Vec::new(), views: Vec::new(), unknown: BTreeMap::new() };
    paths::each_extension(json, &mut |owner, name, object| finder.extension(owner, name, object));
    finder.joints(json);
    finder.nodes_alone(json);
    finder.meshes_alone(json);
    let warnings = finder.unknown.iter().map(|(name, unknown)| unknown.warning(name)).collect();
    Holds { nodes: finder.nodes, meshes: finder.meshes, hidden: finder.hidden, warnings }
}

/// Returns why a node keeps its mesh, judged by the node alone.
fn node_hold(node: &Value) -> Option<Hold> {
    let extensions = node.get("extensions").and_then(Value::as_object).into_iter().flatten();
    let stays = |(name, object): (&String, &Value)| table::find(name).is_none_or(|row| row.on_node.stays(object));
    if extensions.clone().into_iter().any(stays) {
        return Some(Hold::Extension);
    }
    let has_light = extensions.into_iter().any(|(name, _)| name == KHR_LIGHTS_PUNCTUAL);
    if node.get("camera").is_some() || has_light {
        return Some(Hold::Attached);
    }
    (node.get("mesh").is_some() && !has_room(node)).then_some(Hold::NoRoom)
}

/// What an extension that is not known keeps from being restructured.
#[derive(Default)]
struct Unknown {
    /// Nodes that carry it or that it may refer to.
    nodes: Vec<usize>,
    /// The same for meshes.
    meshes: Vec<usize>,
    /// Whether it may refer to any node.
    everything: bool,
}

struct Finder {
    nodes: Vec<Option<Hold>>,
    meshes: Vec<Option<Hold>>,
    hidden: Vec<bool>,
    /// Accessors whose elements mean something unknown.
    accessors: Vec<usize>,
    /// Buffer views whose bytes mean something unknown.
    views: Vec<usize>,
    unknown: BTreeMap<String, Unknown>,
}

impl Finder {
    fn extension(&mut self, owner: Owner, name: &str, object: &Value) {
        let row = table::find(name);
        let found = match row {
            None => guess::numbers(object, owner == Owner::Root),
            Some(row) if row.guessed => guess::numbers(object, false),
            Some(row) => {
                let mut found = Vec::new();
                let refers = row.refers_from(owner);
                of_object(name, object, &mut |list, at| {
                    found.extend(unsigned(at).filter(|_| refers).map(|n| (list, n)))
                });
                found
            }
        };
        if row.is_none() {
            self.unknown.entry(name.to_owned()).or_default();
        }
        for (list, number) in found {
            self.hold(list, number, Hold::Referred, row.is_none().then_some(name));
        }
        self.pointers(object, row.is_none().then_some(name));
        self.carried(owner, name, row, object);
        match (owner, name) {
            (Owner::Node(node), KHR_NODE_VISIBILITY) => {
                self.hidden[node] |= object.get("visible") == Some(&Value::Bool(false));
            }
            (Owner::Node(node), MSFT_LOD) => of_object(name, object, &mut |_, at| {
                if let Some(hidden) = unsigned(at).filter(|&n| n != node).and_then(|n| self.hidden.get_mut(n)) {
                    *hidden = true;
                }
            }),
            _ => {}
        }
    }

    /// Holds what carries an extension.
    fn carried(&mut self, owner: Owner, name: &str, row: Option<&table::Extension>, object: &Value) {
        let unknown = row.is_none().then_some(name);
        let stays = |carried: fn(&table::Extension) -> table::Carried| row.is_none_or(|row| carried(row).stays(object));
        match owner {
            Owner::Node(node) if stays(|row| row.on_node) => self.hold(List::Nodes, node, Hold::Extension, unknown),
            Owner::Mesh(mesh) if stays(|row| row.on_mesh) => {
                self.hold(List::Meshes, mesh, Hold::MeshExtension, unknown)
            }
            Owner::Primitive(mesh) if stays(|row| row.on_primitive) => {
                self.hold(List::Meshes, mesh, Hold::Order, unknown);
            }
            Owner::Accessor(accessor) if row.is_none() => self.accessors.push(accessor),
            Owner::View(view) if row.is_none() => self.views.push(view),
            _ => {}
        }
    }

    fn pointers(&mut self, object: &Value, unknown: Option<&str>) {
        for (list, pointed) in guess::pointers(object) {
            match pointed {
                Pointed::Element(number) => self.hold(list, number, Hold::Referred, unknown),
                Pointed::Any => {
                    self.everything();
                    if let Some(unknown) = unknown.and_then(|name| self.unknown.get_mut(name)) {
                        unknown.everything = true;
                    }
                }
            }
        }
    }

    fn everything(&mut self) {
        self.nodes.iter_mut().for_each(|hold| *hold = hold.or(Some(Hold::Referred)));
    }

    fn hold(&mut self, list: List, number: usize, hold: Hold, unknown: Option<&str>) {
        let holds = match list {
            List::Nodes => &mut self.nodes,
            List::Meshes => &mut self.meshes,
            List::Accessors | List::Views => return,
        };
        let Some(slot) = holds.get_mut(number) else { return };
        *slot = slot.or(Some(hold));
        if let Some(unknown) = unknown.and_then(|name| self.unknown.get_mut(name)) {
            if list == List::Nodes { unknown.nodes.push(number) } else { unknown.meshes.push(number) }
        }
    }

    /// Joints are moved by animations of other files or by the application, with all that hangs on them.
    fn joints(&mut self, json: &Value) {
        paths::walk(json, "skins.*.joints.*", &mut |joint| {
            if let Some(slot) = unsigned(joint).and_then(|joint| self.nodes.get_mut(joint)) {
                *slot = slot.or(Some(Hold::Joint));
            }
        });
    }

    fn nodes_alone(&mut self, json: &Value) {
        let nodes = json.get("nodes").and_then(Value::as_array).into_iter().flatten();
        for (slot, node) in self.nodes.iter_mut().zip(nodes) {
            *slot = slot.or_else(|| node_hold(node));
        }
    }

    /// Holds meshes whose primitives cannot be rewritten, or leave no room to record where their triangles went.
    fn meshes_alone(&mut self, json: &Value) {
        paths::walk(json, "accessors", &mut |list| {
            let all = list.as_array().into_iter().flatten().enumerate();
            let is_odd = |accessor: &Value| {
                let view = accessor.get("bufferView").and_then(unsigned);
                view.is_some_and(|view| self.views.contains(&view))
            };
            self.accessors.extend(all.filter(|(_, accessor)| is_odd(accessor)).map(|(i, _)| i));
        });
        let is_matrix = |accessor: usize| {
            let kind = json.get("accessors").and_then(|list| list.get(accessor)?.get("type")?.as_str());
            kind.is_some_and(|kind| kind.starts_with("MAT"))
        };
        let meshes = json.get("meshes").and_then(Value::as_array).into_iter().flatten();
        for (slot, mesh) in self.meshes.iter_mut().zip(meshes) {
            paths::walk(mesh, "primitives.*", &mut |primitive| {
                let mut of_primitive = Vec::new();
                for (path, _) in core::OF_PRIMITIVE {
                    paths::walk(primitive, path, &mut |at| of_primitive.extend(unsigned(at)));
                }
                let hold = if of_primitive.iter().any(|accessor| self.accessors.contains(accessor)) {
                    Some(Hold::Order)
                } else {
                    of_primitive.iter().any(|&accessor| is_matrix(accessor)).then_some(Hold::Matrix)
                };
                *slot = slot.or(hold);
            });
        }
    }
}

impl Unknown {
    fn warning(&self, name: &str) -> Warning {
        let list = |what: &str, numbers: &[usize]| {
            let mut numbers = numbers.to_vec();
            numbers.sort_unstable();
            numbers.dedup();
            (!numbers.is_empty()).then(|| format!("{what} {}", listed(&numbers)))
        };
        let held: Vec<String> =
            [list("nodes", &self.nodes), list("meshes", &self.meshes)].into_iter().flatten().collect();
        let message = if self.everything {
            "is not known and may refer to any node: nothing is restructured".to_owned()
        } else if held.is_empty() {
            "is not known; it is carried through as it is".to_owned()
        } else {
            format!("is not known; what carries it or what it may refer to stays as it is: {}", held.join("; "))
        };
        Warning { place: name.to_owned(), message }
    }
}

/// Most numbers that a warning lists.
const MOST_LISTED: usize = 10;

fn listed(numbers: &[usize]) -> String {
    let some: Vec<String> = numbers.iter().take(MOST_LISTED).map(ToString::to_string).collect();
    let more =
        if numbers.len() > MOST_LISTED { format!(" and {} more", numbers.len() - MOST_LISTED) } else { String::new() };
    format!("{}{more}", some.join(", "))
}
