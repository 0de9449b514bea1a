//! Broken OBJ and MTL files: whatever the bytes, a sound document or an error, and never a panic.

mod obj_support;

use obj_support::{check, read, triangle_count, try_read, try_read_in};

const OBJ: &str = "mtllib scene.mtl other.mtl\n# comment\no thing\ng part one\nv 0 0 0 1 0 0\nv 1.5 0 0 0 1 0\n\
    v 1 1e0 0 0 0 1\nv 0 1 0 1\nv .5 .5 1\nvt 0 0\nvt 1 0.5 0\nvt 1 1\nvn 0 0 1\nvn 0 1 0\ns 1\nusemtl red\n\
    f 1/1/1 2/2/1 3/3/2 4/1/2\nf 1//1 2//1 3//2\nf -1/-1 -2/-2 \\\n -3/-3\ng two\nusemtl blue glass\n\
    f 1 2 5 3 4\nf 1 2 3 4 1 5\nl 1 2 3\np 4\nusemtl gone\nf 1 2 3 2 1 4\ng part one\nf 3 2 1\n";

const MTL: &str = "newmtl red\nKd 1 0 0\nKs 0.5\nNs 10\nd 0.5\nillum 2\nmap_Kd -s 1 1 1 red tex.png -bm 1\n\
    map_d red tex.png\nnewmtl blue glass\nKe 2 1 0\nTr 0.5\nNi 1.5\nPr 0.5\nPm 1\nmap_Pr a\\b.png\nbump b.png\n\
    norm -bm 2 n.jpg\naniso 0.5\nanisor 0.1\nPc 1\n";

/// The next number of a fixed sequence (splitmix64: G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number
/// Generators", 2014).
fn random(seed: &mut u64, below: usize) -> usize {
    *seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *seed;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) % below.max(1) as u64) as usize
}

/// Cuts, flips, doubles, moves or replaces bytes.
fn broken(text: &str, seed: &mut u64) -> Vec<u8> {
    const WORDS: [&str; 16] = [
        "0",
        "-1",
        "-9",
        "99999999999999999999",
        "1e999",
        "nan",
        "-inf",
        "1e-45",
        "/",
        "//",
        "\\\n",
        "\r",
        "#",
        "\u{feff}",
        "f 1 2 3 4 5\n",
        "\n",
    ];
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..=random(seed, 4) {
        let at = random(seed, bytes.len());
        match random(seed, 6) {
            0 => bytes.truncate(at),
            1 if at < bytes.len() => bytes[at] ^= 1 << random(seed, 8),
            2 if at < bytes.len() => drop(bytes.remove(at)),
            3 => drop(bytes.splice(at..at, WORDS[random(seed, WORDS.len())].bytes())),
            4 => {
                let end = (at + random(seed, 40)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                let to = random(seed, bytes.len() + 1);
                drop(bytes.splice(to..to, piece));
            }
            _ => {
                let end = (at + random(seed, 8)).min(bytes.len());
                drop(bytes.splice(at..end, WORDS[random(seed, WORDS.len())].bytes()));
            }
        }
    }
    bytes
}

#[test]
fn unbroken_files_are_read() {
    let document = try_read(&[("scene.obj", OBJ.as_bytes()), ("scene.mtl", MTL.as_bytes())]).expect("sound files");
    check(&document);
    assert_eq!(document.json["meshes"].as_array().map(Vec::len), Some(6), "four of faces, lines, a point");
}

#[test]
fn broken_files_give_a_document_or_an_error() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (mut seed, mut read, mut refused) = (3, 0, 0);
    for round in 0..1200 {
        let (obj, mtl) = match round % 3 {
            0 => (broken(OBJ, &mut seed), MTL.as_bytes().to_vec()),
            1 => (OBJ.as_bytes().to_vec(), broken(MTL, &mut seed)),
            _ => (broken(OBJ, &mut seed), broken(MTL, &mut seed)),
        };
        let strict = obj_support::write_and_read(folder.path(), &[("scene.obj", &obj), ("scene.mtl", &mtl)], true);
        if let Ok(document) = try_read_in(folder.path(), &[]) {
            check(&document);
        } else {
            assert!(strict.is_err(), "what a strict reader reads, any does");
        }
        match strict {
            Ok(document) => {
                check(&document);
                read += 1;
            }
            Err(error) => {
                assert!(error.place.starts_with("line "), "{error}");
                refused += 1;
            }
        }
    }
    assert!(read > 300 && refused > 90, "{read} read, {refused} refused");
}

#[test]
fn every_truncation_gives_a_document_or_an_error() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for end in 0..OBJ.len() {
        if let Ok(document) = try_read_in(folder.path(), &[("scene.obj", &OBJ.as_bytes()[..end])]) {
            check(&document);
        }
    }
    for end in 0..MTL.len() {
        let files = [("scene.obj", OBJ.as_bytes()), ("scene.mtl", &MTL.as_bytes()[..end])];
        check(&try_read_in(folder.path(), &files).expect("a broken library is not an error"));
    }
}

#[test]
fn bytes_at_random_are_no_panic() {
    let mut seed = 4;
    for _ in 0..500 {
        let length = random(&mut seed, 300);
        let bytes: Vec<u8> = (0..length).map(|_| random(&mut seed, 256) as u8).collect();
        if let Ok(document) = try_read(&[("scene.obj", &bytes)]) {
            check(&document);
        }
    }
}

#[test]
fn polygons_with_any_coordinates_are_no_panic() {
    const VALUES: [&str; 16] = [
        "0",
        "1",
        "-1",
        "1.0000001",
        "0.99999994",
        "2",
        "1e-45",
        "-1e-45",
        "1e-38",
        "1e-20",
        "3.4e38",
        "-3.4e38",
        "1e30",
        "16777216",
        "nan",
        "inf",
    ];
    let mut seed = 5;
    for round in 0..600 {
        let corners = 3 + random(&mut seed, 12);
        let kinds = if round % 2 == 0 { 14 } else { 16 };
        let mut value = || VALUES[random(&mut seed, kinds)];
        let points: String = (0..corners).map(|_| format!("v {} {} {}\n", value(), value(), value())).collect();
        let indices: String = (1..=corners).map(|i| format!(" {i}")).collect();
        assert!(triangle_count(&read(&format!("{points}f{indices}\n"))) > 0);
    }
}

#[test]
fn reading_twice_gives_the_same_document() {
    let files = [("scene.obj", OBJ.as_bytes()), ("scene.mtl", MTL.as_bytes())];
    let (a, b) = (try_read(&files).expect("sound files"), try_read(&files).expect("sound files"));
    assert_eq!((a.json, a.buffers, a.warnings), (b.json, b.buffers, b.warnings));
}
