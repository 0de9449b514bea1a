//! All BLASes of a scene, built in few batches. Barriers are only between batches, because a single small build leaves
//! most of a device idle.

use std::ops::Range;

use ash::vk;

use super::inputs::{Addresses, Inputs, describe, input_bytes};
use super::plan::Group;
use super::scale::Scales;
use super::structure::{ALIGNMENT, Sizes, Structure, sizes};
use super::{BuildOptions, Plan};
use crate::scene::Scene;
use crate::verify::vulkan::Error;
use crate::verify::vulkan::commands::{Queries, Timer};
use crate::verify::vulkan::device::Device;
use crate::verify::vulkan::memory::{Buffer, Packing, Purpose};

pub(super) const BOTTOM: vk::AccelerationStructureTypeKHR = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;

/// Memory that one batch may use besides what stays; a BLAS that needs more gets a batch to itself.
#[derive(Clone, Copy, Debug)]
struct Budget {
    /// Scratch memory, in bytes.
    scratch: u64,
    /// Structures before compaction, in bytes.
    structures: u64,
    /// Vertices and indices, in bytes.
    input: u64,
}

const BUDGET: Budget = Budget { scratch: 256 << 20, structures: 512 << 20, input: 256 << 20 };

/// The built BLASes of a scene.
pub(in crate::verify::vulkan) struct Blases<'d> {
    structures: Vec<Structure<'d>>,
    /// Declared after the structures, which are dropped first.
    _storage: Vec<Buffer<'d>>,
    pub(in crate::verify::vulkan) build_ms: f64,
    /// Total size as built, in bytes.
    pub(in crate::verify::vulkan) bytes: u64,
    /// Total size after compaction, in bytes.
    pub(in crate::verify::vulkan) bytes_compacted: Option<u64>,
}

/// Memory needed by one BLAS.
#[derive(Clone, Copy, Debug, Default)]
struct Needs {
    sizes: Sizes,
    input: u64,
}

/// Structures and the buffers that hold them.
type Placed<'d> = (Vec<Structure<'d>>, Vec<Buffer<'d>>);

impl<'d> Blases<'d> {
    /// Builds the BLASes of a plan.
    pub(in crate::verify::vulkan) fn build(
        device: &'d Device,
        scene: &Scene,
        plan: &Plan,
        options: &BuildOptions,
    ) -> Result<Blases<'d>, Error> {
        let timer = Timer::new(device)?;
        let builder = Builder { device, scene, scales: &plan.scales, flags: flags(options), timer };
        let needs: Vec<Needs> = plan.groups.iter().map(|g| builder.needs(g)).collect();
        for (group, needs) in plan.groups.iter().zip(&needs) {
            let what = || format!("bytes of the {}", group.name(scene));
            Error::check_limit(what, needs.sizes.structure, device.info().limits.max_allocation)?;
        }
        let mut built = Blases {
            structures: Vec::with_capacity(needs.len()),
            _storage: Vec::new(),
            build_ms: 0.0,
            bytes: needs.iter().map(|n| n.sizes.structure).sum(),
            bytes_compacted: options.compact.then_some(0),
        };
        let limits = &device.info().limits;
        let budget = Budget { scratch: BUDGET.scratch.min(limits.max_allocation / 2), ..BUDGET };
        let batches = batches(&needs, budget, limits.scratch_alignment);
        let scratch = batches.iter().map(|b| b.scratch).max().unwrap_or(0);
        let scratch = Scratch::new(device, scratch)?;
        for batch in &batches {
            built.add(&builder, &plan.groups[batch.groups.clone()], &needs[batch.groups.clone()], &scratch)?;
        }
        Ok(built)
    }

    fn add(
        &mut self,
        builder: &Builder<'d, '_>,
        groups: &[Group],
        needs: &[Needs],
        scratch: &Scratch<'d>,
    ) -> Result<(), Error> {
        let mut placed = builder.place(needs.iter().map(|n| n.sizes.structure))?;
        self.build_ms += builder.build(groups, needs, &placed.0, scratch)?;
        if let Some(total) = &mut self.bytes_compacted {
            let sizes = builder.compacted_sizes(&placed.0)?;
            *total += sizes.iter().sum::<u64>();
            placed = builder.compact(&placed.0, sizes)?;
        }
        let (structures, storage) = placed;
        self.structures.extend(structures);
        self._storage.extend(storage);
        Ok(())
    }

    /// Returns the device address of the BLAS of a group.
    pub(super) fn address(&self, group: usize) -> u64 {
        self.structures[group].address
    }

    /// Replaces the BLAS of a group; what holds the new one must outlive all BLASes.
    pub(super) fn replace(&mut self, group: usize, structure: Structure<'d>) {
        self.structures[group] = structure;
    }

    pub(in crate::verify::vulkan) fn len(&self) -> usize {
        self.structures.len()
    }
}

fn flags(options: &BuildOptions) -> vk::BuildAccelerationStructureFlagsKHR {
    use vk::BuildAccelerationStructureFlagsKHR as Flags;
    options.flags() | if options.compact { Flags::ALLOW_COMPACTION } else { Flags::empty() }
}

/// BLASes built at once.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Batch {
    groups: Range<usize>,
    /// Scratch memory for the whole batch, in bytes.
    scratch: u64,
}

/// Groups neighbouring BLASes so that the needs of each batch stay within the budget.
fn batches(needs: &[Needs], budget: Budget, scratch_alignment: u64) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    let (mut structures, mut input) = (0, 0);
    for (i, n) in needs.iter().enumerate() {
        let scratch = n.sizes.scratch.next_multiple_of(scratch_alignment);
        let size = n.sizes.structure.next_multiple_of(ALIGNMENT);
        let fits = |batch: &Batch| {
            batch.scratch + scratch <= budget.scratch
                && structures + size <= budget.structures
                && input + n.input <= budget.input
        };
        match batches.last_mut().filter(|b| fits(b)) {
            Some(batch) => {
                batch.groups.end = i + 1;
                batch.scratch += scratch;
                (structures, input) = (structures + size, input + n.input);
            }
            None => {
                batches.push(Batch { groups: i..i + 1, scratch });
                (structures, input) = (size, n.input);
            }
        }
    }
    batches
}

/// Scratch memory, used by one batch at a time.
struct Scratch<'d> {
    buffer: Buffer<'d>,
    alignment: u64,
}

impl<'d> Scratch<'d> {
    fn new(device: &'d Device, size: u64) -> Result<Scratch<'d>, Error> {
        let alignment = device.info().limits.scratch_alignment;
        let what = "scratch memory of BLAS builds";
        // The address of a buffer may be less aligned than builds require.
        Ok(Scratch { buffer: Buffer::new(device, what, size + alignment, Purpose::Scratch)?, alignment })
    }

    fn start(&self) -> u64 {
        self.buffer.address.next_multiple_of(self.alignment)
    }
}

/// State shared by all batches.
struct Builder<'d, 'a> {
    device: &'d Device,
    scene: &'a Scene,
    scales: &'a Scales,
    flags: vk::BuildAccelerationStructureFlagsKHR,
    timer: Timer<'d>,
}

impl<'d> Builder<'d, '_> {
    fn describe<'g>(
        &self,
        geometries: &'g [vk::AccelerationStructureGeometryKHR<'g>],
    ) -> vk::AccelerationStructureBuildGeometryInfoKHR<'g> {
        vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(BOTTOM)
            .flags(self.flags)
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(geometries)
    }

    fn needs(&self, group: &Group) -> Needs {
        let geometries = group.geometries(self.scene);
        let described = describe(geometries, std::iter::repeat(Addresses::default()));
        let primitives: Vec<u32> = geometries.iter().map(|g| g.triangles.len() as u32).collect();
        Needs {
            sizes: sizes(self.device, &self.describe(&described), &primitives),
            input: geometries.iter().map(input_bytes).sum(),
        }
    }

    /// Allocates space for structures of the given sizes.
    fn place(&self, sizes: impl Iterator<Item = u64> + Clone) -> Result<Placed<'d>, Error> {
        let packing = Packing::new(sizes.clone(), ALIGNMENT, self.device.info().limits.max_allocation);
        let what = format!("{} BLASes", packing.places.len());
        let storage = packing.allocate(self.device, &what, Purpose::Structures)?;
        let structures = packing.places.iter().zip(sizes).map(|(place, size)| {
            Structure::new(self.device, &what, BOTTOM, (&storage[place.buffer], place.offset), size)
        });
        Ok((structures.collect::<Result<_, _>>()?, storage))
    }

    /// Builds a batch and returns the time it took, in milliseconds.
    fn build(
        &self,
        groups: &[Group],
        needs: &[Needs],
        structures: &[Structure<'d>],
        scratch: &Scratch<'d>,
    ) -> Result<f64, Error> {
        let inputs = Inputs::upload(self.device, self.scene, groups, self.scales)?;
        let mut addresses = inputs.addresses().iter().copied();
        let described: Vec<_> = groups.iter().map(|g| describe(g.geometries(self.scene), addresses.by_ref())).collect();
        let mut scratch_at = scratch.start();
        let mut builds = Vec::with_capacity(groups.len());
        for ((geometries, needs), structure) in described.iter().zip(needs).zip(structures) {
            let scratch_data = vk::DeviceOrHostAddressKHR { device_address: scratch_at };
            scratch_at += needs.sizes.scratch.next_multiple_of(scratch.alignment);
            let build = self.describe(geometries).dst_acceleration_structure(structure.handle);
            builds.push(build.scratch_data(scratch_data));
        }
        assert!(scratch_at <= scratch.buffer.address + scratch.buffer.size, "a batch keeps to its scratch memory");
        let ranges: Vec<Vec<_>> = groups.iter().map(|g| self.ranges(g)).collect();
        let ranges: Vec<&[_]> = ranges.iter().map(Vec::as_slice).collect();
        self.device.submit(&format!("building {} BLASes", groups.len()), |commands| {
            // Earlier batches no longer use the scratch memory, because each submission is waited for.
            self.device.barrier(commands);
            self.timer.measure(commands, || {
                // SAFETY: inputs, structures and scratch memory outlive the submission, are sized for these
                // descriptions, and do not overlap.
                unsafe { self.device.structures.cmd_build_acceleration_structures(commands, &builds, &ranges) }
            });
        })?;
        self.timer.milliseconds()
    }

    fn ranges(&self, group: &Group) -> Vec<vk::AccelerationStructureBuildRangeInfoKHR> {
        let count = |g: &crate::scene::Geometry| g.triangles.len() as u32;
        let range = |g| vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count(g));
        group.geometries(self.scene).iter().map(range).collect()
    }

    fn compacted_sizes(&self, structures: &[Structure<'d>]) -> Result<Vec<u64>, Error> {
        let kind = vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
        let queries = Queries::new(self.device, kind, structures.len() as u32)?;
        let handles: Vec<_> = structures.iter().map(|s| s.handle).collect();
        self.device.submit("asking for compacted sizes", |commands| {
            queries.reset(commands);
            self.device.barrier(commands);
            // SAFETY: the structures were built with compaction allowed; there is one query per structure.
            unsafe {
                self.device.structures.cmd_write_acceleration_structures_properties(
                    commands,
                    &handles,
                    kind,
                    queries.pool,
                    0,
                );
            }
        })?;
        queries.results()
    }

    /// Copies structures into buffers of their compacted sizes.
    fn compact(&self, structures: &[Structure<'d>], sizes: Vec<u64>) -> Result<Placed<'d>, Error> {
        let placed = self.place(sizes.iter().copied())?;
        self.device.submit("compacting BLASes", |commands| {
            self.device.barrier(commands);
            for (from, to) in structures.iter().zip(&placed.0) {
                let copy = vk::CopyAccelerationStructureInfoKHR::default()
                    .src(from.handle)
                    .dst(to.handle)
                    .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
                // SAFETY: the source was built with compaction allowed; the target has the size that it asked for.
                unsafe { self.device.structures.cmd_copy_acceleration_structure(commands, &copy) };
            }
        })?;
        Ok(placed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIGHT: Budget = Budget { scratch: 100, structures: 2048, input: 50 };

    fn ranges(needs: &[(u64, u64, u64)]) -> Vec<(Range<usize>, u64)> {
        let needs: Vec<Needs> = needs
            .iter()
            .map(|&(structure, scratch, input)| Needs {
                sizes: Sizes { structure, scratch, ..Sizes::default() },
                input,
            })
            .collect();
        batches(&needs, TIGHT, 8).into_iter().map(|b| (b.groups, b.scratch)).collect()
    }

    #[test]
    fn a_batch_ends_where_any_budget_does() {
        assert_eq!(ranges(&[(1, 50, 1), (1, 40, 1), (1, 8, 1)]), [(0..2, 96), (2..3, 8)]);
        assert_eq!(ranges(&[(1000, 1, 1), (1025, 1, 1), (1, 1, 1)]), [(0..1, 8), (1..3, 16)]);
        assert_eq!(ranges(&[(1, 1, 30), (1, 1, 20), (1, 1, 1)]), [(0..2, 16), (2..3, 8)]);
    }

    #[test]
    fn what_exceeds_the_budget_is_built_alone() {
        assert_eq!(ranges(&[(1, 1, 1), (1, 1000, 1), (1, 1, 1)]), [(0..1, 8), (1..2, 1000), (2..3, 8)]);
    }

    #[test]
    fn nothing_needs_no_batch() {
        assert_eq!(ranges(&[]), []);
    }
}
