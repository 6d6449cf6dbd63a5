//! Settings of the refinement: `[refine]`.

use serde::{Deserialize, Serialize};

/// How components are refined for positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RefineSettings {
    /// Turns of finding weights and fitting components; 0 leaves the components as the fit left them.
    pub rounds: usize,
    /// Mixes a turn, fresh ones each. Several times the number of components, or they are learned by heart.
    pub samples: usize,
}

impl Default for RefineSettings {
    fn default() -> Self {
        Self {
            rounds: 3,
            samples: 240,
        }
    }
}
