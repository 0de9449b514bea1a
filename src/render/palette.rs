//! Colours of groups and instances: few and far apart, so that neighbours differ.
//!
//! Greedy colouring in order, as of D. Welsh, M. Powell, "An upper bound for the chromatic number of a graph and its
//! application to timetabling problems", The Computer Journal 10(1), 1967; if all colours are taken by neighbours, the
//! one farthest from theirs is used.

use glam::{DVec3, Vec3};

use super::colour::of_hue;
use crate::parallel;
use crate::scene::{Bounds, Scene};
use crate::tree::{Quality, Tree};

/// Colours per lightness, and the lightnesses.
const HUES: usize = 10;
const LIGHTNESS: [f32; 3] = [0.72, 0.56, 0.86];
const CHROMA: f32 = 0.125;
/// Neighbours of one box that are looked at: in a heap of thousands of boxes no more colours could be told apart.
const MOST_NEIGHBOURS: usize = 32;
/// Boxes closer than this are neighbours, over the diagonal of the scene's core.
const REACH: f64 = 0.002;
/// Step from one index to the next among the colours, so that consecutive ones differ.
const STRIDE: usize = 7;

/// Returns the colour of each instance, that of its group.
pub(super) fn of_groups(scene: &Scene) -> Vec<Vec3> {
    let groups: Vec<u32> = scene.instances.iter().map(|instance| instance.mesh.0).collect();
    coloured(scene, &groups, scene.meshes.len())
}

/// Returns the colour of each instance.
pub(super) fn of_instances(scene: &Scene) -> Vec<Vec3> {
    let own: Vec<u32> = (0..scene.instances.len() as u32).collect();
    coloured(scene, &own, own.len())
}

/// Returns the colour of each instance, given the number of what is coloured, and how many of those there are.
fn coloured(scene: &Scene, owners: &[u32], count: usize) -> Vec<Vec3> {
    let colours = colours();
    let mut neighbours = vec![Vec::new(); count];
    for (i, met) in neighbours_of(scene).into_iter().enumerate() {
        for other in met {
            let (a, b) = (owners[i], owners[other as usize]);
            if a != b {
                neighbours[a as usize].push(b);
                neighbours[b as usize].push(a);
            }
        }
    }
    let mut chosen: Vec<Option<usize>> = vec![None; count];
    for owner in 0..count {
        let taken: Vec<usize> = neighbours[owner].iter().filter_map(|&n| chosen[n as usize]).collect();
        chosen[owner] = Some(pick(&colours, owner, &taken));
    }
    owners.iter().map(|&owner| colours[chosen[owner as usize].unwrap_or(0)]).collect()
}

fn colours() -> Vec<Vec3> {
    let of = |i: usize| {
        let ring = i / HUES;
        of_hue(LIGHTNESS[ring], CHROMA, (i % HUES) as f32 / HUES as f32 + 0.03 * ring as f32)
    };
    (0..HUES * LIGHTNESS.len()).map(of).collect()
}

/// Returns the first free colour, or the one farthest from those taken.
fn pick(colours: &[Vec3], owner: usize, taken: &[usize]) -> usize {
    let order = (0..colours.len()).map(|i| (owner * STRIDE + i * STRIDE) % colours.len());
    let distance = |i: usize| taken.iter().map(|&t| colours[i].distance(colours[t])).fold(1.0, f32::min);
    let mut best = (owner * STRIDE % colours.len(), -1.0);
    for i in order {
        let distance = distance(i);
        if distance > best.1 {
            best = (i, distance);
        }
    }
    best.0
}

/// Returns for each instance up to [`MOST_NEIGHBOURS`] instances whose boxes touch its own or nearly do.
fn neighbours_of(scene: &Scene) -> Vec<Vec<u32>> {
    let reach = DVec3::splat(REACH * scene.core().bounds().diagonal());
    let boxes: Vec<Bounds> =
        scene.instance_boxes().iter().map(|b| Bounds { min: b.min - reach, max: b.max + reach }).collect();
    let tree = Tree::build_usable(&boxes, Quality::Instances);
    let nodes = tree.bounds(&boxes);
    parallel::map(boxes.len(), &|i| meeting(&tree, &nodes, &boxes, i))
}

fn meeting(tree: &Tree, nodes: &[Bounds], boxes: &[Bounds], of: usize) -> Vec<u32> {
    let mut met = Vec::new();
    let mut stack = if nodes.is_empty() { vec![] } else { vec![0] };
    while let Some(at) = stack.pop() {
        let node = tree.nodes[at as usize];
        if !nodes[at as usize].overlaps(&boxes[of]) || met.len() >= MOST_NEIGHBOURS {
            continue;
        }
        if node.is_leaf() {
            let items = tree.order[node.items()].iter().copied();
            met.extend(items.filter(|&i| i as usize != of && boxes[i as usize].overlaps(&boxes[of])));
        } else {
            stack.extend([node.first, node.first + 1]);
        }
    }
    met
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::verify::test_scenes::{cube, scene};

    #[test]
    fn touching_neighbours_differ_and_instances_of_a_group_are_alike() {
        let at = |mesh: u32, x: f64| (mesh, DAffine3::from_translation(DVec3::X * x));
        let places = [at(0, 0.0), at(1, 2.0), at(0, 4.0), at(1, 6.0), at(2, 8.0)];
        let scene = scene((0..3).map(|i| cube(i, None)).collect(), &places);
        let groups = of_groups(&scene);
        assert!(groups[0] == groups[2] && groups[1] == groups[3]);
        assert!(groups.windows(2).all(|pair| pair[0].distance(pair[1]) > 0.1), "{groups:?}");
        let instances = of_instances(&scene);
        assert!(instances.windows(2).all(|pair| pair[0].distance(pair[1]) > 0.1), "{instances:?}");
    }

    #[test]
    fn a_heap_with_more_groups_than_colours_is_coloured_too() {
        let places: Vec<_> = (0..100).map(|i| (i, DAffine3::IDENTITY)).collect();
        let scene = scene((0..100).map(|i| cube(i, None)).collect(), &places);
        assert_eq!(of_groups(&scene).len(), 100);
    }
}
