//! Bakes all instances of a mesh, or none.
//!
//! For a mesh that several instances place, either all unpinned instances are baked or none: cheapest meshes first, by
//! the predicted bytes that their copies add, as long as the limits hold.

use super::{Fate, MOST_COPIED_TRIANGLES, MOST_TRIANGLES, Selection, input_bytes, placed_bytes};
use crate::cost::bytes;
use crate::layout::{Layout, Limit, Note};
use crate::methods::InstanceOptions;
use crate::scene::{Instance, Scene};

/// Runs a method on as many instances as the limits allow. The predicted bytes of its actual result decide: if they
/// exceed the limit although the estimate did not, the most expensive meshes are left instanced and the method runs
/// again.
pub(super) fn run(scene: &Scene, options: &InstanceOptions, method: impl Fn(&Selection) -> Layout) -> Layout {
    let candidates = candidates(scene);
    let most_bytes = options.max_bytes_ratio.map_or(f64::INFINITY, |ratio| ratio * input_bytes(scene) as f64);
    let within_memory = prefix(&candidates, |sum| sum.fits_memory());
    let mut chosen = prefix(&candidates[..within_memory], |sum| {
        sum.extra_bytes == 0 || (placed_bytes(scene).saturating_add(sum.extra_bytes)) as f64 <= most_bytes
    });
    loop {
        let mut layout = method(&select(scene, &candidates[..chosen]));
        let excess = layout.as_bytes(scene) as f64 - most_bytes;
        let fewer = without_excess(&candidates[..chosen], excess);
        if fewer == chosen {
            layout.notes.extend(note(&candidates[chosen..within_memory], Limit::Bytes));
            layout.notes.extend(note(&candidates[within_memory..], Limit::Triangles));
            return layout;
        }
        chosen = fewer;
    }
}

/// A mesh whose instances could be baked.
struct Candidate {
    mesh: u32,
    /// Instances that are not pinned.
    instances: u64,
    /// Whether another instance places the mesh too.
    shared: bool,
    /// Triangles that those instances place.
    triangles: u64,
    /// Predicted bytes added by baking them.
    extra_bytes: u64,
}

/// Returns the candidates of a scene, cheapest first, ties in mesh order.
fn candidates(scene: &Scene) -> Vec<Candidate> {
    let mut counts = vec![(0u64, 0u64); scene.meshes.len()];
    for instance in &scene.instances {
        let (free, pinned) = &mut counts[instance.mesh.0 as usize];
        *if instance.pinned.is_some() { pinned } else { free } += 1;
    }
    let mut candidates: Vec<Candidate> = (0u32..)
        .zip(scene.meshes.iter())
        .zip(counts)
        .filter(|(_, (free, _))| *free > 0)
        .map(|((mesh, of), (free, pinned))| {
            let triangles = of.triangle_count() as u64;
            let copies = if pinned > 0 { free } else { free - 1 };
            Candidate {
                mesh,
                instances: free,
                shared: free + pinned > 1,
                triangles: triangles.saturating_mul(free),
                extra_bytes: bytes::blas(triangles).saturating_mul(copies),
            }
        })
        .collect();
    candidates.sort_by_key(|c| (c.extra_bytes, c.mesh));
    candidates
}

/// Totals of the first candidates.
#[derive(Default)]
struct Sum {
    triangles: u64,
    copied_triangles: u64,
    extra_bytes: u64,
}

impl Sum {
    fn add(&mut self, candidate: &Candidate) {
        self.triangles = self.triangles.saturating_add(candidate.triangles);
        if candidate.shared {
            self.copied_triangles = self.copied_triangles.saturating_add(candidate.triangles);
        }
        self.extra_bytes = self.extra_bytes.saturating_add(candidate.extra_bytes);
    }

    fn fits_memory(&self) -> bool {
        self.triangles <= MOST_TRIANGLES && self.copied_triangles <= MOST_COPIED_TRIANGLES
    }
}

/// Returns how many candidates can be taken before their sum no longer fits.
fn prefix(candidates: &[Candidate], fits: impl Fn(&Sum) -> bool) -> usize {
    let mut sum = Sum::default();
    let too_much = candidates.iter().position(|candidate| {
        sum.add(candidate);
        !fits(&sum)
    });
    too_much.unwrap_or(candidates.len())
}

/// Returns how many candidates remain after dropping the last ones until they save `excess` bytes: all of them if there
/// is no excess or nothing can be saved.
fn without_excess(chosen: &[Candidate], excess: f64) -> usize {
    let (mut left, mut saved) = (chosen.len(), 0.0);
    // Drop at least half of those that cost bytes at once, so that the method runs only a few times.
    let half = chosen.iter().filter(|c| c.extra_bytes > 0).count().div_ceil(2);
    while left > 0 && chosen[left - 1].extra_bytes > 0 && excess > 0.0 {
        if saved >= excess && chosen.len() - left >= half {
            break;
        }
        left -= 1;
        saved += chosen[left].extra_bytes as f64;
    }
    left
}

fn select(scene: &Scene, chosen: &[Candidate]) -> Selection {
    let mut by_mesh = vec![false; scene.meshes.len()];
    chosen.iter().for_each(|c| by_mesh[c.mesh as usize] = true);
    let is_baked = |i: &Instance| i.pinned.is_none() && by_mesh[i.mesh.0 as usize];
    let fates = scene.instances.iter().map(|i| if is_baked(i) { Fate::Bake } else { Fate::Keep }).collect();
    Selection { fates, pieces: vec![Vec::new(); scene.meshes.len()] }
}

fn note(left: &[Candidate], limit: Limit) -> Option<Note> {
    let instances: u64 = left.iter().map(|c| c.instances).sum();
    (instances > 0).then_some(Note::BeyondLimit { instances, meshes: left.len(), limit })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::methods::PartOptions;
    use crate::methods::instancing::Known;
    use crate::methods::single::single;
    use crate::scene::Pinned;
    use glam::{DAffine3, Vec3};

    /// Two meshes of 100 and 1,000 triangles, placed three times each, and one of 50 placed once.
    fn instanced() -> SceneBuilder {
        let mut builder = SceneBuilder::default();
        for (name, count) in [("large", 1000), ("small", 100)] {
            let mesh = builder.mesh(name, vec![(0, row(Vec3::ZERO, count))]);
            (0..3).for_each(|y| drop(builder.place(mesh, name, at(0.0, f64::from(y), 0.0)).name.clone()));
        }
        builder.object("floor", 0, row(Vec3::ZERO, 50));
        builder
    }

    fn run_single(scene: &Scene, max_bytes_ratio: Option<f64>) -> Layout {
        let instances = InstanceOptions { max_bytes_ratio, ..InstanceOptions::default() };
        single(scene, &instances, &PartOptions::default(), &Known::default())
    }

    fn with_ratio(scene: &Scene, ratio: f64) -> Layout {
        let layout = run_single(scene, Some(ratio));
        assert_eq!(layout.check(scene), Ok(()));
        layout
    }

    #[test]
    fn without_a_limit_every_instance_is_baked() {
        let scene = instanced().scene();
        let layout = run_single(&scene, None);
        assert_eq!(group_names(&layout), ["baked scene"]);
        assert!(layout.notes.is_empty());
    }

    #[test]
    fn the_cheapest_meshes_are_baked_first() {
        let scene = instanced().scene();
        let layout = with_ratio(&scene, 1.3);
        assert_eq!(group_names(&layout), ["kept large", "baked scene"]);
        assert_eq!(group_sizes(&scene, &layout), [1000, 350]);
        assert_eq!(
            layout.notes[0].to_string(),
            "3 instances of 1 mesh stay as they are: the bytes allowed would be exceeded"
        );
    }

    #[test]
    fn a_mesh_placed_once_is_restructured_whatever_the_limit() {
        let scene = instanced().scene();
        for ratio in [0.0, -1.0, f64::NAN] {
            let layout = with_ratio(&scene, ratio);
            assert_eq!(group_sizes(&scene, &layout), [1000, 100, 50], "{ratio}");
            assert_eq!(layout.notes, [Note::BeyondLimit { instances: 6, meshes: 2, limit: Limit::Bytes }]);
        }
    }

    #[test]
    fn the_result_stays_within_the_limit_although_the_estimate_does() {
        let scene = instanced().scene();
        let input = input_bytes(&scene) as f64;
        for ratio in [1.0, 1.1, 1.2, 1.5, 2.0, 2.5, 3.0] {
            let bytes = with_ratio(&scene, ratio).as_bytes(&scene) as f64;
            assert!(bytes <= ratio * input, "{bytes} of {input} at {ratio}");
        }
    }

    #[test]
    fn a_pinned_instance_makes_every_other_one_a_copy() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("mesh", vec![(0, row(Vec3::ZERO, 10))]);
        builder.place(mesh, "pinned", DAffine3::IDENTITY).pinned = Some(Pinned::Animated);
        builder.place(mesh, "free", DAffine3::IDENTITY);
        let candidates = candidates(&builder.scene());
        assert_eq!(candidates[0].extra_bytes, bytes::blas(10));
        assert!(candidates[0].shared);
    }

    #[test]
    fn a_small_file_of_very_many_triangles_stays_instanced() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("mesh", vec![(0, row(Vec3::ZERO, 10_000))]);
        (0..10_000).for_each(|_| drop(builder.place(mesh, "copy", DAffine3::IDENTITY).name.clone()));
        let scene = builder.scene();
        let layout = run_single(&scene, None);
        assert_eq!(group_names(&layout), ["kept mesh"]);
        assert_eq!(
            layout.notes[0].to_string(),
            "10000 instances of 1 mesh stay as they are: too many triangles would have to be written out"
        );
    }
}
