//! Inputs of the any-hit shader of timed rays: the texture, texture coordinates and cutoff of each geometry with an
//! alpha-tested material.

mod image;
mod textures;

use super::Error;
use super::accel::Plan;
use super::device::Device;
use super::interface::AlphaGeometry;
use super::memory::{Buffer, Packing, Purpose};
use super::transfer::Uploader;
use crate::scene::{AlphaTest, AlphaTexture, Geometry, Scene, Wrap};
use crate::verify::OpaqueTextures;

pub(super) use textures::Textures;
use textures::{Found, Texture};

/// Alignment of triangles and texture coordinates, in bytes.
const ALIGNMENT: u64 = 16;
/// Number of images named in a note.
const NAMED: usize = 3;

/// The alpha tests of a scene on a device.
#[derive(Default)]
pub(super) struct AlphaTests<'d> {
    _buffers: Vec<Buffer<'d>>,
    /// Address of the list of geometries; 0 if nothing is tested.
    pub(super) geometries: u64,
    /// Address of the list of the first geometry of each TLAS entry.
    pub(super) first_geometries: u64,
    /// Images that could not be loaded.
    pub(super) opaque: Option<OpaqueTextures>,
}

impl<'d> AlphaTests<'d> {
    /// Uploads the alpha tests of a scene.
    pub(super) fn new(
        device: &'d Device,
        textures: &Textures<'d>,
        scene: &Scene,
        plan: &Plan,
    ) -> Result<AlphaTests<'d>, Error> {
        let geometries: Vec<&Geometry> = plan.geometries(scene).collect();
        if geometries.iter().all(|g| g.alpha.is_none()) {
            return Ok(AlphaTests::default());
        }
        let found = textures.of(&scene.images)?;
        let mut arrays = Vec::new();
        let mut tests: Vec<AlphaGeometry> = geometries.iter().map(|g| test(g, &found, &mut arrays)).collect();
        let firsts = plan.first_geometries(scene);
        let (mut buffers, addresses) = upload(device, "triangles of alpha-tested materials", &arrays)?;
        for test in &mut tests {
            let at = |place: u64| if place == 0 { 0 } else { addresses[place as usize - 1] };
            (test.triangles, test.texcoords) = (at(test.triangles), at(test.texcoords));
        }
        let lists: [&[u8]; 2] = [bytemuck::cast_slice(&tests), bytemuck::cast_slice(&firsts)];
        let (more, addresses) = upload(device, "alpha tests", &lists)?;
        buffers.extend(more);
        let opaque = opaque(scene, &found);
        Ok(AlphaTests { _buffers: buffers, geometries: addresses[0], first_geometries: addresses[1], opaque })
    }
}

/// Returns the test of a geometry; arrays it needs are appended to `arrays` and referred to by their position, from 1.
fn test<'s>(geometry: &'s Geometry, found: &[Found], arrays: &mut Vec<&'s [u8]>) -> AlphaGeometry {
    let Some(AlphaTest { cutoff, factor, texture }) = &geometry.alpha else { return AlphaGeometry::ACCEPT };
    let Some(AlphaTexture { image, wrap, texcoords }) = texture else {
        return AlphaGeometry { factor: *factor, cutoff: *cutoff, ..AlphaGeometry::ACCEPT };
    };
    let Ok(Texture { address, size }) = &found[*image as usize] else { return AlphaGeometry::ACCEPT };
    arrays.push(bytemuck::cast_slice(&geometry.triangles));
    arrays.push(bytemuck::cast_slice(texcoords));
    AlphaGeometry {
        triangles: arrays.len() as u64 - 1,
        texcoords: arrays.len() as u64,
        texels: *address,
        size: *size,
        wrap: wrap.map(mode),
        factor: *factor,
        cutoff: *cutoff,
    }
}

fn mode(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::Repeat => 0,
        Wrap::Clamp => 1,
        Wrap::Mirror => 2,
    }
}

/// Uploads arrays in order and returns the address of each.
fn upload<'d>(device: &'d Device, what: &str, arrays: &[&[u8]]) -> Result<(Vec<Buffer<'d>>, Vec<u64>), Error> {
    let sizes = arrays.iter().map(|a| a.len() as u64);
    let packing = Packing::new(sizes, ALIGNMENT, device.info().limits.max_allocation);
    let buffers = packing.allocate(device, what, Purpose::ShaderData)?;
    let mut uploader = Uploader::new(device, packing.buffers.iter().sum())?;
    for (array, place) in arrays.iter().zip(&packing.places) {
        uploader.write(&buffers[place.buffer], place.offset, array)?;
    }
    uploader.flush()?;
    drop(uploader);
    let addresses = packing.places.iter().map(|p| buffers[p.buffer].address + p.offset).collect();
    Ok((buffers, addresses))
}

/// Returns the images that could not be loaded.
fn opaque(scene: &Scene, found: &[Found]) -> Option<OpaqueTextures> {
    let missing: Vec<String> = (scene.images.iter().zip(found))
        .filter_map(|(image, found)| Some(format!("{}: {}", image.name, found.as_ref().err()?)))
        .collect();
    let named = missing[..missing.len().min(NAMED)].to_vec();
    (!missing.is_empty()).then(|| OpaqueTextures { more: missing.len() - named.len(), named })
}
