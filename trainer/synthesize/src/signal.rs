//! Smooth signals that never repeat: what moves the subjects.

use core::f64::consts::TAU;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A sum of three sines of incommensurate frequencies. Range of the values: [-1, 1].
#[derive(Debug, Clone)]
pub(super) struct Wander {
    /// Frequency in hertz and phase in radians of each sine.
    terms: [(f64, f64); 3],
}

/// Amplitudes of the three sines; they add up to 1.
const AMPLITUDES: [f64; 3] = [0.5, 0.31, 0.19];

impl Wander {
    /// A signal whose lowest frequency is near `hertz`; the generator shifts the frequencies a little and draws the phases.
    pub(super) fn new(hertz: f64, rng: &mut ChaCha8Rng) -> Self {
        // Ratios from the golden mean and the square root of 7: no two share a short common period.
        let ratios = [1.0, 1.618_033_988_75, 2.645_751_311_06];
        Self {
            terms: ratios.map(|ratio| {
                let detune = 0.9 + 0.2 * rng.random::<f64>();
                (hertz * ratio * detune, TAU * rng.random::<f64>())
            }),
        }
    }

    /// The value at time `t` in seconds.
    pub(super) fn at(&self, t: f64) -> f64 {
        self.terms
            .iter()
            .zip(AMPLITUDES)
            .map(|((hertz, phase), amplitude)| amplitude * (TAU * hertz * t + phase).sin())
            .sum()
    }
}
