//! Tables 5.1 to 5.3 with the numbers of the thesis beside those that were measured.

use super::measured::{Crowded, Measured, standing_for};
use super::numbers::{
    BVH_BUILDS, CHOSEN, Edition, NODE_RATIOS, SAN_MIGUEL, SCENES, SKIP_STATISTICS, SKIP_THRESHOLDS, SkipStatistics,
};
use super::trials::Trial;
use crate::lab::bench::RunRow;
use crate::report::study::Table;

/// A number that is not known.
const NONE: &str = "\u{2013}";

/// Returns a number with four significant digits.
pub(super) fn number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let digits = (3 - x.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Returns a measured number beside that of the thesis, with the ratio.
fn beside(ours: Option<f64>, thesis: Option<f64>) -> String {
    match (ours, thesis) {
        (Some(ours), Some(thesis)) if thesis > 0.0 => {
            format!("{} / {} (x {})", number(ours), number(thesis), number(ours / thesis))
        }
        (Some(ours), thesis) => format!("{} / {}", number(ours), thesis.map_or(NONE.into(), number)),
        (None, thesis) => format!("{NONE} / {}", thesis.map_or(NONE.into(), number)),
    }
}

/// States what the scenes of a table are that are not those of the thesis.
pub(super) fn editions<'m>(scenes: impl IntoIterator<Item = &'m Measured>) -> Vec<String> {
    let of = |scene: &Measured| match scene.found.edition {
        Edition::Same => None,
        Edition::Other(how) => Some(format!("{} is not the thesis's: {how}.", scene.found.name)),
    };
    scenes.into_iter().filter_map(of).collect()
}

/// Table 5.1.
pub(super) fn scenes(measured: &[Measured]) -> Table {
    let head = ["scene", "objects", "triangles", "overlap ratio", "edition"];
    let of_thesis = SCENES.iter().enumerate().map(|(of, thesis)| {
        let ours = measured.iter().find(|scene| scene.found.of == Some(of));
        let row = ours.and_then(|scene| scene.row(Trial::PerObject));
        let edition = match ours.map(|scene| scene.found.edition) {
            None => "not at hand",
            Some(Edition::Same) => "as in the thesis",
            Some(Edition::Other(how)) => how,
        };
        vec![
            thesis.name.to_owned(),
            beside(row.map(|row| row.meshes as f64), Some(thesis.objects as f64)),
            beside(row.map(|row| row.triangles as f64), Some(thesis.triangles as f64)),
            beside(row.map(|row| row.overlap_ratio), Some(thesis.overlap_ratio)),
            edition.to_owned(),
        ]
    });
    let samples = measured.iter().filter(|scene| scene.found.of.is_none()).map(|scene| {
        let row = scene.row(Trial::PerObject);
        let edition = if let Edition::Other(how) = scene.found.edition { how } else { "" };
        let cells = [row.map(|r| r.meshes as f64), row.map(|r| r.triangles as f64), row.map(|r| r.overlap_ratio)];
        let cells = cells.map(|x| beside(x, None));
        [vec![scene.found.name.clone()], cells.to_vec(), vec![edition.to_owned()]].concat()
    });
    Table {
        caption: "Table 5.1: complexity of the scenes; here / in the thesis (ratio)".into(),
        head: head.map(String::from).to_vec(),
        rows: of_thesis.chain(samples).collect(),
        notes: vec![
            "Objects are groups of the file, each split by material; overlap is the surface of the intersections \
                     of all pairs of their boxes over that of the scene's box."
                .into(),
        ],
    }
}

/// Table 5.2.
pub(super) fn bvh_builds(measured: &[Measured]) -> Option<Table> {
    let scene = standing_for(SAN_MIGUEL, measured)?;
    let is_thesis = scene.found.of == Some(SAN_MIGUEL);
    let row = |name: &str, ours: &dyn Fn(&RunRow) -> Option<f64>, thesis: &dyn Fn(usize) -> f64| {
        let cell = |(i, ratio): (usize, &f64)| {
            beside(scene.row(Trial::Bvh(*ratio)).and_then(ours), is_thesis.then(|| thesis(i)))
        };
        [vec![name.to_owned()], NODE_RATIOS.iter().enumerate().map(cell).collect()].concat()
    };
    let rows = vec![
        row("optimisation [s]", &|row| Some(row.optimise_seconds), &|i| BVH_BUILDS[i].optimise_seconds),
        row("BLAS build [ms]", &|row| row.blas_build_ms, &|i| BVH_BUILDS[i].blas_build_ms),
        row("BLAS size [MB]", &|row| megabytes(row.blas_bytes), &|i| BVH_BUILDS[i].blas_mb),
        row("TLAS build [ms]", &|row| row.tlas_build_ms, &|i| BVH_BUILDS[i].tlas_build_ms),
        row("TLAS size [MB]", &|row| megabytes(row.tlas_bytes), &|i| BVH_BUILDS[i].tlas_mb),
        row("groups", &|row| Some(row.meshes as f64), &|_| 0.0),
    ];
    let names = NODE_RATIOS.map(|ratio| Trial::Bvh(ratio).name());
    Some(Table {
        caption: format!("Table 5.2: builds of bvh on {}, static; here / in the thesis (ratio)", scene.found.name),
        head: [vec![String::new()], names.to_vec()].concat(),
        rows,
        notes: [editions([scene]), no_build_times(&[scene])].concat(),
    })
}

/// Table 5.3.
pub(super) fn skip_thresholds(measured: &[Measured]) -> Table {
    let names = SKIP_THRESHOLDS.map(|threshold| threshold.to_string());
    Table {
        caption: "Table 5.3: builds of the overlap reduction by skip threshold; here / in the thesis".into(),
        head: [vec!["scene".into(), String::new()], names.to_vec()].concat(),
        rows: measured.iter().flat_map(skip_rows).collect(),
        notes: [
            vec![
                "The thesis heads the build times with seconds, but they are milliseconds, as in its table 5.2: with a \
                 skip threshold of 0.1, San Miguel would build in 1138.8 s against 1.3 s of the coarsest bvh."
                    .into(),
            ],
            editions(measured),
            no_build_times(&measured.iter().collect::<Vec<_>>()),
        ]
        .concat(),
    }
}

/// A cell of a row, from what was measured, and from the thesis at the number of a threshold.
type Cell<'c> = &'c dyn Fn(Option<&RunRow>, Option<(&SkipStatistics, usize)>) -> String;

fn skip_rows(scene: &Measured) -> Vec<Vec<String>> {
    let thesis = scene.found.of.map(|of| &SKIP_STATISTICS[of]);
    let row = |name: &str, cell: Cell| {
        let cells = SKIP_THRESHOLDS
            .iter()
            .enumerate()
            .map(|(i, &skip)| cell(scene.row(Trial::Overlap { skip, som: CHOSEN.2 }), thesis.map(|of| (of, i))));
        [vec![scene.found.name.clone(), name.to_owned()], cells.collect()].concat()
    };
    let numbers = |name: &str, ours: fn(&RunRow) -> Option<f64>, thesis: fn(&SkipStatistics) -> &[f64; 6]| {
        row(name, &|of, in_thesis| pair(of.and_then(ours), in_thesis.map(|(of, i)| thesis(of)[i])))
    };
    vec![
        numbers("optimisation [ms]", |row| Some(1e3 * row.optimise_seconds), |of| &of.optimise_ms),
        numbers("overlap ratio", |row| Some(row.overlap_ratio), |of| &of.overlap_ratio),
        row("splits/merges", &|of, in_thesis| {
            let ours = of.and_then(|row| Some(format!("{}/{}", row.splits?, row.merges?)));
            let thesis = in_thesis.map(|(of, i)| format!("{}/{}", of.splits[i], of.merges[i]));
            format!("{}, {}", ours.unwrap_or(NONE.into()), thesis.unwrap_or(NONE.into()))
        }),
        numbers("BLAS build [ms]", |row| row.blas_build_ms, |of| &of.blas_build_ms),
        numbers("BLAS size [MB]", |row| megabytes(row.blas_bytes), |of| &of.blas_mb),
        numbers("TLAS build [ms]", |row| row.tlas_build_ms, |of| &of.tlas_build_ms),
        numbers("TLAS size [MB]", |row| megabytes(row.tlas_bytes), |of| &of.tlas_mb),
    ]
}

fn pair(ours: Option<f64>, thesis: Option<f64>) -> String {
    let text = |x: Option<f64>| x.map_or(NONE.into(), number);
    format!("{} / {}", text(ours), text(thesis))
}

/// The speeds of all methods on all scenes without instances and with numbers of them, over one BLAS.
pub(super) fn methods(measured: &[Measured], instances: &[usize]) -> Table {
    let setups: Vec<Option<usize>> = [None].into_iter().chain(instances.iter().copied().map(Some)).collect();
    let speed = |scene: &Measured, setup: Option<usize>, trial: Trial| match setup {
        None => scene.speed(trial),
        Some(instances) => scene.crowd(instances, Some(trial)),
    };
    let cell = |scene: &Measured, setup, trial| match (speed(scene, setup, trial), speed(scene, setup, Trial::Single)) {
        (Some((speed, _)), Some((single, _))) => format!("{} (x {})", number(speed), number(speed / single)),
        (Some((speed, _)), None) => number(speed),
        (None, _) => NONE.into(),
    };
    let row = |(scene, setup): (&Measured, Option<usize>)| {
        let cells = Trial::COMPARED.iter().map(|trial| cell(scene, setup, *trial));
        let name = setup.map_or("static".into(), |instances| format!("{instances} instances"));
        [vec![scene.found.name.clone(), name], cells.collect()].concat()
    };
    let all = measured.iter().flat_map(|scene| setups.iter().map(move |setup| (scene, *setup)));
    let head = [vec!["scene".into(), "setup".into()], Trial::COMPARED.map(Trial::name).to_vec()].concat();
    Table {
        caption: "Experiment 4: million rays per second of all kinds (over the single BLAS's)".into(),
        head,
        rows: all.map(row).filter(|row| row[2..].iter().any(|cell| cell != NONE)).collect(),
        notes: editions(measured),
    }
}

/// The speeds with many instances, beside those of the instances alone.
pub(super) fn crowds(measured: &[Measured], instances: usize) -> Option<Table> {
    let row = |scene: &Measured| {
        let [with, alone] = [Some(Trial::Single), None].map(|trial| scene.crowd(instances, trial).map(|speed| speed.0));
        let ratio = with.zip(alone).map(|(with, alone)| with / alone);
        let cells = [with, alone, ratio].map(|x| x.map_or(NONE.into(), number));
        [vec![scene.found.name.clone()], cells.to_vec()].concat()
    };
    let head = ["scene", "scene and instances", "instances only", "ratio"].map(String::from).to_vec();
    let rows: Vec<Vec<String>> = measured.iter().filter(|scene| !scene.crowds.is_empty()).map(row).collect();
    let caption = format!("Experiment 3: million rays per second of all kinds with {instances} instances, single BLAS");
    (!rows.is_empty()).then(|| Table { caption, head, rows, notes: editions(measured) })
}

/// What the columns of [`motion`] hold.
const MOTION_NOTE: &str = "Update: to compute the matrices of all instances and hand them to the tracer. Speeds in motion are \
                           of fewer rays per frame than at the start, with the camera of the scene; the last column is their \
                           ratio to the speed through a TLAS built in each frame.";

/// What the frames took in which instances move.
pub(super) fn motion(measured: &[Measured], instances: &[usize]) -> Option<Table> {
    let shown = |of: &&Crowded| instances.contains(&of.instances) && of.row.motion.is_some();
    let row = |scene: &Measured, of: &Crowded| {
        let motion = of.row.motion.as_ref()?;
        let trial = of.trial.map_or_else(|| "instances only".to_owned(), Trial::name);
        let some = |x: Option<f64>| x.map_or(NONE.into(), number);
        let cells = [
            some(of.row.blas_build_ms),
            some(of.row.tlas_build_ms),
            number(motion.matrices_ms + motion.upload_ms),
            some(motion.refit_ms),
            some(motion.rebuild_ms),
            number(of.row.all_mrays_per_s),
            number(motion.mrays_per_s),
            some(motion.speed_over_fresh_ratio),
        ];
        Some([vec![scene.found.name.clone(), of.instances.to_string(), trial], cells.to_vec()].concat())
    };
    let of_scene = |scene: &'_ Measured| scene.crowds.iter().filter(shown).filter_map(|of| row(scene, of)).collect();
    let rows: Vec<Vec<String>> = measured.iter().flat_map(|scene| -> Vec<Vec<String>> { of_scene(scene) }).collect();
    let first = measured.iter().flat_map(|scene| &scene.crowds).find_map(|of| of.row.motion.as_ref())?;
    let (frames, interval) = (first.frames, first.rebuild_interval);
    let head = [
        "scene",
        "instances",
        "method",
        "BLAS build [ms]",
        "TLAS build [ms]",
        "update [ms]",
        "refit [ms]",
        "rebuild [ms]",
        "Mrays/s at the start",
        "Mrays/s in motion",
        "over a fresh TLAS",
    ];
    (!rows.is_empty()).then(|| Table {
        caption: format!("Instances that move, over {frames} frames; the TLAS is rebuilt every {interval} frames"),
        head: head.map(String::from).to_vec(),
        rows,
        notes: [vec![MOTION_NOTE.into()], editions(measured)].concat(),
    })
}

fn megabytes(bytes: Option<u64>) -> Option<f64> {
    bytes.map(|bytes| bytes as f64 * 1e-6)
}

/// States why build times are missing.
fn no_build_times(scenes: &[&Measured]) -> Vec<String> {
    let is_missing = |scene: &&Measured| scene.trials.iter().all(|(_, row)| row.blas_build_ms.is_none());
    match scenes.iter().all(is_missing) {
        true => vec!["Build times and sizes are known on a Vulkan device only.".into()],
        false => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits() {
        let texts = [0.0, 1.0, 17.447_2, 12_759_225.0, 0.000_512_34, 100.0].map(number);
        assert_eq!(texts, ["0", "1", "17.45", "12759225", "0.0005123", "100"]);
        assert_eq!(beside(Some(2.0), Some(4.0)), "2 / 4 (x 0.5)");
        assert_eq!(beside(None, Some(4.0)), "\u{2013} / 4");
    }
}
