//! The numbers of one reconstruction: E_rms and STED side by side (method section 4).

use serde::{Deserialize, Serialize};

use super::{
    erms::NormalisedPair,
    sted::{Sted, sted},
};

/// E_rms and STED of one reconstructed sequence. All unitless, not negative; smaller is better.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// Root mean square error of positions, per mille of the bounding ball.
    pub e_rms: f64,
    /// `sqrt(sted_s^2 + (0.127 sted_t)^2)`.
    pub sted: f64,
    /// Spatial part: jitter of edge lengths over the surface.
    pub sted_s: f64,
    /// Temporal part: jitter of each vertex's steps; 0 for a single shape.
    pub sted_t: f64,
}

/// Why a reconstruction cannot be scored. Shapes are counted within the arrays given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScoreError {
    /// As it says.
    #[error("{truth} true shapes stand against {reconstruction} reconstructed ones: give as many of each")]
    ShapeCount {
        /// Shapes given as truth.
        truth: usize,
        /// Shapes given as reconstruction.
        reconstruction: usize,
    },
    /// No shape, or shapes without vertices.
    #[error("nothing to score: give at least one shape with at least one vertex")]
    Nothing,
    /// Vertex counts disagree.
    #[error("shape {shape} has {actual} vertices instead of {expected}")]
    VertexCount {
        /// Index of the shape.
        shape: usize,
        /// V of the first true shape.
        expected: usize,
        /// V of this shape.
        actual: usize,
    },
    /// A NaN or an infinity.
    #[error("shape {shape}, vertex {vertex}: the position is not finite")]
    NotFinite {
        /// Index of the shape.
        shape: usize,
        /// Index of the vertex.
        vertex: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} names vertex {vertex}, but the shapes have {vertex_count} vertices")]
    FaceOutOfRange {
        /// Index of the face.
        face: usize,
        /// The index found.
        vertex: u32,
        /// V.
        vertex_count: usize,
    },
    /// All vertices of every true shape coincide.
    #[error("the true shapes have no extent: all their vertices coincide")]
    NoExtent,
}

/// Scores a reconstruction against the truth. Shapes: `truth` and `reconstruction` `[N][V]` in temporal order and the
/// same units, `faces` `[F]`.
/// Source: method section 4; the same on one and on many threads.
pub fn score(
    truth: &[Vec<[f32; 3]>],
    reconstruction: &[Vec<[f32; 3]>],
    faces: &[[u32; 3]],
) -> Result<Scores, ScoreError> {
    let vertex_count = truth.first().map_or(0, Vec::len);
    for (face, corners) in faces.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertex_count) {
            return Err(ScoreError::FaceOutOfRange {
                face,
                vertex,
                vertex_count,
            });
        }
    }
    let pair = NormalisedPair::new(truth, reconstruction)?;
    let Sted {
        total,
        spatial,
        temporal,
    } = sted(&pair, faces);
    Ok(Scores {
        e_rms: pair.e_rms(),
        sted: total,
        sted_s: spatial,
        sted_t: temporal,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 4;
    const COLUMNS: usize = 5;
    const SHAPES: usize = 6;

    /// The scorer this must agree with finds its bounding ball by iteration, to about 1e-4.
    const SCORER_TOLERANCE: f64 = 1e-3;

    /// High halves of a linear congruential generator: the same numbers in any language.
    struct Noise(u32);

    impl Noise {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(self.0 >> 16) / 65536.0
        }

        /// A grid that drifts along z, each coordinate raised by up to `amplitude`.
        fn sequence(&mut self, amplitude: f64) -> Vec<Vec<[f64; 3]>> {
            let grid = |m: usize, v: usize| [(v % COLUMNS) as f64, (v / COLUMNS) as f64, 0.25 * m as f64];
            (0..SHAPES)
                .map(|m| {
                    (0..ROWS * COLUMNS)
                        .map(|v| grid(m, v).map(|c| c + amplitude * self.next()))
                        .collect()
                })
                .collect()
        }
    }

    fn faces() -> Vec<[u32; 3]> {
        let corner = |row: usize, column: usize| (row * COLUMNS + column) as u32;
        (0..ROWS - 1)
            .flat_map(|row| (0..COLUMNS - 1).map(move |column| (row, column)))
            .flat_map(|(row, column)| {
                let [a, b] = [corner(row, column), corner(row, column + 1)];
                let [c, d] = [corner(row + 1, column), corner(row + 1, column + 1)];
                [[a, b, c], [b, d, c]]
            })
            .collect()
    }

    fn narrow(shapes: &[Vec<[f64; 3]>]) -> Vec<Vec<[f32; 3]>> {
        shapes
            .iter()
            .map(|shape| shape.iter().map(|p| p.map(|c| c as f32)).collect())
            .collect()
    }

    fn noisy_pair() -> (Vec<Vec<[f32; 3]>>, Vec<Vec<[f32; 3]>>) {
        let mut noise = Noise(1);
        let truth = noise.sequence(0.5);
        let offsets = noise.sequence(0.125);
        let grid = Noise(0).sequence(0.0);
        let mut moved = truth.clone();
        for (m, shape) in moved.iter_mut().enumerate() {
            for (v, position) in shape.iter_mut().enumerate() {
                for c in 0..3 {
                    position[c] += offsets[m][v][c] - grid[m][v][c];
                }
            }
        }
        (narrow(&truth), narrow(&moved))
    }

    /// Expected numbers: the same arrays, made with the same generator in numpy, given to the independent Python scorer
    /// (E_rms by Kavan, STED by Vasa and Skala; d = 1, w = 1, dt = 0.01, c = 0.127), defaults unchanged.
    #[test]
    fn agrees_with_the_independent_scorer() {
        let (truth, reconstruction) = noisy_pair();
        let scores = score(&truth, &reconstruction, &faces()).unwrap();
        let expected = Scores {
            e_rms: 13.134_189_745_956_267,
            sted: 0.027_281_996_308_416_632,
            sted_s: 0.026_275_179_752_368_33,
            sted_t: 0.057_820_293_000_558_8,
        };
        let check = |name: &str, actual: f64, expected: f64| {
            assert!(
                (actual / expected - 1.0).abs() < SCORER_TOLERANCE,
                "{name}: {actual} instead of {expected}"
            );
        };
        check("e_rms", scores.e_rms, expected.e_rms);
        check("sted", scores.sted, expected.sted);
        check("sted_s", scores.sted_s, expected.sted_s);
        check("sted_t", scores.sted_t, expected.sted_t);
    }

    #[test]
    fn rigid_motion_and_scale_leave_no_error() {
        let (truth, _) = noisy_pair();
        let turned: Vec<Vec<[f32; 3]>> = truth
            .iter()
            .map(|shape| {
                shape
                    .iter()
                    .map(|&[x, y, z]| [0.6 * x - 0.8 * y + 3.0, 0.8 * x + 0.6 * y, z - 1.0])
                    .collect()
            })
            .collect();
        let scores = score(&truth, &turned, &faces()).unwrap();
        // Positions are rounded to f32.
        assert!(scores.e_rms < 1e-3, "{scores:?}");
        assert!(scores.sted < 1e-5, "{scores:?}");
    }

    #[test]
    fn one_shape_has_no_temporal_part() {
        let (truth, reconstruction) = noisy_pair();
        let scores = score(&truth[..1], &reconstruction[..1], &faces()).unwrap();
        assert_eq!(scores.sted_t, 0.0);
        assert!(scores.sted_s > 0.0);
        assert_eq!(scores.sted, scores.sted_s);
    }

    #[test]
    fn errors_of_single_shapes_sum_to_that_of_all() {
        let (truth, reconstruction) = noisy_pair();
        let pair = NormalisedPair::new(&truth, &reconstruction).unwrap();
        let mean = pair.e_rms_of_shapes().iter().map(|e| e * e).sum::<f64>() / SHAPES as f64;
        assert!((mean.sqrt() - pair.e_rms()).abs() < 1e-9);
    }

    #[test]
    fn refusals() {
        let (truth, reconstruction) = noisy_pair();
        let faces = faces();
        assert_eq!(
            score(&truth, &reconstruction[1..], &faces),
            Err(ScoreError::ShapeCount {
                truth: SHAPES,
                reconstruction: SHAPES - 1
            })
        );
        assert_eq!(score(&[], &[], &[]), Err(ScoreError::Nothing));
        let mut short = reconstruction.clone();
        short[2].pop();
        assert_eq!(
            score(&truth, &short, &faces),
            Err(ScoreError::VertexCount {
                shape: 2,
                expected: ROWS * COLUMNS,
                actual: ROWS * COLUMNS - 1
            })
        );
        let mut broken = reconstruction.clone();
        broken[3][7][1] = f32::NAN;
        assert_eq!(
            score(&truth, &broken, &faces),
            Err(ScoreError::NotFinite { shape: 3, vertex: 7 })
        );
        assert_eq!(
            score(&truth, &reconstruction, &[[0, 1, 99]]),
            Err(ScoreError::FaceOutOfRange {
                face: 0,
                vertex: 99,
                vertex_count: ROWS * COLUMNS
            })
        );
        let point = vec![vec![[1.0; 3]; 4]];
        assert_eq!(score(&point, &point, &[]), Err(ScoreError::NoExtent));
    }
}
