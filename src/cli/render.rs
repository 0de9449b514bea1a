//! The command `render`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use raykiln_formats::staging::{Folder, Hold};

use super::args::{ObjArguments, Output};
use super::progress::Progress;
use super::{print, print_for_people};
use crate::commands::render::{Rendered, Stage, difference, render};
use crate::render::{CameraChoice, ColourMap, Masks, RenderOptions, View};
use crate::report::json::to_json;
use crate::report::render::RenderReport;
use crate::verify::DeviceChoice;

pub(super) const EXAMPLES: &str = "Examples:
  raykiln render conference.obj -o conference.png
  raykiln render baked.glb -o cost.png --view heatmap --scale 200 --size 1920x1080
  raykiln render scene.glb -o groups.png --view groups --camera 2,1.7,3,0,1,0,60
  raykiln render scene.glb -o level.png --view boxes --depth 6 --show boxes
  raykiln render before.glb after.glb -o changed.png --view difference

docs/render.md describes the views.";

#[derive(Debug, Args)]
pub(super) struct RenderArguments {
    /// Scene: OBJ, glTF or GLB
    input: PathBuf,
    /// difference: scene to compare with, seen by the same camera
    after: Option<PathBuf>,
    /// Picture to write (.png)
    #[arg(long, short)]
    output: PathBuf,
    /// What to show
    #[arg(long, value_enum, default_value_t = ViewArgument::Of(View::Shaded))]
    view: ViewArgument,
    /// Camera: number (from 0) or name of a camera of the file, `auto`, or an upright one by seven numbers: eye, target
    /// and field of view across the shorter side in degrees [default: the first of the file, else auto]
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    camera: Option<CameraChoice>,
    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size)]
    size: [u32; 2],
    /// Samples per pixel [default: 16 for shaded and difference, 1 for heatmap and overlap, 4 otherwise]
    #[arg(long, value_name = "N")]
    samples: Option<u32>,
    /// Seed of the samples
    #[arg(long, value_name = "N", default_value_t = RenderOptions::default().seed)]
    seed: u64,
    /// Device that traces rays: `auto` (a GPU if there is one, else the CPU), `cpu`, or a Vulkan device by index or part
    /// of its name (see `raykiln devices`)
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    device: String,
    /// heatmap, overlap: colours from small to large values [default: viridis]
    #[arg(long, value_enum, value_name = "MAP")]
    colours: Option<ColourMap>,
    /// heatmap, overlap: value with the last colour [default: a round number that few pixels exceed]
    #[arg(long, value_name = "MAX", allow_hyphen_values = true)]
    scale: Option<f64>,
    /// boxes: depth of the nodes whose boxes are drawn, from the root of the TLAS through its leaves into the BLASes
    /// [default: the boxes of the instances]
    #[arg(long, value_name = "N")]
    depth: Option<u32>,
    /// boxes: what is visible [default: all]
    #[arg(long, value_enum, value_name = "MASKS", value_delimiter = ',')]
    show: Vec<MaskArgument>,
    /// Print what was measured as JSON on standard output
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    obj: ObjArguments,
}

/// A view of one scene, or the one that compares two.
#[derive(Clone, Copy, Debug)]
enum ViewArgument {
    Of(View),
    Difference,
}

impl ViewArgument {
    const ALL: [ViewArgument; View::ALL.len() + 1] = {
        let mut all = [ViewArgument::Difference; View::ALL.len() + 1];
        let mut i = 0;
        while i < View::ALL.len() {
            all[i] = ViewArgument::Of(View::ALL[i]);
            i += 1;
        }
        all
    };

    /// The view of one scene; `None` for the one that compares two.
    fn of_one(self) -> Option<View> {
        match self {
            ViewArgument::Of(view) => Some(view),
            ViewArgument::Difference => None,
        }
    }
}

impl ValueEnum for ViewArgument {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (name, help) = match self {
            ViewArgument::Of(view) => (view.name(), view.description()),
            ViewArgument::Difference => (RenderReport::DIFFERENCE, "Pixels in which two scenes differ, and by what"),
        };
        Some(PossibleValue::new(name).help(help))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MaskArgument {
    /// Surfaces of meshes that are placed once
    Scene,
    /// Boxes
    Boxes,
    /// Surfaces of meshes that are placed more than once
    Instances,
}

impl ValueEnum for ColourMap {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            ColourMap::Jet => "Blue, cyan, yellow, red",
            ColourMap::Cividis => "Dark blue to yellow, alike for all eyes",
            ColourMap::Viridis => "Dark violet to yellow",
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides.ok_or_else(|| "must be two whole numbers with an x between them, such as 1280x720".into())
}

impl RenderArguments {
    fn options(&self) -> RenderOptions {
        let shows = |mask: MaskArgument| self.show.is_empty() || self.show.contains(&mask);
        RenderOptions {
            size: self.size,
            samples: self.samples,
            seed: self.seed,
            colours: self.colours.unwrap_or_default(),
            scale: self.scale,
            depth: self.depth,
            masks: Masks {
                scene: shows(MaskArgument::Scene),
                boxes: shows(MaskArgument::Boxes),
                instances: shows(MaskArgument::Instances),
            },
            load: self.obj.load(),
            ..RenderOptions::default()
        }
    }

    /// Refuses options that do not apply to the view.
    fn check(&self) -> Result<()> {
        let view = self.view.of_one();
        let is_scaled = matches!(view, Some(View::Heatmap | View::Overlap));
        let has_boxes = view == Some(View::Boxes);
        let given = [
            ("--colours", self.colours.is_some(), is_scaled, "heatmap, overlap"),
            ("--scale", self.scale.is_some(), is_scaled, "heatmap, overlap"),
            ("--depth", self.depth.is_some(), has_boxes, "boxes"),
            ("--show", !self.show.is_empty(), has_boxes, "boxes"),
            ("a second scene", self.after.is_some(), view.is_none(), "difference"),
        ];
        for (option, is_given, applies, views) in given {
            ensure!(!is_given || applies, "{option} applies to --view {views} only");
        }
        ensure!(view.is_some() || self.after.is_some(), "--view difference takes two scenes: BEFORE AFTER");
        Ok(())
    }
}

/// Draws a picture and writes it.
pub(super) fn run(arguments: &RenderArguments, output: &Output) -> Result<ExitCode> {
    arguments.check()?;
    let inputs: Vec<&Path> = [&arguments.input].into_iter().chain(&arguments.after).map(PathBuf::as_path).collect();
    let file = PictureFile::check(&arguments.output, &inputs)?;
    let (camera, options) = (arguments.camera.clone().unwrap_or_default(), arguments.options());
    let device = DeviceChoice::from(arguments.device.as_str());
    let mut progress = Progress::new(output.quiet);
    let enter = &mut |stage: Stage| progress.enter(stage.label());
    let rendered = match (arguments.view.of_one(), &inputs[..]) {
        (None, &[before, after]) => difference(before.into(), after.into(), &camera, &options, &device, enter),
        (view, _) => render(inputs[0].into(), view.unwrap_or_default(), &camera, &options, &device, enter),
    };
    progress.finish();
    let Rendered { png, report } = rendered?;
    let staged = file.stage(&png)?;
    // Printed before the picture is in place: if it fails, there must be no output.
    if arguments.json {
        print(to_json(&report).as_bytes())?;
    }
    staged.commit()?;
    if !output.quiet {
        print_for_people(&report.text());
    }
    Ok(ExitCode::SUCCESS)
}

/// The file that a picture is written to.
struct PictureFile<'a> {
    given: &'a Path,
    /// The file itself if the path is a symbolic link.
    to: PathBuf,
}

impl<'a> PictureFile<'a> {
    /// Rejects a file that cannot be written, before any work is done.
    fn check(given: &'a Path, inputs: &[&Path]) -> Result<Self> {
        let to = fs::canonicalize(given).unwrap_or_else(|_| given.to_owned());
        let file = PictureFile { given, to };
        let shown = given.display();
        let is_png = given.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
        ensure!(is_png, "{shown}: only files with the extension .png can be written");
        ensure!(file.folder().is_dir(), "{shown}: there is no folder {}", file.folder().display());
        ensure!(file.to.is_file() || !file.to.exists(), "{shown}: is not a regular file");
        let is_input = inputs.iter().any(|input| fs::canonicalize(input).is_ok_and(|input| input == file.to));
        ensure!(!is_input, "{shown}: is the scene itself");
        Folder::new_in(file.folder()).with_context(|| format!("{shown}: its folder cannot be written to"))?;
        Ok(file)
    }

    fn folder(&self) -> &Path {
        self.to.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
    }

    /// Writes the picture, but does not put it in place yet.
    fn stage(self, png: &[u8]) -> Result<StagedPicture> {
        let folder = Folder::new_in(self.folder());
        let staged = folder.and_then(|folder| fs::write(folder.path().join("picture.png"), png).map(|()| folder));
        let folder = staged.with_context(|| format!("{}: cannot be written", self.given.display()))?;
        Ok(StagedPicture { folder, to: self.to })
    }
}

/// A picture that is written but not in place. Dropping it without [`StagedPicture::commit`] removes it.
struct StagedPicture {
    folder: Folder,
    to: PathBuf,
}

impl StagedPicture {
    fn commit(self) -> Result<()> {
        let _hold = Hold::new();
        fs::rename(self.folder.path().join("picture.png"), &self.to)
            .with_context(|| format!("{}: cannot be put in place", self.to.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_numbers() {
        assert_eq!(size("640x360"), Ok([640, 360]));
        for bad in ["640", "640x", "x", "-1x4", "1x2x3", "1.5x2", "99999999999x1"] {
            assert!(size(bad).is_err(), "{bad}");
        }
    }
}
