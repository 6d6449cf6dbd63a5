//! Local mixes: training shapes whose distant parts move independently. Stands between the scaled features and both the
//! closed-form start and the network's batches.
//!
//! A handful of poses says nothing about which parts move on their own, so a network that only sees the poses learns
//! them by heart. A mix lets each soft region follow its own random blend of the poses: near vertices keep moving
//! together, far ones become independent.

use rand::{Rng, RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

use sinew_interchange::ShapeStore;

/// Most shapes that one mix is drawn from, chosen anew for every mix: of thousands, all at once would be their average and
/// its price a thousandfold.
const SHAPES_OF_A_MIX: usize = 64;

/// How mixes are drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MixSettings {
    /// Fresh mixes an optimiser step; 0 trains on the shapes themselves, as the paper does.
    pub per_step: usize,
    /// Fewest soft regions of a mix.
    pub regions_min: usize,
    /// Most soft regions of a mix.
    pub regions_max: usize,
    /// Width of a soft region (one standard deviation), as a share of the longest distance along the surface.
    pub reach: f64,
    /// Share of mixes that blend whole shapes: one region.
    pub whole_share: f64,
    /// Every region also turns about an axis of its own, by this share of what vertices turn on the mean: parts can do more than
    /// a handful of shapes shows. 0 leaves it out.
    pub turn: f64,
    /// How far apart vertices count that move differently, against how far apart they lie: regions then end where the shapes
    /// bend. 0 goes by the surface alone.
    pub bend: f64,
    /// Whether mirror images of the shapes are mixed in, where the reference is its own mirror image.
    pub mirror: bool,
}

impl Default for MixSettings {
    fn default() -> Self {
        Self {
            per_step: 16,
            regions_min: 6,
            regions_max: 20,
            reach: 0.14,
            whole_share: 0.1,
            turn: 0.2,
            bend: 0.5,
            mirror: true,
        }
    }
}

/// Draws mixes of M shapes over V vertices.
#[derive(Debug, Clone)]
pub struct Mixer {
    store: Arc<ShapeStore<9>>,
    shapes: Vec<usize>,
    distances: Vec<Vec<f32>>,
    settings: MixSettings,
    /// Standard deviation of an entry of a region's own turn, network units.
    turn: f32,
    seed: u64,
}

/// One soft region of one mix: its centre, the width of its window, its weight of each shape.
struct SoftRegion {
    centre: usize,
    inverse_two_sigma_squared: f32,
    blend: Vec<f32>,
    turn: [f32; 3],
}

impl Mixer {
    /// Mixes those of the store (network units, without the reference) that `shapes` lists, `[M]`. Shape: `distances` is
    /// `[candidate centres][V]`, the longest being 1.
    pub fn new(
        store: Arc<ShapeStore<9>>,
        shapes: Vec<usize>,
        distances: Vec<Vec<f32>>,
        settings: MixSettings,
        seed: u64,
    ) -> Self {
        let turn = settings.turn as f32 * mean_turn(&store, &shapes);
        Self {
            store,
            shapes,
            distances,
            settings,
            turn,
            seed,
        }
    }

    /// Mixes number `first .. first + count`, flat `[count][V][9]`: always the same ones for the same seed, whatever was
    /// drawn before, so that a resumed run sees what the interrupted one would have seen.
    pub fn mixes(&self, first: u64, count: usize) -> Vec<f32> {
        let width = self.shapes.first().map_or(0, |&m| self.store[m].len() * 9);
        let mut mixes = vec![0.0; count * width];
        if width > 0 {
            mixes
                .par_chunks_mut(width)
                .enumerate()
                .for_each(|(i, mix)| self.draw(first + i as u64, mix));
        }
        mixes
    }

    fn draw(&self, number: u64, mix: &mut [f32]) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(number);
        let shapes = self.draw_shapes(&mut rng);
        let shape_count = shapes.len();
        let regions = self.draw_regions(shape_count, &mut rng);
        let mut window = vec![0.0_f32; regions.len()];
        let mut blend = vec![0.0_f32; shape_count];
        for (v, x) in mix.chunks_exact_mut(9).enumerate() {
            // Relative to the nearest centre, so that a vertex far from all of them still gets weights that sum to one.
            let mut least = f32::INFINITY;
            for (w, region) in window.iter_mut().zip(&regions) {
                let d = self.distances[region.centre][v];
                *w = d * d * region.inverse_two_sigma_squared;
                least = least.min(*w);
            }
            let mut total = 0.0;
            for w in &mut window {
                *w = (least - *w).exp();
                total += *w;
            }
            blend.fill(0.0);
            for (w, region) in window.iter().zip(&regions) {
                let share = w / total;
                if share > 1e-4 {
                    for (b, a) in blend.iter_mut().zip(&region.blend) {
                        *b += share * a;
                    }
                    for (x, turn) in x.iter_mut().zip(region.turn) {
                        *x += share * turn;
                    }
                }
            }
            for (b, shape) in blend.iter().zip(&shapes) {
                for (out, value) in x.iter_mut().zip(&shape[v]) {
                    *out += b * value;
                }
            }
        }
    }

    /// All shapes, or as many different ones as a mix may have.
    fn draw_shapes(&self, rng: &mut ChaCha8Rng) -> Vec<&[[f32; 9]]> {
        if self.shapes.len() <= SHAPES_OF_A_MIX {
            return self.shapes.iter().map(|&m| &self.store[m]).collect();
        }
        let chosen = rand::seq::index::sample(rng, self.shapes.len(), SHAPES_OF_A_MIX);
        chosen.iter().map(|i| &self.store[self.shapes[i]]).collect()
    }

    fn draw_regions(&self, shape_count: usize, rng: &mut ChaCha8Rng) -> Vec<SoftRegion> {
        let count = if rng.random::<f64>() < self.settings.whole_share {
            1
        } else {
            rng.random_range(
                self.settings.regions_min.max(1)..=self.settings.regions_max.max(self.settings.regions_min).max(1),
            )
        };
        let deviation = 1.0 / (shape_count as f32).sqrt();
        (0..count)
            .map(|_| {
                let sigma = self.settings.reach * (rng.random::<f64>() - 0.5).exp();
                SoftRegion {
                    centre: rng.random_range(0..self.distances.len()),
                    inverse_two_sigma_squared: (0.5 / (sigma * sigma)) as f32,
                    blend: (0..shape_count).map(|_| deviation * standard_normal(rng)).collect(),
                    turn: core::array::from_fn(|_| self.turn * standard_normal(rng)),
                }
            })
            .collect()
    }
}

/// Shapes that are looked at for what a whole sequence does, spread evenly.
pub(super) const LOOKED_AT: usize = 64;

/// Some of the shapes, spread evenly.
pub(super) fn some_of(shapes: &[usize]) -> impl Iterator<Item = usize> + Clone {
    let step = shapes.len().div_ceil(LOOKED_AT).max(1);
    shapes.iter().copied().step_by(step)
}

/// Root mean square of an entry of a rotation over vertices and shapes, network units.
fn mean_turn(store: &ShapeStore<9>, shapes: &[usize]) -> f32 {
    let (mut sum, mut count) = (0.0_f64, 0_usize);
    for m in some_of(shapes) {
        let values = store[m].iter().flat_map(|x| &x[..3]);
        sum += values.map(|x| f64::from(*x).powi(2)).sum::<f64>();
        count += 3 * store[m].len();
    }
    (sum / count.max(1) as f64).sqrt() as f32
}

/// One standard normal number (Box and Muller 1958).
pub(super) fn standard_normal(rng: &mut impl RngCore) -> f32 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    (radius * (core::f64::consts::TAU * rng.random::<f64>()).cos()) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line_mixer(settings: MixSettings) -> Mixer {
        let vertex_count = 50;
        let shape = |seed: usize| {
            (0..vertex_count)
                .map(|v| [((v * 7 + seed * 3) % 11) as f32 / 11.0 - 0.5; 9])
                .collect()
        };
        let distances = (0..vertex_count)
            .map(|c: usize| {
                (0..vertex_count)
                    .map(|v| c.abs_diff(v) as f32 / (vertex_count - 1) as f32)
                    .collect()
            })
            .collect();
        let store = Arc::new(ShapeStore::of_shapes(&[shape(0), shape(1), shape(2)]));
        Mixer::new(store, vec![0, 1, 2], distances, settings, 7)
    }

    #[test]
    fn a_mix_of_many_shapes_takes_some_and_other_mixes_take_others() {
        let mut one = line_mixer(MixSettings {
            whole_share: 1.0,
            turn: 0.0,
            ..MixSettings::default()
        });
        // Shape m moves vertex m alone.
        let count = 2 * SHAPES_OF_A_MIX;
        let shape = |m: usize| (0..count).map(|v| [if v == m { 1.0 } else { 0.0 }; 9]).collect();
        one.store = Arc::new(ShapeStore::of_shapes(&(0..count).map(shape).collect::<Vec<_>>()));
        one.shapes = (0..count).collect();
        one.distances = vec![vec![0.0; count]];
        let moved = |number: u64| -> Vec<usize> {
            let mix = one.mixes(number, 1);
            (0..count).filter(|v| mix[9 * v] != 0.0).collect()
        };
        assert_eq!(moved(0).len(), SHAPES_OF_A_MIX);
        assert_ne!(moved(0), moved(1));
    }

    #[test]
    fn a_region_turns_as_one_beyond_what_its_shapes_do() {
        let of = |turn: f64| {
            line_mixer(MixSettings {
                whole_share: 1.0,
                turn,
                ..MixSettings::default()
            })
            .mixes(2, 1)
        };
        let (still, turned) = (of(0.0), of(1.0));
        let added = |v: usize, c: usize| turned[9 * v + c] - still[9 * v + c];
        assert!((0..3).any(|c| added(0, c).abs() > 1e-3));
        for v in 0..50 {
            assert!(
                (0..3).all(|c| (added(v, c) - added(0, c)).abs() < 1e-5),
                "one region, one turn"
            );
            assert!((3..9).all(|c| added(v, c) == 0.0), "turns do not stretch");
        }
    }

    #[test]
    fn mixes_depend_on_their_number_alone() {
        let mixer = line_mixer(MixSettings::default());
        let together = mixer.mixes(3, 4);
        let alone = mixer.mixes(5, 1);
        assert_eq!(together[2 * 450..3 * 450], alone[..]);
        assert_ne!(together[..450], alone[..]);
    }

    #[test]
    fn one_region_blends_whole_shapes() {
        let mixer = line_mixer(MixSettings {
            whole_share: 1.0,
            ..MixSettings::default()
        });
        let mix = mixer.mixes(0, 1);
        // Shapes repeat with period 11 along the line, so a blend of whole shapes does too.
        for v in 0..39 {
            assert!((mix[v * 9] - mix[(v + 11) * 9]).abs() < 1e-5, "vertex {v}");
        }
    }

    #[test]
    fn normal_numbers_have_unit_variance() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let samples: Vec<f32> = (0..20_000).map(|_| standard_normal(&mut rng)).collect();
        let mean = samples.iter().sum::<f32>() / 20_000.0;
        let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / 20_000.0;
        assert!(
            mean.abs() < 0.03 && (variance - 1.0).abs() < 0.04,
            "mean {mean}, variance {variance}"
        );
    }
}
