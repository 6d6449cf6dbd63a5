//! The kernel against a naive, independent implementation of method section 2 in double precision: outputs, every loss
//! term, and every gradient by central differences.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::mesh::topology::{Topology, TopologyFindings};
use crate::network::stack::DifferentiableStack;
use crate::network::weights::CONVOLUTION_LEN;

/// Single precision through a few hundred sums against double precision.
const VALUE_TOLERANCE: f64 = 2e-5;
/// The same through the way back; relative to the largest gradient of the same kind.
const GRADIENT_TOLERANCE: f64 = 2e-4;
/// Step of the central differences: in double precision its truncation and rounding stay near 1e-9.
const DIFFERENCE_STEP: f64 = 1e-5;

/// A closed strip with chords, a pendant vertex and one vertex without neighbours.
fn topology(vertex_count: usize) -> Topology {
    let mut rings = vec![Vec::new(); vertex_count];
    let closed = vertex_count - 2;
    let mut join = |a: usize, b: usize| {
        rings[a].push(b as u32);
        rings[b].push(a as u32);
    };
    for v in 0..closed {
        join(v, (v + 1) % closed);
        if v % 3 == 0 {
            join(v, (v + 3) % closed);
        }
    }
    join(closed, 1);
    let mut ring_offsets = vec![0];
    let mut ring = Vec::new();
    for neighbours in &mut rings {
        neighbours.sort_unstable();
        neighbours.dedup();
        ring.extend_from_slice(neighbours);
        ring_offsets.push(ring.len() as u32);
    }
    Topology {
        vertex_count,
        faces: Vec::new(),
        ring_offsets,
        ring,
        piece_of: Vec::new(),
        bridges: Vec::new(),
        findings: TopologyFindings::default(),
    }
}

struct Case {
    topology: Topology,
    weights: StackWeights,
    shapes: Vec<f32>,
    vertex_weights: Vec<f32>,
    modes: Vec<f32>,
    outside: Vec<Vec<bool>>,
    attention: Attention,
    activation: Activation,
}

impl Case {
    fn new(vertex_count: usize, shape_count: usize, component_counts: &[usize]) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut numbers = |len: usize, scale: f32| -> Vec<f32> {
            (0..len).map(|_| scale * random.random_range(-1.0_f32..1.0)).collect()
        };
        let len = vertex_count * FEATURE_COUNT;
        let mut weights = StackWeights::zeros(vertex_count, component_counts);
        let components = numbers(weights.flat_components().len(), 0.3);
        weights.set_flat_components(&components);
        let convolutions = numbers(weights.flat_convolutions().len(), 0.3);
        weights.set_flat_convolutions(&convolutions);
        let row_count: Vec<usize> = weights.blocks().map(|block| block.components.len() / len).collect();
        Self {
            topology: topology(vertex_count),
            weights,
            shapes: numbers(shape_count * len, 0.8),
            vertex_weights: numbers(vertex_count, 0.5).iter().map(|value| 1.0 + value).collect(),
            modes: numbers(3 * len, 0.2),
            outside: row_count
                .iter()
                .map(|rows| (0..rows * vertex_count).map(|at| at % 3 != 0).collect())
                .collect(),
            attention: Attention::Components,
            activation: Activation::FromRest,
        }
    }

    fn sharing(self, attention: Attention) -> Self {
        Self { attention, ..self }
    }

    fn activated(self, activation: Activation) -> Self {
        Self { activation, ..self }
    }

    fn kernel(&self) -> Kernel {
        Kernel::new(
            RingMean::new(&self.topology),
            &self.vertex_weights,
            &self.modes,
            self.attention,
            self.activation,
        )
    }
}

/// What the naive model answers.
struct Naive {
    terms: [f64; 5],
    latents: Vec<Vec<Vec<f64>>>,
    shapes: Vec<f64>,
}

fn naive_convolution(topology: &Topology, activation: Activation, numbers: &[f64], x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for v in 0..topology.vertex_count {
        let ring = topology.ring_of(v);
        for o in 0..9 {
            let mut sum = numbers[162 + o];
            for i in 0..9 {
                let mean = match ring.len() {
                    0 => 0.0,
                    degree => ring.iter().map(|&j| x[j as usize * 9 + i]).sum::<f64>() / degree as f64,
                };
                sum += numbers[o * 9 + i] * x[v * 9 + i] + numbers[81 + o * 9 + i] * mean;
            }
            y[v * 9 + o] = match activation {
                Activation::FromRest => sum.tanh() - numbers[162 + o].tanh(),
                Activation::Plain => sum.tanh(),
            };
        }
    }
    y
}

/// The whole network and its loss, shape by shape, decoding shapes and not components.
fn naive(case: &Case, components: &[f64], convolutions: &[f64], settings: &LossSettings) -> Naive {
    let topology = &case.topology;
    let (vertex_count, len) = (topology.vertex_count, topology.vertex_count * 9);
    let shapes: Vec<Vec<f64>> = case
        .shapes
        .chunks(len)
        .map(|shape| shape.iter().map(|&value| f64::from(value)).collect())
        .collect();
    let norm = |x: &[f64]| -> f64 {
        (0..len)
            .map(|at| f64::from(case.vertex_weights[at / 9]) * x[at] * x[at])
            .sum()
    };
    let weight = |value: f32| f64::from(value);
    let scale = weight(settings.reconstruction_weight) / shapes.len() as f64;
    let mut terms = [0.0; 5];
    let mut error = shapes.clone();
    let mut inputs = vec![shapes.clone()];
    let (mut row, mut block_index) = (0, 0);
    let mut latents = Vec::new();
    for k_count in case.weights.component_counts() {
        let mut next = Vec::new();
        let mut level_latents = Vec::new();
        for input in &inputs {
            let c = |k: usize, at: usize| components[(row + k) * len + at];
            let encoder = &convolutions[2 * block_index * CONVOLUTION_LEN..];
            let decoder = &convolutions[(2 * block_index + 1) * CONVOLUTION_LEN..];
            let mut residuals = Vec::new();
            let mut block_latents = Vec::new();
            for (x, e) in input.iter().zip(&mut error) {
                let hidden = naive_convolution(topology, case.activation, encoder, x);
                let z: Vec<f64> = (0..k_count)
                    .map(|k| (0..len).map(|at| c(k, at) * hidden[at]).sum())
                    .collect();
                let blend: Vec<f64> = (0..len).map(|at| (0..k_count).map(|k| z[k] * c(k, at)).sum()).collect();
                let y = naive_convolution(topology, case.activation, decoder, &blend);
                residuals.push(x.iter().zip(&y).map(|(x, y)| x - y).collect::<Vec<_>>());
                e.iter_mut().zip(&y).for_each(|(e, y)| *e -= y);
                block_latents.extend(z);
            }
            terms[0] += scale * weight(settings.block_weight) * residuals.iter().map(|r| norm(r)).sum::<f64>();
            for k in 0..k_count {
                let widest = block_latents
                    .iter()
                    .skip(k)
                    .step_by(k_count)
                    .fold(0.0_f64, |widest, z| widest.max(z.abs()));
                let excess = (widest - weight(settings.range_threshold)).max(0.0);
                terms[4] += weight(settings.range_weight) * excess / k_count as f64;
                let length = (0..len).map(|at| c(k, at).powi(2)).sum::<f64>().sqrt();
                for v in (0..vertex_count).filter(|v| case.outside[block_index][k * vertex_count + v]) {
                    let norm = (0..9).map(|i| c(k, v * 9 + i).powi(2)).sum::<f64>().sqrt();
                    let norm = if settings.unit_rows { norm / length } else { norm };
                    terms[3] += weight(settings.sparsity_weight) * norm / k_count as f64;
                }
            }
            let floor = 1e-6 / vertex_count as f64;
            let energy = |k: usize, v: usize| (0..9).map(|i| c(k, v * 9 + i).powi(2)).sum::<f64>() + floor;
            for k in 0..k_count {
                let mask = |v: usize| match case.attention {
                    Attention::Components => energy(k, v) / (0..k_count).map(|j| energy(j, v)).sum::<f64>(),
                    Attention::Equal => 1.0 / k_count as f64,
                };
                let masks: Vec<f64> = (0..vertex_count).map(mask).collect();
                next.push(
                    residuals
                        .iter()
                        .map(|r| (0..len).map(|at| masks[at / 9] * r[at]).collect())
                        .collect(),
                );
            }
            level_latents.push(block_latents);
            row += k_count;
            block_index += 1;
        }
        latents.push(level_latents);
        inputs = next;
    }
    for e in &error {
        terms[1] += scale * weight(settings.total_weight) * norm(e);
        for mode in case.modes.chunks(len) {
            let along: f64 = mode.iter().zip(e).map(|(&g, e)| f64::from(g) * e).sum();
            terms[2] += scale * weight(settings.position_weight) * along * along;
        }
    }
    let shapes = shapes
        .iter()
        .flatten()
        .zip(error.iter().flatten())
        .map(|(x, e)| x - e)
        .collect();
    Naive { terms, latents, shapes }
}

fn doubles(numbers: &[f32]) -> Vec<f64> {
    numbers.iter().map(|&number| f64::from(number)).collect()
}

const ACTIVATIONS: [Activation; 2] = [Activation::FromRest, Activation::Plain];

/// Components of each level, shapes, and how residuals are shared out.
const CASES: [(&[usize], usize, Attention); 7] = [
    (&[3], 2, Attention::Components),
    (&[3, 2], 3, Attention::Components),
    (&[2, 2, 2], 3, Attention::Components),
    (&[9, 2], 11, Attention::Components),
    // More shapes than a wide group holds.
    (&[3, 2], 21, Attention::Components),
    (&[2, 2, 2], 3, Attention::Equal),
    (&[9, 2], 11, Attention::Equal),
];

fn every_case() -> impl Iterator<Item = ((&'static [usize], usize, Attention), Activation)> {
    CASES
        .into_iter()
        .flat_map(|case| ACTIVATIONS.map(|activation| (case, activation)))
}

/// Every term at once, with a range that some latents leave.
fn all_terms() -> LossSettings {
    LossSettings {
        block_weight: 0.3,
        total_weight: 1.0,
        position_weight: 2.0,
        sparsity_weight: 0.7,
        range_threshold: 0.05,
        ..LossSettings::local()
    }
}

fn assert_close(found: f64, expected: f64, scale: f64, tolerance: f64, what: &str) {
    assert!(
        (found - expected).abs() <= tolerance * scale,
        "{what}: {found}, expected {expected}"
    );
}

#[test]
fn outputs_and_loss_equal_the_naive_model() {
    for ((counts, shape_count, attention), activation) in every_case() {
        let case = Case::new(13, shape_count, counts)
            .sharing(attention)
            .activated(activation);
        let (components, convolutions) = (case.weights.flat_components(), case.weights.flat_convolutions());
        let expected = naive(&case, &doubles(&components), &doubles(&convolutions), &all_terms());
        let mut kernel = case.kernel();
        let output = kernel.reconstruct(&case.weights, &case.shapes);
        for (found, expected) in output.shapes.iter().zip(&expected.shapes) {
            assert_close(f64::from(*found), *expected, 1.0, VALUE_TOLERANCE, "shape");
        }
        let latents = output.latents.iter().flatten().flatten();
        for (found, expected) in latents.zip(expected.latents.iter().flatten().flatten()) {
            assert_close(f64::from(*found), *expected, 1.0, VALUE_TOLERANCE, "latent");
        }
        let (terms, _) = kernel.differentiate(&case.weights, &case.shapes, &case.outside, &all_terms());
        let found = [terms.block, terms.total, terms.position, terms.sparsity, terms.range];
        for (found, expected) in found.into_iter().zip(expected.terms) {
            assert!(expected > 0.0, "a term that is zero tests nothing");
            assert_close(f64::from(found), expected, expected, VALUE_TOLERANCE, "term");
        }
    }
}

/// Compares every `stride`-th gradient with central differences of the naive loss.
fn check_gradients(case: &Case, settings: &LossSettings, stride: usize) {
    let (_, gradient) = case
        .kernel()
        .differentiate(&case.weights, &case.shapes, &case.outside, settings);
    let components = doubles(&case.weights.flat_components());
    let convolutions = doubles(&case.weights.flat_convolutions());
    let loss = |components: &[f64], convolutions: &[f64]| -> f64 {
        naive(case, components, convolutions, settings).terms.iter().sum()
    };
    for (of_components, found) in [
        (true, gradient.flat_components()),
        (false, gradient.flat_convolutions()),
    ] {
        let scale = f64::from(found.iter().fold(0.0_f32, |scale, value| scale.max(value.abs())));
        for at in (0..found.len()).step_by(stride) {
            let moved = |by: f64| {
                let mut numbers = if of_components {
                    components.clone()
                } else {
                    convolutions.clone()
                };
                numbers[at] += by;
                if of_components {
                    loss(&numbers, &convolutions)
                } else {
                    loss(&components, &numbers)
                }
            };
            let expected = (moved(DIFFERENCE_STEP) - moved(-DIFFERENCE_STEP)) / (2.0 * DIFFERENCE_STEP);
            let what = format!("gradient {at} (of C: {of_components}) under {settings:?}");
            assert_close(
                f64::from(found[at]),
                expected,
                scale.max(1e-3),
                GRADIENT_TOLERANCE,
                &what,
            );
        }
    }
}

#[test]
fn gradients_of_all_terms_equal_differences() {
    for (counts, shape_count, stride) in [(&[3][..], 2, 3), (&[3, 2], 3, 5), (&[2, 2, 2], 3, 7), (&[9, 1], 9, 29)] {
        check_gradients(&Case::new(11, shape_count, counts), &all_terms(), stride);
    }
    let equal = Case::new(11, 3, &[2, 2, 2]).sharing(Attention::Equal);
    check_gradients(&equal, &all_terms(), 7);
    let plain = Case::new(11, 3, &[3, 2]).activated(Activation::Plain);
    check_gradients(&plain, &all_terms(), 7);
}

#[test]
fn gradients_of_each_term_equal_differences() {
    let none = LossSettings {
        block_weight: 0.0,
        total_weight: 0.0,
        position_weight: 0.0,
        sparsity_weight: 0.0,
        range_weight: 0.0,
        ..all_terms()
    };
    let single = [
        LossSettings {
            block_weight: 1.0,
            ..none.clone()
        },
        LossSettings {
            total_weight: 1.0,
            ..none.clone()
        },
        LossSettings {
            position_weight: 1.0,
            ..none.clone()
        },
        LossSettings {
            sparsity_weight: 1.0,
            ..none.clone()
        },
        LossSettings {
            sparsity_weight: 1.0,
            unit_rows: false,
            ..none.clone()
        },
        LossSettings {
            range_weight: 1.0,
            ..none
        },
    ];
    let case = Case::new(11, 3, &[3, 2]);
    single.iter().for_each(|settings| check_gradients(&case, settings, 11));
}

#[test]
fn rest_maps_to_rest() {
    let case = Case::new(12, 1, &[3, 2]);
    let output = case.kernel().reconstruct(&case.weights, &[0.0; 12 * FEATURE_COUNT]);
    assert!(output.shapes.iter().all(|&value| value == 0.0));
}

#[test]
fn buffers_do_not_carry_over() {
    let case = Case::new(12, 3, &[3, 2]);
    let mut used = case.kernel();
    used.differentiate(
        &case.weights,
        &Case::new(12, 11, &[3, 2]).shapes,
        &case.outside,
        &all_terms(),
    );
    let again = used.differentiate(&case.weights, &case.shapes, &case.outside, &all_terms());
    assert_eq!(
        again,
        case.kernel()
            .differentiate(&case.weights, &case.shapes, &case.outside, &all_terms())
    );
    let shallow = Case::new(12, 3, &[3]);
    let differentiate =
        |kernel: &mut Kernel| kernel.differentiate(&shallow.weights, &shallow.shapes, &shallow.outside, &all_terms());
    assert_eq!(differentiate(&mut used), differentiate(&mut case.kernel()));
}

#[test]
fn loss_and_every_gradient_equal_the_differentiable_model() {
    for ((counts, shape_count, attention), activation) in every_case() {
        let case = Case::new(13, shape_count, counts)
            .sharing(attention)
            .activated(activation);
        let ring = RingMean::new(&case.topology);
        let model = DifferentiableStack::new(&ring, &case.vertex_weights, &case.modes, attention, case.activation);
        for settings in [all_terms(), LossSettings::paper(), LossSettings::local()] {
            let (expected_terms, expected) = model.differentiate(&case.weights, &case.shapes, &case.outside, &settings);
            let (terms, found) = case
                .kernel()
                .differentiate(&case.weights, &case.shapes, &case.outside, &settings);
            let (sum, expected_sum) = (f64::from(terms.sum()), f64::from(expected_terms.sum()));
            assert_close(sum, expected_sum, expected_sum, VALUE_TOLERANCE, "loss");
            let pairs = [
                (found.flat_components(), expected.flat_components()),
                (found.flat_convolutions(), expected.flat_convolutions()),
            ];
            for (found, expected) in pairs {
                let scale = f64::from(expected.iter().fold(0.0_f32, |scale, value| scale.max(value.abs())));
                for (found, expected) in found.iter().zip(&expected) {
                    assert_close(
                        f64::from(*found),
                        f64::from(*expected),
                        scale,
                        GRADIENT_TOLERANCE,
                        "gradient",
                    );
                }
            }
        }
    }
}
