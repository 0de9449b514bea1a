//! Trees of a scene that moves: refitted, which keeps a tree and computes its boxes anew, or rebuilt.

use std::sync::Arc;

use rayon::prelude::*;

use super::boxes::{BoxNode, refit};
use super::two_level::{Bottom, Entry, Padding, TwoLevel, largest_coordinate};
use crate::scene::{Bounds, Scene};

/// The trees of all meshes, shared by several trees over instances.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bottoms(Vec<Arc<Bottom>>);

impl Bottoms {
    /// Builds the trees of a scene's meshes.
    pub(crate) fn build(scene: &Scene) -> Bottoms {
        Bottoms(scene.meshes.par_iter().map(|mesh| Arc::new(Bottom::build_all(mesh))).collect())
    }

    /// Refits the trees of the meshes that deformed. A tree whose mesh has outgrown it is rebuilt.
    pub(crate) fn refit(&mut self, scene: &Scene, deformed: &[usize]) {
        for &mesh in deformed {
            let refitted = self.0[mesh].refitted(&scene.meshes[mesh]);
            self.0[mesh] = Arc::new(refitted.unwrap_or_else(|| Bottom::build_all(&scene.meshes[mesh])));
        }
    }

    /// Rebuilds the trees of the meshes that deformed.
    pub(crate) fn rebuild(&mut self, scene: &Scene, deformed: &[usize]) {
        for &mesh in deformed {
            self.0[mesh] = Arc::new(Bottom::build_all(&scene.meshes[mesh]));
        }
    }

    /// Returns the bytes of the trees and of the corners they hold.
    pub(crate) fn bytes(&self) -> u64 {
        let of = |b: &Arc<Bottom>| size_of_val(&b.nodes[..]) + size_of_val(&b.corners[..]) + size_of_val(&b.order[..]);
        self.0.iter().map(|b| of(b) as u64).sum()
    }
}

/// A tree over instances that move.
#[derive(Debug, Default)]
pub(crate) struct MovingTop(TwoLevel);

impl MovingTop {
    /// Builds the tree over all instances that rays can enter.
    pub(crate) fn build(bottoms: &Bottoms, scene: &Scene) -> MovingTop {
        // Instances in one place now may part later, so that none is left out as a repetition.
        let all = (0..scene.instances.len()).collect();
        MovingTop(TwoLevel::over_instances(bottoms.0.clone(), scene, all, Padding::AsRaysNeed))
    }

    /// Moves the boxes to where the instances are and keeps the tree. Returns whether that was possible: if rays can
    /// enter other instances than when the tree was built, it is rebuilt.
    pub(crate) fn refit(&mut self, bottoms: &Bottoms, scene: &Scene) -> bool {
        match self.placed(bottoms, scene) {
            None => {
                *self = MovingTop::build(bottoms, scene);
                false
            }
            Some(placed) => {
                let (entries, boxes): (Vec<Entry>, Vec<Bounds>) = placed.into_iter().unzip();
                let around = |items: std::ops::Range<usize>| {
                    boxes[items].iter().fold(Bounds::EMPTY, |all, bounds| all.union(bounds))
                };
                refit(&mut self.0.top, around);
                self.0.reach = boxes.iter().map(largest_coordinate).fold(0.0, f64::max);
                self.0.depth[1] = bottoms.0.iter().map(|b| b.depth).max().unwrap_or(0);
                (self.0.entries, self.0.bottom) = (entries, bottoms.0.clone());
                true
            }
        }
    }

    /// Returns the entries in the order of the tree with their boxes; `None` if these are not all instances that rays can
    /// enter now.
    fn placed(&self, bottoms: &Bottoms, scene: &Scene) -> Option<Vec<(Entry, Bounds)>> {
        let of = |i: usize| Entry::of(i, &scene.instances[i], &bottoms.0, self.0.scale, Padding::AsRaysNeed);
        let placed: Option<Vec<(Entry, Bounds)>> =
            self.0.entries.par_iter().map(|entry| of(entry.instance as usize)).collect();
        let is_known = |known: &Vec<(Entry, Bounds)>| {
            known.len() == scene.instances.len() || {
                let mut entered = vec![false; scene.instances.len()];
                known.iter().for_each(|(entry, _)| entered[entry.instance as usize] = true);
                entered.iter().enumerate().all(|(i, entered)| *entered || of(i).is_none())
            }
        };
        placed.filter(is_known)
    }

    /// Returns both levels, to trace through.
    pub(crate) fn trees(&self) -> &TwoLevel {
        &self.0
    }

    /// Returns the bytes of the nodes and entries.
    pub(crate) fn bytes(&self) -> u64 {
        (size_of::<BoxNode>() * self.0.top.len() + size_of::<Entry>() * self.0.entries.len()) as u64
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3, Vec3Swizzles};

    use super::*;
    use crate::verify::cpu::{CpuTracer, Reference};
    use crate::verify::rays::Ray;
    use crate::verify::test_scenes::{Style, random_rays, random_scene, room};

    const STYLE: Style = Style { size: 1.0, offset: 0.0, on_grid: false, thin: false, wild: true };

    /// A scene whose instances have moved by their own ways.
    fn moved(scene: &Scene, by: f64) -> Scene {
        let mut moved = room();
        moved.clone_from(scene);
        for (i, instance) in moved.instances.iter_mut().enumerate() {
            let turn = DAffine3::from_rotation_y(by * (i as f64 + 1.0));
            instance.transform =
                DAffine3::from_translation(by * DVec3::new(i as f64, 1.0, -1.0)) * turn * instance.transform;
        }
        moved.boxes = Default::default();
        moved
    }

    fn assert_hits_as_built_anew(top: &MovingTop, scene: &Scene, rays: &[Ray]) {
        let fresh = TwoLevel::build(scene);
        assert_eq!(CpuTracer::new(top.trees()).closest(rays), CpuTracer::new(&fresh).closest(rays));
        assert_eq!(Reference::new(top.trees()).closest(rays), Reference::new(&fresh).closest(rays));
    }

    #[test]
    fn a_refitted_tree_is_hit_as_one_built_anew() {
        for seed in 0..12 {
            let start = random_scene(seed, STYLE);
            let bottoms = Bottoms::build(&start);
            let mut top = MovingTop::build(&bottoms, &start);
            let shape = |top: &MovingTop| top.trees().top.iter().map(|n| (n.first, n.count)).collect::<Vec<_>>();
            let built = shape(&top);
            for step in 1..4 {
                let scene = moved(&start, 0.7 * f64::from(step));
                assert!(top.refit(&bottoms, &scene), "all instances can still be entered");
                assert_eq!(shape(&top), built);
                assert_hits_as_built_anew(&top, &scene, &random_rays(seed, STYLE, 300));
            }
        }
    }

    #[test]
    fn an_instance_that_appears_or_vanishes_makes_a_refit_a_rebuild() {
        let whole = room();
        let mut flat = room();
        flat.instances[3].transform.matrix3.x_axis = DVec3::ZERO;
        let rays = random_rays(1, STYLE, 300);
        let bottoms = Bottoms::build(&whole);
        for (from, to) in [(&whole, &flat), (&flat, &whole)] {
            let mut top = MovingTop::build(&bottoms, from);
            assert!(!top.refit(&bottoms, to));
            assert_hits_as_built_anew(&top, to, &rays);
            assert!(top.refit(&bottoms, to));
        }
    }

    #[test]
    fn instances_in_one_place_may_part() {
        let mut start = room();
        start.instances[2].transform = start.instances[1].transform;
        let bottoms = Bottoms::build(&start);
        let mut top = MovingTop::build(&bottoms, &start);
        assert!(top.refit(&bottoms, &room()));
        assert_hits_as_built_anew(&top, &room(), &random_rays(2, STYLE, 300));
    }

    #[test]
    fn a_mesh_that_deforms_is_hit_where_it_is() {
        let start = room();
        let mut bent = room();
        for mesh in bent.meshes.iter_mut() {
            mesh.geometries
                .iter_mut()
                .for_each(|g| g.positions = g.positions.iter().map(|p| *p * 1.3 + p.yzx() * 0.2).collect());
            mesh.extent = Default::default();
        }
        let (rays, deformed) = (random_rays(3, STYLE, 300), [0, 1]);
        let (mut refitted, mut rebuilt) = (Bottoms::build(&start), Bottoms::build(&start));
        refitted.refit(&bent, &deformed);
        rebuilt.rebuild(&bent, &deformed);
        for bottoms in [&refitted, &rebuilt] {
            let mut top = MovingTop::build(&Bottoms::build(&start), &start);
            assert!(top.refit(bottoms, &bent));
            assert_hits_as_built_anew(&top, &bent, &rays);
        }
    }

    #[test]
    fn nothing_may_move() {
        let nothing = Scene::default();
        let mut top = MovingTop::build(&Bottoms::build(&nothing), &nothing);
        assert!(top.refit(&Bottoms::default(), &nothing));
        assert_eq!((top.bytes(), Bottoms::default().bytes()), (0, 0));
    }
}
