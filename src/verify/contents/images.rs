//! Which images of two files are the same.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use raykiln_formats::alpha::{Bytes, Image};

use super::super::Sides;
use super::{Inputs, pixels};

/// The images of two files.
pub(super) struct Images {
    all: Sides<Vec<Image>>,
    known: Mutex<HashMap<(usize, usize), Sameness>>,
}

/// Whether two images are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sameness {
    Same,
    Different,
    /// Neither can be read; they have the same name.
    SameName,
}

impl Images {
    pub(super) fn of(inputs: &Inputs<'_>) -> Images {
        let mut all = inputs.documents.map(|doc| (0..doc.image_count()).map(|i| doc.image(i)).collect::<Vec<_>>());
        if let Some((hidden, folder)) = inputs.staged {
            all.after.iter_mut().for_each(|image| image.also_look(hidden, folder));
        }
        Images { all, known: Mutex::default() }
    }

    /// Compares an image of the input with one of the output; each two are compared once.
    pub(super) fn compare(&self, before: usize, after: usize) -> Sameness {
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let found = known().get(&(before, after)).copied();
        found.unwrap_or_else(|| {
            let found = self.look(before, after);
            known().insert((before, after), found);
            found
        })
    }

    fn look(&self, before: usize, after: usize) -> Sameness {
        let (before, after) = match (self.all.before.get(before), self.all.after.get(after)) {
            (Some(before), Some(after)) => (before, after),
            // A file may refer to images that it does not have.
            (None, None) if before == after => return Sameness::SameName,
            _ => return Sameness::Different,
        };
        match (before.read(), after.read()) {
            (Ok(b), Ok(a)) if are_same(&b, &a) => Sameness::Same,
            (Err(_), Err(_)) if file_name(before) == file_name(after) => Sameness::SameName,
            _ => Sameness::Different,
        }
    }
}

/// Whether two encoded images are the same; slices of one buffer need not be read.
fn are_same(before: &Bytes, after: &Bytes) -> bool {
    before.as_ptr() == after.as_ptr() && before.len() == after.len() || pixels::are_same(before, after)
}

/// Returns the part of an image's name that does not depend on its index.
fn file_name(image: &Image) -> &str {
    image.name.split_once('`').map_or("", |(_, name)| name)
}
