//! From JSON to [`Contents`], with every check.
use crate::{Contents, Document, Error, ReadOptions};

pub(crate) fn contents(_doc: &Document, _options: ReadOptions) -> Result<Contents, Error> {
    todo!()
}
