//! What rays traverse on the CPU, and what that costs there.
//!
//! Seconds on a CPU vary from run to run with whatever else it does. The number of steps that rays take does not, and it
//! is what a layout changes. So steps at fixed prices decide on the CPU, and seconds are reported beside them.

use serde::Serialize;

use super::cpu::Steps;

/// Steps of rays through both levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Number of rays.
    pub rays: u64,
    /// Number of inner nodes of the top tree.
    pub top: u64,
    /// Number of instances entered.
    pub entries: u64,
    /// Number of inner nodes of bottom trees.
    pub bottom: u64,
    /// Number of triangles tested.
    pub tests: u64,
}

/// Steps per ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct WorkPerRay {
    /// Inner nodes of the top tree.
    pub tlas_nodes: f64,
    /// Instances entered.
    pub entries: f64,
    /// Inner nodes of bottom trees.
    pub blas_nodes: f64,
    /// Triangles tested.
    pub triangle_tests: f64,
}

/// Nanoseconds on one core of a CPU: per ray, inner node of either tree, instance entered and triangle tested.
///
/// Fitted to the program's own tracer by non-negative least squares on relative errors: 172 times of 43 layouts of 13
/// scenes. The ratios of layouts of one scene are predicted with an RMS error of 13 %. See docs/measurements.md.
const PRICES: Prices = Prices { ray: 70.0, node: 34.0, entry: 64.0, test: 28.0 };

struct Prices {
    ray: f64,
    node: f64,
    entry: f64,
    test: f64,
}

impl Work {
    /// Returns the seconds that the steps cost on one core.
    pub fn seconds(&self) -> f64 {
        let [rays, nodes, entries, tests] =
            [self.rays, self.top + self.bottom, self.entries, self.tests].map(|count| count as f64);
        1e-9 * (PRICES.ray * rays + PRICES.node * nodes + PRICES.entry * entries + PRICES.test * tests)
    }

    /// Returns the steps per ray; zeros without rays.
    pub fn per_ray(&self) -> WorkPerRay {
        let per_ray = |count: u64| count as f64 / self.rays.max(1) as f64;
        WorkPerRay {
            tlas_nodes: per_ray(self.top),
            entries: per_ray(self.entries),
            blas_nodes: per_ray(self.bottom),
            triangle_tests: per_ray(self.tests),
        }
    }

    /// Returns the work of both.
    #[must_use]
    pub fn and(self, other: Work) -> Work {
        Work {
            rays: self.rays + other.rays,
            top: self.top + other.top,
            entries: self.entries + other.entries,
            bottom: self.bottom + other.bottom,
            tests: self.tests + other.tests,
        }
    }
}

impl<'a> FromIterator<&'a Steps> for Work {
    /// Adds up the steps of rays.
    fn from_iter<I: IntoIterator<Item = &'a Steps>>(steps: I) -> Work {
        let of_ray = |steps: &Steps| Work {
            rays: 1,
            top: steps.top.into(),
            entries: steps.entries.into(),
            bottom: steps.bottom.into(),
            tests: steps.tests.into(),
        };
        steps.into_iter().map(of_ray).fold(Work::default(), Work::and)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_add_up_and_each_has_its_price() {
        let steps = [Steps { top: 1, entries: 2, bottom: 3, tests: 4 }, Steps { tests: 1, ..Steps::default() }];
        let work: Work = steps.iter().collect();
        assert_eq!(work, Work { rays: 2, top: 1, entries: 2, bottom: 3, tests: 5 });
        assert_eq!(work.per_ray().triangle_tests, 2.5);
        let one = |work: Work| Work { rays: 1, ..work }.seconds();
        let none = one(Work::default());
        for more in [
            Work { top: 1, ..Work::default() },
            Work { entries: 1, ..Work::default() },
            Work { bottom: 1, ..Work::default() },
            Work { tests: 1, ..Work::default() },
        ] {
            assert!(one(more) > none);
        }
        assert_eq!(Work::default().per_ray(), WorkPerRay::default());
    }
}
