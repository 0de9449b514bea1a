//! Rays through both files with any tracer: what they see, and how fast.

use super::Hit;
use super::VerifyOptions;
use super::build::{Built, Structures};
use super::compare::Tally;
use super::cpu::TrueHit;
use super::rays::{self, Ray, RayKind, Rays};
use super::speed::{self, Kinds};
use crate::scene::{Scene, TriangleRef};

/// Something that traces rays through one scene.
pub trait Tracer {
    /// Rays made ready to be traced; those that one tracer made ready serve all of its device.
    type Rays<'r>;
    /// What can go wrong.
    type Error;

    /// What does the tracing, for the report.
    fn device(&self) -> String;

    /// How its speed is best measured.
    fn pace(&self) -> Pace {
        Pace::default()
    }

    /// Makes rays ready.
    ///
    /// # Errors
    /// Out of memory, or another failure of the device; as all methods below.
    fn prepare<'r>(&self, rays: &'r [Ray]) -> Result<Self::Rays<'r>, Self::Error>;

    /// The first hit of each ray.
    ///
    /// # Errors
    /// As above.
    fn closest(&self, rays: &Self::Rays<'_>) -> Result<Vec<Option<Hit>>, Self::Error>;

    /// For each ray whether it hits anything.
    ///
    /// # Errors
    /// As above.
    fn occluded(&self, rays: &Self::Rays<'_>) -> Result<Vec<bool>, Self::Error>;

    /// Seconds to trace rays of a kind: shadow rays until the first hit found, others to the closest.
    ///
    /// # Errors
    /// As above.
    fn seconds(&self, kind: RayKind, rays: &Self::Rays<'_>) -> Result<f64, Self::Error>;

    /// What was built for it and what its rays met so far; `None` where that tells nothing of a device.
    fn built(&self) -> Option<Built> {
        None
    }
}

/// How a tracer's speed is best measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pace {
    /// Rays of a kind it takes to keep it busy; `None` where those that are compared will do.
    pub rays: Option<u32>,
    /// How often it may trace before its times settle.
    pub most_warm_ups: u32,
}

/// What rays saw.
pub(super) struct Seen {
    pub(super) device: String,
    pub(super) view: String,
    pub(super) tally: Tally,
    pub(super) kinds: Kinds,
    pub(super) structures: Option<Structures>,
}

/// Traces rays through both scenes, compares what they see, and times them.
pub(super) fn trace<T: Tracer>(
    before: &Scene,
    rays: &Rays,
    tracers: [&T; 2],
    options: &VerifyOptions,
    compare: impl Fn(RayKind, &[Ray], [&[Option<Hit>]; 2]) -> Tally,
) -> Result<Seen, T::Error> {
    let mut tally = Tally::default();
    let prepared = rays.kinds.iter().map(|rays| tracers[0].prepare(rays)).collect::<Result<Vec<_>, _>>()?;
    for ((kind, rays), prepared) in RayKind::ALL.into_iter().zip(&rays.kinds).zip(&prepared) {
        let hits = [tracers[0].closest(prepared)?, tracers[1].closest(prepared)?];
        tally.add(compare(kind, rays, [&hits[0], &hits[1]]));
        if kind == RayKind::Shadow {
            tally.tracer_faults += contradictions(prepared, tracers, &hits)?;
        }
    }
    let structures = tracers[0].built().zip(tracers[1].built()).map(|(before, after)| Structures::of([before, after]));
    let mut kinds = Kinds::default();
    let timed = options.timed_rays_per_kind.or(tracers[0].pace().rays).unwrap_or(options.rays_per_kind);
    if timed == options.rays_per_kind {
        for ((kind, rays), prepared) in RayKind::ALL.into_iter().zip(&rays.kinds).zip(&prepared) {
            *kinds.of(kind) = speed::measure(kind, rays.len(), prepared, tracers, options.repeats)?;
        }
    } else {
        drop(prepared);
        let rays = rays::generate_by(before, |rays| seen_by(tracers[0], rays), timed as usize, options.seed)?;
        for (kind, rays) in RayKind::ALL.into_iter().zip(rays.kinds) {
            let prepared = tracers[0].prepare(&rays)?;
            *kinds.of(kind) = speed::measure(kind, rays.len(), &prepared, tracers, options.repeats)?;
        }
    }
    Ok(Seen { device: tracers[0].device(), view: rays.view.clone(), tally, kinds, structures })
}

/// Rays of which a tracer says that they hit something, or nothing, depending on how it is asked.
fn contradictions<T: Tracer>(
    rays: &T::Rays<'_>,
    tracers: [&T; 2],
    hits: &[Vec<Option<Hit>>; 2],
) -> Result<u64, T::Error> {
    let mut count = 0;
    for (tracer, closest) in tracers.into_iter().zip(hits) {
        let occluded = tracer.occluded(rays)?;
        count += closest.iter().zip(occluded).filter(|(c, o)| c.is_some() != *o).count() as u64;
    }
    Ok(count)
}

/// What a tracer takes for the truth.
pub(super) fn seen_by<T: Tracer>(tracer: &T, rays: &[Ray]) -> Result<Vec<Option<TrueHit>>, T::Error> {
    let hits = tracer.closest(&tracer.prepare(rays)?)?;
    let believed = |hit: Hit| TrueHit {
        t: f64::from(hit.t),
        at: TriangleRef { instance: hit.instance, triangle: hit.triangle },
        front: hit.front,
    };
    Ok(hits.into_iter().map(|hit| hit.map(believed)).collect())
}
