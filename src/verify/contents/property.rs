//! Compares properties.

use std::collections::BTreeSet;

use raykiln_formats::properties::Property;

/// Numbers that differ by no more than this share of the larger one are equal: tools write six significant digits.
const SAME_NUMBER: f64 = 6e-6;

/// Whether two references, one of each file, refer to the same.
pub(super) trait Correspondence {
    /// Whether two images are the same.
    fn images(&self, before: usize, after: usize) -> bool;
    /// Whether two materials show the same.
    fn materials(&self, _before: Option<usize>, _after: Option<usize>) -> bool {
        false
    }
    /// Whether two nodes are the same.
    fn nodes(&self, _before: usize, _after: usize) -> bool {
        false
    }
}

/// A property that differs.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Changed {
    /// Its path; parts are separated by dots.
    pub(super) path: String,
    /// Its value in the input, if it has one.
    pub(super) before: Option<String>,
    /// Its value in the output, if it has one.
    pub(super) after: Option<String>,
}

/// Returns the properties that differ, in order of their paths.
pub(super) fn changes(before: &Property, after: &Property, same: &dyn Correspondence) -> Vec<Changed> {
    let mut found = Vec::new();
    collect("", Some(before), Some(after), same, &mut found);
    found
}

/// Whether two numbers are equal up to the digits that tools write.
pub(super) fn same_number(before: f64, after: f64) -> bool {
    let is_close = (before - after).abs() <= SAME_NUMBER * before.abs().max(after.abs());
    before == after || is_close || before.is_nan() && after.is_nan()
}

/// Whether two lists of numbers are equal up to the digits that tools write.
pub(super) fn same_numbers(before: &[f64], after: &[f64]) -> bool {
    before.len() == after.len() && before.iter().zip(after).all(|(b, a)| same_number(*b, *a))
}

fn collect(
    path: &str,
    before: Option<&Property>,
    after: Option<&Property>,
    same: &dyn Correspondence,
    found: &mut Vec<Changed>,
) {
    use Property::{List, Object};
    match (before, after) {
        (Some(Object(b)), Some(Object(a))) => {
            for key in b.keys().chain(a.keys()).collect::<BTreeSet<_>>() {
                collect(&below(path, key), b.get(key), a.get(key), same, found);
            }
        }
        // Of what only one has, each part is told, but textures whole.
        (Some(Object(one)), None) | (None, Some(Object(one))) if !one.is_empty() && !path.ends_with("Texture") => {
            for (key, value) in one {
                let values = if before.is_some() { [Some(value), None] } else { [None, Some(value)] };
                collect(&below(path, key), values[0], values[1], same, found);
            }
        }
        (Some(List(b)), Some(List(a))) if b.len() == a.len() => {
            for (i, (b, a)) in b.iter().zip(a).enumerate() {
                collect(&format!("{path}[{i}]"), Some(b), Some(a), same, found);
            }
        }
        (Some(b), Some(a)) if is_same(b, a, same) => {}
        _ => {
            let [before, after] = [before, after].map(|value| value.map(Property::short));
            found.push(Changed { path: path.to_owned(), before, after });
        }
    }
}

fn below(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

fn is_same(before: &Property, after: &Property, same: &dyn Correspondence) -> bool {
    match (before, after) {
        (Property::Number(b), Property::Number(a)) => same_number(*b, *a),
        (Property::Numbers(b), Property::Numbers(a)) => same_numbers(b, a),
        (Property::Image(b), Property::Image(a)) => same.images(*b, *a),
        (Property::Material(b), Property::Material(a)) => same.materials(*b, *a),
        (Property::Node(b), Property::Node(a)) => same.nodes(*b, *a),
        _ => before == after,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// References are the same if they are equal.
    struct ByIndex;
    impl Correspondence for ByIndex {
        fn images(&self, before: usize, after: usize) -> bool {
            before == after
        }
    }

    fn object(entries: &[(&str, Property)]) -> Property {
        Property::Object(entries.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect::<BTreeMap<_, _>>())
    }

    #[test]
    fn paths_lead_to_what_differs() {
        let list = |x| object(&[("a", Property::List(vec![Property::Number(1.0), Property::Number(x)]))]);
        let found = changes(&list(2.0), &list(3.0), &ByIndex);
        let expected = Changed { path: "a[1]".into(), before: Some("2".into()), after: Some("3".into()) };
        assert_eq!(found, [expected]);
        assert_eq!(changes(&list(2.0), &list(2.000_001), &ByIndex), []);
        let gone = changes(&object(&[("b", Property::Image(1))]), &object(&[]), &ByIndex);
        assert_eq!(gone, [Changed { path: "b".into(), before: Some("images[1]".into()), after: None }]);
    }

    #[test]
    fn references_are_the_same_by_what_they_refer_to() {
        let image = |i| object(&[("image", Property::Image(i))]);
        assert_eq!(changes(&image(1), &image(1), &ByIndex), []);
        assert_eq!(changes(&image(1), &image(2), &ByIndex).len(), 1);
        assert_eq!(changes(&Property::Node(1), &Property::Node(1), &ByIndex).len(), 1, "no nodes correspond");
    }
}
