//! Alpha textures on a device, each stored once and shared by all tracers.

use std::cell::RefCell;
use std::collections::HashMap;

use raykiln_formats::alpha::Bytes;

use super::image::Alpha;
use crate::parallel;
use crate::scene::Image;
use crate::verify::vulkan::Error;
use crate::verify::vulkan::device::Device;
use crate::verify::vulkan::memory::{Buffer, Packing, Purpose};
use crate::verify::vulkan::transfer::Uploader;

/// Alignment of textures, in bytes.
const ALIGNMENT: u64 = 16;

/// The alpha of an image on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Texture {
    /// Address of the texels: one byte each, in rows from the top.
    pub(super) address: u64,
    pub(super) size: [u32; 2],
}

/// A texture, or the reason why it is missing.
pub(super) type Found = Result<Texture, String>;

/// All textures, keyed by their encoded bytes.
pub(in crate::verify::vulkan) struct Textures<'d> {
    device: &'d Device,
    known: RefCell<Known<'d>>,
}

#[derive(Default)]
struct Known<'d> {
    found: HashMap<Bytes, Found>,
    buffers: Vec<Buffer<'d>>,
}

impl<'d> Textures<'d> {
    pub(in crate::verify::vulkan) fn new(device: &'d Device) -> Textures<'d> {
        Textures { device, known: RefCell::default() }
    }

    /// Returns the textures of images; new images are decoded a few at a time.
    pub(super) fn of(&self, images: &[Image]) -> Result<Vec<Found>, Error> {
        let mut all = Vec::with_capacity(images.len());
        for images in images.chunks(rayon::current_num_threads()) {
            let encoded: Vec<Result<Bytes, String>> = parallel::map_each(images, &Image::read);
            self.learn(&encoded)?;
            let known = &self.known.borrow().found;
            all.extend(encoded.into_iter().map(|bytes| bytes.and_then(|bytes| known[&bytes].clone())));
        }
        Ok(all)
    }

    fn learn(&self, encoded: &[Result<Bytes, String>]) -> Result<(), Error> {
        let mut known = self.known.borrow_mut();
        let mut new: Vec<&Bytes> = encoded.iter().flatten().filter(|bytes| !known.found.contains_key(*bytes)).collect();
        new.sort_unstable();
        new.dedup();
        let decoded: Vec<Result<Alpha, String>> = parallel::map_each(&new, &|bytes| Alpha::decode(bytes));
        let (addresses, buffers) = upload(self.device, &decoded)?;
        known.buffers.extend(buffers);
        let mut addresses = addresses.into_iter();
        for (bytes, alpha) in new.into_iter().zip(decoded) {
            let found = alpha.map(|a| Texture { address: addresses.next().unwrap_or_default(), size: a.size });
            known.found.insert(bytes.clone(), found);
        }
        Ok(())
    }
}

/// Uploads the decoded images and returns the address of each.
fn upload<'d>(device: &'d Device, decoded: &[Result<Alpha, String>]) -> Result<(Vec<u64>, Vec<Buffer<'d>>), Error> {
    let sound: Vec<&Alpha> = decoded.iter().flatten().collect();
    let packing = Packing::new(sound.iter().map(|a| padded(a)), ALIGNMENT, device.info().limits.max_allocation);
    let what = format!("the alpha of {} images", sound.len());
    let buffers = packing.allocate(device, &what, Purpose::ShaderData)?;
    if !sound.is_empty() {
        let mut uploader = Uploader::new(device, packing.buffers.iter().sum())?;
        for (alpha, place) in sound.iter().zip(&packing.places) {
            uploader.write(&buffers[place.buffer], place.offset, &alpha.texels)?;
        }
        uploader.flush()?;
    }
    let addresses = packing.places.iter().map(|p| buffers[p.buffer].address + p.offset).collect();
    Ok((addresses, buffers))
}

/// Returns the size of a texture rounded up to whole words, which shaders read.
fn padded(alpha: &Alpha) -> u64 {
    (alpha.texels.len() as u64).next_multiple_of(4)
}
