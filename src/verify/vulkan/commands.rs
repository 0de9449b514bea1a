//! Submits work to the device, one piece at a time, and measures how long it takes.

use std::sync::MutexGuard;

use ash::vk;

use super::Error;
use super::device::Device;

/// The queue and the one command buffer that is recorded anew for each submission.
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
        // SAFETY: the pool was just made; on failure it is destroyed, and nothing else uses it.
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
                // SAFETY: destroying the pool also frees its command buffer.
                unsafe { device.destroy_command_pool(pool, None) };
                Err(failed(e))
            }
        }
    }

    /// # Safety
    /// No submission may still be running, and the queue must not be used again.
    pub(super) unsafe fn destroy(&mut self, device: &ash::Device) {
        // SAFETY: guaranteed by the caller.
        unsafe {
            device.destroy_fence(self.done, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}

impl Device {
    /// Records work, submits it, and waits for it without a time limit.
    pub(super) fn submit(&self, what: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<(), Error> {
        let queue: MutexGuard<'_, Queue> = self.queue.lock().unwrap_or_else(|e| e.into_inner());
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let buffers = [queue.buffer];
        let submission = vk::SubmitInfo::default().command_buffers(&buffers);
        // SAFETY: the lock gives this call exclusive use of command buffer, queue and fence, and the wait at its end
        // ensures that they are idle for the next call. The recorded commands state their own safety.
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

    /// Makes all earlier writes visible to all later commands.
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

    /// Makes the device's writes visible to the host.
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

/// A query pool of values that the device writes while it works.
pub(super) struct Queries<'d> {
    device: &'d Device,
    pub(super) pool: vk::QueryPool,
    count: u32,
}

impl<'d> Queries<'d> {
    pub(super) fn new(device: &'d Device, kind: vk::QueryType, count: u32) -> Result<Queries<'d>, Error> {
        let info = vk::QueryPoolCreateInfo::default().query_type(kind).query_count(count);
        // SAFETY: the query types used here need no features beyond those enabled.
        let pool = unsafe { device.handle.create_query_pool(&info, None) }
            .map_err(|e| Error::call(&format!("making {count} queries"), u64::from(count) * 8, e))?;
        Ok(Queries { device, pool, count })
    }

    /// Resets the queries; must be recorded before they are used.
    pub(super) fn reset(&self, commands: vk::CommandBuffer) {
        // SAFETY: the pool is alive and has this many queries.
        unsafe { self.device.handle.cmd_reset_query_pool(commands, self.pool, 0, self.count) }
    }

    /// Returns the results; the work that writes them must have completed.
    pub(super) fn results(&self) -> Result<Vec<u64>, Error> {
        self.first_results(self.count)
    }

    /// Returns the results of the first queries, if only these were written.
    fn first_results(&self, count: u32) -> Result<Vec<u64>, Error> {
        assert!(count <= self.count, "there are as many queries");
        let mut results = vec![0u64; count as usize];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: as above; the slice has one element per query.
        unsafe { self.device.handle.get_query_pool_results(self.pool, 0, &mut results, flags) }
            .map_err(|e| Error::call("reading queries", 0, e))?;
        Ok(results)
    }
}

impl Drop for Queries<'_> {
    fn drop(&mut self) {
        // SAFETY: all submissions are waited for, so none still uses the pool.
        unsafe { self.device.handle.destroy_query_pool(self.pool, None) }
    }
}

/// Measures how long recorded work takes on the device.
pub(super) struct Timer<'d> {
    queries: Queries<'d>,
}

impl<'d> Timer<'d> {
    /// Creates a timer of one interval.
    pub(super) fn new(device: &'d Device) -> Result<Timer<'d>, Error> {
        Timer::of_intervals(device, 1)
    }

    /// Creates a timer of up to so many intervals that follow each other.
    pub(super) fn of_intervals(device: &'d Device, intervals: u32) -> Result<Timer<'d>, Error> {
        Ok(Timer { queries: Queries::new(device, vk::QueryType::TIMESTAMP, intervals + 1)? })
    }

    /// Records work between two timestamps.
    pub(super) fn measure(&self, commands: vk::CommandBuffer, record: impl FnOnce()) {
        self.start(commands);
        record();
        self.stamp(commands, 1);
    }

    /// Records the start of the first interval.
    pub(super) fn start(&self, commands: vk::CommandBuffer) {
        self.queries.reset(commands);
        self.stamp(commands, 0);
    }

    /// Records the end of an interval, counted from 1, which is also the start of the next.
    pub(super) fn stamp(&self, commands: vk::CommandBuffer, interval: u32) {
        assert!(interval < self.queries.count, "there is a timestamp for each interval");
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: the command buffer is being recorded, the pool has the query, and the family supports timestamps.
        unsafe { self.queries.device.handle.cmd_write_timestamp(commands, stage, self.queries.pool, interval) }
    }

    /// Returns the time between the first two timestamps of the last submission, in milliseconds.
    pub(super) fn milliseconds(&self) -> Result<f64, Error> {
        Ok(self.intervals(1)?[0])
    }

    /// Returns the first intervals of the last submission, in milliseconds.
    pub(super) fn intervals(&self, count: u32) -> Result<Vec<f64>, Error> {
        let stamps = self.queries.first_results(count + 1)?;
        let device = self.queries.device;
        let mask = u64::MAX >> (64 - device.family.timestamp_bits.clamp(1, 64));
        let between = |pair: &[u64]| (pair[1].wrapping_sub(pair[0]) & mask) as f64 * device.timestamp_period * 1e-6;
        Ok(stamps.windows(2).map(between).collect())
    }
}
