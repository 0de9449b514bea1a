//! The number of instance boxes around what is seen: each of them is entered by rays that start there.

use super::colour::{Rgb, encoded};
use super::flat::BACKGROUND;
use super::frame::Frame;
use super::legend;
use super::surface::Spot;
use super::{Picture, RenderOptions, Renderer, Statistics, Values};
use crate::cost::boxes::BoxCounter;
use crate::tree::{Quality, Tree};

/// What the legend says.
const UNIT: &str = "instance boxes around the surface";

/// Draws the number of boxes around the first hit of each ray.
pub(super) fn picture(renderer: &Renderer, frame: &Frame, options: &RenderOptions) -> Picture {
    let boxes = renderer.scene.instance_boxes();
    let tlas = Tree::build_usable(boxes, Quality::Instances);
    let counter = BoxCounter::new(&tlas, boxes);
    let tracer = renderer.tracer();
    let counts: Vec<Option<f64>> = frame.each(
        || tracer.probe(),
        |probe, pixel| {
            let (mut sum, mut hits) = (0u64, 0u32);
            for sample in frame.samples_of(pixel) {
                if let Some(hit) = probe.closest(&sample.ray, |_| true) {
                    sum += u64::from(counter.around(Spot::of(renderer.scene, &sample.ray, &hit).point));
                    hits += 1;
                }
            }
            (hits > 0).then(|| sum as f64 / f64::from(hits))
        },
    );
    let seen = || counts.iter().flatten().copied();
    let largest = seen().fold(0.0, f64::max);
    let scale = options.scale.unwrap_or_else(|| legend::rounded_up(largest));
    let colour = |count: &Option<f64>| -> Rgb {
        count.map_or_else(|| encoded(BACKGROUND), |count| options.colours.at(count / scale))
    };
    let statistics = Statistics {
        seen_ratio: seen().count() as f64 / counts.len() as f64,
        values: Some(Values::of(seen(), scale)),
        ..Statistics::default()
    };
    let mut picture = Picture::of(frame.size, counts.iter().map(colour).collect(), statistics);
    legend::draw(&mut picture, options.colours, scale, UNIT);
    picture
}
