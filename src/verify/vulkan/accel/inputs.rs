//! Upload of the triangles that a batch of BLASes is built from.

use std::borrow::Cow;

use ash::vk;
use glam::Vec3;

use super::plan::Group;
use super::scale::Scales;
use crate::scene::{Geometry, Opacity, Scene};
use crate::verify::vulkan::Error;
use crate::verify::vulkan::device::Device;
use crate::verify::vulkan::memory::{Buffer, Packing, Purpose};
use crate::verify::vulkan::transfer::Uploader;

/// Alignment of vertices and indices, in bytes.
pub(super) const ALIGNMENT: u64 = 16;

/// Device addresses of a geometry's vertices and indices.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Addresses {
    pub(super) positions: u64,
    pub(super) triangles: u64,
}

/// Vertices and indices on the device.
pub(super) struct Inputs<'d> {
    _buffers: Vec<Buffer<'d>>,
    addresses: Vec<Addresses>,
}

impl<'d> Inputs<'d> {
    /// Uploads the geometries of the given groups.
    pub(super) fn upload(
        device: &'d Device,
        scene: &Scene,
        groups: &[Group],
        scales: &Scales,
    ) -> Result<Inputs<'d>, Error> {
        let scaled = |group: &Group| (group.geometries(scene), scales.meshes[group.mesh]);
        let arrays: Vec<Cow<'_, [u8]>> = groups
            .iter()
            .map(scaled)
            .flat_map(|(geometries, scale)| geometries.iter().map(move |g| [positions(g, scale), triangles(g)]))
            .flatten()
            .collect();
        let max_buffer = device.info().limits.max_allocation;
        let packing = Packing::new(arrays.iter().map(|a| a.len() as u64), ALIGNMENT, max_buffer);
        let what = format!("the triangles of {} BLASes", groups.len());
        let buffers = packing.allocate(device, &what, Purpose::BuildInput)?;
        let mut uploader = Uploader::new(device, packing.buffers.iter().sum())?;
        for (array, place) in arrays.iter().zip(&packing.places) {
            uploader.write(&buffers[place.buffer], place.offset, array)?;
        }
        uploader.flush()?;
        drop(uploader);
        let addresses: Vec<u64> = packing.places.iter().map(|p| buffers[p.buffer].address + p.offset).collect();
        let pairs = addresses.chunks_exact(2).map(|pair| Addresses { positions: pair[0], triangles: pair[1] });
        Ok(Inputs { addresses: pairs.collect(), _buffers: buffers })
    }

    /// Returns the addresses of the groups' geometries, in order.
    pub(super) fn addresses(&self) -> &[Addresses] {
        &self.addresses
    }
}

/// Returns the number of bytes that [`Inputs::upload`] needs for a geometry.
pub(super) fn input_bytes(geometry: &Geometry) -> u64 {
    let aligned = |bytes: usize| (bytes as u64).next_multiple_of(ALIGNMENT);
    aligned(size_of_val(&geometry.positions[..])) + aligned(size_of_val(&geometry.triangles[..]))
}

pub(super) fn positions(geometry: &Geometry, scale: f64) -> Cow<'_, [u8]> {
    if scale == 1.0 {
        return Cow::Borrowed(bytemuck::cast_slice(&geometry.positions));
    }
    let scaled: Vec<Vec3> = geometry.positions.iter().map(|p| *p * scale as f32).collect();
    Cow::Owned(bytemuck::cast_slice(&scaled).to_vec())
}

pub(super) fn triangles(geometry: &Geometry) -> Cow<'_, [u8]> {
    Cow::Borrowed(bytemuck::cast_slice(&geometry.triangles))
}

/// Describes geometries to a build; addresses do not matter if only sizes are queried.
pub(super) fn describe(
    geometries: &[Geometry],
    addresses: impl Iterator<Item = Addresses>,
) -> Vec<vk::AccelerationStructureGeometryKHR<'static>> {
    geometries.iter().zip(addresses).map(|(geometry, at)| describe_one(geometry, at)).collect()
}

fn describe_one(geometry: &Geometry, at: Addresses) -> vk::AccelerationStructureGeometryKHR<'static> {
    let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
        .vertex_format(vk::Format::R32G32B32_SFLOAT)
        .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: at.positions })
        .vertex_stride(12)
        .max_vertex(geometry.positions.len().saturating_sub(1) as u32)
        .index_type(vk::IndexType::UINT32)
        .index_data(vk::DeviceOrHostAddressConstKHR { device_address: at.triangles });
    let flags = match geometry.opacity {
        Opacity::Opaque => vk::GeometryFlagsKHR::OPAQUE,
        Opacity::Mask { .. } | Opacity::Blend => vk::GeometryFlagsKHR::empty(),
    };
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
        .flags(flags)
}
