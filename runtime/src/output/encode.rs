//! Unit vectors as whole numbers, each the nearest.

/// Adding it leaves the whole number nearest to a small number, half-way ones to even, in the lowest bits.
const ROUNDER: f32 = 12_582_912.0;

/// The whole number nearest to `x`, as far as it goes into the lower 16 bits; 0 for what is not a number.
fn nearest(x: f32) -> u32 {
    (x + ROUNDER).to_bits()
}

/// 32767 for 1.
pub(super) fn snorm16(v: &[f32; 4]) -> [u8; 8] {
    bytemuck::cast(v.map(|x| nearest(x.clamp(-1.0, 1.0) * 32767.0) as i16))
}

/// 127 for 1.
pub(super) fn snorm8(v: &[f32; 4]) -> [u8; 4] {
    bytemuck::cast(v.map(|x| nearest(x.clamp(-1.0, 1.0) * 127.0) as i8))
}

/// A direction's place on the unfolded octahedron.
pub(super) fn octahedral16(n: &[f32; 3]) -> [u8; 4] {
    bytemuck::cast(octahedron(n).map(unorm16))
}

/// The same of a tangent; the half of the second number says the sign: the upper one plus, the lower one, turned over, minus.
pub(super) fn octahedral16_signed([x, y, z, sign]: &[f32; 4]) -> [u8; 4] {
    /// Keeps what is near zero from both halves.
    const LEAST: f32 = 1.0 / 32767.0;
    let [u, v] = octahedron(&[*x, *y, *z]);
    let v = 0.5 * v.max(LEAST) + 0.5;
    bytemuck::cast([u, if *sign < 0.0 { 1.0 - v } else { v }].map(unorm16))
}

/// The sphere onto an octahedron, its lower half folded out, into the unit square.
fn octahedron(n: &[f32; 3]) -> [f32; 2] {
    let inverse = 1.0 / (n[0].abs() + n[1].abs() + n[2].abs());
    let (x, y) = (n[0] * inverse, n[1] * inverse);
    let outside = |own: f32, other: f32| (1.0 - other.abs()).copysign(own);
    let [u, v] = if n[2] < 0.0 {
        [outside(x, y), outside(y, x)]
    } else {
        [x, y]
    };
    [0.5 * u + 0.5, 0.5 * v + 0.5]
}

/// 65535 for 1.
fn unorm16(x: f32) -> u16 {
    nearest(x.clamp(0.0, 1.0) * 65535.0) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As an engine does it: back onto the octahedron and to the sphere.
    fn decoded([u, v]: [f32; 2]) -> [f32; 3] {
        let [x, y] = [2.0 * u - 1.0, 2.0 * v - 1.0];
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).max(0.0);
        let n = [x - fold.copysign(x), y - fold.copysign(y), z];
        let length = libm::sqrtf(n.iter().map(|x| x * x).sum());
        n.map(|x| x / length)
    }

    fn shares(bytes: [u8; 4]) -> [f32; 2] {
        bytemuck::cast::<_, [u16; 2]>(bytes).map(|x| f32::from(x) / 65535.0)
    }

    #[test]
    fn directions_and_signs_are_found_again() {
        /// Half a step of the square, stretched by the fold; the signed half is twice as coarse.
        const TOLERANCE: f32 = 8e-5;
        for n in 0..4000 {
            let (turn, height) = (2.399_963 * n as f32, 1.0 - 2.0 * (n as f32 + 0.5) / 4000.0);
            let radius = libm::sqrtf(1.0 - height * height);
            let direction = [radius * libm::cosf(turn), radius * libm::sinf(turn), height];
            let near = |found: [f32; 3]| (0..3).all(|c| (found[c] - direction[c]).abs() < TOLERANCE);
            assert!(near(decoded(shares(octahedral16(&direction)))), "{direction:?}");
            for sign in [1.0, -1.0] {
                let [x, y, z] = direction;
                let [u, v] = shares(octahedral16_signed(&[x, y, z, sign]));
                let v = 2.0 * v - 1.0;
                assert_eq!(v < 0.0, sign < 0.0, "{direction:?}");
                assert!(near(decoded([u, v.abs()])), "{direction:?} {sign}");
            }
        }
        assert_eq!(
            octahedral16(&[0.0, 0.0, 1.0]),
            bytemuck::cast::<[u16; 2], [u8; 4]>([32768; 2])
        );
        assert_eq!(
            octahedral16(&[0.0, 0.0, -1.0]),
            bytemuck::cast::<[u16; 2], [u8; 4]>([65535; 2])
        );
    }

    #[test]
    fn whole_numbers_are_the_nearest() {
        for n in -70_000..=70_000 {
            let x = n as f32 / 65_000.0;
            let exact = (f64::from(x.clamp(-1.0, 1.0)) * 32767.0) as f32;
            let found = f32::from(bytemuck::cast::<_, [i16; 4]>(snorm16(&[x; 4]))[3]);
            assert!((found - exact).abs() <= 0.502, "{x} {found}");
        }
        assert_eq!(snorm8(&[1.0, -1.0, f32::NAN, 9.0]), [127, 129, 0, 127]);
        assert_eq!(snorm16(&[f32::NAN; 4]), [0; 8]);
    }
}
