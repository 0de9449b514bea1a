//! Frames with permuted axes.
//!
//! Triangle boxes are the same along axes that are swapped or reversed, and no coordinate is rounded. Yet a driver
//! builds a different tree: Morton order and ties depend on which axis comes first and where it points. Only
//! measurement shows which permutation is fastest.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::layout::{Content, Layout};
use crate::scene::Scene;

/// Number of ways to map three axes to three axes without mirroring.
pub(crate) const WAYS: u8 = 24;

/// Returns one of the ways: a rotation whose columns are axes or their opposites. The first is the identity.
pub(super) fn way(number: u8) -> DMat3 {
    let (first, second, signs) = (number / 8 % 3, number / 4 % 2, number % 4);
    let axis = |i: u8| DVec3::AXES[usize::from(i % 3)];
    let sign = |negative: bool| if negative { -1.0 } else { 1.0 };
    let x = axis(first) * sign(signs & 1 > 0);
    let y = axis(first + 1 + second) * sign(signs & 2 > 0);
    DMat3::from_cols(x, y, x.cross(y))
}

/// Whether frames have the same axes, up to order and signs.
pub(super) fn are_alike(a: &DMat3, b: &DMat3) -> bool {
    (0..WAYS).any(|number| *a * way(number) == *b)
}

/// Permutes the axes of the frames of all rewritten groups in one of the ways; 0 changes nothing.
pub(crate) fn turn_axes(layout: &mut Layout, number: u8) {
    let turn = way(number);
    for group in &mut layout.groups {
        match &mut group.content {
            Content::Kept(_) => {}
            Content::Piece { frame, .. } | Content::Baked { frame, .. } => frame.matrix3 *= turn,
        }
    }
    for placement in &mut layout.placements {
        if !layout.groups[placement.group as usize].content.is_kept() {
            placement.transform.matrix3 *= turn;
        }
    }
}

/// Like [`turn_axes`], for the scene that a layout results in ([`super::stored()`]); `is_rewritten` is by mesh.
pub(crate) fn turn_stored(scene: &Scene, is_rewritten: &[bool], number: u8) -> Scene {
    let turn = way(number);
    let back = turn.transpose();
    let mut turned = scene.clone();
    for (index, _) in is_rewritten.iter().enumerate().filter(|(_, rewritten)| **rewritten) {
        let geometries = turned.meshes[index].geometries.iter_mut();
        let positions = geometries.flat_map(|g| Arc::make_mut(&mut g.positions));
        positions.for_each(|p| *p = (back * p.as_dvec3()).as_vec3());
    }
    for instance in turned.instances.iter_mut().filter(|i| is_rewritten[i.mesh.0 as usize]) {
        instance.transform.matrix3 *= turn;
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::layout::{GroupGeometry, stored};
    use crate::methods::{Method, Options, run};
    use crate::scene::TriangleRef;
    use glam::{DAffine3, Vec3};

    #[test]
    fn every_way_is_another_rotation_and_the_first_does_nothing() {
        let ways: Vec<DMat3> = (0..WAYS).map(way).collect();
        assert_eq!(ways[0], DMat3::IDENTITY);
        for (i, a) in ways.iter().enumerate() {
            assert_eq!(a.determinant(), 1.0);
            assert_eq!(*a * a.transpose(), DMat3::IDENTITY);
            assert!(!ways[..i].contains(a));
            assert!(are_alike(a, &ways[0]));
        }
        assert!(!are_alike(&DMat3::from_rotation_z(0.1), &DMat3::IDENTITY));
    }

    #[test]
    fn groups_are_stored_along_other_axes_and_placed_as_before() {
        let mut builder = SceneBuilder::default();
        builder.object("row", 0, row(Vec3::new(1.0, 2.0, 3.0), 10));
        builder.object("other row", 0, row(Vec3::new(5.0, 2.0, 4.0), 10));
        let scene = builder.scene();
        for method in [Method::Single, Method::Keep] {
            let mut layout = run(method, &scene, &Options::default());
            let before = stored(&scene, &layout);
            turn_axes(&mut layout, 9);
            assert_eq!(layout.check(&scene), Ok(()));
            let after = stored(&scene, &layout);
            assert_eq!(after.meshes[0].bounds() == before.meshes[0].bounds(), method == Method::Keep);
            let corners = |scene: &Scene| {
                (0..10).map(|triangle| scene.world_corners(TriangleRef { instance: 0, triangle })).collect::<Vec<_>>()
            };
            assert_eq!(corners(&after), corners(&before));
            let turned = turn_stored(&before, &vec![method == Method::Single; layout.groups.len()], 9);
            assert_eq!(turned.meshes[0].geometries[0].positions, after.meshes[0].geometries[0].positions);
            assert_eq!(turned.instances[0].transform, after.instances[0].transform);
        }
    }

    #[test]
    fn pieces_of_instances_are_turned_too() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("row", vec![(0, row(Vec3::new(1.0, 2.0, 3.0), 20))]);
        for i in 0..3 {
            builder.place(mesh, "placed", DAffine3::from_translation(DVec3::X * f64::from(i)));
        }
        let scene = builder.scene();
        let mut layout = run(Method::Keep, &scene, &Options::default());
        let triangles = (0..20).map(|triangle| TriangleRef { instance: 0, triangle }).collect();
        let geometries = vec![GroupGeometry { material: Some(0), triangles, ..GroupGeometry::default() }];
        layout.groups[0].content = Content::Piece { mesh, frame: DAffine3::IDENTITY, geometries };
        turn_axes(&mut layout, 17);
        assert_eq!(layout.check(&scene), Ok(()));
        assert!(layout.placements.iter().all(|p| p.transform.matrix3 == way(17)));
    }
}
