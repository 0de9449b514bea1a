//! Notes on the plans chosen, with reasons.

use super::choose::{Candidate, Candidates};
use super::plan::Plan;
use crate::layout::{Changed, Meshes, Note, Stay};
use crate::scene::Scene;

/// Maximum number of meshes listed by name.
const MOST_NAMED: usize = 16;

impl Candidates {
    /// Returns notes on the plan chosen for each mesh, with reasons. `allowed` is the number of bytes allowed beyond
    /// the input's.
    pub(super) fn notes(&self, scene: &Scene, plans: &[Plan], allowed: f64) -> Vec<Note> {
        if self.are_apart {
            let instances: usize = self.meshes.iter().map(|m| m.instances.len()).sum();
            return vec![Note::Stay { of: Meshes::All, instances, why: Stay::Apart }];
        }
        let kept: Vec<usize> = (0..plans.len()).filter(|&m| plans[m].keeps()).collect();
        let changed: Vec<usize> = (0..plans.len()).filter(|&m| !plans[m].keeps()).collect();
        let note = |&m: &usize| Note::Changed(self.meshes[m].changed(scene, &plans[m]));
        let mut notes: Vec<Note> = changed.iter().take(MOST_NAMED).map(note).collect();
        if changed.len() > MOST_NAMED {
            notes.push(Note::ChangedLikewise(changed.len() - MOST_NAMED));
        }
        notes.extend(self.kept_note(scene, &kept, allowed));
        notes
    }

    /// Returns notes on why some meshes stay instanced.
    fn kept_note(&self, scene: &Scene, kept: &[usize], allowed: f64) -> Vec<Note> {
        let unlimited = self.choose(f64::INFINITY);
        let bytes = Stay::Bytes { allowed: allowed.max(0.0) };
        let why = |mesh: usize| match &self.meshes[mesh].looked_at {
            None => Stay::Rare,
            Some(_) if !unlimited[mesh].keeps() => bytes,
            Some(_) => Stay::NoGain,
        };
        let of_kind = |kind: Stay| -> Option<Note> {
            let meshes: Vec<&Candidate> = kept.iter().filter(|&&m| why(m) == kind).map(|&m| &self.meshes[m]).collect();
            let instances: usize = meshes.iter().map(|m| m.instances.len()).sum();
            let of = match meshes.as_slice() {
                [] => return None,
                [one] => Meshes::One(scene.meshes[one.id.0 as usize].name.clone()),
                several => Meshes::Several(several.len()),
            };
            Some(Note::Stay { of, instances, why: kind })
        };
        [Stay::Rare, bytes, Stay::NoGain].into_iter().filter_map(of_kind).collect()
    }
}

impl Candidate {
    fn changed(&self, scene: &Scene, plan: &Plan) -> Changed {
        let mut changed = Changed {
            mesh: scene.meshes[self.id.0 as usize].name.clone(),
            baked: 0,
            opened: 0,
            pieces: 0,
            kept: 0,
            boxes_per_ray: 0.0,
            cost_ratio: plan.cost / self.plans[0].cost,
        };
        if let Some(found) = &self.looked_at {
            let mesh = &found.mesh;
            let count = |of: std::ops::Range<usize>| mesh.order[of].iter().map(|&n| mesh.nodes[n].len()).sum::<usize>();
            changed.baked = count(0..plan.baked);
            changed.opened = count(plan.baked..plan.baked + plan.opened);
            changed.pieces = mesh.pieces[plan.level].len();
            changed.kept = self.instances.len() - changed.baked - changed.opened;
            let entries: f64 = mesh.tally.levels[0].iter().map(|c| c.entries).sum();
            changed.boxes_per_ray = entries / mesh.tally.met as f64;
        }
        changed
    }
}
