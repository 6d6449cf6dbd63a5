//! How a block's residual is shared out among the blocks under its components.

use serde::{Deserialize, Serialize};

use super::kernel::MASK_FLOOR;

/// Where the attention masks come from. They sum to one at every vertex either way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Attention {
    /// From where the components of the block live (method section 2): each block below sees its component's region.
    #[default]
    Components,
    /// Equal shares everywhere: no block below knows where to look. The paper's network without attention.
    Equal,
}

impl Attention {
    /// Energy added to every component at a vertex before masks are normalised. Infinite for equal shares, which the
    /// energies cannot change.
    pub(crate) fn floor(self, vertex_count: usize) -> f32 {
        match self {
            Self::Components => MASK_FLOOR / vertex_count as f32,
            Self::Equal => f32::INFINITY,
        }
    }
}
