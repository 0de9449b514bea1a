//! The table `[flags]` of a configuration.

use serde::Deserialize;
use toml::Spanned;

use super::rows::prefer_name;
use crate::lab::LabError;
use crate::lab::config::Source;
use crate::verify::VerifyOptions;
use crate::verify::build::{BuildOptions, Prefer};

/// The sets of flags to build with.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::lab) struct Flags {
    /// The sets, each preference with all others.
    pub(super) builds: Vec<BuildOptions>,
    /// Rays of each kind.
    pub(super) rays: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::lab) struct Keys {
    prefer: Option<Vec<Spanned<String>>>,
    allow_update: Option<Vec<bool>>,
    compact: Option<Vec<bool>>,
}

/// All preferences, in the order of the study.
const PREFERENCES: [Prefer; 3] = [Prefer::None, Prefer::FastTrace, Prefer::FastBuild];

/// Rays of each kind where the configuration says nothing else.
const RAYS: u32 = 1 << 18;

impl Flags {
    /// Reads the table.
    ///
    /// # Errors
    /// Fails if a preference is unknown.
    pub(in crate::lab) fn read(
        source: &Source<'_>,
        table: &Spanned<Keys>,
        verify: &VerifyOptions,
    ) -> Result<Flags, LabError> {
        let keys = table.get_ref();
        let known = |word: &Spanned<String>| {
            let found = PREFERENCES.into_iter().find(|prefer| prefer_name(*prefer) == word.get_ref());
            let names = PREFERENCES.map(prefer_name).join("`, `");
            let cause = || format!("`prefer`: there is no `{}`, only `{names}`", word.get_ref());
            found.ok_or_else(|| source.error(Some(word.span()), cause()))
        };
        let prefer = match &keys.prefer {
            Some(words) => words.iter().map(known).collect::<Result<Vec<Prefer>, LabError>>()?,
            None => PREFERENCES.to_vec(),
        };
        let [updates, compact] = [(&keys.allow_update, [false, true]), (&keys.compact, [false, true])]
            .map(|(listed, both)| listed.clone().unwrap_or(both.to_vec()));
        let mut builds = Vec::new();
        for prefer in prefer {
            for &allow_update in &updates {
                let of = |&compact: &bool| BuildOptions { prefer, allow_update, compact, ..verify.build };
                builds.extend(compact.iter().map(of));
            }
        }
        match builds.is_empty() {
            true => Err(source.error(Some(table.span()), "`flags` lists no set of flags")),
            false => Ok(Flags { builds, rays: verify.timed_rays_per_kind.unwrap_or(RAYS) as usize }),
        }
    }
}
