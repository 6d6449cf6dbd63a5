//! When the samples of an Alembic archive are: what its time samplings say, for frame rates and order.

/// Time between cycles that says that there are none.
const ACYCLIC: f64 = f64::MAX / 32.0;

/// A time sampling: when sample `n` is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sampling {
    /// Seconds after which `times` repeat.
    pub(super) cycle: f64,
    pub(super) times: Vec<f64>,
}

impl Sampling {
    /// Seconds of sample `n`.
    pub(super) fn time(&self, n: usize) -> f64 {
        let count = self.times.len();
        if self.cycle >= ACYCLIC {
            return self.times[n.min(count - 1)];
        }
        self.times[n % count] + (n / count) as f64 * self.cycle
    }

    /// How many samples have a time of their own.
    pub(super) fn reaches(&self, sample_count: usize) -> bool {
        self.cycle < ACYCLIC || sample_count <= self.times.len()
    }

    /// Whether times ascend, so that frames are in order.
    pub(super) fn ascends(&self) -> bool {
        let finite = self.times.iter().all(|time| time.is_finite());
        let inside = self.times.windows(2).all(|pair| pair[0] < pair[1]);
        let cycles = self.cycle >= ACYCLIC || self.cycle > self.times[self.times.len() - 1] - self.times[0];
        finite && inside && cycles
    }
}
