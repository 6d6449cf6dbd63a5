//! Numbers side by side: what the kernels of decode ask of an instruction set, so that each kernel is written once.
//!
//! One lane of plain Rust is the reference; AVX2 and AVX-512 have files of their own. They differ in fused
//! multiply-add, which rounds once, and by nothing else.

use half::f16;
use libm::sqrtf;

use sinew_formats::package::GROUP_NODES;

/// A deformation gradient less identity, `D = T - I`, as the right-hand side reads it: three columns, each filled up with
/// a zero.
pub(crate) type Gradient = [[f32; 4]; 3];

/// A vector of f32. All operations are by lane and round as IEEE 754 says.
pub(crate) trait Lanes: Copy {
    /// Lanes; divides [`GROUP_NODES`].
    const COUNT: usize;

    fn splat(value: f32) -> Self;
    /// The first lanes of `values`, which has enough.
    fn load(values: &[f32]) -> Self;
    /// Over the first lanes of `values`, which has enough.
    fn store(self, values: &mut [f32]);
    /// The first halves of `bits`, which has enough; exact.
    fn load_halves(bits: &[u16]) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// `self / other` to a few roundings, for an ordinary divisor.
    fn quotient(self, other: Self) -> Self {
        self.div(other)
    }
    fn sqrt(self) -> Self;
    /// `self * factor + term`, rounded once or twice.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// `term - self * factor`, rounded once or twice.
    fn neg_mul_add(self, factor: Self, term: Self) -> Self;
    /// Numbers only.
    fn min(self, other: Self) -> Self;
    /// Numbers only.
    fn max(self, other: Self) -> Self;
    /// `if self < limit { yes } else { no }`.
    fn select_below(self, limit: Self, yes: Self, no: Self) -> Self;
    /// Whether every lane is at most `limit`; not where one is NaN.
    fn all_at_most(self, limit: f32) -> bool;
    /// Lane n of the rows to column `column` of `target[places[n]]`, for the places there are, at most all lanes.
    fn scatter(rows: [Self; 4], places: &[u32], column: usize, target: &mut [Gradient]) {
        let mut lanes = [[0.0; GROUP_NODES]; 4];
        for (row, lanes) in rows.into_iter().zip(&mut lanes) {
            row.store(lanes);
        }
        for (n, &place) in places.iter().enumerate() {
            target[place as usize][column] = lanes.map(|row| row[n]);
        }
    }
}

/// The reference: one lane, no fused operation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct One(pub(crate) f32);

impl Lanes for One {
    const COUNT: usize = 1;

    fn splat(value: f32) -> Self {
        Self(value)
    }
    fn load(values: &[f32]) -> Self {
        Self(values[0])
    }
    fn store(self, values: &mut [f32]) {
        values[0] = self.0;
    }
    fn load_halves(bits: &[u16]) -> Self {
        Self(f16::from_bits(bits[0]).to_f32())
    }
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0)
    }
    fn sqrt(self) -> Self {
        Self(sqrtf(self.0))
    }
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(self.0 * factor.0 + term.0)
    }
    fn neg_mul_add(self, factor: Self, term: Self) -> Self {
        Self(term.0 - self.0 * factor.0)
    }
    fn min(self, other: Self) -> Self {
        Self(if self.0 < other.0 { self.0 } else { other.0 })
    }
    fn max(self, other: Self) -> Self {
        Self(if self.0 > other.0 { self.0 } else { other.0 })
    }
    fn select_below(self, limit: Self, yes: Self, no: Self) -> Self {
        if self.0 < limit.0 { yes } else { no }
    }
    fn all_at_most(self, limit: f32) -> bool {
        self.0 <= limit
    }
}
