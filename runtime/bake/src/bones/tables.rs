//! The tables that make bones of nodes, by ridge regression: gradients of a bone from the nodes around it, displacements from
//! all nodes and from the weights themselves.

use nalgebra::{Cholesky, DMatrix, Dyn};
use rayon::prelude::*;
use sinew_formats::package::TURN_NODES;

use super::cells::Cells;
use super::nodes::Nodes;
use super::{Matrix, Vector};

/// What holds a bone's turns to the plain mean of its nodes, as a share of the mean diagonal.
const TURN_RIDGE: f64 = 1e-4;
/// What holds pulls to nothing, as a share of the mean diagonal. **Measured**: a hundredth of it does the same.
const PULL_RIDGE: f64 = 1e-6;
/// What holds slides to nothing, of weights of unit mean square.
const SLIDE_RIDGE: f64 = 1e-5;
/// Poses that it takes to tell what one weight does; with fewer there are no slides.
const POSES_A_SLIDE: usize = 2;

/// The nodes around a bone, and the matrices by which their gradients less identity are mixed.
#[derive(Debug, Clone)]
pub(super) struct Turn {
    pub(super) nodes: Vec<usize>,
    /// Applied from the right. Shape: that of `nodes`.
    pub(super) matrices: Vec<Matrix>,
}

impl Turn {
    /// For each bone the plain mean of the nearest nodes, the nearer the more.
    pub(super) fn start(cells: &Cells, nodes: &Nodes) -> Vec<Self> {
        let of_bone = |place: &Vector| {
            let mut near: Vec<(f64, usize)> = nodes
                .centres
                .iter()
                .map(|centre| (centre - place).norm())
                .zip(0..)
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            near.truncate(TURN_NODES);
            let farthest = near.last().map_or(0.0, |last| 1.25 * last.0);
            let share = |distance: f64| {
                if farthest > 0.0 {
                    (1.0 - distance / farthest).powi(2)
                } else {
                    1.0
                }
            };
            let total: f64 = near.iter().map(|&(distance, _)| share(distance)).sum();
            Self {
                nodes: near.iter().map(|&(_, node)| node).collect(),
                matrices: near
                    .iter()
                    .map(|&(distance, _)| Matrix::identity() * (share(distance) / total))
                    .collect(),
            }
        };
        cells.centres.iter().map(of_bone).collect()
    }

    /// The gradient `T` of the bone. Shape: `nodes` `[N]`, `T` of the nodes.
    pub(super) fn gradient(&self, nodes: &[Matrix]) -> Matrix {
        let shares = self.nodes.iter().zip(&self.matrices);
        let mixed: Matrix = shares
            .map(|(&node, matrix)| (nodes[node] - Matrix::identity()) * matrix)
            .sum();
        Matrix::identity() + mixed
    }

    /// The same nodes, mixed so that some poses have the gradients that are wanted. Shape: `nodes` `[poses][N]`, `wanted` `[poses]`.
    fn fitted(&self, nodes: &[&Vec<Matrix>], wanted: impl Fn(usize) -> Matrix) -> Self {
        let width = 3 * self.nodes.len();
        let (mut gram, mut side) = (DMatrix::<f64>::zeros(width, width), DMatrix::<f64>::zeros(width, 3));
        let mut row = vec![0.0; width];
        for (pose, nodes) in nodes.iter().enumerate() {
            let wanted = wanted(pose) - Matrix::identity();
            for c in 0..3 {
                for (n, &node) in self.nodes.iter().enumerate() {
                    for i in 0..3 {
                        row[3 * n + i] = nodes[node][(c, i)] - if c == i { 1.0 } else { 0.0 };
                    }
                }
                for a in 0..width {
                    (0..=a).for_each(|b| gram[(a, b)] += row[a] * row[b]);
                    (0..3).for_each(|b| side[(a, b)] += row[a] * wanted[(c, b)]);
                }
            }
        }
        gram.fill_upper_triangle_with_lower_triangle();
        let hold = TURN_RIDGE * gram.trace() / width as f64 + f64::MIN_POSITIVE;
        for a in 0..width {
            gram[(a, a)] += hold;
            side[(a, a % 3)] += hold / self.nodes.len() as f64;
        }
        let Some(factor) = gram.cholesky() else {
            return self.clone();
        };
        let solved = factor.solve(&side);
        Self {
            nodes: self.nodes.clone(),
            matrices: (0..self.nodes.len())
                .map(|n| solved.fixed_view::<3, 3>(3 * n, 0).into_owned())
                .collect(),
        }
    }
}

/// Turns of all bones for the gradients that are wanted. Shape: `nodes` `[poses][N]`, `wanted` `[poses][B]`.
pub(super) fn fit_turns(turns: &[Turn], nodes: &[&Vec<Matrix>], wanted: &[Vec<Matrix>]) -> Vec<Turn> {
    let fit = |(bone, turn): (usize, &Turn)| turn.fitted(nodes, |pose| wanted[pose][bone]);
    turns.par_iter().enumerate().map(fit).collect()
}

/// What makes displacements: pulls of the nodes and slides of the weights. Shape: `[B][N]` and `[B][K]`.
#[derive(Debug, Clone)]
pub(super) struct Places {
    pub(super) pulls: Vec<Vec<Vector>>,
    pub(super) slides: Vec<Vec<Vector>>,
}

/// The regression of displacements, factored once: only what is wanted changes from round to round.
///
/// For each coordinate `d_c = X_c a + Z s_c`, with the nodes' gradients X, the weights Z, pulls a that all coordinates share and slides s of
/// each. Slides are eliminated first: a solves the sum over c of `X_c^T (1 - P) X_c`, where P projects onto the weights.
pub(super) struct PlaceFit {
    /// Row c of all nodes' gradients less identity, pose by pose. Shape: `[M][3 N]`.
    x: [DMatrix<f64>; 3],
    slides: Option<SlideFit>,
    factor: Option<Cholesky<f64, Dyn>>,
    components: usize,
}

struct SlideFit {
    /// Weights over their root mean squares. Shape: `[M][K]`.
    z: DMatrix<f64>,
    scales: Vec<f64>,
    factor: Cholesky<f64, Dyn>,
    /// `Z^T X_c`. Shape: `[K][3 N]`.
    crossed: [DMatrix<f64>; 3],
}

impl PlaceFit {
    /// Shape: `nodes` `[M][N]`, `weights` `[M][K]`.
    pub(super) fn new(nodes: &[Vec<Matrix>], weights: &[Vec<f32>]) -> Self {
        let width = 3 * nodes[0].len();
        let rows = |c: usize| {
            DMatrix::from_fn(nodes.len(), width, |m, j| {
                nodes[m][j / 3][(c, j % 3)] - if c == j % 3 { 1.0 } else { 0.0 }
            })
        };
        let x = [0, 1, 2].map(rows);
        let slides = SlideFit::new(weights, &x);
        let grams: Vec<DMatrix<f64>> = (0..3).into_par_iter().map(|c| x[c].tr_mul(&x[c])).collect();
        let mut gram = grams.into_iter().reduce(|sum, own| sum + own).unwrap_or_default();
        let hold = PULL_RIDGE * gram.trace() / width as f64 + f64::MIN_POSITIVE;
        if let Some(slides) = &slides {
            let explained: Vec<DMatrix<f64>> = slides
                .crossed
                .par_iter()
                .map(|crossed| crossed.tr_mul(&slides.factor.solve(crossed)))
                .collect();
            explained.iter().for_each(|own| gram -= own);
        }
        (0..width).for_each(|n| gram[(n, n)] += hold);
        Self {
            x,
            slides,
            factor: gram.cholesky(),
            components: weights[0].len(),
        }
    }

    /// Tables for displacements that are wanted. Shape: `wanted` `[M][B]`.
    pub(super) fn fit(&self, wanted: &[Vec<Vector>]) -> Places {
        let (bones, width) = (wanted[0].len(), self.x[0].ncols());
        let y = [0, 1, 2].map(|c| DMatrix::from_fn(wanted.len(), bones, |m, b| wanted[m][b][c]));
        let sides: Vec<DMatrix<f64>> = (0..3)
            .into_par_iter()
            .map(|c| {
                let mut side = self.x[c].tr_mul(&y[c]);
                if let Some(slides) = &self.slides {
                    let own = slides.factor.solve(&slides.z.tr_mul(&y[c]));
                    side -= slides.crossed[c].tr_mul(&own);
                }
                side
            })
            .collect();
        let side = sides.into_iter().reduce(|sum, own| sum + own).unwrap_or_default();
        let pulls = self
            .factor
            .as_ref()
            .map_or_else(|| DMatrix::zeros(width, bones), |factor| factor.solve(&side));
        let pull = |b: usize, n: usize| Vector::from_fn(|i, _| pulls[(3 * n + i, b)]);
        let mut slid = vec![vec![Vector::zeros(); self.components]; bones];
        if let Some(slides) = &self.slides {
            for c in 0..3 {
                let left = slides.z.tr_mul(&y[c]) - &slides.crossed[c] * &pulls;
                let own = slides.factor.solve(&left);
                for (b, row) in slid.iter_mut().enumerate() {
                    row.iter_mut()
                        .enumerate()
                        .for_each(|(k, slide)| slide[c] = own[(k, b)] / slides.scales[k]);
                }
            }
        }
        Places {
            pulls: (0..bones)
                .map(|b| (0..width / 3).map(|n| pull(b, n)).collect())
                .collect(),
            slides: slid,
        }
    }

    /// What the tables make of the poses. Shape: `[M][B]`.
    pub(super) fn play(&self, places: &Places, weights: &[Vec<f32>]) -> Vec<Vec<Vector>> {
        let poses = (0..weights.len()).into_par_iter().map(|m| {
            let of_bone = |b: usize| {
                let mut place = Vector::zeros();
                for (n, pull) in places.pulls[b].iter().enumerate() {
                    for c in 0..3 {
                        place[c] += (0..3).map(|i| self.x[c][(m, 3 * n + i)] * pull[i]).sum::<f64>();
                    }
                }
                let slides = places.slides[b].iter().zip(&weights[m]);
                place + slides.map(|(slide, &weight)| slide * f64::from(weight)).sum::<Vector>()
            };
            (0..places.pulls.len()).map(of_bone).collect()
        });
        poses.collect()
    }
}

impl SlideFit {
    /// None where there are too few poses for so many weights.
    fn new(weights: &[Vec<f32>], x: &[DMatrix<f64>; 3]) -> Option<Self> {
        let (poses, components) = (weights.len(), weights[0].len());
        if POSES_A_SLIDE * components > poses {
            return None;
        }
        let square = |k: usize| weights.iter().map(|w| f64::from(w[k]).powi(2)).sum::<f64>() / poses as f64;
        let scale = |k: usize| Some(square(k).sqrt()).filter(|&x| x > 0.0).unwrap_or(1.0);
        let scales: Vec<f64> = (0..components).map(scale).collect();
        let z = DMatrix::from_fn(poses, components, |m, k| f64::from(weights[m][k]) / scales[k]);
        let mut gram = z.tr_mul(&z);
        (0..components).for_each(|k| gram[(k, k)] += SLIDE_RIDGE * poses as f64);
        let crossed = [0, 1, 2].map(|c| z.tr_mul(&x[c]));
        Some(Self {
            factor: gram.cholesky()?,
            z,
            scales,
            crossed,
        })
    }
}
