//! Frames of a scene whose instances move, with the TLAS rebuilt as often as an environment says and refitted in between.

use std::convert::Infallible;

use serde::{Deserialize, Serialize};

use crate::lab::motion::{MotionRow, Setup, Summary};
use crate::motion::MovingScene;
use crate::motion::frames::{self, FrameOptions, FramesError, RebuildEvery};
use crate::verify::Machine;
use crate::verify::rays::RayKind;

use super::row::KINDS;

/// What the frames of a scene that moves took.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionRun {
    /// Frames from one rebuild of the TLAS to the next; 0: it is built in the first frame only.
    pub rebuild_interval: u32,
    /// Number of frames.
    pub frames: u32,
    /// Frames in which the TLAS was built anew; it was refitted in the others.
    pub rebuilds: u32,
    /// Median milliseconds to compute the matrices of all instances on the CPU.
    pub matrices_ms: f64,
    /// Mean milliseconds to hand them to the tracer.
    pub upload_ms: f64,
    /// Median milliseconds of a refit; `None` if there was none.
    pub refit_ms: Option<f64>,
    /// Median milliseconds of a rebuild.
    pub rebuild_ms: Option<f64>,
    /// Million rays per second of all kinds that a picture takes, in all frames.
    pub mrays_per_s: f64,
    /// Speed over that through a TLAS built in each frame: geometric mean over frames and kinds of rays.
    pub speed_over_fresh_ratio: Option<f64>,
    /// Rays of the last frame that hit something else than they should.
    pub wrong_hits: u64,
    /// `mrays_per_s` of each frame.
    pub series: Vec<f64>,
}

impl MotionRun {
    /// Traces the frames by the only policy of the options.
    ///
    /// # Errors
    /// Fails if the device does.
    pub(super) fn of(moving: &mut MovingScene, machine: &Machine, options: &FrameOptions) -> Result<MotionRun, String> {
        let (mut summary, mut timed) = (Summary::new(&options.policies), Vec::new());
        let setup = Setup::default();
        let last = frames::run(moving, machine, options, &mut |frame| -> Result<(), Infallible> {
            let row = MotionRow::of(&setup, frame);
            timed.push(rays_and_seconds(&row));
            summary.add(&row);
            Ok(())
        });
        let last = last.map_err(|e| match e {
            FramesError::Tracer(why) => why,
            FramesError::Receiver(never) => match never {},
        })?;
        let of = summary.finish(&last).pop().ok_or("there are no frames")?;
        let [rays, seconds] = [0, 1].map(|i| timed.iter().map(|pair| pair[i]).sum::<f64>());
        Ok(MotionRun {
            rebuild_interval: if let RebuildEvery::Frames(every) = of.rebuild_every { every } else { 0 },
            frames: of.frames,
            rebuilds: of.rebuilds,
            matrices_ms: of.matrices_ms,
            upload_ms: of.upload_ms,
            refit_ms: of.refit_ms,
            rebuild_ms: of.rebuild_ms,
            mrays_per_s: speed([rays, seconds]),
            speed_over_fresh_ratio: of.speed_over_fresh_ratio,
            wrong_hits: of.hits.wrong,
            series: timed.into_iter().map(speed).collect(),
        })
    }

    /// Its fields as columns: names and values; all empty if nothing moves.
    pub(super) fn columns(of: Option<&MotionRun>) -> [(&'static str, String); 10] {
        let text = |value: fn(&MotionRun) -> String| of.map_or(String::new(), value);
        let some = |value: fn(&MotionRun) -> Option<f64>| of.and_then(value).map_or(String::new(), |x| x.to_string());
        [
            ("rebuild_interval", text(|m| m.rebuild_interval.to_string())),
            ("frames", text(|m| m.frames.to_string())),
            ("rebuilds", text(|m| m.rebuilds.to_string())),
            ("matrices_ms", text(|m| m.matrices_ms.to_string())),
            ("upload_ms", text(|m| m.upload_ms.to_string())),
            ("refit_ms", some(|m| m.refit_ms)),
            ("rebuild_ms", some(|m| m.rebuild_ms)),
            ("moving_mrays_per_s", text(|m| m.mrays_per_s.to_string())),
            ("moving_speed_over_fresh_ratio", some(|m| m.speed_over_fresh_ratio)),
            ("wrong_hits", text(|m| m.wrong_hits.to_string())),
        ]
    }
}

/// Returns the rays of a frame, of the kinds that a picture takes, and the seconds that they took.
fn rays_and_seconds(row: &MotionRow) -> [f64; 2] {
    let of = |kind: RayKind| {
        let seconds = 1e-3 * row.kinds[kind].trace_ms;
        [1e6 * row.kinds[kind].mrays_per_s * seconds, seconds]
    };
    let kinds = KINDS.map(of);
    [0, 1].map(|i| kinds.iter().map(|pair| pair[i]).sum())
}

fn speed([rays, seconds]: [f64; 2]) -> f64 {
    if seconds > 0.0 { 1e-6 * rays / seconds } else { 0.0 }
}
