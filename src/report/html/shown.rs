//! [`Shown`]: what a page shows of the scenes themselves: groups, boxes, a preview, where triangles went, overlaps.
//!
//! Everything is limited in number, so that the page of a large scene stays small; what is left out is counted.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::Serialize;

use super::pictures::{self, Drawing, Drawn};
use super::preview::Preview;
use super::text::{packed, visible};
use crate::cost::overlap;
use crate::report::OverlappingPair;
use crate::scene::{Bounds, InstanceId, Scene};
use crate::verify::Sides;
use crate::verify::identity::Identity;

/// Number of overlapping pairs listed.
const WORST_PAIRS: usize = 20;
/// Maximum number of instances of a scene whose boxes are shown: the largest.
const MOST_BOXES: usize = 4_000;
/// Maximum number of groups listed: those with most triangles.
const MOST_GROUPS: usize = 4_000;
/// Maximum number of objects that can be searched for.
const MOST_OBJECTS: usize = 10_000;
/// Maximum number of pairs of a group and an object that it holds.
const MOST_LINKS: usize = 40_000;
/// Maximum characters of a name in the data of the page.
const MOST_OF_NAME: usize = 60;

/// What a page shows of the scenes of a report.
#[derive(Clone, Debug)]
pub struct Shown {
    /// The input, and the output if it differs.
    sides: (Side, Option<Side>),
    /// The objects of the input.
    objects: Objects,
    /// Where the triangles of the objects went.
    links: Links,
    /// Instances that overlap most, of the input and of the output.
    pub(super) overlaps: Sides<Vec<OverlappingPair>>,
    /// How many groups have how many triangles.
    pub(super) sizes: Sides<Vec<u64>>,
    /// What was drawn and traced of both; empty if nothing was.
    pub(super) drawing: Drawing,
}

/// The groups and boxes of a scene.
#[derive(Clone, Debug, Serialize)]
struct Side {
    /// The groups with most triangles, by descending number.
    groups: Vec<Group>,
    /// Number of all groups.
    groups_in_all: usize,
    /// The instances with the largest boxes, by descending area.
    instances: Vec<Placed>,
    /// Number of all instances.
    instances_in_all: usize,
    /// Six 32-bit floats per listed instance, in base 64: minimum and maximum of its box, as shares of the frame's
    /// longest side, from the middle of the frame.
    boxes: String,
    /// The sides of the frame over the longest.
    frame: [f64; 3],
    preview: Preview,
}

/// A mesh group.
#[derive(Clone, Debug, Serialize)]
struct Group {
    /// Its index in the scene.
    id: u32,
    name: String,
    triangles: usize,
    /// Number of instances that place it.
    placed: u32,
}

/// A listed instance.
#[derive(Clone, Debug, Serialize)]
struct Placed {
    /// Its index in the scene.
    id: u32,
    name: String,
    /// Index of its group in the scene.
    group: u32,
}

/// The objects of the input: its instances.
#[derive(Clone, Debug, Serialize)]
struct Objects {
    names: Vec<String>,
    in_all: usize,
}

/// Which groups of the output hold triangles of which objects of the input.
#[derive(Clone, Debug, Serialize)]
struct Links {
    /// Group, object and number of triangles; by group, then object.
    links: Vec<[u32; 3]>,
    in_all: usize,
}

impl Shown {
    /// Gathers what a page shows of one scene.
    pub fn of(scene: &Scene) -> Shown {
        Shown::new(scene, None, links_within(scene))
    }

    /// Gathers what a page shows of the input and the output. `after` records where its triangles come from, or places
    /// the same meshes by the same nodes; what it records wrongly is in no group.
    pub fn of_both(before: &Scene, after: &Scene) -> Shown {
        Shown::new(before, Some(after), links_between(before, after))
    }

    fn new(before: &Scene, after: Option<&Scene>, links: BTreeMap<(u32, u32), u32>) -> Shown {
        let frame = frame(before);
        let of_scene = |scene: &Scene| Side::of(scene, &frame);
        let both = Sides { before, after: after.unwrap_or(before) };
        Shown {
            sides: (of_scene(before), after.map(of_scene)),
            objects: Objects::of(before),
            links: Links::of(links),
            overlaps: both.map(worst_pairs),
            sizes: both.map(|scene| scene.meshes.iter().map(|m| m.triangle_count() as u64).collect()),
            drawing: Drawing::default(),
        }
    }

    /// Adds pictures, unless there is nothing to see.
    pub fn with_pictures(self, before: Drawn, after: Option<Drawn>) -> Shown {
        Shown { drawing: pictures::of(before, after, pictures::SIZE).unwrap_or_default(), ..self }
    }

    /// Returns the data that the page's scripts read, as JSON.
    pub(super) fn json(&self) -> String {
        let Shown { sides: (before, after), objects, links, .. } = self;
        let data = Data { before, after: after.as_ref(), objects, links };
        serde_json::to_string(&data).expect("all keys are strings")
    }
}

/// The data that the page's scripts read.
#[derive(Serialize)]
struct Data<'a> {
    before: &'a Side,
    after: Option<&'a Side>,
    objects: &'a Objects,
    links: &'a Links,
}

/// The box that is shown: that of the core, so that a sky dome does not make the rest tiny.
fn frame(scene: &Scene) -> Bounds {
    let core = scene.core().bounds();
    if core.is_empty() { scene.bounds() } else { core }
}

impl Side {
    fn of(scene: &Scene, frame: &Bounds) -> Side {
        let instances = largest(scene);
        let sides = if frame.is_empty() { glam::DVec3::ONE } else { frame.max - frame.min };
        let longest = sides.max_element().max(f64::MIN_POSITIVE);
        let middle = if frame.is_empty() { glam::DVec3::ZERO } else { frame.min + 0.5 * sides };
        let share = |p: glam::DVec3| ((p - middle) / longest).as_vec3().to_array();
        let of_instance = |p: &Placed| scene.instance_boxes()[p.id as usize];
        let boxes: Vec<f32> =
            instances.iter().map(of_instance).flat_map(|b| [share(b.min), share(b.max)]).flatten().collect();
        Side {
            groups: groups(scene),
            groups_in_all: scene.meshes.len(),
            instances,
            instances_in_all: scene.instances.len(),
            boxes: packed(&boxes),
            frame: (sides / longest).to_array(),
            preview: Preview::of(scene, frame),
        }
    }
}

/// The instances with the largest boxes.
fn largest(scene: &Scene) -> Vec<Placed> {
    let area = |i: u32| scene.instance_boxes()[i as usize].area();
    let filled = |i: &u32| !scene.instance_boxes()[*i as usize].is_empty();
    let mut by_area: Vec<u32> = (0..scene.instances.len() as u32).filter(filled).collect();
    by_area.sort_by(|&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
    by_area.truncate(MOST_BOXES);
    let placed = |id: u32| {
        let instance = &scene.instances[id as usize];
        Placed { id, name: short(&instance.display_name()), group: instance.mesh.0 }
    };
    by_area.into_iter().map(placed).collect()
}

/// The groups with most triangles.
fn groups(scene: &Scene) -> Vec<Group> {
    let mut placed = vec![0; scene.meshes.len()];
    scene.instances.iter().for_each(|i| placed[i.mesh.0 as usize] += 1);
    let group = |(id, mesh): (u32, &crate::scene::Mesh)| Group {
        id,
        name: group_name(&mesh.name, id),
        triangles: mesh.triangle_count(),
        placed: placed[id as usize],
    };
    let mut groups: Vec<Group> = (0..).zip(scene.meshes.iter()).map(group).collect();
    groups.sort_by_key(|g| (Reverse(g.triangles), g.id));
    groups.truncate(MOST_GROUPS);
    groups
}

fn group_name(name: &str, id: u32) -> String {
    if name.is_empty() { format!("group {id}") } else { short(name) }
}

fn short(name: &str) -> String {
    visible(name, MOST_OF_NAME).into_owned()
}

impl Objects {
    fn of(scene: &Scene) -> Objects {
        let listed = scene.instances.iter().take(MOST_OBJECTS);
        Objects { names: listed.map(|i| short(&i.display_name())).collect(), in_all: scene.instances.len() }
    }
}

impl Links {
    fn of(links: BTreeMap<(u32, u32), u32>) -> Links {
        let in_all = links.len();
        let listed = links.into_iter().filter(|&((_, object), _)| (object as usize) < MOST_OBJECTS);
        Links {
            links: listed.take(MOST_LINKS).map(|((group, object), count)| [group, object, count]).collect(),
            in_all,
        }
    }
}

/// Each mesh of a scene holds the instances that place it.
fn links_within(scene: &Scene) -> BTreeMap<(u32, u32), u32> {
    let instances = (0..).zip(&scene.instances);
    instances.map(|(i, at)| ((at.mesh.0, i), scene.mesh_of(InstanceId(i)).triangle_count() as u32)).collect()
}

/// Follows the triangles of the output to the instances of the input that they come from.
fn links_between(before: &Scene, after: &Scene) -> BTreeMap<(u32, u32), u32> {
    let identity = Identity::new(before, after);
    let of_instance = |i: u32| {
        let mut objects: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mesh = after.instances[i as usize].mesh.0;
        for (g, geometry) in after.meshes[mesh as usize].geometries.iter().enumerate() {
            for source in identity.sources(i, g, 0..geometry.triangles.len()).flatten() {
                *objects.entry((mesh, source.instance)).or_default() += 1;
            }
        }
        objects
    };
    let instances = (0..after.instances.len() as u32).into_par_iter();
    let parts: Vec<BTreeMap<(u32, u32), u32>> = instances.map(of_instance).collect();
    let mut all = BTreeMap::new();
    for (link, count) in parts.into_iter().flatten() {
        *all.entry(link).or_default() += count;
    }
    all
}

/// The pairs of instances of the scene's core that overlap most, worst first.
fn worst_pairs(scene: &Scene) -> Vec<OverlappingPair> {
    let (area, boxes) = (scene.core().bounds().area(), scene.core().instance_boxes(scene));
    let name = |i: u32| scene.instances[i as usize].display_name();
    let pairs = overlap::worst_pairs(&boxes, WORST_PAIRS);
    let named = |p: &overlap::Pair| OverlappingPair { a: name(p.a), b: name(p.b), overlap_ratio: p.area / area };
    pairs.iter().map(named).filter(|p| p.overlap_ratio > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::heaps;
    use serde_json::Value;

    fn data(shown: &Shown) -> Value {
        serde_json::from_str(&shown.json()).expect("JSON")
    }

    #[test]
    fn a_scene_is_shown_with_all_its_objects_groups_and_boxes() {
        let scene = heaps(0);
        let data = data(&Shown::of(&scene));
        let count = |list: &Value| list.as_array().expect("a list").len();
        assert_eq!(count(&data["objects"]["names"]), scene.instances.len());
        assert_eq!(count(&data["before"]["groups"]), scene.meshes.len());
        assert_eq!(count(&data["before"]["instances"]), scene.instances.len());
        assert_eq!(count(&data["links"]["links"]), scene.instances.len());
        assert_eq!(data["after"], Value::Null);
        assert_eq!(data["before"]["preview"]["placed"], scene.triangles_placed());
    }

    #[test]
    fn the_same_scene_twice_holds_its_own_objects() {
        let scene = heaps(0);
        let [one, both] = [Shown::of(&scene), Shown::of_both(&scene, &scene)].map(|shown| data(&shown));
        assert_eq!(one["links"], both["links"]);
        assert_eq!(both["before"], both["after"]);
    }

    #[test]
    fn a_dome_does_not_make_the_rest_small() {
        let [plain, dome] = [heaps(0), heaps(1)].map(|scene| data(&Shown::of(&scene)));
        assert_eq!(plain["before"]["frame"], dome["before"]["frame"]);
    }

    #[test]
    fn overlaps_come_worst_first() {
        let pairs = Shown::of(&heaps(0)).overlaps.before;
        assert!(!pairs.is_empty() && pairs.is_sorted_by(|a, b| a.overlap_ratio >= b.overlap_ratio));
    }
}
