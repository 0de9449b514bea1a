//! Options of `bake` that an experiment sweeps.

use std::fmt::{Display, Formatter};

use serde::Serialize;

use crate::choose::applies::OPTIONS;
use crate::choose::model::Class;
use crate::choose::plans::Effort;
use crate::choose::{Choice, ChooseOptions};
use crate::methods::{Instances, Method, OverlapRule};
use crate::verify::VerifyOptions;
use crate::verify::rays::MOST_RAYS;

/// Largest number of combinations of values.
const MOST_COMBINATIONS: usize = 100_000;

/// A value of a setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// An integer.
    Whole(u64),
    /// Another number; finite.
    Number(f64),
    /// `true` or `false`.
    Flag(bool),
    /// A word.
    Word(String),
}

impl Value {
    /// Returns a value of a configuration; `None` for tables, dates and numbers that are not finite.
    pub(in crate::lab) fn of(value: &toml::Value) -> Option<Value> {
        match value {
            toml::Value::Integer(n) => match u64::try_from(*n) {
                Ok(n) => Some(Value::Whole(n)),
                Err(_) => Some(Value::Number(*n as f64)),
            },
            toml::Value::Float(x) => x.is_finite().then_some(Value::Number(*x)),
            toml::Value::Boolean(flag) => Some(Value::Flag(*flag)),
            toml::Value::String(word) => Some(Value::Word(word.clone())),
            _ => None,
        }
    }

    /// Returns the value as TOML.
    pub(in crate::lab) fn to_toml(&self) -> toml::Value {
        match self {
            Value::Whole(n) => toml::Value::Integer(i64::try_from(*n).unwrap_or(i64::MAX)),
            Value::Number(x) => toml::Value::Float(*x),
            Value::Flag(flag) => toml::Value::Boolean(*flag),
            Value::Word(word) => toml::Value::String(word.clone()),
        }
    }

    fn ratio(&self) -> Option<f64> {
        match *self {
            Value::Whole(n) => Some(n as f64),
            Value::Number(x) if x >= 0.0 => Some(x),
            _ => None,
        }
    }

    fn positive(&self) -> Option<f64> {
        self.ratio().filter(|x| *x > 0.0)
    }

    fn within(&self, least: u64, most: u64) -> Option<u64> {
        match *self {
            Value::Whole(n) if (least..=most).contains(&n) => Some(n),
            _ => None,
        }
    }

    fn flag(&self) -> Option<bool> {
        if let Value::Flag(flag) = self { Some(*flag) } else { None }
    }

    pub(in crate::lab) fn word(&self) -> Option<&str> {
        if let Value::Word(word) = self { Some(word) } else { None }
    }
}

impl Display for Value {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Whole(n) => write!(f, "{n}"),
            Value::Number(x) if *x != 0.0 && !(1e-3..1e6).contains(&x.abs()) => write!(f, "{x:e}"),
            Value::Number(x) => write!(f, "{x}"),
            Value::Flag(flag) => write!(f, "{flag}"),
            Value::Word(word) => f.write_str(word),
        }
    }
}

/// What a layout is made with.
#[derive(Clone, Debug)]
pub(in crate::lab) struct Bake {
    pub(in crate::lab) choose: ChooseOptions,
    pub(in crate::lab) verify: VerifyOptions,
}

/// What a setting applies to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum To {
    /// What the option of `bake` of that name applies to.
    AsOption,
    /// Every layout that differs from the input.
    Rewritten,
    /// `auto` only.
    Auto,
}

/// An option that can be swept.
pub(in crate::lab) struct Setting {
    /// The name of the option of `bake`, with underscores.
    pub(in crate::lab) name: &'static str,
    /// Which values it takes, in words.
    expects: &'static str,
    to: To,
    /// Sets the value; `None` if the option does not take it.
    set: fn(&mut Bake, &Value) -> Option<()>,
}

const RATIO: &str = "a number of at least 0";
const POSITIVE: &str = "a number above 0";
const FLAG: &str = "`true` or `false`";

const fn option(name: &'static str, expects: &'static str, set: fn(&mut Bake, &Value) -> Option<()>) -> Setting {
    Setting { name, expects, to: To::AsOption, set }
}

/// All options that can be swept.
pub(super) const SETTINGS: [Setting; 21] = [
    Setting {
        name: "max_position_error_ratio",
        expects: RATIO,
        to: To::Rewritten,
        set: |b, v| v.ratio().map(|x| b.verify.max_position_error_ratio = x),
    },
    option("effort", "an integer from 0 to 6", |b, v| {
        v.within(0, u64::from(Effort::MOST)).map(|n| b.choose.effort = Effort::new(n as u8))
    }),
    Setting {
        name: "counted_rays",
        expects: "an integer from 1 to 16777216",
        to: To::Auto,
        set: |b, v| v.within(1, u64::from(MOST_RAYS)).map(|n| b.choose.ranking_rays = Some(n as usize)),
    },
    option("device_class", "`no-rt-cores` or `rt-cores`", |b, v| {
        let word = v.word()?;
        Class::ALL.into_iter().find(|class| class.name() == word).map(|class| b.choose.class = class)
    }),
    option("nodes_per_triangle_ratio", RATIO, |b, v| {
        v.ratio().map(|x| b.choose.layout.bvh.nodes_per_triangle_ratio = x)
    }),
    option("min_area_ratio", RATIO, |b, v| v.ratio().map(|x| b.choose.layout.bvh.min_area_ratio = x)),
    option("skip_overlap_ratio", RATIO, |b, v| v.ratio().map(|x| b.choose.layout.overlap.skip_overlap_ratio = x)),
    option("split_or_merge_ratio", RATIO, |b, v| v.ratio().map(|x| b.choose.layout.overlap.split_or_merge_ratio = x)),
    option("overlap_rule", "`improved` or `thesis`", |b, v| {
        b.choose.layout.overlap.rule = match v.word()? {
            "improved" => OverlapRule::Improved,
            "thesis" => OverlapRule::Thesis,
            _ => return None,
        };
        Some(())
    }),
    option("split_ratio", RATIO, |b, v| v.ratio().map(|x| b.choose.layout.overlap.split_ratio = x)),
    option("termination_overlap_ratio", RATIO, |b, v| {
        v.ratio().map(|x| b.choose.layout.overlap.termination_overlap_ratio = x)
    }),
    option("min_triangles", "an integer", |b, v| {
        let n = v.within(0, u64::from(u32::MAX))? as usize;
        (b.choose.layout.overlap.min_triangles, b.choose.layout.bvh.min_triangles) = (n, n);
        Some(())
    }),
    option("max_bytes_ratio", POSITIVE, |b, v| {
        v.positive().map(|x| b.choose.layout.instances.max_bytes_ratio = Some(x))
    }),
    option("instances", "`bake-or-keep` or `choose`", |b, v| {
        b.choose.layout.instances.shared = match v.word()? {
            "bake-or-keep" => Instances::BakeOrKeep,
            "choose" => Instances::Choose,
            _ => return None,
        };
        b.choose.forbidden.choose_instances = b.choose.layout.instances.shared == Instances::BakeOrKeep;
        Some(())
    }),
    option("pieces", "an integer from 1 to 64", |b, v| {
        v.within(1, 64).map(|n| b.choose.layout.instances.pieces = Some(n as u32))
    }),
    option("isolate", FLAG, |b, v| {
        let flag = v.flag()?;
        (b.choose.layout.parts.isolate, b.choose.forbidden.isolate) = (flag, !flag);
        Some(())
    }),
    option("split_opacity", FLAG, |b, v| {
        let flag = v.flag()?;
        (b.choose.layout.parts.split_opacity, b.choose.forbidden.split_opacity) = (flag, !flag);
        Some(())
    }),
    option("entry_cost", RATIO, |b, v| v.ratio().map(|x| b.choose.layout.instances.entry_cost = x)),
    option("frames", FLAG, |b, v| v.flag().map(|flag| b.choose.layout.instances.frames = flag)),
    option("max_group_triangles", "an integer above 0", |b, v| {
        v.within(1, u64::from(u32::MAX)).map(|n| b.choose.layout.cluster.max_group_triangles = Some(n as u32))
    }),
    option("max_group_extent_ratio", POSITIVE, |b, v| {
        v.positive().map(|x| b.choose.layout.cluster.max_group_extent_ratio = Some(x))
    }),
];

impl Setting {
    /// Returns the setting of a name.
    pub(in crate::lab) fn named(name: &str) -> Option<&'static Setting> {
        const { &SETTINGS }.iter().find(|setting| setting.name == name)
    }

    /// Returns why the option does not take a value, in words.
    pub(in crate::lab) fn refusal(&self, value: &Value) -> Option<String> {
        let mut any = Bake { choose: ChooseOptions::default(), verify: VerifyOptions::default() };
        let refused = (self.set)(&mut any, value).is_none();
        refused.then(|| format!("`{}` is {value}, not {}", self.name, self.expects))
    }

    /// Sets a value that the option takes; others change nothing.
    pub(in crate::lab) fn apply(&self, bake: &mut Bake, value: &Value) {
        (self.set)(bake, value);
    }

    fn applies(&self, choose: &ChooseOptions) -> bool {
        match self.to {
            To::Rewritten => choose.method != Choice::Method(Method::Keep),
            To::Auto => choose.method == Choice::Auto,
            To::AsOption => {
                let option = self.name.replace('_', "-");
                OPTIONS.iter().any(|applies| applies.option == option && applies.to_choice(choose))
            }
        }
    }
}

/// The settings to sweep, each with its values.
#[derive(Default)]
pub(super) struct Sweep(Vec<(&'static Setting, Vec<Value>)>);

/// A method with one value of each setting that applies to it.
#[derive(Clone, Debug)]
pub(super) struct Combination {
    pub(super) bake: Bake,
    /// In the order of the sweep.
    pub(super) values: Vec<Option<Value>>,
}

impl Sweep {
    /// Adds a setting.
    ///
    /// # Errors
    /// Fails if there are too many combinations, in words.
    pub(super) fn add(&mut self, setting: &'static Setting, values: Vec<Value>) -> Result<(), String> {
        self.0.push((setting, values));
        let count = self.0.iter().try_fold(1usize, |count, (_, values)| count.checked_mul(values.len()));
        match count {
            Some(..=MOST_COMBINATIONS) => Ok(()),
            _ => Err(format!("the settings have more than {MOST_COMBINATIONS} combinations")),
        }
    }

    /// Returns the names of the settings.
    pub(super) fn names(&self) -> Vec<&'static str> {
        self.0.iter().map(|(setting, _)| setting.name).collect()
    }

    /// Returns the combinations of the settings that apply to what `bake` is made with, in the order of the values.
    pub(super) fn combinations(&self, bake: &Bake) -> Vec<Combination> {
        let mut all: Vec<Combination> = Vec::new();
        let count: usize = self.0.iter().map(|(_, values)| values.len()).product();
        for number in 0..count {
            let combination = self.applicable(bake, self.chosen(number));
            if all.iter().all(|known| known.values != combination.values) {
                all.push(combination);
            }
        }
        all
    }

    /// Returns the values of a combination; the last setting changes fastest.
    fn chosen(&self, mut number: usize) -> Vec<&Value> {
        let mut chosen: Vec<&Value> = Vec::new();
        for (_, values) in self.0.iter().rev() {
            chosen.push(&values[number % values.len()]);
            number /= values.len();
        }
        chosen.reverse();
        chosen
    }

    /// Sets the values that apply once all are set.
    fn applicable(&self, bake: &Bake, chosen: Vec<&Value>) -> Combination {
        let mut all = bake.clone();
        for ((setting, _), value) in self.0.iter().zip(&chosen) {
            (setting.set)(&mut all, value);
        }
        let mut combination = Combination { bake: bake.clone(), values: Vec::new() };
        for ((setting, _), value) in self.0.iter().zip(chosen) {
            let applies = setting.applies(&all.choose);
            if applies {
                (setting.set)(&mut combination.bake, value);
            }
            combination.values.push(applies.then(|| value.clone()));
        }
        combination
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(settings: &[(&str, &[Value])]) -> Sweep {
        let mut sweep = Sweep::default();
        for (name, values) in settings {
            sweep.add(Setting::named(name).expect(name), values.to_vec()).expect("few");
        }
        sweep
    }

    fn by(method: Choice) -> Bake {
        Bake { choose: ChooseOptions { method, ..ChooseOptions::default() }, verify: VerifyOptions::default() }
    }

    #[test]
    fn every_option_of_a_layout_can_be_swept() {
        for applies in &OPTIONS {
            let name = applies.option.replace('-', "_");
            assert!(Setting::named(&name).is_some(), "{name}");
        }
        assert!(["max_position_error_ratio", "counted_rays"].iter().all(|name| Setting::named(name).is_some()));
    }

    #[test]
    fn a_method_is_swept_by_what_applies_to_it() {
        let numbers = [1.0, 5.0].map(Value::Number);
        let flags = [true, false].map(Value::Flag);
        let sweep = sweep(&[("entry_cost", &numbers), ("frames", &flags), ("skip_overlap_ratio", &numbers)]);
        let count = |method: Choice| sweep.combinations(&by(method)).len();
        assert_eq!(count(Method::Cluster.into()), 4);
        assert_eq!(count(Method::Overlap.into()), 2);
        assert_eq!(count(Method::Keep.into()), 1);
        let last = sweep.combinations(&by(Method::Cluster.into())).pop().expect("four");
        assert_eq!(last.values, [Some(Value::Number(5.0)), Some(Value::Flag(false)), None]);
        let instances = &last.bake.choose.layout.instances;
        assert_eq!((instances.entry_cost, instances.frames), (5.0, false));
    }

    #[test]
    fn values_that_an_option_does_not_take_are_refused_by_name() {
        for (name, bad, good) in [
            ("effort", Value::Whole(7), Value::Whole(6)),
            ("frames", Value::Whole(1), Value::Flag(false)),
            ("instances", Value::Word("all".into()), Value::Word("choose".into())),
            ("max_position_error_ratio", Value::Number(-1.0), Value::Whole(0)),
            ("max_bytes_ratio", Value::Whole(0), Value::Number(1.5)),
            ("pieces", Value::Number(2.5), Value::Whole(2)),
            ("counted_rays", Value::Whole(0), Value::Whole(1)),
        ] {
            let setting = Setting::named(name).expect(name);
            let words = setting.refusal(&bad).expect("refused");
            assert!(words.starts_with(&format!("`{name}` is {bad}, not ")), "{words}");
            assert_eq!(setting.refusal(&good), None, "{name}");
        }
    }

    #[test]
    fn too_many_combinations_are_refused() {
        let many: Vec<Value> = (0..1000).map(Value::Whole).collect();
        let mut sweep = sweep(&[("min_triangles", &many)]);
        assert!(sweep.add(Setting::named("entry_cost").expect("known"), many).is_err());
    }
}
