//! The size of the files of a bake, and how the output is compressed.

use serde::Serialize;

use super::BakeReport;
use super::words::bytes;

/// How an output is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum OutputCompression {
    /// Not at all.
    None,
    /// By `EXT_meshopt_compression`, without loss.
    Meshopt,
    /// As the input, whose bytes it has.
    Input,
}

/// Says what the files take.
pub(super) fn words(report: &BakeReport) -> String {
    let output = bytes(report.output_bytes);
    let input = report.input.bytes.map(|size| format!("; the input has {}", bytes(size))).unwrap_or_default();
    match report.output_compression {
        OutputCompression::Input => format!("file: {output}, the bytes of the input\n"),
        OutputCompression::None => {
            format!("file: {output}, uncompressed{input} (--compress meshopt compresses without loss)\n")
        }
        OutputCompression::Meshopt => format!("file: {output}, compressed without loss{input}\n"),
    }
}
