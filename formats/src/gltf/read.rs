//! From file to [`Document`].
use crate::{Document, Error};
use std::path::Path;

pub(crate) fn read(_path: &Path) -> Result<Document, Error> {
    todo!()
}
