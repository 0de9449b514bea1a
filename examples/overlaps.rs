//! Lists the most overlapping objects of scenes, without baking them: `overlaps FILE...`.

use raykiln::{ErrorKind, LoadOptions};

fn main() {
    for file in std::env::args().skip(1) {
        match raykiln::inspect(&file, &LoadOptions::default()) {
            Ok(report) => {
                println!("{file}: overlap ratio {:.3}", report.before.overlap_ratio);
                for pair in &report.worst_pairs {
                    println!("  {:.4}  {} and {}", pair.overlap_ratio, pair.a, pair.b);
                }
            }
            Err(error) if error.kind == ErrorKind::Unsupported => println!("{file}: left out: {error}"),
            Err(error) => println!("{file}: {error}"),
        }
    }
}
