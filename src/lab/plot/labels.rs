//! Places labels beside points so that they cover neither each other nor points.
//!
//! Greedy, in the order given, over a fixed list of places around each point: the simplest of the methods compared in
//! J. Christensen, J. Marks, S. Shieber, "An Empirical Study of Algorithms for Point-Feature Label Placement", ACM
//! Transactions on Graphics 14(3), 1995.

/// A rectangle of pixels: left, top, right, bottom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Area(pub(super) [i32; 4]);

impl Area {
    /// Returns a square around a point.
    pub(super) fn around([x, y]: [i32; 2], reach: i32) -> Area {
        Area([x - reach, y - reach, x + reach, y + reach])
    }

    fn overlaps(&self, other: &Area) -> bool {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        a < g && e < c && b < h && f < d
    }

    fn is_within(&self, frame: &Area) -> bool {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, frame.0);
        a >= e && b >= f && c <= g && d <= h
    }
}

/// A label to be placed.
pub(super) struct Label {
    /// The point that it belongs to.
    pub(super) at: [i32; 2],
    /// Width and height.
    pub(super) size: [i32; 2],
}

/// Distances of labels from their points, in pixels; those beyond [`NEAR`] are joined to their points by lines.
const DISTANCES: [i32; 4] = [10, 22, 40, 64];

/// Largest distance at which a label obviously belongs to its point.
pub(super) const NEAR: i32 = 10;

/// Returns the place of each label, and its distance from the point; `None` where there is no room. `taken` is where no
/// label may lie.
pub(super) fn place(labels: &[Label], frame: &Area, mut taken: Vec<Area>) -> Vec<Option<(Area, i32)>> {
    let mut placed = Vec::with_capacity(labels.len());
    for label in labels {
        let places = DISTANCES.iter().flat_map(|&distance| around(label, distance).map(|area| (area, distance)));
        let free = |area: &Area| area.is_within(frame) && taken.iter().all(|other| !area.overlaps(other));
        let found = places.into_iter().find(|(area, _)| free(area));
        taken.extend(found.map(|(area, _)| area));
        placed.push(found);
    }
    placed
}

/// Returns the places at a distance from a point: to its right, left, above and below, then on the diagonals.
fn around(label: &Label, distance: i32) -> [Area; 8] {
    let ([x, y], [width, height]) = (label.at, label.size);
    let aside = (distance * 7 + 9) / 10;
    let corners = [
        [x + distance, y - height / 2],
        [x - distance - width, y - height / 2],
        [x - width / 2, y - distance - height],
        [x - width / 2, y + distance],
        [x + aside, y - aside - height],
        [x + aside, y + aside],
        [x - aside - width, y - aside - height],
        [x - aside - width, y + aside],
    ];
    corners.map(|[left, top]| Area([left, top, left + width, top + height]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_neighbouring_points_do_not_overlap_and_stay_in_the_frame() {
        let frame = Area([0, 0, 400, 300]);
        let points: Vec<[i32; 2]> = (0..12).map(|i| [200 + 9 * (i % 4), 150 + 7 * (i / 4)]).collect();
        let labels: Vec<Label> = points.iter().map(|&at| Label { at, size: [60, 14] }).collect();
        let taken: Vec<Area> = points.iter().map(|&at| Area::around(at, 6)).collect();
        let placed: Vec<Area> = place(&labels, &frame, taken.clone()).into_iter().flatten().map(|p| p.0).collect();
        assert!(placed.len() >= 6, "{placed:?}");
        for (i, area) in placed.iter().enumerate() {
            assert!(area.is_within(&frame) && !placed[..i].iter().chain(&taken).any(|other| area.overlaps(other)));
        }
    }

    #[test]
    fn without_room_there_is_no_label() {
        let label = Label { at: [5, 5], size: [60, 14] };
        assert_eq!(place(&[label], &Area([0, 0, 40, 40]), Vec::new()), [None]);
    }
}
