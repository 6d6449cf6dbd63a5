//! Numbers side by side: what the kernels of decode ask of an instruction set, so that each kernel is written once.
//!
//! One lane of plain Rust is the reference, in [`crate::simd::all`]. AVX2 and AVX-512 have fused multiply-add, which rounds once;
//! and AVX-512 divides by an approximation and a step of Newton's, to a few roundings.

/// A deformation gradient less identity, `D = T - I`, as the right-hand side reads it: three columns, each filled up with
/// a zero.
pub(crate) type Gradient = [[f32; 4]; 3];

/// A vector of f32. All operations are by lane and round as IEEE 754 says.
pub(crate) trait Lanes: Copy {
    /// Lanes; divides [`sinew_formats::package::GROUP_NODES`].
    const COUNT: usize;

    fn splat(value: f32) -> Self;
    /// The first lanes of `values`, which has enough.
    fn load(values: &[f32]) -> Self;
    /// Over the first lanes of `values`, which has enough.
    fn store(self, values: &mut [f32]);
    /// The first of `whole` numbers, which has enough; exact.
    fn load_whole(whole: &[i16]) -> Self;
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
    /// Lane n of the rows to column `column` of `target[n]`, as far as both go.
    fn store_column(rows: [Self; 4], column: usize, target: &mut [Gradient]);
}
