//! URIs of buffers and images: data URIs and file names.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};

/// The parsed form of a URI.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Uri<'u> {
    /// A data URI: media type and encoded payload.
    Data { media: &'u str, base64: bool, payload: &'u str },
    /// A file name, decoded; relative names start at the scene file's folder.
    File(Cow<'u, str>),
    /// An unsupported scheme, such as `https`.
    Scheme(&'u str),
    /// Not a URI.
    Malformed(&'static str),
}

/// Parses a URI.
pub(super) fn parse(uri: &str) -> Uri<'_> {
    match scheme(uri) {
        Some(s) if s.eq_ignore_ascii_case("data") => data(&uri[s.len() + 1..]),
        Some(s) => Uri::Scheme(s),
        None => match percent_decode_str(uri).decode_utf8() {
            Ok(name) if name.is_empty() => Uri::Malformed("the URI is empty"),
            Ok(name) if name.contains('\0') => Uri::Malformed("the file name holds a zero byte"),
            Ok(name) => Uri::File(name),
            Err(_) => Uri::Malformed("the file name is not UTF-8"),
        },
    }
}

/// Returns the scheme as defined by RFC 3986 (T. Berners-Lee, R. Fielding, L. Masinter, "Uniform Resource Identifier:
/// Generic Syntax", 2005).
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let inner = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
    (scheme.starts_with(|c: char| c.is_ascii_alphabetic()) && scheme.chars().all(inner)).then_some(scheme)
}

fn data(rest: &str) -> Uri<'_> {
    let Some((head, payload)) = rest.split_once(',') else {
        return Uri::Malformed("the data URI has no comma");
    };
    // The comparison ignores case (L. Masinter, "The data URL scheme", RFC 2397, 1998).
    let end = head.len().saturating_sub(";base64".len());
    let (head, base64) = match head.get(end..) {
        Some(last) if last.eq_ignore_ascii_case(";base64") => (&head[..end], true),
        _ => (head, false),
    };
    Uri::Data { media: head.split(';').next().unwrap_or_default(), base64, payload }
}

/// Decodes the payload of a data URI.
pub(super) fn decode(base64: bool, payload: &str) -> Result<Vec<u8>, String> {
    if !base64 {
        return Ok(percent_decode_str(payload).collect());
    }
    let lenient = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    let engine = GeneralPurpose::new(&base64::alphabet::STANDARD, lenient);
    let plain: Cow<'_, [u8]> =
        if payload.contains('%') { percent_decode_str(payload).into() } else { payload.as_bytes().into() };
    // Lines are broken as in mail (N. Freed, N. Borenstein, RFC 2045, 1996), which decoders in browsers ignore.
    let plain: Cow<'_, [u8]> = match plain.iter().any(u8::is_ascii_whitespace) {
        true => plain.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).collect(),
        false => plain,
    };
    engine.decode(&*plain).map_err(|e| format!("the data URI is not base64: {e}"))
}

/// Returns the file that a URI refers to, relative to `folder`. The undecoded name is used if only a file of that name
/// exists.
pub(super) fn locate(folder: &Path, uri: &str, decoded: &str) -> PathBuf {
    let path = folder.join(decoded);
    let raw = folder.join(uri);
    if uri != decoded && !path.exists() && raw.exists() { raw } else { path }
}

/// Whether a file name stays within its base folder.
pub(super) fn stays_inside(name: &str) -> bool {
    let mut components = Path::new(name).components().peekable();
    components.peek().is_some() && components.all(|c| matches!(c, Component::Normal(_) | Component::CurDir))
}

/// Encodes a file name as a URI.
pub(super) fn encode(name: &str) -> String {
    const ESCAPED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_').remove(b'.').remove(b'~').remove(b'/');
    utf8_percent_encode(name, ESCAPED).to_string()
}

/// Returns the folder of a file.
pub(super) fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
