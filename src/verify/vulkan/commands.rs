//! Work given to the device, one piece at a time, and how long it took.

use std::sync::MutexGuard;

use ash::vk;

use super::Error;
use super::device::Device;

/// The queue and the one command buffer that is recorded anew for each piece of work.
pub(super) struct Queue {
    queue: vk::Queue,
    pool: vk::CommandPool,
    buffer: vk::CommandBuffer,
    done: vk::Fence,
}

impl Queue {
    pub(super) fn new(device: &ash::Device, family: u32) -> Result<Queue, Error> {
        let failed = |e| Error::call("making a command buffer", 0, e);
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the family is the one the device was created with.
        let pool = unsafe { device.create_command_pool(&info, None) }.map_err(failed)?;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool was just made; on failure it goes, and nothing was made of it.
        let made = unsafe {
            device.allocate_command_buffers(&info).and_then(|buffers| {
                device.create_fence(&vk::FenceCreateInfo::default(), None).map(|done| (buffers[0], done))
            })
        };
        match made {
            Ok((buffer, done)) => {
                // SAFETY: the device was created with one queue of the family.
                let queue = unsafe { device.get_device_queue(family, 0) };
                Ok(Queue { queue, pool, buffer, done })
            }
            Err(e) => {
                // SAFETY: the pool takes its command buffer along.
                unsafe { device.destroy_command_pool(pool, None) };
                Err(failed(e))
            }
        }
    }

    /// # Safety
    /// Nothing submitted may still run, and the queue is not used again.
    pub(super) unsafe fn destroy(&mut self, device: &ash::Device) {
        // SAFETY: as promised by the caller.
        unsafe {
            device.destroy_fence(self.done, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}

impl Device {
    /// Records work, has the device do it, and waits for it to be done, however long that takes.
    pub(super) fn submit(&self, what: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<(), Error> {
        let queue: MutexGuard<'_, Queue> = self.queue.lock().unwrap_or_else(|e| e.into_inner());
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let buffers = [queue.buffer];
        let submission = vk::SubmitInfo::default().command_buffers(&buffers);
        // SAFETY: the lock keeps command buffer, queue and fence to this call, and the wait at its end keeps the
        // next call from finding them in use. What is recorded answers for itself.
        unsafe {
            self.handle.begin_command_buffer(queue.buffer, &begin).and_then(|()| {
                record(queue.buffer);
                self.handle.end_command_buffer(queue.buffer)?;
                self.handle.queue_submit(queue.queue, &[submission], queue.done)?;
                self.handle.wait_for_fences(&[queue.done], true, u64::MAX)?;
                self.handle.reset_fences(&[queue.done])
            })
        }
        .map_err(|e| Error::call(what, 0, e))
    }

    /// Makes all that was written so far visible to all that follows.
    pub(super) fn barrier(&self, commands: vk::CommandBuffer) {
        let all = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
            .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE);
        let stage = vk::PipelineStageFlags::ALL_COMMANDS;
        // SAFETY: the command buffer is being recorded.
        unsafe {
            self.handle.cmd_pipeline_barrier(commands, stage, stage, vk::DependencyFlags::empty(), &[all], &[], &[]);
        }
    }

    /// Makes what the device wrote visible to the host.
    pub(super) fn barrier_to_host(&self, commands: vk::CommandBuffer) {
        let to_host = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ);
        // SAFETY: the command buffer is being recorded.
        unsafe {
            self.handle.cmd_pipeline_barrier(
                commands,
                vk::PipelineStageFlags::ALL_COMMANDS,
                vk::PipelineStageFlags::HOST,
                vk::DependencyFlags::empty(),
                &[to_host],
                &[],
                &[],
            );
        }
    }
}

/// Numbers the device writes down while it works.
pub(super) struct Queries<'d> {
    device: &'d Device,
    pub(super) pool: vk::QueryPool,
    count: u32,
}

impl<'d> Queries<'d> {
    pub(super) fn new(device: &'d Device, kind: vk::QueryType, count: u32) -> Result<Queries<'d>, Error> {
        let info = vk::QueryPoolCreateInfo::default().query_type(kind).query_count(count);
        // SAFETY: the kinds used here need no feature beyond those enabled.
        let pool = unsafe { device.handle.create_query_pool(&info, None) }
            .map_err(|e| Error::call(&format!("making {count} queries"), u64::from(count) * 8, e))?;
        Ok(Queries { device, pool, count })
    }

    /// Forgets earlier results; to be recorded before the queries are.
    pub(super) fn reset(&self, commands: vk::CommandBuffer) {
        // SAFETY: the pool is alive and has so many queries.
        unsafe { self.device.handle.cmd_reset_query_pool(commands, self.pool, 0, self.count) }
    }

    /// The results; the work that wrote them must be done.
    pub(super) fn results(&self) -> Result<Vec<u64>, Error> {
        let mut results = vec![0u64; self.count as usize];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: as above; the slice has one element a query.
        unsafe { self.device.handle.get_query_pool_results(self.pool, 0, &mut results, flags) }
            .map_err(|e| Error::call("reading queries", 0, e))?;
        Ok(results)
    }
}

impl Drop for Queries<'_> {
    fn drop(&mut self) {
        // SAFETY: submissions are waited for, so that none uses the pool.
        unsafe { self.device.handle.destroy_query_pool(self.pool, None) }
    }
}

/// Measures how long a piece of recorded work takes on the device.
pub(super) struct Timer<'d> {
    queries: Queries<'d>,
}

impl<'d> Timer<'d> {
    pub(super) fn new(device: &'d Device) -> Result<Timer<'d>, Error> {
        Ok(Timer { queries: Queries::new(device, vk::QueryType::TIMESTAMP, 2)? })
    }

    /// Records work between two timestamps.
    pub(super) fn measure(&self, commands: vk::CommandBuffer, record: impl FnOnce()) {
        self.queries.reset(commands);
        self.stamp(commands, 0);
        record();
        self.stamp(commands, 1);
    }

    fn stamp(&self, commands: vk::CommandBuffer, query: u32) {
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: the command buffer is being recorded, the pool has two queries, and the family takes timestamps.
        unsafe { self.queries.device.handle.cmd_write_timestamp(commands, stage, self.queries.pool, query) }
    }

    /// Milliseconds between the timestamps of the last submission.
    pub(super) fn milliseconds(&self) -> Result<f64, Error> {
        let stamps = self.queries.results()?;
        let device = self.queries.device;
        let mask = u64::MAX >> (64 - device.family.timestamp_bits.clamp(1, 64));
        let ticks = stamps[1].wrapping_sub(stamps[0]) & mask;
        Ok(ticks as f64 * device.timestamp_period * 1e-6)
    }
}
