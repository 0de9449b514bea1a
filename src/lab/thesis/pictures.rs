//! Figure 5.2: the layouts of a scene, each mesh in a colour of its own.

use std::fs;
use std::path::Path;

use super::Failure;
use super::numbers::{NODE_RATIOS, SAN_MIGUEL};
use super::scenes::Found;
use super::trials::Trial;
use crate::lab::LabError;
use crate::lab::bench::{PictureSetup, Session};
use crate::render::{Camera, RenderOptions, Renderer, View};
use crate::report::study::{Figure, Picture};

/// Returns the number of the scene whose layouts are drawn: San Miguel or, if it is not at hand, the last one.
pub(super) fn chosen(found: &[Found]) -> usize {
    found.iter().position(|scene| scene.of == Some(SAN_MIGUEL)).unwrap_or(found.len().saturating_sub(1))
}

/// Draws the layouts of figure 5.2 and writes them to the folder of figures.
pub(super) fn fragments(session: &Session, picture: PictureSetup, out: &Path) -> Result<Vec<Figure>, Failure> {
    let trials = [
        ("left", "the objects of the scene", Trial::PerObject),
        ("centre", "bvh 10^-4", Trial::Bvh(NODE_RATIOS[3])),
        ("right", "bvh 10^-1", Trial::Bvh(NODE_RATIOS[0])),
    ];
    let folder = out.join(super::page::FIGURES);
    fs::create_dir_all(&folder).map_err(|e| Failure::Output(LabError::file(&folder, e)))?;
    let mut figures = Vec::new();
    for (place, what, trial) in trials {
        let failed = |e: crate::render::RenderError| Failure::Scene(e.to_string());
        let laid = session.lay_out(&trial.setup(picture));
        let renderer = Renderer::new(&session.subject.doc, &laid.stored).map_err(failed)?;
        let options = RenderOptions { size: picture.size, ..RenderOptions::default() };
        let drawn = renderer.picture(View::Groups, &Camera::of(session.view().clone()), &options).map_err(failed)?;
        let (file, bytes) = (format!("figure-5-2-{place}.png"), drawn.png());
        let path = folder.join(&file);
        fs::write(&path, &bytes).map_err(|e| Failure::Output(LabError::file(&path, e)))?;
        let caption =
            format!("Figure 5.2, {place}: {}, {what}; each mesh has a colour of its own.", session.subject.name);
        figures.push(Figure { caption, file, content: Picture::Png(bytes) });
    }
    Ok(figures)
}
