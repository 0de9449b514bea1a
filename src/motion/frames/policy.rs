//! When a TLAS is rebuilt.

use std::fmt;

use serde::{Serialize, Serializer};

use crate::verify::frames::Upkeep;

/// When a TLAS is rebuilt; it is refitted in all other frames. It is always built in the first frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RebuildEvery {
    /// In each frame whose number is a multiple of this; 0 and 1 both mean each frame.
    Frames(u32),
    /// In no frame but the first.
    Never,
}

impl RebuildEvery {
    /// Returns what is done in a frame.
    pub fn upkeep(self, frame: u32) -> Upkeep {
        if self.last_rebuild(frame) == frame { Upkeep::Rebuild } else { Upkeep::Refit }
    }

    /// Returns the last frame up to this one in which the TLAS was rebuilt.
    pub fn last_rebuild(self, frame: u32) -> u32 {
        match self {
            RebuildEvery::Frames(every) => frame - frame % every.max(1),
            RebuildEvery::Never => 0,
        }
    }
}

impl fmt::Display for RebuildEvery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RebuildEvery::Frames(every) => write!(f, "{every}"),
            RebuildEvery::Never => f.write_str("never"),
        }
    }
}

impl Serialize for RebuildEvery {
    /// As a number, or `never`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            RebuildEvery::Frames(every) => serializer.serialize_u32(*every),
            RebuildEvery::Never => serializer.serialize_str("never"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tlas_is_rebuilt_in_every_nth_frame_and_refitted_in_between() {
        let rebuilt =
            |policy: RebuildEvery| (0..9).filter(|&f| policy.upkeep(f) == Upkeep::Rebuild).collect::<Vec<u32>>();
        assert_eq!(rebuilt(RebuildEvery::Frames(4)), [0, 4, 8]);
        assert_eq!(rebuilt(RebuildEvery::Never), [0]);
        assert_eq!(rebuilt(RebuildEvery::Frames(1)).len(), 9);
        assert_eq!((RebuildEvery::Frames(4).last_rebuild(7), RebuildEvery::Never.last_rebuild(7)), (4, 0));
        assert_eq!(rebuilt(RebuildEvery::Frames(0)).len(), 9);
    }
}
