//! The views of a verification: where primary rays come from, and which views choose a layout and which judge it.
//!
//! A layout that one view calls faster may be slower in another, by up to 20 % either way. Therefore rays come from
//! several views: the file's cameras first, then viewpoints that the scene itself places, in its free space and around
//! it. Every other view chooses; the rest judge.

use glam::DVec3;
use serde::Serialize;

use super::cpu::TrueHit;
use super::random::Random;
use super::rays::{FirstHits, Ray, RaysOfView};
use super::view::{Stage, View};
use super::weights::Overall;
use crate::scene::{Bounds, Scene};

/// Default number of views: four choose and four judge, which leaves a view about as many rays as keep a GPU busy.
pub const DEFAULT_VIEWS: u32 = 8;
/// Smallest number of views: one chooses, one judges.
pub const FEWEST_VIEWS: u32 = 2;
/// Largest number of views.
pub const MOST_VIEWS: u32 = 64;

/// What a view is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Candidates are ranked by its rays.
    Choose,
    /// Its rays decide whether the output is faster.
    Judge,
}

impl Role {
    /// The role of the view at an index: the first chooses, the second judges, and so on.
    pub fn of(index: usize) -> Role {
        if index.is_multiple_of(2) { Role::Choose } else { Role::Judge }
    }
}

/// Where the primary rays of a view come from.
pub(super) enum Source {
    /// A camera.
    View(View),
    /// Points of the sphere around the scene, if no camera sees anything.
    Around,
}

/// A view of a scene.
pub(super) struct PlacedView {
    pub(super) name: String,
    pub(super) source: Source,
    /// Share of its picture that shows something.
    pub(super) seen_ratio: f64,
}

/// A view is used only if at least this share of its picture shows something.
const LEAST_SEEN: f64 = 1.0 / 64.0;
/// Viewpoints are tried until at least this share of the picture shows something.
const ENOUGH_SEEN: f64 = 1.0 / 8.0;
/// Description of rays from all around.
const AROUND: &str = "random points around the scene";
/// Side of the picture, in rays, by which a view is judged to see something.
const PICTURE: usize = 16;
/// Viewpoints of each kind that are tried for a view; cameras that are tried, per view.
const TRIES: usize = 4;
/// Points among which the one with the most space around it becomes a viewpoint inside the scene.
const POINTS: usize = 8;
/// Directions that are probed around such a point.
const DIRECTIONS: usize = 32;
/// Largest share of a direction that is vertical, for a viewpoint inside.
const STEEPEST: f64 = 0.5;
/// Elevation above the horizon of viewpoints outside, as the sine of the angle: lowest and highest.
const ELEVATION: [f64; 2] = [-0.1, 0.75];
/// Distance of viewpoints outside, over the distance at which the whole box is just seen: least and most.
const NEARNESS: [f64; 2] = [0.75, 1.0];

/// Streams of random numbers; apart from those of the rays.
mod stream {
    pub(super) const PICTURE: u64 = 16;
    pub(super) const INSIDE: u64 = 17;
    pub(super) const OUTSIDE: u64 = 18;
}

/// The kinds of viewpoints that a scene places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Inside,
    Outside,
}

impl Place {
    /// The kind of the viewpoint at an index: two of three are inside an interior and outside any other scene.
    fn of(index: usize, enclosed: bool) -> Place {
        if (index % 6 < 4) == enclosed { Place::Inside } else { Place::Outside }
    }

    fn other(self) -> Place {
        if self == Place::Inside { Place::Outside } else { Place::Inside }
    }
}

/// Places `count` views of a scene, the same for any number of rays. `closest` returns the first hits of rays.
///
/// # Errors
/// Returns the errors of `closest`.
pub(super) fn place<E>(
    scene: &Scene,
    stage: &Stage,
    closest: &FirstHits<E>,
    count: usize,
    seed: u64,
) -> Result<Vec<PlacedView>, E> {
    let core = scene.core().bounds();
    let bounds = if core.is_empty() { stage.bounds } else { core };
    let placer = Placer { stage, bounds, closest, seed };
    let mut views = Vec::with_capacity(count);
    for camera in scene.cameras.iter().filter_map(View::of).take(TRIES * count) {
        views.extend(Some(placer.seen(camera)?).filter(|view| view.seen_ratio >= LEAST_SEEN && views.len() < count));
    }
    if views.is_empty() {
        views.extend(Some(placer.seen(View::automatic(stage))?).filter(|view| view.seen_ratio >= LEAST_SEEN));
    }
    while views.len() < count {
        views.push(placer.viewpoint(views.len())?);
    }
    Ok(views)
}

/// Returns views of a scene that a picture may be taken from: the automatic one, then `count` viewpoints inside and
/// around the scene that see something. The file's cameras are not among them.
pub(crate) fn viewpoints(
    scene: &Scene,
    stage: &Stage,
    closest: &impl Fn(&[Ray]) -> Vec<Option<TrueHit>>,
    count: usize,
    seed: u64,
) -> Vec<View> {
    let core = scene.core().bounds();
    let bounds = if core.is_empty() { stage.bounds } else { core };
    let closest = |rays: &[Ray]| Ok::<_, std::convert::Infallible>(closest(rays));
    let placer = Placer { stage, bounds, closest: &closest, seed };
    let placed = (0..count).map(|index| {
        let Ok(view) = placer.viewpoint(index);
        view.source
    });
    let views = placed.filter_map(|source| if let Source::View(view) = source { Some(view) } else { None });
    [View::automatic(stage)].into_iter().chain(views).collect()
}

struct Placer<'a, E> {
    stage: &'a Stage,
    /// Box of the scene without what lies far outside it.
    bounds: Bounds,
    closest: &'a FirstHits<'a, E>,
    seed: u64,
}

impl<E> Placer<'_, E> {
    /// Returns a view with the share of its picture that shows something.
    fn seen(&self, view: View) -> Result<PlacedView, E> {
        let at = |i: usize| {
            let mut random = Random::at(self.seed, stream::PICTURE, i);
            let cell = [i % PICTURE, i / PICTURE].map(|cell| cell as f64);
            let [x, y] = cell.map(|cell| 2.0 * (cell + random.unit()) / PICTURE as f64 - 1.0);
            let (origin, direction) = view.ray([x, y]);
            Ray::endless(origin, direction)
        };
        let rays: Vec<Ray> = (0..PICTURE * PICTURE).map(at).collect();
        let hits = (self.closest)(&rays)?.iter().flatten().count();
        let seen_ratio = hits as f64 / rays.len() as f64;
        Ok(PlacedView { name: view.name.clone(), source: Source::View(view), seen_ratio })
    }

    /// Returns a view from the first viewpoint that sees enough, else from the one that sees most, or from all around if
    /// that is next to nothing.
    fn viewpoint(&self, index: usize) -> Result<PlacedView, E> {
        let mut best = PlacedView { name: AROUND.to_owned(), source: Source::Around, seen_ratio: 0.0 };
        let preferred = Place::of(index, self.stage.enclosed);
        for place in [preferred, preferred.other()] {
            for attempt in 0..TRIES {
                let stream = index * TRIES + attempt;
                let view = match place {
                    Place::Inside => self.inside(index, stream)?,
                    Place::Outside => Some(self.outside(index, stream)),
                };
                let Some(view) = view else { continue };
                let view = self.seen(view)?;
                if view.seen_ratio >= ENOUGH_SEEN {
                    return Ok(view);
                }
                if view.seen_ratio >= LEAST_SEEN.max(best.seen_ratio) {
                    best = view;
                }
            }
        }
        Ok(best)
    }

    /// Returns the view from the roomiest of some random points, toward something at least as far as most of what is
    /// around it; `None` if all points are inside of objects or see little.
    fn inside(&self, index: usize, stream: usize) -> Result<Option<View>, E> {
        let mut random = Random::at(self.seed, stream::INSIDE, stream);
        let points: Vec<DVec3> = (0..POINTS).map(|_| self.point(&mut random)).collect();
        let directions: Vec<DVec3> = (0..DIRECTIONS).map(|_| random.direction()).collect();
        let around = |point: &DVec3| directions.iter().map(|d| Ray::endless(*point, *d)).collect::<Vec<_>>();
        let rays: Vec<Ray> = points.iter().flat_map(around).collect();
        let hits = (self.closest)(&rays)?;
        let rooms = points.into_iter().zip(hits.chunks(DIRECTIONS)).map(|(point, hits)| (point, hits, room(hits)));
        let roomiest = rooms.reduce(|best, other| if other.2 > best.2 { other } else { best });
        let Some((point, hits, _)) = roomiest.filter(|(.., room)| *room > 0.0) else { return Ok(None) };
        let median = sorted_distances(hits)[hits.iter().flatten().count() / 2];
        let is_far = |(hit, direction): (&Option<TrueHit>, &DVec3)| {
            hit.is_some_and(|hit| hit.t >= median) && direction.y.abs() <= STEEPEST
        };
        let far = hits.iter().zip(&directions).position(is_far);
        Ok(Some(View::inside(format!("inside {index}"), point, directions[far.unwrap_or(0)])))
    }

    fn point(&self, random: &mut Random) -> DVec3 {
        self.bounds.min + DVec3::from_array(std::array::from_fn(|_| random.unit())) * self.bounds.size()
    }

    /// Returns a view of the whole scene, or most of it, from a random direction.
    fn outside(&self, index: usize, stream: usize) -> View {
        let mut random = Random::at(self.seed, stream::OUTSIDE, stream);
        let mut within = |[least, most]: [f64; 2]| least + (most - least) * random.unit();
        let (y, nearness) = (within(ELEVATION), within(NEARNESS));
        let (sin, cos) = within([0.0, std::f64::consts::TAU]).sin_cos();
        let flat = (1.0 - y * y).sqrt();
        View::outside(format!("outside {index}"), &self.bounds, DVec3::new(flat * cos, y, flat * sin), nearness)
    }
}

/// How much room there is around a point: the distance that all but an eighth of the hits exceed, times the share of
/// hits that are fronts; 0 if fewer than half of the directions hit anything.
fn room(hits: &[Option<TrueHit>]) -> f64 {
    let distances = sorted_distances(hits);
    if distances.is_empty() || 2 * distances.len() < hits.len() {
        return 0.0;
    }
    let fronts = hits.iter().flatten().filter(|hit| hit.front).count();
    distances[distances.len() / 8] * fronts as f64 / distances.len() as f64
}

fn sorted_distances(hits: &[Option<TrueHit>]) -> Vec<f64> {
    let mut distances: Vec<f64> = hits.iter().flatten().map(|hit| hit.t).collect();
    distances.sort_unstable_by(f64::total_cmp);
    distances
}

/// A view in reports.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewReport {
    /// Description of where the primary rays came from.
    pub name: String,
    /// What the view is for.
    pub role: Role,
    /// Share of the picture that shows something, from 256 rays; 0 if rays came from all around.
    pub seen_ratio: f64,
    /// Its speedup over all ray kinds; `None` if its rays do not decide, or were not timed.
    pub speedup_ratio: Option<f64>,
    /// Uncertainty of `speedup_ratio` over repeats.
    pub spread_ratio: Option<f64>,
}

impl ViewReport {
    /// All views, with the speeds of those that judge.
    pub(super) fn all(views: &[RaysOfView], speeds: &[Overall]) -> Vec<ViewReport> {
        let mut speeds = speeds.iter();
        let report = |view: &RaysOfView| {
            let speed = if view.role == Role::Judge { speeds.next() } else { None };
            ViewReport {
                name: view.name.clone(),
                role: view.role,
                seen_ratio: view.seen_ratio,
                speedup_ratio: speed.map(|speed| speed.speedup_ratio),
                spread_ratio: speed.map(|speed| speed.spread_ratio),
            }
        };
        views.iter().map(report).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use glam::DAffine3;

    use super::super::cpu::{Reference, TwoLevel};
    use super::super::rays::{RayKind, Rays, Sampling, generate};
    use super::super::test_scenes::{self, cube, scene};
    use super::*;
    use crate::scene::{Camera, PlacedCamera, TriangleRef};

    fn rays(scene: &Scene, sampling: &Sampling) -> Rays {
        generate(scene, &Reference::new(&TwoLevel::build(scene)), sampling)
    }

    #[test]
    fn views_are_the_same_for_any_number_of_rays_and_one_role_has_its_share_of_them() {
        let scene = test_scenes::room();
        let all = rays(&scene, &Sampling::new(1000, 7));
        let few = rays(&scene, &Sampling { role: Some(Role::Judge), ..Sampling::new(100, 7) });
        let judging: Vec<_> = all.views.iter().filter(|view| view.role == Role::Judge).collect();
        assert_eq!(all.views.len(), DEFAULT_VIEWS as usize);
        assert_eq!(
            judging.iter().map(|v| &v.name).collect::<Vec<_>>(),
            few.views.iter().map(|v| &v.name).collect::<Vec<_>>()
        );
        assert_eq!(judging.iter().map(|v| v.range.len()).sum::<usize>(), 500);
        assert_eq!(few.kinds.each_ref().map(Vec::len), [100; 4].into());
        assert_eq!(all.of_role(Role::Judge).kinds.each_ref().map(Vec::len), [500; 4].into());
        assert_ne!(rays(&scene, &Sampling::new(1000, 8)).kinds[RayKind::Primary], all.kinds[RayKind::Primary]);
    }

    #[test]
    fn every_view_of_a_room_and_of_a_solid_sees_something() {
        let solid = scene(vec![cube(0, None)], &[(0, DAffine3::IDENTITY)]);
        for (scene, inside) in [(test_scenes::room(), 6), (solid, 0)] {
            let views = rays(&scene, &Sampling::new(800, 1)).views;
            let names = |word: &str| views.iter().filter(|view| view.name.contains(word)).count();
            assert!(views.iter().all(|view| view.seen_ratio >= ENOUGH_SEEN), "{views:?}");
            assert_eq!([names("inside"), names("outside")], [inside, 8 - inside], "{views:?}");
        }
    }

    #[test]
    fn cameras_come_first_and_those_that_see_nothing_are_replaced() {
        let mut scene = test_scenes::room();
        let camera = |name: &str, z: f64| PlacedCamera {
            name: name.into(),
            camera: Camera::Perspective { yfov: 1.0, aspect_ratio: None },
            transform: DAffine3::from_translation(DVec3::new(0.0, 0.0, z)),
        };
        scene.cameras = vec![camera("far", -1e4), camera("a", 0.0), camera("b", 0.1)];
        let views = rays(&scene, &Sampling { views: 2, ..Sampling::new(100, 1) }).views;
        assert_eq!(
            views.iter().map(|v| (v.name.as_str(), v.role)).collect::<Vec<_>>(),
            [("camera `a`", Role::Choose), ("camera `b`", Role::Judge)]
        );
    }

    #[test]
    fn a_point_inside_of_an_object_has_no_room() {
        let hit = |t: f64, front: bool| Some(TrueHit { t, at: TriangleRef { instance: 0, triangle: 0 }, front });
        assert_eq!(room(&[hit(1.0, false), hit(2.0, false)]), 0.0);
        assert_eq!(room(&[hit(2.0, true), None]), 2.0);
        assert_eq!(room(&[hit(2.0, true), None, None]), 0.0);
        assert_eq!(room(&[]), 0.0);
    }

    #[test]
    fn an_error_of_the_tracer_ends_the_search() {
        let scene = test_scenes::room();
        let stage = Stage::new(scene.bounds());
        assert!(place(&scene, &stage, &|_: &[Ray]| Err::<Vec<_>, _>("lost"), 4, 1).is_err_and(|e| e == "lost"));
        let blind = |rays: &[Ray]| Ok::<_, Infallible>(vec![None; rays.len()]);
        let Ok(views) = place(&scene, &stage, &blind, 4, 1);
        assert!(views.len() == 4 && views.iter().all(|view| matches!(view.source, Source::Around)));
    }
}
