//! Builds layouts from kept meshes, pieces of meshes, and baked groups.

use std::collections::BTreeMap;

use glam::DAffine3;

use crate::layout::{Content, Group, GroupGeometry, Layout, Note, Placement};
use crate::scene::{Geometry, InstanceId, Mesh, MeshId, Scene, TriangleRef};
pub(crate) use crate::scene::{Object, objects};

/// Some or all triangles of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    /// Triangles in ascending order.
    pub(crate) triangles: Vec<u32>,
    /// As in [`Content::Piece`].
    pub(crate) frame: DAffine3,
}

/// Triangles may share a geometry if their keys are equal.
pub(crate) type GeometryKey = (Option<u32>, u32);

impl Object {
    /// Returns the name of the object: that of its node, else of its mesh, followed by the number of the geometry if
    /// the mesh has several.
    pub(crate) fn name(self, scene: &Scene) -> String {
        let mesh = scene.mesh_of(InstanceId(self.instance));
        let node = &scene.instances[self.instance as usize].name;
        geometry_name(if node.is_empty() { &mesh.name } else { node }, mesh, self.geometry)
    }
}

/// Returns the key of a geometry.
pub(crate) fn key(geometry: &Geometry) -> GeometryKey {
    (geometry.material, geometry.merge_class)
}

/// Collects triangles into geometries, ordered by material, then merge class.
#[derive(Default)]
pub(crate) struct Geometries(BTreeMap<GeometryKey, GroupGeometry>);

impl Geometries {
    /// Appends triangles that belong to a geometry of the scene.
    pub(crate) fn add(&mut self, of: &Geometry, triangles: impl Iterator<Item = TriangleRef>) {
        let (material, merge_class) = key(of);
        let entry = self.0.entry(key(of)).or_insert_with(|| GroupGeometry {
            material,
            merge_class,
            opacity: of.opacity,
            triangles: Vec::new(),
        });
        entry.triangles.extend(triangles);
    }

    /// Returns the geometries.
    pub(crate) fn finish(self) -> Vec<GroupGeometry> {
        let fitted = |mut geometry: GroupGeometry| {
            geometry.triangles.shrink_to_fit();
            geometry
        };
        self.0.into_values().map(fitted).collect()
    }
}

/// A layout under construction. Each mesh or piece becomes one group, no matter how many instances place it.
pub(crate) struct Builder<'a> {
    scene: &'a Scene,
    first_instance: Vec<u32>,
    whole: Vec<Option<u32>>,
    pieces: BTreeMap<(MeshId, u32), u32>,
    /// The groups of the pieces of each opened mesh.
    opened: BTreeMap<MeshId, Vec<u32>>,
    layout: Layout,
    baked: Vec<Group>,
}

impl<'a> Builder<'a> {
    /// Creates an empty layout.
    pub(crate) fn new(scene: &'a Scene) -> Self {
        Builder {
            scene,
            first_instance: first_instances(scene),
            whole: vec![None; scene.meshes.len()],
            pieces: BTreeMap::new(),
            opened: BTreeMap::new(),
            layout: Layout::default(),
            baked: Vec::new(),
        }
    }

    /// Leaves an instance unchanged. A mesh with dropped triangles cannot be kept: the rest of it becomes a piece.
    pub(crate) fn keep(&mut self, instance: InstanceId) {
        let mesh = self.scene.instances[instance.0 as usize].mesh;
        let group = match self.whole[mesh.0 as usize] {
            Some(group) => group,
            None => {
                let content = if self.scene.meshes[mesh.0 as usize].dropped {
                    self.piece(mesh, None)
                } else {
                    Content::Kept(mesh)
                };
                let group = self.push(self.scene.meshes[mesh.0 as usize].name.clone(), content);
                self.whole[mesh.0 as usize] = Some(group);
                group
            }
        };
        self.place(group, instance);
    }

    /// Places an object as content shared with other instances of its mesh: the mesh if the object is all of it, else a
    /// piece of the mesh.
    pub(crate) fn place_object(&mut self, object: Object) {
        let instance = InstanceId(object.instance);
        let mesh = self.scene.instances[object.instance as usize].mesh;
        if self.scene.mesh_of(instance).geometries.len() == 1 {
            return self.keep(instance);
        }
        let group = match self.pieces.get(&(mesh, object.geometry)) {
            Some(&group) => group,
            None => {
                let content = self.piece(mesh, Some(object.geometry));
                let of = &self.scene.meshes[mesh.0 as usize];
                let group = self.push(geometry_name(&of.name, of, object.geometry), content);
                self.pieces.insert((mesh, object.geometry), group);
                group
            }
        };
        self.place(group, instance);
    }

    /// Places the pieces of an instance's mesh, which all its opened instances share, instead of the mesh. `pieces`
    /// holds the pieces of each mesh and is parallel to the meshes.
    pub(crate) fn open(&mut self, instance: InstanceId, pieces: &[Vec<Part>]) {
        let mesh = self.scene.instances[instance.0 as usize].mesh;
        let groups = match self.opened.get(&mesh) {
            Some(groups) => groups.clone(),
            None => {
                let groups: Vec<u32> =
                    (0..).zip(&pieces[mesh.0 as usize]).map(|(i, piece)| self.push_part(mesh, i, piece)).collect();
                self.opened.insert(mesh, groups.clone());
                groups
            }
        };
        groups.into_iter().for_each(|group| self.place(group, instance));
    }

    /// Adds the group of a part of a mesh.
    fn push_part(&mut self, mesh: MeshId, number: usize, piece: &Part) -> u32 {
        let instance = self.first_instance[mesh.0 as usize];
        let of = &self.scene.meshes[mesh.0 as usize];
        let mut geometries = Geometries::default();
        for run in piece.triangles.chunk_by(|&a, &b| of.locate(a).0 == of.locate(b).0) {
            let geometry = &of.geometries[of.locate(run[0]).0];
            geometries.add(geometry, run.iter().map(|&triangle| TriangleRef { instance, triangle }));
        }
        let base = if of.name.is_empty() { "object" } else { &of.name };
        self.push(
            format!("{base}.{number}"),
            Content::Piece { mesh, frame: piece.frame, geometries: geometries.finish() },
        )
    }

    /// Places the whole mesh of an instance with one geometry per material and merge class.
    pub(crate) fn place_joined(&mut self, instance: InstanceId) {
        let mesh = self.scene.mesh_of(instance);
        let mut keys: Vec<_> = mesh.geometries.iter().map(key).collect();
        keys.sort_unstable();
        if keys.windows(2).all(|k| k[0] != k[1]) {
            return self.keep(instance);
        }
        let content = self.piece(self.scene.instances[instance.0 as usize].mesh, None);
        let group = self.push(mesh.name.clone(), content);
        self.place(group, instance);
    }

    /// Adds a group of placed triangles.
    pub(crate) fn bake(&mut self, name: String, geometries: Geometries) {
        self.bake_in(DAffine3::IDENTITY, name, geometries);
    }

    /// Adds a group of placed triangles stored in a frame, given as world from group.
    pub(crate) fn bake_in(&mut self, frame: DAffine3, name: String, geometries: Geometries) {
        self.baked.push(Group { name, content: Content::Baked { frame, geometries: geometries.finish() } });
    }

    /// Adds a note for the report.
    pub(crate) fn note(&mut self, note: Note) {
        self.layout.notes.push(note);
    }

    /// Returns the layout: first kept content, in the order of its instances, then the baked groups in the order in
    /// which they were added.
    pub(crate) fn finish(self) -> Layout {
        let Builder { mut layout, baked, .. } = self;
        layout.placements.sort_by_key(|p| p.instance);
        for group in baked {
            let Content::Baked { frame, .. } = group.content else { unreachable!("only baked groups are queued") };
            let index = layout.groups.len() as u32;
            layout.placements.push(Placement { group: index, instance: None, transform: frame });
            layout.groups.push(group);
        }
        layout
    }

    /// Returns the content of a group with one geometry or all geometries of a mesh.
    fn piece(&self, mesh: MeshId, geometry: Option<u32>) -> Content {
        let instance = self.first_instance[mesh.0 as usize];
        let all = 0..self.scene.meshes[mesh.0 as usize].geometries.len() as u32;
        let mut geometries = Geometries::default();
        for geometry in geometry.map_or(all, |g| g..g + 1) {
            let object = Object { instance, geometry };
            geometries.add(object.geometry(self.scene), object.triangles(self.scene));
        }
        Content::Piece { mesh, frame: DAffine3::IDENTITY, geometries: geometries.finish() }
    }

    fn push(&mut self, name: String, content: Content) -> u32 {
        self.layout.groups.push(Group { name, content });
        self.layout.groups.len() as u32 - 1
    }

    fn place(&mut self, group: u32, instance: InstanceId) {
        let of_group = self.layout.groups[group as usize].content.piece_frame();
        let transform = self.scene.instances[instance.0 as usize].transform * of_group;
        self.layout.placements.push(Placement { group, instance: Some(instance), transform });
    }
}

/// Returns the first instance that places each mesh; 0 for unplaced meshes.
pub(crate) fn first_instances(scene: &Scene) -> Vec<u32> {
    let mut first = vec![None; scene.meshes.len()];
    for (i, instance) in scene.instances.iter().enumerate() {
        first[instance.mesh.0 as usize].get_or_insert(i as u32);
    }
    first.into_iter().map(Option::unwrap_or_default).collect()
}

/// Names a group by the number of triangles of each object in it: the name of the object with the most, followed by the
/// next number if the group is only a part of one object, or by the number of other objects if there are any.
pub(crate) fn group_name(
    scene: &Scene,
    objects: &[Object],
    sizes: &BTreeMap<u32, usize>,
    numbers: &mut [u32],
) -> String {
    let largest = sizes.iter().max_by_key(|(object, size)| (**size, std::cmp::Reverse(**object)));
    let Some((&object, &size)) = largest else { return String::new() };
    let object = object as usize;
    let base = objects[object].name(scene);
    if sizes.len() > 1 {
        return format!("{base} + {}", sizes.len() - 1);
    }
    if size == objects[object].geometry(scene).triangles.len() {
        return base;
    }
    numbers[object] += 1;
    format!("{base}.{}", numbers[object] - 1)
}

fn geometry_name(base: &str, mesh: &Mesh, geometry: u32) -> String {
    let base = if base.is_empty() { "object" } else { base };
    if mesh.geometries.len() == 1 { base.to_owned() } else { format!("{base}.{geometry}") }
}
