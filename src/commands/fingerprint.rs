//! Hashes of what was read, by which equal files are recognised.

use raykiln_formats::Document;

/// Returns the BLAKE3 hash of a document: of its JSON and of its buffers, as they were read.
pub(crate) fn of_document(doc: &Document) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    add(doc.json.to_string().as_bytes());
    doc.buffers.iter().for_each(|buffer| add(buffer));
    hasher.finalize()
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
}
