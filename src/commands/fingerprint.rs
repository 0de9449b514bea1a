//! Hashes of files, by which equal ones are recognised.

use std::fs::File;
use std::io;
use std::path::Path;

use blake3::{Hash, Hasher};
use raykiln_formats::document::Staged;
use raykiln_formats::{Document, Error};

use super::source::Source;

/// Returns the BLAKE3 hash of a document: of its JSON and of its buffers, as they were read.
pub(crate) fn of_document(doc: &Document) -> Hash {
    let mut hasher = Hasher::new();
    add(&mut hasher, doc.json.to_string().as_bytes());
    doc.buffers.iter().for_each(|buffer| add(&mut hasher, buffer));
    hasher.finalize()
}

/// Returns the BLAKE3 hash of a source and of the document that was read from it.
///
/// # Errors
/// Fails if the file cannot be read again.
pub(super) fn of_source(source: &Source, doc: &Document) -> Result<Hash, Error> {
    let mut hasher = Hasher::new();
    match source {
        Source::File(path) => update(&mut hasher, path)?,
        Source::Bytes { bytes, .. } => _ = hasher.update(bytes),
    }
    hasher.update(of_document(doc).as_bytes());
    Ok(hasher.finalize())
}

/// Returns the BLAKE3 hash of the files of an output.
///
/// # Errors
/// Fails if a file cannot be read again.
pub(super) fn of_output(staged: &Staged) -> Result<Hash, Error> {
    let mut hasher = Hasher::new();
    staged.files().try_for_each(|file| update(&mut hasher, file))?;
    Ok(hasher.finalize())
}

fn update(hasher: &mut Hasher, path: &Path) -> Result<(), Error> {
    let file = File::open(path).and_then(|file| hasher.update_reader(file).map(|_| ()));
    file.map_err(|e: io::Error| Error::io(path, "", &e))
}

/// Adds bytes and their number, so that what follows cannot be taken for them.
fn add(hasher: &mut Hasher, bytes: &[u8]) {
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(bytes);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(text: &str) -> Document {
        raykiln_formats::read_bytes("scene.obj", text.as_bytes().to_vec()).expect("an OBJ file")
    }

    #[test]
    fn what_differs_in_one_bit_has_another_hash() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        let hash = |text: &str| of_document(&document(text));
        assert_eq!(hash(text), hash(text));
        assert_ne!(hash(text), hash(&text.replace("v 1 0", "v 1.0000001 0")));
        assert_ne!(hash(text), hash(&text.replace("f 1", "o named\nf 1")));
    }

    #[test]
    fn decimals_beyond_single_precision_count_in_the_hash_of_a_source() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        let hash = |text: &str| {
            let source = Source::Bytes { name: "scene.obj".into(), bytes: text.into() };
            of_source(&source, &document(text)).expect("nothing is read")
        };
        assert_eq!(hash(text), hash(text));
        assert_ne!(hash(text), hash(&text.replace("v 1 0", "v 1.00000000001 0")));
    }
}
