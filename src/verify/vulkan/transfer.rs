//! Copies bytes to and from the device, in pieces that fit a staging buffer.

use ash::vk;

use super::Error;
use super::device::Device;
use super::memory::{Buffer, Purpose};

/// Size of a staging buffer, in bytes.
const STAGING: u64 = 32 << 20;

/// Collects data for buffers of the device and submits it whenever the staging buffer is full.
pub(super) struct Uploader<'d, 'b> {
    device: &'d Device,
    staging: Buffer<'d>,
    used: u64,
    pending: Vec<(&'b Buffer<'d>, vk::BufferCopy)>,
}

impl<'d, 'b> Uploader<'d, 'b> {
    /// Creates an uploader for about this many bytes.
    pub(super) fn new(device: &'d Device, bytes: u64) -> Result<Self, Error> {
        let size = bytes.min(STAGING).min(device.info().limits.max_allocation);
        let staging = Buffer::new(device, "the upload buffer", size, Purpose::Upload)?;
        Ok(Uploader { device, staging, used: 0, pending: Vec::new() })
    }

    /// Writes bytes to a buffer of the device, immediately or at the latest on [`Uploader::flush`].
    pub(super) fn write(&mut self, to: &'b Buffer<'d>, mut offset: u64, mut bytes: &[u8]) -> Result<(), Error> {
        assert!(offset + bytes.len() as u64 <= to.size, "an upload stays within its buffer");
        while !bytes.is_empty() {
            if self.used == self.staging.size {
                self.flush()?;
            }
            let size = (self.staging.size - self.used).min(bytes.len() as u64);
            let (now, later) = bytes.split_at(size as usize);
            self.staging.bytes_mut()[self.used as usize..][..now.len()].copy_from_slice(now);
            let copy = vk::BufferCopy::default().src_offset(self.used).dst_offset(offset).size(size);
            self.pending.push((to, copy));
            (self.used, offset, bytes) = (self.used + size, offset + size, later);
        }
        Ok(())
    }

    /// Submits the data still collected.
    pub(super) fn flush(&mut self) -> Result<(), Error> {
        let pending = std::mem::take(&mut self.pending);
        self.used = 0;
        if pending.is_empty() {
            return Ok(());
        }
        self.device.submit("copying to the device", |commands| {
            for run in pending.chunk_by(|a, b| a.0.handle == b.0.handle) {
                let copies: Vec<vk::BufferCopy> = run.iter().map(|(_, copy)| *copy).collect();
                // SAFETY: `write` stayed within both buffers' sizes; the target can be copied to.
                unsafe {
                    self.device.handle.cmd_copy_buffer(commands, self.staging.handle, run[0].0.handle, &copies);
                }
            }
        })
    }
}

/// Reads the first `count` elements of a buffer of the device.
pub(super) fn download<T: bytemuck::Pod>(
    device: &Device,
    from: &Buffer<'_>,
    count: usize,
    mut each: impl FnMut(&T),
) -> Result<(), Error> {
    let element = size_of::<T>() as u64;
    let total = count as u64 * element;
    assert!(total <= from.size, "a download stays within its buffer");
    if total == 0 {
        return Ok(());
    }
    let piece = STAGING.min(device.info().limits.max_allocation) / element * element;
    let staging = Buffer::new(device, "the download buffer", total.min(piece), Purpose::Download)?;
    for offset in (0..total).step_by(piece as usize) {
        let size = piece.min(total - offset);
        device.submit("copying from the device", |commands| {
            device.barrier(commands);
            let copy = vk::BufferCopy::default().src_offset(offset).size(size);
            // SAFETY: the copy stays within both buffers.
            unsafe { device.handle.cmd_copy_buffer(commands, from.handle, staging.handle, &[copy]) };
            device.barrier_to_host(commands);
        })?;
        bytemuck::cast_slice(&staging.bytes()[..size as usize]).iter().for_each(&mut each);
    }
    Ok(())
}
