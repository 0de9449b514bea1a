//! The TLAS over all entries of a plan.

use ash::vk;
use glam::DAffine3;

use super::plan::{Plan, can_be_entered};
use super::structure::{ALIGNMENT, Structure, sizes};
use super::{Blases, BuildOptions};
use crate::scene::Scene;
use crate::verify::vulkan::Error;
use crate::verify::vulkan::commands::Timer;
use crate::verify::vulkan::device::Device;
use crate::verify::vulkan::memory::{Buffer, Purpose};
use crate::verify::vulkan::transfer::Uploader;

pub(super) const TOP: vk::AccelerationStructureTypeKHR = vk::AccelerationStructureTypeKHR::TOP_LEVEL;

/// Number of instances written to the device at a time.
const CHUNK: usize = 1 << 16;

/// A built TLAS.
pub(in crate::verify::vulkan) struct Tlas<'d> {
    structure: Structure<'d>,
    /// Declared after the structure, which is dropped first.
    _storage: Buffer<'d>,
    pub(in crate::verify::vulkan) build_ms: f64,
    pub(in crate::verify::vulkan) bytes: u64,
}

/// Mirrors `VkAccelerationStructureInstanceKHR`.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Record {
    /// World-from-mesh transform, row by row.
    transform: [[f32; 4]; 3],
    /// Custom index in the lower 24 bits, mask in the upper 8.
    index_and_mask: u32,
    /// Offset into the shader binding table in the lower 24 bits, flags in the upper 8. No flag is needed: like glTF,
    /// Vulkan determines the front side in mesh coordinates, and in right-handed ones both agree on it, so a mirroring
    /// instance flips the front in both.
    table_offset_and_flags: u32,
    blas: u64,
}

const _: () = assert!(size_of::<Record>() == size_of::<vk::AccelerationStructureInstanceKHR>());

impl<'d> Tlas<'d> {
    /// Builds the TLAS of a plan over its BLASes; without entries, no ray hits the TLAS.
    pub(in crate::verify::vulkan) fn build(
        device: &'d Device,
        scene: &Scene,
        plan: &Plan,
        blases: &Blases<'d>,
        options: &BuildOptions,
    ) -> Result<Tlas<'d>, Error> {
        let count = plan.entries.len() as u32;
        let what = format!("the TLAS of {count} instances");
        let instances = upload(device, scene, plan, blases)?;
        let geometries = [describe(instances.address)];
        let mut build = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(TOP)
            .flags(options.flags())
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(&geometries);
        let sizes = sizes(device, &build, &[count]);
        let storage = Buffer::new(device, &what, sizes.structure, Purpose::Structures)?;
        let structure = Structure::new(device, &what, TOP, (&storage, 0), sizes.structure)?;
        let alignment = device.info().limits.scratch_alignment.max(ALIGNMENT);
        let scratch = format!("scratch memory of {what}");
        let scratch = Buffer::new(device, &scratch, sizes.scratch + alignment, Purpose::Scratch)?;
        build.dst_acceleration_structure = structure.handle;
        build.scratch_data.device_address = scratch.address.next_multiple_of(alignment);
        let range = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count)];
        let timer = Timer::new(device)?;
        device.submit(&format!("building {what}"), |commands| {
            device.barrier(commands);
            timer.measure(commands, || {
                // SAFETY: instances, structure and scratch memory outlive the submission and are sized for this
                // description; the instances refer to built BLASes.
                unsafe { device.structures.cmd_build_acceleration_structures(commands, &[build], &[&range]) }
            });
        })?;
        let build_ms = timer.milliseconds()?;
        Ok(Tlas { structure, _storage: storage, build_ms, bytes: sizes.structure })
    }

    /// Returns the device address of the TLAS.
    pub(in crate::verify::vulkan) fn address(&self) -> u64 {
        self.structure.address
    }
}

pub(super) fn describe(instances: u64) -> vk::AccelerationStructureGeometryKHR<'static> {
    let data = vk::AccelerationStructureGeometryInstancesDataKHR::default()
        .data(vk::DeviceOrHostAddressConstKHR { device_address: instances });
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::INSTANCES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data })
}

fn upload<'d>(device: &'d Device, scene: &Scene, plan: &Plan, blases: &Blases<'d>) -> Result<Buffer<'d>, Error> {
    let size = (plan.entries.len() * size_of::<Record>()) as u64;
    let what = format!("{} instances", plan.entries.len());
    let buffer = Buffer::new(device, &what, size, Purpose::BuildInput)?;
    let mut uploader = Uploader::new(device, size)?;
    let mut offset = 0;
    for (chunk, entries) in plan.entries.chunks(CHUNK).enumerate() {
        let records: Vec<Record> = (chunk * CHUNK..)
            .zip(entries)
            .map(|(index, entry)| {
                let transform = plan.transform(scene, entry);
                record(index as u32, &transform, blases.address(entry.group as usize))
            })
            .collect();
        uploader.write(&buffer, offset, bytemuck::cast_slice(&records))?;
        offset += size_of_val(&records[..]) as u64;
    }
    uploader.flush()?;
    drop(uploader);
    Ok(buffer)
}

pub(super) fn record(index: u32, transform: &DAffine3, blas: u64) -> Record {
    let m = transform.matrix3.transpose();
    let rows = [m.x_axis, m.y_axis, m.z_axis].map(|r| r.as_vec3());
    let t = transform.translation.as_vec3();
    Record {
        transform: [rows[0].extend(t.x), rows[1].extend(t.y), rows[2].extend(t.z)].map(|r| r.to_array()),
        index_and_mask: index | 0xff << 24,
        table_offset_and_flags: 0,
        blas,
    }
}

/// Like [`record`], for an instance that may have moved to where no ray can enter it: the mask then hides it.
pub(super) fn moving_record(index: u32, transform: &DAffine3, blas: u64) -> Record {
    if can_be_entered(transform) {
        return record(index, transform, blas);
    }
    Record { index_and_mask: index, transform: [[0.0; 4]; 3], ..record(index, transform, blas) }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;

    #[test]
    fn an_instance_is_stored_by_rows() {
        let transform = DAffine3 {
            matrix3: DMat3::from_cols(DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0), DVec3::new(7.0, 8.0, 9.0)),
            translation: DVec3::new(10.0, 11.0, 12.0),
        };
        let record = record(0xabcdef, &transform, 42);
        let rows = [[1.0, 4.0, 7.0, 10.0], [2.0, 5.0, 8.0, 11.0], [3.0, 6.0, 9.0, 12.0]];
        assert_eq!(record.transform, rows);
        assert_eq!((record.index_and_mask, record.blas), (0xffab_cdef, 42));
    }

    #[test]
    fn an_instance_that_cannot_be_entered_is_hidden() {
        let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        let nowhere = DAffine3::from_translation(DVec3::new(f64::NAN, 0.0, 0.0));
        for transform in [flat, nowhere] {
            let hidden = moving_record(5, &transform, 42);
            assert_eq!((hidden.index_and_mask, hidden.blas, hidden.transform), (5, 42, [[0.0; 4]; 3]));
        }
        assert_eq!(moving_record(5, &DAffine3::IDENTITY, 42).index_and_mask, 0xff00_0005);
    }
}
