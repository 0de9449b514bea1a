//! Errors of positions and hits as text.

use std::fmt::Write;

use crate::verify::errors::{ErrorReport, ErrorSizes};
use crate::verify::sight::DeviceError;

/// The errors of a verification, over the scene and over the object with the largest ratio, and the group whose hits may
/// be off farthest, beside the bound.
pub(super) fn errors(errors: &ErrorReport) -> String {
    let mut text = String::new();
    if let Some(position) = &errors.position {
        let _ = writeln!(text, "position error: {}", sizes(position));
    }
    let _ = writeln!(text, "distance error: {}", sizes(&errors.distance.after));
    if let Some(worst) = errors.worst_groups.first() {
        let _ = writeln!(
            text,
            "bound: hits of `{}` are off their triangles by at most {:.1e}, and may be by {:.1e}; its positions may be off by \
             {:.1e}",
            worst.name, worst.hit_error, worst.hit_error_bound, worst.position_error_bound
        );
    }
    text
}

/// What single precision may do to rays in a scene.
pub(super) fn of_device(error: &DeviceError) -> String {
    let bound = &error.bound;
    let cannot_tell = if error.cannot_tell.is_nothing() { String::new() } else { format!("; {}", error.cannot_tell) };
    format!("error of rays as long as the scene: {}{cannot_tell}", sizes(bound))
}

fn sizes(error: &ErrorSizes) -> String {
    match &error.object {
        None => "none".to_owned(),
        Some(object) => format!(
            "at most {:.1e} of the scene's diagonal, {:.1e} of an object's, `{object}`",
            error.ratio_of_scene, error.ratio_of_object
        ),
    }
}
