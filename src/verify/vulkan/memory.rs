//! Buffers and the accounting of device memory.

use std::sync::atomic::{AtomicU64, Ordering};

use ash::vk;

use super::Error;
use super::device::Device;

/// The purpose of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Vertices, indices and instances that structures are built from.
    BuildInput,
    /// Acceleration structures.
    Structures,
    /// Temporary data of a build.
    Scratch,
    /// Data that shaders read and write.
    ShaderData,
    /// The shader binding table.
    ShaderTable,
    /// Host memory to be copied to the device.
    Upload,
    /// Host memory for results copied from the device.
    Download,
}

impl Purpose {
    fn usage(self) -> vk::BufferUsageFlags {
        use vk::BufferUsageFlags as Usage;
        match self {
            Purpose::BuildInput => {
                Usage::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
                    | Usage::SHADER_DEVICE_ADDRESS
                    | Usage::TRANSFER_DST
            }
            Purpose::Structures => Usage::ACCELERATION_STRUCTURE_STORAGE_KHR | Usage::SHADER_DEVICE_ADDRESS,
            Purpose::Scratch => Usage::STORAGE_BUFFER | Usage::SHADER_DEVICE_ADDRESS,
            Purpose::ShaderData => {
                Usage::STORAGE_BUFFER | Usage::SHADER_DEVICE_ADDRESS | Usage::TRANSFER_SRC | Usage::TRANSFER_DST
            }
            Purpose::ShaderTable => {
                Usage::SHADER_BINDING_TABLE_KHR | Usage::SHADER_DEVICE_ADDRESS | Usage::TRANSFER_DST
            }
            Purpose::Upload => Usage::TRANSFER_SRC,
            Purpose::Download => Usage::TRANSFER_DST,
        }
    }

    fn is_on_host(self) -> bool {
        matches!(self, Purpose::Upload | Purpose::Download)
    }

    /// Returns the preferred memory properties and, as a fallback, weaker ones.
    fn memory(self) -> [vk::MemoryPropertyFlags; 2] {
        use vk::MemoryPropertyFlags as Memory;
        let host = Memory::HOST_VISIBLE | Memory::HOST_COHERENT;
        match self {
            Purpose::Upload => [host, host],
            Purpose::Download => [host | Memory::HOST_CACHED, host],
            _ => [Memory::DEVICE_LOCAL, Memory::empty()],
        }
    }
}

/// Tracks the use of device memory.
pub(super) struct Ledger {
    /// Limit on the memory in use at a time, in bytes.
    limit: u64,
    used: AtomicU64,
    /// Peak use, in bytes.
    peak: AtomicU64,
}

impl Ledger {
    pub(super) fn new(limit: Option<u64>) -> Ledger {
        Ledger { limit: limit.unwrap_or(u64::MAX), used: AtomicU64::new(0), peak: AtomicU64::new(0) }
    }

    /// Records an allocation, or fails if it would exceed the limit.
    fn take(&self, bytes: u64) -> Result<(), vk::Result> {
        let within = |used: u64| used.checked_add(bytes).filter(|sum| *sum <= self.limit);
        let before = self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, within);
        let before = before.map_err(|_| vk::Result::ERROR_OUT_OF_DEVICE_MEMORY)?;
        self.peak.fetch_max(before + bytes, Ordering::Relaxed);
        Ok(())
    }

    fn give_back(&self, bytes: u64) {
        self.used.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// Returns the memory in use, in bytes.
    pub(super) fn used(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }

    /// Returns the peak use, in bytes.
    #[cfg(test)]
    pub(super) fn peak(&self) -> u64 {
        self.peak.load(Ordering::Relaxed)
    }
}

/// A buffer with its own memory. Each holds many objects, because devices limit the number of allocations (often to
/// 4096).
pub(super) struct Buffer<'d> {
    device: &'d Device,
    pub(super) handle: vk::Buffer,
    memory: vk::DeviceMemory,
    /// Size recorded in the device's ledger, in bytes.
    entered: u64,
    pub(super) size: u64,
    /// Device address; 0 for host memory.
    pub(super) address: u64,
    /// Pointer to the mapped memory; null for device memory.
    mapped: *mut u8,
}

// SAFETY: the pointer refers to mapped memory owned by the buffer, which is only written through `&mut self`.
unsafe impl Send for Buffer<'_> {}
// SAFETY: as above.
unsafe impl Sync for Buffer<'_> {}

impl<'d> Buffer<'d> {
    /// Creates a buffer of at least one byte with undefined contents. `what` names it in errors.
    pub(super) fn new(device: &'d Device, what: &str, size: u64, purpose: Purpose) -> Result<Buffer<'d>, Error> {
        let size = size.max(1);
        Error::check_limit(|| format!("bytes of {what}"), size, device.info().limits.max_allocation)?;
        let failed = |e| Error::call(what, size, e);
        let info = vk::BufferCreateInfo::default().size(size).usage(purpose.usage());
        // SAFETY: the usages need only the enabled extensions.
        let handle = unsafe { device.handle.create_buffer(&info, None) }.map_err(failed)?;
        // From here on, `Drop` frees everything if a call fails.
        let (memory, mapped) = (vk::DeviceMemory::null(), std::ptr::null_mut());
        let mut buffer = Buffer { device, handle, memory, entered: 0, size, address: 0, mapped };
        buffer.allocate(purpose).map_err(failed)?;
        if purpose.usage().contains(vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS) {
            let info = vk::BufferDeviceAddressInfo::default().buffer(handle);
            // SAFETY: the buffer has memory and was created with a device address.
            buffer.address = unsafe { device.handle.get_buffer_device_address(&info) };
        }
        Ok(buffer)
    }

    fn allocate(&mut self, purpose: Purpose) -> Result<(), vk::Result> {
        let vulkan = &self.device.handle;
        // SAFETY: the buffer is alive.
        let needs = unsafe { vulkan.get_buffer_memory_requirements(self.handle) };
        let Some(kind) = memory_kind(&self.device.memory, needs.memory_type_bits, purpose) else {
            return Err(vk::Result::ERROR_FEATURE_NOT_PRESENT);
        };
        let has_address = purpose.usage().contains(vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS);
        let flags =
            if has_address { vk::MemoryAllocateFlags::DEVICE_ADDRESS } else { vk::MemoryAllocateFlags::empty() };
        let mut flags = vk::MemoryAllocateFlagsInfo::default().flags(flags);
        let info =
            vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind).push_next(&mut flags);
        if !purpose.is_on_host() {
            self.device.ledger.take(needs.size)?;
            self.entered = needs.size;
        }
        // SAFETY: size and type are those the buffer requires, and the memory is bound once; it is mapped only if its
        // type allows it, and as a whole.
        unsafe {
            self.memory = vulkan.allocate_memory(&info, None)?;
            vulkan.bind_buffer_memory(self.handle, self.memory, 0)?;
            if purpose.is_on_host() {
                let all = vk::MemoryMapFlags::empty();
                self.mapped = vulkan.map_memory(self.memory, 0, vk::WHOLE_SIZE, all)?.cast();
            }
        }
        Ok(())
    }

    /// Returns the bytes as seen by the host; empty for a buffer in device memory.
    pub(super) fn bytes(&self) -> &[u8] {
        if self.mapped.is_null() {
            return &[];
        }
        // SAFETY: the memory is mapped, is at least `size` bytes long, and is written by the device only during
        // submissions, which need the borrow of the buffer or its `bytes_mut` to have ended.
        unsafe { std::slice::from_raw_parts(self.mapped, self.size as usize) }
    }

    /// Returns the bytes of [`Buffer::bytes`] for writing.
    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        if self.mapped.is_null() {
            return &mut [];
        }
        // SAFETY: as above; the borrow is unique.
        unsafe { std::slice::from_raw_parts_mut(self.mapped, self.size as usize) }
    }
}

impl Drop for Buffer<'_> {
    fn drop(&mut self) {
        // SAFETY: all submissions are waited for, so none uses the buffer; freeing null memory is a no-op, and freeing
        // unmaps.
        unsafe {
            self.device.handle.destroy_buffer(self.handle, None);
            self.device.handle.free_memory(self.memory, None);
        }
        self.device.ledger.give_back(self.entered);
    }
}

/// Returns the best suited of the memory types in `allowed` (one bit per type).
fn memory_kind(memory: &vk::PhysicalDeviceMemoryProperties, allowed: u32, purpose: Purpose) -> Option<u32> {
    let types = memory.memory_types_as_slice();
    purpose.memory().into_iter().find_map(|wanted| {
        let suits = |i: &usize| allowed & (1 << i) != 0 && types[*i].property_flags.contains(wanted);
        (0..types.len()).find(suits).map(|i| i as u32)
    })
}

/// Location of an object: a buffer and an offset in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) buffer: usize,
    pub(super) offset: u64,
}

/// A layout of objects in order into few buffers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Packing {
    /// Location of each object.
    pub(super) places: Vec<Place>,
    /// Size of each buffer.
    pub(super) buffers: Vec<u64>,
}

impl Packing {
    /// Places objects of the given sizes at multiples of `alignment` into buffers of at most `max_buffer` bytes; an
    /// object larger than that gets a buffer to itself.
    pub(super) fn new(sizes: impl IntoIterator<Item = u64>, alignment: u64, max_buffer: u64) -> Packing {
        let mut packing = Packing::default();
        for size in sizes {
            let end = packing.buffers.last().map_or(0, |used| used.next_multiple_of(alignment));
            if packing.buffers.is_empty() || end.saturating_add(size) > max_buffer && end > 0 {
                packing.buffers.push(size);
                packing.places.push(Place { buffer: packing.buffers.len() - 1, offset: 0 });
            } else {
                let buffer = packing.buffers.len() - 1;
                packing.buffers[buffer] = end + size;
                packing.places.push(Place { buffer, offset: end });
            }
        }
        packing
    }

    /// Creates the buffers.
    pub(super) fn allocate<'d>(
        &self,
        device: &'d Device,
        what: &str,
        purpose: Purpose,
    ) -> Result<Vec<Buffer<'d>>, Error> {
        self.buffers.iter().map(|&size| Buffer::new(device, what, size, purpose)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(packing: &Packing) -> Vec<(usize, u64)> {
        packing.places.iter().map(|p| (p.buffer, p.offset)).collect()
    }

    #[test]
    fn objects_are_aligned_and_split_over_buffers() {
        let packing = Packing::new([100, 200, 300, 1], 256, 700);
        assert_eq!(places(&packing), [(0, 0), (0, 256), (1, 0), (1, 512)]);
        assert_eq!(packing.buffers, [456, 513]);
    }

    #[test]
    fn the_ledger_refuses_what_exceeds_its_limit_and_remembers_its_peak() {
        let ledger = Ledger::new(Some(100));
        assert_eq!(ledger.take(60), Ok(()));
        assert_eq!(ledger.take(41), Err(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY));
        assert_eq!(ledger.take(u64::MAX), Err(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY));
        assert_eq!(ledger.take(40), Ok(()));
        ledger.give_back(60);
        assert_eq!((ledger.take(50), ledger.peak()), (Ok(()), 100));
        assert_eq!(Ledger::new(None).take(u64::MAX), Ok(()));
    }

    #[test]
    fn a_buffer_may_be_filled_to_the_last_byte() {
        assert_eq!(Packing::new([256, 256], 256, 512).buffers, [512]);
        assert_eq!(Packing::new([256, 257], 256, 512).buffers, [256, 257]);
    }

    #[test]
    fn an_object_too_large_is_alone() {
        let packing = Packing::new([10, 1000, 10], 16, 100);
        assert_eq!(places(&packing), [(0, 0), (1, 0), (2, 0)]);
        assert_eq!(packing.buffers, [10, 1000, 10]);
    }

    #[test]
    fn nothing_needs_no_buffer() {
        assert_eq!(Packing::new([], 256, 100), Packing::default());
        assert_eq!(places(&Packing::new([0, 0, 5], 256, 100)), [(0, 0), (0, 0), (0, 0)]);
    }
}
