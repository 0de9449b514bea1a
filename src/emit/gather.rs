//! The vertices and indices of a rewritten group, collected from the primitives its triangles come from.

use glam::{DAffine3, DMat3, DVec3};
use raykiln_formats::Document;
use raykiln_formats::contents::Source;
use raykiln_formats::document::{Attribute, Component, Element, NewAccessor, Target};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::layout::{Content, GroupGeometry};
use crate::scene::{Geometry, Origin, Scene, TriangleRef};

/// Vertices up to this many are indexed with 16 bits; 65,535 itself is glTF's primitive restart.
const MOST_SHORT_VERTICES: usize = 65_535;

/// The primitives of a scene, with their attributes at hand.
pub(super) struct Sources<'a> {
    scene: &'a Scene,
    /// By mesh, then geometry.
    attributes: Vec<Vec<Vec<Attribute<'a>>>>,
}

/// The primitives of a rewritten group.
pub(super) struct Gathered {
    pub(super) primitives: Vec<NewPrimitive>,
    /// The largest distance between a stored position and the exact one, in units of the group.
    pub(super) position_error: f64,
}

/// A primitive to be written.
pub(super) struct NewPrimitive {
    pub(super) attributes: Vec<(String, NewAccessor)>,
    pub(super) indices: NewAccessor,
    pub(super) material: Option<u32>,
    /// Mesh and primitive of the document whose further properties this primitive inherits.
    pub(super) like: (usize, usize),
    pub(super) sources: Vec<Source>,
    /// Runs of source triangles: source, first triangle, count.
    pub(super) runs: Vec<[u32; 3]>,
}

impl<'a> Sources<'a> {
    pub(super) fn new(doc: &'a Document, scene: &'a Scene) -> Self {
        let attributes = scene
            .meshes
            .par_iter()
            .map(|mesh| {
                let source = mesh.source as usize;
                mesh.geometries.iter().map(|g| doc.attributes(source, g.primitive as usize)).collect()
            })
            .collect();
        Sources { scene, attributes }
    }
}

/// Collects a group; `None` for a mesh that is kept.
pub(super) fn gather(sources: &Sources, content: &Content) -> Option<Gathered> {
    let (basis, geometries) = match content {
        Content::Kept(_) => return None,
        Content::Piece { frame, geometries, .. } => (Basis::Mesh(frame.inverse()), geometries),
        Content::Baked { frame, geometries } => (Basis::World(frame.inverse()), geometries),
    };
    let gathered: Vec<(NewPrimitive, f64)> =
        geometries.par_iter().map(|geometry| gather_geometry(sources, basis, geometry)).collect();
    let position_error = gathered.iter().map(|(_, error)| *error).fold(0.0, f64::max);
    Some(Gathered { primitives: gathered.into_iter().map(|(primitive, _)| primitive).collect(), position_error })
}

/// How corners get into a group.
#[derive(Clone, Copy)]
enum Basis {
    /// From the coordinates of the mesh, for all of its instances.
    Mesh(DAffine3),
    /// From the world, for one instance.
    World(DAffine3),
}

fn gather_geometry(sources: &Sources, basis: Basis, geometry: &GroupGeometry) -> (NewPrimitive, f64) {
    let mut vertices = Vertices::new(sources.scene, basis);
    let mut runs = Vec::new();
    let mut corners = Vec::with_capacity(3 * geometry.triangles.len());
    for &at in &geometry.triangles {
        let (part, triangle) = vertices.part_of(at);
        corners.extend(vertices.corners(part, triangle));
        extend_runs(&mut runs, part, vertices.parts[part as usize].geometry.kept.as_ref(), triangle);
    }
    let first = &vertices.parts[0];
    let like = (first.mesh_source as usize, first.geometry.primitive as usize);
    let (attributes, position_error) = vertices.attributes(sources);
    let primitive = NewPrimitive {
        attributes,
        indices: indices(&corners, vertices.list.len()),
        material: geometry.material,
        like,
        sources: vertices.parts.iter().map(|p| p.source).collect(),
        runs,
    };
    (primitive, position_error)
}

/// Appends a triangle to the runs, joined to the last run where it follows on.
fn extend_runs(runs: &mut Vec<[u32; 3]>, part: u32, kept: Option<&Vec<u32>>, triangle: usize) {
    let triangle = kept.map_or(triangle as u32, |k| k[triangle]);
    match runs.last_mut() {
        Some([p, first, count]) if *p == part && *first + *count == triangle => *count += 1,
        _ => runs.push([part, triangle, 1]),
    }
}

fn indices(corners: &[u32], vertices: usize) -> NewAccessor {
    let (data, component) = if vertices <= MOST_SHORT_VERTICES {
        (corners.iter().flat_map(|&c| (c as u16).to_le_bytes()).collect(), Component::U16)
    } else {
        (corners.iter().flat_map(|&c| c.to_le_bytes()).collect(), Component::U32)
    };
    NewAccessor {
        data,
        element: Element { component, components: 1, normalized: false },
        target: Target::Indices,
        bounds: false,
    }
}

/// A source primitive as one instance places it.
struct Part<'a> {
    mesh: usize,
    mesh_source: u32,
    geometry_index: usize,
    geometry: &'a Geometry,
    /// Group from mesh; `None` where nothing changes.
    transform: Option<Transform>,
    source: Source,
}

/// How positions, normals and tangents change.
struct Transform {
    affine: DAffine3,
    /// Cofactors of the linear part: they take normals along, also where the inverse would overflow.
    normals: DMat3,
    mirrored: bool,
}

impl Transform {
    fn unless_identity(affine: DAffine3) -> Option<Transform> {
        if affine == DAffine3::IDENTITY {
            return None;
        }
        let m = affine.matrix3;
        let mirrored = m.determinant() < 0.0;
        let side = if mirrored { -1.0 } else { 1.0 };
        let normals = DMat3::from_cols(
            m.y_axis.cross(m.z_axis) * side,
            m.z_axis.cross(m.x_axis) * side,
            m.x_axis.cross(m.y_axis) * side,
        );
        Some(Transform { affine, normals, mirrored })
    }
}

/// The vertices of a new primitive, numbered in the order of first use.
struct Vertices<'a> {
    scene: &'a Scene,
    basis: Basis,
    parts: Vec<Part<'a>>,
    /// Part by instance (0 for a piece) and geometry.
    part_numbers: FxHashMap<(u32, u32), u32>,
    /// Number of a vertex, by part and vertex of the source.
    numbers: FxHashMap<(u32, u32), u32>,
    /// Part and vertex of the source, by number.
    list: Vec<(u32, u32)>,
}

impl<'a> Vertices<'a> {
    fn new(scene: &'a Scene, basis: Basis) -> Self {
        Vertices {
            scene,
            basis,
            parts: Vec::new(),
            part_numbers: FxHashMap::default(),
            numbers: FxHashMap::default(),
            list: Vec::new(),
        }
    }

    /// Whether triangles are those of one instance.
    fn is_placed(&self) -> bool {
        matches!(self.basis, Basis::World(_))
    }

    /// The part a triangle belongs to, and its index in the part's geometry.
    ///
    /// What is baked is taken from the mesh that the document places, so that a copy adds no error of its own; a piece
    /// is shared with the mesh's other instances.
    fn part_of(&mut self, at: TriangleRef) -> (u32, usize) {
        let placed = &self.scene.instances[at.instance as usize];
        let origin = match self.basis {
            Basis::World(_) => self.scene.origin(at),
            Basis::Mesh(_) => Origin { mesh: placed.mesh, triangle: at.triangle, transform: placed.transform },
        };
        let mesh = &self.scene.meshes[origin.mesh.0 as usize];
        let (geometry, triangle) = mesh.locate(origin.triangle);
        let instance = if self.is_placed() { at.instance } else { 0 };
        let next = self.parts.len() as u32;
        let part = *self.part_numbers.entry((instance, geometry as u32)).or_insert(next);
        if part == next {
            self.parts.push(self.new_part(at.instance, &origin, geometry));
        }
        (part, triangle)
    }

    fn new_part(&self, instance: u32, origin: &Origin, geometry_index: usize) -> Part<'a> {
        let placed = &self.scene.instances[instance as usize];
        let mesh = &self.scene.meshes[origin.mesh.0 as usize];
        let geometry = &mesh.geometries[geometry_index];
        Part {
            mesh: origin.mesh.0 as usize,
            mesh_source: mesh.source,
            geometry_index,
            geometry,
            transform: Transform::unless_identity(match self.basis {
                Basis::World(into) => into * origin.transform,
                Basis::Mesh(into) => into,
            }),
            source: Source {
                node: self.is_placed().then_some(placed.node),
                copy: if self.is_placed() { placed.copy } else { 0 },
                mesh: mesh.source,
                primitive: geometry.primitive,
            },
        }
    }

    /// The numbers of a triangle's vertices, counter-clockwise from the front also where the part is mirrored.
    fn corners(&mut self, part: u32, triangle: usize) -> [u32; 3] {
        let source = &self.parts[part as usize];
        let mirrored = source.transform.as_ref().is_some_and(|t| t.mirrored);
        let [a, b, c] = source.geometry.triangles[triangle];
        let ordered = if mirrored { [a, c, b] } else { [a, b, c] };
        ordered.map(|vertex| {
            let next = self.list.len() as u32;
            let number = *self.numbers.entry((part, vertex)).or_insert(next);
            if number == next {
                self.list.push((part, vertex));
            }
            number
        })
    }

    /// All attributes of the vertices, and the position error.
    fn attributes(&self, sources: &Sources) -> (Vec<(String, NewAccessor)>, f64) {
        let mut position_error = 0.0;
        let by_part: Vec<&[Attribute]> =
            self.parts.iter().map(|p| sources.attributes[p.mesh][p.geometry_index].as_slice()).collect();
        let gathered = by_part[0]
            .iter()
            .enumerate()
            .map(|(first, attribute)| {
                let same: Vec<&Attribute> = by_part.iter().map(|list| find(list, first, &attribute.name)).collect();
                let accessor = match attribute.name.as_str() {
                    "POSITION" => self.positions(&same, &mut position_error),
                    "NORMAL" => self.directions(&same, |t, v| t.normals * v, false),
                    "TANGENT" => self.directions(&same, |t, v| t.affine.matrix3 * v, true),
                    _ => self.copied(&same),
                };
                (attribute.name.clone(), accessor)
            })
            .collect();
        (gathered, position_error)
    }

    /// Whether an attribute can be copied byte for byte: stored alike in all parts, none of them moved.
    fn can_copy(&self, same: &[&Attribute]) -> bool {
        self.parts.iter().all(|p| p.transform.is_none()) && same.iter().all(|a| a.element == same[0].element)
    }

    fn copied(&self, same: &[&Attribute]) -> NewAccessor {
        let element = same[0].element;
        let mut data = Vec::with_capacity(self.list.len() * element.size());
        for &(part, vertex) in &self.list {
            data.extend_from_slice(same[part as usize].bytes(vertex));
        }
        let bounds = same[0].name == "POSITION";
        NewAccessor { data, element, target: Target::Vertices, bounds }
    }

    /// Positions in the group's frame, computed in double precision and rounded once.
    fn positions(&self, same: &[&Attribute], error: &mut f64) -> NewAccessor {
        if self.can_copy(same) {
            return self.copied(same);
        }
        let mut data = Vec::with_capacity(self.list.len() * 12);
        for &(part, vertex) in &self.list {
            let part = &self.parts[part as usize];
            let stored = part.geometry.positions[vertex as usize];
            let rounded = match &part.transform {
                None => stored,
                Some(t) => {
                    let exact = t.affine.transform_point3(stored.as_dvec3());
                    *error = error.max(exact.as_vec3().as_dvec3().distance(exact));
                    exact.as_vec3()
                }
            };
            data.extend_from_slice(bytemuck::bytes_of(&rounded));
        }
        NewAccessor { data, element: FLOAT3, target: Target::Vertices, bounds: true }
    }

    /// Normals or tangents (whose fourth component is their side), turned with their parts and of unit length.
    fn directions(&self, same: &[&Attribute], turn: impl Fn(&Transform, DVec3) -> DVec3, sided: bool) -> NewAccessor {
        if self.can_copy(same) {
            return self.copied(same);
        }
        let mut data = Vec::with_capacity(self.list.len() * if sided { 16 } else { 12 });
        for &(part, vertex) in &self.list {
            let transform = self.parts[part as usize].transform.as_ref();
            let [x, y, z, side] = same[part as usize].numbers(vertex);
            let direction = DVec3::new(x, y, z);
            let turned = transform.map_or(Some(direction), |t| unit(turn(t, direction))).unwrap_or(direction);
            data.extend_from_slice(bytemuck::bytes_of(&turned.as_vec3()));
            if sided {
                let flip = transform.is_some_and(|t| t.mirrored);
                data.extend_from_slice(bytemuck::bytes_of(&(if flip { -side } else { side } as f32)));
            }
        }
        NewAccessor { data, element: if sided { FLOAT4 } else { FLOAT3 }, target: Target::Vertices, bounds: false }
    }
}

const FLOAT3: Element = Element { component: Component::F32, components: 3, normalized: false };
const FLOAT4: Element = Element { component: Component::F32, components: 4, normalized: false };

/// The attribute of that name, most likely at the same place as in the first part.
fn find<'a, 'b>(list: &'b [Attribute<'a>], likely: usize, name: &str) -> &'b Attribute<'a> {
    list.get(likely)
        .filter(|a| a.name == name)
        .or_else(|| list.iter().find(|a| a.name == name))
        .expect("primitives of one merge class have the same attributes")
}

/// The unit vector of a direction, whatever its length; `None` for zero and for what is not finite.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (largest > 0.0 && v.is_finite()).then(|| (v / largest).normalize())
}
