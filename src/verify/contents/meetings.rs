//! [`meetings`]: which primitives of two files show themselves in the same places.

use std::ops::Range;

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::super::Sides;
use super::super::surface::pairs::{Pair, Pairs};
use crate::scene::{InstanceId, Object, Scene, TriangleRef, objects};

/// Triangles that a task looks at, at least.
const TASK: usize = 1 << 14;

/// A primitive of the input and one of the output that have triangles in the same places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Meeting {
    /// The first object of each scene, in the order of the output's triangles.
    pub(super) objects: Sides<Object>,
    /// The first of the output's triangles.
    pub(super) first: TriangleRef,
    /// How many triangles there are.
    pub(super) triangles: u64,
}

/// Triangles of one object of the output in the places of triangles of one object of the input.
pub(super) struct Run<'a> {
    pub(super) objects: Sides<Object>,
    /// The output's triangle, and the input's.
    pub(super) pairs: &'a [(TriangleRef, Pair)],
}

/// Returns which primitives meet, in the order of the output's triangles.
pub(super) fn meetings(scenes: Sides<&Scene>, pairs: &Pairs) -> Vec<Meeting> {
    let found = each_run(
        scenes,
        pairs,
        |found: &mut FxHashMap<Sides4, Meeting>, run| {
            let first = run.pairs[0].0;
            let meeting = found.entry(primitives(scenes, run.objects)).or_insert(Meeting {
                objects: run.objects,
                first,
                triangles: 0,
            });
            meeting.triangles += run.pairs.len() as u64;
        },
        |found| found,
    );
    let mut all: FxHashMap<Sides4, Meeting> = FxHashMap::default();
    for (key, meeting) in found.into_iter().flatten() {
        let known = all.entry(key).or_insert(Meeting { triangles: 0, ..meeting });
        let triangles = known.triangles + meeting.triangles;
        let first = if meeting.first < known.first { meeting } else { *known };
        *known = Meeting { triangles, ..first };
    }
    let mut sorted: Vec<Meeting> = all.into_values().collect();
    sorted.sort_unstable_by_key(|meeting| (meeting.first, meeting.objects.before));
    sorted
}

/// Mesh and geometry of the input, mesh and geometry of the output.
type Sides4 = [u32; 4];

fn primitives(scenes: Sides<&Scene>, objects: Sides<Object>) -> Sides4 {
    let mesh = |scene: &Scene, object: Object| scene.instances[object.instance as usize].mesh.0;
    let Sides { before, after } = objects;
    [mesh(scenes.before, before), before.geometry, mesh(scenes.after, after), after.geometry]
}

/// Calls a function for all runs of triangles, in parallel; returns what each task made of its runs, in the order of the
/// output's triangles.
pub(super) fn each_run<T: Default, R: Send>(
    scenes: Sides<&Scene>,
    pairs: &Pairs,
    work: impl Fn(&mut T, Run<'_>) + Sync,
    finish: impl Fn(T) -> R + Sync,
) -> Vec<R> {
    tasks(scenes.after)
        .into_par_iter()
        .map(|pieces| {
            let (mut made, mut run) = (T::default(), Vec::new());
            for (object, triangles) in pieces {
                runs(scenes, pairs, object, triangles, &mut run, &mut |run| work(&mut made, run));
            }
            finish(made)
        })
        .collect()
}

/// Divides the triangles of a scene into tasks of parts of objects.
fn tasks(scene: &Scene) -> Vec<Vec<(Object, Range<u32>)>> {
    let mut tasks: Vec<Vec<(Object, Range<u32>)>> = Vec::new();
    let mut room = 0;
    for object in objects(scene, (0..scene.instances.len() as u32).map(InstanceId)) {
        let geometry = object.geometry(scene);
        let (mut first, end) = (geometry.first_triangle, geometry.first_triangle + geometry.triangles.len() as u32);
        while first < end {
            if room == 0 {
                tasks.push(Vec::new());
                room = TASK;
            }
            let next = end.min(first + room as u32);
            room -= (next - first) as usize;
            tasks.last_mut().expect("there is one").push((object, first..next));
            first = next;
        }
    }
    tasks
}

/// Divides triangles of an object of the output into runs whose partners are of one object of the input.
fn runs(
    scenes: Sides<&Scene>,
    pairs: &Pairs,
    after: Object,
    triangles: Range<u32>,
    run: &mut Vec<(TriangleRef, Pair)>,
    work: &mut impl FnMut(Run<'_>),
) {
    let mut before: Option<(Object, Range<u32>)> = None;
    run.clear();
    for triangle in triangles {
        let at = TriangleRef { instance: after.instance, triangle };
        let Some(pair) = pairs.get(at) else { continue };
        let is_same = |(object, range): &(Object, Range<u32>)| {
            object.instance == pair.at.instance && range.contains(&pair.at.triangle)
        };
        if !before.as_ref().is_some_and(is_same) {
            if let Some((object, _)) = before.filter(|_| !run.is_empty()) {
                work(Run { objects: Sides { before: object, after }, pairs: run });
            }
            run.clear();
            before = Some(object_of(scenes.before, pair.at));
        }
        run.push((at, pair));
    }
    if let Some((object, _)) = before.filter(|_| !run.is_empty()) {
        work(Run { objects: Sides { before: object, after }, pairs: run });
    }
}

/// Returns the object that has a triangle, and the object's triangles.
fn object_of(scene: &Scene, at: TriangleRef) -> (Object, Range<u32>) {
    let mesh = scene.mesh_of(InstanceId(at.instance));
    let (geometry, _) = mesh.locate(at.triangle);
    let first = mesh.geometries[geometry].first_triangle;
    let end = first + mesh.geometries[geometry].triangles.len() as u32;
    (Object { instance: at.instance, geometry: geometry as u32 }, first..end)
}

/// Returns a name to display of an object.
pub(super) fn object_name(scene: &Scene, object: Object) -> String {
    scene.instances[object.instance as usize].display_name()
}
