//! The passes of a bake, with their reasons in words.

use std::fmt::{self, Display, Formatter};

use serde::{Serialize, Serializer};

use super::words::{bytes, counted};
use crate::choose::{self, But, NotTimed, PassId, Reason};
use crate::copies::{Count, Looser, Saved, Sharing};
use crate::emit::Copied;

/// A step that was applied or skipped.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Pass {
    /// Which step; serialized by name.
    #[serde(rename = "name", serialize_with = "by_name")]
    pub id: PassId,
    /// Whether it changed anything.
    pub applied: bool,
    /// Why, in words.
    pub reason: String,
    /// Duration in seconds.
    pub seconds: f64,
}

fn by_name<S: Serializer>(id: &PassId, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(id.name())
}

impl From<choose::Pass> for Pass {
    fn from(pass: choose::Pass) -> Pass {
        let choose::Pass { id, applied, reason, buts, seconds } = pass;
        let reason = buts.iter().fold(words_of(id, &reason), |reason, but| reason + &words_of_but(but));
        Pass { id, applied, reason, seconds }
    }
}

impl Pass {
    /// The pass that shares copies.
    pub(crate) fn find_copies(sharing: &Sharing, seconds: f64) -> Pass {
        Pass { id: PassId::FindCopies, applied: sharing.is_applied(), reason: sharing.to_string(), seconds }
    }

    /// The pass that writes instances as copies of one node.
    pub(crate) fn instancing_extension(copied: &Copied, seconds: f64) -> Pass {
        Pass { id: PassId::InstancingExtension, applied: copied.nodes > 0, reason: copied.to_string(), seconds }
    }

    /// The pass that drops nodes that show nothing.
    pub(crate) fn prune(nodes: usize, seconds: f64) -> Pass {
        let reason = match nodes {
            0 => "every node shows something or is referred to".to_owned(),
            1 => "1 node showed nothing and nothing referred to it".to_owned(),
            n => format!("{} showed nothing and nothing referred to them", counted(n, "node")),
        };
        Pass { id: PassId::Prune, applied: nodes > 0, reason, seconds }
    }
}

impl Display for Sharing {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Sharing::NoneAlike => f.write_str("no two meshes are alike"),
            Sharing::NotLookedFor(most) => {
                write!(f, "sharing copies, if there are any, would save {} at most", bytes(*most))
            }
            Sharing::TooLoose(copies, looser) => write!(f, "{copies}, but {looser}"),
            Sharing::SavesTooLittle(saved) => {
                let Saved { shared, as_bytes, .. } = saved;
                write!(f, "{shared}, but sharing them saves only {}{}", bytes(*as_bytes), words_of_left_out(saved))
            }
            Sharing::Shared { saved, stored_bytes } => write!(
                f,
                "{}; sharing saves {} of stored geometry and {} of predicted acceleration structures{}",
                saved.shared,
                bytes(*stored_bytes),
                bytes(saved.as_bytes),
                words_of_left_out(saved)
            ),
            Sharing::InputLeftAlone(sharing) => write!(f, "{sharing}; but the input is left alone"),
            Sharing::WrittenOut(sharing) => write!(f, "{sharing}; but the layout chosen writes all of them out"),
        }
    }
}

fn words_of_left_out(saved: &Saved) -> String {
    saved.left_out.map(|(copies, looser)| format!("; {copies}, left out: with them {looser}")).unwrap_or_default()
}

impl Display for Count {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self.copies {
            1 => f.write_str("1 mesh is a copy of another"),
            copies => write!(f, "{} are copies of {}", counted(copies, "mesh"), self.models),
        }
    }
}

impl Display for Looser {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "turned boxes are looser: predicted cost {:.2} against {:.2}", self.cost, self.before)
    }
}

fn words_of(id: PassId, reason: &Reason) -> String {
    let words = match reason {
        Reason::FewFreeInstances => "fewer than two instances may be restructured",
        Reason::NoOverlap => "no two instance boxes overlap",
        Reason::OnlyApartOverlap => "only objects that enclose the rest or lie far outside overlap others",
        Reason::Overlap => "instance boxes overlap",
        Reason::NoSharedMesh => "no mesh is placed twice by instances that may be restructured",
        Reason::SharedOverlap => "instances of shared meshes overlap others",
        Reason::Loose(looseness) => {
            return format!("the boxes of triangles are {looseness:.2} times as large as they need be");
        }
        Reason::AlongAxes => "all triangles lie along the axes",
        Reason::SomeApart => "some objects enclose the rest or lie far outside",
        Reason::NoneApart => "no object encloses the scene and none lies far outside",
        Reason::OpacitiesMeet => "some triangles are opaque and some are not",
        Reason::AllOpaque => "all materials are opaque",
        Reason::OpacitiesDoNotMeet => "opaque triangles and others that may be regrouped do not meet",
        Reason::Forbidden => return format!("{} forbids it", option_against(id)),
        Reason::Timed(1) => "1 candidate was timed in turns with the input",
        Reason::Timed(n) => return format!("{} were timed in turns with the input", counted(*n, "candidate")),
        Reason::NotTimed(why) => return words_of_not_timed(why),
        Reason::Ordered => "rewritten groups are put in tree order",
        Reason::NothingToOrder => "no group is rewritten",
        Reason::Regrouped => "the layout differs from the input's",
        Reason::NotRegrouped => "the layout is the input's",
        Reason::Centred(0) => "rounding stays within the limit where the groups are stored",
        Reason::Centred(1) => "1 group is stored around its centre so that rounding stays within the limit",
        Reason::Centred(n) => {
            let groups = counted(*n, "group");
            return format!("{groups} are stored around their centres so that rounding stays within the limit");
        }
        Reason::InputLeftAlone => "the input is left alone",
    };
    words.to_owned()
}

/// The option that forbids a pass.
fn option_against(id: PassId) -> &'static str {
    match id {
        PassId::ChooseInstances => "--instances bake-or-keep",
        PassId::Frames => "--frames false",
        PassId::Isolate => "--isolate false",
        PassId::SplitOpacity => "--split-opacity false",
        other => other.name(),
    }
}

fn words_of_not_timed(why: &NotTimed) -> String {
    match why {
        NotTimed::NothingDiffers => "no candidate differs from the input".to_owned(),
        NotTimed::NoDevice => "no device traces rays: the model decides".to_owned(),
        NotTimed::NoneTaken => "the device could take no candidate: the model decides".to_owned(),
        NotTimed::Failed(why) => why.clone(),
    }
}

fn words_of_but(but: &But) -> String {
    match but {
        But::NotTried => ", but no candidate of this effort or within these bounds tries it".to_owned(),
        But::ChosenWithout => "; tried, but what was chosen does without".to_owned(),
        But::ChosenWith(plan) => format!(", but `{plan}` does it"),
    }
}
