//! Wavefront OBJ and MTL, made into a glTF [`Document`].
use crate::{Document, Error};
use std::path::Path;

/// Whether the file is to be read as OBJ.
pub(crate) fn is_obj(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"))
}

pub(crate) fn read(_path: &Path) -> Result<Document, Error> {
    todo!()
}
