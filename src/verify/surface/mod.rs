//! Compares the surfaces of two files, triangle by triangle, without what one records about the other.

pub mod pairs;
