//! A store of results on disk, found by a hash of everything that decides them.
//!
//! One file holds one result, so that a result is there as a whole or not at all:
//!
//! ```text
//! raykiln.cache/1
//! BLAKE3 hash of all that follows, in hexadecimal digits
//! JSON in one line: the parts of the result by name and length
//! the bytes of the parts
//! ```
//! A file is written under a temporary name and renamed, and its hash is checked by whoever reads it. Therefore any number
//! of processes on any number of machines may share a folder without locks: two that store the same result write the same
//! bytes, and a file that was damaged or cut short is removed and made again.

mod entry;
mod key;
mod store;

pub use entry::{Entry, Part};
pub use key::{Key, KeyBuilder};
pub use store::{Contents, Store};
