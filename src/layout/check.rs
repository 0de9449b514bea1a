//! The invariants of a [`Layout`].

use std::collections::BTreeSet;

use glam::DAffine3;

use crate::layout::builder::first_instances;
use crate::layout::{Content, Group, GroupGeometry, Layout, Placement};
use crate::scene::{Broken, InstanceId, MeshId, Scene, TriangleRef};

impl Layout {
    /// Checks the invariants: each triangle that an instance places is placed exactly once, by a group that keeps its
    /// material; pinned instances stay unchanged; each transform is correct; nothing is empty or unused. Takes time
    /// linear in the triangles of the groups and in the placements.
    ///
    /// # Errors
    /// A description of the first broken invariant.
    pub fn check(&self, scene: &Scene) -> Result<(), Broken> {
        let first = first_instances(scene);
        for (i, group) in self.groups.iter().enumerate() {
            check_group(scene, &first, group).map_err(|e| Broken(format!("group {i} `{}`: {e}", group.name)))?;
        }
        let mut uses = vec![0u32; self.groups.len()];
        for (i, placement) in self.placements.iter().enumerate() {
            check_placement(scene, self, placement).map_err(|e| Broken(format!("placement {i}: {e}")))?;
            uses[placement.group as usize] += 1;
        }
        for (i, (group, &uses)) in self.groups.iter().zip(&uses).enumerate() {
            if uses == 0 || (uses > 1 && matches!(group.content, Content::Baked { .. })) {
                return Err(Broken(format!("group {i} `{}` is placed {uses} times", group.name)));
            }
        }
        Coverage::new(scene, self).check()
    }
}

fn check_group(scene: &Scene, first: &[u32], group: &Group) -> Result<(), String> {
    match &group.content {
        Content::Kept(mesh) => check_mesh(scene, *mesh),
        Content::Piece { mesh, frame, geometries } => {
            require(is_single_precision(frame), "has a frame that single precision does not hold")?;
            require(frame.matrix3.determinant() > 0.0, "has a singular or mirroring frame")?;
            check_mesh(scene, *mesh)?;
            check_geometries(scene, geometries)?;
            let first = first[mesh.0 as usize];
            let refs = geometries.iter().flat_map(|g| &g.triangles);
            require(refs.into_iter().all(|t| t.instance == first), "refers to another than the first instance")
        }
        Content::Baked { frame, geometries } => {
            require(is_single_precision(frame), "has a frame that single precision does not hold")?;
            require(frame.matrix3.determinant() != 0.0, "has a singular frame")?;
            check_geometries(scene, geometries)?;
            let pinned = |t: &TriangleRef| scene.instances[t.instance as usize].pinned.is_some();
            require(!geometries.iter().flat_map(|g| &g.triangles).any(pinned), "bakes a pinned instance")
        }
    }
}

fn check_mesh(scene: &Scene, mesh: MeshId) -> Result<(), String> {
    require((mesh.0 as usize) < scene.meshes.len(), "is of a mesh that is not there")
}

/// Whether each coefficient is exactly a 32-bit float.
pub(crate) fn is_single_precision(frame: &DAffine3) -> bool {
    frame.is_finite() && frame.to_cols_array().iter().all(|&c| f64::from(c as f32) == c)
}

fn check_geometries(scene: &Scene, geometries: &[GroupGeometry]) -> Result<(), String> {
    require(!geometries.is_empty(), "is empty")?;
    let mut keys: Vec<_> = geometries.iter().map(|g| (g.material, g.merge_class)).collect();
    keys.sort_unstable();
    require(keys.windows(2).all(|k| k[0] != k[1]), "has two geometries of one material and merge class")?;
    for geometry in geometries {
        require(!geometry.triangles.is_empty(), "has an empty geometry")?;
        for &at in &geometry.triangles {
            check_triangle(scene, geometry, at).map_err(|e| format!("{at:?} {e}"))?;
        }
    }
    Ok(())
}

fn check_triangle(scene: &Scene, geometry: &GroupGeometry, at: TriangleRef) -> Result<(), String> {
    require((at.instance as usize) < scene.instances.len(), "is of an instance that is not there")?;
    let mesh = scene.mesh_of(InstanceId(at.instance));
    require((at.triangle as usize) < mesh.triangle_count(), "is beyond its mesh")?;
    let source = &mesh.geometries[mesh.locate(at.triangle).0];
    require(geometry.material == source.material, "has another material")?;
    require(geometry.merge_class == source.merge_class, "has another merge class")?;
    require(geometry.opacity == source.opacity, "has another opacity")
}

fn check_placement(scene: &Scene, layout: &Layout, placement: &Placement) -> Result<(), String> {
    let group = layout.groups.get(placement.group as usize).ok_or("is of a group that is not there")?;
    match (&group.content, placement.instance) {
        (Content::Baked { frame, .. }, None) => {
            require(placement.transform == *frame, "does not undo the frame of its group")
        }
        (Content::Baked { .. }, Some(_)) => Err("of a baked group names an instance".to_owned()),
        (Content::Kept(_) | Content::Piece { .. }, None) => Err("of a mesh names no instance".to_owned()),
        (Content::Kept(mesh) | Content::Piece { mesh, .. }, Some(instance)) => {
            let instance = scene.instances.get(instance.0 as usize).ok_or("names an instance that is not there")?;
            require(instance.mesh == *mesh, "names an instance of another mesh")?;
            let frame = group.content.piece_frame();
            require(instance.transform * frame == placement.transform, "has another transform than its instance")?;
            let stays = instance.pinned.is_some() || scene.is_copied(instance.node);
            require(frame == DAffine3::IDENTITY || !stays, "stores what is pinned or copied in a frame")
        }
    }
}

/// The groups that place the triangles of each instance.
struct Coverage<'a> {
    scene: &'a Scene,
    layout: &'a Layout,
    /// The groups that place each instance, sorted.
    groups: Vec<Vec<u32>>,
    /// Number of baked triangles of each instance.
    baked: Vec<usize>,
    /// Number of triangles of each group.
    sizes: Vec<usize>,
}

impl<'a> Coverage<'a> {
    fn new(scene: &'a Scene, layout: &'a Layout) -> Self {
        let mut groups = vec![Vec::new(); scene.instances.len()];
        for placement in &layout.placements {
            if let Some(instance) = placement.instance {
                groups[instance.0 as usize].push(placement.group);
            }
        }
        groups.iter_mut().for_each(|g| g.sort_unstable());
        let mut baked = vec![0; scene.instances.len()];
        baked_triangles(layout).for_each(|t| baked[t.instance as usize] += 1);
        let sizes = layout.groups.iter().map(|g| g.content.triangle_count(scene)).collect();
        Coverage { scene, layout, groups, baked, sizes }
    }

    fn check(&self) -> Result<(), Broken> {
        for i in 0..self.scene.instances.len() {
            let name = &self.scene.instances[i].name;
            self.check_instance(i).map_err(|e| Broken(format!("instance {i} `{name}` {e}")))?;
        }
        // With the expected number of triangles and no duplicates, each triangle is there exactly once.
        let together: BTreeSet<&[u32]> = self.groups.iter().map(Vec::as_slice).collect();
        for groups in together {
            self.check_pieces(groups).map_err(|e| Broken(format!("groups {groups:?} {e}")))?;
        }
        self.check_baked()
    }

    fn check_instance(&self, i: usize) -> Result<(), String> {
        let (groups, instance) = (&self.groups[i], &self.scene.instances[i]);
        let placed: usize = groups.iter().map(|&g| self.sizes[g as usize]).sum::<usize>() + self.baked[i];
        let expected = self.scene.mesh_of(InstanceId(i as u32)).triangle_count();
        if placed != expected {
            return Err(format!("has {placed} triangles placed of {expected}"));
        }
        require(instance.pinned.is_none() || groups.len() == 1, "is pinned and not left whole")?;
        let copies_differ = i > 0 && self.scene.instances[i - 1].node == instance.node && self.groups[i - 1] != *groups;
        require(!copies_differ, "is placed otherwise than the copy before it on its node")
    }

    /// Checks that pieces placed together contain no triangle twice.
    fn check_pieces(&self, groups: &[u32]) -> Result<(), String> {
        let mut seen = Bits::default();
        for triangle in groups.iter().flat_map(|&g| self.piece_triangles(g)) {
            require(seen.insert(triangle as usize), "place a triangle twice")?;
        }
        Ok(())
    }

    fn check_baked(&self) -> Result<(), Broken> {
        let mut seen = Bits::default();
        let first_bits: Vec<usize> = (0..self.baked.len())
            .scan(0, |bits, i| {
                let first = *bits;
                *bits += if self.baked[i] > 0 { self.baked[i] + self.piece_sizes(i) } else { 0 };
                Some(first)
            })
            .collect();
        let pieces = (0..self.baked.len()).filter(|&i| self.baked[i] > 0).flat_map(|i| {
            let triangles = self.groups[i].iter().flat_map(|&g| self.piece_triangles(g));
            triangles.map(move |triangle| TriangleRef { instance: i as u32, triangle })
        });
        for at in pieces.chain(baked_triangles(self.layout)) {
            if !seen.insert(first_bits[at.instance as usize] + at.triangle as usize) {
                return Err(Broken(format!("{at:?} is placed twice")));
            }
        }
        Ok(())
    }

    fn piece_sizes(&self, instance: usize) -> usize {
        self.groups[instance].iter().map(|&g| self.sizes[g as usize]).sum()
    }

    /// Returns the triangles of a piece; none for a kept mesh, which cannot omit or repeat any.
    fn piece_triangles(&self, group: u32) -> impl Iterator<Item = u32> {
        let geometries: &[GroupGeometry] = match &self.layout.groups[group as usize].content {
            Content::Piece { geometries, .. } => geometries,
            _ => &[],
        };
        geometries.iter().flat_map(|g| g.triangles.iter().map(|t| t.triangle))
    }
}

fn baked_triangles(layout: &Layout) -> impl Iterator<Item = TriangleRef> {
    let geometries = |group| match group {
        &Group { content: Content::Baked { ref geometries, .. }, .. } => geometries.as_slice(),
        _ => &[],
    };
    layout.groups.iter().flat_map(geometries).flat_map(|g| g.triangles.iter().copied())
}

/// A set of small numbers.
#[derive(Default)]
struct Bits(Vec<u64>);

impl Bits {
    /// Adds a number; returns whether it is new.
    fn insert(&mut self, i: usize) -> bool {
        let (word, bit) = (i / 64, 1 << (i % 64));
        if self.0.len() <= word {
            self.0.resize(word + 1, 0);
        }
        let new = self.0[word] & bit == 0;
        self.0[word] |= bit;
        new
    }
}

fn require(holds: bool, otherwise: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(otherwise.to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::methods::{Method, Options, run};
    use crate::scene::Pinned;
    use glam::Vec3;

    /// An object, a mesh of two geometries placed twice, and a pinned door.
    fn scene() -> Scene {
        let mut builder = SceneBuilder::default();
        builder.object("floor", 0, row(Vec3::ZERO, 4));
        let lamp = builder.mesh("lamp", vec![(0, row(Vec3::ZERO, 3)), (1, row(Vec3::Y, 2))]);
        builder.place(lamp, "left", at(1.0, 0.0, 0.0));
        builder.place(lamp, "right", at(2.0, 0.0, 0.0));
        let door = builder.mesh("door", vec![(0, row(Vec3::ZERO, 2))]);
        builder.place(door, "door", DAffine3::IDENTITY).pinned = Some(Pinned::Animated);
        builder.scene()
    }

    /// Returns the error found after a fault is planted in the layout of a method.
    fn fault(method: Method, plant: impl FnOnce(&mut Layout)) -> String {
        let scene = scene();
        let mut layout = run(method, &scene, &Options::default());
        assert_eq!(layout.check(&scene), Ok(()));
        plant(&mut layout);
        layout.check(&scene).expect_err("the fault is found").0
    }

    fn geometries(layout: &mut Layout, group: usize) -> &mut Vec<GroupGeometry> {
        match &mut layout.groups[group].content {
            Content::Baked { geometries, .. } | Content::Piece { geometries, .. } => geometries,
            Content::Kept(_) => panic!("kept"),
        }
    }

    #[test]
    fn lost_and_repeated_triangles_are_found() {
        let lost = fault(Method::Single, |l| {
            geometries(l, 1)[0].triangles.pop();
        });
        assert!(lost.contains("has 4 triangles placed of 5"), "{lost}");
        let repeated =
            fault(Method::Single, |l| geometries(l, 1)[0].triangles[1] = TriangleRef { instance: 0, triangle: 0 });
        assert!(repeated.contains("placed twice"), "{repeated}");
        let repeated = fault(Method::PerObject, |l| geometries(l, 1)[0].triangles[1].triangle = 0);
        assert!(repeated.contains("place a triangle twice"), "{repeated}");
        let both = fault(Method::Keep, |l| l.placements.push(l.placements[0]));
        assert!(both.contains("has 8 triangles placed of 4"), "{both}");
        let lost = fault(Method::PerObject, |l| {
            l.placements.remove(2);
        });
        assert!(lost.contains("has 3 triangles placed of 5"), "{lost}");
    }

    #[test]
    fn wrong_materials_and_doubled_geometries_are_found() {
        let wrong = fault(Method::Single, |l| geometries(l, 1)[0].material = Some(1));
        assert!(wrong.contains("material"), "{wrong}");
        let wrong = fault(Method::Single, |l| geometries(l, 1)[0].opacity = crate::scene::Opacity::Blend);
        assert!(wrong.contains("opacity"), "{wrong}");
        let doubled = fault(Method::Single, |l| {
            let last = geometries(l, 1)[0].triangles.pop();
            let half = GroupGeometry { triangles: last.into_iter().collect(), ..geometries(l, 1)[0].clone() };
            geometries(l, 1).push(half);
        });
        assert!(doubled.contains("two geometries"), "{doubled}");
    }

    #[test]
    fn wrong_transforms_are_found() {
        let moved = fault(Method::Keep, |l| l.placements[1].transform.translation.x += 1e-9);
        assert!(moved.contains("another transform"), "{moved}");
        let moved = fault(Method::Single, |l| l.placements[1].transform.translation.x = 1.0);
        assert!(moved.contains("frame"), "{moved}");
        let inexact = fault(Method::Single, |l| {
            let Content::Baked { frame, .. } = &mut l.groups[1].content else { panic!("not baked") };
            frame.translation.x = 0.1;
        });
        assert!(inexact.contains("single precision"), "{inexact}");
    }

    #[test]
    fn touched_pinned_instances_are_found() {
        let baked =
            fault(Method::Single, |l| geometries(l, 1)[0].triangles[0] = TriangleRef { instance: 3, triangle: 0 });
        assert!(baked.contains("pinned"), "{baked}");
    }

    #[test]
    fn empty_unused_and_missing_groups_are_found() {
        let empty = fault(Method::Single, |l| geometries(l, 1)[0].triangles.clear());
        assert!(empty.contains("empty"), "{empty}");
        let unused = fault(Method::Keep, |l| l.groups.push(l.groups[0].clone()));
        assert!(unused.contains("placed 0 times"), "{unused}");
        let twice = fault(Method::Single, |l| l.placements.push(l.placements[1]));
        assert!(twice.contains("placed 2 times"), "{twice}");
        let missing = fault(Method::Keep, |l| l.placements[0].group = 9);
        assert!(missing.contains("not there"), "{missing}");
        let swapped = fault(Method::Keep, |l| l.placements[0].group = 1);
        assert!(swapped.contains("another mesh"), "{swapped}");
        let beyond = fault(Method::Single, |l| geometries(l, 1)[0].triangles[0].triangle = 99);
        assert!(beyond.contains("beyond"), "{beyond}");
    }

    #[test]
    fn copies_of_one_node_are_placed_alike() {
        let mut scene = scene();
        (scene.instances[2].node, scene.instances[2].copy) = (scene.instances[1].node, 1);
        let mut layout = run(Method::Keep, &scene, &Options::default());
        let pieces = run(Method::PerObject, &scene, &Options::default());
        let first = layout.groups.len() as u32;
        layout.groups.extend(pieces.groups[1..3].iter().cloned());
        layout.placements.remove(2);
        layout
            .placements
            .extend(pieces.placements[3..5].iter().map(|p| Placement { group: p.group - 1 + first, ..*p }));
        assert!(layout.check(&scene).is_err_and(|e| e.0.contains("copy")));
    }
}
