//! Objects divided into pieces, for `bvh` and `overlap`.
//!
//! A triangle takes 64 bytes, but only once its object is first divided. Dividing permutes triangles within the divided
//! range, so all earlier pieces stay valid.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::layout::builder::{Builder, Geometries, Object, group_name, objects};
use crate::methods::instancing::Selection;
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::{Bounds, Geometry, Scene, TriangleRef};

/// The properties of a triangle that dividing needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    /// Its box in world coordinates.
    pub(super) bounds: Bounds,
    /// Mean of the corners relative to the middle of the scene's core ([`Pieces::seen_from_middle`]), where single precision
    /// is enough to choose a side.
    pub(super) centroid: Vec3,
    /// Index of the triangle in the object's mesh.
    triangle: u32,
}

/// Triangles per task.
pub(super) const CHUNK: usize = 1 << 14;

/// A run of an object's triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Piece {
    /// Index into the objects of [`Pieces`].
    pub(super) object: u32,
    start: u32,
    end: u32,
}

impl Piece {
    /// Returns the number of triangles.
    pub(super) fn len(&self) -> usize {
        self.range().len()
    }

    fn range(&self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// The objects that a method restructures, and the box of the scene's core.
pub(super) struct Pieces<'a> {
    scene: &'a Scene,
    objects: Vec<Object>,
    /// Whether another instance shares the object's mesh.
    shared: Vec<bool>,
    /// The triangles of each object; empty until it is divided.
    items: Vec<Vec<Item>>,
    /// The box of each object.
    bounds: Vec<Bounds>,
    /// Boxes of the instances of the core that stay unchanged.
    pub(super) others: Vec<Bounds>,
    /// Surface area of the box of the scene's core.
    pub(super) core_area: f64,
    /// Center of that box.
    middle: DVec3,
}

impl<'a> Pieces<'a> {
    /// Collects the objects of the selected instances.
    ///
    /// The box of an object is the one with which it would be placed undivided: the transformed box of its geometry if
    /// it can stay unchanged, the box of its transformed triangles if it is baked.
    pub(super) fn new(scene: &'a Scene, selection: &Selection) -> Self {
        let objects = objects(scene, selection.baked());
        let mut uses = vec![0u32; scene.meshes.len()];
        scene.instances.iter().for_each(|i| uses[i.mesh.0 as usize] += 1);
        let mesh_of = |o: &Object| scene.instances[o.instance as usize].mesh.0 as usize;
        let shared: Vec<bool> = objects.iter().map(|o| uses[mesh_of(o)] > 1).collect();
        let bounds: Vec<Bounds> =
            objects.par_iter().zip(&shared).map(|(&object, &shared)| placed_bounds(scene, object, shared)).collect();
        let others: Vec<Bounds> = selection.left_bounds(scene);
        let in_core = objects.iter().zip(&bounds).filter(|(object, _)| !scene.core().sets_apart(**object));
        let core = in_core.map(|(_, b)| b).chain(&others).fold(Bounds::EMPTY, |all, b| all.union(b));
        Pieces {
            scene,
            items: vec![Vec::new(); objects.len()],
            objects,
            shared,
            bounds,
            others,
            core_area: core.area(),
            middle: core.center(),
        }
    }

    /// Returns a world-space point in the coordinates of the stored centroids.
    pub(super) fn seen_from_middle(&self, point: DVec3) -> Vec3 {
        (point - self.middle).as_vec3()
    }

    /// Whether a piece is of an object outside the scene's core.
    pub(super) fn is_apart(&self, piece: Piece) -> bool {
        self.scene.core().sets_apart(self.objects[piece.object as usize])
    }

    /// Returns each object as one piece, with its box.
    pub(super) fn whole(&self) -> Vec<(Piece, Bounds)> {
        let whole = |object: u32| Piece { object, start: 0, end: self.triangle_count(object) };
        (0u32..).zip(&self.bounds).map(|(object, &bounds)| (whole(object), bounds)).collect()
    }

    /// Returns the triangles of a piece; [`Pieces::load`] must have been called for its object.
    pub(super) fn items(&self, piece: Piece) -> &[Item] {
        &self.items[piece.object as usize][piece.range()]
    }

    /// Reads the triangles of a piece's object unless they were already read.
    pub(super) fn load(&mut self, piece: Piece) {
        let at = piece.object as usize;
        if self.items[at].is_empty() {
            let (scene, middle, object) = (self.scene, self.middle, self.objects[at]);
            let first = object.geometry(scene).first_triangle;
            let count = self.triangle_count(piece.object);
            let item = |triangle| {
                let corners = scene.world_corners(TriangleRef { instance: object.instance, triangle });
                Item::new(corners, middle, triangle)
            };
            self.items[at] = (first..first + count).into_par_iter().with_min_len(CHEAP_ELEMENTS).map(item).collect();
        }
    }

    /// Returns the boxes of the triangles of a piece when baked.
    pub(super) fn boxes(&self, piece: Piece) -> Vec<Bounds> {
        if let Some(items) = self.items[piece.object as usize].get(piece.range()) {
            return items.iter().map(|item| item.bounds).collect();
        }
        let object = self.objects[piece.object as usize];
        let first = object.geometry(self.scene).first_triangle;
        let corners = |triangle| self.scene.world_corners(TriangleRef { instance: object.instance, triangle });
        (first + piece.start..first + piece.end).map(|triangle| Bounds::of(corners(triangle))).collect()
    }

    /// The surface area of the scene's box.
    pub(super) fn scene_area(&self) -> f64 {
        self.scene.bounds().area()
    }

    /// Returns the box around the triangles of a piece when baked.
    pub(super) fn baked_bounds(&self, piece: Piece) -> Bounds {
        match self.items[piece.object as usize].get(piece.range()) {
            Some(items) => bounds_of(items),
            None => placed_bounds(self.scene, self.objects[piece.object as usize], true),
        }
    }

    /// Divides a loaded piece into the triangles for which `is_left` holds and the others.
    pub(super) fn divide(&mut self, piece: Piece, is_left: impl Fn(&Item) -> bool) -> [Piece; 2] {
        let items = &mut self.items[piece.object as usize][piece.range()];
        let middle = piece.start + partition(items, is_left) as u32;
        [Piece { end: middle, ..piece }, Piece { start: middle, ..piece }]
    }

    /// Adds groups to a layout, each given by its pieces; each triangle of the objects must be in exactly one of them.
    /// An object that forms a group by itself stays a mesh or piece of the input if no other instance shares its mesh.
    pub(super) fn emit(&self, groups: &[Vec<Piece>], layout: &mut Builder) {
        let mut numbers = vec![0u32; self.objects.len()];
        for group in groups {
            match *group.as_slice() {
                [piece] if self.is_whole(piece) && !self.shared[piece.object as usize] => {
                    layout.place_object(self.objects[piece.object as usize]);
                }
                _ => layout.bake(self.name(group, &mut numbers), self.geometries(group)),
            }
        }
    }

    /// Whether a piece is its whole object.
    pub(super) fn is_whole(&self, piece: Piece) -> bool {
        piece.len() == self.triangle_count(piece.object) as usize
    }

    fn triangle_count(&self, object: u32) -> u32 {
        self.objects[object as usize].geometry(self.scene).triangles.len() as u32
    }

    fn name(&self, group: &[Piece], numbers: &mut [u32]) -> String {
        let mut sizes: BTreeMap<u32, usize> = BTreeMap::new();
        group.iter().for_each(|piece| *sizes.entry(piece.object).or_default() += piece.len());
        group_name(self.scene, &self.objects, &sizes, numbers)
    }

    fn geometries(&self, group: &[Piece]) -> Geometries {
        let mut geometries = Geometries::default();
        for &piece in group {
            let object = self.objects[piece.object as usize];
            let of = object.geometry(self.scene);
            if self.is_whole(piece) {
                geometries.add(of, object.triangles(self.scene));
            } else {
                let mut triangles: Vec<u32> = self.items(piece).iter().map(|item| item.triangle).collect();
                triangles.sort_unstable();
                let placed = |triangle| TriangleRef { instance: object.instance, triangle };
                geometries.add(of, triangles.into_iter().map(placed));
            }
        }
        geometries
    }
}

impl Item {
    fn new(corners: [DVec3; 3], middle: DVec3, triangle: u32) -> Self {
        let centroid = corners.iter().map(|&p| (p - middle) / 3.0).sum::<DVec3>();
        Item { bounds: Bounds::of(corners), centroid: centroid.as_vec3(), triangle }
    }
}

/// Returns the box around triangles.
pub(super) fn bounds_of(items: &[Item]) -> Bounds {
    union_of(items, |item| item.bounds)
}

/// Returns the box around the stored centroids of triangles.
pub(super) fn centroid_bounds(items: &[Item]) -> Bounds {
    union_of(items, |item| Bounds { min: item.centroid.as_dvec3(), max: item.centroid.as_dvec3() })
}

fn union_of(items: &[Item], bounds: impl Fn(&Item) -> Bounds + Sync) -> Bounds {
    let of_chunk = |chunk: &[Item]| chunk.iter().fold(Bounds::EMPTY, |all, item| all.union(&bounds(item)));
    items.par_chunks(CHUNK).map(of_chunk).reduce(|| Bounds::EMPTY, |a, b| a.union(&b))
}

/// Returns the axis of the longest edge of a box; the first one wins ties.
pub(super) fn longest_axis(bounds: &Bounds) -> usize {
    let size = bounds.size();
    if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) }
}

/// Moves the items for which `is_left` holds before the others; returns their number.
fn partition(items: &mut [Item], is_left: impl Fn(&Item) -> bool) -> usize {
    let (mut left, mut right) = (0, items.len());
    while left < right {
        if is_left(&items[left]) {
            left += 1;
        } else {
            right -= 1;
            items.swap(left, right);
        }
    }
    left
}

/// Returns the box with which an object is placed undivided.
fn placed_bounds(scene: &Scene, object: Object, baked: bool) -> Bounds {
    if baked {
        Bounds::of(object.triangles(scene).flat_map(|at| scene.world_corners(at)))
    } else {
        let transform = &scene.instances[object.instance as usize].transform;
        geometry_bounds(object.geometry(scene)).transformed(transform)
    }
}

/// Returns the box of a geometry, in mesh coordinates.
fn geometry_bounds(geometry: &Geometry) -> Bounds {
    Bounds::of((0..geometry.triangles.len()).flat_map(|t| geometry.corners(t)).map(|p| p.as_dvec3()))
}
