//! What a bake does to the size of acceleration structures: a gain, or a loss, beside that of speed.

use serde::Serialize;

use super::words::bytes;
use crate::cost::Metrics;
use crate::verify::Sides;

/// Sizes that differ by less than this share of the input's count as equal.
const SAME: f64 = 0.01;

/// Predicted size of the acceleration structures of input and output.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Size {
    /// Bytes of BLASes and TLAS.
    pub as_bytes: Sides<u64>,
    /// Bytes of the output over those of the input; 1 if both are 0.
    pub ratio: f64,
    /// Whether that is a gain.
    pub verdict: SizeVerdict,
}

/// Whether the acceleration structures became smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SizeVerdict {
    /// By more than a hundredth.
    Smaller,
    /// Neither.
    Same,
    /// By more than a hundredth.
    Larger,
}

impl Size {
    /// Compares two layouts.
    pub(crate) fn of(before: &Metrics, after: &Metrics) -> Size {
        let as_bytes = Sides { before: before.as_bytes(), after: after.as_bytes() };
        let ratio = if as_bytes.before > 0 { as_bytes.after as f64 / as_bytes.before as f64 } else { 1.0 };
        let verdict = match ratio {
            _ if ratio < 1.0 - SAME => SizeVerdict::Smaller,
            _ if ratio > 1.0 + SAME => SizeVerdict::Larger,
            _ => SizeVerdict::Same,
        };
        Size { as_bytes, ratio, verdict }
    }

    /// States a gain or a loss; nothing if there is none, or if the output is the input.
    pub(crate) fn words(&self, unchanged: bool) -> Option<String> {
        let Sides { before, after } = self.as_bytes.map(bytes);
        let what = match self.verdict {
            SizeVerdict::Smaller => "smaller",
            SizeVerdict::Larger => "LARGER",
            SizeVerdict::Same => return None,
        };
        let times = self.ratio;
        (!unchanged).then(|| {
            format!("{what}: acceleration structures of {after}, not {before}, as predicted ({times:.2} times)")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(before: u64, after: u64) -> Size {
        let metrics = |blas_bytes| Metrics { blas_bytes, ..Metrics::default() };
        Size::of(&metrics(before), &metrics(after))
    }

    #[test]
    fn smaller_and_larger_are_said() {
        let smaller = size(4096, 1024);
        assert_eq!((smaller.verdict, smaller.ratio), (SizeVerdict::Smaller, 0.25));
        let words = "smaller: acceleration structures of 1.0 KiB, not 4.0 KiB, as predicted (0.25 times)";
        assert_eq!(smaller.words(false).as_deref(), Some(words));
        assert!(size(1024, 4096).words(false).is_some_and(|words| words.starts_with("LARGER")));
    }

    #[test]
    fn what_is_as_large_or_left_alone_needs_no_words() {
        assert_eq!(size(1000, 1005).words(false), None);
        assert_eq!(size(0, 0).verdict, SizeVerdict::Same);
        assert_eq!(size(4096, 1024).words(true), None);
    }
}
