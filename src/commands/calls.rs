//! Each command as one function, for programs that use the library.

use std::path::Path;
use std::{env, fs};

use raykiln_formats::Error;
use raykiln_formats::document::Staged;
use raykiln_formats::staging::Folder;

use super::CommandError;
use super::bake::{BakeOptions, Baked, bake as stage};
use super::inspect::inspect as look;
use super::source::Source;
use super::verify::{MatchBy, compare};
use crate::report::{BakeReport, InspectReport, VerifyReport};
use crate::scene::LoadOptions;
use crate::verify::VerifyOptions;

/// Bakes the file `input` (OBJ, glTF or GLB) into the file `output` (`.glb`, or `.gltf` with a `.bin` beside it). If
/// the verification fails, the report says so and `output` is left unchanged.
///
/// # Errors
/// Fails if the input cannot be read, the output cannot be written, or the selected device cannot trace rays.
pub fn bake(
    input: impl AsRef<Path>,
    output: impl AsRef<Path>,
    options: &BakeOptions,
) -> Result<BakeReport, CommandError> {
    let Baked { report, output, .. } = staged(input.as_ref().into(), output.as_ref(), options)?;
    output.map(Staged::commit).transpose()?;
    Ok(report)
}

/// The result of a bake in memory.
#[derive(Debug)]
#[non_exhaustive]
pub struct BakedBytes {
    /// What was done, and the result of the verification.
    pub report: BakeReport,
    /// A GLB file; `None` if the verification failed.
    pub glb: Option<Vec<u8>>,
}

/// Bakes the bytes of a file that refers to no other, such as a GLB; `name` gives its extension and appears in
/// messages. As in [`bake`], the result was written, read back and verified; this uses a hidden folder in the system's
/// temporary folder.
///
/// # Errors
/// Like [`bake`]; also fails if the bytes refer to a file.
pub fn bake_bytes(
    name: impl AsRef<Path>,
    bytes: impl Into<Vec<u8>>,
    options: &BakeOptions,
) -> Result<BakedBytes, CommandError> {
    let temporary = env::temp_dir();
    let folder = Folder::new_in(&temporary).map_err(|e| Error::io(&temporary, "", &e))?;
    let source = Source::Bytes { name: name.as_ref().to_owned(), bytes: bytes.into() };
    let Baked { report, output, .. } = staged(source, &folder.path().join("baked.glb"), options)?;
    let read = |staged: Staged| fs::read(staged.path()).map_err(|e| Error::io(staged.path(), "", &e));
    Ok(BakedBytes { report, glb: output.map(read).transpose()? })
}

/// Inspects a file without changing it.
///
/// # Errors
/// Fails if the input cannot be read.
pub fn inspect(input: impl AsRef<Path>, options: &LoadOptions) -> Result<InspectReport, Error> {
    let source = input.as_ref().into();
    in_pool(|| look(source, options))
}

/// Inspects the bytes of a file that refers to no other; `name` gives its extension and appears in messages.
///
/// # Errors
/// Like [`inspect`]; also fails if the bytes refer to a file.
pub fn inspect_bytes(
    name: impl AsRef<Path>,
    bytes: impl Into<Vec<u8>>,
    options: &LoadOptions,
) -> Result<InspectReport, Error> {
    let source = Source::Bytes { name: name.as_ref().to_owned(), bytes: bytes.into() };
    in_pool(|| look(source, options))
}

/// Traces the same rays through the files `before` and `after`, and compares what they hit and how fast they are
/// traced; `by` selects how triangles are matched.
///
/// # Errors
/// Fails if a file cannot be read, or the selected device cannot trace rays.
pub fn verify(
    before: impl AsRef<Path>,
    after: impl AsRef<Path>,
    by: MatchBy,
    options: &VerifyOptions,
) -> Result<VerifyReport, CommandError> {
    let (before, after) = (before.as_ref(), after.as_ref());
    in_pool(|| compare(before, after, by, options))
}

fn staged(source: Source, output: &Path, options: &BakeOptions) -> Result<Baked, CommandError> {
    in_pool(|| stage(source, output, options, &mut |_| {}))
}

/// Runs a whole command inside the caller's thread pool, or the global one: a parallel loop that starts outside of it
/// costs several system calls per piece of work.
fn in_pool<R: Send>(command: impl FnOnce() -> R + Send) -> R {
    rayon::scope(|_| command())
}
