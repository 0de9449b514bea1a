//! The keys of tables 4.1 and 4.2 of the thesis, and their values.

use std::fmt::{Display, Formatter};

use super::Sort;

/// A value of a key.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::lab) enum Value {
    /// Text, such as a name.
    Text(String),
    /// A finite number.
    Number(f64),
    /// An integer of at least 0.
    Whole(u64),
    /// 0 or 1.
    Flag(bool),
    /// Three finite numbers.
    Vector([f64; 3]),
}

impl Display for Value {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Text(text) => f.write_str(text),
            Value::Number(x) => write!(f, "{x}"),
            Value::Whole(n) => write!(f, "{n}"),
            Value::Flag(flag) => write!(f, "{}", u8::from(*flag)),
            Value::Vector([x, y, z]) => write!(f, "{x} {y} {z}"),
        }
    }
}

/// What a key takes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    Text,
    /// A number of at least the given one, or above it.
    Least(f64),
    Above(f64),
    /// Any finite number.
    Any,
    /// An integer between two.
    Whole(u64, u64),
    Flag,
    Vector,
    /// Build flags of OptiX.
    Flags,
}

/// A key of a file.
#[derive(Debug)]
pub(in crate::lab) struct Key {
    /// As the table has it, but spelled correctly.
    pub(in crate::lab) name: &'static str,
    /// As the table has it, if it is misspelled there.
    also: Option<&'static str>,
    pub(super) kind: Kind,
}

const fn key(name: &'static str, kind: Kind) -> Key {
    Key { name, also: None, kind }
}

/// Largest number of instances: as many as a TLAS can tell apart.
pub(in crate::lab) const MOST_INSTANCES: u64 = 1 << 24;

/// Table 4.1.
const SCENE: [Key; 12] = [
    key("SCENE_NAME", Kind::Text),
    key("MODEL_FILE_NAME", Kind::Text),
    key("INSTANCE_FILE_NAME", Kind::Text),
    key("CAMERA_POSITION", Kind::Vector),
    key("CAMERA_POI", Kind::Vector),
    key("CAMERA_ROTATION_SPEED", Kind::Any),
    key("ANIMATE_CAMERA", Kind::Flag),
    key("INSTANCE_COUNT", Kind::Whole(0, MOST_INSTANCES)),
    key("ANIM_INSTANCE_COUNT", Kind::Whole(0, MOST_INSTANCES)),
    key("LIGHT_ORIGIN", Kind::Vector),
    key("LIGHT_SIZE", Kind::Least(0.0)),
    key("LIGHT_POWER", Kind::Least(0.0)),
];

/// Table 4.2.
const ENVIRONMENT: [Key; 16] = [
    key("BUILD_FLAGS", Kind::Flags),
    Key {
        name: "SCENE_REBUILD_INTERVAL",
        also: Some("SCENE_REBUILD_INTEREVAL"),
        kind: Kind::Whole(0, u32::MAX as u64),
    },
    key("ENVIRONMENT_NAME", Kind::Text),
    key("WIDTH", Kind::Whole(1, 16_384)),
    key("HEIGHT", Kind::Whole(1, 16_384)),
    key("HEATSCALE", Kind::Above(0.0)),
    key("PIXEL_SAMPLES", Kind::Whole(1, 4096)),
    key("SECONDARY_RAYS", Kind::Flag),
    key("LIGHT_SAMPLES", Kind::Whole(0, 4096)),
    key("SOM_THRESHOLD", Kind::Least(0.0)),
    key("SKIP_OVERLAP_THRESHOLD", Kind::Least(0.0)),
    key("OVERLAP_THRESHOLD", Kind::Least(0.0)),
    key("MIN_SIZE", Kind::Whole(0, u32::MAX as u64)),
    key("SINGLE_GAS", Kind::Flag),
    key("USE_BVH", Kind::Flag),
    key("NODES_TO_TRIS", Kind::Least(0.0)),
];

/// Returns the keys of a file, in the order of the table.
pub(in crate::lab) fn keys_of(sort: Sort) -> &'static [Key] {
    match sort {
        Sort::Scene => &SCENE,
        Sort::Environment => &ENVIRONMENT,
    }
}

impl Key {
    /// Returns the key of a name, in capitals as in `.scn` and `.env` files.
    pub(super) fn named(sort: Sort, name: &str) -> Option<&'static Key> {
        keys_of(sort).iter().find(|key| key.name == name || key.also == Some(name))
    }

    /// Returns the name of the key in TOML.
    pub(super) fn in_toml(&self) -> String {
        self.name.to_ascii_lowercase()
    }

    /// Returns the value that a text states.
    ///
    /// # Errors
    /// What the key expects instead, in words.
    pub(super) fn parse(&self, text: &str) -> Result<Value, String> {
        let number = || text.parse().ok().filter(|x: &f64| x.is_finite());
        let value = match self.kind {
            Kind::Text => Some(Value::Text(text.to_owned())),
            Kind::Least(_) | Kind::Above(_) | Kind::Any => number().map(Value::Number),
            Kind::Whole(..) | Kind::Flags => text.parse().ok().map(Value::Whole),
            Kind::Flag => {
                [("0", false), ("1", true)].into_iter().find(|(name, _)| *name == text).map(|f| Value::Flag(f.1))
            }
            Kind::Vector => numbers(text).map(Value::Vector),
        };
        value.ok_or(()).or_else(|()| self.refuse(text)).and_then(|value| self.checked(value))
    }

    /// Returns the value that TOML states.
    ///
    /// # Errors
    /// What the key expects instead, in words.
    pub(super) fn of_toml(&self, value: &toml::Value) -> Result<Value, String> {
        let read = match (self.kind, value) {
            (Kind::Text, toml::Value::String(text)) => Some(Value::Text(text.clone())),
            (Kind::Flag, toml::Value::Boolean(flag)) => Some(Value::Flag(*flag)),
            (Kind::Whole(..) | Kind::Flags, toml::Value::Integer(n)) => u64::try_from(*n).ok().map(Value::Whole),
            (Kind::Least(_) | Kind::Above(_) | Kind::Any, value) => finite(value).map(Value::Number),
            (Kind::Vector, toml::Value::Array(values)) => vector(values).map(Value::Vector),
            _ => None,
        };
        read.ok_or(()).or_else(|()| self.refuse(&value.to_string())).and_then(|value| self.checked(value))
    }

    fn checked(&self, value: Value) -> Result<Value, String> {
        let is_sound = match (self.kind, &value) {
            (Kind::Text, Value::Text(text)) => !text.trim().is_empty(),
            (Kind::Least(least), Value::Number(x)) => *x >= least,
            (Kind::Above(least), Value::Number(x)) => *x > least,
            (Kind::Whole(least, most), Value::Whole(n)) => (least..=most).contains(n),
            (Kind::Flags, Value::Whole(n)) => *n < 32 && n & 0b1100 != 0b1100,
            _ => true,
        };
        if is_sound { Ok(value) } else { self.refuse(&value.to_string()) }
    }

    fn refuse<T>(&self, text: &str) -> Result<T, String> {
        let expected = match self.kind {
            Kind::Text => "a text that is not empty".to_owned(),
            Kind::Least(least) => format!("a number of at least {least}"),
            Kind::Above(least) => format!("a number above {least}"),
            Kind::Any => "a finite number".to_owned(),
            Kind::Whole(least, most) => format!("an integer from {least} to {most}"),
            Kind::Flag => "0 or 1".to_owned(),
            Kind::Vector => "three numbers".to_owned(),
            Kind::Flags => "a sum of build flags of OptiX, from 0 to 31, with at most one of 4 and 8".to_owned(),
        };
        Err(format!("`{}` is `{text}`, not {expected}", self.name))
    }
}

/// Returns finite numbers with blanks or commas between them.
pub(super) fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let parts = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty());
    let numbers: Option<Vec<f64>> = parts.map(|part| part.parse().ok().filter(|x: &f64| x.is_finite())).collect();
    numbers?.try_into().ok()
}

/// Returns a finite number of TOML.
fn finite(value: &toml::Value) -> Option<f64> {
    match value {
        toml::Value::Float(x) => Some(*x).filter(|x| x.is_finite()),
        toml::Value::Integer(n) => Some(*n as f64),
        _ => None,
    }
}

/// Returns finite numbers of TOML.
pub(super) fn vector<const N: usize>(values: &[toml::Value]) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = values.iter().map(finite).collect();
    numbers?.try_into().ok()
}

/// Returns a value as TOML.
pub(super) fn to_toml(value: &Value) -> toml::Value {
    match value {
        Value::Text(text) => toml::Value::String(text.clone()),
        Value::Number(x) => toml::Value::Float(*x),
        Value::Whole(n) => toml::Value::Integer(i64::try_from(*n).unwrap_or(i64::MAX)),
        Value::Flag(flag) => toml::Value::Boolean(*flag),
        Value::Vector(numbers) => toml::Value::Array(numbers.iter().map(|x| toml::Value::Float(*x)).collect()),
    }
}
