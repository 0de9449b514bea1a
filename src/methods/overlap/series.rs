//! What each round costs: the two-level cost of its bodies, each of whose trees is built once.

use glam::DVec3;

use super::Body;
use crate::cost::sah::FaceAreas;
use crate::cost::two_level::TwoLevelCost;
use crate::methods::pieces::{Piece, Pieces};
use crate::parallel;
use crate::scene::Bounds;
use crate::tree::{Quality, Tree};

/// The SAH cost and the two-level cost of one state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Costs {
    pub(super) sah: f64,
    pub(super) two_level: f64,
}

/// The trees' costs of all bodies so far.
#[derive(Default)]
pub(super) struct Series {
    /// By body; `None`: not computed yet.
    areas: Vec<Option<FaceAreas>>,
}

impl Series {
    /// Returns the costs of a state, relative to the box of the scene. Of instances that stay as they are, only the boxes
    /// count.
    pub(super) fn costs(&mut self, pieces: &Pieces, bodies: &[Body], live: &[usize], scene_area: f64) -> Costs {
        self.areas.resize(bodies.len(), None);
        let new: Vec<usize> = live.iter().copied().filter(|&body| self.areas[body].is_none()).collect();
        let found = parallel::map_each(&new, &|&body| areas_of(pieces, &bodies[body].pieces));
        new.into_iter().zip(found).for_each(|(body, areas)| self.areas[body] = Some(areas));
        let boxes: Vec<Bounds> =
            live.iter().map(|&body| bodies[body].bounds).chain(pieces.others.iter().copied()).collect();
        let top = Tree::build_usable(&boxes, Quality::Instances);
        let around = top.bounds(&boxes);
        let inner = top.nodes.iter().zip(&around).filter(|(node, _)| !node.is_leaf()).map(|(_, b)| b.area());
        let areas = live.iter().map(|&body| self.areas[body].unwrap_or_default());
        let areas = areas.chain(std::iter::repeat_n(FaceAreas::default(), pieces.others.len()));
        let placed = boxes
            .iter()
            .zip(areas)
            .map(|(b, areas)| TwoLevelCost::of_placement(b.area(), &areas, &glam::DMat3::IDENTITY));
        let sum = TwoLevelCost::sum(inner, placed);
        Costs { sah: sum.flat_cost(scene_area), two_level: sum.cost(scene_area) }
    }
}

/// Returns the areas of the nodes of the tree over a body.
fn areas_of(pieces: &Pieces, of: &[Piece]) -> FaceAreas {
    let boxes: Vec<Bounds> = of.iter().flat_map(|&piece| pieces.boxes(piece)).collect();
    let tree = Tree::build_usable(&boxes, Quality::Medium);
    let areas = FaceAreas::of(&tree, &tree.bounds(&boxes));
    if areas.cost(DVec3::ONE).is_finite() { areas } else { FaceAreas::default() }
}
