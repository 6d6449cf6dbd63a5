//! Where the fit's shapes come from.

use std::sync::Arc;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use sinew_interchange::ShapeStore;

/// Gives the shapes of each step. A pure function of the source's own seed and the step, so that a resumed fit sees
/// what an uninterrupted one would; it is asked from another thread, one step ahead.
pub trait BatchSource: Send {
    /// Scaled features of the shapes of one step. Shape: `[N][V][9]`, N at least one and free to differ between steps.
    fn batch(&mut self, step: usize) -> Vec<f32>;
}

/// The same values at every step.
#[derive(Debug, Clone)]
pub struct FixedBatch {
    values: Vec<f32>,
}

impl FixedBatch {
    /// Shape of `values`: `[N][V][9]`.
    pub fn new(values: Vec<f32>) -> Self {
        Self { values }
    }
}

impl BatchSource for FixedBatch {
    fn batch(&mut self, _step: usize) -> Vec<f32> {
        self.values.clone()
    }
}

/// Most shapes of one step.
pub const BATCH_MAX: usize = 256;

/// The shapes themselves: all of them at every step, or where they are more than [`BATCH_MAX`], as many in turns, shuffled
/// anew in every turn.
#[derive(Debug, Clone)]
pub struct ShapesSource {
    store: Arc<ShapeStore<9>>,
    /// `None` is the reference, whose features are zero and not in the store.
    shapes: Vec<Option<usize>>,
    seed: u64,
}

impl ShapesSource {
    /// Those of the store that `shapes` lists, and before them the reference where a network does not give it back by itself.
    pub fn new(store: Arc<ShapeStore<9>>, shapes: &[usize], with_reference: bool, seed: u64) -> Self {
        let reference = with_reference.then_some(None);
        let shapes = reference.into_iter().chain(shapes.iter().copied().map(Some)).collect();
        Self { store, shapes, seed }
    }

    /// Steps of one pass over all shapes.
    pub fn steps_of_a_pass(&self) -> usize {
        self.shapes.len().div_ceil(BATCH_MAX)
    }

    /// The shapes of a step, in the order of its turn.
    fn of_step(&self, step: usize) -> Vec<Option<usize>> {
        if self.shapes.len() <= BATCH_MAX {
            return self.shapes.clone();
        }
        let steps_of_a_turn = self.steps_of_a_pass();
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream((step / steps_of_a_turn) as u64);
        let mut order = self.shapes.clone();
        order.shuffle(&mut rng);
        let first = step % steps_of_a_turn * BATCH_MAX;
        order[first..order.len().min(first + BATCH_MAX)].to_vec()
    }
}

impl BatchSource for ShapesSource {
    fn batch(&mut self, step: usize) -> Vec<f32> {
        let at_rest = vec![[0.0; 9]; self.store.vertex_count()];
        let shapes = self.of_step(step);
        shapes
            .iter()
            .flat_map(|m| m.map_or(&at_rest[..], |m| &self.store[m]).as_flattened())
            .copied()
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_shapes_come_in_turns_and_each_turn_shows_all() {
        let count = BATCH_MAX + 44;
        let store: Vec<Vec<[f32; 9]>> = (0..count).map(|m| vec![[m as f32; 9]]).collect();
        let mut source = ShapesSource::new(
            Arc::new(ShapeStore::of_shapes(&store)),
            &(0..count).collect::<Vec<_>>(),
            false,
            3,
        );
        let mut turn = |n: usize| -> Vec<f32> { [2 * n, 2 * n + 1].map(|step| source.batch(step)).concat() };
        let (first, second) = (turn(0), turn(1));
        assert_ne!(first, second);
        for mut values in [first, second] {
            values.sort_unstable_by(f32::total_cmp);
            let all: Vec<f32> = (0..count).flat_map(|m| [m as f32; 9]).collect();
            assert_eq!(values, all);
        }
        source.shapes.truncate(5);
        assert_eq!(source.batch(0), source.batch(1));
        assert_eq!(source.batch(0).len(), 5 * 9);
    }
}
