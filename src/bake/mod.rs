//! The pipeline of a bake.
