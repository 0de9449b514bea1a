//! glTF and GLB: what is read, what is refused, what is written.

mod alpha;
mod attributes;
mod compact;
mod compressed;
mod damage;
mod edit;
mod hierarchy;
mod instancing;
mod memory;
mod outputs;
mod outputs_images;
mod provenance;
mod read;
mod scenes;
mod support;
mod triangles;
mod views;
