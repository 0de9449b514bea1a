//! Collects the vertices and indices of a rewritten group from the source primitives of its triangles.

use glam::{DMat3, DVec3};
use raykiln_formats::Document;
use raykiln_formats::document::{Attribute, Component, Element};
use raykiln_formats::edit::{NewAccessor, NewPrimitive, Target};
use raykiln_formats::record::{Origins, Source};
use rayon::prelude::*;

use crate::layout::store::{Part, Store, Vertices, rounding_error};
use crate::layout::{Content, GroupGeometry};
use crate::parallel;
use crate::scene::Scene;

/// Up to this many vertices are indexed with 16 bits; 65,535 itself is glTF's primitive restart value.
const MOST_SHORT_VERTICES: usize = 65_535;

/// The primitives of a scene, with their attributes.
pub(super) struct Sources<'a> {
    scene: &'a Scene,
    /// By mesh, then geometry.
    attributes: Vec<Vec<Vec<Attribute<'a>>>>,
}

/// The primitives of a rewritten group.
pub(super) struct Gathered {
    pub(super) primitives: Vec<NewPrimitive>,
    /// Where their triangles come from.
    pub(super) origins: Vec<Origins>,
    /// The largest distance between a stored position and the exact one, in units of the group.
    pub(super) position_error: f64,
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

    /// Returns the document index of the mesh that a part is taken from.
    fn document_mesh(&self, part: &Part) -> u32 {
        self.scene.meshes[part.mesh.0 as usize].source
    }

    /// Returns the source of a part, as recorded in the document.
    fn source(&self, part: &Part) -> Source {
        let instance = part.instance.map(|i| &self.scene.instances[i as usize]);
        Source {
            node: instance.map(|i| i.node),
            copy: instance.map_or(0, |i| i.copy),
            mesh: self.document_mesh(part),
            primitive: part.geometry.primitive,
        }
    }
}

/// Collects a group; `None` for a kept mesh.
pub(super) fn gather(sources: &Sources, content: &Content) -> Option<Gathered> {
    let geometries = match content {
        Content::Kept(_) => return None,
        Content::Piece { geometries, .. } | Content::Baked { geometries, .. } => geometries,
    };
    let store = Store::new(sources.scene, content);
    let gathered: Vec<(NewPrimitive, Origins, f64)> =
        parallel::map_each(geometries, &|geometry| gather_geometry(sources, &store, geometry));
    let position_error = gathered.iter().map(|(.., error)| *error).fold(0.0, f64::max);
    let (primitives, origins) = gathered.into_iter().map(|(primitive, origins, _)| (primitive, origins)).unzip();
    Some(Gathered { primitives, origins, position_error })
}

fn gather_geometry(sources: &Sources, store: &Store, geometry: &GroupGeometry) -> (NewPrimitive, Origins, f64) {
    let mut triangles = Vec::new();
    let vertices = store.vertices(geometry, |number, part, triangle| {
        let kept = part.geometry.kept.as_ref();
        triangles.push([number, kept.map_or(triangle as u32, |kept| kept[triangle])]);
    });
    let first = &vertices.parts[0];
    let like = (sources.document_mesh(first) as usize, first.geometry.primitive as usize);
    let (attributes, position_error) = Attributes::new(sources, &vertices).all();
    let indices = indices(vertices.triangles.as_flattened(), vertices.list.len());
    let primitive = NewPrimitive { attributes, indices, material: geometry.material, like };
    let sources = vertices.parts.iter().map(|part| sources.source(part)).collect();
    (primitive, Origins::Each { sources, triangles }, position_error)
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

/// How positions, normals and tangents change.
struct Transform {
    linear: DMat3,
    /// Cofactors of the linear part: they transform normals, even if the inverse would overflow.
    normals: DMat3,
    mirrored: bool,
}

impl Transform {
    /// Returns the transform of a part; `None` if nothing changes.
    fn of(part: &Part) -> Option<Transform> {
        let m = part.group_from_mesh?.matrix3;
        let side = if part.mirrored { -1.0 } else { 1.0 };
        let normals = DMat3::from_cols(
            m.y_axis.cross(m.z_axis) * side,
            m.z_axis.cross(m.x_axis) * side,
            m.x_axis.cross(m.y_axis) * side,
        );
        Some(Transform { linear: m, normals, mirrored: part.mirrored })
    }
}

/// The vertex attributes of a new primitive.
struct Attributes<'a> {
    vertices: &'a Vertices<'a>,
    /// Transforms of directions, parallel to the parts.
    transforms: Vec<Option<Transform>>,
    /// Parallel to the parts: their attributes.
    by_part: Vec<&'a [Attribute<'a>]>,
}

impl<'a> Attributes<'a> {
    fn new(sources: &'a Sources, vertices: &'a Vertices<'a>) -> Self {
        Attributes {
            vertices,
            transforms: vertices.parts.iter().map(Transform::of).collect(),
            by_part: vertices
                .parts
                .iter()
                .map(|p| sources.attributes[p.mesh.0 as usize][p.number].as_slice())
                .collect(),
        }
    }

    /// Returns all attributes, and the position error.
    fn all(&self) -> (Vec<(String, NewAccessor)>, f64) {
        let mut position_error = 0.0;
        let gathered = self.by_part[0]
            .iter()
            .enumerate()
            .map(|(first, attribute)| {
                let same: Vec<&Attribute> =
                    self.by_part.iter().map(|list| find(list, first, &attribute.name)).collect();
                let accessor = match attribute.name.as_str() {
                    "POSITION" => self.positions(&same, &mut position_error),
                    "NORMAL" => self.directions(&same, |t, v| t.normals * v, false),
                    "TANGENT" => self.directions(&same, |t, v| t.linear * v, true),
                    _ => self.copied(&same),
                };
                (attribute.name.clone(), accessor)
            })
            .collect();
        (gathered, position_error)
    }

    /// Whether an attribute can be copied byte for byte: stored in the same format in all parts, none of which is
    /// transformed.
    fn can_copy(&self, same: &[&Attribute]) -> bool {
        self.transforms.iter().all(Option::is_none) && same.iter().all(|a| a.element == same[0].element)
    }

    fn copied(&self, same: &[&Attribute]) -> NewAccessor {
        let element = same[0].element;
        let mut data = Vec::with_capacity(self.vertices.list.len() * element.size());
        for &(part, vertex) in &self.vertices.list {
            data.extend_from_slice(same[part as usize].bytes(vertex));
        }
        let bounds = same[0].name == "POSITION";
        NewAccessor { data, element, target: Target::Vertices, bounds }
    }

    /// Returns positions in the group's frame, as given by the store.
    fn positions(&self, same: &[&Attribute], error: &mut f64) -> NewAccessor {
        let exact = self.vertices.list.iter().map(|&(part, vertex)| self.vertices.parts[part as usize].exact(vertex));
        *error = exact.map(rounding_error).fold(*error, f64::max);
        if self.can_copy(same) {
            return self.copied(same);
        }
        let mut data = Vec::with_capacity(self.vertices.list.len() * 12);
        for &(part, vertex) in &self.vertices.list {
            let part = &self.vertices.parts[part as usize];
            data.extend_from_slice(bytemuck::bytes_of(&part.stored(vertex)));
        }
        NewAccessor { data, element: FLOAT3, target: Target::Vertices, bounds: true }
    }

    /// Returns normals or tangents (whose fourth component is their handedness), transformed with their parts and
    /// normalised.
    fn directions(&self, same: &[&Attribute], turn: impl Fn(&Transform, DVec3) -> DVec3, sided: bool) -> NewAccessor {
        if self.can_copy(same) {
            return self.copied(same);
        }
        let mut data = Vec::with_capacity(self.vertices.list.len() * if sided { 16 } else { 12 });
        for &(part, vertex) in &self.vertices.list {
            let transform = self.transforms[part as usize].as_ref();
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

/// Finds an attribute by name, most likely at the same index as in the first part.
fn find<'a, 'b>(list: &'b [Attribute<'a>], likely: usize, name: &str) -> &'b Attribute<'a> {
    list.get(likely)
        .filter(|a| a.name == name)
        .or_else(|| list.iter().find(|a| a.name == name))
        .expect("primitives of one merge class have the same attributes")
}

/// Returns the unit vector of a direction of any length; `None` for zero and non-finite directions.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (largest > 0.0 && v.is_finite()).then(|| (v / largest).normalize())
}
