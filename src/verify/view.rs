//! Origins of rays: the camera and the light.

use glam::{DAffine3, DMat3, DVec3};

use crate::scene::{Bounds, Camera, PlacedCamera};

/// Aspect ratio (width over height) of a view whose camera does not define it.
const ASPECT_RATIO: f64 = 16.0 / 9.0;
/// Vertical field of view of the automatic camera inside a scene, in radians.
const FIELD_INSIDE: f64 = 60.0 * std::f64::consts::PI / 180.0;
/// Vertical field of view of the automatic camera outside a scene, in radians.
const FIELD_OUTSIDE: f64 = 40.0 * std::f64::consts::PI / 180.0;

/// The size of a scene, and whether it surrounds its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// The scene's box.
    pub bounds: Bounds,
    /// The centre of the box.
    pub center: DVec3,
    /// Half the box's diagonal; never zero.
    pub radius: f64,
    /// Whether the scene is an interior: see [`super::rays::generate`].
    pub enclosed: bool,
}

impl Stage {
    /// Creates the stage for a scene's box, which must not be empty. A single point gets a radius of a thousandth of
    /// its distance from the origin.
    pub fn new(bounds: Bounds) -> Stage {
        let center = bounds.center();
        let radii = [0.5 * bounds.diagonal(), 1e-3 * center.length(), 1.0];
        let radius = radii.into_iter().find(|&r| r > 0.0).unwrap_or(1.0);
        Stage { bounds, center, radius, enclosed: false }
    }

    /// Returns a point of the area light for two numbers in [0, 1]: a horizontal square with half the extent of the
    /// box's shorter horizontal side, in an interior at nine tenths of its height, else half a radius above the box.
    pub fn light(&self, [x, z]: [f64; 2]) -> DVec3 {
        let size = self.bounds.size();
        let side = 0.5 * [size.x.min(size.z), self.radius].into_iter().find(|&s| s > 0.0).unwrap_or(1.0);
        let y = if self.enclosed { self.bounds.min.y + 0.9 * size.y } else { self.bounds.max.y + 0.5 * self.radius };
        DVec3::new(self.center.x + side * (x - 0.5), y, self.center.z + side * (z - 0.5))
    }
}

/// A camera that can generate rays.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Description of the camera.
    pub name: String,
    transform: DAffine3,
    projection: Projection,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Projection {
    /// Half the extents of the image at distance one.
    Perspective { half: [f64; 2] },
    /// Half the extents of the image.
    Parallel { half: [f64; 2] },
}

impl View {
    /// Returns the view of a camera of the file, unless it shows nothing.
    pub fn of(camera: &PlacedCamera) -> Option<View> {
        let projection = match camera.camera {
            Camera::Perspective { yfov, aspect_ratio } => {
                let half = (0.5 * yfov).tan();
                Projection::Perspective { half: [half * aspect_ratio.unwrap_or(ASPECT_RATIO), half] }
            }
            Camera::Orthographic { xmag, ymag } => Projection::Parallel { half: [xmag.abs(), ymag.abs()] },
        };
        let (Projection::Perspective { half } | Projection::Parallel { half }) = projection;
        let shows = half.iter().all(|&h| h > 0.0 && h.is_finite()) && camera.transform.matrix3.z_axis != DVec3::ZERO;
        let name = format!("camera `{}`", camera.name);
        shows.then_some(View { name, transform: camera.transform, projection })
    }

    /// Returns a view for scenes without a camera. In an interior, it looks from the centre along the longer horizontal
    /// side; otherwise from outside, in front, above and to the right, just far enough to see the whole box.
    pub fn automatic(stage: &Stage) -> View {
        if stage.enclosed {
            let size = stage.bounds.size();
            let back = if size.x > size.z { DVec3::X } else { DVec3::Z };
            return View::inside("automatic, inside".into(), stage.center, -back);
        }
        View::outside("automatic, outside".into(), &stage.bounds, DVec3::new(0.5, 0.45, 0.74), 1.0)
    }

    /// Returns an upright view from a point in a direction, which must not be zero.
    pub(super) fn inside(name: String, from: DVec3, toward: DVec3) -> View {
        View::upright(name, from, -toward.normalize(), FIELD_INSIDE)
    }

    /// Returns an upright view of a box from the direction `back`, which must not be zero. At a `nearness` of 1 the whole
    /// box is just seen, at half of it from half that distance, but never from closer than half the diagonal.
    pub(super) fn outside(name: String, bounds: &Bounds, back: DVec3, nearness: f64) -> View {
        let stage = Stage::new(*bounds);
        let view = View::upright(name, stage.center, back.normalize(), FIELD_OUTSIDE);
        let Projection::Perspective { half } = view.projection else { return view };
        let all = distance_to_see(0.5 * bounds.size(), &view.transform.matrix3, half);
        let distance = (nearness * all).max(stage.radius);
        let transform =
            DAffine3 { translation: stage.center + distance * view.transform.matrix3.z_axis, ..view.transform };
        View { transform, ..view }
    }

    /// Returns a view from a point, away from the direction `back` of length one.
    fn upright(name: String, from: DVec3, back: DVec3, field: f64) -> View {
        let right = DVec3::Y.cross(back).try_normalize().unwrap_or(DVec3::X);
        let axes = DMat3::from_cols(right, back.cross(right), back);
        let half = (0.5 * field).tan();
        View {
            name,
            transform: DAffine3 { matrix3: axes, translation: from },
            projection: Projection::Perspective { half: [half * ASPECT_RATIO, half] },
        }
    }

    /// Returns an upright, square view from a point toward another one, with a field of view in radians; `None` if the
    /// points are equal or too far apart, a number is not finite, or the field is not between 0 and a half turn.
    pub fn toward(name: String, eye: DVec3, target: DVec3, field: f64) -> Option<View> {
        let back = (eye - target).try_normalize().filter(|back| back.is_finite())?;
        let is_sound = eye.is_finite() && target.is_finite() && field > 0.0 && field < std::f64::consts::PI;
        let projection = Projection::Perspective { half: [(0.5 * field).tan(); 2] };
        is_sound.then(|| View { projection, ..View::upright(name, eye, back, field) })
    }

    /// Returns the view in a picture with another aspect ratio (width over height): it shows at least the same.
    pub fn fitted(&self, aspect_ratio: f64) -> View {
        let mut fitted = self.clone();
        let (Projection::Perspective { half } | Projection::Parallel { half }) = &mut fitted.projection;
        let [x, y] = *half;
        *half = if aspect_ratio > x / y { [y * aspect_ratio, y] } else { [x, x / aspect_ratio] };
        fitted
    }

    /// Returns camera from world: the camera looks along -z, with y up.
    pub fn to_camera(&self) -> DAffine3 {
        self.transform.inverse()
    }

    /// Returns the place in the image, from -1 to 1 rightward and upward, of a point in front of the camera, in the
    /// coordinates of [`View::to_camera`].
    pub fn project(&self, point: DVec3) -> [f64; 2] {
        match self.projection {
            Projection::Perspective { half } => [point.x / (-point.z * half[0]), point.y / (-point.z * half[1])],
            Projection::Parallel { half } => [point.x / half[0], point.y / half[1]],
        }
    }

    /// Whether distant objects look smaller.
    pub fn is_perspective(&self) -> bool {
        matches!(self.projection, Projection::Perspective { .. })
    }

    /// Returns the aspect ratio (width over height) of the image.
    pub fn aspect_ratio(&self) -> f64 {
        let (Projection::Perspective { half: [x, y] } | Projection::Parallel { half: [x, y] }) = self.projection;
        x / y
    }

    /// Returns origin and direction of the ray through a point of the image, from -1 to 1 rightward and upward.
    pub fn ray(&self, [x, y]: [f64; 2]) -> (DVec3, DVec3) {
        let ahead = DVec3::NEG_Z;
        let (origin, direction) = match self.projection {
            Projection::Perspective { half } => (DVec3::ZERO, DVec3::new(x * half[0], y * half[1], -1.0)),
            Projection::Parallel { half } => (DVec3::new(x * half[0], y * half[1], 0.0), ahead),
        };
        (self.transform.transform_point3(origin), self.transform.transform_vector3(direction))
    }
}

/// Distance from the centre of a box, given half its size, at which a camera with these axes sees all corners.
fn distance_to_see(half_size: DVec3, axes: &DMat3, half: [f64; 2]) -> f64 {
    let signs = |i: u32| DVec3::from_array([1, 2, 4].map(|bit| if i & bit != 0 { 1.0 } else { -1.0 }));
    let corners = (0..8).map(|i| axes.transpose() * (half_size * signs(i)));
    corners.map(|c| c.z + (c.x.abs() / half[0]).max(c.y.abs() / half[1])).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_stage(enclosed: bool) -> Stage {
        Stage { enclosed, ..Stage::new(Bounds { min: DVec3::ZERO, max: DVec3::new(1.0, 1.0, 2.0) }) }
    }

    #[test]
    fn a_scene_in_one_point_has_a_radius() {
        let point = |p: DVec3| Stage::new(Bounds { min: p, max: p }).radius;
        assert_eq!(point(DVec3::ZERO), 1.0);
        assert_eq!(point(DVec3::X * 1000.0), 1.0);
    }

    #[test]
    fn the_outside_view_looks_at_the_middle_and_just_sees_all_corners() {
        let stage = unit_stage(false);
        let view = View::automatic(&stage);
        let (origin, direction) = view.ray([0.0, 0.0]);
        assert!(direction.normalize().distance((stage.center - origin).normalize()) < 1e-12);
        let to_view = view.transform.inverse();
        let in_picture = (0..8).map(|i| {
            let corner = DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2) * 2.0);
            let p = to_view.transform_point3(corner);
            (p.x / (-p.z * view.aspect_ratio())).abs().max((p.y / -p.z).abs()) / (0.5 * FIELD_OUTSIDE).tan()
        });
        assert!((in_picture.fold(0.0, f64::max) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_inside_view_stands_in_the_middle_and_is_upright() {
        let view = View::automatic(&unit_stage(true));
        assert_eq!(view.ray([0.0, 0.0]), (DVec3::new(0.5, 0.5, 1.0), DVec3::NEG_Z));
        assert!(view.ray([0.0, 1.0]).1.y > 0.0 && view.ray([1.0, 0.0]).1.x > 0.0);
    }

    #[test]
    fn cameras_that_show_nothing_are_no_views() {
        let camera = |camera, transform| View::of(&PlacedCamera { name: String::new(), camera, transform });
        let parallel = Camera::Orthographic { xmag: 2.0, ymag: -1.0 };
        let view = camera(parallel, DAffine3::IDENTITY).expect("shows something");
        assert_eq!(view.ray([0.5, 1.0]), (DVec3::new(1.0, 1.0, 0.0), DVec3::NEG_Z));
        assert!(camera(Camera::Orthographic { xmag: 0.0, ymag: 1.0 }, DAffine3::IDENTITY).is_none());
        assert!(camera(parallel, DAffine3::from_scale(DVec3::ZERO)).is_none());
        let wide = Camera::Perspective { yfov: f64::NAN, aspect_ratio: None };
        assert!(camera(wide, DAffine3::IDENTITY).is_none());
    }
}
