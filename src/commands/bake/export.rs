//! Writes candidates into a folder, to be timed where there is a device.

use std::path::Path;

use raykiln_formats::document::Staged;
use raykiln_formats::{Document, Error};

use super::{BakeOptions, fingerprint, write};
use crate::choose::{Chosen, Contender};
use crate::layout::Layout;
use crate::methods::{self, Method};
use crate::report::exported::{Exported, ExportedCandidate};
use crate::scene::Scene;

/// Where candidates are written, and what would be written if they won.
#[derive(Clone, Copy)]
pub(super) struct To<'a> {
    pub(super) folder: &'a Path,
    pub(super) output: &'a Path,
}

/// Writes the input, with its predicted bytes, and the contenders, which were laid out from `staged`.
pub(super) fn write_all(
    doc: &Document,
    (scene, input_bytes): (&Scene, u64),
    staged: &Scene,
    chosen: &Chosen,
    to: To,
    options: &BakeOptions,
) -> Result<Exported, Error> {
    let keep = methods::run(Method::Keep, scene, &methods::Options::default());
    let (file, output_blake3) = write_one(doc, scene, &keep, 0, to, options)?;
    let plan = Method::Keep.into();
    let mut candidates =
        vec![ExportedCandidate { plan, file, output_blake3, sampled_cost: None, as_bytes: input_bytes }];
    for (i, contender) in chosen.contenders.iter().enumerate() {
        let Contender { plan, layout, overlay, sampled_cost, as_bytes } = contender;
        let (file, output_blake3) = write_one(doc, &staged.overlaid(overlay), layout, i + 1, to, options)?;
        let (plan, sampled_cost, as_bytes) = (*plan, Some(*sampled_cost), *as_bytes);
        candidates.push(ExportedCandidate { plan, file, output_blake3, sampled_cost, as_bytes });
    }
    Ok(Exported { input_may_win: chosen.may_be_left_alone, candidates })
}

/// Writes a layout; returns the name of its file, and the hash of the output that the bake would write.
fn write_one(
    doc: &Document,
    scene: &Scene,
    layout: &Layout,
    number: usize,
    to: To,
    options: &BakeOptions,
) -> Result<(String, String), Error> {
    // Which files an output consists of depends on its place: textures stay where they are if it is that of the input.
    let hash = fingerprint::of_output(&write(doc, scene, layout, to.output, options)?.staged)?.to_string();
    let file = format!("{number}.glb");
    write(doc, scene, layout, &to.folder.join(&file), options)
        .map(|written| written.staged)
        .and_then(Staged::commit)?;
    Ok((file, hash))
}
