//! Decode, a group of vertices at a time and all in registers: the sparse blend of the blocks' folded components, tanh,
//! the sum of the blocks, and the exponential map to deformation gradients (method sections 1 and 2).
//!
//! Written once for any [`Lanes`]. The decoder's convolution is folded into the components by the baker, because blend
//! and convolution are both linear: only `tanh(bias + sum_k z_k C_k)` is left for the frame. Gradients are kept as
//! `D = T - I`: rest gives exactly zero, and the solve then works on displacements, which keeps f32 accurate.

use sinew_formats::package::FEATURE_COUNT;

use super::functions::{half_angle, tanh};
use super::lanes::{GROUP_VERTICES, Lanes};

/// Nine numbers of each vertex of a group, number first.
pub(crate) type Group<T> = [[T; GROUP_VERTICES]; FEATURE_COUNT];
/// Nine vectors.
type Row<L> = [L; FEATURE_COUNT];
/// Row-major 3x3 of vectors.
type Matrix<L> = [[L; 3]; 3];

/// The components, by groups of vertices: G groups, T tiles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tiles<'a> {
    /// Shape: `[G + 1]`.
    pub(crate) offsets: &'a [u32],
    /// Component and block of each tile, ascending within a group. Shape: `[T]`.
    pub(crate) owners: &'a [[u16; 2]],
    /// IEEE half bits. Shape: `[T]`.
    pub(crate) values: &'a [Group<u16>],
}

/// What a component counts in this frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Share {
    /// Weight times the scale of the component's values; finite times any half.
    pub(crate) factor: f32,
    /// Not zero where it was another one in the frame before.
    pub(crate) changed: u32,
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
    pub(crate) tiles: Tiles<'a>,
    /// Shape: `[K]`.
    pub(crate) shares: &'a [Share],
    /// Shape: `[B]`.
    pub(crate) blocks: &'a [BlockRest],
    pub(crate) scales: FeatureScales,
    /// Where the gradients of each vertex go. Shape: `[V]`; `G = ceil(V / GROUP_VERTICES)`.
    pub(crate) places: &'a [u32],
}

/// Fills in the activations of the biases.
#[inline(always)]
pub(crate) fn rest_activations<L: Lanes>(blocks: &mut [BlockRest]) {
    for block in blocks {
        for c in 0..FEATURE_COUNT {
            let mut lanes = [0.0; GROUP_VERTICES];
            tanh(L::splat(block.bias[c])).store(&mut lanes);
            block.activation[c] = lanes[0];
        }
    }
}

/// Features and gradients of the groups that a changed component touches; the others stay.
///
/// Shape: `features` `[G]`; `gradients` as `places` say.
#[inline(always)]
pub(crate) fn decode<L: Lanes>(decoder: &Decoder<'_>, features: &mut [Group<f32>], gradients: &mut [[f32; 4]]) {
    for (g, features) in features.iter_mut().enumerate() {
        let tiles = decoder.tiles.of(g);
        let changed = |owner: &[u16; 2]| decoder.shares[owner[0] as usize].changed != 0;
        if !decoder.tiles.owners[tiles.clone()].iter().any(changed) {
            continue;
        }
        let places = &decoder.places[g * GROUP_VERTICES..decoder.places.len().min((g + 1) * GROUP_VERTICES)];
        for lane in (0..places.len()).step_by(L::COUNT) {
            let x = blend::<L>(decoder, tiles.clone(), lane);
            for c in 0..FEATURE_COUNT {
                x[c].store(&mut features[c][lane..]);
            }
            let places = &places[lane..places.len().min(lane + L::COUNT)];
            scatter(&gradient(decoder.scales, &x), places, gradients);
        }
    }
}

impl Tiles<'_> {
    /// The tiles of a group.
    #[inline(always)]
    fn of(&self, g: usize) -> core::ops::Range<usize> {
        self.offsets[g] as usize..self.offsets[g + 1] as usize
    }
}

/// Features: the sum over the blocks of `tanh(bias + sum_k z_k C_k) - tanh(bias)`, from one lane on.
#[inline(always)]
fn blend<L: Lanes>(decoder: &Decoder<'_>, tiles: core::ops::Range<usize>, lane: usize) -> Row<L> {
    let mut x = [L::splat(0.0); FEATURE_COUNT];
    let owners = &decoder.tiles.owners[tiles.clone()];
    let values = &decoder.tiles.values[tiles];
    let mut t = 0;
    while t < owners.len() {
        let b = owners[t][1];
        let block = &decoder.blocks[b as usize];
        let mut u = block.bias.map(L::splat);
        let mut moved = false;
        while t < owners.len() && owners[t][1] == b {
            let factor = decoder.shares[owners[t][0] as usize].factor;
            if factor != 0.0 {
                moved = true;
                let factor = L::splat(factor);
                for c in 0..FEATURE_COUNT {
                    u[c] = L::load_halves(&values[t][c][lane..]).mul_add(factor, u[c]);
                }
            }
            t += 1;
        }
        // A block at rest adds nothing.
        if moved {
            for c in 0..FEATURE_COUNT {
                x[c] = x[c].add(tanh(u[c]).sub(L::splat(block.activation[c])));
            }
        }
    }
    x
}

/// `D = exp([r]x) S - I` by rows.
#[inline(always)]
fn gradient<L: Lanes>(scales: FeatureScales, x: &Row<L>) -> Row<L> {
    let e = rotation_less_identity(&log_rotation(scales, x)).0;
    let p = stretch_less_identity(scales, x);
    // (I + E)(I + P) - I = E + P + E P: no difference of near-equal numbers.
    core::array::from_fn(|n| {
        let (i, j) = (n / 3, n % 3);
        let sum = e[i][j].add(p[i][j]);
        e[i][2].mul_add(p[2][j], e[i][1].mul_add(p[1][j], e[i][0].mul_add(p[0][j], sum)))
    })
}

#[inline(always)]
fn log_rotation<L: Lanes>(scales: FeatureScales, x: &Row<L>) -> [L; 3] {
    core::array::from_fn(|c| L::splat(scales.rotation).mul(x[c]))
}

/// `S - I`.
#[inline(always)]
fn stretch_less_identity<L: Lanes>(scales: FeatureScales, x: &Row<L>) -> Matrix<L> {
    let s: [L; 6] = core::array::from_fn(|c| L::splat(scales.stretch).mul(x[3 + c]));
    [[s[0], s[1], s[2]], [s[1], s[3], s[4]], [s[2], s[4], s[5]]]
}

/// What Rodrigues' formula knows besides the matrix.
struct HalfTurn<L> {
    /// `|r|^2`.
    angle_squared: L,
    /// `sin(|r| / 2) / |r|`, up to the sign that it shares with `cosine`.
    sine: L,
    /// `cos(|r| / 2)`.
    cosine: L,
}

/// `exp([r]x) - I = 2 w [v]x + 2 [v]x^2` with the quaternion `(w, v)` of the rotation: squares and products only.
#[inline(always)]
fn rotation_less_identity<L: Lanes>(r: &[L; 3]) -> (Matrix<L>, HalfTurn<L>) {
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
fn dot<L: Lanes>(a: &[L; 3], b: &[L; 3]) -> L {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul(b[0])))
}

/// Gradients to their vertices: three columns of four numbers each, the last one zero.
#[inline(always)]
fn scatter<L: Lanes>(d: &Row<L>, places: &[u32], gradients: &mut [[f32; 4]]) {
    for column in 0..3 {
        let rows = [d[column], d[3 + column], d[6 + column], L::splat(0.0)];
        L::scatter(rows, places, 3, column, gradients);
    }
}
