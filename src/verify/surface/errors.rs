//! The largest position errors, in all, by object of the input and by instance of the output.

use super::limits::Limits;
use crate::scene::{InstanceId, Scene};

/// The largest position errors of some triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Largest {
    /// In world units.
    pub error: f64,
    /// The object of the input with the largest error over its own size, and that ratio.
    pub object: Option<(InstanceId, f64)>,
}

impl Largest {
    /// Also considers an error of a triangle of an instance of the input.
    pub(super) fn or(self, limits: &Limits, instance: u32, error: f64) -> Largest {
        if error == 0.0 {
            return self;
        }
        self.max(Largest { error, object: Some((InstanceId(instance), limits.over_own_size(instance, error))) })
    }

    /// Of objects with equal ratios, the first counts.
    fn max(self, later: Largest) -> Largest {
        let object = match (self.object, later.object) {
            (Some(a), Some(b)) => Some(if b.1 > a.1 || (b.1 == a.1 && b.0 < a.0) { b } else { a }),
            (a, b) => a.or(b),
        };
        Largest { error: self.error.max(later.error), object }
    }
}

/// The largest position errors of all triangles.
pub(super) struct PositionErrors {
    pub largest: Largest,
    /// By instance of the output, in world units.
    pub of_instances: Vec<f64>,
}

impl PositionErrors {
    pub(super) fn new(after: &Scene) -> PositionErrors {
        PositionErrors { largest: Largest::default(), of_instances: vec![0.0; after.instances.len()] }
    }

    /// Adds the errors of triangles of an instance of the output.
    pub(super) fn add(&mut self, instance: u32, largest: Largest) {
        self.largest = self.largest.max(largest);
        let of_instance = &mut self.of_instances[instance as usize];
        *of_instance = of_instance.max(largest.error);
    }
}
