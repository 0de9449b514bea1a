//! Cameras: of the file, given by numbers, or placed by the scene.

use std::f64::consts::PI;
use std::str::FromStr;

use glam::DVec3;
use rustc_hash::FxHashSet;

use super::{Renderer, SEED};
use crate::scene::{InstanceId, Scene};
use crate::verify::cpu::{Reference, TrueHit};
use crate::verify::rays::Ray;
use crate::verify::view::View as Sight;
use crate::verify::views::viewpoints;

/// A camera in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    pub(super) sight: Sight,
}

impl Camera {
    /// Returns the description.
    pub fn name(&self) -> &str {
        &self.sight.name
    }

    /// Returns the camera that sees what a view does.
    #[cfg(feature = "lab")]
    pub(crate) fn of(sight: Sight) -> Camera {
        Camera { sight }
    }

    /// Returns what it sees.
    #[cfg(feature = "lab")]
    pub(crate) fn view(&self) -> &Sight {
        &self.sight
    }
}

/// Which camera to take.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum CameraChoice {
    /// The first of the file that shows something, or else the automatic one.
    #[default]
    Default,
    /// The viewpoint from which most is seen.
    Automatic,
    /// A camera of the file, by its number from 0 or else its name.
    OfFile(String),
    /// An upright camera.
    At {
        /// Where it stands.
        eye: DVec3,
        /// A point in the middle of the picture.
        target: DVec3,
        /// Field of view across the shorter side of the picture, in degrees.
        field_degrees: f64,
    },
}

/// Why there is no such camera.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BadCamera {
    /// A text with commas that is not seven numbers.
    #[error("--camera takes seven finite numbers, EX,EY,EZ,TX,TY,TZ,FOV, not `{0}`")]
    Numbers(String),
    /// A camera that shows nothing.
    #[error("the camera looks nowhere: eye and target are the same point")]
    Nowhere,
    /// A field of view out of range.
    #[error("a field of view of {0} degrees: it must be above 0 and below 180")]
    Field(String),
    /// No camera has that number or name.
    #[error("the file has no camera `{wanted}` that shows something; {}", listed(.known))]
    Unknown {
        /// What was asked for.
        wanted: String,
        /// The names of the file's cameras.
        known: Vec<String>,
    },
}

fn listed(known: &[String]) -> String {
    if known.is_empty() { "it has none at all".into() } else { format!("its cameras: {}", known.join(", ")) }
}

impl FromStr for CameraChoice {
    type Err = BadCamera;

    /// Reads `auto`, seven numbers with commas between them, or else a number or name of a camera.
    fn from_str(text: &str) -> Result<CameraChoice, BadCamera> {
        if text == "auto" {
            return Ok(CameraChoice::Automatic);
        }
        if !text.contains(',') {
            return Ok(CameraChoice::OfFile(text.to_owned()));
        }
        let number = |part: &str| part.trim().parse().ok().filter(|x: &f64| x.is_finite());
        let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
        let Some([a, b, c, d, e, f, field_degrees]) = numbers.and_then(|n| <[f64; 7]>::try_from(n).ok()) else {
            return Err(BadCamera::Numbers(text.to_owned()));
        };
        Ok(CameraChoice::At { eye: DVec3::new(a, b, c), target: DVec3::new(d, e, f), field_degrees })
    }
}

/// Number of viewpoints that the automatic camera is chosen from, besides the one in the middle.
const TRIED: usize = 12;
/// Worth of the one in the middle, over that of another one that shows as much: it shows the whole of what it shows.
const PREFERENCE: f64 = 1.4;
/// Columns and rows of rays by which a viewpoint is judged.
const GRID: [usize; 2] = [24, 14];

impl Renderer<'_> {
    /// Returns the camera of a choice.
    ///
    /// # Errors
    /// Why there is no such camera.
    pub fn camera(&self, choice: &CameraChoice) -> Result<Camera, BadCamera> {
        match choice {
            CameraChoice::Default => Ok(self.cameras_of_file().next().unwrap_or_else(|| self.best())),
            CameraChoice::Automatic => Ok(self.best()),
            CameraChoice::OfFile(wanted) => of_file(self.scene, wanted),
            CameraChoice::At { eye, target, field_degrees } => at(*eye, *target, *field_degrees),
        }
    }

    /// Returns up to `count` cameras: those of the file that show something, then automatic ones, best first.
    pub fn cameras(&self, count: usize) -> Vec<Camera> {
        let mut cameras: Vec<Camera> = self.cameras_of_file().take(count).collect();
        if cameras.len() < count {
            cameras.extend(self.automatic_cameras());
            cameras.truncate(count);
        }
        cameras
    }

    /// Returns viewpoints that the scene places in and around it, those from which most is seen first.
    pub fn automatic_cameras(&self) -> Vec<Camera> {
        let reference = Reference::new(&self.accel);
        let closest = |rays: &[Ray]| reference.closest(rays);
        let placed = viewpoints(self.scene, &self.stage, &closest, TRIED, SEED);
        let rated = |(i, sight): (usize, Sight)| {
            let preference = if i == 0 { PREFERENCE } else { 1.0 };
            (preference * self.worth(&sight, &reference), sight)
        };
        let mut rated: Vec<(f64, Sight)> = placed.into_iter().enumerate().map(rated).collect();
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        rated.into_iter().map(|(_, sight)| Camera { sight }).collect()
    }

    fn best(&self) -> Camera {
        self.automatic_cameras().swap_remove(0)
    }

    fn cameras_of_file(&self) -> impl Iterator<Item = Camera> {
        self.scene.cameras.iter().filter_map(Sight::of).map(|sight| Camera { sight })
    }

    /// How much a viewpoint shows: more for more of its picture that shows something, for more objects, and for fronts
    /// that are not near.
    fn worth(&self, sight: &Sight, reference: &Reference) -> f64 {
        let [columns, rows] = GRID;
        let ray = |i: usize| {
            let place = [(i % columns, columns), (i / columns, rows)].map(|(at, of)| (2 * at + 1) as f64 / of as f64);
            let (origin, direction) = sight.ray([place[0] - 1.0, 1.0 - place[1]]);
            Ray::endless(origin, direction)
        };
        let rays: Vec<Ray> = (0..columns * rows).map(ray).collect();
        let hits: Vec<TrueHit> = reference.closest(&rays).into_iter().flatten().collect();
        let count = hits.len().max(1) as f64;
        let front = hits.iter().filter(|hit| hit.front).count() as f64 / count;
        let near = hits.iter().filter(|hit| hit.t < 0.1 * self.stage.radius).count() as f64 / count;
        let seen = hits.len() as f64 / rays.len() as f64;
        seen.sqrt() * (1.0 + objects_of(self.scene, &hits) as f64).ln() * (0.5 + front) * (1.0 - 0.8 * near)
    }
}

/// Number of objects that are hit.
fn objects_of(scene: &Scene, hits: &[TrueHit]) -> usize {
    let object = |hit: &TrueHit| {
        let mesh = scene.mesh_of(InstanceId(hit.at.instance));
        (hit.at.instance, mesh.locate(hit.at.triangle).0)
    };
    hits.iter().map(object).collect::<FxHashSet<_>>().len()
}

fn of_file(scene: &Scene, wanted: &str) -> Result<Camera, BadCamera> {
    let by_number = wanted.parse().ok().and_then(|number: usize| scene.cameras.get(number));
    let found = by_number.or_else(|| scene.cameras.iter().find(|camera| camera.name == wanted));
    found.and_then(Sight::of).map(|sight| Camera { sight }).ok_or_else(|| BadCamera::Unknown {
        wanted: wanted.to_owned(),
        known: scene.cameras.iter().map(|camera| format!("`{}`", camera.name)).collect(),
    })
}

fn at(eye: DVec3, target: DVec3, field_degrees: f64) -> Result<Camera, BadCamera> {
    let field = field_degrees.to_radians();
    if !(field > 0.0 && field < PI) {
        return Err(BadCamera::Field(field_degrees.to_string()));
    }
    let name = format!("from {eye} to {target}, {field_degrees} degrees");
    Sight::toward(name, eye, target, field).map(|sight| Camera { sight }).ok_or(BadCamera::Nowhere)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_read_by_what_they_look_like() {
        let read = |text: &str| text.parse::<CameraChoice>();
        assert_eq!(read("auto"), Ok(CameraChoice::Automatic));
        assert_eq!(read("2"), Ok(CameraChoice::OfFile("2".into())));
        let (eye, target) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4.0, 5.0, 0.5));
        assert_eq!(read("1,2,3, -4,5,.5,60"), Ok(CameraChoice::At { eye, target, field_degrees: 60.0 }));
        for bad in ["1,2,3", "1,2,3,4,5,6,x", "1,2,3,4,5,6,NaN", "inf,2,3,4,5,6,7", "1,2,3,4,5,6,7,8", ","] {
            assert_eq!(read(bad), Err(BadCamera::Numbers(bad.into())));
        }
    }

    #[test]
    fn cameras_that_show_nothing_are_refused() {
        assert_eq!(at(DVec3::ONE, DVec3::ONE, 60.0), Err(BadCamera::Nowhere));
        for field in [0.0, 180.0, -1.0, f64::NAN] {
            assert!(matches!(at(DVec3::ZERO, DVec3::ONE, field), Err(BadCamera::Field(_))));
        }
        assert!(at(DVec3::ZERO, DVec3::ONE, 179.0).is_ok());
    }
}
