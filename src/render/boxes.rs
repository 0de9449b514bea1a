//! Boxes of instances, or of a level of the tree, as wires: the third view of T. Bilák's thesis (2024, section 4.2).
//!
//! As there, a mask selects what is visible: the scene (what is placed once), the instances (what is placed more than
//! once) and the boxes. Wires behind a surface are drawn faintly.

use glam::{DAffine3, DVec3, Vec3};

use super::colour::{encoded, of_hue};
use super::flat::{BACKGROUND, facing};
use super::frame::{Frame, Sample};
use super::palette;
use super::probe::{Probe, Tracing};
use super::surface::Spot;
use super::wires::{Canvas, Wire};
use super::{Picture, RenderError, RenderOptions, Renderer, Statistics};
use crate::scene::{Bounds, Scene};
use crate::verify::DeviceError;
use crate::verify::cpu::LevelBox;

/// Largest number of boxes in a picture: more could not be told apart.
pub const MOST_BOXES: usize = 200_000;
/// Light of surfaces of the scene, and the share of an instance's colour in its light.
const GREY: Vec3 = Vec3::splat(0.62);
const TINT: f32 = 0.5;

/// What [`View::Boxes`](super::View::Boxes) makes visible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Masks {
    /// Surfaces of meshes that are placed once.
    pub scene: bool,
    /// Boxes.
    pub boxes: bool,
    /// Surfaces of meshes that are placed more than once.
    pub instances: bool,
}

impl Default for Masks {
    fn default() -> Masks {
        Masks { scene: true, boxes: true, instances: true }
    }
}

/// Draws the visible surfaces and, over them, the wires of boxes.
///
/// # Errors
/// [`RenderError::Boxes`] if there are too many, or the device fails.
pub(super) fn picture(
    renderer: &Renderer,
    frame: &Frame,
    tracing: &Tracing,
    options: &RenderOptions,
) -> Result<Picture, RenderError> {
    let boxes = if options.masks.boxes { boxes(renderer, options.depth)? } else { Vec::new() };
    let (mut picture, depths) = surfaces(renderer, frame, tracing, options.masks)?;
    picture.statistics.boxes = Some(boxes.len() as u64);
    let mut canvas = Canvas { sight: &frame.sight, picture: &mut picture, depths: &depths };
    for (placed, colour) in &boxes {
        let colour = encoded(*colour);
        edges(&placed.bounds, &placed.to_world).into_iter().for_each(|ends| canvas.draw(&Wire { ends, colour }));
    }
    Ok(picture)
}

/// Returns the boxes to be drawn, with their colours.
fn boxes(renderer: &Renderer, depth: Option<u32>) -> Result<Vec<(LevelBox, Vec3)>, RenderError> {
    let scene = renderer.scene;
    let Some(depth) = depth else {
        if scene.instances.len() > MOST_BOXES {
            return Err(RenderError::Boxes { count: scene.instances.len(), depth: None });
        }
        let placed = scene.instance_boxes().iter().map(|&bounds| LevelBox { bounds, to_world: DAffine3::IDENTITY });
        return Ok(placed.zip(palette::of_instances(scene)).collect());
    };
    let found = renderer.accel.boxes_at(depth, MOST_BOXES + 1);
    if found.len() > MOST_BOXES {
        return Err(RenderError::Boxes { count: found.len(), depth: Some(depth) });
    }
    // Steps of the golden ratio leave hues of consecutive boxes far apart.
    let colour = |i: usize| of_hue(0.62, 0.15, (i as f32 * 0.618_034).fract());
    Ok(found.into_iter().enumerate().map(|(i, placed)| (placed, colour(i))).collect())
}

/// Draws the visible surfaces, and returns how far in front of the camera they are: infinitely far where there are none.
fn surfaces(
    renderer: &Renderer,
    frame: &Frame,
    tracing: &Tracing,
    masks: Masks,
) -> Result<(Picture, Vec<f32>), DeviceError> {
    let scene = renderer.scene;
    let colours = palette::of_groups(scene);
    let shown = shown(scene, masks);
    let to_camera = frame.sight.to_camera();
    let of_sample = |probe: &mut Probe, sample: &Sample| {
        let hit = probe.closest(&sample.ray, |hit| shown[hit.instance as usize].is_some())?;
        let spot = Spot::of(scene, &sample.ray, &hit);
        let tint = if shown[hit.instance as usize] == Some(true) { TINT } else { 0.0 };
        let colour = GREY.lerp(colours[hit.instance as usize], tint) * facing(&spot, sample.ray.direction);
        Some((colour, -to_camera.transform_point3(spot.point).z as f32))
    };
    let of_pixel = |samples: &mut dyn Iterator<Item = Option<(Vec3, f32)>>| {
        let (mut sum, mut hits, mut depth) = (Vec3::ZERO, 0u32, f32::INFINITY);
        for seen in samples {
            let (colour, at) = seen.unwrap_or((BACKGROUND, f32::INFINITY));
            (sum, hits, depth) = (sum + colour, hits + u32::from(seen.is_some()), depth.min(at));
        }
        (encoded(sum / frame.samples as f32), hits, depth)
    };
    let of_pixels = frame.each(tracing, of_sample, of_pixel)?;
    let statistics = Statistics {
        seen_ratio: frame.seen_ratio(of_pixels.iter().map(|(_, hits, _)| *hits)),
        ..Statistics::default()
    };
    let depths = of_pixels.iter().map(|(.., depth)| *depth).collect();
    Ok((Picture::of(frame.size, of_pixels.into_iter().map(|(colour, ..)| colour).collect(), statistics), depths))
}

/// Returns for each visible instance whether its mesh is placed more than once; `None` for the others.
fn shown(scene: &Scene, masks: Masks) -> Vec<Option<bool>> {
    let mut placed = vec![0u32; scene.meshes.len()];
    scene.instances.iter().for_each(|instance| placed[instance.mesh.0 as usize] += 1);
    let of_instance = |mesh: usize| {
        let is_shared = placed[mesh] > 1;
        Some(is_shared).filter(|_| if is_shared { masks.instances } else { masks.scene })
    };
    scene.instances.iter().map(|instance| of_instance(instance.mesh.0 as usize)).collect()
}

/// Returns the ends of the twelve edges of a box in the world; none of an empty box.
fn edges(bounds: &Bounds, to_world: &DAffine3) -> Vec<[DVec3; 2]> {
    if bounds.is_empty() || !bounds.min.is_finite() || !bounds.max.is_finite() {
        return Vec::new();
    }
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 1 { bounds.max[axis] } else { bounds.min[axis] };
        to_world.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
    };
    let of_corner = |i: usize| (0..3).filter(move |axis| i >> axis & 1 == 0).map(move |axis| [i, i | 1 << axis]);
    (0..8).flat_map(of_corner).map(|ends| ends.map(corner)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_twelve_edges_of_its_own_lengths() {
        let bounds = Bounds { min: DVec3::ZERO, max: DVec3::new(1.0, 2.0, 4.0) };
        let mut lengths: Vec<f64> = edges(&bounds, &DAffine3::IDENTITY).iter().map(|[a, b]| a.distance(*b)).collect();
        lengths.sort_by(f64::total_cmp);
        assert_eq!(lengths, [[1.0; 4], [2.0; 4], [4.0; 4]].concat());
        assert!(edges(&Bounds::EMPTY, &DAffine3::IDENTITY).is_empty());
    }
}
