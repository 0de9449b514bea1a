//! A scene with copies of a model that move.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::{Animation, PlacedCopies, Playing, Rig};
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::{Bounds, Instance, Known, Mesh, MeshId, Scene};

/// A scene at a time. The instances of the scene itself come first and stay, unless an animation of its own
/// plays; those of the copies follow, copy by copy.
#[derive(Clone, Debug)]
pub struct MovingScene {
    scene: Scene,
    /// Number of instances of the scene itself.
    still: usize,
    /// The model's instances, about its centre and in its size among the copies.
    model: Vec<DAffine3>,
    positions: Vec<DVec3>,
    animations: Vec<Animation>,
    /// What moves of the scene itself.
    playing: Option<Playing>,
    /// The meshes that deform.
    deforming: Vec<usize>,
}

impl MovingScene {
    /// Adds copies of a model to a scene, at time 0. Each copy is scaled so that the diagonal of the model's box is
    /// `size` scene units long. Without copies, the scene stays as it is.
    pub fn new(scene: &Scene, model: &Scene, size: f64, copies: PlacedCopies) -> MovingScene {
        let bounds = model.bounds();
        let still = scene.instances.len();
        let about_center = about_center(&bounds, size);
        let mut moving = MovingScene {
            scene: scene.clone(),
            still,
            model: model.instances.iter().map(|instance| about_center * instance.transform).collect(),
            positions: copies.positions,
            animations: copies.animations,
            playing: None,
            deforming: Vec::new(),
        };
        let first_mesh = moving.add_meshes(model);
        let copied = |instance: &Instance| Instance {
            mesh: MeshId(first_mesh + instance.mesh.0),
            node: moving.scene.nodes as u32,
            ..instance.clone()
        };
        let of_copy: Vec<Instance> = model.instances.iter().map(copied).collect();
        for _ in &moving.positions {
            moving.scene.instances.extend_from_slice(&of_copy);
        }
        moving.advance(0.0);
        moving
    }

    /// Adds the meshes of a model with their materials and images, and returns the index of the first mesh.
    fn add_meshes(&mut self, model: &Scene) -> u32 {
        let first = self.scene.meshes.len() as u32;
        let (materials, images) = (self.scene.materials.len() as u32, self.scene.images.len() as u32);
        for mesh in &model.meshes {
            let mut mesh = Mesh { source: Mesh::ELSEWHERE, ..mesh.clone() };
            for geometry in &mut mesh.geometries {
                geometry.material = geometry.material.map(|material| material + materials);
                if let Some(texture) = geometry.alpha.as_mut().and_then(|alpha| alpha.texture.as_mut()) {
                    texture.image += images;
                }
            }
            self.scene.meshes.push(mesh);
        }
        self.scene.materials.extend(model.materials.iter().cloned());
        self.scene.images.extend(model.images.iter().cloned());
        first
    }

    /// Lets an animation of the scene play too, which moves the instances that `place` returns, see [`Playing::new`]. The
    /// time becomes 0.
    pub fn play(&mut self, rig: Rig, place: impl Fn(u32) -> Option<u32>) {
        let playing = Playing::new(rig, &mut self.scene, place);
        self.deforming = playing.deforming();
        self.playing = Some(playing);
        self.advance(0.0);
    }

    /// Moves everything to its place at a time in seconds.
    pub fn advance(&mut self, time: f64) {
        let MovingScene { scene, still, model, positions, animations, playing, .. } = self;
        let per_copy = model.len().max(1);
        scene.instances[*still..].par_chunks_mut(per_copy).enumerate().with_min_len(CHEAP_ELEMENTS).for_each(
            |(copy, instances)| {
                let motion = animations.get(copy).map_or(DAffine3::IDENTITY, |animation| animation.motion(time));
                let to_world = DAffine3::from_translation(positions[copy]) * motion;
                for (instance, place) in instances.iter_mut().zip(&*model) {
                    instance.transform = to_world * *place;
                }
            },
        );
        playing.iter().for_each(|playing| playing.advance(scene, time));
        scene.boxes = Known::default();
        scene.core = Known::default();
    }

    /// Returns the scene at the time of the last [`MovingScene::advance`].
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the meshes that deform.
    pub fn deforming(&self) -> &[usize] {
        &self.deforming
    }

    /// Returns the number of instances that can move or deform.
    pub fn moving_instances(&self) -> usize {
        let playing = self.playing.as_ref().map_or(0, |playing| playing.instances().count());
        self.animations.len() * self.model.len() + playing
    }
}

/// Returns what moves the centre of a box to the origin and scales its diagonal to a size; a point is only moved.
fn about_center(bounds: &Bounds, size: f64) -> DAffine3 {
    if bounds.is_empty() {
        return DAffine3::IDENTITY;
    }
    let scale = size / bounds.diagonal();
    let scale = if scale.is_finite() { scale } else { 1.0 };
    DAffine3::from_scale(DVec3::splat(scale)) * DAffine3::from_translation(-bounds.center())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Crowd, Deviating};
    use crate::verify::test_scenes::{cube, room, scene};

    fn model() -> Scene {
        let at = |x: f64| DAffine3::from_translation(DVec3::X * x);
        scene(vec![cube(0, Some(1))], &[(0, at(10.0)), (0, at(14.0))])
    }

    fn copies(count: usize) -> PlacedCopies {
        let speed = Deviating { base: 1.0, deviation: 0.0 };
        let turns = Deviating::default();
        let crowd = Crowd { copies: count, animated: count / 2, speed, distance: speed, turns, seed: 1 };
        crowd.place(&room().bounds())
    }

    #[test]
    fn copies_stand_about_their_homes_in_their_size() {
        let placed = copies(4);
        let moving = MovingScene::new(&room(), &model(), 0.5, placed.clone());
        let scene = moving.scene();
        scene.check().expect("a sound scene");
        assert_eq!((scene.instances.len(), scene.meshes.len()), (6 + 8, 3));
        assert_eq!(scene.meshes[2].geometries[0].material, Some(room().materials.len() as u32 + 1));
        let boxes = scene.instance_boxes();
        // The third copy is not animated.
        let copy = boxes[6 + 4].union(&boxes[6 + 5]);
        assert!(copy.center().distance(placed.positions[2]) < 1e-12 && (copy.diagonal() - 0.5).abs() < 1e-12);
        assert_eq!(moving.moving_instances(), 4);
    }

    #[test]
    fn only_the_animated_copies_move_and_a_time_is_always_the_same() {
        let mut moving = MovingScene::new(&room(), &model(), 0.5, copies(4));
        let places = |moving: &MovingScene| moving.scene().instances.iter().map(|i| i.transform).collect::<Vec<_>>();
        let start = places(&moving);
        moving.advance(0.3);
        let later = places(&moving);
        let moved: Vec<bool> = start.iter().zip(&later).map(|(a, b)| a != b).collect();
        assert_eq!(moved, [vec![false; 6], vec![true; 4], vec![false; 4]].concat());
        let box_then = moving.scene().instance_boxes()[6];
        moving.advance(2.0);
        assert_ne!(moving.scene().instance_boxes()[6], box_then, "boxes follow");
        moving.advance(0.3);
        assert_eq!(places(&moving), later);
    }

    #[test]
    fn without_copies_or_triangles_nothing_is_added() {
        let alone = MovingScene::new(&room(), &model(), 0.5, PlacedCopies::default());
        assert_eq!(alone.scene().instances.len(), 6);
        let empty = MovingScene::new(&Scene::default(), &Scene::default(), 1.0, copies(3));
        assert!(empty.scene().instances.is_empty());
    }
}
