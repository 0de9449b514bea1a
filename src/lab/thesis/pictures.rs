//! Figures 5.2 and 5.6: layouts of a scene and scenes with instances, each mesh in a colour of its own.

use std::fs;
use std::path::Path;

use super::Failure;
use super::crowds;
use super::numbers::NODE_RATIOS;
use super::scenes::Found;
use super::trials::Trial;
use crate::lab::LabError;
use crate::lab::bench::{PictureSetup, Session};
use crate::render::{Camera, RenderOptions, Renderer, View};
use crate::report::study::{Figure, Picture};
use crate::scene::Scene;

/// Width and height of a picture in pixels, at least; and its samples per pixel.
const SMALLEST: u32 = 96;
const SAMPLES: u32 = 2;

/// Returns the number of a scene that is drawn: the last one, if it is not at hand.
pub(super) fn chosen(of: usize, found: &[Found]) -> usize {
    found.iter().position(|scene| scene.of == Some(of)).unwrap_or(found.len().saturating_sub(1))
}

/// Draws the layouts of figure 5.2 and writes them to the folder of figures.
pub(super) fn fragments(session: &Session, picture: PictureSetup, out: &Path) -> Result<Vec<Figure>, Failure> {
    let trials = [
        ("left", "the objects of the scene", Trial::PerObject),
        ("centre", "bvh 10^-4", Trial::Bvh(NODE_RATIOS[3])),
        ("right", "bvh 10^-1", Trial::Bvh(NODE_RATIOS[0])),
    ];
    let mut figures = Vec::new();
    for (place, what, trial) in trials {
        let laid = session.lay_out(&trial.setup(picture));
        let caption =
            format!("Figure 5.2, {place}: {}, {what}; each mesh has a colour of its own.", session.subject.name);
        figures.push(drawn(session, &laid.stored, picture, out, &format!("figure-5-2-{place}.png"), caption)?);
    }
    Ok(figures)
}

/// Draws a scene with instances, as in figure 5.6.
pub(super) fn crowd(session: &Session, instances: usize, picture: PictureSetup, out: &Path) -> Result<Figure, Failure> {
    let laid = session.lay_out(&Trial::PerObject.setup(picture));
    let scene = session.subject.with_instances(&laid.stored);
    let name = &session.subject.name;
    let caption = format!("Figure 5.6: {name} with {instances} instances; each mesh has a colour of its own.");
    drawn(session, &scene, picture, out, &format!("figure-5-6-{instances}.png"), caption)
}

/// Draws the groups of a scene and writes the picture to the folder of figures.
fn drawn(
    session: &Session,
    scene: &Scene,
    picture: PictureSetup,
    out: &Path,
    file: &str,
    caption: String,
) -> Result<Figure, Failure> {
    let failed = |e: crate::render::RenderError| Failure::Scene(e.to_string());
    let folder = out.join(super::page::FIGURES);
    crowds::create(&folder)?;
    let renderer = Renderer::new(&session.subject.doc, scene).map_err(failed)?;
    let size = picture.size.map(|side| side.max(SMALLEST));
    let options = RenderOptions { size, samples: Some(SAMPLES), ..RenderOptions::default() };
    let drawn = renderer.picture(View::Groups, &Camera::of(session.view().clone()), &options).map_err(failed)?;
    let (path, bytes) = (folder.join(file), drawn.png());
    fs::write(&path, &bytes).map_err(|e| Failure::Output(LabError::file(&path, e)))?;
    Ok(Figure { caption, file: file.to_owned(), content: Picture::Png(bytes) })
}
