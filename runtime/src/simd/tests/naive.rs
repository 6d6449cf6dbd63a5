//! Twins of the kernels in f64, written as the textbook writes them, and a source of repeatable noise. For tests.

use sinew_formats::package::FEATURE_COUNT;

/// Repeatable numbers in [-1, 1): splitmix64.
pub(crate) struct Noise(u64);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    pub(crate) fn features(&mut self) -> [f32; FEATURE_COUNT] {
        core::array::from_fn(|_| self.next())
    }

    pub(crate) fn point(&mut self) -> [f32; 3] {
        core::array::from_fn(|_| self.next())
    }
}

/// Greatest absolute difference between rows in f32 and rows in f64.
pub(crate) fn largest_difference<const N: usize>(found: &[[f32; N]], expected: &[[f64; N]]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let pairs = found.as_flattened().iter().zip(expected.as_flattened());
    pairs.map(|(&a, &b)| (f64::from(a) - b).abs()).fold(0.0, f64::max)
}

pub(crate) type Matrix = [[f64; 3]; 3];

pub(crate) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// `exp([r]x) S` by the power series of the exponential, which needs no case for small angles.
pub(crate) fn deformation_gradient(rotation_scale: f32, stretch_scale: f32, x: &[f64; FEATURE_COUNT]) -> Matrix {
    let r: [f64; 3] = core::array::from_fn(|c| f64::from(rotation_scale) * x[c]);
    let s: [f64; 6] = core::array::from_fn(|c| f64::from(stretch_scale) * x[3 + c]);
    let cross = [[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]];
    let identity: Matrix = core::array::from_fn(|i| core::array::from_fn(|j| f64::from(i == j)));
    let (mut sum, mut term) = (identity, identity);
    for n in 1..60 {
        term = product(&term, &cross).map(|row| row.map(|a| a / f64::from(n)));
        sum = core::array::from_fn(|i| core::array::from_fn(|j| sum[i][j] + term[i][j]));
    }
    let stretch = [
        [1.0 + s[0], s[1], s[2]],
        [s[1], 1.0 + s[3], s[4]],
        [s[2], s[4], 1.0 + s[5]],
    ];
    product(&sum, &stretch)
}
