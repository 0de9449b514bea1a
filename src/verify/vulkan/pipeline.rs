//! The ray tracing pipelines: one returns complete hits, one as little as timing needs, one all hits of each ray, and one
//! the time of each ray.

use std::io::Cursor;

use ash::vk;

use super::Error;
use super::device::Device;
use super::interface::Work;
use super::memory::{Buffer, Purpose};
use super::transfer::Uploader;

/// Compiled shaders of one pipeline.
pub(super) struct Shaders {
    name: &'static str,
    generate: &'static [u8],
    miss: &'static [u8],
    closest_hit: &'static [u8],
    any_hit: &'static [u8],
}

macro_rules! shader {
    ($name:literal, $stage:literal) => {
        include_bytes!(concat!("../../../shaders/", $name, ".", $stage, ".spv"))
    };
}

macro_rules! shaders {
    ($name:literal) => {
        Shaders {
            name: $name,
            generate: shader!($name, "rgen"),
            miss: shader!($name, "rmiss"),
            closest_hit: shader!($name, "rchit"),
            any_hit: shader!($name, "rahit"),
        }
    };
}

/// Shaders that write one [`super::interface::Hit`] per ray.
pub(super) const HITS: Shaders = shaders!("hits");
/// Shaders that write one word per ray.
pub(super) const TIMING: Shaders = shaders!("timing");
/// Shaders that write up to [`Work::kept_hits`] hits per ray.
pub(super) const ALL: Shaders =
    Shaders { name: "all", generate: shader!("all", "rgen"), any_hit: shader!("all", "rahit"), ..HITS };
/// Shaders that write one [`super::interface::Clocked`] per ray, for devices with a clock.
pub(super) const CLOCK: Shaders = Shaders { name: "clock", generate: shader!("clock", "rgen"), ..HITS };

/// A pipeline and its shader binding table.
pub(super) struct Pipeline<'d> {
    device: &'d Device,
    layout: vk::PipelineLayout,
    handle: vk::Pipeline,
    table: Option<Table<'d>>,
}

struct Table<'d> {
    _buffer: Buffer<'d>,
    /// Regions of the table: ray generation, miss, hit.
    regions: [vk::StridedDeviceAddressRegionKHR; 3],
}

const WORK_STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::RAYGEN_KHR.as_raw() | vk::ShaderStageFlags::ANY_HIT_KHR.as_raw(),
);

impl<'d> Pipeline<'d> {
    pub(super) fn new(device: &'d Device, shaders: &Shaders) -> Result<Pipeline<'d>, Error> {
        let what = format!("making the pipeline `{}`", shaders.name);
        let work = [vk::PushConstantRange::default().stage_flags(WORK_STAGES).size(size_of::<Work>() as u32)];
        let info = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&work);
        // SAFETY: the range is far smaller than any device's limit.
        let layout =
            unsafe { device.handle.create_pipeline_layout(&info, None) }.map_err(|e| Error::call(&what, 0, e))?;
        // From here on, `Drop` frees everything if a call fails.
        let mut pipeline = Pipeline { device, layout, handle: vk::Pipeline::null(), table: None };
        pipeline.handle = create(device, shaders, layout, &what)?;
        pipeline.table = Some(Table::new(device, pipeline.handle, &what)?);
        Ok(pipeline)
    }

    /// Records one-dimensional launches over `rays` rays, as many as the device's limit requires.
    pub(super) fn trace(&self, commands: vk::CommandBuffer, work: Work, rays: u64, rays_per_launch: u64) {
        let Some(table) = &self.table else { return };
        let vulkan = &self.device.handle;
        // SAFETY: the command buffer is being recorded, and the pipeline is complete.
        unsafe { vulkan.cmd_bind_pipeline(commands, vk::PipelineBindPoint::RAY_TRACING_KHR, self.handle) };
        for first in (0..rays).step_by(rays_per_launch.max(1) as usize) {
            let work = Work { first: first as u32, ..work };
            let count = (rays - first).min(rays_per_launch) as u32;
            let [generate, miss, hit] = &table.regions;
            let callable = vk::StridedDeviceAddressRegionKHR::default();
            // SAFETY: as above; the table belongs to this pipeline, and the caller's buffers hold `rays` elements.
            unsafe {
                vulkan.cmd_push_constants(commands, self.layout, WORK_STAGES, 0, bytemuck::bytes_of(&work));
                self.device.pipelines.cmd_trace_rays(commands, generate, miss, hit, &callable, count, 1, 1);
            }
        }
    }
}

/// Shader modules, freed together.
struct Modules<'d> {
    device: &'d Device,
    handles: Vec<vk::ShaderModule>,
}

impl Modules<'_> {
    fn add(&mut self, spirv: &[u8]) -> Result<vk::ShaderModule, vk::Result> {
        let words = ash::util::read_spv(&mut Cursor::new(spirv)).map_err(|_| vk::Result::ERROR_INVALID_SHADER_NV)?;
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the SPIR-V is the project's own and needs no features beyond those enabled.
        let module = unsafe { self.device.handle.create_shader_module(&info, None) }?;
        self.handles.push(module);
        Ok(module)
    }
}

impl Drop for Modules<'_> {
    fn drop(&mut self) {
        for module in &self.handles {
            // SAFETY: pipelines do not need their modules after creation.
            unsafe { self.device.handle.destroy_shader_module(*module, None) };
        }
    }
}

fn create(device: &Device, shaders: &Shaders, layout: vk::PipelineLayout, what: &str) -> Result<vk::Pipeline, Error> {
    use vk::ShaderStageFlags as Stage;
    let failed = |e| Error::call(what, 0, e);
    let mut modules = Modules { device, handles: Vec::new() };
    let mut stages = Vec::new();
    for (stage, spirv) in [
        (Stage::RAYGEN_KHR, shaders.generate),
        (Stage::MISS_KHR, shaders.miss),
        (Stage::CLOSEST_HIT_KHR, shaders.closest_hit),
        (Stage::ANY_HIT_KHR, shaders.any_hit),
    ] {
        let module = modules.add(spirv).map_err(failed)?;
        stages.push(vk::PipelineShaderStageCreateInfo::default().stage(stage).module(module).name(c"main"));
    }
    let groups = [general(0), general(1), triangles(2, 3)];
    let info = vk::RayTracingPipelineCreateInfoKHR::default()
        .stages(&stages)
        .groups(&groups)
        .max_pipeline_ray_recursion_depth(1)
        .layout(layout);
    let (operation, cache) = (vk::DeferredOperationKHR::null(), vk::PipelineCache::null());
    // SAFETY: stages and groups agree with each other and outlive the call.
    unsafe { device.pipelines.create_ray_tracing_pipelines(operation, cache, &[info], None) }
        .map(|pipelines| pipelines[0])
        .map_err(|(made, e)| {
            // SAFETY: pipelines that were created despite the failure are not used.
            made.into_iter().for_each(|p| unsafe { device.handle.destroy_pipeline(p, None) });
            failed(e)
        })
}

fn general(shader: u32) -> vk::RayTracingShaderGroupCreateInfoKHR<'static> {
    vk::RayTracingShaderGroupCreateInfoKHR::default()
        .ty(vk::RayTracingShaderGroupTypeKHR::GENERAL)
        .general_shader(shader)
        .closest_hit_shader(vk::SHADER_UNUSED_KHR)
        .any_hit_shader(vk::SHADER_UNUSED_KHR)
        .intersection_shader(vk::SHADER_UNUSED_KHR)
}

fn triangles(closest_hit: u32, any_hit: u32) -> vk::RayTracingShaderGroupCreateInfoKHR<'static> {
    general(vk::SHADER_UNUSED_KHR)
        .ty(vk::RayTracingShaderGroupTypeKHR::TRIANGLES_HIT_GROUP)
        .closest_hit_shader(closest_hit)
        .any_hit_shader(any_hit)
}

impl<'d> Table<'d> {
    /// Creates three regions of one record each.
    fn new(device: &'d Device, pipeline: vk::Pipeline, what: &str) -> Result<Table<'d>, Error> {
        let limits = &device.info().limits;
        let (handle, alignment) = (limits.handle_size, limits.table_alignment.max(1));
        let record = handle.next_multiple_of(alignment);
        // SAFETY: the pipeline has three groups.
        let handles =
            unsafe { device.pipelines.get_ray_tracing_shader_group_handles(pipeline, 0, 3, 3 * handle as usize) }
                .map_err(|e| Error::call(what, 0, e))?;
        let buffer = Buffer::new(device, "a table of shaders", 3 * record + alignment, Purpose::ShaderTable)?;
        let start = buffer.address.next_multiple_of(alignment);
        let mut uploader = Uploader::new(device, 3 * handle)?;
        for (i, bytes) in (0..).zip(handles.chunks_exact(handle as usize)) {
            uploader.write(&buffer, start - buffer.address + i * record, bytes)?;
        }
        uploader.flush()?;
        drop(uploader);
        let region =
            |i| vk::StridedDeviceAddressRegionKHR { device_address: start + i * record, stride: record, size: record };
        Ok(Table { regions: [region(0), region(1), region(2)], _buffer: buffer })
    }
}

impl Drop for Pipeline<'_> {
    fn drop(&mut self) {
        // SAFETY: all submissions are waited for, so none uses the pipeline; destroying null is a no-op.
        unsafe {
            self.device.handle.destroy_pipeline(self.handle, None);
            self.device.handle.destroy_pipeline_layout(self.layout, None);
        }
    }
}
