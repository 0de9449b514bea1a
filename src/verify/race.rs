//! Times several layouts of one scene with the same rays.

use super::build::Built;
use super::cpu::{CpuTracer, TwoLevel};
use super::rays::{self, Ray, RayKind, Rays, RaysOfView};
use super::speed::{self, KindSpeed};
use super::tracing::seen_by;
use super::view_speeds::ViewSpeeds;
use super::views::Role;
#[cfg(feature = "vulkan")]
use super::vulkan::{Error, Pipelines, VulkanTracer};
use super::{Machine, PerKind, Sides, Tracer, VerifyOptions};
use crate::scene::Scene;

/// The result of one contender.
#[derive(Clone, Debug)]
pub struct RaceResult {
    /// Its speed as the output, by view and ray kind, with that of the input.
    pub views: ViewSpeeds,
    /// Structures built for it; `None` if they say nothing about a device.
    pub built: Option<Built>,
}

/// How thoroughly contenders are timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Timing {
    /// With the rays of a verification, but from the views that choose.
    Full,
    /// As in a verification: with rays from the views that judge.
    Judging,
    /// With a quarter of the rays and three repeats, which suffices to preselect from many contenders.
    Brief,
}

impl Timing {
    fn rays(self, rays: u32) -> u32 {
        if self == Timing::Brief { rays.div_ceil(4) } else { rays }
    }

    fn repeats(self, repeats: u32) -> u32 {
        if self == Timing::Brief { repeats.min(3) } else { repeats }
    }

    fn role(self) -> Role {
        if self == Timing::Judging { Role::Judge } else { Role::Choose }
    }
}

/// Times contenders one after the other, each in turns with `before`, by the kinds of rays that count anything. `enter`
/// makes the tracer of the contender of a number, or says why it cannot take part. Rays are those of `before`, as a
/// verification times them, but no more of a kind than can be traced time and again, unless their number is given.
///
/// # Errors
/// Those of the tracer of `before`.
pub(super) fn race<T: Tracer>(
    scene: &Scene,
    before: &T,
    contenders: usize,
    enter: impl Fn(usize) -> Result<T, T::Error>,
    care: Timing,
    options: &VerifyOptions,
) -> Result<Vec<Result<RaceResult, T::Error>>, T::Error> {
    let count = care.rays(before.pace().timed(options));
    let sampling = options.sampling(count as usize, Some(care.role()));
    let rays = rays::generate_by(scene, &|rays| seen_by(before, rays), &sampling)?;
    let cells = cells(before, &rays, options)?;
    let prepared = prepared(before, &cells)?;
    let lap = |i| {
        let tracer = enter(i)?;
        let both = Sides { before, after: &tracer };
        let cell = |kind, rays: &Vec<Ray>, prepared: &T::Rays<'_>| {
            if rays.is_empty() {
                return Ok(KindSpeed::default());
            }
            let seconds = speed::pairs(kind, prepared, both, care.repeats(options.repeats))?;
            Ok(KindSpeed::in_pairs(rays.len(), &seconds))
        };
        let views = cells.iter().zip(&prepared);
        let views = views.map(|(rays, prepared)| PerKind::try_of(|kind| cell(kind, &rays[kind], &prepared[kind])));
        Ok(RaceResult { views: ViewSpeeds(views.collect::<Result<_, T::Error>>()?), built: tracer.built() })
    };
    let mut laps: Vec<Result<RaceResult, T::Error>> = (0..contenders).map(lap).collect();
    level(&mut laps);
    Ok(laps)
}

/// Returns the rays of each kind that counts in each view: all of them, or as many as do not take too long.
fn cells<T: Tracer>(before: &T, rays: &Rays, options: &VerifyOptions) -> Result<Vec<PerKind<Vec<Ray>>>, T::Error> {
    let of_view = |view: &RaysOfView| {
        PerKind::try_of(|kind| {
            if options.weights.0[kind] == 0.0 {
                return Ok(Vec::new());
            }
            let rays = rays.kinds[kind][view.range.clone()].to_vec();
            if options.timed_rays_per_kind.is_some() { Ok(rays) } else { affordable(before, kind, rays) }
        })
    };
    rays.views.iter().map(of_view).collect()
}

fn prepared<'r, T: Tracer>(tracer: &T, cells: &'r [PerKind<Vec<Ray>>]) -> Result<Vec<PerKind<T::Rays<'r>>>, T::Error> {
    let mut prepared = Vec::with_capacity(cells.len());
    for view in cells {
        prepared.push(PerKind::try_of(|kind| tracer.prepare(&view[kind]))?);
    }
    Ok(prepared)
}

/// Longest time that a kind of rays may take through the input in a view, in seconds.
const MOST_SECONDS: f64 = 0.005;

/// Number of rays that keep a device busy: the limit on time does not reduce them further.
const FEWEST_RAYS: usize = 1 << 19;

/// Number of neighbouring rays that stay together, because a device traces them in lockstep.
const TOGETHER: usize = 1 << 10;

/// Returns as many of the rays as do not take too long, spread over all of them.
fn affordable<T: Tracer>(tracer: &T, kind: RayKind, rays: Vec<Ray>) -> Result<Vec<Ray>, T::Error> {
    if rays.len() <= FEWEST_RAYS {
        return Ok(rays);
    }
    let share = MOST_SECONDS / tracer.seconds(kind, &tracer.prepare(&rays)?)?;
    let count = (rays.len() as f64 * share).max(FEWEST_RAYS as f64) as usize;
    Ok(if count < rays.len() { spread(&rays, count) } else { rays })
}

/// Returns about `count` rays, in groups of neighbours at regular intervals.
fn spread(rays: &[Ray], count: usize) -> Vec<Ray> {
    let groups: Vec<&[Ray]> = rays.chunks(TOGETHER).collect();
    let wanted = count.div_ceil(TOGETHER).min(groups.len());
    (0..wanted).flat_map(|i| groups[i * groups.len() / wanted]).copied().collect()
}

/// Like [`Machine::race`], but on the CPU, whose timings do not predict GPU speed.
pub fn race_on_cpu(
    before: &Scene,
    contenders: usize,
    scene_of: impl Fn(usize) -> Scene,
    options: &VerifyOptions,
) -> Vec<RaceResult> {
    let trees = TwoLevel::build(before);
    let first = CpuTracer::new(&trees);
    // One at a time, so that the trees of one contender are freed before those of the next are built.
    let lap = |i| {
        let trees = TwoLevel::build(&scene_of(i));
        let Ok(laps) = race(before, &first, 1, |_| Ok(CpuTracer::new(&trees)), Timing::Full, options);
        laps.into_iter().map(|lap| lap.unwrap_or_else(|never| match never {}))
    };
    (0..contenders).flat_map(lap).collect()
}

/// Runs work that takes scenes one after the other, preparing each while the previous one is in use.
#[cfg(feature = "vulkan")]
fn prepared_ahead<R>(
    count: usize,
    scene_of: impl Fn(usize) -> Scene + Sync,
    work: impl FnOnce(&dyn Fn() -> Scene) -> R,
) -> R {
    let scene_of = &scene_of;
    std::thread::scope(|scope| {
        let (send, receive) = std::sync::mpsc::sync_channel(0);
        scope.spawn(move || (0..count).map(scene_of).all(|scene| send.send(scene).is_ok()));
        // Nothing is received if preparing panicked; the scope then propagates the panic.
        work(&move || receive.recv().unwrap_or_default())
    })
}

/// Gives all laps the same input speeds, the medians over all laps, and scales the contenders' speeds accordingly:
/// while a device still raises its clock, the first laps are slow for input and contender alike.
fn level<E>(laps: &mut [Result<RaceResult, E>]) {
    let views = laps.iter().flatten().map(|lap| lap.views.0.len()).max().unwrap_or(0);
    for (view, kind) in (0..views).flat_map(|view| RayKind::ALL.map(|kind| (view, kind))) {
        let cells = laps.iter_mut().flatten().filter_map(|lap| lap.views.0.get_mut(view)).map(|kinds| &mut kinds[kind]);
        let mut timed: Vec<_> = cells.filter(|k| k.before_mrays_per_s > 0.0).collect();
        let mut speeds: Vec<f64> = timed.iter().map(|k| k.before_mrays_per_s).collect();
        speeds.sort_by(f64::total_cmp);
        let Some(&before) = speeds.get(speeds.len() / 2) else { continue };
        for k in &mut timed {
            (k.before_mrays_per_s, k.after_mrays_per_s) = (before, before * k.speedup_ratio);
        }
    }
}

impl Machine {
    /// Times contenders on the device: `scene_of` gives the scene of the contender of a number. `None` where the CPU
    /// traces, whose speeds tell nothing of a device. A contender that the device cannot take has the reason instead of
    /// its lap.
    ///
    /// # Errors
    /// Why the device cannot take `before`, in words.
    #[cfg(feature = "vulkan")]
    pub fn race(
        &self,
        before: &Scene,
        contenders: usize,
        scene_of: impl Fn(usize) -> Scene + Sync,
        care: Timing,
        options: &VerifyOptions,
    ) -> Option<Result<Vec<Result<RaceResult, String>>, String>> {
        let device = self.device.as_ref()?;
        let laps = Pipelines::new(device).and_then(|pipelines| {
            let build = |scene: &Scene| VulkanTracer::new(&pipelines, scene, options.build);
            let first = build(before)?;
            match device.info().is_software {
                // Preparing scenes at the same time would slow it down.
                true => race(before, &first, contenders, |i| build(&scene_of(i)), care, options),
                false => prepared_ahead(contenders, scene_of, |next| {
                    race(before, &first, contenders, |_| build(&next()), care, options)
                }),
            }
        });
        let in_words =
            |laps: Vec<Result<RaceResult, Error>>| laps.into_iter().map(|lap| lap.map_err(|e| e.to_string())).collect();
        Some(laps.map(in_words).map_err(|e| e.to_string()))
    }

    /// Without Vulkan there is no device to race on.
    #[cfg(not(feature = "vulkan"))]
    pub fn race(
        &self,
        _: &Scene,
        _: usize,
        _: impl Fn(usize) -> Scene + Sync,
        _: Timing,
        _: &VerifyOptions,
    ) -> Option<Result<Vec<Result<RaceResult, String>>, String>> {
        None
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::super::test_scenes;
    use super::super::weights::Weights;
    use super::*;

    #[test]
    fn a_slow_start_does_not_make_the_first_lap_slow() {
        let lap = |before: f64, speedup_ratio: f64| {
            let idle = KindSpeed::default();
            let kind = KindSpeed { before_mrays_per_s: before, speedup_ratio, ..idle };
            Ok::<_, Infallible>(RaceResult { views: ViewSpeeds(vec![[kind, idle, idle, idle].into()]), built: None })
        };
        let mut laps = vec![lap(1.0, 3.0), lap(4.0, 1.0), lap(4.0, 2.0)];
        level(&mut laps);
        let after = laps.iter().flatten().map(|lap| lap.views.0[0][RayKind::Primary].after_mrays_per_s);
        assert_eq!(after.collect::<Vec<_>>(), [12.0, 4.0, 8.0]);
        assert_eq!(laps[0].as_ref().map(|lap| lap.views.0[0][RayKind::Shadow].after_mrays_per_s), Ok(0.0));
    }

    #[cfg(feature = "vulkan")]
    #[test]
    fn scenes_come_in_their_order_and_no_more_are_prepared_than_are_taken() {
        let prepared = std::sync::atomic::AtomicUsize::new(0);
        let scene_of = |i: usize| {
            prepared.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            Scene { instances: test_scenes::room().instances[..i].to_vec(), ..Scene::default() }
        };
        let taken = prepared_ahead(5, scene_of, |next| [next(), next(), next()].map(|scene| scene.instances.len()));
        assert_eq!(taken, [0, 1, 2]);
        assert!(prepared.into_inner() <= 4);
    }

    #[test]
    fn every_contender_is_timed_with_the_kinds_of_rays_that_count() {
        let scene = test_scenes::room();
        let trees = TwoLevel::build(&scene);
        for weights in [[1.0; 4], [1.0, 0.0, 2.0, 0.0]] {
            let weights = Weights(weights.into());
            let options = VerifyOptions { rays_per_kind: 64, repeats: 3, weights, ..VerifyOptions::default() };
            let enter = |_| Ok(CpuTracer::new(&trees));
            let Ok(laps) = race(&scene, &CpuTracer::new(&trees), 2, enter, Timing::Brief, &options);
            assert_eq!(laps.len(), 2);
            for Ok(lap) in laps {
                assert_eq!(lap.views.0.len(), 4);
                for kinds in lap.views.0 {
                    let timed = kinds.map(|k| k.after_mrays_per_s > 0.0);
                    assert_eq!(timed, weights.0.map(|weight| weight > 0.0));
                }
            }
        }
    }

    #[test]
    fn rays_are_left_out_in_groups_spread_over_all() {
        let ray = |i: usize| Ray::endless(glam::DVec3::X * i as f64, glam::DVec3::Z);
        let rays: Vec<Ray> = (0..10 * TOGETHER + 5).map(ray).collect();
        let some = spread(&rays, 3 * TOGETHER);
        let starts: Vec<usize> = some.chunks(TOGETHER).map(|group| group[0].origin.x as usize / TOGETHER).collect();
        assert_eq!((some.len(), starts), (3 * TOGETHER, vec![0, 3, 7]));
        assert_eq!(spread(&rays, 20 * TOGETHER), rays);
    }
}
