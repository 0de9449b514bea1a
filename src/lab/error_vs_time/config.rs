//! The table `[error-vs-time]` of a configuration.

use std::collections::BTreeMap;

use toml::Spanned;

use super::placed::{Generated, Placement};
use super::settings::{Bake, Setting, Sweep, Value};
use crate::choose::Choice;
use crate::lab::LabError;
use crate::lab::config::Source;
use crate::methods::Method;
use crate::verify::VerifyOptions;
use crate::verify::cpu::Precision;
use crate::verify::rays::MOST_RAYS;

/// The table as it is written.
pub(in crate::lab) type Keys = BTreeMap<String, Spanned<toml::Value>>;

/// What traces a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::lab) enum Tracer {
    /// The CPU, in some arithmetic.
    Cpu(Precision),
    /// The Vulkan device.
    Device,
}

impl Tracer {
    pub(in crate::lab) const ALL: [Tracer; 5] = [
        Tracer::Cpu(Precision::F32Fast),
        Tracer::Cpu(Precision::F32Watertight),
        Tracer::Cpu(Precision::F32Recentred),
        Tracer::Cpu(Precision::F64),
        Tracer::Device,
    ];

    /// Returns the name in configurations and tables.
    pub(in crate::lab) fn name(self) -> &'static str {
        match self {
            Tracer::Cpu(precision) => precision.name(),
            Tracer::Device => "device",
        }
    }
}

/// What to measure, beside the scenes.
pub(in crate::lab) struct ErrorVsTime {
    pub(super) methods: Vec<Choice>,
    pub(super) tracers: Vec<Tracer>,
    pub(super) placements: Vec<Placement>,
    pub(super) generated: Vec<Generated>,
    pub(super) sweep: Sweep,
    /// What every layout is made with where no setting says otherwise.
    pub(super) bake: Bake,
}

impl ErrorVsTime {
    /// Reads the table; `methods` are those of the configuration, if it names any.
    ///
    /// # Errors
    /// Fails if a key is unknown or has an invalid value. Errors name file, line and key.
    pub(in crate::lab) fn read(
        source: &Source<'_>,
        keys: &Keys,
        methods: Option<&Spanned<Vec<Spanned<String>>>>,
        mut bake: Bake,
    ) -> Result<ErrorVsTime, LabError> {
        let all_methods = [Choice::Auto].into_iter().chain(Method::ALL.map(Choice::Method));
        bake.verify.rays_per_kind = VerifyOptions::default().rays_per_kind;
        let mut read = ErrorVsTime {
            methods: match methods {
                Some(names) => methods_of(source, names)?,
                None => all_methods.collect(),
            },
            tracers: vec![Tracer::Cpu(Precision::F32Watertight)],
            placements: vec![Placement::AsIs],
            generated: Vec::new(),
            sweep: Sweep::default(),
            bake,
        };
        for (key, value) in keys {
            read.take(source, key, value)?;
        }
        Ok(read)
    }

    /// Whether scenes are generated, so that none needs to be listed.
    pub(in crate::lab) fn has_scenes(&self) -> bool {
        !self.generated.is_empty()
    }

    fn take(&mut self, source: &Source<'_>, key: &str, value: &Spanned<toml::Value>) -> Result<(), LabError> {
        let at = |cause: String| source.error(Some(value.span()), cause);
        let values = values(value.get_ref()).ok_or_else(|| at(format!("`{key}` is not a value or a list of them")))?;
        match key {
            "tracers" => self.tracers = named(key, &values, &Tracer::ALL, |of| of.name()).map_err(at)?,
            "placements" => self.placements = named(key, &values, &Placement::ALL, |of| of.name()).map_err(at)?,
            "generated" => self.generated = named(key, &values, &Generated::ALL, |of| of.name()).map_err(at)?,
            "error_rays" => match values[..] {
                [Value::Whole(n)] if (1..=u64::from(MOST_RAYS)).contains(&n) => {
                    self.bake.verify.rays_per_kind = n as u32;
                }
                _ => return Err(at(format!("`{key}` is not an integer from 1 to {MOST_RAYS}"))),
            },
            _ => {
                let setting =
                    Setting::named(key).ok_or_else(|| at(format!("unknown key `{key}` in `error-vs-time`")))?;
                match values.iter().find_map(|value| setting.refusal(value)) {
                    Some(refusal) => return Err(at(refusal)),
                    None => self.sweep.add(setting, values).map_err(at)?,
                }
            }
        }
        Ok(())
    }
}

/// Returns the values of a list, or a single value; `None` for an empty list and for what is neither.
fn values(value: &toml::Value) -> Option<Vec<Value>> {
    let values: Vec<Value> = match value {
        toml::Value::Array(list) => list.iter().map(Value::of).collect::<Option<_>>()?,
        single => vec![Value::of(single)?],
    };
    (!values.is_empty()).then_some(values)
}

/// Returns the members of a closed set with the given names.
fn named<T: Copy>(key: &str, values: &[Value], all: &[T], name: impl Fn(T) -> &'static str) -> Result<Vec<T>, String> {
    let of = |value: &Value| {
        let word = value.to_string();
        all.iter().copied().find(|of| name(*of) == word).ok_or_else(|| {
            let names: Vec<String> = all.iter().map(|of| format!("`{}`", name(*of))).collect();
            format!("`{key}`: there is no `{word}`; there are {}", names.join(", "))
        })
    };
    values.iter().map(of).collect()
}

fn methods_of(source: &Source<'_>, names: &Spanned<Vec<Spanned<String>>>) -> Result<Vec<Choice>, LabError> {
    let all: Vec<Choice> = [Choice::Auto].into_iter().chain(Method::ALL.map(Choice::Method)).collect();
    let method = |word: &Spanned<String>| {
        let found = named("methods", &[Value::Word(word.get_ref().clone())], &all, |of| of.name());
        found.map(|found| found[0]).map_err(|cause| source.error(Some(word.span()), cause))
    };
    match names.get_ref().is_empty() {
        true => Err(source.error(Some(names.span()), "`methods` lists none")),
        false => names.get_ref().iter().map(method).collect(),
    }
}
