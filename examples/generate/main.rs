//! Writes seeded test and benchmark scenes as glTF: `cargo run --release --example generate -- WHAT OUT [OPTIONS]`.
//!
//! Equal arguments yield equal bytes. Vertices are streamed to disk, so memory grows with the number of meshes, not of
//! triangles. The raykiln library is not used, so that neither can hide a fault of the other.

mod buildings;
mod random;
mod samples;
mod scenes;
mod shapes;
mod turned;
mod writer;

use std::path::Path;
use std::process::ExitCode;

const USAGE: &str = "\
Usage: generate WHAT OUT [--seed N] [--count N] [--size-ratio R]
       generate turned IN.obj OUT.obj [--degrees X,Y,Z]

WHAT is one of
  nodes      10,000 nodes, each with a mesh of its own of 1,280 triangles (277 MiB)
  pipes      4,000 tubes in any direction, 96 triangles each
  instances  1,000 instances of one mesh of 11,000 triangles
  cubes      1,000 cubes, each a node with a mesh of its own
  hair       30,000 bent strands of 12 triangles, in 8 locks
  lattice    1,000 instances of one mesh of 11,000 triangles whose boxes do not overlap, however they are turned
  mixed      a room along the axes with 90 pieces of turned furniture, cables and railings: 200,000 triangles
  enclosed   a town of 2,000 houses and trees in a sky dome, and a cube a hundred times as far away as the town is wide
  samples    the glTF scenes of samples/, OUT being that folder

OUT is a .glb or .gltf file.
  --seed N          another scene of the same kind (default 1)
  --count N         another number of nodes (of strands for hair, pieces of furniture for mixed)
  --size-ratio R    size of an object over that of the scene (nodes, pipes, instances, cubes)

turned writes an OBJ file again with its `v` and `vn` lines turned about x, then y, then z; all else is copied byte for
byte. A relative mtllib is still found where OUT lies beside IN.
  --degrees X,Y,Z   the angles (default 30,20,45)
";

/// The arguments of the command line.
pub(crate) struct Request {
    /// Seed of the random numbers.
    pub(crate) seed: u64,
    /// Number of nodes; `None`: the default.
    pub(crate) count: Option<usize>,
    /// Size of an object over that of the scene; `None`: the default.
    pub(crate) size_ratio: Option<f64>,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("generate: {problem}\n\n{USAGE}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &[String]) -> Result<(), String> {
    if let [what, files @ ..] = arguments
        && what == "turned"
    {
        return turned::run(files);
    }
    let [what, out, options @ ..] = arguments else { return Err("WHAT and OUT are missing".into()) };
    let request = parse(options)?;
    let out = Path::new(out);
    let written = match what.as_str() {
        "nodes" => scenes::nodes(out, &request),
        "pipes" => scenes::pipes(out, &request),
        "instances" => scenes::instances(out, &request),
        "cubes" => scenes::cubes(out, &request),
        "hair" => scenes::hair(out, &request),
        "lattice" => scenes::lattice(out, &request),
        "mixed" => buildings::mixed(out, &request),
        "enclosed" => buildings::enclosed(out, &request),
        "samples" => samples::all(out),
        other => return Err(format!("no scene is called {other:?}")),
    };
    written.map_err(|e| format!("{}: {e}", out.display()))
}

fn parse(options: &[String]) -> Result<Request, String> {
    let mut request = Request { seed: 1, count: None, size_ratio: None };
    for option in options.chunks(2) {
        let [name, value] = option else { return Err(format!("{:?} needs a value", option[0])) };
        let wrong = |e: &dyn std::fmt::Display| format!("{name} {value}: {e}");
        match name.as_str() {
            "--seed" => request.seed = value.parse().map_err(|e| wrong(&e))?,
            "--count" => request.count = Some(value.parse().map_err(|e| wrong(&e))?),
            "--size-ratio" => request.size_ratio = Some(value.parse().map_err(|e| wrong(&e))?),
            _ => return Err(format!("no option is called {name:?}")),
        }
    }
    Ok(request)
}
