//! Plans the BLASes and TLAS entries of a scene. Does not use the device, only its limits.

use std::ops::Range;

use glam::DAffine3;

use super::scale::Scales;
use crate::layout::BlasPer;
use crate::scene::{Geometry, Mesh, Scene};
use crate::verify::vulkan::Error;
use crate::verify::vulkan::info::Limits;

/// Number of custom indices: an instance's custom index has 24 bits.
const CUSTOM_INDICES: u64 = 1 << 24;

/// The geometries of one BLAS.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::verify::vulkan) struct Group {
    /// Index into the scene's meshes.
    pub(super) mesh: usize,
    /// Range of geometries within that mesh.
    pub(super) geometries: Range<usize>,
}

/// One instance of the TLAS; its custom index is its position in the list of entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::verify::vulkan) struct Entry {
    /// Index into the scene's instances.
    pub(in crate::verify::vulkan) instance: u32,
    /// Index into the groups.
    pub(in crate::verify::vulkan) group: u32,
}

/// The BLASes and TLAS entries to build for a scene.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::verify::vulkan) struct Plan {
    pub(in crate::verify::vulkan) scales: Scales,
    pub(super) groups: Vec<Group>,
    pub(in crate::verify::vulkan) entries: Vec<Entry>,
    /// Number of instances that no ray can enter.
    pub(in crate::verify::vulkan) skipped_instances: u64,
}

impl Group {
    /// Returns the geometries of the group.
    pub(super) fn geometries<'a>(&self, scene: &'a Scene) -> &'a [Geometry] {
        &scene.meshes[self.mesh].geometries[self.geometries.clone()]
    }

    /// Returns a name for error messages.
    pub(super) fn name(&self, scene: &Scene) -> String {
        let mesh = &scene.meshes[self.mesh];
        match self.geometries.len() == mesh.geometries.len() {
            true => format!("BLAS of mesh {} `{}`", self.mesh, mesh.name),
            false => format!("BLAS of mesh {} `{}`, geometry {}", self.mesh, mesh.name, self.geometries.start),
        }
    }
}

impl Plan {
    /// Plans BLASes and entries, and checks them against the limits.
    pub(in crate::verify::vulkan) fn new(scene: &Scene, per: BlasPer, limits: &Limits) -> Result<Plan, Error> {
        Plan::of(scene, per, limits, can_be_entered)
    }

    /// Like [`Plan::new`], with entries for all instances that have triangles: what no ray can enter now may be entered
    /// once it has moved.
    pub(in crate::verify::vulkan) fn moving(scene: &Scene, per: BlasPer, limits: &Limits) -> Result<Plan, Error> {
        Plan::of(scene, per, limits, |_| true)
    }

    fn of(scene: &Scene, per: BlasPer, limits: &Limits, is_entered: impl Fn(&DAffine3) -> bool) -> Result<Plan, Error> {
        let mut plan =
            Plan { scales: Scales::of(scene), groups: Vec::new(), entries: Vec::new(), skipped_instances: 0 };
        let mut groups_of_mesh = Vec::with_capacity(scene.meshes.len());
        for (index, mesh) in scene.meshes.iter().enumerate() {
            let first = plan.groups.len();
            plan.groups.extend(split(mesh, per).into_iter().map(|geometries| Group { mesh: index, geometries }));
            groups_of_mesh.push(first..plan.groups.len());
        }
        for (index, instance) in scene.instances.iter().enumerate() {
            let mesh = instance.mesh.0 as usize;
            let groups = &groups_of_mesh[mesh];
            if groups.is_empty() || !is_entered(&plan.scales.transform(&instance.transform, mesh)) {
                plan.skipped_instances += 1;
                continue;
            }
            plan.entries.extend(groups.clone().map(|g| Entry { instance: index as u32, group: g as u32 }));
        }
        plan.check(scene, limits)?;
        Ok(plan)
    }

    /// Returns the world-from-mesh transform of an entry, both spaces scaled as on the device.
    pub(super) fn transform(&self, scene: &Scene, entry: &Entry) -> DAffine3 {
        let instance = &scene.instances[entry.instance as usize];
        self.scales.transform(&instance.transform, instance.mesh.0 as usize)
    }

    fn check(&self, scene: &Scene, limits: &Limits) -> Result<(), Error> {
        let instances = limits.instances.min(CUSTOM_INDICES);
        Error::check_limit(|| "instances of the TLAS".into(), self.entries.len() as u64, instances)?;
        for group in &self.groups {
            let geometries = group.geometries(scene);
            let triangles = geometries.iter().map(|g| g.triangles.len() as u64).sum();
            let name = |of: &str| format!("{of} of the {}", group.name(scene));
            Error::check_limit(|| name("geometries"), geometries.len() as u64, limits.geometries)?;
            Error::check_limit(|| name("triangles"), triangles, limits.primitives)?;
        }
        Ok(())
    }

    /// Returns the geometries of all groups, in order.
    pub(in crate::verify::vulkan) fn geometries<'s>(&self, scene: &'s Scene) -> impl Iterator<Item = &'s Geometry> {
        self.groups.iter().flat_map(|group| group.geometries(scene))
    }

    /// Returns, for each entry, the index of its first geometry in [`Plan::geometries`].
    pub(in crate::verify::vulkan) fn first_geometries(&self, scene: &Scene) -> Vec<u32> {
        let (_, starts) = self.first_triangles(scene);
        self.entries.iter().map(|entry| starts[entry.group as usize]).collect()
    }

    /// Returns the number, within its mesh, of the first triangle of each geometry of each group, and the index in that
    /// list at which the geometries of each group start.
    pub(in crate::verify::vulkan) fn first_triangles(&self, scene: &Scene) -> (Vec<u32>, Vec<u32>) {
        let (mut triangles, mut starts) = (Vec::new(), Vec::with_capacity(self.groups.len()));
        for group in &self.groups {
            starts.push(triangles.len() as u32);
            triangles.extend(group.geometries(scene).iter().map(|g| g.first_triangle));
        }
        (triangles, starts)
    }
}

/// Returns the ranges of geometries that become one BLAS each; ranges without triangles are omitted.
fn split(mesh: &Mesh, per: BlasPer) -> Vec<Range<usize>> {
    let all = 0..mesh.geometries.len();
    match per {
        BlasPer::Mesh if mesh.triangle_count() == 0 => Vec::new(),
        BlasPer::Mesh => vec![all],
        BlasPer::Primitive => all.filter(|&g| !mesh.geometries[g].triangles.is_empty()).map(|g| g..g + 1).collect(),
    }
}

/// Whether rays can enter the instance on a device, which inverts the transform in single precision.
pub(super) fn can_be_entered(transform: &DAffine3) -> bool {
    let stored = DAffine3::from_cols_array(&transform.to_cols_array().map(|x| f64::from(x as f32)));
    let invertible = |t: &DAffine3| {
        t.matrix3.determinant() != 0.0 && t.inverse().to_cols_array().iter().all(|x| (*x as f32).is_finite())
    };
    // If rounding to single precision flips the orientation, the instance was flat.
    let same_side = (stored.matrix3.determinant() < 0.0) == (transform.matrix3.determinant() < 0.0);
    stored.is_finite() && invertible(transform) && invertible(&stored) && same_side
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DVec3, Vec3};

    use super::*;
    use crate::scene::{Instance, MeshId};

    const PLENTY: Limits = Limits {
        instances: 100,
        geometries: 100,
        primitives: 100,
        scratch_alignment: 1,
        max_allocation: 1 << 30,
        rays_per_launch: 1,
        handle_size: 32,
        table_alignment: 64,
    };

    fn mesh(triangles: &[usize]) -> Mesh {
        let mut first_triangle = 0;
        let geometry = |&count: &usize| {
            first_triangle += count as u32;
            Geometry {
                positions: Arc::from([Vec3::ZERO, Vec3::X, Vec3::Y]),
                triangles: vec![[0, 1, 2]; count],
                first_triangle: first_triangle - count as u32,
                ..Geometry::default()
            }
        };
        Mesh { name: "m".into(), geometries: triangles.iter().map(geometry).collect(), ..Mesh::default() }
    }

    fn scene(meshes: Vec<Mesh>, placed: &[(u32, DAffine3)]) -> Scene {
        let place = |&(mesh, transform): &(u32, DAffine3)| Instance {
            name: String::new(),
            node: 0,
            copy: 0,
            mesh: MeshId(mesh),
            transform,
            pinned: None,
        };
        Scene { meshes: meshes.into(), instances: placed.iter().map(place).collect(), ..Scene::default() }
    }

    fn scaled(x: f64, y: f64, z: f64) -> DAffine3 {
        DAffine3::from_scale(DVec3::new(x, y, z))
    }

    #[test]
    fn a_blas_per_mesh_is_shared_by_its_instances() {
        let scene = scene(vec![mesh(&[2, 3])], &[(0, DAffine3::IDENTITY), (0, scaled(2.0, 2.0, 2.0))]);
        let plan = Plan::new(&scene, BlasPer::Mesh, &PLENTY).expect("within the limits");
        assert_eq!(plan.groups, [Group { mesh: 0, geometries: 0..2 }]);
        assert_eq!(plan.entries, [Entry { instance: 0, group: 0 }, Entry { instance: 1, group: 0 }]);
        assert_eq!(plan.first_triangles(&scene), (vec![0, 2], vec![0]));
    }

    #[test]
    fn a_blas_per_primitive_has_an_entry_of_its_own() {
        let scene = scene(vec![mesh(&[1]), mesh(&[2, 0, 3])], &[(1, DAffine3::IDENTITY), (0, DAffine3::IDENTITY)]);
        let plan = Plan::new(&scene, BlasPer::Primitive, &PLENTY).expect("within the limits");
        let groups: Vec<_> = plan.groups.iter().map(|g| (g.mesh, g.geometries.start)).collect();
        assert_eq!(groups, [(0, 0), (1, 0), (1, 2)]);
        let entries: Vec<_> = plan.entries.iter().map(|e| (e.instance, e.group)).collect();
        assert_eq!(entries, [(0, 1), (0, 2), (1, 0)]);
        assert_eq!(plan.first_triangles(&scene), (vec![0, 0, 2], vec![0, 1, 2]));
    }

    #[test]
    fn instances_that_no_ray_can_enter_are_skipped() {
        let flat = [scaled(0.0, 1.0, 1.0), scaled(0.0, 0.0, 0.0), scaled(1e-60, 1.0, 1.0), scaled(1e-45, 1.0, 1.0)];
        let mut placed: Vec<(u32, DAffine3)> = flat.map(|t| (0, t)).to_vec();
        placed.push((0, scaled(-1.0, 1e-12, 1.0)));
        placed.push((1, DAffine3::IDENTITY));
        let scene = scene(vec![mesh(&[1]), mesh(&[])], &placed);
        let plan = Plan::new(&scene, BlasPer::Mesh, &PLENTY).expect("within the limits");
        assert_eq!(plan.skipped_instances, 5);
        assert_eq!(plan.entries, [Entry { instance: 4, group: 0 }]);
    }

    #[test]
    fn nothing_gives_nothing() {
        let plan = Plan::new(&Scene::default(), BlasPer::Mesh, &PLENTY).expect("within the limits");
        assert!(plan.groups.is_empty() && plan.entries.is_empty() && plan.skipped_instances == 0);
    }

    #[test]
    fn each_limit_is_checked_before_the_build_and_names_its_object() {
        let scene = scene(vec![mesh(&[4, 5])], &[(0, DAffine3::IDENTITY), (0, DAffine3::IDENTITY)]);
        let error =
            |limits: Limits| Plan::new(&scene, BlasPer::Mesh, &limits).expect_err("it exceeds a limit").to_string();
        let exact = Limits { instances: 2, geometries: 2, primitives: 9, ..PLENTY };
        assert!(Plan::new(&scene, BlasPer::Mesh, &exact).is_ok());
        assert_eq!(
            error(Limits { instances: 1, ..PLENTY }),
            "instances of the TLAS: 2, and the device takes at most 1"
        );
        assert_eq!(
            error(Limits { primitives: 8, ..PLENTY }),
            "triangles of the BLAS of mesh 0 `m`: 9, and the device takes at most 8"
        );
        assert!(error(Limits { geometries: 1, ..PLENTY }).starts_with("geometries of the BLAS of mesh 0"));
    }
}
