//! [`Planner`]: which attributes of two objects are compared, and how.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

use glam::DMat3;
use raykiln_formats::document::Attribute;
use raykiln_formats::properties::TextureUse;

use super::super::{Side, Sides};
use super::comparison::{Comparison, How, Influences, Turn, Values};
use super::materials::{Materials, materials};
use super::{DifferenceKind, Inputs, Tolerance};
use crate::parallel;
use crate::scene::{Instance, Object, Scene};

/// The attributes of a primitive and of its morph targets.
struct Attributes<'a> {
    own: Vec<Attribute<'a>>,
    targets: Vec<Vec<Attribute<'a>>>,
}

/// By mesh and geometry, the attributes of a scene's primitives.
pub(super) struct Primitives<'a>(Sides<Vec<Vec<Attributes<'a>>>>);

impl<'a> Primitives<'a> {
    pub(super) fn of(inputs: &Inputs<'a>) -> Primitives<'a> {
        let of_side = |side: Side| {
            let (doc, scene) = (inputs.documents[side], inputs.scenes[side]);
            let mesh = |mesh: &crate::scene::Mesh| {
                let source = mesh.source as usize;
                let of = |primitive: usize| Attributes {
                    own: doc.attributes(source, primitive),
                    targets: doc.morph_targets(source, primitive),
                };
                mesh.geometries.iter().map(|g| of(g.primitive as usize)).collect()
            };
            parallel::map(scene.meshes.len(), &|m| mesh(&scene.meshes[m]))
        };
        Primitives(Sides { before: of_side(Side::Before), after: of_side(Side::After) })
    }

    fn get(&self, side: Side, scene: &Scene, object: Object) -> &Attributes<'a> {
        let mesh = scene.instances[object.instance as usize].mesh.0;
        &self.0[side][mesh as usize][object.geometry as usize]
    }
}

/// What the joints of an instance with a skin are.
pub(super) type Joints = Option<Arc<[u32]>>;

/// Decides how the attributes of two objects are compared.
pub(super) struct Planner<'a> {
    pub(super) scenes: Sides<&'a Scene>,
    pub(super) primitives: &'a Primitives<'a>,
    pub(super) materials: &'a Materials<'a>,
    /// For each instance with a skin, what its joints are: the same numbers for the same joints of both files.
    pub(super) joints: &'a Sides<Vec<Joints>>,
    pub(super) tolerance: &'a Tolerance,
    /// The largest distance between displacements of morph targets.
    pub(super) displacement: f64,
}

/// Integers of directions may differ by this many steps if the transforms differ.
const STEPS: f64 = 4.0;

impl<'a> Planner<'a> {
    /// Returns the comparisons of two objects.
    pub(super) fn plan(&self, objects: Sides<Object>) -> Vec<Comparison<'a>> {
        let attributes = Sides {
            before: self.primitives.get(Side::Before, self.scenes.before, objects.before),
            after: self.primitives.get(Side::After, self.scenes.after, objects.after),
        };
        let instances = self.scenes.zip(objects).map(|(scene, object)| &scene.instances[object.instance as usize]);
        let textures = Textures::of(self.materials, materials(self.scenes, objects));
        let own = attributes.map(|attributes| attributes.own.as_slice());
        let mut plan: Vec<Comparison<'a>> = textures.comparisons(own, self.tolerance);
        for name in names(own) {
            let found = own.map(|list| find(list, name));
            plan.extend(self.attribute(name, found, &textures, instances));
        }
        plan.extend(self.weights(own, objects));
        for target in 0..attributes.before.targets.len().max(attributes.after.targets.len()) {
            let targets = attributes.map(|all| all.targets.get(target).map_or(&[][..], Vec::as_slice));
            plan.extend(names(targets).into_iter().map(|name| self.displaced(target, name, own, targets, instances)));
        }
        plan
    }

    /// Returns the comparison of an attribute that at least one primitive has.
    fn attribute(
        &self,
        name: &str,
        found: Sides<Option<&'a Attribute<'a>>>,
        textures: &Textures<'_>,
        instances: Sides<&Instance>,
    ) -> Option<Comparison<'a>> {
        use DifferenceKind as Kind;
        let comparison = |kind, allowed, how| Some(Comparison { kind, name: name.to_owned(), allowed, how });
        let missing = |kind| comparison(kind, 0.0, How::Missing);
        let kind = kind_of(name)?;
        let values = match found {
            Sides { before: Some(b), after: Some(a) } => Sides { before: Values::Of(b), after: Values::Of(a) },
            _ if kind == Kind::Color && name == "COLOR_0" => found.map(|f| f.map_or(Values::All([1.0; 4]), Values::Of)),
            _ if kind == Kind::TextureCoordinates && textures.samples(name) => return None,
            _ if !textures.needs(kind) || name.starts_with("COLOR") => return missing(Kind::UnusedAttribute),
            Sides { before: Some(_), .. } => return missing(Kind::AttributeMissing),
            _ => return missing(Kind::AttributeAdded),
        };
        let numbers = How::Numbers { values, is_relative: kind == Kind::TextureCoordinates };
        match kind {
            Kind::Normal | Kind::Tangent => {
                let is_tangent = kind == Kind::Tangent;
                let turns = instances.map(|instance| if is_tangent { tangents(instance) } else { normals(instance) });
                let allowed = self.angle(&values, &turns);
                comparison(kind, allowed, How::Directions { values, turns, is_tangent })
            }
            Kind::TextureCoordinates if textures.samples(name) => None,
            Kind::TextureCoordinates => comparison(kind, self.tolerance.texcoord, numbers),
            Kind::Color => comparison(kind, self.tolerance.color, numbers),
            _ => comparison(kind, 0.0, numbers),
        }
    }

    /// Returns the largest angle between directions: integers are coarse, and copies may be two steps off.
    fn angle(&self, values: &Sides<Values<'_>>, turns: &Sides<Turn>) -> f64 {
        let one = |values: Values<'_>| match values {
            Values::Of(attribute) => attribute.element.component.one().unwrap_or(f64::INFINITY),
            Values::All(_) => f64::INFINITY,
        };
        let coarse = STEPS / one(values.before).min(one(values.after));
        if turns.before == turns.after { self.tolerance.angle } else { self.tolerance.angle.max(coarse) }
    }

    /// Returns the comparison of joints and weights.
    fn weights(&self, own: Sides<&'a [Attribute<'a>]>, objects: Sides<Object>) -> Option<Comparison<'a>> {
        let influences = |side: Side| {
            let joints = self.joints[side].get(objects[side].instance as usize).and_then(Option::as_deref);
            let sets = (0..).map_while(|set| {
                Some((find(own[side], &format!("JOINTS_{set}"))?, find(own[side], &format!("WEIGHTS_{set}"))?))
            });
            Influences { sets: sets.collect(), joints: Cow::Borrowed(joints.unwrap_or_default()) }
        };
        let both = Sides { before: influences(Side::Before), after: influences(Side::After) };
        let (is_any, is_missing) = (
            !both.before.sets.is_empty() || !both.after.sets.is_empty(),
            both.before.sets.is_empty() || both.after.sets.is_empty(),
        );
        // Without a skin nothing moves.
        let is_skinned = !both.before.joints.is_empty() || !both.after.joints.is_empty();
        let (kind, how) = match (is_missing, is_skinned) {
            (true, true) => (DifferenceKind::AttributeMissing, How::Missing),
            (true, false) => (DifferenceKind::UnusedAttribute, How::Missing),
            _ => (DifferenceKind::SkinWeights, How::Weights(Box::new(both))),
        };
        is_any.then(|| Comparison { kind, name: "WEIGHTS".into(), allowed: self.tolerance.weight, how })
    }

    /// Returns the comparison of an attribute of a morph target; without it nothing is displaced.
    fn displaced(
        &self,
        target: usize,
        name: &str,
        own: Sides<&'a [Attribute<'a>]>,
        targets: Sides<&'a [Attribute<'a>]>,
        instances: Sides<&Instance>,
    ) -> Comparison<'a> {
        let of =
            |list: Sides<&'a [Attribute<'a>]>| list.map(|l| find(l, name).map_or(Values::All([0.0; 4]), Values::Of));
        let (values, base) = (of(targets), of(own));
        let tolerance = self.tolerance;
        let (allowed, how) = match kind_of(name) {
            Some(DifferenceKind::Normal) => {
                let turns = instances.map(normals);
                (self.angle(&values, &turns), How::Displaced { base, values, turns })
            }
            Some(DifferenceKind::Tangent) => {
                let turns = instances.map(tangents);
                (self.angle(&values, &turns), How::Displaced { base, values, turns })
            }
            None if name == "POSITION" => {
                (self.displacement, How::Displacements { values, turns: instances.map(tangents) })
            }
            Some(DifferenceKind::TextureCoordinates) => {
                (tolerance.texcoord, How::Numbers { values, is_relative: true })
            }
            Some(DifferenceKind::Color) => (tolerance.color, How::Numbers { values, is_relative: false }),
            _ => (0.0, How::Numbers { values, is_relative: false }),
        };
        Comparison { kind: DifferenceKind::MorphTarget, name: format!("targets[{target}].{name}"), allowed, how }
    }
}

/// Returns the kind of difference of an attribute; `None` for those that are not compared alone.
fn kind_of(name: &str) -> Option<DifferenceKind> {
    let is = |prefix: &str| name.starts_with(prefix);
    Some(match name {
        "POSITION" => return None,
        "NORMAL" => DifferenceKind::Normal,
        "TANGENT" => DifferenceKind::Tangent,
        _ if is("JOINTS_") || is("WEIGHTS_") => return None,
        _ if is("TEXCOORD_") => DifferenceKind::TextureCoordinates,
        _ if is("COLOR_") => DifferenceKind::Color,
        _ => DifferenceKind::CustomAttribute,
    })
}

/// How the materials of two objects place textures.
struct Textures<'a> {
    /// By place, the uses of both.
    uses: Vec<Sides<&'a TextureUse>>,
    /// Sets that the material of either samples.
    sampled: BTreeSet<usize>,
    has_normals: bool,
}

impl<'a> Textures<'a> {
    fn of(all: &'a Materials<'_>, materials: Sides<Option<usize>>) -> Textures<'a> {
        let before = &all.get(Side::Before, materials.before).textures;
        let after = &all.get(Side::After, materials.after).textures;
        let other = |b: &TextureUse| after.iter().find(|a| a.place == b.place);
        let uses = before.iter().filter_map(|b| Some(Sides { before: b, after: other(b)? })).collect();
        Textures {
            uses,
            sampled: before.iter().map(|u| u.texcoord).collect(),
            has_normals: before.iter().any(|u| u.place.to_ascii_lowercase().ends_with("normaltexture")),
        }
    }

    /// Whether the material samples by an attribute.
    fn samples(&self, name: &str) -> bool {
        name.strip_prefix("TEXCOORD_").and_then(|set| set.parse().ok()).is_some_and(|set| self.sampled.contains(&set))
    }

    /// Whether the material needs an attribute of a kind, other than texture coordinates that it samples.
    fn needs(&self, kind: DifferenceKind) -> bool {
        match kind {
            DifferenceKind::TextureCoordinates => false,
            DifferenceKind::Tangent => self.has_normals,
            _ => true,
        }
    }

    /// Returns the comparisons of texture coordinates as the materials transform them; textures that are placed alike
    /// are compared once.
    fn comparisons<'d>(&self, own: Sides<&'d [Attribute<'d>]>, tolerance: &Tolerance) -> Vec<Comparison<'d>> {
        let mut known: Vec<Sides<&TextureUse>> = Vec::new();
        let is_like = |a: &TextureUse, b: &TextureUse| a.texcoord == b.texcoord && a.transform == b.transform;
        for both in &self.uses {
            if !known.iter().any(|k| is_like(k.before, both.before) && is_like(k.after, both.after)) {
                known.push(*both);
            }
        }
        let of_use = |both: Sides<&TextureUse>| {
            let name = format!("TEXCOORD_{}", both.before.texcoord);
            let found = both.zip(own).map(|(u, list)| find(list, &format!("TEXCOORD_{}", u.texcoord)));
            let is_placed_alike = is_like(both.before, both.after);
            let (kind, how) = match found {
                Sides { before: Some(b), after: Some(a) } => {
                    let values = Sides { before: Values::Of(b), after: Values::Of(a) };
                    let kind = [DifferenceKind::TextureTransform, DifferenceKind::TextureCoordinates]
                        [usize::from(is_placed_alike)];
                    (kind, How::Texcoords { values, transforms: both.map(|u| u.transform) })
                }
                // The texture shows one texel in both.
                Sides { before: None, after: None } => return None,
                Sides { before: Some(_), .. } => (DifferenceKind::AttributeMissing, How::Missing),
                _ => (DifferenceKind::AttributeAdded, How::Missing),
            };
            Some(Comparison { kind, name, allowed: tolerance.texcoord, how })
        };
        known.into_iter().filter_map(of_use).collect()
    }
}

fn find<'a>(list: &'a [Attribute<'a>], name: &str) -> Option<&'a Attribute<'a>> {
    list.iter().find(|attribute| attribute.name == name)
}

/// Returns the names of the attributes of both, sorted.
fn names<'a>(lists: Sides<&'a [Attribute<'_>]>) -> BTreeSet<&'a str> {
    lists.before.iter().chain(lists.after).map(|attribute| attribute.name.as_str()).collect()
}

fn tangents(instance: &Instance) -> Turn {
    Turn { matrix: instance.transform.matrix3, side: if instance.mirrored() { -1.0 } else { 1.0 } }
}

/// Returns the cofactors of an instance's matrix: they turn normals, even if there is no inverse.
fn normals(instance: &Instance) -> Turn {
    let m = instance.transform.matrix3;
    let side = if instance.mirrored() { -1.0 } else { 1.0 };
    let cofactors = [m.y_axis.cross(m.z_axis) * side, m.z_axis.cross(m.x_axis) * side, m.x_axis.cross(m.y_axis) * side];
    Turn { matrix: DMat3::from_cols(cofactors[0], cofactors[1], cofactors[2]), side }
}
