//! Puts into words what differs between two files beyond the places of their triangles.

use std::fmt::{self, Display, Formatter};

use super::words::grouped;
use crate::verify::contents::{Detail, Difference};

impl Display for Difference {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "{}", self.kind.name())?;
        if let Some(detail) = &self.detail {
            write!(f, ": {detail}")?;
        }
        match (&self.object, self.count) {
            (Some(object), 0 | 1) => write!(f, " at `{object}`"),
            (Some(object), count) => write!(f, " ({} times, first at `{object}`)", grouped(count)),
            (None, 0 | 1) => Ok(()),
            (None, count) => write!(f, " ({} times)", grouped(count)),
        }
    }
}

impl Display for Detail {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Detail::Property { of, property, before, after } => {
                if let Some(of) = of {
                    write!(f, "`{of}`: ")?;
                }
                let or_none = |value: &Option<String>| value.clone().unwrap_or_else(|| "absent".into());
                write!(f, "{property} was {}, is {}", or_none(before), or_none(after))
            }
            Detail::Attribute { attribute, deviation, allowed } => {
                write!(f, "{attribute} is off by up to {deviation:.3e}, allowed {allowed:.3e}")
            }
        }
    }
}
