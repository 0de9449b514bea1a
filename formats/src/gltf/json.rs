//! Typed access to a JSON tree that tracks its place in it, so that errors can name the place.

use std::fmt;
use std::path::Path;

use serde_json::{Map, Value};

use crate::{Document, Error, Warning};

/// Largest number of steps from the root that a place records; deeper ones are omitted from messages.
const DEPTH: usize = 10;

/// One step down a JSON tree.
#[derive(Clone, Copy)]
enum Step<'v> {
    Key(&'v str),
    Index(usize),
}

/// A JSON value and its place in the file.
#[derive(Clone, Copy)]
pub(super) struct At<'v> {
    pub(super) value: &'v Value,
    file: &'v Path,
    steps: [Step<'v>; DEPTH],
    depth: usize,
}

impl<'v> At<'v> {
    /// Returns the root of a document.
    pub(super) fn root(doc: &'v Document) -> Self {
        At::new(&doc.path, &doc.json)
    }

    /// Returns the root of a file's JSON.
    pub(super) fn new(file: &'v Path, value: &'v Value) -> Self {
        At { value, file, steps: [Step::Index(0); DEPTH], depth: 0 }
    }

    fn down(mut self, step: Step<'v>, value: &'v Value) -> Self {
        if let Some(slot) = self.steps.get_mut(self.depth) {
            *slot = step;
            self.depth += 1;
        }
        At { value, ..self }
    }

    /// Creates an error at this place.
    pub(super) fn error(&self, cause: impl fmt::Display) -> Error {
        Error::at(self.file, self.to_string(), cause)
    }

    /// Creates an error at a property of this object, present or not.
    pub(super) fn error_at(&self, key: &'v str, cause: impl fmt::Display) -> Error {
        self.down(Step::Key(key), self.value).error(cause)
    }

    /// Creates a warning at this place.
    pub(super) fn warning(&self, message: impl fmt::Display) -> Warning {
        Warning { place: self.to_string(), message: message.to_string() }
    }

    /// Returns this value as an object.
    pub(super) fn object(&self) -> Result<&'v Map<String, Value>, Error> {
        self.value.as_object().ok_or_else(|| self.error("an object is expected"))
    }

    /// Returns a property of this object; `None` if it is absent.
    pub(super) fn get(&self, key: &'v str) -> Option<At<'v>> {
        self.value.get(key).map(|value| self.down(Step::Key(key), value))
    }

    /// Returns a required property.
    pub(super) fn need(&self, key: &'v str) -> Result<At<'v>, Error> {
        self.get(key).ok_or_else(|| self.error_at(key, "is missing"))
    }

    /// Returns an element of this array.
    pub(super) fn element(&self, index: usize) -> Option<At<'v>> {
        self.value.get(index).map(|value| self.down(Step::Index(index), value))
    }

    /// Returns all elements of this array.
    pub(super) fn elements(self) -> Result<impl ExactSizeIterator<Item = At<'v>> + Clone, Error> {
        let list = self.value.as_array().ok_or_else(|| self.error("an array is expected"))?;
        Ok(list.iter().enumerate().map(move |(i, value)| self.down(Step::Index(i), value)))
    }

    /// Returns all properties of this object, in file order.
    pub(super) fn entries(self) -> Result<impl Iterator<Item = (&'v str, At<'v>)>, Error> {
        let object = self.object()?;
        Ok(object.iter().map(move |(key, value)| (key.as_str(), self.down(Step::Key(key), value))))
    }

    /// Returns the elements of an array property; none if it is absent.
    pub(super) fn list(&self, key: &'v str) -> Result<impl ExactSizeIterator<Item = At<'v>> + Clone + use<'v>, Error> {
        static NONE: Value = Value::Array(Vec::new());
        self.get(key).unwrap_or_else(|| self.down(Step::Key(key), &NONE)).elements()
    }

    /// Returns the number of elements of an array property; 0 if it is absent or not an array.
    pub(super) fn count(&self, key: &str) -> usize {
        self.value.get(key).and_then(Value::as_array).map_or(0, Vec::len)
    }

    /// Returns this value as a non-negative integer.
    pub(super) fn integer(&self) -> Result<usize, Error> {
        unsigned(self.value)
            .ok_or_else(|| self.error(format_args!("expected an unsigned integer, found {}", Short(self.value))))
    }

    /// Returns this value as a finite number within the range of a 32-bit float.
    pub(super) fn number(&self) -> Result<f64, Error> {
        let x = self
            .value
            .as_f64()
            .ok_or_else(|| self.error(format_args!("expected a number, found {}", Short(self.value))))?;
        if x.abs() <= f64::from(f32::MAX) {
            Ok(x)
        } else {
            Err(self.error(format_args!("{x:e} is beyond the range of 32-bit floats")))
        }
    }

    /// Returns this array as exactly `N` numbers.
    pub(super) fn numbers<const N: usize>(&self) -> Result<[f64; N], Error> {
        let list = self.elements()?;
        if list.len() != N {
            return Err(self.error(format_args!("{N} numbers are expected, there are {}", list.len())));
        }
        let mut all = [0.0; N];
        for (slot, item) in all.iter_mut().zip(list) {
            *slot = item.number()?;
        }
        Ok(all)
    }

    /// Returns this value as a string.
    pub(super) fn string(&self) -> Result<&'v str, Error> {
        self.value.as_str().ok_or_else(|| self.error(format_args!("expected a string, found {}", Short(self.value))))
    }

    /// Returns this value as a boolean.
    pub(super) fn boolean(&self) -> Result<bool, Error> {
        self.value.as_bool().ok_or_else(|| self.error(format_args!("{} is neither true nor false", Short(self.value))))
    }

    /// Returns this value as an index into the top-level list `list`, which has `len` elements.
    pub(super) fn index_into(&self, list: &str, len: usize) -> Result<usize, Error> {
        let index = self.integer()?;
        if index < len {
            Ok(index)
        } else {
            Err(self.error(format_args!("{list}[{index}] does not exist; there are {len} {list}")))
        }
    }

    /// Returns an index property, see [`At::index_into`]; `None` if it is absent.
    pub(super) fn index(&self, key: &'v str, list: &str, len: usize) -> Result<Option<usize>, Error> {
        self.get(key).map(|at| at.index_into(list, len)).transpose()
    }

    /// Returns the `name` property, if it is a string.
    pub(super) fn name(&self) -> Option<String> {
        self.value.get("name").and_then(Value::as_str).map(str::to_owned)
    }

    /// Returns an extension of this object.
    pub(super) fn extension(&self, name: &'v str) -> Option<At<'v>> {
        self.get("extensions")?.get(name)
    }
}

impl fmt::Display for At<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, step) in self.steps[..self.depth].iter().enumerate() {
            match step {
                Step::Key(key) if i == 0 => write!(f, "{key}")?,
                Step::Key(key) => write!(f, ".{key}")?,
                Step::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}

/// A JSON value, shortened for messages.
struct Short<'v>(&'v Value);

impl fmt::Display for Short<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Value::Array(_) => f.write_str("an array"),
            Value::Object(_) => f.write_str("an object"),
            Value::String(s) if s.chars().count() > 40 => write!(f, "\"{}…\"", s.chars().take(40).collect::<String>()),
            other => write!(f, "{other}"),
        }
    }
}

/// Returns a JSON number as an unsigned integer; `3.0` counts as 3.
pub(crate) fn unsigned(value: &Value) -> Option<usize> {
    const EXACT: f64 = 9_007_199_254_740_992.0; // 2^53
    if let Some(n) = value.as_u64() {
        return usize::try_from(n).ok();
    }
    value.as_f64().filter(|x| x.fract() == 0.0 && (0.0..EXACT).contains(x)).map(|x| x as usize)
}
