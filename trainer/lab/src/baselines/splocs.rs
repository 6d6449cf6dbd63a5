//! Sparse localized deformation components: Neumann, Varanasi, Wenger, Wacker, Magnor, Theobalt, *Sparse Localized
//! Deformation Components* (ACM TOG 2013, sections 3 and 4). Minimises `|X - W C|^2 + sum_k sum_e Lambda_ke |C_ke|_2` with
//! weights in [0, 1] whose greatest is 1, by turns over W (block coordinate descent) and C (ADMM). X is measured from the first
//! sample, the authors' default: from a mean, weights that are never negative could go one way only.
//!
//! Values are of any width an element: positions of vertices (3), as in the paper; features (9), as its successors do;
//! rotations and stretches of faces.

use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

use super::linear::{LinearBasis, product};

/// A component whose squared length falls below this has no weights of its own.
const ZERO_COMPONENT: f64 = 1e-8;

/// The paper's parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct SplocsSettings {
    /// K.
    pub component_count: usize,
    /// Distances from a component's centre, as shares of the longest on the mesh: up to the first sparsity costs nothing,
    /// from the second it costs all (d_min, d_max).
    pub support: [f64; 2],
    /// Lambda, on values scaled to unit variance.
    pub sparsity: f64,
    /// Penalty of the ADMM.
    pub penalty: f64,
    /// Turns over weights and components.
    pub rounds: usize,
    /// ADMM iterations in each.
    pub inner_rounds: usize,
}

impl SplocsSettings {
    /// As published: support 0.1 to 0.7, lambda 2, penalty 10, ten by ten rounds.
    pub fn published(component_count: usize) -> Self {
        Self {
            component_count,
            support: [0.1, 0.7],
            sparsity: 2.0,
            penalty: 10.0,
            rounds: 10,
            inner_rounds: 10,
        }
    }
}

/// Factors `samples` (shape `[N][E x width]`, at least one; the first is the rest state). `distances(e)` gives distances of all elements from element e along the
/// surface, shape `[E]`, the longest on the mesh being 1. The same bits for any number of threads.
pub fn splocs(
    samples: &[Vec<f64>],
    width: usize,
    distances: &(dyn Fn(usize) -> Vec<f32> + Sync),
    settings: &SplocsSettings,
) -> LinearBasis {
    let Start {
        deviation,
        scaled,
        residual,
        weights,
        components,
    } = greedy_start(samples, &samples[0], width, distances, settings, false);
    let mut state = State {
        samples: &scaled,
        width,
        distances,
        settings,
        residual,
        weights,
        components,
    };
    for _ in 0..settings.rounds {
        state.update_weights();
        state.update_components();
    }
    let mut directions = state.components;
    directions.iter_mut().flatten().for_each(|x| *x *= deviation);
    LinearBasis {
        width,
        mean: samples[0].clone(),
        directions,
    }
}

/// Where the turns begin: everything less an origin, in values of unit variance.
pub(super) struct Start {
    /// Units of the samples in one of the values; 1 where nothing moves.
    pub deviation: f64,
    /// The samples, less the origin and scaled. Shape: `[N][D]`.
    pub scaled: Vec<Vec<f64>>,
    /// What the components leave of them. Shape: `[N][D]`.
    pub residual: Vec<Vec<f64>>,
    /// Shape: `[K][N]`.
    pub weights: Vec<Vec<f64>>,
    /// Shape: `[K][D]`.
    pub components: Vec<Vec<f64>>,
}

/// Components one by one, each where most is left to explain. `signed` lets weights be any, instead of in [0, 1].
pub(super) fn greedy_start(
    samples: &[Vec<f64>],
    origin: &[f64],
    width: usize,
    distances: &(dyn Fn(usize) -> Vec<f32> + Sync),
    settings: &SplocsSettings,
    signed: bool,
) -> Start {
    let length = samples.first().map_or(0, Vec::len);
    let mut scaled: Vec<Vec<f64>> = samples
        .par_iter()
        .map(|x| x.iter().zip(origin).map(|(x, origin)| x - origin).collect())
        .collect();
    let energy: f64 = scaled.iter().map(|x| product(x, x)).sum();
    let deviation = (energy / (length * samples.len()).max(1) as f64).sqrt();
    let deviation = if deviation > 0.0 { deviation } else { 1.0 };
    scaled.iter_mut().flatten().for_each(|x| *x /= deviation);
    let mut state = State {
        samples: &scaled,
        width,
        distances,
        settings,
        residual: scaled.clone(),
        weights: Vec::new(),
        components: Vec::new(),
    };
    state.start(signed);
    let State {
        residual,
        weights,
        components,
        ..
    } = state;
    Start {
        deviation,
        scaled,
        residual,
        weights,
        components,
    }
}

struct State<'a> {
    /// Less the first, unit variance. Shape: `[N][D]`.
    samples: &'a [Vec<f64>],
    width: usize,
    distances: &'a (dyn Fn(usize) -> Vec<f32> + Sync),
    settings: &'a SplocsSettings,
    /// `X - W C`. Shape: `[N][D]`.
    residual: Vec<Vec<f64>>,
    /// Transposed W. Shape: `[K][N]`.
    weights: Vec<Vec<f64>>,
    /// C. Shape: `[K][D]`.
    components: Vec<Vec<f64>>,
}

impl State<'_> {
    /// Components one by one: each explains the element of greatest residual, faded out with the distance from it.
    fn start(&mut self, signed: bool) {
        let width = self.width;
        let element_count = self.residual[0].len() / width;
        for _ in 0..self.settings.component_count {
            let energies: Vec<f64> = (0..element_count)
                .into_par_iter()
                .map(|e| {
                    let values = self.residual.iter().flat_map(|x| &x[e * width..(e + 1) * width]);
                    values.map(|x| x * x).sum()
                })
                .collect();
            let centre = greatest(&energies);
            let weights = explaining_weights(&self.residual, centre, width, signed);
            let squared = product(&weights, &weights);
            let support = self.support(centre);
            let mut component = vec![0.0; element_count * width];
            if squared > 0.0 {
                for (weight, residual) in weights.iter().zip(&self.residual) {
                    for (sum, x) in component.iter_mut().zip(residual) {
                        *sum += weight / squared * x;
                    }
                }
                for (x, cost) in component.chunks_exact_mut(width).zip(&support) {
                    x.iter_mut().for_each(|x| *x *= 1.0 - cost);
                }
            }
            self.residual
                .par_iter_mut()
                .zip(&weights)
                .for_each(|(residual, weight)| {
                    for (x, component) in residual.iter_mut().zip(&component) {
                        *x -= weight * component;
                    }
                });
            self.weights.push(weights);
            self.components.push(component);
        }
    }

    /// What sparsity costs around `centre`: 0 near it, 1 far from it. Shape: `[E]`.
    fn support(&self, centre: usize) -> Vec<f64> {
        let [near, far] = self.settings.support;
        (self.distances)(centre)
            .into_iter()
            .map(|distance| ((f64::from(distance) - near) / (far - near)).clamp(0.0, 1.0))
            .collect()
    }

    fn update_weights(&mut self) {
        for (weights, component) in self.weights.iter_mut().zip(&self.components) {
            let squared = product(component, component);
            if squared <= ZERO_COMPONENT {
                // The residual gets back what little the component had explained.
                let old = core::mem::replace(weights, vec![0.0; weights.len()]);
                subtract(
                    &mut self.residual,
                    component,
                    &old.iter().map(|w| -w).collect::<Vec<_>>(),
                );
                continue;
            }
            let best: Vec<f64> = self
                .residual
                .par_iter()
                .zip(&*weights)
                .map(|(residual, weight)| product(residual, component) / squared + weight)
                .collect();
            let best = onto_unit_range(&best);
            let change: Vec<f64> = best.iter().zip(&*weights).map(|(new, old)| new - old).collect();
            subtract(&mut self.residual, component, &change);
            *weights = best;
        }
    }

    fn update_components(&mut self) {
        let width = self.width;
        let component_count = self.components.len();
        let element_count = self.residual[0].len() / width;
        let costs: Vec<Vec<f64>> = self
            .components
            .par_iter()
            .map(|component| {
                let energies: Vec<f64> = component
                    .chunks_exact(width)
                    .map(|x| x.iter().map(|x| x * x).sum())
                    .collect();
                self.support(greatest(&energies))
            })
            .collect();
        let penalty = self.settings.penalty;
        let gram = DMatrix::from_fn(component_count, component_count, |i, j| {
            let shift = if i == j { penalty } else { 0.0 };
            product(&self.weights[i], &self.weights[j]) + shift
        });
        // Positive definite by the penalty.
        let Some(inverse) = gram.try_inverse() else { return };
        let this = &*self;
        // Given W, elements do not know of each other: each runs all its iterations on its own. Shape: [E][width][K].
        let elements: Vec<Vec<f64>> = (0..element_count)
            .into_par_iter()
            .map(|e| this.solve_element(e, &inverse, &costs))
            .collect();
        self.components.par_iter_mut().enumerate().for_each(|(k, component)| {
            for (x, element) in component.chunks_exact_mut(width).zip(&elements) {
                for c in 0..width {
                    x[c] = element[c * component_count + k];
                }
            }
        });
        self.residual = self.samples.to_vec();
        for (component, weights) in self.components.iter().zip(&self.weights) {
            subtract(&mut self.residual, component, weights);
        }
    }

    /// ADMM on one element: `min |x - W c|^2 / 2 + sum_k cost_k |c_k|`. Returns c, shape `[width][K]`.
    fn solve_element(&self, e: usize, inverse: &DMatrix<f64>, costs: &[Vec<f64>]) -> Vec<f64> {
        let (width, count) = (self.width, self.components.len());
        let penalty = self.settings.penalty;
        let mut explained = vec![0.0; width * count];
        let mut split = vec![0.0; width * count];
        for (k, (weights, component)) in self.weights.iter().zip(&self.components).enumerate() {
            for c in 0..width {
                let d = e * width + c;
                split[c * count + k] = component[d];
                explained[c * count + k] = self.samples.iter().zip(weights).map(|(x, w)| w * x[d]).sum();
            }
        }
        let mut dual = vec![0.0; width * count];
        let mut free = vec![0.0; width * count];
        for _ in 0..self.settings.inner_rounds {
            for c in 0..width {
                let row = c * count..(c + 1) * count;
                let sum = &mut free[row.clone()];
                sum.fill(0.0);
                for (j, column) in row.zip(inverse.as_slice().chunks_exact(count)) {
                    let right = explained[j] + penalty * (split[j] - dual[j]);
                    for (sum, x) in sum.iter_mut().zip(column) {
                        *sum += right * x;
                    }
                }
            }
            for k in 0..count {
                let squared: f64 = (0..width)
                    .map(|c| (free[c * count + k] + dual[c * count + k]).powi(2))
                    .sum();
                let threshold = self.settings.sparsity * costs[k][e] / penalty;
                let norm = squared.sqrt();
                let shrink = if norm > threshold { 1.0 - threshold / norm } else { 0.0 };
                for c in 0..width {
                    let at = c * count + k;
                    let moved = free[at] + dual[at];
                    split[at] = shrink * moved;
                    dual[at] = moved - split[at];
                }
            }
        }
        split
    }
}

/// `residual_n -= weights_n component`.
fn subtract(residual: &mut [Vec<f64>], component: &[f64], weights: &[f64]) {
    residual.par_iter_mut().zip(weights).for_each(|(residual, &weight)| {
        if weight != 0.0 {
            for (x, component) in residual.iter_mut().zip(component) {
                *x -= weight * component;
            }
        }
    });
}

/// Weights of the one direction that explains most of what an element does: as they are where `signed`, or of both signs the
/// one that fits the range better.
fn explaining_weights(residual: &[Vec<f64>], element: usize, width: usize, signed: bool) -> Vec<f64> {
    let values: Vec<&[f64]> = residual
        .iter()
        .map(|x| &x[element * width..(element + 1) * width])
        .collect();
    let moments = DMatrix::from_fn(width, width, |i, j| values.iter().map(|x| x[i] * x[j]).sum::<f64>());
    let eigen = SymmetricEigen::new(moments);
    let direction = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    let along: Vec<f64> = values
        .iter()
        .map(|x| x.iter().zip(direction.iter()).map(|(x, d)| x * d).sum())
        .collect();
    if signed {
        return along;
    }
    let against: Vec<f64> = along.iter().map(|x| -x).collect();
    let (positive, negative) = (onto_unit_range(&along), onto_unit_range(&against));
    if product(&positive, &positive) >= product(&negative, &negative) {
        positive
    } else {
        negative
    }
}

/// Nothing below 0, the greatest 1; zeros where nothing is above 0.
fn onto_unit_range(weights: &[f64]) -> Vec<f64> {
    let most = weights.iter().copied().fold(0.0, f64::max);
    let scale = if most > 0.0 { 1.0 / most } else { 0.0 };
    weights.iter().map(|w| w.max(0.0) * scale).collect()
}

/// The first of the greatest.
fn greatest(values: &[f64]) -> usize {
    (0..values.len())
        .rev()
        .max_by(|&a, &b| values[a].total_cmp(&values[b]))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ELEMENTS: usize = 40;

    /// Distances on a line of elements.
    fn line(e: usize) -> Vec<f32> {
        (0..ELEMENTS)
            .map(|j| e.abs_diff(j) as f32 / (ELEMENTS - 1) as f32)
            .collect()
    }

    /// Two bumps far apart, moved independently, with weights in [0, 1].
    fn planted() -> (Vec<Vec<f64>>, [Vec<f64>; 2]) {
        let bump = |centre: f64, direction: [f64; 3]| -> Vec<f64> {
            (0..ELEMENTS)
                .flat_map(|e| {
                    let height = (1.0 - (e as f64 - centre).abs() / 3.0).max(0.0);
                    direction.map(|d| d * height)
                })
                .collect()
        };
        let components = [bump(8.0, [1.0, 0.5, 0.0]), bump(30.0, [0.0, 1.0, -1.0])];
        let samples = (0..12)
            .map(|m| {
                let weights = [f64::from(m % 4) / 3.0, f64::from(m * 5 % 7) / 6.0];
                (0..3 * ELEMENTS)
                    .map(|d| 2.0 + weights[0] * components[0][d] + weights[1] * components[1][d])
                    .collect()
            })
            .collect();
        (samples, components)
    }

    fn cosine(a: &[f64], b: &[f64]) -> f64 {
        product(a, b) / (product(a, a) * product(b, b)).sqrt()
    }

    #[test]
    fn recovers_planted_components() {
        let (samples, planted) = planted();
        let basis = splocs(&samples, 3, &line, &SplocsSettings::published(2));
        for truth in &planted {
            let best = basis
                .directions
                .iter()
                .map(|c| cosine(c, truth).abs())
                .fold(0.0, f64::max);
            assert!(best > 0.99, "cosine {best}");
        }
    }

    #[test]
    fn components_are_zero_far_from_their_centres() {
        let (samples, _) = planted();
        // More components than movements, and a strong pull to zero.
        let settings = SplocsSettings {
            sparsity: 4.0,
            ..SplocsSettings::published(4)
        };
        let basis = splocs(&samples, 3, &line, &settings);
        for k in 0..4 {
            let energy = basis.energy(k);
            let total: f64 = energy.iter().sum();
            let distances = line(greatest(&energy));
            let outside: f64 = energy
                .iter()
                .zip(&distances)
                .filter(|(_, d)| **d > 0.5)
                .map(|(e, _)| e)
                .sum();
            assert!(outside <= 1e-6 * total, "component {k}: {outside} of {total}");
        }
    }

    #[test]
    fn nothing_that_moves_gives_nothing() {
        let basis = splocs(
            &[vec![1.0; 6], vec![1.0; 6]],
            3,
            &|_| vec![0.0; 2],
            &SplocsSettings::published(2),
        );
        assert_eq!((basis.used_count(), basis.mean), (0, vec![1.0; 6]));
    }
}
