//! The number of instance boxes around what is seen: each of them is entered by rays that start there.

use super::colour::{Rgb, encoded};
use super::flat::BACKGROUND;
use super::frame::{Frame, Sample};
use super::legend;
use super::probe::{Probe, Tracing};
use super::surface::Spot;
use super::{Picture, RenderOptions, Renderer, Statistics, Unit, Values};
use crate::cost::boxes::BoxCounter;
use crate::tree::{Quality, Tree};
use crate::verify::DeviceError;

/// Draws the number of boxes around the first hit of each ray.
pub(super) fn picture(
    renderer: &Renderer,
    frame: &Frame,
    tracing: &Tracing,
    options: &RenderOptions,
) -> Result<Picture, DeviceError> {
    let boxes = renderer.scene.instance_boxes();
    let tlas = Tree::build_usable(boxes, Quality::Instances);
    let counter = BoxCounter::new(&tlas, boxes);
    let of_sample = |probe: &mut Probe, sample: &Sample| {
        let hit = probe.closest(&sample.ray, |_| true)?;
        Some(counter.around(Spot::of(renderer.scene, &sample.ray, &hit).point))
    };
    let of_pixel = |samples: &mut dyn Iterator<Item = Option<u32>>| {
        let (sum, hits) = samples.flatten().fold((0, 0u32), |(sum, hits), count| (sum + u64::from(count), hits + 1));
        (hits > 0).then(|| sum as f64 / f64::from(hits))
    };
    let counts: Vec<Option<f64>> = frame.each(tracing, of_sample, of_pixel)?;
    let seen = || counts.iter().flatten().copied();
    let largest = seen().fold(0.0, f64::max);
    let scale = options.scale.unwrap_or_else(|| legend::rounded_up(largest));
    let colour = |count: &Option<f64>| -> Rgb {
        count.map_or_else(|| encoded(BACKGROUND), |count| options.colours.at(count / scale))
    };
    let statistics = Statistics {
        seen_ratio: seen().count() as f64 / counts.len() as f64,
        values: Some(Values::of(seen(), scale, Unit::Boxes)),
        ..Statistics::default()
    };
    let mut picture = Picture::of(frame.size, counts.iter().map(colour).collect(), statistics);
    legend::draw(&mut picture, options.colours, scale, Unit::Boxes.name());
    Ok(picture)
}
