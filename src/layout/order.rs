//! Sorts triangles and groups in the order of a tree over them.
//!
//! Some drivers build their trees by halving the input by index; the quality of such a tree depends on the order of its
//! input.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use crate::layout::{Content, Group, GroupGeometry, Layout, PlacedTrees, Placement};
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::{Bounds, Scene, TriangleRef};
use crate::tree::{Quality, Tree};

/// Maximum number of triangles in a group for which a tree is built only for their order.
const TREE_TRIANGLES: usize = 1 << 19;

/// Sorts the triangles of each rewritten group, and the placements of baked groups, in the order of a tree. Baked
/// groups come after all others, in the order of a tree over their world boxes.
///
/// Groups of more than 2^19 triangles follow the Morton curve, which is the order of a linear tree (C. Lauterbach et
/// al., "Fast BVH Construction on GPUs", 2009): as an order it is as good, and it takes a tenth of the memory.
pub fn order_by_tree(scene: &Scene, layout: &mut Layout) {
    let order = |group: &mut Group| order_group(scene, group, &|count, bounds| order_items(count, bounds));
    let bounds = layout.groups.par_iter_mut().map(|group| order(group).bounds).collect();
    order_groups(layout, bounds);
}

/// Like [`order_by_tree`], with trees good enough for tracing. Returns, for each rewritten group in the new order, the
/// tree whose item `i` is its triangle `i`; `None` if no tree can hold all triangles. `known` trees are not rebuilt.
pub fn order_for_good(scene: &Scene, layout: &mut Layout, known: &PlacedTrees) -> Vec<Option<Arc<Tree>>> {
    let order = |group: &mut Group| {
        let tree = known.of_group(scene, &group.content);
        order_group(scene, group, &|count, bounds| order_by(tree.as_ref(), count, bounds))
    };
    let ordered: Vec<Ordered> = layout.groups.par_iter_mut().map(order).collect();
    let (bounds, mut trees): (Vec<Bounds>, Vec<Option<Tree>>) = ordered.into_iter().map(|o| (o.bounds, o.tree)).unzip();
    let order = order_groups(layout, bounds);
    let anew = layout.groups.iter().zip(order).filter(|(group, _)| !group.content.is_kept());
    anew.map(|(_, old)| trees[old as usize].take().map(Arc::new)).collect()
}

/// Moves baked groups after all others, in the order of a tree over their boxes; returns the new order.
fn order_groups(layout: &mut Layout, bounds: Vec<Bounds>) -> Vec<u32> {
    let baked = |group: &u32| matches!(layout.groups[*group as usize].content, Content::Baked { .. });
    let (baked, mut order): (Vec<u32>, Vec<u32>) = (0..layout.groups.len() as u32).partition(baked);
    let baked_bounds: Vec<Bounds> = baked.iter().map(|&g| bounds[g as usize]).collect();
    order.extend(tree_order(&baked_bounds).into_iter().map(|i| baked[i as usize]));
    permute_groups(layout, &order);
    order
}

/// Sorts a number of items by their boxes.
type Sort<'a> = dyn Fn(usize, &Boxes) -> Ordered + Sync + 'a;

/// The boxes of items.
type Boxes<'a> = dyn Fn(u32) -> Bounds + Sync + 'a;

/// Sorts the triangles of a group; the returned box is in world coordinates, and empty for a group that is not baked.
fn order_group(scene: &Scene, group: &mut Group, sort: &Sort) -> Ordered {
    match &mut group.content {
        Content::Kept(_) => Ordered::default(),
        Content::Piece { mesh, frame, geometries } => {
            let (mesh, into) = (&scene.meshes[mesh.0 as usize], frame.inverse());
            let corners = |at: TriangleRef| mesh.corners(at.triangle).map(|p| into.transform_point3(p.as_dvec3()));
            Ordered { bounds: Bounds::EMPTY, ..order_geometries(geometries, &corners, sort) }
        }
        Content::Baked { frame, geometries } => {
            let into = frame.inverse();
            let corners = |at: TriangleRef| scene.world_corners(at).map(|p| into.transform_point3(p));
            let ordered = order_geometries(geometries, &corners, sort);
            Ordered { bounds: ordered.bounds.transformed(frame), ..ordered }
        }
    }
}

/// Sorts the triangles of each geometry by a tree over all of them. The returned tree refers to the new positions.
fn order_geometries(
    geometries: &mut [GroupGeometry],
    corners: &(impl Fn(TriangleRef) -> [DVec3; 3] + Sync),
    sort: &Sort,
) -> Ordered {
    let ends: Vec<usize> = geometries
        .iter()
        .scan(0, |end, g| {
            *end += g.triangles.len();
            Some(*end)
        })
        .collect();
    let all: Vec<TriangleRef> = geometries.iter().flat_map(|g| g.triangles.iter().copied()).collect();
    let triangle_bounds = |i: u32| Bounds::of(corners(all[i as usize]));
    let mut ordered = sort(all.len(), &triangle_bounds);
    let mut next: Vec<usize> = geometries.iter().zip(&ends).map(|(g, end)| end - g.triangles.len()).collect();
    geometries.iter_mut().for_each(|g| g.triangles.clear());
    for item in &mut ordered.items {
        let geometry = ends.partition_point(|&end| end <= *item as usize);
        geometries[geometry].triangles.push(all[*item as usize]);
        *item = next[geometry] as u32;
        next[geometry] += 1;
    }
    if let Some(tree) = &mut ordered.tree {
        tree.order = std::mem::take(&mut ordered.items);
    }
    ordered
}

/// Items in tree order, and the box around them.
#[derive(Default)]
struct Ordered {
    items: Vec<u32>,
    bounds: Bounds,
    /// The tree; its order is in `items`.
    tree: Option<Tree>,
}

/// Sorts items by a tree built only for their order.
fn order_items(count: usize, bounds: &Boxes) -> Ordered {
    let around = around(count, bounds);
    let items = match count > TREE_TRIANGLES {
        true => along_morton_curve(count, bounds, &around),
        false => {
            tree_order(&(0..count as u32).into_par_iter().with_min_len(CHEAP_ELEMENTS).map(bounds).collect::<Vec<_>>())
        }
    };
    Ordered { items, bounds: around, tree: None }
}

/// Sorts items by a known tree, or one of the same quality.
fn order_by(known: Option<&Tree>, count: usize, bounds: &Boxes) -> Ordered {
    let mut tree = match known {
        Some(known) => known.clone(),
        None => Tree::build_from(count, Quality::Medium, &bounds),
    };
    let items = std::mem::take(&mut tree.order);
    match items.len() == count {
        true => Ordered { items, bounds: around(count, bounds), tree: Some(tree) },
        false => order_items(count, bounds),
    }
}

fn around(count: usize, bounds: &Boxes) -> Bounds {
    (0..count as u32)
        .into_par_iter()
        .with_min_len(CHEAP_ELEMENTS)
        .map(bounds)
        .reduce(|| Bounds::EMPTY, |a, b| a.union(&b))
}

/// Sorts items by the Morton codes of their boxes' centres, 21 bits per axis, ties by number.
fn along_morton_curve(count: usize, bounds: &Boxes, around: &Bounds) -> Vec<u32> {
    let extent = around.size().max_element();
    let cells_per_unit = f64::from((1 << 21) - 1) / extent;
    let code = |i: u32| {
        // A cast from NaN gives 0, one from too large a number the maximum.
        let cell = (bounds(i).center() - around.min) * cells_per_unit;
        spread_bits(cell.x as u64) | spread_bits(cell.y as u64) << 1 | spread_bits(cell.z as u64) << 2
    };
    let mut codes: Vec<(u64, u32)> =
        (0..count as u32).into_par_iter().with_min_len(CHEAP_ELEMENTS).map(|i| (code(i), i)).collect();
    codes.par_sort_unstable();
    codes.into_iter().map(|(_, i)| i).collect()
}

/// Moves bit `i` of the lowest 21 bits to bit `3 i`.
fn spread_bits(x: u64) -> u64 {
    let x = x.min((1 << 21) - 1);
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Returns the indices of boxes in tree order; boxes without a finite size come last.
fn tree_order(boxes: &[Bounds]) -> Vec<u32> {
    let is_usable = |&i: &u32| {
        let b = &boxes[i as usize];
        !b.is_empty() && b.min.is_finite() && b.max.is_finite()
    };
    let (usable, rest): (Vec<u32>, Vec<u32>) = (0..boxes.len() as u32).partition(is_usable);
    let usable_boxes: Vec<Bounds> = usable.iter().map(|&i| boxes[i as usize]).collect();
    let mut order: Vec<u32> =
        Tree::build(&usable_boxes, Quality::Fast).order.into_iter().map(|i| usable[i as usize]).collect();
    order.extend(rest);
    order
}

/// Reorders the groups, and moves the placements of baked groups after all others in the same order.
fn permute_groups(layout: &mut Layout, order: &[u32]) {
    let mut new_index = vec![0u32; order.len()];
    (0u32..).zip(order).for_each(|(new, &old)| new_index[old as usize] = new);
    let mut groups: Vec<Option<Group>> = std::mem::take(&mut layout.groups).into_iter().map(Some).collect();
    layout.groups = order.iter().filter_map(|&old| groups[old as usize].take()).collect();
    let (mut kept, mut baked): (Vec<Placement>, Vec<Placement>) = std::mem::take(&mut layout.placements)
        .into_iter()
        .map(|p| Placement { group: new_index[p.group as usize], ..p })
        .partition(|p: &Placement| p.instance.is_some());
    baked.sort_by_key(|p| p.group);
    kept.append(&mut baked);
    layout.placements = kept;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::methods::{Method, Options, run};
    use glam::Vec3;
    use proptest::prelude::*;

    /// The mean step along x between consecutive triangles.
    fn mean_step(scene: &Scene, triangles: &[TriangleRef]) -> f64 {
        let x: Vec<f64> = triangles.iter().map(|&t| scene.world_corners(t)[0].x).collect();
        x.windows(2).map(|w| (w[1] - w[0]).abs()).sum::<f64>() / (x.len() - 1) as f64
    }

    #[test]
    fn an_empty_layout_stays_empty() {
        let mut layout = Layout::default();
        order_by_tree(&Scene::default(), &mut layout);
        assert!(layout.groups.is_empty());
    }

    #[test]
    fn neighbours_come_one_after_the_other() {
        let mut builder = SceneBuilder::default();
        let shuffled = |i: usize| small_triangle(Vec3::X * (i * 389 % 1000) as f32);
        builder.object("a", 0, (0..500).map(shuffled).collect());
        builder.object("b", 0, (500..1000).map(shuffled).collect());
        let scene = builder.scene();
        let mut layout = run(Method::Single, &scene, &Options::default());
        order_by_tree(&scene, &mut layout);
        assert_eq!(layout.check(&scene), Ok(()));
        let Content::Baked { geometries, .. } = &layout.groups[0].content else { panic!("not baked") };
        assert!(mean_step(&scene, &geometries[0].triangles) < 10.0);
    }

    #[test]
    fn large_groups_follow_the_morton_curve() {
        let count = TREE_TRIANGLES + 17;
        let x = |i: u32| f64::from(i.wrapping_mul(2_654_435_761));
        let bounds = |i: u32| Bounds { min: DVec3::X * x(i), max: DVec3::X * x(i) + DVec3::splat(1e6) };
        let ordered = order_items(count, &bounds);
        let mut items = ordered.items.clone();
        items.sort_unstable();
        assert!(items.into_iter().eq(0..count as u32));
        let cell = (f64::from(u32::MAX) + 1e6) / f64::from(1 << 21);
        assert!(ordered.items.windows(2).all(|w| x(w[0]) <= x(w[1]) + 2.0 * cell));
    }

    #[test]
    fn equal_triangles_keep_their_number() {
        let mut builder = SceneBuilder::default();
        builder.object("a", 0, vec![small_triangle(Vec3::ZERO); 20_000]);
        builder.object("b", 1, vec![[Vec3::ZERO; 3]; 10]);
        let scene = builder.scene();
        let mut layout = run(Method::Single, &scene, &Options::default());
        order_by_tree(&scene, &mut layout);
        assert_eq!(layout.check(&scene), Ok(()));
        assert_eq!(group_sizes(&scene, &layout), [20_010]);
    }

    #[test]
    fn the_order_is_the_same_for_any_number_of_threads() {
        let mut builder = SceneBuilder::default();
        for i in 0..20 {
            let start = Vec3::new((i * 7 % 20) as f32, (i * 3 % 5) as f32, 0.0);
            builder.object("object", i % 3, row(start, 50));
        }
        let scene = builder.scene();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut layout = run(Method::Single, &scene, &Options::default());
                order_by_tree(&scene, &mut layout);
                format!("{layout:?}")
            })
        };
        assert_eq!(with(1), with(3));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]
        #[test]
        fn every_layout_of_every_scene_stays_whole(scene in any_scene()) {
            for method in [Method::Keep, Method::Single, Method::PerObject, Method::Bvh, Method::Overlap] {
                let mut layout = run(method, &scene, &Options::default());
                prop_assert_eq!(layout.check(&scene), Ok(()));
                order_by_tree(&scene, &mut layout);
                prop_assert_eq!(layout.check(&scene), Ok(()));
            }
        }
    }
}
