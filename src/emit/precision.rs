//! Chooses frames that keep the rounding of baked positions within a limit.

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use crate::layout::seams::{self, Class};
use crate::layout::store::{Store, rounding_error};
use crate::layout::{Content, Group, GroupGeometry, Layout, is_single_precision};
use crate::parallel::{self, CHEAP_ELEMENTS};
use crate::scene::{Bounds, InstanceId, Scene, TriangleRef, most_stretch};

/// The result of [`settle`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settled {
    /// Number of groups whose positions are now stored relative to their centre.
    pub centred: usize,
    /// The largest distance between a corner and its stored position, in world units.
    pub error: f64,
    /// Instances whose triangles cannot be written out within the limit.
    pub refused: Vec<InstanceId>,
    /// Instances whose triangles share corners with an instance that stays, under a transform that only staying keeps.
    pub bound: Vec<InstanceId>,
}

/// What must stay unchanged if rounding moves a corner too far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refuse {
    /// The instance of that corner.
    Instances,
    /// All instances of its group.
    Groups,
}

/// Rounding must not move a corner farther than this share of the diagonal of its own instance: in a large scene, the
/// limit for the scene exceeds the size of small objects.
const OF_OWN_SIZE: f64 = 1e-4;

/// Stores baked groups relative to their centre if rounding world positions to single precision would move a vertex
/// farther than `max_error_ratio` of the scene's diagonal, or of the group's own, or than a ten-thousandth of its
/// instance's own: a small object far from the origin keeps its shape. Groups that share corners ([`seams`]) get one
/// frame, with one origin. Names the instances, also those opened into pieces that are stored in frames, that would
/// still exceed the ratio of the scene's diagonal, or a ten-thousandth of their own, and those whose neighbours stay.
/// What the scene as stored is off is allowed beyond each of these limits.
pub fn settle(scene: &Scene, layout: &mut Layout, max_error_ratio: f64, refuse: Refuse) -> Settled {
    let limit = max_error_ratio * scene.bounds().diagonal();
    let limit_of = |(i, own): (u32, &Bounds)| {
        let unavoidable = scene.unavoidable_error(InstanceId(i));
        Limit { allowed: limit.min(own_limit(own)) + unavoidable, unavoidable }
    };
    let limits: Vec<Limit> = (0..).zip(scene.instance_boxes()).map(limit_of).collect();
    let settling = Settling { scene, limits, max_error_ratio, refuse };
    let mut settled = settling.baked_groups(layout);
    let errors = errors_of_shared(scene, layout);
    for placement in &layout.placements {
        let error = errors[placement.group as usize] * most_stretch(&placement.transform);
        settled.error = settled.error.max(error);
        // What is kept is off as the input is.
        let is_kept = layout.groups[placement.group as usize].content.is_kept();
        let is_over = |i: &InstanceId| !is_kept && error > settling.limits[i.0 as usize].allowed;
        settled.refused.extend(placement.instance.filter(is_over));
    }
    for list in [&mut settled.refused, &mut settled.bound] {
        list.sort_unstable();
        list.dedup();
    }
    for placement in &mut layout.placements {
        if let Content::Baked { frame, .. } = &layout.groups[placement.group as usize].content {
            placement.transform = *frame;
        }
    }
    settled
}

/// What [`settle`] works with.
struct Settling<'a> {
    scene: &'a Scene,
    /// Of each instance.
    limits: Vec<Limit>,
    max_error_ratio: f64,
    refuse: Refuse,
}

impl Settling<'_> {
    fn baked_groups(&self, layout: &mut Layout) -> Settled {
        let of_group = |group: &Group| rounded(self.scene, &group.content, &self.limits);
        let mut all: Vec<Rounded> = layout.groups.iter().map(of_group).collect();
        let is_far: Vec<bool> = layout.groups.iter().zip(&all).map(|(g, r)| self.is_too_far(&g.content, r)).collect();
        let mut settled = Settled::default();
        let is_moved = |(group, far): (&Group, &bool)| *far || group.content.baked_frame() != DAffine3::IDENTITY;
        if layout.groups.iter().zip(&is_far).any(is_moved) || seams::parts_from_what_stays(self.scene, layout) {
            for class in seams::classes(self.scene, layout) {
                self.settle_class(layout, &class, &is_far, &mut all, &mut settled);
            }
        }
        for (group, rounded) in layout.groups.iter().zip(all) {
            settled.error = settled.error.max(rounded.error);
            match (&group.content, self.refuse) {
                (Content::Baked { geometries, .. }, Refuse::Groups) if !rounded.refused.is_empty() => {
                    let triangles = geometries.iter().flat_map(|g| &g.triangles);
                    settled.refused.extend(triangles.map(|t| InstanceId(t.instance)));
                }
                _ => settled.refused.extend(rounded.refused),
            }
        }
        settled
    }

    /// Whether rounding moves a vertex of a baked group too far that is stored about the origin of the world.
    fn is_too_far(&self, content: &Content, rounded: &Rounded) -> bool {
        let Content::Baked { geometries, .. } = content else { return false };
        let share = || self.max_error_ratio * bounds(self.scene, geometries).diagonal() + rounded.unavoidable;
        rounded.error > 0.0 && (!rounded.refused.is_empty() || rounded.error > share())
    }

    /// Gives the groups of a class one frame; `all` is what rounding does to each group of the layout.
    fn settle_class(
        &self,
        layout: &mut Layout,
        class: &Class,
        is_far: &[bool],
        all: &mut [Rounded],
        settled: &mut Settled,
    ) {
        let groups = || class.groups.iter().map(|&g| g as usize);
        let fixed = frame_of_what_stays(class);
        let parted = class.left.iter().filter(|left| Some(**left) != fixed);
        settled.bound.extend(parted.flat_map(|left| bound_to(self.scene, layout, class, left)));
        let common = fixed.unwrap_or_else(|| {
            let matrix3 = common_rotation(self.scene, layout, class);
            let is_moved = matrix3 != DMat3::IDENTITY || groups().any(|g| is_far[g]);
            let of_group = |g: usize| bounds(self.scene, layout.groups[g].content.baked_geometries());
            let around = || groups().map(of_group).fold(Bounds::EMPTY, |all, b| all.union(&b));
            DAffine3 { matrix3, translation: if is_moved { around().stored_center() } else { DVec3::ZERO } }
        });
        for g in groups() {
            let content = &mut layout.groups[g].content;
            let Content::Baked { frame, .. } = content else { continue };
            settled.centred += usize::from(is_far[g] && fixed.is_none());
            if *frame != common {
                *frame = common;
                all[g] = rounded(self.scene, content, &self.limits);
            }
        }
    }
}

/// The frame that a class shares with the instances beside it that stay, if any do and one frame will do: the
/// coordinates of the world, or those of the mesh where all stay under one transform that single precision holds.
fn frame_of_what_stays(class: &Class) -> Option<DAffine3> {
    if class.left.contains(&DAffine3::IDENTITY) {
        return Some(DAffine3::IDENTITY);
    }
    match class.left[..] {
        [only] if is_single_precision(&only) && only.matrix3.determinant() != 0.0 => Some(only),
        _ => None,
    }
}

/// The baked instances of a class that the input places by a transform.
fn bound_to(scene: &Scene, layout: &Layout, class: &Class, left: &DAffine3) -> Vec<InstanceId> {
    let geometries = class.groups.iter().flat_map(|&g| layout.groups[g as usize].content.baked_geometries());
    let mut instances: Vec<u32> = geometries.flat_map(|g| &g.triangles).map(|at| at.instance).collect();
    instances.dedup();
    instances.retain(|&i| scene.instances[i as usize].transform == *left);
    instances.into_iter().map(InstanceId).collect()
}

/// Triangles that tell which rotation fits a class best.
const SAMPLE: usize = 1 << 12;

/// Of the rotations that the groups of a class have, the one in which the boxes of a sample of their triangles are
/// smallest; the first of equal ones.
fn common_rotation(scene: &Scene, layout: &Layout, class: &Class) -> DMat3 {
    let contents = || class.groups.iter().map(|&g| &layout.groups[g as usize].content);
    let mut rotations: Vec<DMat3> = Vec::new();
    for content in contents() {
        let rotation = content.baked_frame().matrix3;
        if !rotations.contains(&rotation) {
            rotations.push(rotation);
        }
    }
    if let [only] = rotations[..] {
        return only;
    }
    let triangles = || contents().flat_map(Content::baked_geometries).flat_map(|g| &g.triangles);
    let corners: Vec<[DVec3; 3]> =
        triangles().step_by(triangles().count().div_ceil(SAMPLE)).map(|&at| scene.world_corners(at)).collect();
    let area = |rotation: &DMat3| {
        let into = rotation.transpose();
        corners.iter().map(|c| Bounds::of(c.map(|p| into * p)).area()).sum::<f64>()
    };
    let areas = rotations.iter().map(|rotation| (area(rotation), *rotation));
    areas.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(DMat3::IDENTITY, |(_, rotation)| rotation)
}

/// Returns how far a corner of an instance with this box may move; infinite if the box is a point, which has no shape
/// to keep.
fn own_limit(own: &Bounds) -> f64 {
    if own.diagonal() > 0.0 { OF_OWN_SIZE * own.diagonal() } else { f64::INFINITY }
}

/// How far a corner of an instance may move, in world units.
#[derive(Clone, Copy)]
struct Limit {
    /// In all.
    allowed: f64,
    /// [`Scene::unavoidable_error`], which is part of it.
    unavoidable: f64,
}

/// Rounding errors of the triangles of a group.
#[derive(Default)]
struct Rounded {
    /// The largest [`Limit::unavoidable`] of its instances.
    unavoidable: f64,
    /// The largest distance between a corner and its stored position, in world units.
    error: f64,
    /// Instances with a corner beyond their limit, possibly with duplicates.
    refused: Vec<InstanceId>,
}

impl Rounded {
    fn with(mut self, instance: InstanceId, error: f64, limit: Limit) -> Rounded {
        self.error = self.error.max(error);
        self.unavoidable = self.unavoidable.max(limit.unavoidable);
        if error > limit.allowed && self.refused.last() != Some(&instance) {
            self.refused.push(instance);
        }
        self
    }

    fn and(mut self, other: Rounded) -> Rounded {
        self.error = self.error.max(other.error);
        self.unavoidable = self.unavoidable.max(other.unavoidable);
        self.refused.extend(other.refused);
        self
    }
}

/// Returns the rounding errors of storing a baked group; `limits` are those of the scene's instances.
fn rounded(scene: &Scene, content: &Content, limits: &[Limit]) -> Rounded {
    let Content::Baked { geometries, .. } = content else { return Rounded::default() };
    let store = Store::new(scene, content);
    let of_triangle = |all: Rounded, &at: &TriangleRef| {
        let error = store.corners_of(at).into_iter().map(rounding_error).fold(0.0, f64::max);
        all.with(InstanceId(at.instance), error, limits[at.instance as usize])
    };
    let triangles = geometries.par_iter().flat_map(|g| g.triangles.par_iter().with_min_len(CHEAP_ELEMENTS));
    triangles.fold(Rounded::default, of_triangle).reduce(Rounded::default, Rounded::and)
}

/// Returns, for each group that instances of one mesh share, the largest distance between a corner and its stored
/// position, in units of the group; 0 for baked groups.
fn errors_of_shared(scene: &Scene, layout: &Layout) -> Vec<f64> {
    let of_group = |group: &Group| {
        let mesh = match &group.content {
            Content::Kept(mesh) => return scene.meshes[mesh.0 as usize].reading_error(),
            Content::Piece { mesh, .. } => mesh,
            Content::Baked { .. } => return 0.0,
        };
        let store = Store::new(scene, &group.content);
        if store.is_unmoved() && scene.meshes[mesh.0 as usize].reading_error() == 0.0 {
            return 0.0;
        }
        (0..store.len()).flat_map(|t| store.corners(t)).map(rounding_error).fold(0.0, f64::max)
    };
    parallel::map_each(&layout.groups, &of_group)
}

/// Returns the world box of a group's triangles.
fn bounds(scene: &Scene, geometries: &[GroupGeometry]) -> Bounds {
    geometries
        .par_iter()
        .flat_map(|g| g.triangles.par_iter().with_min_len(CHEAP_ELEMENTS))
        .map(|&at| Bounds::of(scene.world_corners(at)))
        .reduce(|| Bounds::EMPTY, |a, b| a.union(&b))
}
