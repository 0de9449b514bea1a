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

/// Returns the number of a scene that is drawn: the one with the largest file, if it is not at hand.
pub(super) fn chosen(of: usize, found: &[Found]) -> usize {
    let size = |i: &usize| found[*i].file.metadata().map_or(0, |metadata| metadata.len());
    let largest = || (0..found.len()).max_by_key(size).unwrap_or(0);
    found.iter().position(|scene| scene.of == Some(of)).unwrap_or_else(largest)
}

/// Draws the layouts of figure 5.2 and writes them to the folder of figures.
pub(super) fn fragments(session: &Session, picture: PictureSetup, out: &Path) -> Result<Vec<Figure>, Failure> {
    let draw = |fragment: &Fragment| {
        let laid = session.lay_out(&fragment.trial.setup(picture));
        drawn(session, &laid.stored, picture, out, fragment.titled(&session.subject.name))
    };
    FRAGMENTS.iter().map(draw).collect()
}

/// A picture of figure 5.2.
pub(super) struct Fragment {
    place: &'static str,
    what: &'static str,
    trial: Trial,
}

/// Figure 5.2.
pub(super) const FRAGMENTS: [Fragment; 3] = [
    Fragment { place: "left", what: "the objects of the scene", trial: Trial::PerObject },
    Fragment { place: "centre", what: "bvh 10^-4", trial: Trial::Bvh(NODE_RATIOS[3]) },
    Fragment { place: "right", what: "bvh 10^-1", trial: Trial::Bvh(NODE_RATIOS[0]) },
];

impl Fragment {
    /// Returns the file and the caption for a scene.
    pub(super) fn titled(&self, scene: &str) -> (String, String) {
        let Fragment { place, what, .. } = self;
        let caption = format!("Figure 5.2, {place}: {scene}, {what}; each mesh has a colour of its own.");
        (format!("figure-5-2-{place}.png"), caption)
    }
}

/// Draws a scene with instances, as in figure 5.6.
pub(super) fn crowd(session: &Session, instances: usize, picture: PictureSetup, out: &Path) -> Result<Figure, Failure> {
    let laid = session.lay_out(&Trial::PerObject.setup(picture));
    let scene = session.subject.with_instances(&laid.stored);
    drawn(session, &scene, picture, out, title_of_crowd(&session.subject.name, instances))
}

/// Returns the file and the caption of a picture of figure 5.6.
pub(super) fn title_of_crowd(scene: &str, instances: usize) -> (String, String) {
    let caption = format!("Figure 5.6: {scene} with {instances} instances; each mesh has a colour of its own.");
    (format!("figure-5-6-{instances}.png"), caption)
}

/// Draws the groups of a scene and writes the picture to the folder of figures.
fn drawn(
    session: &Session,
    scene: &Scene,
    picture: PictureSetup,
    out: &Path,
    (file, caption): (String, String),
) -> Result<Figure, Failure> {
    let failed = |e: crate::render::RenderError| Failure::Scene(e.to_string());
    let folder = out.join(super::page::FIGURES);
    crowds::create(&folder)?;
    let renderer = Renderer::new(&session.subject.doc, scene).map_err(failed)?;
    let size = picture.size.map(|side| side.max(SMALLEST));
    let options = RenderOptions { size, samples: Some(SAMPLES), ..RenderOptions::default() };
    let drawn = renderer.picture(View::Groups, &Camera::of(session.view().clone()), &options).map_err(failed)?;
    let (path, bytes) = (folder.join(&file), drawn.png());
    fs::write(&path, &bytes).map_err(|e| Failure::Output(LabError::file(&path, e)))?;
    Ok(Figure { caption, file, content: Picture::Png(bytes) })
}
