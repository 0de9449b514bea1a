//! The cache of a bake.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};
use raykiln_formats::Outline;
use raykiln_formats::document::Staged;

use super::args::BakeArguments;
use crate::cache::{Key, Store};
use crate::commands::bake::BakeOptions;
use crate::commands::cached::{self, Decides, Hit};
use crate::report;

/// The name of the JSON report among the reports.
pub(super) const JSON: &str = "json";

/// The cache, and the key of one bake.
pub(super) struct Cached<'a> {
    store: Store,
    key: Key,
    /// The files that the scene consists of.
    pub(super) outline: Outline,
    arguments: &'a BakeArguments,
    options: &'a BTreeMap<String, Vec<String>>,
    device: String,
    /// The reports that are wanted besides JSON.
    wanted: &'a [&'static str],
}

/// A result that was found, with all reports that are wanted.
pub(super) struct Found {
    pub(super) staged: Staged,
    pub(super) json: String,
    pub(super) reports: BTreeMap<String, String>,
}

impl<'a> Cached<'a> {
    /// Opens the cache, if one is asked for, and hashes what decides the result.
    pub(super) fn open(
        arguments: &'a BakeArguments,
        options: &'a BTreeMap<String, Vec<String>>,
        bake: &BakeOptions,
        wanted: &'a [&'static str],
    ) -> Result<Option<Self>> {
        let Some(folder) = &arguments.cache.cache else { return Ok(None) };
        let store = Store::open(folder).with_context(|| format!("--cache {}", folder.display()))?;
        let device = cached::deciding_device(bake)?;
        let (key, outline) = decides(arguments, options, &device, wanted).key()?;
        Ok(Some(Cached { store, key, outline, arguments, options, device, wanted }))
    }

    /// Looks the result up.
    pub(super) fn look_up(&self) -> Result<Option<Found>> {
        let (input, output) = (&self.arguments.input, &self.arguments.output);
        let Some(Hit { staged, mut reports }) = cached::look_up(&self.store, &self.key, output)? else {
            return Ok(None);
        };
        let json = reports.remove(JSON).and_then(|json| report::cached::renamed(&json, input, output));
        let is_whole = self.wanted.iter().all(|report| reports.contains_key(*report));
        Ok(json.filter(|_| is_whole).map(|json| Found { staged, json, reports }))
    }

    /// Keeps a result, and the cache below its size.
    ///
    /// # Errors
    /// Fails if the cache cannot be written to, or a file of the scene changed while it was baked.
    pub(super) fn keep(&self, staged: &Staged, reports: &BTreeMap<String, String>) -> Result<()> {
        let (key, _) = decides(self.arguments, self.options, &self.device, self.wanted).key()?;
        ensure!(key == self.key, "a file of {} changed meanwhile", self.arguments.input.display());
        let kept = reports.iter().filter(|(name, _)| *name == JSON || self.wanted.contains(&name.as_str()));
        let kept: Vec<(&str, &str)> = kept.map(|(name, text)| (name.as_str(), text.as_str())).collect();
        cached::keep(&self.store, &self.key, staged, &kept)?;
        self.arguments.cache.cache_size.map(|most| self.store.trim(most)).transpose()?;
        Ok(())
    }
}

fn decides<'a>(
    arguments: &'a BakeArguments,
    options: &'a BTreeMap<String, Vec<String>>,
    device: &'a str,
    reports: &'a [&'a str],
) -> Decides<'a> {
    let plan = arguments.plan.as_deref();
    let obj = arguments.options.obj.options();
    Decides { input: &arguments.input, output: &arguments.output, options, obj, device, plan, reports }
}
