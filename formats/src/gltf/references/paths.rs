//! Walks a JSON tree along paths, and finds the extension objects in it; the same code reads and changes.

use serde_json::Value;

use super::Owner;

/// One step from a JSON value to a value in it.
#[derive(Clone, Copy)]
pub(super) enum Step<'k> {
    /// A property of an object.
    Key(&'k str),
    /// An element of an array.
    Index(usize),
}

/// A JSON value that is read (`&Value`) or changed (`&mut Value`).
pub(super) trait Tree: Sized {
    /// Returns a property of an object.
    fn property(self, key: &str) -> Option<Self>;
    /// Calls a function with each property or element.
    fn children(self, visit: &mut dyn FnMut(Step<'_>, Self));
    /// The value.
    fn value(&self) -> &Value;
}

impl Tree for &Value {
    fn property(self, key: &str) -> Option<Self> {
        self.get(key)
    }

    fn children(self, visit: &mut dyn FnMut(Step<'_>, Self)) {
        match self {
            Value::Object(map) => map.iter().for_each(|(key, value)| visit(Step::Key(key), value)),
            Value::Array(list) => list.iter().enumerate().for_each(|(i, value)| visit(Step::Index(i), value)),
            _ => {}
        }
    }

    fn value(&self) -> &Value {
        self
    }
}

impl Tree for &mut Value {
    fn property(self, key: &str) -> Option<Self> {
        self.get_mut(key)
    }

    fn children(self, visit: &mut dyn FnMut(Step<'_>, Self)) {
        match self {
            Value::Object(map) => map.iter_mut().for_each(|(key, value)| visit(Step::Key(key), value)),
            Value::Array(list) => list.iter_mut().enumerate().for_each(|(i, value)| visit(Step::Index(i), value)),
            _ => {}
        }
    }

    fn value(&self) -> &Value {
        self
    }
}

/// Calls a function with each value at a path: keys separated by dots, `*` for each property or element. An empty path
/// is the value itself.
pub(super) fn walk<T: Tree>(from: T, path: &str, visit: &mut dyn FnMut(T)) {
    let (step, rest) = path.split_once('.').unwrap_or((path, ""));
    match step {
        "" => visit(from),
        "*" => from.children(&mut |_, child| walk(child, rest, visit)),
        key => from.property(key).into_iter().for_each(|child| walk(child, rest, visit)),
    }
}

/// Calls a function with each extension object of a document, in file order: who carries it, its name, and itself.
/// Extras are left out. No recursion depth follows the input.
pub(super) fn each_extension<T: Tree>(root: T, visit: &mut dyn FnMut(Owner, &str, &mut T)) {
    let mut todo = vec![(Owner::Root, root)];
    while let Some((owner, value)) = todo.pop() {
        let first = todo.len();
        value.children(&mut |step, child| match step {
            Step::Key("extras") => {}
            Step::Key("extensions") if child.value().is_object() => child.children(&mut |name, mut object| {
                if let Step::Key(name) = name {
                    visit(owner.of_extension(), name, &mut object);
                }
                todo.push((owner, object));
            }),
            _ if child.value().is_object() || child.value().is_array() => todo.push((owner.below(step), child)),
            _ => {}
        });
        todo[first..].reverse();
    }
}
