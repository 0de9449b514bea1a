//! BLASes of meshes that deform: refitted in place or built anew, all of them in one batch.

use ash::vk;

use super::blas::BOTTOM;
use super::inputs::{self, Addresses, describe};
use super::plan::{Group, Plan};
use super::structure::{ALIGNMENT, Sizes, Structure, sizes};
use super::{Blases, BuildOptions};
use crate::scene::Scene;
use crate::verify::frames::Upkeep;
use crate::verify::vulkan::Error;
use crate::verify::vulkan::commands::Timer;
use crate::verify::vulkan::device::Device;
use crate::verify::vulkan::memory::{Buffer, Packing, Purpose};
use crate::verify::vulkan::transfer::Uploader;

/// The BLASes of the meshes that deform, and what they are built from.
pub(in crate::verify::vulkan) struct Deforming<'d> {
    device: &'d Device,
    groups: Vec<Deformed>,
    flags: vk::BuildAccelerationStructureFlagsKHR,
    memory: Memory<'d>,
    timer: Timer<'d>,
}

/// The memory of all BLASes that deform.
struct Memory<'d> {
    sizes: Vec<Sizes>,
    /// What the device copies positions from, and the bytes in use.
    staging: Buffer<'d>,
    bytes: u64,
    positions: Buffer<'d>,
    /// By BLAS and geometry.
    position_offsets: Vec<Vec<u64>>,
    triangles: Buffer<'d>,
    triangle_offsets: Vec<Vec<u64>>,
    storage: Buffer<'d>,
    places: Packing,
    scratch: Buffer<'d>,
}

/// One of the BLASes.
struct Deformed {
    group: Group,
    handle: vk::AccelerationStructureKHR,
    /// By geometry.
    addresses: Vec<Addresses>,
    /// Offset of the positions of each geometry.
    offsets: Vec<u64>,
    scratch: u64,
}

impl<'d> Deforming<'d> {
    /// Builds the BLASes of the given meshes such that they can be updated, without compaction, in place of those that there
    /// are. Must outlive `blases`.
    pub(in crate::verify::vulkan) fn new(
        device: &'d Device,
        scene: &Scene,
        plan: &Plan,
        (options, meshes): (&BuildOptions, &[usize]),
        blases: &mut Blases<'d>,
    ) -> Result<Deforming<'d>, Error> {
        let numbered = plan.groups.iter().enumerate().filter(|(_, group)| meshes.contains(&group.mesh));
        let (numbers, groups): (Vec<usize>, Vec<&Group>) = numbered.unzip();
        let flags = BuildOptions { allow_update: true, ..*options }.flags();
        let memory = Memory::new(device, scene, &groups, flags)?;
        let mut deformed = Vec::with_capacity(groups.len());
        for (i, group) in groups.into_iter().enumerate() {
            let structure = memory.structure(device, i)?;
            deformed.push(Deformed {
                group: group.clone(),
                handle: structure.handle,
                addresses: memory.addresses(i),
                offsets: memory.position_offsets[i].clone(),
                scratch: memory.scratch_address(device, i),
            });
            blases.replace(numbers[i], structure);
        }
        let mut deforming = Deforming { device, groups: deformed, flags, memory, timer: Timer::new(device)? };
        deforming.update(scene, plan, Upkeep::Rebuild)?;
        Ok(deforming)
    }

    /// Brings the BLASes up to date; returns the milliseconds it took, without the transfer of the positions.
    pub(in crate::verify::vulkan) fn update(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        upkeep: Upkeep,
    ) -> Result<f64, Error> {
        if self.groups.is_empty() {
            return Ok(0.0);
        }
        self.write(scene, plan);
        let described: Vec<_> =
            self.groups.iter().map(|of| describe(of.group.geometries(scene), of.addresses.iter().copied())).collect();
        let builds: Vec<_> =
            self.groups.iter().zip(&described).map(|(of, geometries)| self.info(of, geometries, upkeep)).collect();
        let range = |count: u32| vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count);
        let ranges: Vec<Vec<_>> =
            self.groups.iter().map(|of| primitives(scene, &of.group).into_iter().map(range).collect()).collect();
        let ranges: Vec<&[_]> = ranges.iter().map(Vec::as_slice).collect();
        self.device.submit("updating BLASes", |commands| {
            self.device.barrier(commands);
            let copy = vk::BufferCopy::default().size(self.memory.bytes);
            // SAFETY: both buffers hold this many bytes; the target can be copied to.
            unsafe {
                let (from, to) = (self.memory.staging.handle, self.memory.positions.handle);
                self.device.handle.cmd_copy_buffer(commands, from, to, &[copy]);
            }
            self.device.barrier(commands);
            self.timer.measure(commands, || {
                // SAFETY: inputs, structures and scratch memory outlive the submission, are sized for these descriptions,
                // which are the same in each frame but for the positions, and do not overlap. The first update is a build.
                unsafe { self.device.structures.cmd_build_acceleration_structures(commands, &builds, &ranges) }
            });
            self.device.barrier(commands);
        })?;
        self.timer.milliseconds()
    }

    /// Writes the positions of all geometries to host memory.
    fn write(&mut self, scene: &Scene, plan: &Plan) {
        let bytes = self.memory.staging.bytes_mut();
        for of in &self.groups {
            let scale = plan.scales.meshes[of.group.mesh];
            for (geometry, offset) in of.group.geometries(scene).iter().zip(&of.offsets) {
                let positions = inputs::positions(geometry, scale);
                bytes[*offset as usize..][..positions.len()].copy_from_slice(&positions);
            }
        }
    }

    fn info<'g>(
        &self,
        of: &Deformed,
        geometries: &'g [vk::AccelerationStructureGeometryKHR<'g>],
        upkeep: Upkeep,
    ) -> vk::AccelerationStructureBuildGeometryInfoKHR<'g> {
        let build = info(geometries, self.flags)
            .dst_acceleration_structure(of.handle)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: of.scratch });
        match upkeep {
            Upkeep::Rebuild => build,
            Upkeep::Refit => {
                build.mode(vk::BuildAccelerationStructureModeKHR::UPDATE).src_acceleration_structure(of.handle)
            }
        }
    }
}

impl<'d> Memory<'d> {
    fn new(
        device: &'d Device,
        scene: &Scene,
        groups: &[&Group],
        flags: vk::BuildAccelerationStructureFlagsKHR,
    ) -> Result<Memory<'d>, Error> {
        let what = format!("{} BLASes that deform", groups.len());
        let sizes: Vec<Sizes> = groups.iter().map(|group| sizes_of(device, scene, group, flags)).collect();
        let (bytes, position_offsets) = packed(scene, groups, |g| size_of_val(&g.positions[..]));
        let (triangle_bytes, triangle_offsets) = packed(scene, groups, |g| size_of_val(&g.triangles[..]));
        let triangles = Buffer::new(device, &what, triangle_bytes, Purpose::BuildInput)?;
        upload_triangles(device, scene, groups, (&triangles, &triangle_offsets))?;
        let places = Packing::new(sizes.iter().map(|s| s.structure), ALIGNMENT, u64::MAX);
        let alignment = device.info().limits.scratch_alignment;
        let scratch = sizes.iter().map(|s| s.scratch_of(alignment)).sum::<u64>() + alignment;
        Ok(Memory {
            staging: Buffer::new(device, &what, bytes, Purpose::Upload)?,
            bytes,
            positions: Buffer::new(device, &what, bytes, Purpose::BuildInput)?,
            position_offsets,
            triangles,
            triangle_offsets,
            storage: Buffer::new(device, &what, places.buffers.iter().sum(), Purpose::Structures)?,
            places,
            scratch: Buffer::new(device, &format!("scratch memory of {what}"), scratch, Purpose::Scratch)?,
            sizes,
        })
    }

    /// Creates the structure of a BLAS.
    fn structure(&self, device: &'d Device, blas: usize) -> Result<Structure<'d>, Error> {
        let place = (&self.storage, self.places.places[blas].offset);
        Structure::new(device, "a BLAS that deforms", BOTTOM, place, self.sizes[blas].structure)
    }

    /// Returns where the geometries of a BLAS are.
    fn addresses(&self, blas: usize) -> Vec<Addresses> {
        let at = |(positions, triangles): (&u64, &u64)| Addresses {
            positions: self.positions.address + positions,
            triangles: self.triangles.address + triangles,
        };
        self.position_offsets[blas].iter().zip(&self.triangle_offsets[blas]).map(at).collect()
    }

    /// Returns where the scratch memory of a BLAS starts.
    fn scratch_address(&self, device: &Device, blas: usize) -> u64 {
        let alignment = device.info().limits.scratch_alignment;
        let before = self.sizes[..blas].iter().map(|s| s.scratch_of(alignment)).sum::<u64>();
        self.scratch.address.next_multiple_of(alignment) + before
    }
}

impl Sizes {
    /// Returns the scratch memory for builds and updates.
    fn scratch_of(&self, alignment: u64) -> u64 {
        self.scratch.max(self.update_scratch).next_multiple_of(alignment)
    }
}

/// Uploads the triangles of all geometries, which stay.
fn upload_triangles(
    device: &Device,
    scene: &Scene,
    groups: &[&Group],
    (buffer, offsets): (&Buffer<'_>, &[Vec<u64>]),
) -> Result<(), Error> {
    let mut uploader = Uploader::new(device, buffer.size)?;
    for (group, offsets) in groups.iter().zip(offsets) {
        for (geometry, offset) in group.geometries(scene).iter().zip(offsets) {
            uploader.write(buffer, *offset, &inputs::triangles(geometry))?;
        }
    }
    uploader.flush()
}

/// Places arrays of all geometries one after the other; returns the bytes of all, and the offset of each.
fn packed(scene: &Scene, groups: &[&Group], bytes: impl Fn(&crate::scene::Geometry) -> usize) -> (u64, Vec<Vec<u64>>) {
    let mut end = 0u64;
    let mut next = |size: usize| {
        let start = end.next_multiple_of(inputs::ALIGNMENT);
        end = start + size as u64;
        start
    };
    let offsets = groups.iter().map(|group| group.geometries(scene).iter().map(|g| next(bytes(g))).collect()).collect();
    (end, offsets)
}

fn primitives(scene: &Scene, group: &Group) -> Vec<u32> {
    group.geometries(scene).iter().map(|g| g.triangles.len() as u32).collect()
}

fn sizes_of(device: &Device, scene: &Scene, group: &Group, flags: vk::BuildAccelerationStructureFlagsKHR) -> Sizes {
    let geometries = describe(group.geometries(scene), std::iter::repeat(Addresses::default()));
    sizes(device, &info(&geometries, flags), &primitives(scene, group))
}

fn info<'g>(
    geometries: &'g [vk::AccelerationStructureGeometryKHR<'g>],
    flags: vk::BuildAccelerationStructureFlagsKHR,
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'g> {
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(BOTTOM)
        .flags(flags)
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(geometries)
}
