//! [`Findings`]: collects differences, one for each kind and property.

use std::collections::BTreeMap;

use raykiln_formats::properties::Property;

use super::materials::property_detail;
use super::property::{Changed, Correspondence, changes};
use super::{ContentsReport, Difference, DifferenceKind};

/// Differences of objects; of each kind and property the first is told, and how many there are.
#[derive(Default)]
pub(super) struct Findings {
    found: BTreeMap<(DifferenceKind, String), Difference>,
}

impl Findings {
    /// Adds an object of which no property can be told.
    pub(super) fn object(&mut self, kind: DifferenceKind, object: &str) {
        self.add(kind, String::new(), || Difference::new(kind, 0, Some(object.to_owned()), None));
    }

    /// Adds a property that differs.
    pub(super) fn property(&mut self, kind: DifferenceKind, object: Option<&str>, changed: Changed) {
        let path = changed.path.clone();
        self.add(kind, path, || {
            Difference::new(kind, 0, object.map(str::to_owned), Some(property_detail(None, changed)))
        });
    }

    /// Adds all that differs between two values of a property.
    pub(super) fn properties(
        &mut self,
        kind: DifferenceKind,
        object: Option<&str>,
        path: &str,
        values: [Option<&Property>; 2],
        same: &dyn Correspondence,
    ) {
        self.properties_by(|_| kind, object, path, values, same);
    }

    /// As [`Findings::properties`]; the kind follows from the path of the property.
    pub(super) fn properties_by(
        &mut self,
        kind: impl Fn(&str) -> DifferenceKind,
        object: Option<&str>,
        path: &str,
        values: [Option<&Property>; 2],
        same: &dyn Correspondence,
    ) {
        let found = match values {
            [None, None] => return,
            [Some(before), Some(after)] => changes(before, after, same),
            [before, after] => {
                let [before, after] = [before, after].map(|value| value.map(Property::short));
                vec![Changed { path: String::new(), before, after }]
            }
        };
        for changed in found {
            let is_joined = path.is_empty() || changed.path.is_empty() || changed.path.starts_with('[');
            let separator = if is_joined { "" } else { "." };
            let path = format!("{path}{separator}{}", changed.path);
            self.property(kind(&path), object, Changed { path, ..changed });
        }
    }

    fn add(&mut self, kind: DifferenceKind, path: String, new: impl FnOnce() -> Difference) {
        self.found.entry((kind, path)).or_insert_with(new).count += 1;
    }

    /// Hands all differences over.
    pub(super) fn report(self, report: &mut ContentsReport) {
        report.differences.extend(self.found.into_values());
    }
}
