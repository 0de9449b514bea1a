//! What the thesis found: the numbers of its tables, and the claims of its text about its figures.
//!
//! T. Bilák, "Scene optimization for RTX", master's thesis, Czech Technical University in Prague, 2024, chapter 5.

/// A scene of table 5.1.
#[derive(Debug, PartialEq)]
pub(super) struct ThesisScene {
    pub(super) name: &'static str,
    pub(super) objects: u64,
    pub(super) triangles: u64,
    pub(super) overlap_ratio: f64,
    /// Where it may be below the folder of scenes, with how that differs from the thesis's; the best first.
    pub(super) files: &'static [(&'static str, Edition)],
}

/// How a scene at hand differs from that of the thesis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edition {
    /// By no more than the table's rounding or a triangle.
    Same,
    /// In more, as described.
    Other(&'static str),
}

/// Table 5.1, in its order.
pub(super) const SCENES: [ThesisScene; 6] = [
    ThesisScene {
        name: "Fireplace",
        objects: 24,
        triangles: 580_486,
        overlap_ratio: 7.272,
        files: &[
            ("fireplace_room/fireplace_room.obj", Edition::Same),
            (
                "fireplace_room/living-room.obj",
                Edition::Other("another edition of the room: each shape is an object, with a quarter of the triangles"),
            ),
        ],
    },
    ThesisScene {
        name: "Conference",
        objects: 41,
        triangles: 331_179,
        overlap_ratio: 17.447,
        files: &[("conference/conference.obj", Edition::Same)],
    },
    ThesisScene {
        name: "Sibenik",
        objects: 15,
        triangles: 75_283,
        overlap_ratio: 10.124,
        files: &[("sibenik/sibenik.obj", Edition::Same)],
    },
    ThesisScene {
        name: "Sponza",
        objects: 393,
        triangles: 289_405,
        overlap_ratio: 12.878,
        files: &[(
            "sponza_crytek/sponza.obj",
            Edition::Other("Crytek's model from another source: about as many objects, 4 % fewer triangles"),
        )],
    },
    ThesisScene {
        name: "Powerplant",
        objects: 56,
        triangles: 12_759_225,
        overlap_ratio: 8.944,
        files: &[("powerplant/powerplant.obj", Edition::Same)],
    },
    ThesisScene {
        name: "San Miguel",
        objects: 2203,
        triangles: 9_978_412,
        overlap_ratio: 222.422,
        files: &[
            ("san_miguel/san-miguel.obj", Edition::Same),
            (
                "san_miguel_furniture/san_miguel_furniture.glb",
                Edition::Other("only the furniture of the instanced edition, which the thesis has flattened"),
            ),
        ],
    },
];

/// Ratios of nodes to triangles of experiment 1.
pub(super) const NODE_RATIOS: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];

/// Skip thresholds of experiment 2.
pub(super) const SKIP_THRESHOLDS: [f64; 6] = [0.1, 0.05, 0.01, 0.005, 0.001, 0.0005];

/// Split-or-merge thresholds of experiment 2.
pub(super) const SOM_THRESHOLDS: [f64; 7] = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8];

/// What the thesis chose of these for its last experiment.
pub(super) const CHOSEN: (f64, f64, f64) = (1e-3, 0.005, 0.5);

/// A build of table 5.2, of the static San Miguel.
pub(super) struct BvhBuild {
    pub(super) optimise_seconds: f64,
    pub(super) blas_build_ms: f64,
    pub(super) blas_mb: f64,
    pub(super) tlas_build_ms: f64,
    pub(super) tlas_mb: f64,
}

const fn bvh(optimise_seconds: f64, blas_build_ms: f64, blas_mb: f64, tlas_build_ms: f64, tlas_mb: f64) -> BvhBuild {
    BvhBuild { optimise_seconds, blas_build_ms, blas_mb, tlas_build_ms, tlas_mb }
}

/// Table 5.2, in the order of [`NODE_RATIOS`].
pub(super) const BVH_BUILDS: [BvhBuild; 4] = [
    bvh(10.657, 12_558.8, 817.753, 32.126, 16.875),
    bvh(10.575, 11_387.4, 803.459, 31.139, 14.966),
    bvh(6.536, 2_164.86, 713.371, 19.941, 1.789),
    bvh(2.963, 1_305.87, 706.997, 18.056, 0.910),
];

/// A scene's part of table 5.3; each row in the order of [`SKIP_THRESHOLDS`].
pub(super) struct SkipStatistics {
    pub(super) optimise_ms: [f64; 6],
    pub(super) overlap_ratio: [f64; 6],
    pub(super) splits: [u64; 6],
    pub(super) merges: [u64; 6],
    /// Headed "t[s]" in the table, but in milliseconds as in table 5.2: San Miguel has 1305.87 ms there and 1138.8 here.
    pub(super) blas_build_ms: [f64; 6],
    pub(super) blas_mb: [f64; 6],
    pub(super) tlas_build_ms: [f64; 6],
    pub(super) tlas_mb: [f64; 6],
}

/// Table 5.3, in the order of [`SCENES`].
// One size is near a known constant by chance.
#[allow(clippy::approx_constant)]
pub(super) const SKIP_STATISTICS: [SkipStatistics; 6] = [
    SkipStatistics {
        optimise_ms: [89.2, 103.197, 476.653, 1204.66, 1786.17, 1817.28],
        overlap_ratio: [6.69451, 5.355, 2.545, 1.897, 1.835, 1.854],
        splits: [67, 107, 348, 1015, 2603, 3307],
        merges: [0, 4, 90, 571, 1897, 2481],
        blas_build_ms: [31.525, 40.129, 76.278, 119.247, 167.443, 192.591],
        blas_mb: [10.214, 10.27, 10.613, 10.973, 11.517, 11.764],
        tlas_build_ms: [20.797, 20.816, 20.872, 20.784, 20.863, 20.942],
        tlas_mb: [0.029, 0.039, 0.085, 0.139, 0.216, 0.251],
    },
    SkipStatistics {
        optimise_ms: [50.667, 56.715, 109.647, 140.115, 218.107, 286.401],
        overlap_ratio: [10.509, 10.09, 9.211, 9.358, 8.753, 8.753],
        splits: [48, 64, 198, 403, 1339, 1914],
        merges: [0; 6],
        blas_build_ms: [33.101, 37.991, 74.465, 127.789, 292.474, 402.736],
        blas_mb: [23.411, 23.465, 23.606, 24.093, 26.03, 27.28],
        tlas_build_ms: [20.714, 20.7965, 20.754, 21.385, 17.922, 21.225],
        tlas_mb: [0.027, 0.033, 0.072, 0.132, 0.407, 0.575],
    },
    SkipStatistics {
        optimise_ms: [93.74, 116.368, 172.822, 210.518, 687.249, 5078.14],
        overlap_ratio: [21.756, 18.104, 8.545, 7.097, 5.115, 5.112],
        splits: [102, 208, 866, 1362, 3860, 7585],
        merges: [0, 0, 0, 0, 172, 1503],
        blas_build_ms: [40.669, 66.707, 197.883, 291.531, 662.414, 1055.8],
        blas_mb: [5.445, 5.537, 6.897, 8.058, 13.369, 18.888],
        tlas_build_ms: [20.931, 21.133, 20.339, 21.029, 21.425, 18.873],
        tlas_mb: [0.036, 0.067, 0.26, 0.406, 1.088, 1.791],
    },
    SkipStatistics {
        optimise_ms: [14.611, 26.529, 48.004, 59.833, 287.464, 558.708],
        overlap_ratio: [54.644, 52.284, 54.492, 55.429, 58.169, 59.395],
        splits: [58, 108, 407, 683, 2921, 3930],
        merges: [0; 6],
        blas_build_ms: [130.316, 140.413, 202.548, 264.644, 659.853, 856.791],
        blas_mb: [19.21, 19.303, 19.857, 20.523, 25.247, 27.068],
        tlas_build_ms: [21.223, 19.86, 20.828, 20.921, 19.46, 20.01],
        tlas_mb: [0.134, 0.148, 0.237, 0.318, 0.974, 1.27],
    },
    SkipStatistics {
        optimise_ms: [460.489, 1614.45, 4811.33, 8272.43, 29_961.0, 33_136.8],
        overlap_ratio: [8.509, 11.017, 20.902, 19.477, 10.756, 9.513],
        splits: [10, 32, 233, 791, 5524, 8780],
        merges: [0; 6],
        blas_build_ms: [203.532, 228.349, 333.791, 480.082, 1688.01, 2773.05],
        blas_mb: [892.695, 892.784, 893.55, 895.272, 901.87, 906.412],
        tlas_build_ms: [17.373, 20.693, 17.85, 17.87, 19.086, 20.31],
        tlas_mb: [0.021, 0.027, 0.086, 0.25, 1.639, 2.595],
    },
    SkipStatistics {
        optimise_ms: [716.276, 1288.56, 3313.51, 3713.25, 6325.15, 76_054.9],
        overlap_ratio: [237.112, 110.966, 28.497, 25.332, 23.672, 18.42],
        splits: [90, 224, 948, 1608, 6800, 27_592],
        merges: [0, 0, 0, 0, 124, 5907],
        blas_build_ms: [1138.8, 1072.8, 1326.7, 1481.1, 2611.13, 6857.55],
        blas_mb: [705.15, 705.606, 707.654, 708.129, 717.435, 751.162],
        tlas_build_ms: [18.245, 18.392, 18.827, 19.394, 20.602, 24.733],
        tlas_mb: [0.675, 0.714, 0.926, 1.12, 2.607, 7.012],
    },
];

/// Index of Sibenik in [`SCENES`].
pub(super) const SIBENIK: usize = 2;

/// Index of San Miguel in [`SCENES`].
pub(super) const SAN_MIGUEL: usize = 5;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_thesis_at_a_few_places() {
        assert_eq!(SCENES[SAN_MIGUEL].name, "San Miguel");
        assert_eq!(SCENES.map(|scene| scene.triangles).iter().sum::<u64>(), 24_013_990);
        assert_eq!((SKIP_STATISTICS[2].splits[5], SKIP_STATISTICS[2].merges[5]), (7585, 1503));
        assert_eq!(BVH_BUILDS[2].tlas_mb, 1.789);
        let rises = |row: [u64; 6]| row.windows(2).all(|pair| pair[0] <= pair[1]);
        assert!(SKIP_STATISTICS.iter().all(|of| rises(of.splits) && rises(of.merges)));
    }
}
