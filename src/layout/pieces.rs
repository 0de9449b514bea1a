//! Objects being divided into pieces: what `bvh` and `overlap` work on.
//!
//! Triangles are divided by their centroids, in coordinates in which the scene spans the unit cube: single precision
//! is enough there to choose where to cut, and areas neither overflow nor vanish. A triangle takes 40 bytes, and only
//! from the moment its object is divided first. Dividing permutes triangles within the range that is divided, so
//! that every piece there ever was stays valid.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::builder::{Builder, Geometries, Object, objects};
use super::instancing::Selection;
use crate::scene::{Bounds, Geometry, InstanceId, Mesh, Scene, TriangleRef};

/// A triangle as far as dividing needs it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    /// Mean of the corners.
    pub(super) centroid: Vec3,
    min: Vec3,
    max: Vec3,
    /// Triangle of the object's mesh.
    triangle: u32,
}

/// A run of an object's triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Piece {
    /// Index into the objects of [`Pieces`].
    pub(super) object: u32,
    start: u32,
    end: u32,
}

impl Piece {
    /// Triangles in it.
    pub(super) fn len(&self) -> usize {
        self.range().len()
    }

    fn range(&self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// The objects that a method restructures, and the box of the scene.
pub(super) struct Pieces<'a> {
    scene: &'a Scene,
    objects: Vec<Object>,
    /// Whether another instance shares the object's mesh.
    shared: Vec<bool>,
    /// The triangles of each object; empty until it is divided.
    items: Vec<Vec<Item>>,
    /// The box of each object, in unit space.
    bounds: Vec<Bounds>,
    /// Boxes of the instances that stay, in unit space.
    pub(super) others: Vec<Bounds>,
    /// Surface area of the box of the scene, in unit space.
    pub(super) scene_area: f64,
    space: UnitSpace,
}

/// The uniform scale and translation that take the scene into the unit cube around the origin.
#[derive(Clone, Copy, Debug)]
struct UnitSpace {
    center: DVec3,
    scale: f64,
}

impl UnitSpace {
    fn of(scene: &Bounds) -> Self {
        let extent = scene.size().max_element();
        UnitSpace { center: scene.center(), scale: if extent > 0.0 { 1.0 / extent } else { 0.0 } }
    }

    fn point(&self, p: DVec3) -> DVec3 {
        (p - self.center) * self.scale
    }

    fn bounds(&self, b: &Bounds) -> Bounds {
        if b.is_empty() { *b } else { Bounds { min: self.point(b.min), max: self.point(b.max) } }
    }
}

impl<'a> Pieces<'a> {
    /// The objects of the selected instances.
    ///
    /// The box of an object is that with which it would be placed undivided: the transformed box of its geometry where it
    /// can stay as it is, the box of its transformed triangles where it is baked.
    pub(super) fn new(scene: &'a Scene, selection: &Selection) -> Self {
        let objects = objects(scene, selection.baked());
        let mut uses = vec![0u32; scene.meshes.len()];
        scene.instances.iter().for_each(|i| uses[i.mesh.0 as usize] += 1);
        let mesh_of = |o: &Object| scene.instances[o.instance as usize].mesh.0 as usize;
        let shared: Vec<bool> = objects.iter().map(|o| uses[mesh_of(o)] > 1).collect();
        let bounds: Vec<Bounds> =
            objects.par_iter().zip(&shared).map(|(&object, &shared)| placed_bounds(scene, object, shared)).collect();
        let others: Vec<Bounds> = instance_bounds(scene, selection.left());
        let all = bounds.iter().chain(&others).fold(Bounds::EMPTY, |all, b| all.union(b));
        let space = UnitSpace::of(&all);
        let in_unit_space = |boxes: Vec<Bounds>| boxes.iter().map(|b| space.bounds(b)).collect();
        Pieces {
            scene,
            items: vec![Vec::new(); objects.len()],
            objects,
            shared,
            bounds: in_unit_space(bounds),
            others: in_unit_space(others),
            scene_area: space.bounds(&all).area(),
            space,
        }
    }

    /// Every object as one piece, with its box.
    pub(super) fn whole(&self) -> Vec<(Piece, Bounds)> {
        let whole = |object: u32| Piece { object, start: 0, end: self.triangle_count(object) };
        (0u32..).zip(&self.bounds).map(|(object, &bounds)| (whole(object), bounds)).collect()
    }

    /// The triangles of a piece of an object that [`Pieces::load`] was called for.
    pub(super) fn items(&self, piece: Piece) -> &[Item] {
        &self.items[piece.object as usize][piece.range()]
    }

    /// Reads the triangles of a piece's object, if that has not been done.
    pub(super) fn load(&mut self, piece: Piece) {
        let at = piece.object as usize;
        if self.items[at].is_empty() {
            let (scene, space, object) = (self.scene, self.space, self.objects[at]);
            let first = object.geometry(scene).first_triangle;
            let count = self.triangle_count(piece.object);
            let item = |triangle| {
                let corners = scene.world_corners(TriangleRef { instance: object.instance, triangle });
                Item::new(corners.map(|p| space.point(p)), triangle)
            };
            self.items[at] = (first..first + count).into_par_iter().map(item).collect();
        }
    }

    /// Divides a loaded piece into the triangles for which `is_left` holds and the others.
    pub(super) fn divide(&mut self, piece: Piece, is_left: impl Fn(&Item) -> bool) -> [Piece; 2] {
        let items = &mut self.items[piece.object as usize][piece.range()];
        let middle = piece.start + partition(items, is_left) as u32;
        [Piece { end: middle, ..piece }, Piece { start: middle, ..piece }]
    }

    /// Adds groups to a layout, each given by the pieces it is made of; every triangle of the objects must be in one
    /// of them. An object that is a group of its own stays a mesh or piece of the input where no other instance
    /// shares its mesh.
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

    fn is_whole(&self, piece: Piece) -> bool {
        piece.len() == self.triangle_count(piece.object) as usize
    }

    fn triangle_count(&self, object: u32) -> u32 {
        self.objects[object as usize].geometry(self.scene).triangles.len() as u32
    }

    /// The object's name; with the next number for a part of one object; with the number of further objects for
    /// several, after the one with the most triangles in the group.
    fn name(&self, group: &[Piece], numbers: &mut [u32]) -> String {
        let mut sizes: BTreeMap<u32, usize> = BTreeMap::new();
        group.iter().for_each(|piece| *sizes.entry(piece.object).or_default() += piece.len());
        let largest = sizes.iter().max_by_key(|(object, size)| (**size, std::cmp::Reverse(**object)));
        let Some((&object, &size)) = largest else { return String::new() };
        let base = self.objects[object as usize].name(self.scene);
        if sizes.len() > 1 {
            return format!("{base} + {}", sizes.len() - 1);
        }
        if size == self.triangle_count(object) as usize {
            return base;
        }
        let number = &mut numbers[object as usize];
        *number += 1;
        format!("{base}.{}", *number - 1)
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
    fn new(corners: [DVec3; 3], triangle: u32) -> Self {
        let bounds = Bounds::of(corners);
        let centroid = (corners[0] + corners[1] + corners[2]) / 3.0;
        Item { centroid: centroid.as_vec3(), min: bounds.min.as_vec3(), max: bounds.max.as_vec3(), triangle }
    }
}

/// A box in single precision, of triangles or of centroids.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) min: Vec3,
    pub(super) max: Vec3,
}

impl Extent {
    pub(super) const EMPTY: Extent = Extent { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box around the triangles.
    pub(super) fn of(items: &[Item]) -> Self {
        Self::gather(items, |item| Extent { min: item.min, max: item.max })
    }

    /// The box around the centroids of the triangles.
    pub(super) fn of_centroids(items: &[Item]) -> Self {
        Self::gather(items, |item| Extent { min: item.centroid, max: item.centroid })
    }

    fn gather(items: &[Item], extent: impl Fn(&Item) -> Extent + Sync) -> Self {
        let fold = |all: Extent, item: &Item| all.union(&extent(item));
        let chunks = items.par_chunks(1 << 14);
        chunks.map(|chunk| chunk.iter().fold(Extent::EMPTY, fold)).reduce(|| Extent::EMPTY, |a, b| a.union(&b))
    }

    /// Takes a triangle in.
    pub(super) fn add(&mut self, item: &Item) {
        *self = self.union(&Extent { min: item.min, max: item.max });
    }

    /// The smallest box around both.
    pub(super) fn union(&self, other: &Extent) -> Extent {
        Extent { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// In double precision.
    pub(super) fn bounds(&self) -> Bounds {
        Bounds { min: self.min.as_dvec3(), max: self.max.as_dvec3() }
    }

    /// Edge lengths.
    pub(super) fn size(&self) -> Vec3 {
        self.max - self.min
    }
}

/// Moves the items for which `is_left` holds before the others; gives their number.
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

/// The box with which an object is placed undivided.
fn placed_bounds(scene: &Scene, object: Object, baked: bool) -> Bounds {
    if baked {
        Bounds::of(object.triangles(scene).flat_map(|at| scene.world_corners(at)))
    } else {
        let transform = &scene.instances[object.instance as usize].transform;
        geometry_bounds(object.geometry(scene)).transformed(transform)
    }
}

/// The boxes with which instances are placed.
fn instance_bounds(scene: &Scene, instances: impl Iterator<Item = InstanceId>) -> Vec<Bounds> {
    let mut of_mesh: Vec<Option<Bounds>> = vec![None; scene.meshes.len()];
    let mesh_bounds = |mesh: &Mesh| mesh.geometries.iter().map(geometry_bounds).fold(Bounds::EMPTY, |a, b| a.union(&b));
    instances
        .map(|i| {
            let instance = &scene.instances[i.0 as usize];
            let mesh = instance.mesh.0 as usize;
            let bounds = of_mesh[mesh].get_or_insert_with(|| mesh_bounds(&scene.meshes[mesh]));
            bounds.transformed(&instance.transform)
        })
        .collect()
}

/// The box of a geometry, in the coordinates of its mesh.
fn geometry_bounds(geometry: &Geometry) -> Bounds {
    Bounds::of((0..geometry.triangles.len()).flat_map(|t| geometry.corners(t)).map(|p| p.as_dvec3()))
}
