//! Traces rays through both files with any tracer: what they hit, and how fast.

use std::cmp::Ordering;

use super::Hit;
use super::build::{Built, Structures};
use super::compare::Tally;
use super::cpu::TrueHit;
use super::rays::{self, Ray, RayKind, Rays, RaysOfView};
use super::seams::{Aimed, Seams};
use super::speed::{self, KindSpeed};
use super::view_speeds::ViewSpeeds;
use super::views::Role;
use super::work::Work;
use super::{Note, OpaqueTextures, PerKind, Side, Sides, VerifyOptions};
use crate::scene::Scene;

/// A tracer of rays through one scene.
pub trait Tracer {
    /// Rays prepared for tracing; rays prepared by one tracer can be used by all tracers of its device.
    type Rays<'r>;
    /// The error of a failed operation.
    type Error;

    /// Returns the name of the device, for the report.
    fn device(&self) -> String;

    /// Returns how its speed is best measured.
    fn pace(&self) -> TimingHints {
        TimingHints::default()
    }

    /// Prepares rays.
    ///
    /// # Errors
    /// Fails if memory runs out or the device fails, as do all methods below.
    fn prepare<'r>(&self, rays: &'r [Ray]) -> Result<Self::Rays<'r>, Self::Error>;

    /// Returns the first hit of each ray.
    ///
    /// # Errors
    /// As above.
    fn closest(&self, rays: &Self::Rays<'_>) -> Result<Vec<Option<Hit>>, Self::Error>;

    /// Returns, for each ray, whether it hits anything.
    ///
    /// # Errors
    /// As above.
    fn occluded(&self, rays: &Self::Rays<'_>) -> Result<Vec<bool>, Self::Error>;

    /// Returns the seconds to trace rays of a kind: shadow rays to the first hit found, others to the closest hit.
    ///
    /// # Errors
    /// As above.
    fn seconds(&self, kind: RayKind, rays: &Self::Rays<'_>) -> Result<f64, Self::Error>;

    /// Returns the steps of rays of a kind, if these rather than seconds say how fast it is. They are the same in every
    /// run.
    fn work(&self, _kind: RayKind, _rays: &[Ray]) -> Option<Work> {
        None
    }

    /// Textures that it takes for opaque when it is timed.
    fn opaque_textures(&self) -> Option<OpaqueTextures> {
        None
    }

    /// Returns its structures and any-hit counts so far; `None` if they say nothing about a device.
    fn built(&self) -> Option<Built> {
        None
    }
}

/// How a tracer's speed is best measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TimingHints {
    /// Number of rays per kind that keeps it busy; `None` if the number of compared rays suffices.
    pub rays: Option<u32>,
    /// Default limit on the timed rays per kind: as many as a slow tracer can trace repeatedly.
    pub most_rays: Option<u32>,
    /// Largest number of warm-up passes before times settle.
    pub most_warm_ups: u32,
}

impl TimingHints {
    /// Returns the number of timed rays per kind.
    pub(super) fn timed(&self, options: &VerifyOptions) -> u32 {
        let suitable = self.rays.unwrap_or(options.rays_per_kind).min(self.most_rays.unwrap_or(u32::MAX));
        options.timed_rays_per_kind.unwrap_or(suitable)
    }
}

/// Results of tracing rays.
pub(super) struct Seen {
    pub(super) device: String,
    pub(super) views: Vec<RaysOfView>,
    pub(super) tally: Tally,
    pub(super) seams: Seams,
    pub(super) timed: Timed,
    pub(super) structures: Option<Structures>,
    pub(super) notes: Vec<Note>,
}

/// How fast rays were traced.
#[derive(Default)]
pub(super) struct Timed {
    /// The speeds that count, by judging view.
    pub(super) speeds: ViewSpeeds,
    /// Each time taken, in seconds, added up over the views.
    pub(super) seconds: PerKind<Sides<Vec<f64>>>,
    /// What they are beside seconds, if seconds do not count.
    pub(super) counted: Option<Counted>,
}

/// Steps of rays, which count, and the seconds that they took, which do not.
pub(super) struct Counted {
    pub(super) work: PerKind<Sides<Work>>,
    pub(super) measured: PerKind<KindSpeed>,
}

/// The tracers of the input and of the output.
pub enum Tracers<'t, T: Tracer> {
    /// Both at once, timed in turns.
    Together(Sides<&'t T>),
    /// Each created when needed and freed before the other is created, if there is no memory for both.
    OneByOne(Sides<Make<'t, T>>),
}

/// Makes a tracer.
pub(super) type Make<'t, T> = &'t dyn Fn() -> Result<T, <T as Tracer>::Error>;

impl<'t, T: Tracer> From<Sides<&'t T>> for Tracers<'t, T> {
    fn from(both: Sides<&'t T>) -> Tracers<'t, T> {
        Tracers::Together(both)
    }
}

/// Compares the hits of two tracers for rays of a kind.
pub(super) trait Compare: Fn(RayKind, &[Ray], Sides<&[Option<Hit>]>) -> Tally {}

impl<F: Fn(RayKind, &[Ray], Sides<&[Option<Hit>]>) -> Tally> Compare for F {}

/// Traces rays through both scenes, compares the hits, and times them. The aimed rays are only traced.
pub(super) fn trace<T: Tracer>(
    before: &Scene,
    rays: &Rays,
    aimed: &Aimed,
    tracers: Tracers<'_, T>,
    options: &VerifyOptions,
    compare: impl Compare,
) -> Result<Seen, T::Error> {
    match tracers {
        Tracers::Together(tracers) => together(before, rays, aimed, tracers, options, compare),
        Tracers::OneByOne(make) => one_by_one(before, rays, aimed, make, options, compare),
    }
}

fn together<T: Tracer>(
    before: &Scene,
    rays: &Rays,
    aimed: &Aimed,
    tracers: Sides<&T>,
    options: &VerifyOptions,
    compare: impl Compare,
) -> Result<Seen, T::Error> {
    let views = Sides { before: View::of(tracers.before, rays, aimed)?, after: View::of(tracers.after, rays, aimed)? };
    let timed = timed_rays(before, rays, tracers.before, options)?;
    let timed = if timed.kinds.values().all(Vec::is_empty) {
        Timed::default()
    } else if let Some(counted) = counted(&rays.of_role(Role::Judge), tracers) {
        measured_beside(counted, &timed, tracers, options)?
    } else {
        timed_in_pairs(&timed, tracers, options)?
    };
    Ok(seen(rays, aimed, views, timed, compare))
}

/// Like [`together`], with one tracer at a time.
fn one_by_one<T: Tracer>(
    before: &Scene,
    rays: &Rays,
    aimed: &Aimed,
    make: Sides<Make<'_, T>>,
    options: &VerifyOptions,
    compare: impl Compare,
) -> Result<Seen, T::Error> {
    let all_times = |tracer: &T, rays: &Rays| {
        by_view(rays, |kind, rays| speed::alone(kind, &tracer.prepare(rays)?, tracer, options.repeats))
    };
    let tracer = (make.before)()?;
    let view_before = View::of(&tracer, rays, aimed)?;
    let timed = timed_rays(before, rays, &tracer, options)?;
    let times_before = all_times(&tracer, &timed)?;
    drop(tracer);
    let tracer = (make.after)()?;
    let view_after = View::of(&tracer, rays, aimed)?;
    let times_after = all_times(&tracer, &timed)?;
    let both = |(before, after): (PerKind<Vec<f64>>, PerKind<Vec<f64>>)| {
        PerKind::of(|kind| Sides { before: before[kind].clone(), after: after[kind].clone() })
    };
    let cells: Vec<PerKind<Sides<Vec<f64>>>> = times_before.into_iter().zip(times_after).map(both).collect();
    let timed = Timed::new(&timed, &cells, KindSpeed::one_after_the_other);
    Ok(seen(rays, aimed, Sides { before: view_before, after: view_after }, timed, compare))
}

/// Times both tracers in pairs: each kind of rays in each view.
pub(super) fn timed_in_pairs<T: Tracer>(
    rays: &Rays,
    tracers: Sides<&T>,
    options: &VerifyOptions,
) -> Result<Timed, T::Error> {
    let cells =
        by_view(rays, |kind, rays| speed::pairs(kind, &tracers.before.prepare(rays)?, tracers, options.repeats))?;
    Ok(Timed::new(rays, &cells, KindSpeed::in_pairs))
}

/// Returns something of the rays of each kind in each view; nothing of no rays.
fn by_view<R: Default, E>(
    rays: &Rays,
    mut of: impl FnMut(RayKind, &[Ray]) -> Result<R, E>,
) -> Result<Vec<PerKind<R>>, E> {
    let mut of_view = |view: &RaysOfView| {
        PerKind::try_of(|kind| match &rays.kinds[kind].get(view.range.clone()) {
            Some(rays) if !rays.is_empty() => of(kind, rays),
            _ => Ok(R::default()),
        })
    };
    rays.views.iter().map(&mut of_view).collect()
}

/// Counts the steps of rays in each view, if the tracers count; `None` if seconds say how fast they are.
fn counted<T: Tracer>(rays: &Rays, tracers: Sides<&T>) -> Option<Vec<PerKind<Sides<Work>>>> {
    let of = |kind, rays: &[Ray]| -> Result<Sides<Work>, ()> {
        let work = |tracer: &T| tracer.work(kind, rays).ok_or(());
        Ok(Sides { before: work(tracers.before)?, after: work(tracers.after)? })
    };
    by_view(rays, of).ok()
}

/// Takes the speeds from steps, and measures the seconds of some rays beside them.
fn measured_beside<T: Tracer>(
    work: Vec<PerKind<Sides<Work>>>,
    rays: &Rays,
    tracers: Sides<&T>,
    options: &VerifyOptions,
) -> Result<Timed, T::Error> {
    let exact = |of: &Sides<Work>| KindSpeed::exact(of.before.rays as usize, of.as_ref().map(Work::seconds));
    let speeds = ViewSpeeds(work.iter().map(|view| view.each_ref().map(exact)).collect());
    let add = |all: Sides<Work>, view: &Sides<Work>| Sides {
        before: all.before.and(view.before),
        after: all.after.and(view.after),
    };
    let work = PerKind::of(|kind| work.iter().map(|view| &view[kind]).fold(Sides::default(), add));
    let seconds = PerKind::try_of(|kind| match rays.kinds[kind].as_slice() {
        [] => Ok(Sides::default()),
        rays => speed::pairs(kind, &tracers.before.prepare(rays)?, tracers, options.repeats),
    })?;
    let measured = PerKind::of(|kind| KindSpeed::in_pairs(rays.kinds[kind].len(), &seconds[kind]));
    Ok(Timed { speeds, seconds, counted: Some(Counted { work, measured }) })
}

impl Timed {
    /// Of the seconds of each kind in each view.
    fn new(
        rays: &Rays,
        cells: &[PerKind<Sides<Vec<f64>>>],
        speed: impl Fn(usize, &Sides<Vec<f64>>) -> KindSpeed,
    ) -> Timed {
        let of_view = |(view, cells): (&RaysOfView, &PerKind<Sides<Vec<f64>>>)| {
            cells.each_ref().map(|seconds| speed(view.range.len(), seconds))
        };
        let mut seconds = PerKind::<Sides<Vec<f64>>>::default();
        for (kind, all) in seconds.iter_mut() {
            for cell in cells {
                for side in Side::BOTH {
                    add(&mut all[side], &cell[kind][side]);
                }
            }
        }
        Timed { speeds: ViewSpeeds(rays.views.iter().zip(cells).map(of_view).collect()), seconds, counted: None }
    }
}

/// Adds numbers to others, of which there may be none yet.
fn add(all: &mut Vec<f64>, more: &[f64]) {
    all.resize(more.len().max(all.len()), 0.0);
    all.iter_mut().zip(more).for_each(|(sum, number)| *sum += number);
}

/// One tracer's results for the compared rays.
struct View {
    device: String,
    /// The first hits.
    closest: PerKind<Vec<Option<Hit>>>,
    /// Whether each aimed ray hits anything.
    aimed: Vec<bool>,
    /// Number of rays that the tracer reports as hitting something in one query and nothing in the other.
    contradictions: u64,
    built: Option<Built>,
    opaque_textures: Option<OpaqueTextures>,
}

impl View {
    fn of<T: Tracer>(tracer: &T, rays: &Rays, aimed: &Aimed) -> Result<View, T::Error> {
        let mut contradictions = 0;
        let closest = PerKind::try_of(|kind| {
            let prepared = tracer.prepare(&rays.kinds[kind])?;
            let hits = tracer.closest(&prepared)?;
            if kind == RayKind::Shadow {
                let occluded = tracer.occluded(&prepared)?;
                contradictions += hits.iter().zip(occluded).filter(|(hit, o)| hit.is_some() != *o).count() as u64;
            }
            Ok(hits)
        })?;
        Ok(View {
            device: tracer.device(),
            closest,
            aimed: tracer.occluded(&tracer.prepare(&aimed.rays)?)?,
            contradictions,
            built: tracer.built(),
            opaque_textures: tracer.opaque_textures(),
        })
    }
}

fn seen(rays: &Rays, aimed: &Aimed, views: Sides<View>, timed: Timed, compare: impl Compare) -> Seen {
    let Sides { before, after } = views;
    let mut tally = Tally::default();
    for (kind, rays) in rays.kinds.iter() {
        tally.add(compare(kind, rays, Sides { before: &before.closest[kind], after: &after.closest[kind] }));
    }
    tally.tracer_faults += before.contradictions + after.contradictions;
    let seams = Seams::count(aimed, Sides { before: &before.aimed, after: &after.aimed });
    let opaque = [(Side::Before, before.opaque_textures), (Side::After, after.opaque_textures)];
    let notes = opaque.into_iter().filter_map(|(side, textures)| Some(Note::OpaqueTextures(side, textures?))).collect();
    let structures = before.built.zip(after.built).map(|(before, after)| Structures::of(&Sides { before, after }));
    Seen { device: before.device, views: rays.views.clone(), tally, seams, timed, structures, notes }
}

/// Returns the rays to be timed: of the views that judge.
fn timed_rays<T: Tracer>(before: &Scene, rays: &Rays, tracer: &T, options: &VerifyOptions) -> Result<Rays, T::Error> {
    let count = tracer.pace().timed(options);
    let judging = rays.of_role(Role::Judge);
    match (count as usize).cmp(&judging.kinds[RayKind::Primary].len()) {
        Ordering::Less => Ok(judging.thinned(count as usize)),
        Ordering::Equal => Ok(judging),
        Ordering::Greater => {
            let sampling = options.sampling(count as usize, Some(Role::Judge));
            rays::generate_by(before, &|rays| seen_by(tracer, rays), &sampling)
        }
    }
}

/// Returns the closest hits reported by a tracer, in the form of true hits.
pub(super) fn seen_by<T: Tracer>(tracer: &T, rays: &[Ray]) -> Result<Vec<Option<TrueHit>>, T::Error> {
    let hits = tracer.closest(&tracer.prepare(rays)?)?;
    Ok(hits.into_iter().map(|hit| hit.map(TrueHit::from)).collect())
}
