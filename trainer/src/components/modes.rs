//! Leading modes of many samples in the feature metric, by the Gram matrix of the samples: of all bases of as many fields,
//! their span misses least of the samples. First step of the closed-form start.

use faer::{Mat, Side};

use super::embedding::{Embedding, combined, products};

/// Gram matrices in f32 carry noise of about 1e-6 of the strongest mode.
const NOISE: f64 = 1e-6;

/// Modes that [`leading_modes`] finds, strongest first; fewer than asked for where the samples have fewer dimensions.
pub struct Modes {
    /// Of unit length in the metric. Shape: `[K]`, each flat `[V][9]`.
    pub rows: Vec<Vec<f32>>,
    /// What each explains of the samples: squares, summed over the samples. Falling. Shape: `[K]`.
    pub energies: Vec<f64>,
}

/// The `count` leading modes of `samples`, flat `[N][V][9]`.
pub fn leading_modes(embedding: &Embedding<'_>, samples: &[f32], count: usize) -> Modes {
    let embedded = embedding.embed(samples);
    let gram = products(embedded.as_ref(), embedded.as_ref());
    drop(embedded);
    let sample_count = gram.nrows();
    let nothing = Modes {
        rows: Vec::new(),
        energies: Vec::new(),
    };
    let Ok(eigen) = gram.self_adjoint_eigen(Side::Lower) else {
        return nothing;
    };
    let (vectors, values) = (eigen.U(), eigen.S());
    let strongest = if sample_count == 0 {
        0.0
    } else {
        values[sample_count - 1]
    };
    let energies: Vec<f64> = (0..count.min(sample_count))
        .map(|i| values[sample_count - 1 - i])
        .take_while(|&energy| energy > NOISE * strongest)
        .collect();
    let coefficients = Mat::from_fn(sample_count, energies.len(), |n, i| {
        vectors[(n, sample_count - 1 - i)] / energies[i].sqrt()
    });
    Modes {
        rows: combined(samples, coefficients.as_ref()),
        energies,
    }
}
