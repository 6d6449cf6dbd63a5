//! Decode, a group of vertices at a time and all in registers: the sparse blend of the blocks' folded components, tanh,
//! the sum of the blocks, and the exponential map to deformation gradients (method sections 1 and 2).
//!
//! Written once for any [`Lanes`]. The decoder's convolution is folded into the components by the baker, because blend
//! and convolution are both linear: only `tanh(bias + sum_k z_k C_k)` is left for the frame. Gradients are kept as
//! `D = T - I`: rest gives exactly zero, and the solve then works on displacements, which keeps f32 accurate.

use sinew_formats::package::{FEATURE_COUNT, GROUP_NODES, PatchesView, ROTATION_FEATURES};

use super::functions::{half_angle, tanh};
use super::lanes::{Gradient, Lanes};

/// Nine numbers of each vertex of a group, number first.
pub(crate) type Group<T> = [[T; GROUP_NODES]; FEATURE_COUNT];
/// Nine vectors.
pub(super) type Row<L> = [L; FEATURE_COUNT];
/// Row-major 3x3 of vectors.
pub(super) type Matrix<L> = [[L; 3]; 3];

/// What a component counts in this frame: for log-rotation, then for stretch.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Share {
    /// Weight times scale; finite times any whole number.
    pub(crate) factors: [f32; 2],
    /// Of the component's whole numbers.
    pub(crate) scales: [f32; 2],
    /// Not zero where the factors were others in the frame before.
    pub(crate) changed: u32,
}

impl Share {
    /// Whether the component is at rest.
    #[inline(always)]
    pub(super) fn is_zero(&self) -> bool {
        self.factors == [0.0; 2]
    }
}

/// Which of two numbers belongs to feature `c`.
#[inline(always)]
pub(super) fn of_feature(pair: &[f32; 2], c: usize) -> f32 {
    pair[usize::from(c >= ROTATION_FEATURES)]
}

/// What a block adds at rest.
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct BlockRest {
    /// Of the decoder.
    pub(crate) bias: [f32; FEATURE_COUNT],
    /// Its tanh, from the kernel that computes the others: an untouched vertex then gives exactly zero.
    pub(crate) activation: [f32; FEATURE_COUNT],
}

/// What a network feature means: the two scales of the package.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeatureScales {
    /// Network value to radians.
    pub(crate) rotation: f32,
    /// Network value to stretch.
    pub(crate) stretch: f32,
}

/// Everything that decode reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decoder<'a> {
    /// The components, by groups of nodes.
    pub(crate) patches: PatchesView<'a>,
    /// Shape: `[K]`.
    pub(crate) shares: &'a [Share],
    /// Shape: `[B]`.
    pub(crate) blocks: &'a [BlockRest],
    pub(crate) scales: FeatureScales,
}

/// Fills in the activations of the biases.
#[inline(always)]
pub(crate) fn rest_activations<L: Lanes>(blocks: &mut [BlockRest]) {
    for block in blocks {
        for c in 0..FEATURE_COUNT {
            let mut lanes = [0.0; GROUP_NODES];
            tanh(L::splat(block.bias[c])).store(&mut lanes);
            block.activation[c] = lanes[0];
        }
    }
}

/// Gradients of the groups that are marked as touched; the others stay. Shape: `touched` `[G]`, `gradients` `[N]`.
///
/// Features stay in registers: writing them costs more than computing them again where somebody asks.
#[inline(always)]
pub(crate) fn decode<L: Lanes>(decoder: &Decoder<'_>, touched: &[u8], gradients: &mut [Gradient]) {
    for (g, (gradients, touched)) in gradients.chunks_mut(GROUP_NODES).zip(touched).enumerate() {
        if *touched == 0 {
            continue;
        }
        let patches = decoder.patches_of(g);
        for lane in (0..gradients.len()).step_by(L::COUNT) {
            let x = blend::<L>(decoder, patches.clone(), lane);
            store(&gradient(decoder.scales, &x), &mut gradients[lane..]);
        }
    }
}

/// Features of group `g`.
#[inline(always)]
pub(crate) fn features<L: Lanes>(decoder: &Decoder<'_>, g: usize, features: &mut Group<f32>) {
    for lane in (0..GROUP_NODES).step_by(L::COUNT) {
        let x = blend::<L>(decoder, decoder.patches_of(g), lane);
        for c in 0..FEATURE_COUNT {
            x[c].store(&mut features[c][lane..]);
        }
    }
}

/// Gradients of one group of features, or of its first nodes. Shape: `gradients` at most `[GROUP_NODES]`.
#[inline(always)]
pub(crate) fn gradients<L: Lanes>(scales: FeatureScales, features: &Group<f32>, gradients: &mut [Gradient]) {
    for lane in (0..gradients.len()).step_by(L::COUNT) {
        let x = features.each_ref().map(|row| L::load(&row[lane..]));
        store(&gradient(scales, &x), &mut gradients[lane..]);
    }
}

/// Derivatives of all gradients along component `k`, at the pose of the shares.
///
/// `dx = (1 - tanh^2(bias + u)) C_k` where the component reaches, `dT = [J_l(r) dr]x R S + R dS`.
#[inline(always)]
pub(crate) fn tangents<L: Lanes>(decoder: &Decoder<'_>, k: usize, gradients: &mut [Gradient]) {
    let scales = &decoder.shares[k].scales;
    for (g, gradients) in gradients.chunks_mut(GROUP_NODES).enumerate() {
        let patches = decoder.patches_of(g);
        let owners = &decoder.patches.owners[patches.clone()];
        let Some(own) = owners.iter().position(|owner| owner[0] as usize == k) else {
            gradients.fill([[0.0; 4]; 3]);
            continue;
        };
        let b = owners[own][1];
        let block = owners.iter().position(|owner| owner[1] == b).unwrap_or(own);
        let values = &decoder.patches.values[patches.start + own];
        for lane in (0..gradients.len()).step_by(L::COUNT) {
            let (u, _) = block_blend::<L>(decoder, patches.start + block..patches.end, lane);
            let dx: Row<L> = core::array::from_fn(|c| {
                let y = tanh(u[c]);
                let slope = y.neg_mul_add(y, L::splat(1.0)).mul(L::splat(of_feature(scales, c)));
                slope.mul(L::load_whole(&values[c][lane..]))
            });
            let x = blend::<L>(decoder, patches.clone(), lane);
            store(&gradient_tangent(decoder.scales, &x, &dx), &mut gradients[lane..]);
        }
    }
}

impl Decoder<'_> {
    /// Marks the groups that a changed component touches. Shape: `[G]`.
    pub(crate) fn mark_touched(&self, touched: &mut [u8]) {
        let changed = |owner: &[u16; 2]| self.shares[owner[0] as usize].changed != 0;
        for (g, touched) in touched.iter_mut().enumerate() {
            *touched = u8::from(self.patches.owners[self.patches_of(g)].iter().any(changed));
        }
    }

    /// The patches of a group.
    #[inline(always)]
    pub(super) fn patches_of(&self, g: usize) -> core::ops::Range<usize> {
        self.patches.offsets[g] as usize..self.patches.offsets[g + 1] as usize
    }
}

/// Features: the sum over the blocks of `tanh(bias + sum_k z_k C_k) - tanh(bias)`, from one lane on.
#[inline(always)]
pub(super) fn blend<L: Lanes>(decoder: &Decoder<'_>, patches: core::ops::Range<usize>, lane: usize) -> Row<L> {
    let mut x = [L::splat(0.0); FEATURE_COUNT];
    let mut t = patches.start;
    while t < patches.end {
        let b = decoder.patches.owners[t][1];
        let (u, end) = block_blend::<L>(decoder, t..patches.end, lane);
        // A block at rest adds nothing.
        if decoder.patches.owners[t..end]
            .iter()
            .any(|owner| !decoder.shares[owner[0] as usize].is_zero())
        {
            let rest = &decoder.blocks[b as usize].activation;
            for c in 0..FEATURE_COUNT {
                x[c] = x[c].add(tanh(u[c]).sub(L::splat(rest[c])));
            }
        }
        t = end;
    }
    x
}

/// `bias + sum_k z_k C_k` of the block that the first patch belongs to, and where its patches end.
#[inline(always)]
pub(super) fn block_blend<L: Lanes>(
    decoder: &Decoder<'_>,
    patches: core::ops::Range<usize>,
    lane: usize,
) -> (Row<L>, usize) {
    let owners = &decoder.patches.owners[patches.clone()];
    let values = &decoder.patches.values[patches.clone()];
    let b = owners[0][1];
    let mut u = decoder.blocks[b as usize].bias.map(L::splat);
    let mut count = 0;
    for (owner, values) in owners.iter().zip(values) {
        if owner[1] != b {
            break;
        }
        let share = &decoder.shares[owner[0] as usize];
        if !share.is_zero() {
            let [rotation, stretch] = [L::splat(share.factors[0]), L::splat(share.factors[1])];
            for c in 0..FEATURE_COUNT {
                let factor = if c < ROTATION_FEATURES { rotation } else { stretch };
                u[c] = L::load_whole(&values[c][lane..]).mul_add(factor, u[c]);
            }
        }
        count += 1;
    }
    (u, patches.start + count)
}

/// `D = exp([r]x) S - I` by rows.
#[inline(always)]
pub(super) fn gradient<L: Lanes>(scales: FeatureScales, x: &Row<L>) -> Row<L> {
    let e = rotation_less_identity(&log_rotation(scales, x)).0;
    let p = stretch_less_identity(scales, x);
    // (I + E)(I + P) - I = E + P + E P: no difference of near-equal numbers.
    core::array::from_fn(|n| {
        let (i, j) = (n / 3, n % 3);
        e[i][j].add(p[i][j]).add(product(&e, &p, i, j))
    })
}

/// Derivative of the gradient when the features move along `dx`, by rows.
#[inline(always)]
fn gradient_tangent<L: Lanes>(scales: FeatureScales, x: &Row<L>, dx: &Row<L>) -> Row<L> {
    let r = log_rotation(scales, x);
    let (e, turn) = rotation_less_identity(&r);
    let w = left_jacobian(&r, &log_rotation(scales, dx), &turn);
    let (rotation, stretch) = (plus_identity(e), plus_identity(stretch_less_identity(scales, x)));
    let deformation: Matrix<L> = core::array::from_fn(|i| core::array::from_fn(|j| product(&rotation, &stretch, i, j)));
    let stretched = stretch_less_identity(scales, dx);
    let turned = |i: usize, j: usize| {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        w[a].mul(deformation[b][j]).sub(w[b].mul(deformation[a][j]))
    };
    core::array::from_fn(|n| turned(n / 3, n % 3).add(product(&rotation, &stretched, n / 3, n % 3)))
}

/// `J_l(r) dr`: the angular velocity, in the deformed frame, of `exp([r + t dr]x)`.
///
/// `J_l = a I + b [r]x + c r r^T` with `a = sin t / t`, `b = (1 - cos t) / t^2` and `c = (t - sin t) / t^3`.
#[inline(always)]
fn left_jacobian<L: Lanes>(r: &[L; 3], dr: &[L; 3], turn: &HalfTurn<L>) -> [L; 3] {
    let [a, b, c] = turn.jacobian();
    let along = c.mul(dot(r, dr));
    core::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let across = r[j].mul(dr[k]).sub(r[k].mul(dr[j]));
        along.mul_add(r[i], b.mul_add(across, a.mul(dr[i])))
    })
}

impl<L: Lanes> HalfTurn<L> {
    /// a, b and c of [`left_jacobian`].
    #[inline(always)]
    pub(super) fn jacobian(&self) -> [L; 3] {
        /// Below this squared angle a series: the closed form cancels.
        const SERIES_ANGLE_SQUARED: f32 = 1.0;
        let twice = self.sine.add(self.sine);
        let (a, b) = (twice.mul(self.cosine), twice.mul(self.sine));
        let t = self.angle_squared;
        let series = [1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0];
        let series = series
            .into_iter()
            .fold(L::splat(0.0), |sum, term| sum.mul_add(t, L::splat(term)));
        let closed = L::splat(1.0).sub(a).div(t);
        let c = t.select_below(L::splat(SERIES_ANGLE_SQUARED), L::splat(0.0).sub(series), closed);
        [a, b, c]
    }
}

/// One entry of `A B`.
#[inline(always)]
pub(super) fn product<L: Lanes>(a: &Matrix<L>, b: &Matrix<L>, i: usize, j: usize) -> L {
    a[i][2].mul_add(b[2][j], a[i][1].mul_add(b[1][j], a[i][0].mul(b[0][j])))
}

#[inline(always)]
pub(super) fn plus_identity<L: Lanes>(mut a: Matrix<L>) -> Matrix<L> {
    for i in 0..3 {
        a[i][i] = a[i][i].add(L::splat(1.0));
    }
    a
}

/// Angles in radians and stretches nearer to zero are zero. Products of two that are left, and of one with such a product,
/// are normal numbers: so are the gradients, whose denormals would cost many times their share of a frame.
pub(crate) const FEATURE_FLUSH_BELOW: f32 = 1e-12;

#[inline(always)]
fn flushed<L: Lanes, const N: usize>(mut row: [L; N]) -> [L; N] {
    let (limit, zero) = (L::splat(FEATURE_FLUSH_BELOW), L::splat(0.0));
    for x in &mut row {
        let magnitude = x.max(zero.sub(*x));
        *x = magnitude.select_below(limit, zero, *x);
    }
    row
}

#[inline(always)]
pub(super) fn log_rotation<L: Lanes>(scales: FeatureScales, x: &Row<L>) -> [L; 3] {
    flushed(core::array::from_fn(|c| L::splat(scales.rotation).mul(x[c])))
}

/// `S - I`.
#[inline(always)]
pub(super) fn stretch_less_identity<L: Lanes>(scales: FeatureScales, x: &Row<L>) -> Matrix<L> {
    let s: [L; 6] = flushed(core::array::from_fn(|c| L::splat(scales.stretch).mul(x[3 + c])));
    [[s[0], s[1], s[2]], [s[1], s[3], s[4]], [s[2], s[4], s[5]]]
}

/// What Rodrigues' formula knows besides the matrix.
pub(super) struct HalfTurn<L> {
    /// `|r|^2`.
    angle_squared: L,
    /// `sin(|r| / 2) / |r|`, up to the sign that it shares with `cosine`.
    sine: L,
    /// `cos(|r| / 2)`.
    cosine: L,
}

/// `exp([r]x) - I = 2 w [v]x + 2 [v]x^2` with the quaternion `(w, v)` of the rotation: squares and products only.
#[inline(always)]
pub(super) fn rotation_less_identity<L: Lanes>(r: &[L; 3]) -> (Matrix<L>, HalfTurn<L>) {
    let angle_squared = dot(r, r);
    let [sine, cosine] = half_angle(angle_squared.sqrt());
    let v = r.map(|x| x.mul(sine));
    let twice = v.map(|x| x.add(x));
    let w = twice.map(|x| x.mul(cosine));
    let square = [v[0].mul(twice[0]), v[1].mul(twice[1]), v[2].mul(twice[2])];
    let [xy, xz, yz] = [v[0].mul(twice[1]), v[0].mul(twice[2]), v[1].mul(twice[2])];
    let zero = L::splat(0.0);
    let diagonal = |i: usize, j: usize| zero.sub(square[i]).sub(square[j]);
    let matrix = [
        [diagonal(1, 2), xy.sub(w[2]), xz.add(w[1])],
        [xy.add(w[2]), diagonal(0, 2), yz.sub(w[0])],
        [xz.sub(w[1]), yz.add(w[0]), diagonal(0, 1)],
    ];
    let turn = HalfTurn {
        angle_squared,
        sine,
        cosine,
    };
    (matrix, turn)
}

#[inline(always)]
pub(super) fn dot<L: Lanes>(a: &[L; 3], b: &[L; 3]) -> L {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul(b[0])))
}

/// Gradients by columns, for as many lanes as there are.
#[inline(always)]
fn store<L: Lanes>(d: &Row<L>, gradients: &mut [Gradient]) {
    for column in 0..3 {
        L::store_column(
            [d[column], d[3 + column], d[6 + column], L::splat(0.0)],
            column,
            gradients,
        );
    }
}
