//! What a file that is neither OBJ nor glTF looks like, for error messages.

/// Number of bytes of a file that [`other`] looks at.
pub(crate) const START: usize = 512;

/// Description and advice for a file that starts with the given bytes and has a size in bytes; `None` if it may be OBJ
/// or glTF.
pub(crate) fn other(start: &[u8], size: u64) -> Option<String> {
    let text = start.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(start).trim_ascii_start();
    let magic = KINDS.iter().find(|kind| {
        let from = if kind.text { text } else { start };
        from.get(..kind.magic.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(kind.magic))
    });
    let kind = magic.map(|kind| (kind.name, kind.advice));
    let (name, advice) = kind.or_else(|| is_binary_stl(start, size).then_some(("an STL model", CONVERT)))?;
    Some(format!("this looks like {name}, not OBJ or glTF: {advice}"))
}

/// Returns the description of a glTF file that is named as an OBJ file.
pub(crate) fn gltf_as_obj(start: &[u8]) -> Option<String> {
    let text = start.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(start).trim_ascii_start();
    let name = match text {
        [b'g', b'l', b'T', b'F', ..] => "glb",
        [b'{', ..] => "gltf",
        _ => return None,
    };
    Some(format!("this looks like glTF, not OBJ: rename it to end in .{name}"))
}

/// A kind of file, recognised by its first bytes.
struct Kind {
    /// Compared without regard to case.
    magic: &'static [u8],
    /// Whether blanks may precede it.
    text: bool,
    name: &'static str,
    advice: &'static str,
}

const CONVERT: &str = "export it to glTF, for example with Blender";
const UNPACK: &str = "unpack it first";
const DOWNLOAD: &str = "the download failed; fetch the file itself";

const fn text(magic: &'static [u8], name: &'static str, advice: &'static str) -> Kind {
    Kind { magic, text: true, name, advice }
}

const fn bytes(magic: &'static [u8], name: &'static str, advice: &'static str) -> Kind {
    Kind { magic, text: false, name, advice }
}

const KINDS: [Kind; 31] = [
    text(b"version https://git-lfs", "a Git LFS pointer", "run `git lfs pull` to fetch the file that it stands for"),
    text(b"version https://hawser", "a Git LFS pointer", "run `git lfs pull` to fetch the file that it stands for"),
    text(b"<!doctype html", "an HTML page", DOWNLOAD),
    text(b"<html", "an HTML page", DOWNLOAD),
    text(b"<head", "an HTML page", DOWNLOAD),
    text(b"<COLLADA", "a COLLADA scene", CONVERT),
    text(b"<X3D", "an X3D scene", CONVERT),
    text(b"<?xml", "an XML file (COLLADA, X3D, SVG or a page)", CONVERT),
    bytes(b"Kaydara FBX Binary", "an FBX scene", CONVERT),
    text(b"; FBX", "an FBX scene in text form", CONVERT),
    text(b"#usda", "a USD scene", CONVERT),
    bytes(b"PXR-USDC", "a USD scene", CONVERT),
    text(b"solid ", "an STL model", CONVERT),
    text(b"ply\n", "a PLY model", CONVERT),
    text(b"ply\r", "a PLY model", CONVERT),
    text(b"OFF\n", "an OFF model", CONVERT),
    text(b"OFF\r", "an OFF model", CONVERT),
    text(b"ISO-10303-21", "a STEP or IFC model", CONVERT),
    text(b"#VRML", "a VRML scene", CONVERT),
    text(b"xof 0", "a DirectX model", CONVERT),
    text(b"%PDF", "a PDF document", CONVERT),
    bytes(b"BLENDER", "a Blender file", "open it in Blender and export glTF"),
    bytes(b"Ogawa", "an Alembic scene", CONVERT),
    bytes(b"\x89HDF", "an HDF5 file, such as Alembic", CONVERT),
    bytes(b"PK\x03\x04", "a ZIP archive (USDZ and 3MF are such)", UNPACK),
    bytes(b"7z\xBC\xAF\x27\x1C", "a 7z archive", UNPACK),
    bytes(b"Rar!", "a RAR archive", UNPACK),
    bytes(b"\x28\xB5\x2F\xFD", "a file compressed by zstd", UNPACK),
    bytes(b"BZh", "a file compressed by bzip2", UNPACK),
    bytes(b"\xFD7zXZ", "a file compressed by xz", UNPACK),
    bytes(b"\x89PNG", "an image", "pass the model that uses it"),
];

/// Whether the size is that of a binary STL file: a head of 80 bytes, the number of triangles, 50 bytes per triangle.
fn is_binary_stl(start: &[u8], size: u64) -> bool {
    let Some(&[a, b, c, d]) = start.get(80..84) else { return false };
    size == 84 + 50 * u64::from(u32::from_le_bytes([a, b, c, d]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_kinds_are_named_with_advice() {
        let cases: [(&[u8], &str); 8] = [
            (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
            (b"\n  <!DOCTYPE HTML>", "HTML"),
            (b"Kaydara FBX Binary  \0", "FBX"),
            (b"; FBX 7.3.0 project file", "FBX"),
            (b"#usda 1.0", "USD"),
            (b"solid cube\n facet", "STL"),
            (b"ply\nformat ascii 1.0", "PLY"),
            (b"PK\x03\x04", "unpack"),
        ];
        for (start, expected) in cases {
            assert!(other(start, start.len() as u64).is_some_and(|text| text.contains(expected)), "{expected}");
        }
    }

    #[test]
    fn binary_stl_is_told_by_its_size() {
        let mut start = vec![b'x'; 80];
        start.extend(2u32.to_le_bytes());
        assert!(other(&start, 184).is_some_and(|text| text.contains("STL")));
        assert_eq!(other(&start, 185), None);
    }

    #[test]
    fn obj_and_gltf_may_begin_as_they_like() {
        for start in [&b""[..], b"v 0 0 0", b"# solid", b"o solid", b"{\"asset\"", b"glTF", b"mtllib a.mtl"] {
            assert_eq!(other(start, 1), None);
        }
        assert!(gltf_as_obj(b" {\"asset\": {}}").is_some_and(|text| text.contains(".gltf")));
    }
}
