//! The pictures of a page: the same views of both files, by one camera.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use raykiln_formats::Document;
use serde::Serialize;

use crate::cost::mesh_trees::MeshTrees;
use crate::render::{Camera, CameraChoice, Costs, Picture, RenderError, RenderOptions, Renderer, View};
use crate::report::words::counted;
use crate::scene::Scene;
use crate::verify::precisions::{self, OfPrecision};

/// Width and height in pixels: small, as a page has up to eight pictures and is made in a few seconds.
pub(super) const SIZE: [u32; 2] = [640, 360];
/// Seed of the rays that precisions are compared by.
const SEED: u64 = 1;
/// Samples per pixel of shaded pictures.
const SAMPLES: u32 = 4;

/// A scene, the document that it was loaded from, which has the textures, and the trees of its meshes.
pub type Drawn<'a> = (&'a Document, &'a Scene, &'a MeshTrees);

/// Pictures of one view of the input and of the output.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Pair {
    /// Identifies it within the page.
    id: &'static str,
    title: &'static str,
    caption: String,
    width: u32,
    height: u32,
    /// A PNG as the address of an image.
    before: String,
    /// `None` if there is one file only.
    after: Option<String>,
}

/// The pictures of a page, and what else is traced through the same trees.
#[derive(Clone, Debug, Default)]
pub(super) struct Drawing {
    pub(super) pairs: Vec<Pair>,
    /// What precision costs in the output, or in the input if there is no output.
    pub(super) precisions: Vec<OfPrecision>,
}

/// Draws the pictures of the input, and of the output by the same camera, in a width and height in pixels.
///
/// # Errors
/// [`RenderError::Empty`] if there is nothing to see.
pub(super) fn of(before: Drawn, after: Option<Drawn>, size: [u32; 2]) -> Result<Drawing, RenderError> {
    let shown = after.unwrap_or(before).1;
    let renderer = |(doc, scene, trees)| Renderer::with_trees(doc, scene, trees);
    let (before, after) = (renderer(before)?, after.map(renderer).transpose()?);
    let after = after.map(|after| after.lit_as(&before));
    let camera = before.camera(&CameraChoice::Default)?;
    let both = Both { before, after, camera, size };
    let shaded = both.pair(View::Shaded, "shaded", "As it looks", "The surfaces with their materials.")?;
    let caption = "One colour per group: a ray has to search each group whose box it enters.";
    let groups = both.pair(View::Groups, "groups", "Groups", caption)?;
    let heat = both.heat()?;
    let overlap = both.overlap()?;
    let bad = both.bad_images();
    let note = if bad == 0 { String::new() } else { format!(" {} could not be read.", counted(bad, "image")) };
    let pairs = vec![Pair { caption: shaded.caption.clone() + &note, ..shaded }, groups, heat, overlap];
    let accel = both.after.as_ref().unwrap_or(&both.before).accel();
    Ok(Drawing { pairs, precisions: precisions::compare(shown, accel, SEED) })
}

/// Both files and the camera.
struct Both<'a> {
    before: Renderer<'a>,
    after: Option<Renderer<'a>>,
    camera: Camera,
    /// Of each picture, in pixels.
    size: [u32; 2],
}

impl Both<'_> {
    fn pair(&self, view: View, id: &'static str, title: &'static str, words: &str) -> Result<Pair, RenderError> {
        let samples = (view == View::Shaded).then_some(SAMPLES);
        let options = RenderOptions { size: self.size, samples, ..RenderOptions::default() };
        let draw = |renderer: &Renderer| renderer.picture(view, &self.camera, &options);
        let after = self.after.as_ref().map(draw).transpose()?;
        let caption = format!("{words} View: {}.", self.camera.name());
        Ok(Pair::of(id, title, caption, &draw(&self.before)?, after.as_ref()))
    }

    /// The heat maps, on one scale.
    fn heat(&self) -> Result<Pair, RenderError> {
        let options = RenderOptions { size: self.size, ..RenderOptions::default() };
        let costs = |renderer: &Renderer| renderer.costs(&self.camera, &options);
        let (before, after) = (costs(&self.before)?, self.after.as_ref().map(costs).transpose()?);
        let all: Vec<&Costs> = [Some(&before), after.as_ref()].into_iter().flatten().collect();
        let scale = Costs::scale(&all);
        let draw = |costs: &Costs| costs.picture(options.colours, scale);
        let (before, after) = (draw(&before), after.as_ref().map(draw));
        let means = means(&before, after.as_ref(), " per ray");
        let caption = format!("What each ray costs on the CPU: nodes, entries and triangle tests; {means}.");
        Ok(Pair::of("heatmap", "Cost per pixel", caption, &before, after.as_ref()))
    }

    /// The boxes around what is seen, on one scale.
    fn overlap(&self) -> Result<Pair, RenderError> {
        let draw = |renderer: &Renderer, scale| {
            let options = RenderOptions { size: self.size, scale, ..RenderOptions::default() };
            renderer.picture(View::Overlap, &self.camera, &options)
        };
        let values = |picture: &Picture| picture.statistics.values.unwrap_or_default();
        let (before, after) = (draw(&self.before, None)?, self.after.as_ref().map(|r| draw(r, None)).transpose()?);
        let scale = after.as_ref().map_or(0.0, |after| values(after).scale).max(values(&before).scale);
        let rescaled = |renderer, picture: Picture| {
            if values(&picture).scale == scale { Ok(picture) } else { draw(renderer, Some(scale)) }
        };
        let before = rescaled(&self.before, before)?;
        let after = self.after.as_ref().zip(after).map(|(r, picture)| rescaled(r, picture)).transpose()?;
        let means = means(&before, after.as_ref(), "");
        let caption = format!(
            "The number of boxes of groups around each point that is seen: rays there enter all of them; {means}."
        );
        Ok(Pair::of("overlap", "Overlapping boxes", caption, &before, after.as_ref()))
    }

    fn bad_images(&self) -> usize {
        let renderers = [Some(&self.before), self.after.as_ref()];
        renderers.into_iter().flatten().map(|renderer| renderer.bad_images().len()).max().unwrap_or(0)
    }
}

impl Pair {
    fn of(id: &'static str, title: &'static str, caption: String, before: &Picture, after: Option<&Picture>) -> Pair {
        let address = |picture: &Picture| format!("data:image/png;base64,{}", STANDARD.encode(picture.png()));
        Pair {
            id,
            title,
            caption,
            width: before.width,
            height: before.height,
            before: address(before),
            after: after.map(address),
        }
    }
}

/// Returns the mean values of a picture, or of one before and one after, each followed by `per`.
fn means(before: &Picture, after: Option<&Picture>, per: &str) -> String {
    let mean = |picture: &Picture| picture.statistics.values.map_or(0.0, |values| values.mean);
    match after {
        Some(after) => format!("on average {:.1}{per} before, {:.1} after", mean(before), mean(after)),
        None => format!("on average {:.1}{per}", mean(before)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LoadOptions, load};
    use std::path::Path;

    #[test]
    fn each_view_has_a_picture_of_each_file() {
        let doc = raykiln_formats::read(Path::new("samples/clean/scene.glb")).expect("a sample");
        let (scene, _) = load(&doc, &LoadOptions::default()).expect("a scene");
        let drawn = (&doc, &scene, &MeshTrees::build(&scene));
        for (after, expected) in [(None, false), (Some(drawn), true)] {
            let Drawing { pairs, precisions } = of(drawn, after, [64, 36]).expect("something to see");
            assert!(!precisions.is_empty());
            assert_eq!(
                pairs.iter().map(|pair| pair.id).collect::<Vec<_>>(),
                ["shaded", "groups", "heatmap", "overlap"]
            );
            for pair in pairs {
                assert_eq!(pair.after.is_some(), expected, "{}", pair.id);
                assert!(pair.after.is_none_or(|after| after == pair.before), "the same scene looks the same");
            }
        }
    }

    #[test]
    fn nothing_has_no_picture() {
        let doc = raykiln_formats::read(Path::new("samples/clean/scene.glb")).expect("a sample");
        assert!(of((&doc, &Scene::default(), &MeshTrees::default()), None, [64, 36]).is_err());
    }
}
