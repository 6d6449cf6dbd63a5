//! Leading modes of many samples over part of the mesh, by the Gram matrix of the samples: the linear algebra under the
//! closed-form start.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par, Side};

/// Samples restricted to some vertices and weighted. Columns are samples, rows the nine features of each vertex.
pub struct WeightedSamples {
    /// Shape: `[9 * vertices.len()] x [sample_count]`.
    pub values: Mat<f32>,
}

impl WeightedSamples {
    /// Shape: `samples` is flat `[sample_count][vertex_count][9]`; `weights` pairs with `vertices`.
    pub fn gather(samples: &[f32], vertex_count: usize, vertices: &[u32], weights: &[f32]) -> Self {
        let width = 9 * vertex_count;
        let sample_count = samples.len() / width.max(1);
        let mut values = Mat::<f32>::zeros(9 * vertices.len(), sample_count);
        for n in 0..sample_count {
            let sample = &samples[n * width..(n + 1) * width];
            let column = values.col_as_slice_mut(n);
            for ((&v, &weight), out) in vertices.iter().zip(weights).zip(column.chunks_exact_mut(9)) {
                for (o, x) in out.iter_mut().zip(&sample[9 * v as usize..9 * v as usize + 9]) {
                    *o = weight * x;
                }
            }
        }
        Self { values }
    }

    /// The `count` leading modes: unit columns over the rows, strongest first, and their coefficients over the samples
    /// (orthonormal columns). Where the samples have fewer dimensions the rest is zero.
    pub fn leading_modes(&self, count: usize) -> Modes {
        let sample_count = self.values.ncols();
        let count = count.min(sample_count);
        let mut gram = Mat::<f32>::zeros(sample_count, sample_count);
        matmul(
            gram.as_mut(),
            Accum::Replace,
            self.values.transpose(),
            self.values.as_ref(),
            1.0,
            Par::Seq,
        );
        let gram = Mat::<f64>::from_fn(sample_count, sample_count, |i, j| f64::from(gram[(i, j)]));
        let mut coefficients = Mat::<f32>::zeros(sample_count, count);
        let mut shapes = Mat::<f32>::zeros(self.values.nrows(), count);
        let mut energies = vec![0.0; count];
        if let Ok(eigen) = gram.self_adjoint_eigen(Side::Lower) {
            let (u, s) = (eigen.U(), eigen.S());
            let strongest = if sample_count == 0 { 0.0 } else { s[sample_count - 1] };
            let mut inverse_lengths = vec![0.0_f32; count];
            for i in 0..count {
                let source = sample_count - 1 - i;
                let energy = s[source];
                // Gram matrices in f32 carry noise of about 1e-6 of the strongest mode.
                if energy <= 1e-6 * strongest || energy <= 0.0 {
                    break;
                }
                energies[i] = energy;
                inverse_lengths[i] = (1.0 / energy.sqrt()) as f32;
                for n in 0..sample_count {
                    coefficients[(n, i)] = u[(n, source)] as f32;
                }
            }
            matmul(
                shapes.as_mut(),
                Accum::Replace,
                self.values.as_ref(),
                coefficients.as_ref(),
                1.0,
                Par::Seq,
            );
            for (i, &inverse_length) in inverse_lengths.iter().enumerate() {
                for value in shapes.col_as_slice_mut(i) {
                    *value *= inverse_length;
                }
            }
        }
        Modes {
            shapes,
            coefficients,
            energies,
        }
    }
}

/// What [`WeightedSamples::leading_modes`] finds.
pub struct Modes {
    /// Unit columns over the rows of the samples.
    pub shapes: Mat<f32>,
    /// Orthonormal columns over the samples.
    pub coefficients: Mat<f32>,
    /// Squared singular values, falling; zero where there is no such mode.
    pub energies: Vec<f64>,
}

/// `[rows] x [columns]` view of flat column-major numbers.
pub fn columns(values: &[f32], rows: usize) -> MatRef<'_, f32> {
    MatRef::from_column_major_slice(values, rows, values.len() / rows.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gram matrices in f32: relative errors of a few 1e-4 in the modes.
    const TOLERANCE: f32 = 1e-3;

    #[test]
    fn finds_the_two_modes_that_made_the_samples() {
        let (vertex_count, sample_count) = (6, 20);
        let mode = |m: usize, i: usize| ((i * (m + 2) + m) % 5) as f32 - 2.0;
        let mut samples = vec![0.0; sample_count * vertex_count * 9];
        for n in 0..sample_count {
            let (a, b) = ((n as f32 * 0.7).sin() * 3.0, (n as f32 * 1.3).cos());
            for i in 0..vertex_count * 9 {
                samples[n * vertex_count * 9 + i] = a * mode(0, i) + b * mode(1, i);
            }
        }
        let vertices: Vec<u32> = (0..vertex_count as u32).collect();
        let found = WeightedSamples::gather(&samples, vertex_count, &vertices, &[1.0; 6]).leading_modes(4);
        assert!(found.energies[0] > found.energies[1] && found.energies[1] > 0.0);
        assert_eq!(&found.energies[2..], [0.0, 0.0]);
        // Both modes together explain every sample.
        for n in 0..sample_count {
            let sample = &samples[n * 54..(n + 1) * 54];
            let mut rest = sample.to_vec();
            for i in 0..2 {
                let shape = found.shapes.col_as_slice(i);
                let z: f32 = shape.iter().zip(sample).map(|(s, x)| s * x).sum();
                rest.iter_mut().zip(shape).for_each(|(r, s)| *r -= z * s);
            }
            assert!(rest.iter().all(|r| r.abs() < TOLERANCE * 10.0), "sample {n}");
        }
    }

    #[test]
    fn vertices_outside_and_weights_of_zero_leave_no_trace() {
        let samples: Vec<f32> = (0..3 * 4 * 9).map(|i| (i % 13) as f32).collect();
        let gathered = WeightedSamples::gather(&samples, 4, &[1, 3], &[0.0, 2.0]);
        assert_eq!(gathered.values.nrows(), 18);
        assert!((0..3).all(|n| gathered.values.col_as_slice(n)[..9].iter().all(|&x| x == 0.0)));
        assert_eq!(gathered.values[(9, 1)], 2.0 * samples[36 + 27]);
    }
}
