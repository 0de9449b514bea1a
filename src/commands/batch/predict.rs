//! Predicts what a bake takes, to start long ones first and to keep within the memory.

use raykiln_formats::Outline;

/// What a bake is predicted to take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Seconds on one thread. Best used to compare assets: machines and options differ.
    pub seconds: f64,
    /// Peak memory in bytes. Images and unusual scenes may take more.
    pub memory_bytes: u64,
}

/// What the smallest bake takes.
const LEAST: Prediction = Prediction { seconds: 0.1, memory_bytes: 48 << 20 };
/// Seconds per triangle that is placed, as measured for `auto` at effort 2 on the CPU.
const SECONDS_PER_TRIANGLE: f64 = 2e-5;
/// Bytes of memory per triangle that is placed, as measured likewise, and rounded up.
const MEMORY_PER_TRIANGLE: u64 = 700;
/// How many times the bytes of the files are in memory: as they are read, and as they are written and read back.
const COPIES_OF_FILES: u64 = 3;

impl Prediction {
    /// Predicts by the size of a scene.
    pub fn of(outline: &Outline) -> Prediction {
        let triangles = outline.triangles_placed.max(outline.triangles_stored);
        let of_files = outline.bytes.saturating_mul(COPIES_OF_FILES);
        let of_triangles = triangles.saturating_mul(MEMORY_PER_TRIANGLE);
        Prediction {
            seconds: LEAST.seconds + triangles as f64 * SECONDS_PER_TRIANGLE,
            memory_bytes: LEAST.memory_bytes.saturating_add(of_files).saturating_add(of_triangles),
        }
    }

    /// What an earlier bake of the asset took, as far as it is known.
    pub(super) fn or_measured(self, seconds: Option<f64>, memory_bytes: Option<u64>) -> Prediction {
        Prediction {
            seconds: seconds.unwrap_or(self.seconds),
            // Bakes with fewer or more threads differ a little.
            memory_bytes: memory_bytes.map_or(self.memory_bytes, |bytes| bytes + bytes / 8),
        }
    }
}
