//! Compares what primitives say and which materials their variants show.

use std::collections::BTreeSet;

use raykiln_formats::properties::{MeshContent, Property};
use rustc_hash::FxHashMap;

use super::super::{Side, Sides};
use super::findings::Findings;
use super::materials::materials;
use super::meetings::{Meeting, object_name};
use super::property::{Changed, Correspondence};
use super::{DifferenceKind as Kind, Inputs};
use crate::scene::Object;

const VARIANTS: &str = "KHR_materials_variants";

/// Compares the primitives that meet.
pub(super) fn compare(inputs: &Inputs<'_>, meetings: &[Meeting], same: &dyn Correspondence, found: &mut Findings) {
    let mut known = Sides { before: FxHashMap::default(), after: FxHashMap::default() };
    for meeting in meetings {
        for side in Side::BOTH {
            let key = primitive(inputs, side, meeting.objects[side]);
            let read = || inputs.documents[side].primitive_content(key[0], key[1]);
            known[side].entry(key).or_insert_with(read);
        }
        let content = |side: Side| &known[side][&primitive(inputs, side, meeting.objects[side])];
        let contents = [content(Side::Before), content(Side::After)];
        let name = object_name(inputs.scenes.before, meeting.objects.before);
        let extras = contents.map(|content| content.extras.as_ref());
        found.properties(Kind::PrimitiveExtras, Some(&name), "primitive.extras", extras, same);
        for key in contents.iter().flat_map(|content| content.extensions.keys()).collect::<BTreeSet<_>>() {
            let values = contents.map(|content| content.extensions.get(key));
            if key == VARIANTS {
                variants(&name, contents, materials(inputs.scenes, meeting.objects), same, found);
            } else {
                let path = format!("primitive.extensions.{key}");
                found.properties(Kind::PrimitiveExtension, Some(&name), &path, values, same);
            }
        }
    }
}

/// Returns the mesh of the file and the primitive in it of an object.
fn primitive(inputs: &Inputs<'_>, side: Side, object: Object) -> [usize; 2] {
    let scene = inputs.scenes[side];
    let mesh = &scene.meshes[scene.instances[object.instance as usize].mesh.0 as usize];
    [mesh.source as usize, mesh.geometries[object.geometry as usize].primitive as usize]
}

/// Compares the material that each variant shows: that of the primitive where a variant does not name another.
fn variants(
    object: &str,
    contents: [&MeshContent; 2],
    own: Sides<Option<usize>>,
    same: &dyn Correspondence,
    found: &mut Findings,
) {
    let shown = contents.map(|content| content.extensions.get(VARIANTS));
    let names = |variants: &Property| match variants {
        Property::Object(map) => map.keys().cloned().collect(),
        _ => Vec::new(),
    };
    let all: BTreeSet<String> = shown.iter().flatten().flat_map(|variants| names(variants)).collect();
    let material = |at: usize, own: Option<usize>, name: &str| match shown[at].and_then(|variants| variants.get(name)) {
        Some(Property::Material(material)) => *material,
        _ => own,
    };
    for name in all {
        let (before, after) = (material(0, own.before, &name), material(1, own.after, &name));
        if !same.materials(before, after) {
            let [before, after] = [before, after].map(|material| Some(Property::Material(material).short()));
            found.property(Kind::Variant, Some(object), Changed { path: format!("variant {name}"), before, after });
        }
    }
}
