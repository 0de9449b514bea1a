//! The arguments, as clap reads them; they become options of the library and stop here.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::{Args, Parser, Subcommand, ValueEnum};
use raykiln_formats::document::Compression;
use raykiln_formats::edit::RecordPlace;
use raykiln_formats::{DoubleSided, ObjNormals, ObjOptions};

use crate::choose::model::Class;
use crate::choose::plans::Effort;
use crate::choose::{Choice, ChooseOptions, Forbidden};
use crate::commands::bake::{BakeOptions, FindCopies, PlanUse};
use crate::commands::verify::MatchBy;
use crate::copies::Likeness;
use crate::layout::BlasPer;
use crate::methods::{
    self, BvhOptions, ClusterOptions, InstanceOptions, Instances, Method, OverlapOptions, OverlapRule, PartOptions,
};
use crate::report::FailOn;
use crate::scene::LoadOptions;
use crate::verify::build::{BuildOptions, Prefer};
use crate::verify::rays::MOST_RAYS;
use crate::verify::speed::MOST_REPEATS;
use crate::verify::views::{FEWEST_VIEWS, MOST_VIEWS};
use crate::verify::weights::Weights;
use crate::verify::{DeviceChoice, Matching, VerifyOptions};

/// Upper limit on threads: idle workers spin and slow the busy ones down.
const MOST_THREADS: i64 = 512;

/// Bakes scenes for hardware ray tracing: decides which triangles share a bottom-level acceleration structure
/// (BLAS), writes glTF whose meshes, primitives and nodes say so, and proves that the result shows the same surfaces.
#[derive(Debug, Parser)]
#[command(
    version,
    name = "raykiln",
    max_term_width = 110,
    after_help = "`raykiln --version --json` prints version, build and features for programs."
)]
pub(super) struct Arguments {
    #[command(flatten)]
    pub(super) output: Output,
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Debug, Args)]
pub(super) struct Output {
    /// Number of threads, from 1 to 512 [default: one per core]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub(super) threads: Option<u16>,
    /// Print only errors and the requested output
    #[arg(long, short, global = true)]
    pub(super) quiet: bool,
    /// Print more: every warning, every pass, every candidate
    #[arg(long, short, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub(super) verbose: u8,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Choose a layout, write it, verify it and report
    #[command(after_help = BAKE_EXAMPLES)]
    Bake(Box<BakeArguments>),
    /// Bake many assets: patterns, lists or a manifest; what is unchanged is not baked again
    #[command(after_help = super::batch::EXAMPLES)]
    Batch(Box<super::batch::BatchArguments>),
    /// Time the candidates that `bake --export-candidates` wrote on this machine's GPU, and name the winner
    #[command(after_help = super::time::EXAMPLES)]
    Time(super::time::TimeArguments),
    /// Trace the same rays through two files of one scene and compare the hits
    #[command(after_help = VERIFY_EXAMPLES)]
    Verify(Box<CompareArguments>),
    /// Show what a scene contains, what it costs to trace and which vendor rules it breaks
    Inspect(InspectArguments),
    /// Draw a picture of a scene: its materials, groups, boxes, or the cost of its rays
    #[command(after_help = super::render::EXAMPLES)]
    Render(super::render::RenderArguments),
    #[cfg(feature = "lab")]
    /// Time many layouts of many scenes: fit the cost model that ranks layouts, or set errors against run time
    #[command(after_help = "docs/lab.md describes the configuration and the tables.")]
    Lab(super::lab::LabArguments),
    /// List Vulkan devices, their limits, and which features for ray tracing they lack
    Devices {
        /// Print JSON instead of text
        #[arg(long)]
        json: bool,
    },
    /// Check or clean the folder of `--cache`
    Cache {
        #[command(subcommand)]
        command: super::cache::CacheCommand,
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
            Command::Bake(_)
            | Command::Batch(_)
            | Command::Time(_)
            | Command::Verify(_)
            | Command::Inspect(_)
            | Command::Render(_) => true,
            #[cfg(feature = "lab")]
            Command::Lab(_) => true,
            Command::Devices { .. } | Command::Cache { .. } | Command::Completions { .. } | Command::Man => false,
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
    /// Reference scene: OBJ, glTF or GLB
    pub(super) before: PathBuf,
    /// File to verify: OBJ, glTF or GLB
    pub(super) after: PathBuf,
    /// How to match the triangles of both files
    #[arg(long = "match", value_enum, value_name = "BY", default_value_t = MatchArgument::Auto)]
    pub(super) match_by: MatchArgument,
    /// Also fail if the layouts differ: BLAS groups (meshes as nodes place them) were merged or split
    #[arg(long)]
    pub(super) layout: bool,
    /// Refuse scenes that name files outside of DIR, also through links; without it, glTF may name no absolute paths
    #[arg(long, value_name = "DIR")]
    pub(super) root: Option<PathBuf>,
    /// Also write the report to FILE (.json, .html for a page with charts, or .sarif for findings about BEFORE); may be
    /// repeated
    #[arg(long, value_name = "FILE")]
    pub(super) report: Vec<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) obj: ObjArguments,
    #[command(flatten)]
    pub(super) verify: VerifyArguments,
}

#[derive(Debug, Args)]
pub(super) struct BakeArguments {
    /// Scene: OBJ, glTF or GLB; `-` reads a scene in one file from standard input
    pub(super) input: PathBuf,
    /// Output file: .glb, or .gltf with a .bin beside it; `-` writes a GLB to standard output
    #[arg(long, short)]
    pub(super) output: PathBuf,
    /// Also write a report to FILE (.json, .html for a page with charts, or .sarif for findings about the input); may be
    /// repeated
    #[arg(long, value_name = "FILE")]
    pub(super) report: Vec<PathBuf>,
    /// Print the report as JSON on standard output
    #[arg(long)]
    pub(super) json: bool,
    /// Also write the report as JSON to an open file descriptor, such as the end of a pipe
    #[cfg(unix)]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) emit_report_fd: Option<u16>,
    /// Also write the decision, with every option and the hash of the input, to FILE (.json)
    #[arg(long, value_name = "FILE")]
    pub(super) write_plan: Option<PathBuf>,
    /// Make the same bytes as the bake that wrote FILE, without a device and without deciding anything; from a folder of
    /// candidates that `raykiln time` has timed, the winner
    #[arg(long, value_name = "FILE", conflicts_with = "write_plan")]
    pub(super) plan: Option<PathBuf>,
    /// auto: also write the candidates that a GPU would time, with a plan each, to a new folder DIR, for `raykiln time`
    #[arg(long, value_name = "DIR", conflicts_with_all = ["plan", "cache"])]
    pub(super) export_candidates: Option<PathBuf>,
    /// Also write to FILE which files the output was made from, as a rule for Make and Ninja
    #[arg(long, value_name = "FILE")]
    pub(super) depfile: Option<PathBuf>,
    /// Treat warnings about the input as errors: print them, write nothing and exit with status 2
    #[arg(long)]
    pub(super) deny_warnings: bool,
    /// Refuse a scene that names files outside of DIR, also through links; without it, glTF may name no absolute paths
    #[arg(long, value_name = "DIR")]
    pub(super) root: Option<PathBuf>,
    /// Allow the output to replace the input
    #[arg(long)]
    pub(super) in_place: bool,
    /// End with an error before more memory than this is used, such as 4GiB (needs Linux)
    #[arg(long, value_name = "SIZE", value_parser = size)]
    pub(super) max_memory: Option<u64>,
    #[command(flatten)]
    pub(super) cache: CacheArguments,
    /// End, and leave nothing, when standard input is closed: whoever started the process has ended
    #[arg(long, hide = true)]
    pub(super) end_with_stdin: bool,
    #[command(flatten)]
    pub(super) options: OptionArguments,
}

/// Where results are kept.
#[derive(Clone, Debug, Args)]
pub(super) struct CacheArguments {
    /// Take the result from this folder if the same content was baked with the same options before, else keep it there;
    /// any number of processes and machines may share the folder
    #[arg(long, value_name = "DIR")]
    pub(super) cache: Option<PathBuf>,
    /// Keep the cache below this size, such as 20GiB: the results that were not used for the longest time go first
    #[arg(long, value_name = "SIZE", requires = "cache", value_parser = size)]
    pub(super) cache_size: Option<u64>,
}

/// A size in bytes, such as 4GiB.
pub(super) fn size(text: &str) -> Result<u64, String> {
    text.parse().map(|size: bytesize::ByteSize| size.0).map_err(|_| "must be a size, such as 500MB or 4GiB".into())
}

/// The options that decide what a bake writes.
#[derive(Debug, Args)]
pub(super) struct OptionArguments {
    /// How to decide which triangles share a BLAS
    #[arg(long, value_enum, default_value_t = MethodArgument::Auto)]
    method: MethodArgument,
    /// auto: number of candidates to evaluate and precision of the evaluation, from 0 to 6
    #[arg(long, value_name = "LEVEL", default_value_t = Effort::default().level(), value_parser = clap::value_parser!(u8).range(0..=i64::from(Effort::MOST)))]
    effort: u8,
    /// auto: device class to predict for when no GPU is available
    #[arg(long, value_enum, default_value_t = ClassArgument::NoRtCores)]
    device_class: ClassArgument,
    /// Do not restructure nodes and meshes whose name matches GLOB, nor the nodes below them; may be repeated
    #[arg(long, value_name = "GLOB")]
    keep: Vec<String>,
    /// Refuse files with non-finite positions or damaged faces instead of dropping the triangles
    #[arg(long)]
    strict: bool,
    /// Drop empty nodes that nothing refers to
    #[arg(long)]
    prune: bool,
    /// How to write the instances of one mesh
    #[arg(long, value_enum, value_name = "HOW", default_value_t = InstancingArgument::Nodes)]
    instancing: InstancingArgument,
    /// How to compress the output
    #[arg(long, value_enum, value_name = "HOW", default_value_t = CompressArgument::None)]
    compress: CompressArgument,
    /// Where to record which triangle of the input each triangle of the output comes from
    #[arg(long, value_enum, value_name = "WHERE", default_value_t = RecordArgument::File)]
    pub(super) record: RecordArgument,
    /// Which copies of a mesh to replace by instances of it
    /// [default: rigid for auto, off otherwise]
    #[arg(long, value_enum, value_name = "LIKENESS")]
    copies: Option<CopiesArgument>,
    #[command(flatten)]
    pub(super) obj: ObjArguments,
    #[command(flatten)]
    layout: LayoutArguments,
    #[command(flatten)]
    verify: VerifyArguments,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "OBJ options")]
pub(super) struct ObjArguments {
    /// Folder to search for material libraries and textures that are not beside the file; may be repeated
    #[arg(long, value_name = "DIR")]
    search: Vec<PathBuf>,
    /// Which normals to write
    #[arg(long, value_enum, value_name = "WHICH", default_value_t = NormalsArgument::Keep)]
    normals: NormalsArgument,
    /// Which materials to show from both sides
    #[arg(long, value_enum, value_name = "WHICH", default_value_t = DoubleSidedArgument::Auto)]
    double_sided: DoubleSidedArgument,
    /// Axis of the file that points up
    #[arg(long, value_enum, value_name = "AXIS", default_value_t = AxisArgument::Y)]
    up_axis: AxisArgument,
    /// Length of the file's unit in metres, such as 0.01 for centimetres
    #[arg(long, value_name = "METRES", default_value_t = 1.0, value_parser = positive_ratio)]
    unit: f64,
}

impl ObjArguments {
    /// What the library needs to know.
    pub(super) fn options(&self) -> ObjOptions {
        let mut options = ObjOptions::default().with_search(self.search.clone());
        options.normals = match self.normals {
            NormalsArgument::Keep => ObjNormals::Keep,
            NormalsArgument::Generate => ObjNormals::Generate,
            NormalsArgument::None => ObjNormals::None,
        };
        options.double_sided = match self.double_sided {
            DoubleSidedArgument::Auto => DoubleSided::Auto,
            DoubleSidedArgument::Always => DoubleSided::Always,
            DoubleSidedArgument::Never => DoubleSided::Never,
        };
        options.z_up = matches!(self.up_axis, AxisArgument::Z);
        options.unit = (self.unit != 1.0).then_some(self.unit);
        options
    }

    /// What the library needs to know to load a scene.
    pub(super) fn load(&self) -> LoadOptions {
        LoadOptions { obj: self.options(), ..LoadOptions::default() }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum NormalsArgument {
    /// Those of the file; faces of smoothing groups that lack normals get generated ones
    Keep,
    /// Generated for all faces
    Generate,
    /// None
    None,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum DoubleSidedArgument {
    /// Materials of surfaces that are not closed
    Auto,
    /// All
    Always,
    /// None
    Never,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum AxisArgument {
    /// y, as in glTF
    Y,
    /// z, as in CAD and Blender
    Z,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Layout options")]
struct LayoutArguments {
    /// bvh: upper limit on tree nodes, per triangle of the scene
    #[arg(long, value_name = "RATIO", default_value_t = BvhOptions::default().nodes_per_triangle_ratio, value_parser = ratio)]
    nodes_per_triangle_ratio: f64,
    /// bvh: do not split a node if its box area over that of the scene's core is below this
    #[arg(long, value_name = "RATIO", default_value_t = BvhOptions::default().min_area_ratio, value_parser = ratio)]
    min_area_ratio: f64,
    /// overlap: ignore pairs whose overlap area over the box area of the scene's core is at most this
    #[arg(long, value_name = "RATIO", default_value_t = OverlapOptions::default().skip_overlap_ratio, value_parser = ratio)]
    skip_overlap_ratio: f64,
    /// overlap: split pairs whose overlap over their joint box is below this; merge the others
    #[arg(long, value_name = "RATIO", default_value_t = OverlapOptions::default().split_or_merge_ratio, value_parser = ratio)]
    split_or_merge_ratio: f64,
    /// overlap: split both objects of a pair in the middle below this, at their overlap above it
    #[arg(long, value_name = "RATIO", default_value_t = OverlapOptions::default().split_ratio, value_parser = ratio)]
    split_ratio: f64,
    /// overlap: stop when the overlap ratio of the scene's core falls below this
    #[arg(long, value_name = "RATIO", default_value_t = OverlapOptions::default().termination_overlap_ratio, value_parser = ratio)]
    termination_overlap_ratio: f64,
    /// overlap: how literally to follow the thesis that the method is from
    #[arg(long, value_name = "RULE", value_enum, default_value_t = OverlapRuleArgument::Improved)]
    overlap_rule: OverlapRuleArgument,
    /// bvh, overlap: do not split objects with at most this many triangles
    #[arg(long, value_name = "N", default_value_t = OverlapOptions::default().min_triangles)]
    min_triangles: usize,
    /// Upper limit on predicted BLAS and TLAS bytes over the input's; instances stay instanced beyond it
    /// [default: 1.25 for auto, no limit otherwise]
    #[arg(long, value_name = "RATIO", value_parser = positive_ratio)]
    max_bytes_ratio: Option<f64>,
    /// What to do with meshes that are placed more than once
    /// [default: bake-or-keep; auto: both are tried]
    #[arg(long, value_enum)]
    instances: Option<InstancesArgument>,
    /// --instances choose: number of pieces into which all instances of a mesh are opened, or none of them
    /// [default: the number and the instances with the lowest predicted cost]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64))]
    pieces: Option<u32>,
    /// single, cluster: put objects that enclose the rest or lie far outside it into groups of their own
    /// [default: false; auto: both are tried]
    #[arg(long, value_name = "BOOL")]
    isolate: Option<bool>,
    /// single, cluster: put triangles that are not opaque into groups of their own
    /// [default: false; auto: both are tried]
    #[arg(long, value_name = "BOOL")]
    split_opacity: Option<bool>,
    /// cluster, --instances choose: cost of entering an instance, in node-traversal steps
    #[arg(long, value_name = "STEPS", default_value_t = InstanceOptions::default().entry_cost, value_parser = ratio)]
    entry_cost: f64,
    /// cluster, --instances choose: store groups in frames of their own
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    frames: bool,
    /// cluster: upper limit on triangles per group [default: no limit]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    max_group_triangles: Option<u32>,
    /// cluster: upper limit on the longest side of a group's box over that of the scene's box
    /// [default: no limit]
    #[arg(long, value_name = "RATIO", value_parser = positive_ratio)]
    max_group_extent_ratio: Option<f64>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Verification options")]
pub(super) struct VerifyArguments {
    /// Device that traces rays: `auto` (a GPU if there is one, else the CPU), `cpu`, or a Vulkan device by index or part
    /// of its name (see `raykiln devices`)
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    device: String,
    /// Number of rays of each kind to trace through both files, at most 16777216
    /// [default: 16384 compared and timed; 3686400 timed on a GPU]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=i64::from(MOST_RAYS)))]
    rays: Option<u32>,
    /// Weight of each ray kind in the overall speed; omitted kinds weigh 0
    #[arg(long, value_name = "KIND=WEIGHT,...", default_value = "primary=1,shadow=1,diffuse=1,random=0")]
    weights: Weights,
    /// Number of timed repeats of each ray kind, at most 1000
    #[arg(long, value_name = "N", default_value_t = VerifyOptions::default().repeats, value_parser = clap::value_parser!(u32).range(0..=i64::from(MOST_REPEATS)))]
    repeats: u32,
    /// Number of views that rays come from, from 2 to 64: the file's cameras first, then viewpoints in and around the
    /// scene; every other view chooses a layout, the rest judge it
    #[arg(long, value_name = "N", default_value_t = VerifyOptions::default().views, value_parser = clap::value_parser!(u32).range(i64::from(FEWEST_VIEWS)..=i64::from(MOST_VIEWS)))]
    views: u32,
    /// Least speedup of any judging view with which an output counts as faster; otherwise the next candidate or the
    /// input is written
    #[arg(long, value_name = "RATIO", default_value_t = VerifyOptions::default().least_view_ratio, value_parser = ratio)]
    least_view_ratio: f64,
    /// Seed of the views and rays
    #[arg(long, value_name = "N", default_value_t = VerifyOptions::default().seed)]
    seed: u64,
    /// Largest distance that a vertex may move, over the scene's diagonal
    #[arg(long, value_name = "RATIO", default_value_t = VerifyOptions::default().max_position_error_ratio, value_parser = ratio)]
    max_position_error_ratio: f64,
    /// What a Vulkan driver optimises for when it builds acceleration structures
    #[arg(long, value_enum, value_name = "FLAGS", default_value_t = PreferArgument::FastTrace)]
    build_flags: PreferArgument,
    /// Build acceleration structures that can be refitted
    #[arg(long)]
    allow_update: bool,
    /// Compact BLASes after building
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    compact: bool,
    /// Contents of one BLAS, on the device, in predictions and in reported costs
    #[arg(long, value_enum, value_name = "PART", default_value_t = BlasPerArgument::Mesh)]
    blas_per: BlasPerArgument,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum InstancesArgument {
    /// Bake all instances of a mesh or none, as --max-bytes-ratio allows
    BakeOrKeep,
    /// Keep, open into shared pieces or bake, whichever has the lowest predicted cost within --max-bytes-ratio
    Choose,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum OverlapRuleArgument {
    /// Merged objects stay together; the round with the least overlap is taken, if it is less than the input's
    Improved,
    /// To the letter: merged objects are divided again, and the last round is taken
    Thesis,
}

impl From<OverlapRuleArgument> for OverlapRule {
    fn from(of: OverlapRuleArgument) -> OverlapRule {
        match of {
            OverlapRuleArgument::Improved => OverlapRule::Improved,
            OverlapRuleArgument::Thesis => OverlapRule::Thesis,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum MatchArgument {
    /// All triangles by their place; a record in AFTER of where they come from need not be right
    Auto,
    /// All triangles by their place, which must be the one that AFTER records
    Identity,
    /// Only what rays see
    Surface,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum InstancingArgument {
    /// One node per instance; copies by EXT_mesh_gpu_instancing in the input stay unless they are written out
    Nodes,
    /// Copies of one node by EXT_mesh_gpu_instancing, if --max-position-error-ratio allows; readers must support it
    Extension,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum CompressArgument {
    /// Not at all
    None,
    /// By EXT_meshopt_compression, without loss; readers must support it
    Meshopt,
}

impl From<CompressArgument> for Compression {
    fn from(argument: CompressArgument) -> Self {
        match argument {
            CompressArgument::None => Compression::None,
            CompressArgument::Meshopt => Compression::Meshopt,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum RecordArgument {
    /// In the output, as extras
    File,
    /// In a file beside it, named like it with `.record.json` at the end
    Sidecar,
    /// Nowhere
    None,
}

impl From<RecordArgument> for RecordPlace {
    fn from(argument: RecordArgument) -> Self {
        match argument {
            RecordArgument::File => RecordPlace::File,
            RecordArgument::Sidecar => RecordPlace::Sidecar,
            RecordArgument::None => RecordPlace::None,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum CopiesArgument {
    /// Copies with equal coordinates and attributes, in any order of triangles and vertices
    Exact,
    /// Also copies that are rotated, moved, uniformly scaled or mirrored
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
    /// One geometry, as some renderers build it
    Primitive,
}

#[derive(Debug, Args)]
pub(super) struct InspectArguments {
    /// Scene: OBJ, glTF or GLB
    pub(super) input: PathBuf,
    /// Also write the report to FILE (.json, .html for a page with charts, or .sarif for its findings); may be repeated
    #[arg(long, value_name = "FILE")]
    pub(super) report: Vec<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    pub(super) json: bool,
    /// Refuse files with non-finite positions or damaged faces instead of dropping the triangles
    #[arg(long)]
    pub(super) strict: bool,
    /// Exit with status 1 on a finding of this rule (such as RK006), or of this severity (note, warning, error) or a
    /// higher one; may be repeated
    #[arg(long, value_name = "RULE|SEVERITY")]
    pub(super) fail_on: Vec<FailOn>,
    /// Refuse a scene that names files outside of DIR, also through links; without it, glTF may name no absolute paths
    #[arg(long, value_name = "DIR")]
    pub(super) root: Option<PathBuf>,
    #[command(flatten)]
    pub(super) obj: ObjArguments,
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
    /// The fastest of many candidates, which include the unchanged input
    Auto,
    /// The unchanged input
    Keep,
    /// One BLAS of everything that may be restructured
    Single,
    /// One BLAS per object and material; instances stay
    PerObject,
    /// Every object split by the binned surface area heuristic
    Bvh,
    /// Objects split and merged until their boxes overlap little
    Overlap,
    /// Groups with the lowest predicted cost, each stored in the frame that fits it best
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
        let exports = self.export_candidates.is_some();
        let plan = if self.write_plan.is_some() || exports { PlanUse::Write } else { PlanUse::Neither };
        let mut options = BakeOptions { plan, ..self.options.options()? };
        options.choose.export = exports;
        ensure!(
            !exports || options.choose.method == Choice::Auto,
            "--export-candidates applies to --method auto, which decides between candidates"
        );
        options.load.obj = options.load.obj.with_root(self.root.clone());
        Ok(options)
    }
}

impl OptionArguments {
    /// What the library needs to know.
    fn options(&self) -> Result<BakeOptions> {
        let l = &self.layout;
        Ok(BakeOptions {
            show: false,
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
                decided: None,
                export: false,
                ranking_rays: None,
            },
            copies: self.copies.map_or(FindCopies::ByMethod, FindCopies::from),
            load: LoadOptions { strict: self.strict, keep: self.keep.clone(), obj: self.obj.options() },
            prune: self.prune,
            copy_instances: self.instancing == InstancingArgument::Extension,
            compression: self.compress.into(),
            record: self.record.into(),
            verify: self.verify.options(),
            plan: PlanUse::Neither,
            export: None,
            recorded: BTreeMap::new(),
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
                rule: self.overlap_rule.into(),
                ..OverlapOptions::default()
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
            views: self.views,
            least_view_ratio: self.least_view_ratio,
            seed: self.seed,
            max_position_error_ratio: self.max_position_error_ratio,
            ..default
        }
    }
}
