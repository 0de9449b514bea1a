//! Seeded rays, cut off at the first surface they hit.
//!
//! For any layout, a ray must enter each box that its segment meets and, if it visits boxes in the best order, no
//! others. Counting boxes on segments therefore sees two things that SAH does not: rays start inside overlapping boxes,
//! and surfaces end them. After the end-point overlap of T. Aila, T. Karras, S. Laine, "On Quality Metrics of Bounding
//! Volume Hierarchies", High Performance Graphics 2013.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::surface::{self, SplitMix64};
use crate::parallel::{self, CHEAP_ELEMENTS};
use crate::scene::{Bounds, Mesh, Scene};
use crate::tree::{Quality, Tree};

/// A line segment: `origin + t * along` for t from 0 to `length`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    origin: DVec3,
    along: DVec3,
    inverse: DVec3,
    length: f64,
}

impl Segment {
    /// Creates the segment from `origin` to `origin + length * along`.
    pub fn new(origin: DVec3, along: DVec3, length: f64) -> Segment {
        // No component is 0, so that a product with its inverse is never NaN.
        let inverse = along.to_array().map(|c| if c.abs() < SMALLEST { SMALLEST.copysign(c) } else { c }.recip());
        Segment { origin, along, inverse: DVec3::from(inverse), length }
    }

    /// Returns the segment transformed by `by`.
    pub fn under(&self, by: &DAffine3) -> Segment {
        Segment::new(by.transform_point3(self.origin), by.transform_vector3(self.along), self.length)
    }

    /// Whether the segment meets a non-empty box; touching counts (A. Williams et al., "An Efficient and Robust Ray-Box
    /// Intersection Algorithm", Journal of Graphics Tools 10(1), 2005).
    pub fn meets(&self, bounds: &Bounds) -> bool {
        let (a, b) = ((bounds.min - self.origin) * self.inverse, (bounds.max - self.origin) * self.inverse);
        let near = a.min(b).max_element().max(0.0);
        near <= a.max(b).min_element().min(self.length)
    }

    /// Returns the t at which the segment intersects a triangle, if it lies between `start` and the end, both excluded
    /// (T. Möller, B. Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", Journal of Graphics Tools 2(1),
    /// 1997).
    fn hit(&self, [a, b, c]: [DVec3; 3], start: f64) -> Option<f64> {
        let (e, f) = (b - a, c - a);
        let p = self.along.cross(f);
        let inverse = e.dot(p).recip();
        let s = self.origin - a;
        let q = s.cross(e);
        let (u, v, t) = (s.dot(p) * inverse, self.along.dot(q) * inverse, f.dot(q) * inverse);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > start && t < self.length).then_some(t)
    }
}

/// Smaller direction components are replaced by this magnitude.
const SMALLEST: f64 = 1e-200;

/// A tree with the boxes of its nodes.
#[derive(Clone, Debug, Default)]
pub struct Boxed {
    /// The tree.
    pub tree: Tree,
    /// The box of each node, parallel to the tree's nodes.
    pub bounds: Vec<Bounds>,
}

impl Boxed {
    /// Builds a tree over the boxes that are neither empty nor too large.
    pub fn build(boxes: &[Bounds], quality: Quality) -> Boxed {
        let tree = Tree::build_usable(boxes, quality);
        Boxed { bounds: tree.bounds(boxes), tree }
    }

    /// Builds a tree over the triangles of a mesh, in mesh coordinates.
    pub fn of_mesh(mesh: &Mesh, quality: Quality) -> Boxed {
        let triangle = |t: u32| Bounds::of(mesh.corners(t).map(|p| p.as_dvec3()));
        let boxes: Vec<Bounds> =
            (0..mesh.triangle_count() as u32).into_par_iter().with_min_len(CHEAP_ELEMENTS).map(triangle).collect();
        Boxed::build(&boxes, quality)
    }

    /// Visits the nodes whose box the segment meets at the time of the visit; a visit may shorten the segment.
    pub fn visit(&self, segment: &mut Segment, visit: impl FnMut(usize, &mut Segment)) {
        if !self.bounds.is_empty() {
            self.visit_below(0, segment, visit);
        }
    }

    /// Like [`Boxed::visit`], for a node and all nodes below it.
    pub fn visit_below(&self, root: usize, segment: &mut Segment, mut visit: impl FnMut(usize, &mut Segment)) {
        let mut stack: Vec<u32> = vec![root as u32];
        while let Some(at) = stack.pop() {
            if !segment.meets(&self.bounds[at as usize]) {
                continue;
            }
            visit(at as usize, segment);
            let node = &self.tree.nodes[at as usize];
            if !node.is_leaf() {
                stack.extend([node.first + 1, node.first]);
            }
        }
    }

    /// Returns the items of a leaf; none for an inner node.
    pub fn items(&self, node: usize) -> &[u32] {
        &self.tree.order[self.tree.nodes[node].items()]
    }
}

/// One in this many segments comes from outside the scene; the others start on a surface.
const ONE_FROM_OUTSIDE: usize = 4;

/// Segments traced between checks of the work done.
const BLOCK: usize = 16;

/// No further segment is traced once this many instances were tried.
const MOST_ENTRIES: u64 = 1 << 19;

const SEED: u64 = 0x7365_676d_656e_7473;

/// Samples segments of a scene, the same for equal scenes: three of four start at random surface points in random
/// directions; the others come from outside through random points of the sphere around the scene. Returns fewer than
/// `count` if the scene has no surface area or very many instances overlap in one place, and none if the scene's box is
/// empty or not finite. `meshes` holds trees over the triangles of the scene's meshes.
pub fn sample(scene: &Scene, meshes: &[Boxed], count: usize) -> Vec<Segment> {
    let instances = Placed::new(scene, meshes);
    let around = instances.top.bounds.first().copied().unwrap_or(Bounds::EMPTY);
    let reach = around.diagonal();
    if !(reach > 0.0 && reach.is_finite()) {
        return Vec::new();
    }
    let mut random = SplitMix64(SEED);
    let mut starts: Vec<Segment> = surface::points(scene, count - count / ONE_FROM_OUTSIDE)
        .into_iter()
        .map(|point| Segment::new(point, direction(&mut random), 2.0 * reach))
        .collect();
    starts.extend((0..count / ONE_FROM_OUTSIDE).map(|_| {
        let (along, through) = (direction(&mut random), 0.5 * reach * random.unit().cbrt() * direction(&mut random));
        Segment::new(around.center() + through - reach * along, along, 2.0 * reach)
    }));
    interleave(&mut starts);
    instances.cut_all(&starts, NEAREST * reach)
}

/// Shuffles the segments so that each part contains both kinds.
fn interleave(starts: &mut [Segment]) {
    let mut random = SplitMix64(!SEED);
    for i in (1..starts.len()).rev() {
        starts.swap(i, ((random.unit() * (i + 1) as f64) as usize).min(i));
    }
}

/// Hits nearer than this, relative to the scene's diagonal, are on the surface that a ray starts on.
const NEAREST: f64 = 1e-7;

fn direction(random: &mut SplitMix64) -> DVec3 {
    let z = 1.0 - 2.0 * random.unit();
    let (sin, cos) = (std::f64::consts::TAU * random.unit()).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(r * cos, r * sin, z)
}

/// The instances of a scene, prepared for tracing.
struct Placed<'a> {
    scene: &'a Scene,
    meshes: &'a [Boxed],
    top: Boxed,
    /// Mesh from world, for each instance.
    into: Vec<DAffine3>,
}

impl<'a> Placed<'a> {
    fn new(scene: &'a Scene, meshes: &'a [Boxed]) -> Self {
        let of_mesh = |mesh: &Boxed| mesh.bounds.first().copied().unwrap_or(Bounds::EMPTY);
        let world_box = |i: &crate::scene::Instance| of_mesh(&meshes[i.mesh.0 as usize]).transformed(&i.transform);
        let boxes: Vec<Bounds> = scene.instances.iter().map(world_box).collect();
        let into = scene.instances.iter().map(|i| i.transform.inverse()).collect();
        Placed { scene, meshes, top: Boxed::build(&boxes, Quality::Instances), into }
    }

    /// Cuts segments at the first triangle that each intersects; returns only the first ones if they enter too many
    /// instances.
    fn cut_all(&self, segments: &[Segment], start: f64) -> Vec<Segment> {
        let (mut cut, mut entries) = (Vec::with_capacity(segments.len()), 0);
        for block in segments.chunks(BLOCK) {
            let of_block: Vec<(Segment, u64)> = parallel::map_each(block, &|&s| self.cut_at_hit(s, start));
            entries += of_block.iter().map(|(_, entries)| entries).sum::<u64>();
            cut.extend(of_block.into_iter().map(|(segment, _)| segment));
            if entries > MOST_ENTRIES {
                break;
            }
        }
        cut
    }

    /// Cuts a segment at the first triangle that it intersects; also returns how many instances were tried.
    fn cut_at_hit(&self, segment: Segment, start: f64) -> (Segment, u64) {
        let (mut segment, mut entries) = (segment, 0);
        self.top.visit(&mut segment, |node, segment| {
            for &instance in self.top.items(node) {
                entries += 1;
                segment.length = self.hit_instance(instance, segment, start).unwrap_or(segment.length);
            }
        });
        (segment, entries)
    }

    fn hit_instance(&self, instance: u32, segment: &Segment, start: f64) -> Option<f64> {
        let mesh = self.scene.instances[instance as usize].mesh.0 as usize;
        let (of, tree) = (&self.scene.meshes[mesh], &self.meshes[mesh]);
        let mut local = segment.under(&self.into[instance as usize]);
        let mut hit = None;
        tree.visit(&mut local, |node, local| {
            for &triangle in tree.items(node) {
                if let Some(t) = local.hit(of.corners(triangle).map(|p| p.as_dvec3()), start) {
                    local.length = t;
                    hit = Some(t);
                }
            }
        });
        hit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tests::{grid_mesh, instance, scene};
    use glam::dvec3;

    fn unit() -> Bounds {
        Bounds { min: DVec3::ZERO, max: DVec3::ONE }
    }

    #[test]
    fn a_segment_meets_what_lies_between_its_ends() {
        let ahead = |length| Segment::new(dvec3(-1.0, 0.5, 0.5), DVec3::X, length);
        assert!(ahead(1.0).meets(&unit()) && ahead(9.0).meets(&unit()) && !ahead(0.9).meets(&unit()));
        assert!(!Segment::new(dvec3(-1.0, 1.5, 0.5), DVec3::X, 9.0).meets(&unit()));
        assert!(Segment::new(dvec3(0.5, 0.5, 0.5), DVec3::Y, 0.1).meets(&unit()), "it starts inside");
        assert!(Segment::new(dvec3(-1.0, 0.0, 0.0), DVec3::X, 9.0).meets(&unit()), "it runs along an edge");
    }

    #[test]
    fn a_segment_seen_from_a_mesh_meets_the_same() {
        let by = DAffine3::from_scale_rotation_translation(
            DVec3::splat(3.0),
            glam::DQuat::from_rotation_y(0.7),
            dvec3(4.0, 5.0, 6.0),
        );
        let local = Segment::new(dvec3(-1.0, 0.5, 0.5), DVec3::X, 1.01);
        assert!(local.under(&by).under(&by.inverse()).meets(&unit()));
        assert!(!Segment { length: 0.99, ..local }.under(&by).under(&by.inverse()).meets(&unit()));
    }

    #[test]
    fn segments_end_at_the_first_surface() {
        let above = |z| instance(0, DAffine3::from_translation(dvec3(0.0, 0.0, z)));
        let scene = scene(vec![grid_mesh(8)], vec![above(0.0), above(1.0), above(2.0)]);
        let meshes = [Boxed::of_mesh(&scene.meshes[0], Quality::Medium)];
        let segments = sample(&scene, &meshes, 4000);
        assert_eq!(segments.len(), 4000);
        let crossed = |s: &Segment| {
            let [a, b] = [s.origin.z, s.origin.z + s.length * s.along.z];
            let inside = |z: f64| a.min(b) < z - 1e-5 && z + 1e-5 < a.max(b);
            let p = |z: f64| s.origin + (z - s.origin.z) / s.along.z * s.along;
            let on = |p: DVec3| p.x > 0.0 && p.y > 0.0 && p.x < 8.0 && p.y < 8.0;
            [0.0, 1.0, 2.0].into_iter().filter(|&z| inside(z) && on(p(z))).count()
        };
        assert!(segments.iter().all(|s| crossed(s) == 0));
        let inner = segments.iter().filter(|s| s.length < 22.0).count();
        assert!((1000..2900).contains(&inner), "{inner}");
    }

    #[test]
    fn no_surface_gives_no_segments() {
        assert!(sample(&Scene::default(), &[], 100).is_empty());
        let flat = scene(vec![grid_mesh(1)], vec![instance(0, DAffine3::from_scale(DVec3::ZERO))]);
        assert!(sample(&flat, &[Boxed::of_mesh(&flat.meshes[0], Quality::Fast)], 100).is_empty());
    }
}
