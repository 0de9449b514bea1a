//! Something for each kind of rays.

use std::ops::{Index, IndexMut};

use serde::{Serialize, Serializer};

use super::rays::RayKind;

const COUNT: usize = RayKind::ALL.len();

/// Something for each kind of rays, in the order of [`RayKind::ALL`]. Serialised as an object with the kinds' names as keys.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerKind<T>([T; COUNT]);

impl<T> PerKind<T> {
    /// What a function gives for each kind.
    pub fn of(value: impl FnMut(RayKind) -> T) -> PerKind<T> {
        PerKind(RayKind::ALL.map(value))
    }

    /// As [`PerKind::of`], up to the first error.
    ///
    /// # Errors
    /// That of the function.
    pub fn try_of<E>(value: impl FnMut(RayKind) -> Result<T, E>) -> Result<PerKind<T>, E> {
        let values = RayKind::ALL.into_iter().map(value).collect::<Result<Vec<T>, E>>()?;
        Ok(PerKind(values.try_into().unwrap_or_else(|_| unreachable!("one value per kind"))))
    }

    /// What a function makes of each value.
    pub fn map<U>(self, f: impl FnMut(T) -> U) -> PerKind<U> {
        PerKind(self.0.map(f))
    }

    /// References to the values.
    pub fn each_ref(&self) -> PerKind<&T> {
        PerKind(self.0.each_ref())
    }

    /// The kinds with their values.
    pub fn iter(&self) -> impl Iterator<Item = (RayKind, &T)> {
        RayKind::ALL.into_iter().zip(&self.0)
    }

    /// As [`PerKind::iter`], to change the values.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = (RayKind, &mut T)> {
        RayKind::ALL.into_iter().zip(&mut self.0)
    }

    /// The values alone.
    pub fn values(&self) -> impl Iterator<Item = &T> {
        self.0.iter()
    }
}

impl<T> From<[T; COUNT]> for PerKind<T> {
    fn from(values: [T; COUNT]) -> PerKind<T> {
        PerKind(values)
    }
}

impl<T> Index<RayKind> for PerKind<T> {
    type Output = T;

    fn index(&self, kind: RayKind) -> &T {
        &self.0[kind as usize]
    }
}

impl<T> IndexMut<RayKind> for PerKind<T> {
    fn index_mut(&mut self, kind: RayKind) -> &mut T {
        &mut self.0[kind as usize]
    }
}

impl<T: Serialize> Serialize for PerKind<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().map(|(kind, value)| (kind.name(), value)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_kinds_is_in_the_order_of_the_index() {
        let per_kind = PerKind::of(|kind| kind);
        assert!(RayKind::ALL.into_iter().all(|kind| per_kind[kind] == kind));
        assert!(per_kind.iter().all(|(kind, value)| kind == *value));
    }

    #[test]
    fn the_first_error_counts() {
        let only = |wanted| move |kind| if kind == wanted { Ok(()) } else { Err(kind) };
        assert_eq!(PerKind::try_of(only(RayKind::Primary)), Err(RayKind::Shadow));
        assert_eq!(PerKind::try_of(|_| Ok::<_, RayKind>(1)), Ok(PerKind::from([1; COUNT])));
    }

    #[test]
    fn json_has_the_names_as_keys_in_their_order() {
        let json = serde_json::to_string(&PerKind::from([1, 2, 3, 4])).expect("numbers");
        assert_eq!(json, r#"{"primary":1,"shadow":2,"diffuse":3,"random":4}"#);
    }
}
