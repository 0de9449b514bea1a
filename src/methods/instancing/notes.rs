//! What was chosen, in words.

use super::choose::{Candidate, Candidates};
use super::plan::Plan;
use crate::scene::Scene;
use crate::words::counted;

/// Meshes named one by one.
const MOST_NAMED: usize = 16;

impl Candidates {
    /// What was chosen for which mesh, and why. `allowed` are the bytes allowed over the input's.
    pub(super) fn notes(&self, scene: &Scene, plans: &[Plan], allowed: f64) -> Vec<String> {
        if let Some(why) = self.idle {
            let instances: usize = self.meshes.iter().map(|m| m.instances.len()).sum();
            return vec![format!("{} stay: {why}", counted(instances, "instance"))];
        }
        let kept: Vec<usize> = (0..plans.len()).filter(|&m| plans[m].keeps()).collect();
        let changed: Vec<usize> = (0..plans.len()).filter(|&m| !plans[m].keeps()).collect();
        let mut notes: Vec<String> =
            changed.iter().take(MOST_NAMED).map(|&m| self.meshes[m].change_note(scene, &plans[m])).collect();
        if changed.len() > MOST_NAMED {
            notes.push(format!("instances of {} likewise", counted(changed.len() - MOST_NAMED, "further mesh")));
        }
        notes.extend(self.kept_note(scene, &kept, allowed));
        notes
    }

    /// Why some meshes stay instanced.
    fn kept_note(&self, scene: &Scene, kept: &[usize], allowed: f64) -> Vec<String> {
        let unlimited = self.choose(f64::INFINITY);
        let of_kind = |kind: Why| -> Option<String> {
            let meshes: Vec<&Candidate> =
                kept.iter().filter(|&&m| self.why(m, &unlimited[m]) == kind).map(|&m| &self.meshes[m]).collect();
            let instances: usize = meshes.iter().map(|m| m.instances.len()).sum();
            let whose = match meshes.as_slice() {
                [] => return None,
                [one] => format!("`{}`", scene.meshes[one.id.0 as usize].name),
                several => counted(several.len(), "mesh"),
            };
            Some(format!("{whose}: {} stay: {}", counted(instances, "instance"), kind.words(allowed)))
        };
        [Why::Rare, Why::Bytes, Why::NoGain].into_iter().filter_map(of_kind).collect()
    }

    fn why(&self, mesh: usize, unlimited: &Plan) -> Why {
        match &self.meshes[mesh].looked_at {
            None => Why::Rare,
            Some(_) if !unlimited.keeps() => Why::Bytes,
            Some(_) => Why::NoGain,
        }
    }
}

/// Why the instances of a mesh stay.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Why {
    Rare,
    Bytes,
    NoGain,
}

impl Why {
    fn words(self, allowed: f64) -> String {
        match self {
            Why::Rare => "too few rays meet them to tell what would pay".to_owned(),
            Why::Bytes => {
                format!("more than the {:.0} bytes allowed beyond the input's would be needed", allowed.max(0.0))
            }
            Why::NoGain => "neither opening nor baking them is predicted to gain enough".to_owned(),
        }
    }
}

impl Candidate {
    fn change_note(&self, scene: &Scene, plan: &Plan) -> String {
        let name = &scene.meshes[self.id.0 as usize].name;
        let (mut parts, mut overlap) = (Vec::new(), 0.0);
        if let Some(found) = &self.looked_at {
            let mesh = &found.mesh;
            let baked: usize = mesh.order[..plan.baked].iter().map(|&n| mesh.nodes[n].len()).sum();
            let opened: usize =
                mesh.order[plan.baked..plan.baked + plan.opened].iter().map(|&n| mesh.nodes[n].len()).sum();
            let kept = self.instances.len() - baked - opened;
            if baked > 0 {
                parts.push(format!("{} baked", counted(baked, "instance")));
            }
            if opened > 0 {
                parts.push(match mesh.pieces[plan.level].len() {
                    1 => format!("{} stored in a frame that fits the mesh", counted(opened, "instance")),
                    pieces => format!("{} opened into {pieces} pieces", counted(opened, "instance")),
                });
            }
            if kept > 0 {
                parts.push(format!("{} kept", counted(kept, "instance")));
            }
            let entries: f64 = mesh.tally.levels[0].iter().map(|c| c.entries).sum();
            overlap = entries / mesh.tally.met as f64;
        }
        let gain = 100.0 * (1.0 - plan.cost / self.plans[0].cost);
        format!(
            "`{name}`: {}: a ray that meets them enters {overlap:.1} of their boxes before it ends; predicted to cost \
             {gain:.0} % less",
            parts.join(", ")
        )
    }
}
