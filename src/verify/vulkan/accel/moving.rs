//! A TLAS over instances that move: refitted in place or built anew in each frame.

use ash::vk;
use rayon::prelude::*;

use super::plan::Plan;
use super::structure::{ALIGNMENT, Structure, sizes};
use super::tlas::{Record, TOP, describe, moving_record};
use super::{Blases, BuildOptions};
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::Scene;
use crate::verify::frames::Upkeep;
use crate::verify::vulkan::Error;
use crate::verify::vulkan::device::Device;
use crate::verify::vulkan::memory::{Buffer, Purpose};

/// The matrices of all instances, in host memory and on the device.
pub(in crate::verify::vulkan) struct Matrices<'d> {
    device: &'d Device,
    staging: Buffer<'d>,
    instances: Buffer<'d>,
    bytes: u64,
}

impl<'d> Matrices<'d> {
    /// Allocates room for the entries of a plan.
    pub(in crate::verify::vulkan) fn new(device: &'d Device, plan: &Plan) -> Result<Matrices<'d>, Error> {
        let bytes = (plan.entries.len() * size_of::<Record>()) as u64;
        let what = format!("{} instances", plan.entries.len());
        Ok(Matrices {
            device,
            staging: Buffer::new(device, &what, bytes, Purpose::Upload)?,
            instances: Buffer::new(device, &what, bytes, Purpose::BuildInput)?,
            bytes,
        })
    }

    /// Writes the instances of a scene to host memory.
    pub(in crate::verify::vulkan) fn write(&mut self, scene: &Scene, plan: &Plan, blases: &Blases<'d>) {
        let bytes = &mut self.staging.bytes_mut()[..self.bytes as usize];
        let records: &mut [Record] = bytemuck::cast_slice_mut(bytes);
        let write = |(index, (record, entry)): (usize, (&mut Record, &super::plan::Entry))| {
            *record = moving_record(index as u32, &plan.transform(scene, entry), blases.address(entry.group as usize));
        };
        records.par_iter_mut().zip(&plan.entries).enumerate().with_min_len(CHEAP_ELEMENTS).for_each(write);
    }

    /// Records the copy to the device.
    pub(in crate::verify::vulkan) fn upload(&self, commands: vk::CommandBuffer) {
        if self.bytes > 0 {
            let copy = vk::BufferCopy::default().size(self.bytes);
            // SAFETY: both buffers hold this many bytes; the target can be copied to.
            unsafe {
                self.device.handle.cmd_copy_buffer(commands, self.staging.handle, self.instances.handle, &[copy]);
            }
        }
        self.device.barrier(commands);
    }
}

/// A TLAS with its memory, for any number of frames.
pub(in crate::verify::vulkan) struct MovingTlas<'d> {
    device: &'d Device,
    structure: Structure<'d>,
    /// Declared after the structure, which is dropped first.
    _storage: Buffer<'d>,
    scratch: Buffer<'d>,
    flags: vk::BuildAccelerationStructureFlagsKHR,
    count: u32,
    pub(in crate::verify::vulkan) bytes: u64,
}

impl<'d> MovingTlas<'d> {
    /// Allocates a TLAS, which must be rebuilt before it is refitted or traced. `refits` tells whether it may be refitted,
    /// which costs memory and speed.
    pub(in crate::verify::vulkan) fn new(
        device: &'d Device,
        plan: &Plan,
        options: &BuildOptions,
        refits: bool,
    ) -> Result<MovingTlas<'d>, Error> {
        let count = plan.entries.len() as u32;
        let what = format!("a TLAS of {count} instances");
        let flags = BuildOptions { allow_update: refits, ..*options }.flags();
        let geometries = [describe(0)];
        let build = info(&geometries, flags);
        let sizes = sizes(device, &build, &[count]);
        let storage = Buffer::new(device, &what, sizes.structure, Purpose::Structures)?;
        let structure = Structure::new(device, &what, TOP, (&storage, 0), sizes.structure)?;
        let scratch = sizes.scratch.max(sizes.update_scratch) + alignment(device);
        let scratch = Buffer::new(device, &format!("scratch memory of {what}"), scratch, Purpose::Scratch)?;
        Ok(MovingTlas { device, structure, _storage: storage, scratch, flags, count, bytes: sizes.structure })
    }

    /// Records a refit or a rebuild from the instances on the device.
    pub(in crate::verify::vulkan) fn record(
        &self,
        commands: vk::CommandBuffer,
        matrices: &Matrices<'d>,
        upkeep: Upkeep,
    ) {
        let geometries = [describe(matrices.instances.address)];
        let mut build = info(&geometries, self.flags).dst_acceleration_structure(self.structure.handle);
        build.scratch_data.device_address = self.scratch.address.next_multiple_of(alignment(self.device));
        if upkeep == Upkeep::Refit {
            assert!(self.flags.contains(vk::BuildAccelerationStructureFlagsKHR::ALLOW_UPDATE), "it may be refitted");
            build = build
                .mode(vk::BuildAccelerationStructureModeKHR::UPDATE)
                .src_acceleration_structure(self.structure.handle);
        }
        let range = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(self.count)];
        // SAFETY: instances, structure and scratch memory outlive the submission and are sized for this description,
        // which is the same in each frame; the instances refer to built BLASes, and none becomes active or inactive. An
        // update follows a build, as the caller ensures.
        unsafe { self.device.structures.cmd_build_acceleration_structures(commands, &[build], &[&range]) };
        self.device.barrier(commands);
    }

    /// Returns the device address.
    pub(in crate::verify::vulkan) fn address(&self) -> u64 {
        self.structure.address
    }
}

fn info<'g>(
    geometries: &'g [vk::AccelerationStructureGeometryKHR<'g>],
    flags: vk::BuildAccelerationStructureFlagsKHR,
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'g> {
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(TOP)
        .flags(flags)
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(geometries)
}

/// Alignment of scratch memory, in bytes.
fn alignment(device: &Device) -> u64 {
    device.info().limits.scratch_alignment.max(ALIGNMENT)
}
