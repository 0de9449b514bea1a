//! Whether what moves can be refitted: each animation is sampled, and trees that were built at its start and refitted are
//! held against trees built anew.
//!
//! The measure is the surface area heuristic of both trees at the same time (J. Goldsmith, J. Salmon, "Automatic Creation of
//! Object Hierarchies for Ray Tracing", 1987), as C. Lauterbach, S. Yoon, D. Tuft, D. Manocha, "RT-DEFORM: Interactive Ray
//! Tracing of Dynamic Scenes using BVHs", 2006, use it to decide when to rebuild. Which build flags follow: A. Dunn, "Tips and
//! Tricks: Ray Tracing Best Practices", NVIDIA, 2019.

use raykiln_formats::{Document, Error};
use serde::Serialize;

use super::{MovingScene, PlacedCopies, Rig};
use crate::cost::sah::{INTERSECTION, TRAVERSAL};
use crate::cost::two_level::INSTANCE_ENTRY;
use crate::scene::{Bounds, Mesh, Scene};
use crate::tree::{Quality, Tree};

/// Times at which an animation is sampled.
pub const SAMPLES: u32 = 8;

/// A refitted tree is worth rebuilding once it costs so many times a new one.
pub const WORTH_REBUILDING: f64 = 1.1;

/// What an animation does to acceleration structures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Advice {
    /// Name of the animation, or its number.
    pub animation: String,
    /// Duration in seconds.
    pub seconds: f64,
    /// Instances that move as a whole.
    pub moving_instances: u64,
    /// The TLAS.
    pub tlas: Ageing,
    /// The BLASes of instances that deform, worst first; at most [`MOST_LISTED`].
    pub blases: Vec<BlasAgeing>,
    /// Number of instances that deform.
    pub deforming_instances: u64,
}

/// Largest number of BLASes listed.
pub const MOST_LISTED: usize = 8;

/// A BLAS that deforms.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlasAgeing {
    /// The instance that places it.
    pub object: String,
    /// How it ages.
    #[serde(flatten)]
    pub ageing: Ageing,
}

/// How a structure that is only refitted ages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Ageing {
    /// Largest surface area of its box over that at the start.
    pub box_growth_ratio: f64,
    /// Largest cost over that of a structure built anew; at least 1, lower is better.
    pub cost_over_fresh_ratio: f64,
    /// First sampled time at which a rebuild pays, in seconds; `None` if refitting will do.
    pub rebuild_after_seconds: Option<f64>,
    /// What to build it with.
    pub flags: Flags,
}

/// Build flags of a structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum Flags {
    /// Refitted in each frame, except when a rebuild is due, and traced by many rays.
    #[default]
    #[serde(rename = "fast-trace, allow-update")]
    FastTraceUpdate,
    /// Rebuilt in each frame, as a TLAS is best.
    #[serde(rename = "fast-trace")]
    FastTrace,
    /// Rebuilt in each frame, because it changes too much to be refitted.
    #[serde(rename = "fast-build")]
    FastBuild,
}

impl Flags {
    /// Returns the name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Flags::FastTraceUpdate => "fast-trace, allow-update",
            Flags::FastTrace => "fast-trace",
            Flags::FastBuild => "fast-build",
        }
    }
}

/// Number of animations advised on.
pub const MOST_ANIMATIONS: usize = 16;

/// Advises on the first animations of a document, those that move something in its scene.
///
/// # Errors
/// See [`Document::contents`].
pub fn advise(doc: &Document, scene: &Scene) -> Result<Vec<Advice>, Error> {
    let mut all = Vec::new();
    for (number, animation) in doc.animations().into_iter().take(MOST_ANIMATIONS).enumerate() {
        if let Some(rig) = Rig::of(doc, scene, animation)? {
            all.push(of_rig(rig, scene, number));
        }
    }
    Ok(all)
}

/// Samples an animation.
fn of_rig(rig: Rig, scene: &Scene, number: usize) -> Advice {
    let animation = if rig.name.is_empty() { format!("animation {number}") } else { rig.name.clone() };
    let (seconds, moving, bodies) = (rig.seconds, rig.placed().count(), rig.deforming().collect::<Vec<u32>>());
    let mut moving_scene = MovingScene::new(scene, &Scene::default(), 1.0, PlacedCopies::default());
    moving_scene.play(rig, Some);
    let mut top = Sampled::new(of_instances(moving_scene.scene()), Quality::Instances);
    let mut meshes: Vec<Sampled> = moving_scene
        .deforming()
        .iter()
        .map(|&m| Sampled::new(of_mesh(&moving_scene.scene().meshes[m]), Quality::Medium))
        .collect();
    for sample in 1..SAMPLES {
        let time = seconds * f64::from(sample) / f64::from(SAMPLES);
        moving_scene.advance(time);
        let now = moving_scene.scene();
        top.sample(time, &of_instances(now));
        for (mesh, sampled) in moving_scene.deforming().iter().zip(&mut meshes) {
            sampled.sample(time, &of_mesh(&now.meshes[*mesh]));
        }
    }
    let blas = |(instance, sampled): (&u32, &Sampled)| BlasAgeing {
        object: scene.instances[*instance as usize].display_name(),
        ageing: sampled.ageing(Flags::FastBuild),
    };
    let mut blases: Vec<BlasAgeing> = bodies.iter().zip(&meshes).map(blas).collect();
    blases.sort_by(|a, b| b.ageing.cost_over_fresh_ratio.total_cmp(&a.ageing.cost_over_fresh_ratio));
    blases.truncate(MOST_LISTED);
    Advice {
        animation,
        seconds,
        moving_instances: moving as u64,
        tlas: top.ageing(Flags::FastTrace),
        blases,
        deforming_instances: bodies.len() as u64,
    }
}

fn of_instances(scene: &Scene) -> Vec<Bounds> {
    scene.instance_boxes().to_vec()
}

fn of_mesh(mesh: &Mesh) -> Vec<Bounds> {
    (0..mesh.triangle_count() as u32).map(|t| Bounds::of(mesh.corners(t).map(|p| p.as_dvec3()))).collect()
}

/// A tree built at the start of an animation.
struct Sampled {
    tree: Tree,
    quality: Quality,
    /// Surface area of the box at the start.
    area: f64,
    growth: f64,
    /// Largest cost over that of a new tree.
    worst: f64,
    /// When that exceeded [`WORTH_REBUILDING`] first.
    due: Option<f64>,
    /// Whether that was at the first sample.
    is_due_at_once: bool,
    samples: u32,
}

impl Sampled {
    fn new(boxes: Vec<Bounds>, quality: Quality) -> Sampled {
        let tree = Tree::build_usable(&boxes, quality);
        Sampled {
            area: area_of(&boxes),
            tree,
            quality,
            growth: 1.0,
            worst: 1.0,
            due: None,
            is_due_at_once: false,
            samples: 0,
        }
    }

    /// Holds the refitted tree against a new one.
    fn sample(&mut self, time: f64, boxes: &[Bounds]) {
        let growth = area_of(boxes) / self.area;
        self.growth = self.growth.max(if growth.is_finite() { growth } else { 1.0 });
        let fresh = Tree::build_usable(boxes, self.quality);
        let ratio = cost(&self.tree, boxes, self.quality) / cost(&fresh, boxes, self.quality);
        if ratio.is_finite() {
            self.worst = self.worst.max(ratio);
            if ratio > WORTH_REBUILDING && self.due.is_none() {
                self.due = Some(time);
                self.is_due_at_once = self.samples == 0;
            }
        }
        self.samples += 1;
    }

    /// Returns how it ages; `rebuilt` are the flags if it is best rebuilt in each frame.
    fn ageing(&self, rebuilt: Flags) -> Ageing {
        Ageing {
            box_growth_ratio: self.growth,
            cost_over_fresh_ratio: self.worst,
            rebuild_after_seconds: self.due,
            flags: if self.is_due_at_once { rebuilt } else { Flags::FastTraceUpdate },
        }
    }
}

fn area_of(boxes: &[Bounds]) -> f64 {
    boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(b)).area()
}

/// Returns the cost of a tree over boxes: areas of nodes times what they cost, of an instance or of a triangle in a leaf.
fn cost(tree: &Tree, boxes: &[Bounds], quality: Quality) -> f64 {
    let per_item = if quality == Quality::Instances { INSTANCE_ENTRY } else { INTERSECTION };
    let nodes = tree.bounds(boxes);
    let of_node = |(node, bounds): (&crate::tree::Node, &Bounds)| match node.count {
        0 => TRAVERSAL * bounds.area(),
        count => per_item * f64::from(count) * bounds.area(),
    };
    tree.nodes.iter().zip(&nodes).map(of_node).sum()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Boxes of side 1 whose centres are at places on a line.
    fn at(places: &[f64]) -> Vec<Bounds> {
        places.iter().map(|x| Bounds { min: DVec3::new(*x, 0.0, 0.0), max: DVec3::new(x + 1.0, 1.0, 1.0) }).collect()
    }

    #[test]
    fn a_tree_whose_boxes_change_places_is_worth_rebuilding_and_one_that_moves_as_a_whole_is_not() {
        let start: Vec<f64> = (0..16).map(|i| 3.0 * f64::from(i)).collect();
        let shuffled: Vec<f64> = (0..16).map(|i| 3.0 * f64::from(7 * i % 16)).collect();
        let shifted: Vec<f64> = start.iter().map(|x| x + 100.0).collect();
        let aged = |places: &[f64]| {
            let mut sampled = Sampled::new(at(&start), Quality::Instances);
            sampled.sample(0.5, &at(&start));
            sampled.sample(1.5, &at(places));
            sampled.ageing(Flags::FastTrace)
        };
        let kept = aged(&shifted);
        assert_eq!((kept.rebuild_after_seconds, kept.flags), (None, Flags::FastTraceUpdate));
        assert!((kept.cost_over_fresh_ratio - 1.0).abs() < 0.05 && kept.box_growth_ratio < 1.01, "{kept:?}");
        let lost = aged(&shuffled);
        assert_eq!((lost.rebuild_after_seconds, lost.flags), (Some(1.5), Flags::FastTraceUpdate));
        let mut at_once = Sampled::new(at(&start), Quality::Instances);
        at_once.sample(0.5, &at(&shuffled));
        let at_once = at_once.ageing(Flags::FastTrace);
        assert_eq!((at_once.rebuild_after_seconds, at_once.flags), (Some(0.5), Flags::FastTrace));
        assert!(lost.cost_over_fresh_ratio > 1.3, "{lost:?}");
        let grown = aged(&start.iter().map(|x| 2.0 * x).collect::<Vec<_>>());
        assert!(grown.box_growth_ratio > 1.9 && grown.rebuild_after_seconds.is_none(), "{grown:?}");
    }

    #[test]
    fn nothing_needs_no_rebuild() {
        let mut sampled = Sampled::new(Vec::new(), Quality::Medium);
        sampled.sample(1.0, &[]);
        assert_eq!(sampled.ageing(Flags::FastBuild).cost_over_fresh_ratio, 1.0);
    }
}
