//! The arguments, as clap reads them; they become options of the library and stop here.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::choose::model::Class;
use crate::choose::plans::Effort;
use crate::choose::{Choice, ChooseOptions, Forbidden};
use crate::commands::bake::{BakeOptions, FindCopies};
use crate::commands::verify::MatchBy;
use crate::copies::Likeness;
use crate::layout::BlasPer;
use crate::methods::{
    self, BvhOptions, ClusterOptions, InstanceOptions, Instances, Method, OverlapOptions, PartOptions,
};
use crate::scene::LoadOptions;
use crate::verify::build::{BuildOptions, Prefer};
use crate::verify::rays::MOST_RAYS;
use crate::verify::speed::MOST_REPEATS;
use crate::verify::weights::Weights;
use crate::verify::{DeviceChoice, Matching, VerifyOptions};

/// Threads at most: those that have nothing to do look for work and hold up the others, the longer the more they are.
const MOST_THREADS: i64 = 512;

/// Bakes scenes for hardware ray tracing: decides which triangles share a bottom-level acceleration structure
/// (BLAS), writes glTF whose meshes, primitives and nodes say so, and proves that the result shows the same surfaces.
#[derive(Debug, Parser)]
#[command(version, name = "raykiln", max_term_width = 110)]
pub(super) struct Arguments {
    #[command(flatten)]
    pub(super) output: Output,
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Debug, Args)]
pub(super) struct Output {
    /// Threads to use, from 1 to 512 [default: one for each core]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub(super) threads: Option<u16>,
    /// Print nothing but errors and what was asked for
    #[arg(long, short, global = true)]
    pub(super) quiet: bool,
    /// Print more: every warning, every pass, every candidate
    #[arg(long, short, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub(super) verbose: u8,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Choose a layout, write it, verify it, report
    #[command(after_help = BAKE_EXAMPLES)]
    Bake(Box<BakeArguments>),
    /// Trace the same rays through two files of one scene and compare what they see
    #[command(after_help = VERIFY_EXAMPLES)]
    Verify(Box<CompareArguments>),
    /// Show what a scene is made of, what it costs, and which vendor rules it breaks
    Inspect(InspectArguments),
    #[cfg(feature = "lab")]
    /// Lay out, trace and time many scenes in many layouts; fit the prices by which layouts are ranked
    #[command(after_help = "docs/lab.md describes the configuration and the tables.")]
    Lab {
        /// What to do
        #[arg(value_name = "CONFIG.toml")]
        config: PathBuf,
    },
    /// List the Vulkan devices, what they can do and what they lack to trace rays
    Devices {
        /// Print JSON instead of text
        #[arg(long)]
        json: bool,
    },
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page
    Man,
}

impl Command {
    /// Whether it reads scenes, and so may stage files.
    pub(super) fn reads_scenes(&self) -> bool {
        match self {
            Command::Bake(_) | Command::Verify(_) | Command::Inspect(_) => true,
            #[cfg(feature = "lab")]
            Command::Lab { .. } => true,
            Command::Devices { .. } | Command::Completions { .. } | Command::Man => false,
        }
    }
}

const BAKE_EXAMPLES: &str = "Examples:
  raykiln bake conference.obj -o conference.glb
  raykiln bake scene.gltf -o baked.glb --method overlap --skip-overlap-ratio 0.005
  raykiln bake scene.glb -o baked.glb --method single --keep 'door*' --report baked.json";

const VERIFY_EXAMPLES: &str = "Examples:
  raykiln verify conference.obj baked.glb
  raykiln verify scene.glb optimised-by-another-tool.glb --max-position-error-ratio 1e-4 --json
  raykiln verify scene.glb baked-and-reordered.glb --match surface";

#[derive(Debug, Args)]
pub(super) struct CompareArguments {
    /// The scene held to be right: OBJ, glTF or GLB
    pub(super) before: PathBuf,
    /// The file to verify: OBJ, glTF or GLB
    pub(super) after: PathBuf,
    /// How triangles of both files are matched
    #[arg(long = "match", value_enum, value_name = "BY", default_value_t = MatchArgument::Auto)]
    pub(super) match_by: MatchArgument,
    /// Also write the report to FILE (.json); may be repeated
    #[arg(long, value_name = "FILE")]
    pub(super) report: Vec<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) verify: VerifyArguments,
}

#[derive(Debug, Args)]
pub(super) struct BakeArguments {
    /// The scene: OBJ, glTF or GLB
    pub(super) input: PathBuf,
    /// Where to write the result: .glb, or .gltf with a .bin beside it
    #[arg(long, short)]
    pub(super) output: PathBuf,
    /// How to decide which triangles share a BLAS
    #[arg(long, value_enum, default_value_t = MethodArgument::Auto)]
    method: MethodArgument,
    /// auto: how many candidates to look at, and how closely, from 0 to 6
    #[arg(long, value_name = "LEVEL", default_value_t = Effort::default().level(), value_parser = clap::value_parser!(u8).range(0..=i64::from(Effort::MOST)))]
    effort: u8,
    /// auto: what kind of device rays are predicted for where none is at hand to measure
    #[arg(long, value_enum, default_value_t = ClassArgument::NoRtCores)]
    device_class: ClassArgument,
    /// Also write a report to FILE (.json); may be repeated
    #[arg(long, value_name = "FILE")]
    pub(super) report: Vec<PathBuf>,
    /// Print the report as JSON on standard output
    #[arg(long)]
    pub(super) json: bool,
    /// Leave nodes and meshes whose name matches GLOB, and all nodes below, as they are; may be repeated
    #[arg(long, value_name = "GLOB")]
    keep: Vec<String>,
    /// Refuse non-finite positions instead of dropping their triangles
    #[arg(long)]
    strict: bool,
    /// Drop empty nodes that nothing refers to
    #[arg(long)]
    prune: bool,
    /// How instances of one mesh are written
    #[arg(long, value_enum, value_name = "HOW", default_value_t = InstancingArgument::Nodes)]
    instancing: InstancingArgument,
    /// Which meshes become instances of another that they are a copy of
    /// [default: rigid for auto, off otherwise]
    #[arg(long, value_enum, value_name = "LIKENESS")]
    copies: Option<CopiesArgument>,
    #[command(flatten)]
    layout: LayoutArguments,
    #[command(flatten)]
    verify: VerifyArguments,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Layout options")]
struct LayoutArguments {
    /// bvh: tree nodes allowed over triangles of the scene
    #[arg(long, value_name = "RATIO", default_value_t = BvhOptions::default().nodes_per_triangle_ratio, value_parser = ratio)]
    nodes_per_triangle_ratio: f64,
    /// bvh: do not split nodes whose box area over the scene's is below this
    #[arg(long, value_name = "RATIO", default_value_t = BvhOptions::default().min_area_ratio, value_parser = ratio)]
    min_area_ratio: f64,
    /// overlap: leave pairs alone whose overlap area over the scene box's area is at most this
    #[arg(long, value_name = "RATIO", default_value_t = OverlapOptions::default().skip_overlap_ratio, value_parser = ratio)]
    skip_overlap_ratio: f64,
    /// overlap: split pairs whose overlap over their joint box is below this, merge the others
    #[arg(long, value_name = "RATIO", default_value_t = OverlapOptions::default().split_or_merge_ratio, value_parser = ratio)]
    split_or_merge_ratio: f64,
    /// overlap: split both objects of a pair at their middle below this, at their overlap above it
    #[arg(long, value_name = "RATIO", default_value_t = OverlapOptions::default().split_ratio, value_parser = ratio)]
    split_ratio: f64,
    /// overlap: stop when the scene's overlap ratio falls below this
    #[arg(long, value_name = "RATIO", default_value_t = OverlapOptions::default().termination_overlap_ratio, value_parser = ratio)]
    termination_overlap_ratio: f64,
    /// bvh, overlap: do not split objects with at most this many triangles
    #[arg(long, value_name = "N", default_value_t = OverlapOptions::default().min_triangles)]
    min_triangles: usize,
    /// Leave instances instanced where writing them out would need more predicted BLAS and TLAS bytes than this times
    /// the input's [default: 1.25 for auto, no limit otherwise]
    #[arg(long, value_name = "RATIO", value_parser = positive_ratio)]
    max_bytes_ratio: Option<f64>,
    /// What a method does with instances of meshes that several place
    /// [default: bake-or-keep; auto: whatever pays]
    #[arg(long, value_enum)]
    instances: Option<InstancesArgument>,
    /// --instances choose: open all instances of a mesh into so many pieces, or none [default: as many pieces, and those
    /// instances, as are predicted to cost least]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64))]
    pieces: Option<u32>,
    /// single, cluster: give objects that enclose the rest, or lie far outside it, groups of their own [default: false;
    /// auto: where it pays]
    #[arg(long, value_name = "BOOL")]
    isolate: Option<bool>,
    /// single, cluster: give triangles that are not opaque groups of their own [default: false; auto: where it pays]
    #[arg(long, value_name = "BOOL")]
    split_opacity: Option<bool>,
    /// cluster, --instances choose: cost of entering an instance, in node-traversal steps
    #[arg(long, value_name = "STEPS", default_value_t = InstanceOptions::default().entry_cost, value_parser = ratio)]
    entry_cost: f64,
    /// cluster, --instances choose: store groups in frames of their own
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    frames: bool,
    /// cluster: most triangles of a group [default: no limit]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    max_group_triangles: Option<u32>,
    /// cluster: longest side of a group's box over that of the scene's [default: no limit]
    #[arg(long, value_name = "RATIO", value_parser = positive_ratio)]
    max_group_extent_ratio: Option<f64>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Verification options")]
pub(super) struct VerifyArguments {
    /// Where to trace rays: `auto` (a GPU if there is one, else the CPU), `cpu`, or a Vulkan device by its index or a
    /// part of its name (see `raykiln devices`)
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    device: String,
    /// Rays of each kind to trace through both files, at most 16777216
    /// [default: 16384 compared; as many timed, but 3686400 on a GPU]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=i64::from(MOST_RAYS)))]
    rays: Option<u32>,
    /// What each kind of rays counts for where one speed is wanted; kinds left out count nothing
    #[arg(long, value_name = "KIND=WEIGHT,...", default_value = "primary=1,shadow=1,diffuse=1,random=0")]
    weights: Weights,
    /// How often to repeat the timing of each kind, at most 1000
    #[arg(long, value_name = "N", default_value_t = VerifyOptions::default().repeats, value_parser = clap::value_parser!(u32).range(0..=i64::from(MOST_REPEATS)))]
    repeats: u32,
    /// Seed of the rays
    #[arg(long, value_name = "N", default_value_t = VerifyOptions::default().seed)]
    seed: u64,
    /// Largest distance a vertex may move, over the scene's diagonal
    #[arg(long, value_name = "RATIO", default_value_t = VerifyOptions::default().max_position_error_ratio, value_parser = ratio)]
    max_position_error_ratio: f64,
    /// What a Vulkan driver favours when it builds acceleration structures
    #[arg(long, value_enum, value_name = "FLAGS", default_value_t = PreferArgument::FastTrace)]
    build_flags: PreferArgument,
    /// Build structures that can be refitted
    #[arg(long)]
    allow_update: bool,
    /// Compact BLASes
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    compact: bool,
    /// What goes into one BLAS: on the device, in what is predicted, and in the costs reported
    #[arg(long, value_enum, value_name = "PART", default_value_t = BlasPerArgument::Mesh)]
    blas_per: BlasPerArgument,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum InstancesArgument {
    /// Bake all instances of a mesh or none, as --max-bytes-ratio allows
    BakeOrKeep,
    /// Keep, open into shared pieces or bake: what is predicted to cost least within --max-bytes-ratio
    Choose,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum MatchArgument {
    /// By identity where AFTER says where its triangles come from and most of that fits BEFORE, else by surface
    Auto,
    /// By what AFTER says about where its triangles come from; all of them are compared, exactly
    Identity,
    /// Not at all: only what rays see is compared
    Surface,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum InstancingArgument {
    /// Each as a node, but for copies that the input has by EXT_mesh_gpu_instancing and that are not written out
    Nodes,
    /// As copies of one node, by EXT_mesh_gpu_instancing, where --max-position-error-ratio allows; then required of readers
    Extension,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum CopiesArgument {
    /// Those with the same coordinates and attributes, triangles and vertices in any order
    Exact,
    /// Also those turned, moved, uniformly scaled or mirrored
    Rigid,
    /// None
    Off,
}

impl From<CopiesArgument> for FindCopies {
    fn from(argument: CopiesArgument) -> FindCopies {
        match argument {
            CopiesArgument::Exact => FindCopies::Always(Likeness::Exact),
            CopiesArgument::Rigid => FindCopies::Always(Likeness::Rigid),
            CopiesArgument::Off => FindCopies::Off,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PreferArgument {
    /// Rays per second
    FastTrace,
    /// Build time
    FastBuild,
    /// Neither
    None,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum BlasPerArgument {
    /// All geometries of a mesh
    Mesh,
    /// Each geometry by itself, as some renderers do
    Primitive,
}

#[derive(Debug, Args)]
pub(super) struct InspectArguments {
    /// The scene: OBJ, glTF or GLB
    pub(super) input: PathBuf,
    /// Also write the report to FILE (.json); may be repeated
    #[arg(long, value_name = "FILE")]
    pub(super) report: Vec<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    pub(super) json: bool,
    /// Refuse non-finite positions instead of dropping their triangles
    #[arg(long)]
    pub(super) strict: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ClassArgument {
    /// Traversal in software
    NoRtCores,
    /// Traversal in hardware
    RtCores,
}

impl From<ClassArgument> for Class {
    fn from(argument: ClassArgument) -> Class {
        match argument {
            ClassArgument::NoRtCores => Class::NoRtCores,
            ClassArgument::RtCores => Class::RtCores,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum MethodArgument {
    /// The fastest of many candidates, the input as it is among them
    Auto,
    /// The input as it is
    Keep,
    /// One BLAS of all that may be restructured
    Single,
    /// One BLAS for each object and material; instances stay
    PerObject,
    /// Binned SAH splits of every object
    Bvh,
    /// Split and merge objects until their boxes overlap little
    Overlap,
    /// Groups of least predicted cost, each stored in the frame that fits it best
    Cluster,
}

impl From<MethodArgument> for Choice {
    fn from(argument: MethodArgument) -> Choice {
        Choice::Method(match argument {
            MethodArgument::Auto => return Choice::Auto,
            MethodArgument::Keep => Method::Keep,
            MethodArgument::Single => Method::Single,
            MethodArgument::PerObject => Method::PerObject,
            MethodArgument::Bvh => Method::Bvh,
            MethodArgument::Overlap => Method::Overlap,
            MethodArgument::Cluster => Method::Cluster,
        })
    }
}

impl From<MatchArgument> for MatchBy {
    fn from(argument: MatchArgument) -> MatchBy {
        match argument {
            MatchArgument::Auto => MatchBy::Auto,
            MatchArgument::Identity => MatchBy::Always(Matching::Identity),
            MatchArgument::Surface => MatchBy::Always(Matching::Surface),
        }
    }
}

fn ratio(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (0.0..f64::INFINITY).contains(&value) => Ok(value),
        _ => Err("must be a finite number of at least 0".into()),
    }
}

fn positive_ratio(text: &str) -> Result<f64, String> {
    ratio(text).ok().filter(|value| *value > 0.0).ok_or_else(|| "must be a finite number above 0".into())
}

impl BakeArguments {
    /// What the library needs to know.
    pub(super) fn options(&self) -> Result<BakeOptions> {
        let l = &self.layout;
        Ok(BakeOptions {
            choose: ChooseOptions {
                method: self.method.into(),
                effort: Effort::new(self.effort),
                class: self.device_class.into(),
                forbidden: Forbidden {
                    isolate: l.isolate == Some(false),
                    split_opacity: l.split_opacity == Some(false),
                    choose_instances: matches!(l.instances, Some(InstancesArgument::BakeOrKeep)),
                },
                layout: l.options(),
            },
            copies: self.copies.map_or(FindCopies::ByMethod, FindCopies::from),
            load: LoadOptions { strict: self.strict, keep: self.keep.clone() },
            prune: self.prune,
            copy_instances: self.instancing == InstancingArgument::Extension,
            verify: self.verify.options(),
        })
    }
}

impl LayoutArguments {
    /// What the methods need to know.
    fn options(&self) -> methods::Options {
        methods::Options {
            instances: InstanceOptions {
                shared: match self.instances {
                    None | Some(InstancesArgument::BakeOrKeep) => Instances::BakeOrKeep,
                    Some(InstancesArgument::Choose) => Instances::Choose,
                },
                pieces: self.pieces,
                max_bytes_ratio: self.max_bytes_ratio,
                entry_cost: self.entry_cost,
                frames: self.frames,
            },
            parts: PartOptions {
                isolate: self.isolate == Some(true),
                split_opacity: self.split_opacity == Some(true),
                ..PartOptions::default()
            },
            bvh: BvhOptions {
                nodes_per_triangle_ratio: self.nodes_per_triangle_ratio,
                min_area_ratio: self.min_area_ratio,
                min_triangles: self.min_triangles,
            },
            overlap: OverlapOptions {
                skip_overlap_ratio: self.skip_overlap_ratio,
                split_or_merge_ratio: self.split_or_merge_ratio,
                split_ratio: self.split_ratio,
                termination_overlap_ratio: self.termination_overlap_ratio,
                min_triangles: self.min_triangles,
            },
            cluster: ClusterOptions {
                max_group_triangles: self.max_group_triangles,
                max_group_extent_ratio: self.max_group_extent_ratio,
                ..ClusterOptions::default()
            },
            ..methods::Options::default()
        }
    }
}

impl VerifyArguments {
    /// What the library needs to know.
    pub(super) fn options(&self) -> VerifyOptions {
        let default = VerifyOptions::default();
        VerifyOptions {
            device: DeviceChoice::from(self.device.as_str()),
            build: BuildOptions {
                prefer: match self.build_flags {
                    PreferArgument::FastTrace => Prefer::FastTrace,
                    PreferArgument::FastBuild => Prefer::FastBuild,
                    PreferArgument::None => Prefer::None,
                },
                allow_update: self.allow_update,
                compact: self.compact,
                blas_per: match self.blas_per {
                    BlasPerArgument::Mesh => BlasPer::Mesh,
                    BlasPerArgument::Primitive => BlasPer::Primitive,
                },
            },
            rays_per_kind: self.rays.unwrap_or(default.rays_per_kind),
            timed_rays_per_kind: self.rays,
            repeats: self.repeats,
            weights: self.weights,
            seed: self.seed,
            max_position_error_ratio: self.max_position_error_ratio,
            ..default
        }
    }
}
