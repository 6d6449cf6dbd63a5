//! The frame backwards, for vertices that are held: where they are, and how far each weight moves them, without a solve.
//!
//! Behind the decode everything is linear: `p_h = r_h + sum_v D_v g_v` with the *pull* of the vertex,
//! `g_v = 1/2 sum_j c_vj (a_v - a_j)(r_v - r_j)`, where `a = L^-1 e_h` is the vertex' row of the inverse. That is the right-hand
//! side of [`super::solve`], transposed; it is made once, when the vertex is taken hold of.
//!
//! Written once for any [`Lanes`], like [`super::decode`], whose blend and exponential map these share.

use sinew_formats::package::{FEATURE_COUNT, GROUP_NODES, Index};

use super::decode::{
    Decoder, Group, Matrix, Row, blend, block_blend, dot, gradient, log_rotation, of_feature, plus_identity, product,
    rotation_less_identity, stretch_less_identity,
};
use super::functions::tanh;
use super::lanes::Lanes;
use super::solve::{Quad, Rings, place};

/// Handles that share one walk over the components.
pub(crate) const TOGETHER: usize = 4;

/// Pull of a held vertex on a group: x, y and z.
pub(crate) type Pull = [[f32; GROUP_NODES]; 3];
/// Lane-wise sums of the x, y and z of up to [`TOGETHER`] held vertices.
pub(crate) type HeldSums = [Pull; TOGETHER];

/// The pull of a vertex from its row of the inverse, which stands in the x of `row`. Shape: `rest` `[N]`, slots; `row` in solver
/// order; `pull` `[G]`, slots.
pub(crate) fn pull<I: Index>(rings: &Rings<'_, I>, rest: &[[f32; 3]], row: &[Quad], pull: &mut [Pull]) {
    pull.fill([[0.0; GROUP_NODES]; 3]);
    let inverse = |slot: usize| place(row, rings.solver_from_slot[slot])[0];
    for slot in 0..rest.len() {
        let (r, a) = (&rest[slot], inverse(slot));
        let ring = rings.offsets[slot] as usize..rings.offsets[slot + 1] as usize;
        let mut sum = [0.0_f32; 3];
        for (&j, &weight) in rings.neighbours[ring.clone()].iter().zip(&rings.weights[ring]) {
            let share = 0.5 * weight * (a - inverse(j.at()));
            let rj = &rest[j.at()];
            for c in 0..3 {
                sum[c] += share * (r[c] - rj[c]);
            }
        }
        for c in 0..3 {
            pull[slot / GROUP_NODES][c][slot % GROUP_NODES] = sum[c];
        }
    }
}

/// Features at the decoder's shares, and the displacement of the held vertices there, `sum_v D_v g_v`, by lanes.
///
/// Shape: `pulls` `[H][G]`, `features` `[G]`, `sums` `[ceil(H / TOGETHER)]`.
#[inline(always)]
pub(crate) fn held<L: Lanes>(
    decoder: &Decoder<'_>,
    pulls: &[Pull],
    features: &mut [Group<f32>],
    sums: &mut [HeldSums],
) {
    let group_count = features.len();
    sums.fill([[[0.0; GROUP_NODES]; 3]; TOGETHER]);
    for (g, features) in features.iter_mut().enumerate() {
        let patches = decoder.patches_of(g);
        for lane in (0..GROUP_NODES).step_by(L::COUNT) {
            let x = blend::<L>(decoder, patches.clone(), lane);
            for c in 0..FEATURE_COUNT {
                x[c].store(&mut features[c][lane..]);
            }
            let d = gradient(decoder.scales, &x);
            for (h, pull) in pulls.iter().skip(g).step_by(group_count).enumerate() {
                let pull = load::<L>(pull, lane);
                let sums = &mut sums[h / TOGETHER][h % TOGETHER];
                for c in 0..3 {
                    let row = [d[3 * c], d[3 * c + 1], d[3 * c + 2]];
                    L::load(&sums[c][lane..])
                        .add(dot(&row, &pull))
                        .store(&mut sums[c][lane..]);
                }
            }
        }
    }
}

/// Derivatives of up to [`TOGETHER`] held vertices by the weight of every component whose share is marked as changed,
/// by lanes, at the pose whose features these are.
///
/// Shape: `pulls` `[H][G]`, `features` `[G]`, `sums` `[K]`; zero where the share is not marked.
#[inline(always)]
pub(crate) fn derivatives<L: Lanes>(
    decoder: &Decoder<'_>,
    pulls: &[Pull],
    features: &[Group<f32>],
    sums: &mut [HeldSums],
) {
    let group_count = features.len();
    let held_count = pulls.len().checked_div(group_count).unwrap_or(0).min(TOGETHER);
    sums.fill([[[0.0; GROUP_NODES]; 3]; TOGETHER]);
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    for (g, features) in features.iter().enumerate() {
        let patches = decoder.patches_of(g);
        for lane in (0..GROUP_NODES).step_by(L::COUNT) {
            let mut x = [zero; FEATURE_COUNT];
            for c in 0..FEATURE_COUNT {
                x[c] = L::load(&features[c][lane..]);
            }
            let pose = Pose::new(decoder, &x);
            let mut adjoints = [[[zero; FEATURE_COUNT]; 3]; TOGETHER];
            for (h, pull) in pulls.iter().skip(g).step_by(group_count).take(TOGETHER).enumerate() {
                let pull = load::<L>(pull, lane);
                adjoints[h] = pose.adjoint(decoder, &pull);
            }
            let mut t = patches.start;
            while t < patches.end {
                let (u, end) = block_blend::<L>(decoder, t..patches.end, lane);
                let mut slope = [zero; FEATURE_COUNT];
                for c in 0..FEATURE_COUNT {
                    let y = tanh(u[c]);
                    slope[c] = y.neg_mul_add(y, one);
                }
                for t in t..end {
                    let k = decoder.patches.owners[t][0] as usize;
                    if decoder.shares[k].changed == 0 {
                        continue;
                    }
                    let (values, scales) = (&decoder.patches.values[t], &decoder.shares[k].scales);
                    let mut dx = [zero; FEATURE_COUNT];
                    for c in 0..FEATURE_COUNT {
                        let scale = L::splat(of_feature(scales, c));
                        dx[c] = L::load_whole(&values[c][lane..]).mul(scale).mul(slope[c]);
                    }
                    for (adjoint, sums) in adjoints[..held_count].iter().zip(&mut sums[k]) {
                        for c in 0..3 {
                            let mut sum = L::load(&sums[c][lane..]);
                            for i in 0..FEATURE_COUNT {
                                sum = adjoint[c][i].mul_add(dx[i], sum);
                            }
                            sum.store(&mut sums[c][lane..]);
                        }
                    }
                }
                t = end;
            }
        }
    }
}

/// A pull from one lane on. Loops, here and below: closures over arrays would not be compiled into the kernel.
#[inline(always)]
fn load<L: Lanes>(pull: &Pull, lane: usize) -> [L; 3] {
    [
        L::load(&pull[0][lane..]),
        L::load(&pull[1][lane..]),
        L::load(&pull[2][lane..]),
    ]
}

/// What the adjoints of all handles share at one group of vertices.
struct Pose<L> {
    r: [L; 3],
    /// Of `J_l`, see [`super::decode`].
    jacobian: [L; 3],
    rotation: Matrix<L>,
    deformation: Matrix<L>,
}

impl<L: Lanes> Pose<L> {
    #[inline(always)]
    fn new(decoder: &Decoder<'_>, x: &Row<L>) -> Self {
        let r = log_rotation(decoder.scales, x);
        let (e, turn) = rotation_less_identity(&r);
        let rotation = plus_identity(e);
        let stretch = plus_identity(stretch_less_identity(decoder.scales, x));
        let mut deformation = rotation;
        for i in 0..3 {
            for j in 0..3 {
                deformation[i][j] = product(&rotation, &stretch, i, j);
            }
        }
        Self {
            r,
            jacobian: turn.jacobian(),
            rotation,
            deformation,
        }
    }

    /// Derivative of x, y and z of the held vertex by the nine features. With `y = R S g`: by the log-rotation
    /// `J_l^T (y x e_c)`, by the stretch `R_c g^T`, both halves of the symmetric one.
    #[inline(always)]
    fn adjoint(&self, decoder: &Decoder<'_>, g: &[L; 3]) -> [Row<L>; 3] {
        let (rotation_scale, stretch_scale) = (L::splat(decoder.scales.rotation), L::splat(decoder.scales.stretch));
        let zero = L::splat(0.0);
        let (mut y, mut scaled) = ([zero; 3], [zero; 3]);
        for i in 0..3 {
            y[i] = dot(&self.deformation[i], g);
            scaled[i] = g[i].mul(stretch_scale);
        }
        let [a, b, along_axis] = self.jacobian;
        let r = &self.r;
        let mut adjoint = [[zero; FEATURE_COUNT]; 3];
        for c in 0..3 {
            let (j, k) = ((c + 1) % 3, (c + 2) % 3);
            let mut z = [zero; 3];
            z[j] = y[k];
            z[k] = zero.sub(y[j]);
            let along = along_axis.mul(dot(r, &z));
            let row = &self.rotation[c];
            let out = &mut adjoint[c];
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let turned = r[j].mul(z[k]).sub(r[k].mul(z[j]));
                let sum = along.mul_add(r[i], b.neg_mul_add(turned, a.mul(z[i])));
                out[i] = sum.mul(rotation_scale);
            }
            out[3] = row[0].mul(scaled[0]);
            out[4] = row[0].mul_add(scaled[1], row[1].mul(scaled[0]));
            out[5] = row[0].mul_add(scaled[2], row[2].mul(scaled[0]));
            out[6] = row[1].mul(scaled[1]);
            out[7] = row[1].mul_add(scaled[2], row[2].mul(scaled[1]));
            out[8] = row[2].mul(scaled[2]);
        }
        adjoint
    }
}
