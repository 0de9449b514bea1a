//! Colours of groups and instances: few and far apart, so that neighbours differ.
//!
//! Greedy colouring in order, as of D. Welsh, M. Powell, "An upper bound for the chromatic number of a graph and its
//! application to timetabling problems", The Computer Journal 10(1), 1967; if no colour is unlike those of neighbours,
//! the one farthest from theirs is used.

use glam::{DVec3, Vec3};

use super::colour::of_hue;
use crate::parallel;
use crate::scene::{Bounds, Scene};
use crate::tree::{Quality, Tree};

/// Colours per lightness, and the lightnesses.
const HUES: usize = 10;
const LIGHTNESS: [f32; 3] = [0.72, 0.56, 0.86];
const CHROMA: f32 = 0.125;
/// Share of a difference in lightness that counts: a light and a dark colour of one hue look alike.
const LIGHTNESS_COUNTS: f32 = 0.5;
/// Distance of colours that look unlike: more than between neighbours on the circle of hues, or between a light and a dark
/// colour of one hue.
const UNLIKE: f32 = 0.14;
/// Neighbours of one box that it must differ from, those that it touches most: in a heap of thousands of boxes, more could
/// not be told apart.
const MOST_NEIGHBOURS: usize = 12;
/// Neighbours of one box that are looked at to find these.
const MOST_FOUND: usize = 256;
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
    owners.iter().map(|&owner| colours[chosen[owner as usize].unwrap_or(0)].light).collect()
}

/// A colour of the palette.
struct Colour {
    light: Vec3,
    /// Its place among colours: the farther apart two are, the less alike they look (B. Ottosson, "A perceptual color space
    /// for image processing", 2020).
    place: Vec3,
}

fn colours() -> Vec<Colour> {
    let of = |i: usize| {
        let ring = i / HUES;
        let hue = (i % HUES) as f32 / HUES as f32 + 0.03 * ring as f32;
        let (sin, cos) = (std::f32::consts::TAU * hue).sin_cos();
        let place = Vec3::new(LIGHTNESS_COUNTS * LIGHTNESS[ring], CHROMA * cos, CHROMA * sin);
        Colour { light: of_hue(LIGHTNESS[ring], CHROMA, hue), place }
    };
    (0..HUES * LIGHTNESS.len()).map(of).collect()
}

/// Returns the first colour that looks unlike those taken, or else the one farthest from them. Owners begin at different
/// colours, so that many are used.
fn pick(colours: &[Colour], owner: usize, taken: &[usize]) -> usize {
    let distance = |i: usize| taken.iter().map(|&t| colours[i].place.distance(colours[t].place)).fold(1.0, f32::min);
    let mut best = (owner * STRIDE % colours.len(), -1.0);
    for i in (0..colours.len()).map(|i| (owner * STRIDE + i * STRIDE) % colours.len()) {
        let distance = distance(i);
        if distance >= UNLIKE {
            return i;
        }
        if distance > best.1 {
            best = (i, distance);
        }
    }
    best.0
}

/// Returns for each instance up to [`MOST_NEIGHBOURS`] instances whose boxes touch its own or nearly do, those first whose
/// boxes share most of their surface with it.
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
        if !nodes[at as usize].overlaps(&boxes[of]) || met.len() >= MOST_FOUND {
            continue;
        }
        if node.is_leaf() {
            let items = tree.order[node.items()].iter().copied();
            met.extend(items.filter(|&i| i as usize != of && boxes[i as usize].overlaps(&boxes[of])));
        } else {
            stack.extend([node.first, node.first + 1]);
        }
    }
    let shared = |other: u32| boxes[of].intersection(&boxes[other as usize]).area();
    met.sort_by(|&a, &b| shared(b).total_cmp(&shared(a)).then(a.cmp(&b)));
    met.truncate(MOST_NEIGHBOURS);
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
    fn pieces_in_a_row_have_hues_that_differ() {
        let places: Vec<_> = (0..60).map(|i| (i, DAffine3::from_translation(DVec3::X * 2.0 * f64::from(i)))).collect();
        let scene = scene((0..60).map(|i| cube(i, None)).collect(), &places);
        let (groups, palette) = (of_groups(&scene), colours());
        let place = |light: &Vec3| palette.iter().find(|colour| colour.light == *light).map(|colour| colour.place);
        let places: Vec<Vec3> = groups.iter().filter_map(place).collect();
        assert_eq!(places.len(), 60);
        assert!(places.windows(2).all(|pair| pair[0].distance(pair[1]) >= UNLIKE), "{places:?}");
        let used: std::collections::BTreeSet<String> = groups.iter().map(Vec3::to_string).collect();
        assert!(used.len() >= 20, "only {} colours are used", used.len());
    }

    #[test]
    fn a_heap_with_more_groups_than_colours_is_coloured_too() {
        let places: Vec<_> = (0..100).map(|i| (i, DAffine3::IDENTITY)).collect();
        let scene = scene((0..100).map(|i| cube(i, None)).collect(), &places);
        assert_eq!(of_groups(&scene).len(), 100);
    }
}
