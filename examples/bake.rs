//! Bakes a scene with the library: `bake IN OUT.glb`, first from its path and then from its bytes.

use std::error::Error;
use std::fs;

use raykiln::{BakeOptions, DeviceChoice, Method, Verdict};

fn main() -> Result<(), Box<dyn Error>> {
    let mut paths = std::env::args().skip(1);
    let (Some(input), Some(output)) = (paths.next(), paths.next()) else { return Err("usage: bake IN OUT.glb".into()) };

    let mut options = BakeOptions::default();
    options.verify.device = DeviceChoice::Cpu;
    let report = raykiln::bake(&input, &output, &options)?;
    println!("{output}: method {}, {:?}", report.method.chosen, report.verdict);

    // The same in memory, with an explicit method. Bytes cannot refer to other files.
    options.choose.method = Method::Overlap.into();
    let baked = raykiln::bake_bytes(&input, fs::read(&input)?, &options)?;
    match baked.glb {
        Some(glb) => println!("in memory: {} bytes, method {}", glb.len(), baked.report.method.chosen),
        None => assert_eq!(baked.report.verdict, Verdict::Failed),
    }
    Ok(())
}
