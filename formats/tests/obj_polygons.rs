//! Polygons of OBJ files as triangles.

mod obj_support;

use std::f64::consts::TAU;
use std::fmt::Write;

use obj_support::{attribute, read, triangles, warnings};
use raykiln_formats::Document;

type Point = [f64; 3];

const FAN_WARNING: &str = "faces whose outline crosses itself or lies in no plane";

/// A document of one polygon.
fn polygon(points: &[Point]) -> Document {
    let mut text = String::new();
    points.iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").expect("text"));
    text.push('f');
    (1..=points.len()).for_each(|i| write!(text, " {i}").expect("text"));
    read(&text)
}

/// A polygon in the plane z = 0.
fn flat(points: &[[f64; 2]]) -> Vec<Point> {
    points.iter().map(|&[x, y]| [x, y, 0.0]).collect()
}

/// The same, turned off the axes and moved.
fn turned(points: &[Point]) -> Vec<Point> {
    let (s, c) = (0.6, 0.8);
    let turn = |&[x, y, z]: &Point| {
        let (x, z) = (c * x - s * z, s * x + c * z);
        [x + 7.0, c * y - s * z - 3.0, s * y + c * z + 11.0]
    };
    points.iter().map(turn).collect()
}

fn corners(document: &Document) -> Vec<[Point; 3]> {
    let positions = attribute(document, 0, 0, "POSITION");
    let point = |i: usize| [positions[i][0], positions[i][1], positions[i][2]];
    triangles(document, 0, 0).into_iter().map(|triangle| triangle.map(point)).collect()
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn length(a: Point) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn sum(vectors: impl Iterator<Item = Point>) -> Point {
    vectors.fold([0.0; 3], |s, v| [s[0] + v[0], s[1] + v[1], s[2] + v[2]])
}

/// Twice the area vector of an outline.
fn outline_area(points: &[Point]) -> Point {
    let single = |p: &Point| p.map(|x| f64::from(x as f32));
    let points: Vec<Point> = points.iter().map(single).collect();
    sum((0..points.len()).map(|i| {
        let (a, b) = (minus(points[i], points[0]), minus(points[(i + 1) % points.len()], points[0]));
        cross(a, b)
    }))
}

fn triangle_area(t: &[Point; 3]) -> Point {
    cross(minus(t[1], t[0]), minus(t[2], t[0]))
}

/// Asserts that the triangles make up the area vector; gives area lost to overlap (twice), 0 without overlap.
fn check_area(points: &[Point], document: &Document) -> f64 {
    let made = corners(document);
    let extent = points.iter().map(|p| length(minus(*p, points[0]))).fold(0.0, f64::max);
    let (want, have) = (outline_area(points), sum(made.iter().map(triangle_area)));
    assert!(length(minus(want, have)) <= 4e-6 * extent * extent, "{want:?} {have:?} of {points:?}");
    made.iter().map(|t| length(triangle_area(t))).sum::<f64>() - length(want)
}

/// Asserts that a flat simple outline becomes n - 2 triangles without overlap, turned or not, from either side.
fn check_simple(outline: &[[f64; 2]]) {
    check_placed(flat(outline));
    check_placed(turned(&flat(outline)));
}

fn check_placed(front: Vec<Point>) {
    let back: Vec<Point> = front.iter().rev().copied().collect();
    for points in [front, back] {
        let document = polygon(&points);
        let area = length(outline_area(&points));
        let overlap = check_area(&points, &document);
        assert!(overlap.abs() < 2e-6 * area, "overlap {overlap} of {area} in {points:?}");
        assert_eq!(triangles(&document, 0, 0).len(), points.len() - 2);
        assert_eq!(warnings(&document), "");
    }
}

#[test]
fn square_takes_the_diagonal_from_its_first_corner() {
    let document = polygon(&flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]));
    assert_eq!(triangles(&document, 0, 0), [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn flat_quad_takes_the_delaunay_diagonal() {
    let kite = [[0.0, 0.0], [5.0, -1.0], [10.0, 0.0], [5.0, 1.0]];
    let document = polygon(&flat(&kite));
    assert_eq!(corners(&document)[0][2], [5.0, 1.0, 0.0]);
    check_simple(&kite);
    check_simple(&[kite[1], kite[2], kite[3], kite[0]]);
}

#[test]
fn warped_quad_takes_the_diagonal_from_its_first_corner() {
    let points = [[0.0, 0.0, 0.0], [5.0, -1.0, 0.5], [10.0, 0.0, 0.0], [5.0, 1.0, 0.5]];
    let document = polygon(&points);
    assert_eq!(triangles(&document, 0, 0), [[0, 1, 2], [0, 2, 3]]);
    check_area(&points, &document);
}

#[test]
fn concave_quad_is_split_inside_whichever_corner_comes_first() {
    let dart = [[0.0, 0.0], [4.0, -3.0], [1.0, 0.0], [4.0, 3.0]];
    for first in 0..4 {
        let mut outline = dart;
        outline.rotate_left(first);
        check_simple(&outline);
    }
}

#[test]
fn quad_with_a_collinear_or_repeated_corner_loses_nothing() {
    check_simple(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 1.0]]);
    check_simple(&[[0.0, 0.0], [2.0, 0.0], [2.0, 0.0], [1.0, 1.0]]);
}

#[test]
fn crossed_quad_and_quad_without_a_plane_are_split_from_the_first_corner() {
    let crossed = flat(&[[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [2.0, 2.0]]);
    let document = polygon(&crossed);
    assert!(warnings(&document).contains(FAN_WARNING));
    check_area(&crossed, &document);
    let eight = flat(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
    assert!(warnings(&polygon(&eight)).contains(FAN_WARNING));
}

#[test]
fn quad_on_a_line_or_point_stays_as_degenerate_triangles() {
    for points in [[[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [2.0, 0.0]], [[1.0, 1.0]; 4]] {
        let document = polygon(&flat(&points));
        assert_eq!(triangles(&document, 0, 0).len(), 2);
        assert_eq!(warnings(&document), "");
    }
}

#[test]
fn degenerate_triangles_are_kept() {
    let document = read("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 2\nf 3 3 3\n");
    assert_eq!(triangles(&document, 0, 0), [[0, 1, 2], [0, 0, 1], [2, 2, 2]]);
    assert_eq!(warnings(&document), "");
}

#[test]
fn concave_polygons_are_triangulated_inside() {
    check_simple(&[[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]);
    let star: Vec<[f64; 2]> = (0..20)
        .map(|i| {
            let (radius, angle) = (if i % 2 == 0 { 3.0 } else { 1.0 }, TAU * f64::from(i) / 20.0);
            [radius * angle.cos(), radius * angle.sin()]
        })
        .collect();
    check_simple(&star);
}

#[test]
fn collinear_corners_stay_corners() {
    check_simple(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0], [0.0, 1.0]]);
    check_simple(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [0.0, 3.0]]);
}

#[test]
fn bridge_to_a_hole_leaves_the_hole_open() {
    let outline = [
        [0.0, 0.0],
        [4.0, 0.0],
        [4.0, 4.0],
        [0.0, 4.0],
        [0.0, 0.0],
        [1.0, 1.0],
        [1.0, 3.0],
        [3.0, 3.0],
        [3.0, 1.0],
        [1.0, 1.0],
    ];
    for points in [flat(&outline), turned(&flat(&outline))] {
        let document = polygon(&points);
        assert!(check_area(&points, &document).abs() < 1e-4);
        assert!((length(outline_area(&points)) - 24.0).abs() < 1e-4);
        assert_eq!(triangles(&document, 0, 0).len(), 8);
        assert_eq!(warnings(&document), "");
    }
}

#[test]
fn both_sides_of_a_bridge_keep_their_attributes() {
    let points = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 1 1 0\nv 1 3 0\nv 3 3 0\nv 3 1 0\n";
    let face = "f 1/1 2/1 3/1 4/1 1/2 5/2 6/1 7/1 8/1 5/1";
    let document = read(&format!("{points}vt 0 0\nvt 1 0\n{face}\n"));
    let (positions, coordinates) = (attribute(&document, 0, 0, "POSITION"), attribute(&document, 0, 0, "TEXCOORD_0"));
    assert_eq!(triangles(&document, 0, 0).len(), 8);
    for triangle in triangles(&document, 0, 0) {
        let above = triangle.iter().map(|&i| positions[i][1] - positions[i][0]).sum::<f64>() > 0.0;
        let on_bridge = triangle.iter().filter(|&&i| positions[i][0] == positions[i][1] && positions[i][0] < 2.0);
        on_bridge.for_each(|&i| assert_eq!(coordinates[i][0] == 1.0, above, "{triangle:?}"));
    }
}

#[test]
fn outline_that_touches_one_of_its_edges_loses_nothing() {
    let outline = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 0.0], [0.0, 4.0]];
    let points = flat(&outline);
    let document = polygon(&points);
    assert!(check_area(&points, &document).abs() < 1e-6);
    assert_eq!(warnings(&document), "");
}

#[test]
fn repeated_corners_lose_nothing() {
    let outline = [[0.0, 0.0], [0.0, 0.0], [2.0, 0.0], [3.0, 1.0], [3.0, 1.0], [2.0, 2.0], [0.0, 2.0]];
    let points = flat(&outline);
    let document = polygon(&points);
    assert!(check_area(&points, &document).abs() < 1e-6);
    assert_eq!(warnings(&document), "");
}

#[test]
fn outline_walked_twice_counts_twice() {
    let once = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
    let points = flat(&[once, once].concat());
    check_area(&points, &polygon(&points));
}

#[test]
fn pentagram_and_pentagon_without_a_plane_are_fans() {
    let pentagram: Vec<[f64; 2]> = (0..5).map(|i| (TAU * 0.4 * f64::from(i)).sin_cos()).map(|(s, c)| [c, s]).collect();
    let line: Vec<[f64; 2]> = (0..5).map(|i| [f64::from(i), 0.0]).collect();
    for points in [flat(&pentagram), turned(&flat(&pentagram)), flat(&line), flat(&[[1.0, 1.0]; 5])] {
        let document = polygon(&points);
        assert!(warnings(&document).contains(FAN_WARNING), "{points:?}");
        assert_eq!(triangles(&document, 0, 0).len(), 3);
        check_area(&points, &document);
    }
}

#[test]
fn polygon_with_a_corner_at_infinity_stays_in_the_data() {
    let document = read("v 0 0 0\nv 1 0 0\nv inf 1 0\nv nan 1 0\nv 0 1 0\nf 1 2 3 4 5\n");
    assert_eq!(triangles(&document, 0, 0).len(), 3);
    assert_eq!(warnings(&document), "");
}

#[test]
fn tiny_huge_thin_and_far_polygons_are_triangulated() {
    let ell = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
    for scale in [1e-30, 1e-6, 1e6, 1e18, 1e30] {
        check_placed(flat(&ell.map(|p| p.map(|x| x * scale))));
    }
    check_placed(flat(&ell.map(|[x, y]| [x + 5000.0, y - 3000.0])));
    check_placed(flat(&ell.map(|[x, y]| [1e4 * x, 1e-2 * y])));
    let denormal = polygon(&flat(&ell.map(|p| p.map(|x| x * 1e-44))));
    assert_eq!(triangles(&denormal, 0, 0).len(), 4);
}

#[test]
fn warped_polygon_keeps_its_area_vector() {
    let warped = |i: i32| {
        let (s, c) = (TAU * f64::from(i) / 9.0).sin_cos();
        [c, s, 0.3 * (3.0 * s).cos()]
    };
    let points: Vec<Point> = (0..9).map(warped).collect();
    let document = polygon(&points);
    check_area(&points, &document);
    assert_eq!(triangles(&document, 0, 0).len(), 7);
}

#[test]
fn ten_thousand_corners_take_little_time() {
    let comb: Vec<[f64; 2]> = (0..5000)
        .map(|i| [f64::from(i), if i % 2 == 0 { 1.0 } else { 100.0 }])
        .chain((0..5000).rev().map(|i| [f64::from(i), 0.0]))
        .collect();
    check_simple(&comb);
}

/// Numbers in 0..1 from a fixed seed (splitmix64: G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number
/// Generators", 2014).
fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *seed;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
fn star_shaped_outlines_of_any_shape_are_triangulated_without_overlap() {
    let mut seed = 1;
    for count in 5..60 {
        let outline: Vec<[f64; 2]> = (0..count)
            .map(|i| {
                let (s, c) = (TAU * f64::from(i) / f64::from(count)).sin_cos();
                let radius = 0.2 + random(&mut seed);
                [radius * c, radius * s]
            })
            .collect();
        check_simple(&outline);
    }
}

#[test]
fn any_outline_at_all_keeps_its_area_vector() {
    let mut seed = 2;
    for round in 0..400 {
        let count = 4 + (random(&mut seed) * 12.0) as usize;
        // Corners on a small grid repeat, touch and cross often; every third outline lies in space.
        let mut grid = || (random(&mut seed) * 5.0).floor();
        let points: Vec<Point> =
            (0..count).map(|_| [grid(), grid(), if round % 3 == 0 { grid() } else { 0.0 }]).collect();
        let document = polygon(&points);
        let document = if round % 2 == 0 { document } else { polygon(&turned(&points)) };
        check_area(&if round % 2 == 0 { points } else { turned(&points) }, &document);
    }
}
