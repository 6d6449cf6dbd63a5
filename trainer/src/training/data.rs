//! Where the fit's shapes come from.

/// Gives the shapes of each step. A pure function of the source's own seed and the step, so that a resumed fit sees
/// what an uninterrupted one would; it is asked from another thread, one step ahead.
pub trait BatchSource: Send {
    /// Scaled features of the shapes of one step. Shape: `[N][V][9]`, N at least one and free to differ between steps.
    fn batch(&mut self, step: usize) -> Vec<f32>;
}

/// The same shapes at every step: the full batch.
#[derive(Debug, Clone)]
pub struct ShapesSource {
    shapes: Vec<f32>,
}

impl ShapesSource {
    /// Shape of `shapes`: `[N][V][9]`.
    pub fn new(shapes: Vec<f32>) -> Self {
        Self { shapes }
    }
}

impl BatchSource for ShapesSource {
    fn batch(&mut self, _step: usize) -> Vec<f32> {
        self.shapes.clone()
    }
}
