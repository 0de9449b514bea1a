use super::*;
use crate::motion::{Crowd, Deviating};
use crate::verify::DeviceChoice;
use crate::verify::test_scenes::{cube, room, scene};

/// A room with cubes that fly about.
pub(super) fn flying(copies: usize) -> MovingScene {
    let speed = Deviating { base: 6.0, deviation: 2.0 };
    let distance = Deviating { base: 4.0, deviation: 2.0 };
    let turns = Deviating { base: 0.5, deviation: 0.2 };
    let crowd = Crowd { copies, animated: copies, speed, distance, turns, seed: 3 };
    let model = scene(vec![cube(0, Some(1))], &[(0, glam::DAffine3::IDENTITY)]);
    MovingScene::new(&room(), &model, 0.8, crowd.place(&room().bounds()))
}

fn options() -> FrameOptions {
    FrameOptions {
        frames: 12,
        frames_per_second: 10.0,
        rays: 600,
        counted_rays: 300,
        counted_every: 4,
        ..FrameOptions::default()
    }
}

fn on_cpu(moving: &mut MovingScene, options: &FrameOptions) -> (Vec<Frame>, Vec<LastHits>) {
    let machine = Machine::open(&DeviceChoice::Cpu).expect("the CPU");
    let mut frames = Vec::new();
    let last = run(moving, &machine, options, &mut |frame| -> Result<(), ()> {
        frames.push(frame.clone());
        Ok(())
    });
    (frames, last.expect("the CPU does not fail"))
}

#[test]
fn each_policy_traces_each_frame_and_hits_what_is_there() {
    let options = options();
    let (frames, last) = on_cpu(&mut flying(150), &options);
    assert_eq!(frames.len(), 12 * 5);
    for (i, frame) in frames.iter().enumerate() {
        assert_eq!((frame.number as usize, frame.policy), (i / 5, options.policies[i % 5]));
        assert_eq!(frame.times.upkeep, frame.policy.upkeep(frame.number), "frame {i}");
        assert_eq!(frame.work.is_some(), [0, 4, 8, 11].contains(&frame.number));
        assert!(frame.times.trace_ms.is_some() && frame.fresh_trace_ms.is_some() && frame.rays == PerKind::of(|_| 600));
        assert!(frame.bytes.tlas > 0 && frame.bytes.blas > 0 && frame.bytes.device.is_none());
    }
    assert_eq!(last.len(), 5);
    for of_policy in last {
        assert_eq!((of_policy.hits.rays, of_policy.hits.wrong), (2400, 0), "{of_policy:?}");
        assert!(of_policy.hits.same > 2380 && of_policy.hits.hits > 1900, "{of_policy:?}");
    }
}

#[test]
fn rays_take_more_steps_the_longer_a_tree_was_refitted() {
    let (frames, _) = on_cpu(&mut flying(300), &options());
    let ratio = |number, policy| {
        let frame = frames.iter().find(|f: &&Frame| f.number == number && f.policy == policy).expect("a frame");
        frame.work.expect("counted").work_ratio()
    };
    assert_eq!(ratio(8, RebuildEvery::Frames(1)), 1.0);
    assert_eq!(ratio(8, RebuildEvery::Frames(8)), 1.0);
    let [young, old] = [ratio(11, RebuildEvery::Frames(8)), ratio(11, RebuildEvery::Never)];
    assert!(1.0 < young && young < old, "{young} {old}");
}

#[test]
fn counts_do_not_depend_on_which_frames_are_counted_or_which_policies_are_compared() {
    let few = FrameOptions { counted_every: 64, policies: vec![RebuildEvery::Frames(8)], ..options() };
    let work = |options: &FrameOptions| {
        let (frames, _) = on_cpu(&mut flying(100), options);
        let last = frames.iter().rev().find(|frame| frame.policy == RebuildEvery::Frames(8)).expect("a frame");
        (last.number, last.work)
    };
    assert_eq!(work(&few), work(&options()));
}

#[test]
fn whoever_receives_the_frames_can_end_them() {
    let machine = Machine::open(&DeviceChoice::Cpu).expect("the CPU");
    let ended = run(&mut flying(5), &machine, &options(), &mut |frame: &Frame| {
        if frame.number < 2 { Ok(()) } else { Err("full") }
    });
    assert_eq!(ended, Err(FramesError::Receiver("full")));
}

#[test]
fn a_scene_of_nothing_has_frames_without_rays() {
    let nothing = Scene::default();
    let mut moving = MovingScene::new(&nothing, &nothing, 1.0, Default::default());
    let (frames, last) = on_cpu(&mut moving, &FrameOptions { frames: 2, ..options() });
    assert_eq!((frames.len(), last[0].hits), (10, CheckedHits::default()));
}
