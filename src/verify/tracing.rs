//! Traces rays through both files with any tracer: what they hit, and how fast.

use std::cmp::Ordering;

use super::Hit;
use super::build::{Built, Structures};
use super::compare::Tally;
use super::cpu::TrueHit;
use super::rays::{self, Ray, RayKind, Rays, RaysOfView};
use super::seams::{Aimed, Seams};
use super::speed::{self, KindSpeed};
use super::views::Role;
use super::{Note, OpaqueTextures, PerKind, Side, Sides, VerifyOptions};
use crate::scene::{Scene, TriangleRef};

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

/// How long rays took.
pub(super) struct Timed {
    pub(super) kinds: PerKind<KindSpeed>,
    /// Each time taken, in seconds.
    pub(super) seconds: PerKind<Sides<Vec<f64>>>,
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
    let both = [tracers.before, tracers.after];
    let seconds = PerKind::try_of(|kind| times(kind, &timed.kinds[kind], both, options.repeats).map(Sides::from))?;
    let kinds = PerKind::of(|kind| KindSpeed::in_turns(timed.kinds[kind].len(), &seconds[kind]));
    Ok(seen(rays, aimed, views, Timed { kinds, seconds }, compare))
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
        PerKind::try_of(|kind| times(kind, &rays.kinds[kind], [tracer], options.repeats).map(|[times]| times))
    };
    let tracer = (make.before)()?;
    let view_before = View::of(&tracer, rays, aimed)?;
    let timed = timed_rays(before, rays, &tracer, options)?;
    let mut times_before = all_times(&tracer, &timed)?;
    drop(tracer);
    let tracer = (make.after)()?;
    let view_after = View::of(&tracer, rays, aimed)?;
    let mut times_after = all_times(&tracer, &timed)?;
    let seconds = PerKind::of(|kind| {
        Sides { before: &mut times_before, after: &mut times_after }.map(|times| std::mem::take(&mut times[kind]))
    });
    let kinds = PerKind::of(|kind| KindSpeed::one_after_the_other(timed.kinds[kind].len(), &seconds[kind]));
    Ok(seen(rays, aimed, Sides { before: view_before, after: view_after }, Timed { kinds, seconds }, compare))
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

/// Times rays of one kind, which are prepared only for this purpose.
fn times<T: Tracer, const N: usize>(
    kind: RayKind,
    rays: &[Ray],
    tracers: [&T; N],
    repeats: u32,
) -> Result<[Vec<f64>; N], T::Error> {
    match tracers.first().filter(|_| !rays.is_empty()) {
        None => Ok([const { Vec::new() }; N]),
        Some(first) => speed::times(kind, &first.prepare(rays)?, tracers, repeats),
    }
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
            rays::generate_by(before, |rays| seen_by(tracer, rays), &sampling)
        }
    }
}

/// Returns the closest hits reported by a tracer, in the form of true hits.
pub(super) fn seen_by<T: Tracer>(tracer: &T, rays: &[Ray]) -> Result<Vec<Option<TrueHit>>, T::Error> {
    let hits = tracer.closest(&tracer.prepare(rays)?)?;
    let believed = |hit: Hit| TrueHit {
        t: f64::from(hit.t),
        at: TriangleRef { instance: hit.instance, triangle: hit.triangle },
        front: hit.front,
    };
    Ok(hits.into_iter().map(|hit| hit.map(believed)).collect())
}
