//! Compares the attributes at every corner of every two triangles in one place.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::super::Sides;
use super::comparison::{Comparison, Vertices};
use super::meetings::{Run, each_run, object_name};
use super::plan::Planner;
use super::{ContentsReport, Detail, Difference, DifferenceKind, Inputs};
use crate::scene::{Geometry, Object, Scene, TriangleRef};

/// Pairs of vertices that a task remembers to be equal; a power of two.
const REMEMBERED: usize = 1 << 10;

/// Compares all attributes.
pub(super) fn compare(inputs: &Inputs<'_>, planner: &Planner<'_>, report: &mut ContentsReport) {
    let tasks = each_run(
        inputs.scenes,
        inputs.pairs,
        |task: &mut Task<'_>, run| task.compare(planner, inputs.scenes, &run),
        |task| (task.found, task.corners),
    );
    let mut found: BTreeMap<Key, Tally> = BTreeMap::new();
    for (of_task, corners) in tasks {
        for (key, tally) in of_task {
            found.entry(key).and_modify(|known| known.add(&tally)).or_insert(tally);
        }
        for (name, count) in corners {
            *report.compared.corners.entry(name).or_default() += count;
        }
    }
    for ((kind, attribute), tally) in found {
        let object = object_name(inputs.scenes.before, tally.object);
        let detail = Detail::Attribute { attribute, deviation: tally.worst, allowed: tally.allowed };
        report.differences.push(Difference::new(kind, tally.corners, Some(object), Some(detail)));
    }
}

/// A kind and the name of an attribute.
type Key = (DifferenceKind, String);

/// How much of one attribute differs.
#[derive(Clone, Copy, Debug)]
struct Tally {
    corners: u64,
    worst: f64,
    allowed: f64,
    first: TriangleRef,
    /// The input's object at the first triangle.
    object: Object,
}

impl Tally {
    fn add(&mut self, other: &Tally) {
        let first = if other.first < self.first { *other } else { *self };
        *self = Tally { corners: self.corners + other.corners, worst: self.worst.max(other.worst), ..first };
    }
}

/// What one task has done.
#[derive(Default)]
struct Task<'a> {
    plans: FxHashMap<Sides2, Vec<Comparison<'a>>>,
    remembered: Remembered,
    found: BTreeMap<Key, Tally>,
    corners: BTreeMap<String, u64>,
}

/// The objects of the input and of the output.
type Sides2 = [Object; 2];

impl<'a> Task<'a> {
    fn compare(&mut self, planner: &Planner<'a>, scenes: Sides<&Scene>, run: &Run<'_>) {
        let objects = [run.objects.before, run.objects.after];
        let comparisons = self.plans.entry(objects).or_insert_with(|| planner.plan(run.objects));
        for comparison in comparisons.iter() {
            let corners = 3 * run.pairs.len() as u64;
            match self.corners.get_mut(&comparison.name) {
                Some(count) => *count += corners,
                None => drop(self.corners.insert(comparison.name.clone(), corners)),
            }
        }
        self.remembered.forget();
        let corners = scenes.zip(run.objects).map(|(scene, object)| Corners::of(scene, object));
        for &(at, pair) in run.pairs {
            let (before, after) = (corners.before.get(pair.at), corners.after.get(at));
            for k in 0..3 {
                let vertices = Sides { before: before[(k + pair.turn as usize) % 3], after: after[k] };
                if self.remembered.has(vertices) {
                    continue;
                }
                let first = Tally { corners: 1, worst: 0.0, allowed: 0.0, first: at, object: run.objects.before };
                if look(comparisons, vertices, first, &mut self.found) {
                    self.remembered.add(vertices);
                }
            }
        }
    }
}

/// Compares two vertices, notes what differs and returns whether nothing does.
fn look(comparisons: &[Comparison<'_>], at: Vertices, first: Tally, found: &mut BTreeMap<Key, Tally>) -> bool {
    let mut are_equal = true;
    for comparison in comparisons {
        let deviation = comparison.deviation(at);
        if deviation > comparison.allowed {
            are_equal = false;
            let tally = Tally { worst: deviation, allowed: comparison.allowed, ..first };
            let key = (comparison.kind, comparison.name.clone());
            found.entry(key).and_modify(|known| known.add(&tally)).or_insert(tally);
        }
    }
    are_equal
}

/// The corners of an object's triangles.
struct Corners<'a> {
    geometry: &'a Geometry,
    mirrored: bool,
}

impl<'a> Corners<'a> {
    fn of(scene: &'a Scene, object: Object) -> Corners<'a> {
        Corners { geometry: object.geometry(scene), mirrored: scene.instances[object.instance as usize].mirrored() }
    }

    /// Returns the vertices of a triangle in the order of [`Scene::world_corners`].
    fn get(&self, at: TriangleRef) -> [u32; 3] {
        let [a, b, c] = self.geometry.triangles[(at.triangle - self.geometry.first_triangle) as usize];
        if self.mirrored { [a, c, b] } else { [a, b, c] }
    }
}

/// Pairs of vertices that were compared a short time ago and are equal: a vertex is a corner of six triangles on
/// average.
struct Remembered {
    /// Input's vertex, output's vertex, and the run.
    places: Vec<[u32; 3]>,
    run: u32,
}

impl Default for Remembered {
    fn default() -> Self {
        Remembered { places: vec![[0; 3]; REMEMBERED], run: 0 }
    }
}

impl Remembered {
    /// Forgets all pairs: the next vertices are of other objects.
    fn forget(&mut self) {
        self.run += 1;
    }

    fn has(&self, at: Vertices) -> bool {
        self.places[at.after as usize % REMEMBERED] == [at.before, at.after, self.run]
    }

    fn add(&mut self, at: Vertices) {
        self.places[at.after as usize % REMEMBERED] = [at.before, at.after, self.run];
    }
}
