//! [`Exact`]: what is compared before any ray is traced.

use std::path::Path;

use raykiln_formats::{Document, Error};

use super::contents::{self, ContentsReport, Inputs, Tolerance};
use super::identity::Identity;
use super::structure::Structure;
use super::surface::{self, pairs::Pairs};
use super::{Matching, Sides, VerifyOptions};
use crate::scene::Scene;

/// The exhaustive comparison of two files.
#[derive(Clone, Debug)]
pub struct Exact {
    pub(super) structure: Structure,
    pub(super) pairs: Pairs,
    pub(super) contents: Option<ContentsReport>,
}

impl Exact {
    /// Compares all triangles of two scenes; `None` if `options` asks for rays alone.
    pub fn of_scenes(scenes: Sides<&Scene>, options: &VerifyOptions) -> Option<Exact> {
        if options.matching == Matching::Surface {
            return None;
        }
        let identity = Identity::new(scenes.before, scenes.after);
        let (structure, pairs) = surface::compare(&identity, options.max_position_error_ratio);
        Some(Exact { structure, pairs, contents: None })
    }

    /// Compares all triangles of two files, and then what the files mean beyond the places of triangles; `None` as above.
    /// `staged` is as in [`Inputs::staged`].
    ///
    /// # Errors
    /// See [`Document::contents`].
    pub fn of_files(
        documents: Sides<&Document>,
        scenes: Sides<&Scene>,
        staged: Option<(&Path, &Path)>,
        options: &VerifyOptions,
    ) -> Result<Option<Exact>, Error> {
        let Some(exact) = Exact::of_scenes(scenes, options) else { return Ok(None) };
        let tolerance = Tolerance::for_positions(options.max_position_error_ratio);
        let inputs = Inputs { documents, scenes, pairs: &exact.pairs, staged };
        let contents = contents::compare(inputs, &tolerance)?;
        Ok(Some(Exact { contents: Some(contents), ..exact }))
    }
}
