//! Filters: what elements of mode 0 are turned into after decoding.
//!
//! Computed in 32-bit floats, in the order of operations of the reference implementation's vector code, and rounded to
//! nearest, ties to even, as it does; the extension allows a difference of one unit in the last place.

/// A filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filter {
    /// Unit vectors of three components, coded on an octahedron, with a fourth component as it is.
    Octahedral,
    /// Unit quaternions without their largest component.
    Quaternion,
    /// 32-bit floats as an exponent of 8 bits and a mantissa of 24.
    Exponential,
    /// Colours as luma and two differences of colour, with alpha.
    Color,
}

impl Filter {
    /// All filters, with their names in files.
    pub(crate) const ALL: [(&'static str, Filter); 4] = [
        ("OCTAHEDRAL", Filter::Octahedral),
        ("QUATERNION", Filter::Quaternion),
        ("EXPONENTIAL", Filter::Exponential),
        ("COLOR", Filter::Color),
    ];

    /// Whether elements may have so many bytes.
    pub(crate) fn allows(self, stride: usize) -> bool {
        match self {
            Filter::Octahedral | Filter::Color => stride == 4 || stride == 8,
            Filter::Quaternion => stride == 8,
            Filter::Exponential => stride.is_multiple_of(4),
        }
    }

    /// Decodes elements in place. `stride` must be [allowed](Filter::allows).
    pub(crate) fn apply(self, elements: &mut [u8], stride: usize) {
        match self {
            Filter::Exponential => each::<4>(elements, exponential),
            Filter::Quaternion => each::<8>(elements, |e| shorts(e, quaternion)),
            Filter::Octahedral if stride == 4 => each::<4>(elements, |e| {
                let vector = octahedral(e.map(|c| f32::from(c as i8)), 127.0);
                [vector[0] as u8, vector[1] as u8, vector[2] as u8, e[3]]
            }),
            Filter::Octahedral => each::<8>(elements, |e| {
                shorts(e, |v| {
                    let vector = octahedral(v.map(f32::from), 32_767.0);
                    [vector[0] as i16, vector[1] as i16, vector[2] as i16, v[3]]
                })
            }),
            Filter::Color if stride == 4 => each::<4>(elements, |[y, co, cg, a]| {
                let signed = |c: u8| i32::from(c as i8);
                color([y.into(), signed(co), signed(cg), a.into()], 255.0).map(|c| c as u8)
            }),
            Filter::Color => each::<8>(elements, |e| {
                shorts(e, |[y, co, cg, a]| {
                    let unsigned = |c: i16| i32::from(c as u16);
                    color([unsigned(y), co.into(), cg.into(), unsigned(a)], 65_535.0).map(|c| c as i16)
                })
            }),
        }
    }
}

/// Replaces each element of `N` bytes.
fn each<const N: usize>(elements: &mut [u8], decode: impl Fn([u8; N]) -> [u8; N]) {
    elements.as_chunks_mut().0.iter_mut().for_each(|element| *element = decode(*element));
}

/// Decodes four 16-bit integers.
fn shorts(bytes: [u8; 8], decode: impl Fn([i16; 4]) -> [i16; 4]) -> [u8; 8] {
    let [a, b, c, d, e, f, g, h] = bytes;
    let [x, y, z, w] = decode([[a, b], [c, d], [e, f], [g, h]].map(i16::from_le_bytes)).map(i16::to_le_bytes);
    [x[0], x[1], y[0], y[1], z[0], z[1], w[0], w[1]]
}

/// The nearest integer, ties to even; 0 for what is not a number.
fn rounded(x: f32) -> i32 {
    x.round_ties_even() as i32
}

/// A unit vector, times `one`, from two coordinates on an octahedron and the integer that stands for 1 there.
fn octahedral([x, y, scale, _]: [f32; 4], one: f32) -> [i32; 3] {
    let z = scale - (x.abs() + y.abs());
    // Below the equator the octahedron is folded outwards.
    let fold = z.min(0.0);
    let unfold = |c: f32| if c >= 0.0 { c + fold } else { c - fold };
    let (x, y) = (unfold(x), unfold(y));
    let scale = one / (x * x + (y * y + z * z)).sqrt();
    [x, y, z].map(|c| rounded(c * scale))
}

/// A unit quaternion from three components and, in the fourth, the integer that stands for 1, whose lowest two bits are
/// the number of the component left out.
fn quaternion(coded: [i16; 4]) -> [i16; 4] {
    let [x, y, z] = [coded[0], coded[1], coded[2]].map(f32::from);
    let one = f32::from(coded[3] | 3);
    let square = one * one;
    let rest = (square + square) - (x * x + (y * y + z * z));
    let w = rest.max(0.0).sqrt();
    let scale = 32_767.0 / 2.0_f32.sqrt() / one;
    let largest = usize::from(coded[3] as u16 & 3);
    let mut quaternion = [0; 4];
    for (i, component) in [w, x, y, z].into_iter().enumerate() {
        quaternion[(largest + i) % 4] = rounded(component * scale) as i16;
    }
    quaternion
}

/// A float from a signed mantissa of 24 bits and a signed exponent of 8.
fn exponential(bytes: [u8; 4]) -> [u8; 4] {
    let coded = i32::from_le_bytes(bytes);
    let power = f32::from_bits(((coded >> 24) + 127).cast_unsigned() << 23);
    (power * ((coded << 8) >> 8) as f32).to_le_bytes()
}

/// Red, green, blue and alpha, times `one`, from luma, two differences and alpha below a bit that gives the scale.
fn color([y, co, cg, alpha]: [i32; 4], one: f32) -> [i32; 4] {
    let scale = (1 << alpha.checked_ilog2().map_or(0, |bit| bit + 1)) - 1;
    let alpha = ((alpha << 1) & scale) | (alpha & 1);
    let factor = one / scale as f32;
    [y + (co - cg), y + cg, y - (co + cg), alpha].map(|c| rounded(c as f32 * factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::meshopt::testing::hex;
    use crate::meshopt::vertices;

    /// Decodes four elements of a stream of the reference decoder's tests.
    fn filtered(filter: Filter, stride: usize, stream: &str) -> Vec<u8> {
        let mut elements = vertices::decode(&hex(stream), 4, stride).expect("sound");
        filter.apply(&mut elements, stride);
        elements
    }

    fn words(values: [u16; 16]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    #[test]
    fn octahedral_vectors_of_8_bits_are_unit_vectors() {
        let stream = "a001070000001e013f0000008b8cfd0001260000000000000000000000000000000000000000000000000000000000000000 \
             017f00";
        let expected = [0, 1, 127, 0, 0, 159, 82, 1, 255, 1, 127, 0, 1, 130, 241, 1];
        assert_eq!(filtered(Filter::Octahedral, 4, stream), expected);
    }

    #[test]
    fn octahedral_vectors_of_12_bits_are_unit_vectors() {
        let stream = "a0010f0000003d5a010f0000000e0d013f0000009a9926013f0000000e0d0a00000126000000000000000000000000000000 \
             0000000000000000000000000000000100ff070000";
        let expected = [0, 16, 32767, 0, 0, 32621, 3088, 1, 32764, 16, 471, 0, 307, 28541, 16093, 1];
        assert_eq!(filtered(Filter::Octahedral, 8, stream), words(expected));
    }

    #[test]
    fn quaternions_get_their_largest_component_back() {
        let stream = "a0010f0000003d5a010f0000000e0d013f0000009a9926013f0000000e0d0a0000012a000000000000000000000000000000 \
             00000000000000000000000000000001000000fc07";
        let expected = [32767, 0, 11, 0, 0, 25013, 0, 21166, 11, 0, 23504, 22830, 158, 14715, 0, 29277];
        assert_eq!(filtered(Filter::Quaternion, 8, stream), words(expected));
    }

    #[test]
    fn floats_are_mantissa_times_power_of_two() {
        let stream =
            "a0000000000000000000000000000000000000000000000000000000000000000000000000030000fff7ffff02ffff7ffe";
        let mut elements = vertices::decode(&hex(stream), 1, 16).expect("sound");
        Filter::Exponential.apply(&mut elements, 16);
        let expected = [0.0, 1.5, -36.0, f32::from_bits(0x49FF_FFFE)];
        assert_eq!(elements, expected.map(f32::to_le_bytes).as_flattened());
    }

    #[test]
    fn colors_of_8_bits_are_red_green_blue_and_alpha() {
        let stream = "a0013f0000007e7d4c013f000000fdfdfe013f000000838280013f0000007d3f7e0000000000000000000000000000000000 \
             0000000000000000000000407fc1ff";
        let expected = [254, 1, 0, 255, 0, 254, 0, 128, 1, 0, 255, 64, 102, 102, 102, 191];
        assert_eq!(filtered(Filter::Color, 4, stream), expected);
    }

    #[test]
    fn colors_of_12_bits_are_red_green_blue_and_alpha() {
        let stream = "a0011b000000cc013f0000000605040129000000013f0000000d0f10013800000003013f0000001615080121000000013f00 \
             00000503060000000000000000000000000000000000000000000000000004ff0701fcff0f";
        let expected = [65519, 16, 0, 65535, 0, 65519, 0, 32776, 16, 0, 65535, 16388, 26214, 26214, 26214, 49147];
        assert_eq!(filtered(Filter::Color, 8, stream), words(expected));
    }

    #[test]
    fn whatever_the_bits_nothing_panics() {
        for (_, filter) in Filter::ALL {
            for stride in [4, 8, 12].into_iter().filter(|stride| filter.allows(*stride)) {
                for bits in [[0; 24], [255; 24], [128; 24], [127; 24], [1; 24]] {
                    let mut elements = bits;
                    filter.apply(&mut elements, stride);
                }
            }
        }
    }
}
