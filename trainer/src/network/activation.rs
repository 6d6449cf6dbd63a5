//! What follows a graph convolution.

use serde::{Deserialize, Serialize};

/// The tanh behind every convolution `x` with bias `b`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activation {
    /// `tanh(x + b) - tanh(b)`: the reference, whose features are zero, stays zero in every block.
    #[default]
    FromRest,
    /// `tanh(x + b)`, the paper's. The runtime plays what a weight changes, so what such a network answers to no weights at
    /// all is not in a package.
    Plain,
}

impl Activation {
    /// How much of `tanh(b)` is subtracted.
    pub(crate) fn rest_share(self) -> f32 {
        match self {
            Self::FromRest => 1.0,
            Self::Plain => 0.0,
        }
    }
}
