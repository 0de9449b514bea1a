//! One acceleration structure, bottom-level or top-level.

use ash::vk;

use crate::verify::vulkan::Error;
use crate::verify::vulkan::device::Device;
use crate::verify::vulkan::memory::Buffer;

/// Alignment of structures within a buffer, in bytes.
pub(super) const ALIGNMENT: u64 = 256;

/// An acceleration structure in a buffer that its owner keeps alive.
pub(super) struct Structure<'d> {
    device: &'d Device,
    pub(super) handle: vk::AccelerationStructureKHR,
    /// Device address of the structure.
    pub(super) address: u64,
}

/// Memory needs of a structure, in bytes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sizes {
    /// Size of the structure itself.
    pub(super) structure: u64,
    /// Size of the scratch memory for its build.
    pub(super) scratch: u64,
    /// Size of the scratch memory for updating it.
    pub(super) update_scratch: u64,
}

impl<'d> Structure<'d> {
    /// Creates an unbuilt structure of `size` bytes at `offset` in a buffer for structures.
    pub(super) fn new(
        device: &'d Device,
        what: &str,
        kind: vk::AccelerationStructureTypeKHR,
        (buffer, offset): (&Buffer<'_>, u64),
        size: u64,
    ) -> Result<Structure<'d>, Error> {
        assert!(offset % ALIGNMENT == 0 && offset + size <= buffer.size, "a structure lies aligned in its buffer");
        let info =
            vk::AccelerationStructureCreateInfoKHR::default().buffer(buffer.handle).offset(offset).size(size).ty(kind);
        // SAFETY: the range was checked; the buffer was made for structures.
        let handle = unsafe { device.structures.create_acceleration_structure(&info, None) }
            .map_err(|e| Error::call(what, size, e))?;
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(handle);
        // SAFETY: the structure was just made.
        let address = unsafe { device.structures.get_acceleration_structure_device_address(&info) };
        Ok(Structure { device, handle, address })
    }
}

impl Drop for Structure<'_> {
    fn drop(&mut self) {
        // SAFETY: all submissions are waited for, so none still uses the structure.
        unsafe { self.device.structures.destroy_acceleration_structure(self.handle, None) }
    }
}

/// Queries the sizes needed to build these geometries with these primitive counts.
pub(super) fn sizes(
    device: &Device,
    build: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
    primitives: &[u32],
) -> Sizes {
    assert_eq!(build.geometry_count as usize, primitives.len(), "each geometry has a number of primitives");
    let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
    // SAFETY: the description and the counts agree; addresses are not read.
    unsafe {
        device.structures.get_acceleration_structure_build_sizes(
            vk::AccelerationStructureBuildTypeKHR::DEVICE,
            build,
            primitives,
            &mut sizes,
        );
    }
    Sizes {
        structure: sizes.acceleration_structure_size,
        scratch: sizes.build_scratch_size,
        update_scratch: sizes.update_scratch_size,
    }
}
