//! From a document to a [`Scene`].
use super::Scene;
use raykiln_formats::{Document, Error};

/// How to read a scene.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Refuse what would otherwise be a warning about the data.
    pub strict: bool,
    /// Glob patterns of node, mesh and object names to be pinned.
    pub keep: Vec<String>,
}

/// Makes the scene a ray tracer sees of the document's default scene; also returns warnings.
pub fn load(_doc: &Document, _options: &LoadOptions) -> Result<(Scene, Vec<raykiln_formats::Warning>), Error> {
    todo!()
}
