//! `KHR_draco_mesh_compression`: compressed primitives, decoded by the crate `draco-core`.
//!
//! The accessors of a primitive get the values that its stream has under the unique ids in the extension, in the component
//! type that the accessor states. Where the file states another number of elements than the stream has, the stream is
//! right, with a warning.

mod place;
mod streams;
mod values;

use std::collections::HashMap;

use draco_core::Mesh;
use rayon::prelude::*;

use self::place::{Filled, Place, place};
use super::budget::Budget;
use crate::document::{Component, Element};
use crate::edit::{NewAccessor, Target};
use crate::extension_names::KHR_DRACO_MESH_COMPRESSION;
use crate::gltf::edit::each_primitive;
use crate::gltf::json::{At, unsigned};
use crate::gltf::{accessor, extensions};
use crate::{Document, Error, Warning};

const POINTS: usize = 0;
const TRIANGLES: usize = 4;
const TRIANGLE_STRIP: usize = 5;

/// A compressed primitive.
struct Primitive<'d> {
    mesh: usize,
    primitive: usize,
    /// Its extension object.
    at: At<'d>,
    /// The buffer view of its stream.
    view: usize,
    mode: usize,
    attributes: Vec<Attribute<'d>>,
    indices: Option<usize>,
}

/// An attribute of a compressed primitive.
struct Attribute<'d> {
    name: &'d str,
    /// Its place in the extension object.
    at: At<'d>,
    accessor: usize,
    /// The unique id of the attribute in the stream.
    id: u32,
}

/// Where values come from: the buffer view of a stream, and the unique id of an attribute or `None` for the indices.
type Source = (usize, Option<u32>);

/// Decodes all compressed primitives whose uncompressed accessors are not there.
pub(super) fn decompress(doc: &mut Document, budget: &mut Budget) -> Result<(), Error> {
    let (primitives, unused) = primitives(doc)?;
    let meshes = streams::decode(doc, &primitives, budget)?;
    let views: Vec<usize> = meshes.keys().copied().collect();
    let strips = primitives.iter().filter(|p| p.mode == TRIANGLE_STRIP).map(|p| [p.mesh, p.primitive]);
    let strips: Vec<[usize; 2]> = strips.collect();
    let (filled, warnings) = fill(doc, &primitives, &meshes, budget)?;
    drop((primitives, meshes));
    each_primitive(&mut doc.json, |primitive| {
        extensions::remove(primitive, KHR_DRACO_MESH_COMPRESSION);
    });
    extensions::forget(&mut doc.json, KHR_DRACO_MESH_COMPRESSION);
    place(doc, filled, views);
    // Their streams hold the triangles one by one.
    for [mesh, primitive] in strips {
        doc.json["meshes"][mesh]["primitives"][primitive]["mode"] = TRIANGLES.into();
    }
    doc.warnings.extend(warnings);
    if unused > 0 {
        let message = format!(
            "{KHR_DRACO_MESH_COMPRESSION} of {unused} primitives is left out; their uncompressed accessors are used"
        );
        doc.warnings.push(Warning { place: "meshes".into(), message });
    }
    Ok(())
}

/// Returns the primitives to decode, and the number of those whose uncompressed accessors are used instead.
fn primitives(doc: &Document) -> Result<(Vec<Primitive<'_>>, usize), Error> {
    let root = At::root(doc);
    let is_required = root.list("extensionsRequired")?.any(|at| at.value == KHR_DRACO_MESH_COMPRESSION);
    let (mut found, mut unused) = (Vec::new(), 0);
    for (mesh, mesh_at) in root.list("meshes")?.enumerate() {
        for (primitive, owner) in mesh_at.list("primitives")?.enumerate() {
            let Some(at) = owner.extension(KHR_DRACO_MESH_COMPRESSION) else { continue };
            if !is_required && has_fallback(&root, &owner) {
                unused += 1;
            } else {
                found.push(Primitive::read(&root, [mesh, primitive], owner, at)?);
            }
        }
    }
    Ok((found, unused))
}

/// Whether all accessors of a primitive have data of their own.
fn has_fallback(root: &At<'_>, primitive: &At<'_>) -> bool {
    let attributes = primitive.get("attributes").and_then(|at| at.value.as_object());
    let attributes = attributes.into_iter().flat_map(|map| map.values());
    attributes.chain(primitive.value.get("indices")).all(|index| {
        let accessor = unsigned(index).and_then(|i| root.get("accessors")?.element(i));
        accessor.is_none_or(|at| at.get("bufferView").is_some() || at.get("sparse").is_some())
    })
}

impl<'d> Primitive<'d> {
    fn read(root: &At<'d>, [mesh, primitive]: [usize; 2], owner: At<'d>, at: At<'d>) -> Result<Self, Error> {
        let accessors = root.count("accessors");
        let view = at.need("bufferView")?.index_into("bufferViews", root.count("bufferViews"))?;
        let mode = owner.get("mode").map_or(Ok(TRIANGLES), |mode| mode.integer())?;
        if ![POINTS, TRIANGLES, TRIANGLE_STRIP].contains(&mode) {
            return Err(at.error(format_args!("primitives of mode {mode} cannot be compressed")));
        }
        let of_primitive = owner.need("attributes")?;
        let mut attributes = Vec::new();
        for (name, at) in at.need("attributes")?.entries()? {
            let id = u32::try_from(at.integer()?).map_err(|_| at.error("is not the id of an attribute"))?;
            let accessor = of_primitive.need(name)?.index_into("accessors", accessors)?;
            attributes.push(Attribute { name, at, accessor, id });
        }
        let indices = owner.index("indices", "accessors", accessors)?;
        Ok(Primitive { mesh, primitive, at, view, mode, attributes, indices })
    }
}

/// What an accessor is filled with.
struct Job<'d> {
    place: Place,
    mesh: &'d Mesh,
    /// Where the primitive names the values.
    at: At<'d>,
    values: Values,
}

/// Values of a stream.
enum Values {
    /// Those of an attribute, by its unique id, as elements of an accessor, and whether this has bounds.
    Attribute { id: u32, element: Element, bounds: bool },
    /// The corners of all triangles, in this component type or a larger one.
    Indices(Component),
}

/// The jobs of a document, while they are collected.
struct Plan<'d, 'b> {
    doc: &'d Document,
    budget: &'b mut Budget,
    /// Where the values of the accessors come from that have a job.
    sources: HashMap<usize, Source>,
    jobs: Vec<Job<'d>>,
    warnings: Vec<Warning>,
}

/// Returns the new contents of the accessors of all primitives.
fn fill(
    doc: &Document,
    primitives: &[Primitive<'_>],
    meshes: &HashMap<usize, Mesh>,
    budget: &mut Budget,
) -> Result<(Vec<Filled>, Vec<Warning>), Error> {
    let mut plan = Plan { doc, budget, sources: HashMap::new(), jobs: Vec::new(), warnings: Vec::new() };
    for primitive in primitives {
        let mesh = &meshes[&primitive.view];
        for attribute in &primitive.attributes {
            plan.attribute(primitive, attribute, mesh)?;
        }
        if primitive.mode != POINTS {
            plan.indices(primitive, mesh)?;
        }
    }
    let Plan { jobs, warnings, .. } = plan;
    let filled: Vec<Result<Filled, Error>> = jobs.into_par_iter().map(Job::fill).collect();
    Ok((filled.into_iter().collect::<Result<_, _>>()?, warnings))
}

impl<'d> Plan<'d, '_> {
    fn attribute(&mut self, primitive: &Primitive<'d>, attribute: &Attribute<'d>, mesh: &'d Mesh) -> Result<(), Error> {
        let source = (primitive.view, Some(attribute.id));
        if self.sources.get(&attribute.accessor) == Some(&source) {
            return Ok(());
        }
        let (at, element) = self.accessor(attribute.accessor, &attribute.at)?;
        self.check_count(&at, mesh.num_points())?;
        let bounds = attribute.name == "POSITION" || at.get("min").is_some() || at.get("max").is_some();
        let place = self.place(primitive, Some(attribute.name), Some(attribute.accessor), source);
        let values = Values::Attribute { id: attribute.id, element, bounds };
        self.add(Job { place, mesh, at: attribute.at, values }, mesh.num_points() * element.size())
    }

    fn indices(&mut self, primitive: &Primitive<'d>, mesh: &'d Mesh) -> Result<(), Error> {
        let source = (primitive.view, None);
        if primitive.indices.is_some_and(|accessor| self.sources.get(&accessor) == Some(&source)) {
            return Ok(());
        }
        if mesh.num_faces() == 0 {
            return Err(primitive.at.error("the stream holds no triangles"));
        }
        let corners = 3 * mesh.num_faces();
        let mut component = Component::U8;
        if let Some(accessor) = primitive.indices {
            let (at, element) = self.accessor(accessor, &primitive.at)?;
            component = element.component;
            // The stream holds the triangles of a strip one by one.
            if primitive.mode == TRIANGLES {
                self.check_count(&at, corners)?;
            }
        }
        let place = self.place(primitive, None, primitive.indices, source);
        self.add(Job { place, mesh, at: primitive.at, values: Values::Indices(component) }, 4 * corners)
    }

    /// Adds a job, and takes its bytes from the budget.
    fn add(&mut self, job: Job<'d>, bytes: usize) -> Result<(), Error> {
        self.budget.take(bytes as u64).map_err(|cause| job.at.error(cause))?;
        self.jobs.push(job);
        Ok(())
    }

    /// Returns an accessor and the type of its elements.
    fn accessor(&self, accessor: usize, owner: &At<'_>) -> Result<(At<'d>, Element), Error> {
        let list = At::root(self.doc).need("accessors")?;
        let at = list.element(accessor).ok_or_else(|| owner.error("is missing"))?;
        let kind = at.need("type")?.string()?;
        if kind.starts_with("MAT") {
            return Err(at.error("matrices are not supported as vertex attributes").unsupported());
        }
        Ok((at, accessor::element(&at, kind)?))
    }

    fn check_count(&mut self, at: &At<'_>, count: usize) -> Result<(), Error> {
        let stated = at.need("count")?.integer()?;
        if stated != count {
            let message = format_args!("count is {stated}, but the Draco stream has {count} elements, which are used");
            self.warnings.push(at.warning(message));
        }
        Ok(())
    }

    /// Decides where values go: into the accessor of the primitive, or one of its own if that has none, or holds the
    /// values of another stream.
    fn place(
        &mut self,
        primitive: &Primitive<'_>,
        attribute: Option<&str>,
        accessor: Option<usize>,
        source: Source,
    ) -> Place {
        if let Some(accessor) = accessor
            && !self.sources.contains_key(&accessor)
        {
            self.sources.insert(accessor, source);
            return Place::Accessor(accessor);
        }
        let attribute = attribute.map(str::to_owned);
        Place::Own { mesh: primitive.mesh, primitive: primitive.primitive, attribute, like: accessor }
    }
}

impl Job<'_> {
    /// Gets the values of the stream.
    fn fill(self) -> Result<Filled, Error> {
        let accessor = match self.values {
            Values::Attribute { id, element, bounds } => values::of_attribute(self.mesh, id, element)
                .map(|data| NewAccessor { data, element, target: Target::Vertices, bounds }),
            Values::Indices(least) => values::of_indices(self.mesh, least).map(|(data, component)| {
                let element = Element { component, components: 1, normalized: false };
                NewAccessor { data, element, target: Target::Indices, bounds: false }
            }),
        };
        let accessor = accessor.map_err(|cause| self.at.error(cause))?;
        Ok(Filled { place: self.place, accessor })
    }
}
