//! [`Key`]: the hash of everything that decides a result.

use std::fmt;
use std::fs::File;
use std::io;
use std::path::Path;

use blake3::{Hash, Hasher};

/// The BLAKE3 hash (J. O'Connor, J.-P. Aumasson, S. Neves, Z. Wilcox-O'Hearn, "BLAKE3: one function, fast everywhere",
/// 2020) of everything that decides a result. Prints as 64 hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(Hash);

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.to_hex())
    }
}

/// Collects what decides a result.
#[derive(Debug, Default)]
pub struct KeyBuilder(Hasher);

impl KeyBuilder {
    /// Adds bytes and their number, so that what follows cannot be taken for them.
    pub fn add(&mut self, bytes: impl AsRef<[u8]>) -> &mut Self {
        let bytes = bytes.as_ref();
        self.0.update(&(bytes.len() as u64).to_le_bytes()).update(bytes);
        self
    }

    /// Adds the content of a file.
    ///
    /// # Errors
    /// Fails if the file cannot be read.
    pub fn add_file(&mut self, path: &Path) -> io::Result<&mut Self> {
        let mut content = Hasher::new();
        content.update_reader(File::open(path)?)?;
        Ok(self.add(content.finalize().as_bytes()))
    }

    /// Returns the key.
    pub fn finish(&self) -> Key {
        Key(self.0.finalize())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(parts: &[&str]) -> Key {
        let mut builder = KeyBuilder::default();
        parts.iter().for_each(|part| _ = builder.add(part));
        builder.finish()
    }

    #[test]
    fn the_same_bytes_in_other_parts_have_another_key() {
        assert_eq!(key(&["ab", "c"]), key(&["ab", "c"]));
        assert_ne!(key(&["ab", "c"]), key(&["a", "bc"]));
        assert_ne!(key(&["ab"]), key(&["ab", ""]));
        assert_eq!(key(&[]).to_string().len(), 64);
    }

    #[test]
    fn a_file_counts_by_its_content() {
        let folder = tempfile::tempdir().expect("a folder");
        let of = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).expect("writable");
            KeyBuilder::default().add_file(&folder.path().join(name)).map(|builder| builder.finish()).expect("readable")
        };
        assert_eq!(of("a", "text"), of("b", "text"));
        assert_ne!(of("a", "text"), of("a", "test"));
        assert!(KeyBuilder::default().add_file(&folder.path().join("absent")).is_err());
    }
}
