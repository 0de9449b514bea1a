//! The trials of the experiments: a method with its parameters each.

use super::numbers::{CHOSEN, NODE_RATIOS, SKIP_THRESHOLDS, SOM_THRESHOLDS};
use crate::choose::Choice;
use crate::lab::bench::{PictureSetup, Setup};
use crate::methods::{Method, OverlapRule};

/// A method with the parameters that an experiment varies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Trial {
    /// One BLAS ("Single GAS").
    Single,
    /// One BLAS per object ("Multi GAS").
    PerObject,
    /// Binned SAH with this ratio of nodes to triangles.
    Bvh(f64),
    /// Overlap reduction by the thesis's rule, with this skip threshold and this split-or-merge threshold.
    Overlap { skip: f64, som: f64 },
    /// The same thresholds by the rule of this program.
    Improved { skip: f64, som: f64 },
    /// What `bake` chooses.
    Auto,
}

impl Trial {
    /// The methods that the last experiment compares, those of the thesis first.
    pub(super) const COMPARED: [Trial; 6] = {
        let (nodes, skip, som) = CHOSEN;
        let reduced = [Trial::Overlap { skip, som }, Trial::Improved { skip, som }];
        [Trial::Single, Trial::PerObject, Trial::Bvh(nodes), reduced[0], reduced[1], Trial::Auto]
    };

    /// How many of these are the thesis's.
    pub(super) const OF_THESIS: usize = 4;

    /// All trials of all experiments, each once.
    pub(super) fn all() -> Vec<Trial> {
        let (_, skip, som) = CHOSEN;
        let of_nodes = NODE_RATIOS.map(Trial::Bvh);
        let of_skip = SKIP_THRESHOLDS.map(|skip| Trial::Overlap { skip, som });
        let of_som = SOM_THRESHOLDS.map(|som| Trial::Overlap { skip, som });
        let mut all = Trial::COMPARED.to_vec();
        for trial in of_nodes.into_iter().chain(of_skip).chain(of_som) {
            if !all.contains(&trial) {
                all.push(trial);
            }
        }
        all
    }

    /// Returns the name in tables and figures.
    pub(super) fn name(self) -> String {
        match self {
            Trial::Single => "single BLAS".into(),
            Trial::PerObject => "BLAS per object".into(),
            Trial::Bvh(ratio) => format!("bvh {}", power(ratio)),
            Trial::Overlap { skip, som } => format!("overlap, skip {skip}, SoM {som}"),
            Trial::Improved { .. } => "overlap (raykiln)".into(),
            Trial::Auto => "auto (raykiln)".into(),
        }
    }

    /// Returns the environment that runs it.
    pub(super) fn setup(self, picture: PictureSetup) -> Setup {
        let mut setup = Setup::with(match self {
            Trial::Single => Choice::Method(Method::Single),
            Trial::PerObject => Choice::Method(Method::PerObject),
            Trial::Bvh(_) => Choice::Method(Method::Bvh),
            Trial::Overlap { .. } | Trial::Improved { .. } => Choice::Method(Method::Overlap),
            Trial::Auto => Choice::Auto,
        });
        let layout = &mut setup.bake.choose.layout;
        match self {
            Trial::Bvh(ratio) => layout.bvh.nodes_per_triangle_ratio = ratio,
            Trial::Overlap { skip, som } | Trial::Improved { skip, som } => {
                layout.overlap.rule = match self {
                    Trial::Improved { .. } => OverlapRule::Improved,
                    _ => OverlapRule::Thesis,
                };
                layout.overlap.skip_overlap_ratio = skip;
                layout.overlap.split_or_merge_ratio = som;
                layout.overlap.split_ratio = 0.5 * som;
            }
            Trial::Single | Trial::PerObject | Trial::Auto => {}
        }
        Setup { name: self.name(), picture, ..setup }
    }
}

/// Returns a power of ten as such.
fn power(x: f64) -> String {
    format!("{x:e}").replace("1e", "10^")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_of_the_thesis_is_tried_once() {
        let all = Trial::all();
        // Four ratios, six and seven thresholds, one of them shared; and four other methods.
        assert_eq!(all.len(), 4 + 6 + 7 - 1 + 4);
        let mut names: Vec<String> = all.iter().map(|trial| trial.name()).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), all.len());
        assert!(names.contains(&"bvh 10^-3".to_owned()), "{names:?}");
    }
}
