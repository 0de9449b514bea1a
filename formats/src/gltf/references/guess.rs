//! What an extension that is not known may refer to, judged by the names of its properties and by JSON pointers.

use serde_json::Value;

use super::List;
use super::paths::{Step, Tree};
use crate::gltf::json::unsigned;

/// The element of a list that a JSON pointer names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pointed {
    /// One element.
    Element(usize),
    /// Any: the number is filled in later (`/nodes/{index}/translation`).
    Any,
}

/// Returns what JSON pointers in a value point to, in lists that a bake changes.
pub(crate) fn pointers(value: &Value) -> Vec<(List, Pointed)> {
    let mut found = Vec::new();
    let mut todo = vec![value];
    while let Some(value) = todo.pop() {
        match value {
            Value::String(text) => found.extend(pointer(text)),
            _ => value.children(&mut |_, child| todo.push(child)),
        }
    }
    found
}

fn pointer(text: &str) -> Option<(List, Pointed)> {
    // A pointer may be written as a fragment of a URI (RFC 6901, section 6).
    let path = text.strip_prefix('#').unwrap_or(text).strip_prefix('/')?;
    let mut parts = path.split('/');
    let (list, element) = (parts.next()?, parts.next()?);
    let list = List::ALL.into_iter().find(|of| of.key() == list)?;
    Some(match element.parse() {
        Ok(number) => (list, Pointed::Element(number)),
        Err(_) if element.starts_with(['{', '[']) => (list, Pointed::Any),
        Err(_) => return None,
    })
}

/// Returns the numbers in a value that its keys say refer to a list. If `all`, each other number that may be one counts
/// as a node and as a mesh as well.
pub(super) fn numbers(value: &Value, all: bool) -> Vec<(List, usize)> {
    let mut found = Vec::new();
    let mut todo = vec![(Meaning::Unknown, value)];
    while let Some((meaning, value)) = todo.pop() {
        if let Some(number) = unsigned(value).filter(|_| value.is_number()) {
            match meaning {
                Meaning::List(list) => found.push((list, number)),
                Meaning::Unknown if all => found.extend([(List::Nodes, number), (List::Meshes, number)]),
                Meaning::Unknown | Meaning::Other => {}
            }
        }
        value.children(&mut |step, child| {
            let meaning = match step {
                Step::Index(_) => meaning,
                // {"node": {"index": 3}} means what {"node": 3} does.
                Step::Key(key) => meaning_of(key).unwrap_or(if child.is_number() { meaning } else { Meaning::Unknown }),
            };
            todo.push((meaning, child));
        });
    }
    found
}

/// What numbers below a key mean.
#[derive(Clone, Copy, PartialEq)]
enum Meaning {
    List(List),
    /// Something that a bake leaves as it is.
    Other,
    Unknown,
}

/// Ends of keys that refer to a list, in lower case and in the singular.
const NAMES: &[(&str, Meaning)] = &[
    ("node", Meaning::List(List::Nodes)),
    ("bone", Meaning::List(List::Nodes)),
    ("joint", Meaning::List(List::Nodes)),
    ("mesh", Meaning::List(List::Meshes)),
    ("accessor", Meaning::List(List::Accessors)),
    ("bufferview", Meaning::List(List::Views)),
    ("texture", Meaning::Other),
    ("image", Meaning::Other),
    ("sampler", Meaning::Other),
    ("material", Meaning::Other),
    ("animation", Meaning::Other),
    ("camera", Meaning::Other),
    ("scene", Meaning::Other),
    ("skin", Meaning::Other),
    ("version", Meaning::Other),
    ("count", Meaning::Other),
    ("byteoffset", Meaning::Other),
    ("bytelength", Meaning::Other),
];

/// Returns what a key says of the numbers below it.
fn meaning_of(key: &str) -> Option<Meaning> {
    let mut name = key.to_ascii_lowercase().replace(['_', '-'], "");
    for end in ["indices", "index", "idx", "ids", "id", "refs", "ref"] {
        if let Some(stem) = name.strip_suffix(end).filter(|stem| !stem.is_empty()) {
            name = stem.to_owned();
            break;
        }
    }
    let singular = name.strip_suffix("es").filter(|stem| stem.ends_with("mesh")).or_else(|| name.strip_suffix('s'));
    let name = singular.unwrap_or(&name);
    NAMES.iter().find(|(end, _)| name.ends_with(end)).map(|(_, meaning)| *meaning)
}
