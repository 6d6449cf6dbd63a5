//! Which levels of the stack train when.

use core::ops::Range;

use serde::{Deserialize, Serialize};

use crate::network::weights::StackWeights;

/// The order in which levels train.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// All levels at every step (method section 2).
    #[default]
    Joint,
    /// One level after the other, coarse to fine, each for an equal part of the steps and with a rate and an optimiser of
    /// its own: levels above it are frozen, levels below it are not there yet. A time budget may end such a fit before
    /// its last level; lack of improvement ends it in the last level alone.
    LevelByLevel,
}

/// The steps that train the same levels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stage {
    pub(super) steps: Range<usize>,
    /// Levels that train; the network ends with the last of them.
    pub(super) levels: Range<usize>,
}

impl Schedule {
    /// The stage of a step below `step_count`, or of the last one.
    pub(super) fn stage(self, step: usize, step_count: usize, level_count: usize) -> Stage {
        let whole = Stage {
            steps: 0..step_count,
            levels: 0..level_count,
        };
        if self == Self::Joint {
            return whole;
        }
        let first_step = |l: usize| l * step_count / level_count;
        let l = (0..level_count).rfind(|&l| first_step(l) <= step).unwrap_or(0);
        Stage {
            steps: first_step(l)..first_step(l + 1),
            levels: l..l + 1,
        }
    }
}

impl Stage {
    /// The stack up to the last level that trains.
    pub(super) fn network(&self, weights: &StackWeights) -> StackWeights {
        StackWeights {
            vertex_count: weights.vertex_count,
            levels: weights.levels[..self.levels.end].to_vec(),
        }
    }

    /// Completes a gradient of [`Self::network`]: zero for every level that does not train.
    pub(super) fn complete(&self, gradient: StackWeights, weights: &StackWeights) -> StackWeights {
        let mut whole = StackWeights::zeros(weights.vertex_count, &weights.component_counts());
        let trained = gradient.levels.into_iter().enumerate().skip(self.levels.start);
        trained.for_each(|(l, level)| whole.levels[l] = level);
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_belongs_to_one_stage_and_levels_follow_each_other() {
        let stages: Vec<Stage> = (0..10).map(|step| Schedule::LevelByLevel.stage(step, 10, 3)).collect();
        for (step, stage) in stages.iter().enumerate() {
            assert!(stage.steps.contains(&step), "{step}: {stage:?}");
        }
        let levels: Vec<usize> = stages.iter().map(|stage| stage.levels.start).collect();
        assert_eq!(levels, [0, 0, 0, 1, 1, 1, 2, 2, 2, 2]);
        assert_eq!(Schedule::LevelByLevel.stage(10, 10, 3).levels, 2..3);
        assert_eq!(Schedule::Joint.stage(7, 10, 3).levels, 0..3);
    }
}
