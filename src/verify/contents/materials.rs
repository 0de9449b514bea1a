//! Compares materials by content.

use std::collections::BTreeMap;

use raykiln_formats::Document;
use raykiln_formats::properties::{MaterialContent, Property};
use rustc_hash::FxHashMap;

use super::super::{Side, Sides};
use super::images::{Images, Sameness};
use super::meetings::{Meeting, object_name};
use super::property::{Changed, Correspondence, changes};
use super::{ContentsReport, Detail, Difference, DifferenceKind, Inputs};
use crate::parallel;
use crate::scene::{Object, Scene};

/// Differences of two materials that are reported, at most.
const MOST: usize = 8;

/// The materials of two files.
pub(super) struct Materials<'a> {
    images: &'a Images,
    /// The default material comes last.
    contents: Sides<Vec<MaterialContent>>,
}

/// A material of the input in the place of one of the output.
struct Met {
    first: Meeting,
    triangles: u64,
}

impl<'a> Materials<'a> {
    pub(super) fn of(documents: Sides<&Document>, images: &'a Images) -> Materials<'a> {
        Materials { images, contents: documents.map(contents) }
    }

    /// Returns a material; `None` is the default material.
    pub(super) fn get(&self, side: Side, material: Option<usize>) -> &MaterialContent {
        let all = &self.contents[side];
        &all[material.unwrap_or(all.len() - 1).min(all.len() - 1)]
    }

    /// Compares the materials that meet.
    pub(super) fn compare(&self, inputs: &Inputs<'_>, meetings: &[Meeting], report: &mut ContentsReport) {
        for ((before, after), met) in met(inputs.scenes, meetings) {
            let contents = Sides { before: self.get(Side::Before, before), after: self.get(Side::After, after) };
            report.compared.materials += 1;
            report.compared.textures += contents.before.textures.len() as u64;
            let object = object_name(inputs.scenes.before, met.first.objects.before);
            for (kind, changed) in self.differences(contents) {
                let detail = property_detail(contents.before.name.clone(), changed);
                report.differences.push(Difference::new(kind, met.triangles, Some(object.clone()), Some(detail)));
            }
        }
    }

    /// Returns how two materials differ: name, extras, and the first few properties.
    fn differences(&self, contents: Sides<&MaterialContent>) -> Vec<(DifferenceKind, Changed)> {
        let Sides { before, after } = contents;
        let of_properties = changes(&before.properties, &after.properties, self);
        let mut all: Vec<_> =
            of_properties.into_iter().take(MOST).map(|changed| (kind_of(&changed), changed)).collect();
        let extras = [before, after].map(|content| content.extras.clone().unwrap_or(Property::Object(BTreeMap::new())));
        let of_extras = changes(&extras[0], &extras[1], self).into_iter().take(1);
        all.extend(
            of_extras.map(|c| (DifferenceKind::MaterialExtras, Changed { path: below("extras", &c.path), ..c })),
        );
        if before.name != after.name {
            let quoted = |name: &Option<String>| name.as_ref().map(|name| format!("{name:?}"));
            let changed = Changed { path: "name".into(), before: quoted(&before.name), after: quoted(&after.name) };
            all.push((DifferenceKind::MaterialName, changed));
        }
        all.extend(self.unreadable(&before.properties, &after.properties));
        all
    }

    /// Returns the first image that neither file lets read.
    fn unreadable(&self, before: &Property, after: &Property) -> Option<(DifferenceKind, Changed)> {
        match (before, after) {
            (Property::Object(b), Property::Object(a)) => b.iter().find_map(|(k, b)| self.unreadable(b, a.get(k)?)),
            (Property::Image(b), Property::Image(a)) if self.images.compare(*b, *a) == Sameness::SameName => {
                let [before, after] = [before, after].map(|image| Some(image.short()));
                Some((DifferenceKind::ImageUnreadable, Changed { path: "image".into(), before, after }))
            }
            _ => None,
        }
    }

    /// Whether two materials show the same, whatever their names and extras.
    pub(super) fn are_same(&self, before: Option<usize>, after: Option<usize>) -> bool {
        let (before, after) = (self.get(Side::Before, before), self.get(Side::After, after));
        changes(&before.properties, &after.properties, self).is_empty()
    }
}

impl Correspondence for Materials<'_> {
    fn images(&self, before: usize, after: usize) -> bool {
        self.images.compare(before, after) != Sameness::Different
    }

    fn materials(&self, before: Option<usize>, after: Option<usize>) -> bool {
        self.are_same(before, after)
    }
}

/// Returns all materials of a file, the default one last.
fn contents(doc: &Document) -> Vec<MaterialContent> {
    let mut all: Vec<MaterialContent> =
        parallel::map(doc.material_count(), &|material| doc.material_content(Some(material)));
    all.push(doc.material_content(None));
    all
}

/// A material of each file.
type Both = (Option<usize>, Option<usize>);

/// Returns the materials that meet, in the order of the output's triangles.
fn met(scenes: Sides<&Scene>, meetings: &[Meeting]) -> Vec<(Both, Met)> {
    let mut places: FxHashMap<Both, usize> = FxHashMap::default();
    let mut found: Vec<(Both, Met)> = Vec::new();
    for meeting in meetings {
        let Sides { before, after } = materials(scenes, meeting.objects);
        let place = *places.entry((before, after)).or_insert_with(|| {
            found.push(((before, after), Met { first: *meeting, triangles: 0 }));
            found.len() - 1
        });
        found[place].1.triangles += meeting.triangles;
    }
    found
}

/// Returns the materials of two objects.
pub(super) fn materials(scenes: Sides<&Scene>, objects: Sides<Object>) -> Sides<Option<usize>> {
    scenes.zip(objects).map(|(scene, object)| object.geometry(scene).material.map(|m| m as usize))
}

fn below(path: &str, rest: &str) -> String {
    if rest.is_empty() { path.to_owned() } else { format!("{path}.{rest}") }
}

pub(super) fn property_detail(of: Option<String>, changed: Changed) -> Detail {
    Detail::Property { of, property: changed.path, before: changed.before, after: changed.after }
}

/// Returns the kind of a difference by the path of the property.
fn kind_of(changed: &Changed) -> DifferenceKind {
    let path = &changed.path;
    let last = path.rsplit('.').next().unwrap_or_default();
    let is_sampler = last.starts_with("wrap") || last.ends_with("Filter");
    match path.split_once(".texture") {
        _ if last.ends_with("Texture") => DifferenceKind::TextureMissing,
        Some(_) if is_sampler => DifferenceKind::TextureSampler,
        Some(_) => DifferenceKind::TextureImage,
        None if path.starts_with("alpha") => DifferenceKind::AlphaMode,
        None if path == "doubleSided" => DifferenceKind::DoubleSided,
        None if path.starts_with("extensions") => DifferenceKind::MaterialExtension,
        None => DifferenceKind::MaterialFactor,
    }
}
