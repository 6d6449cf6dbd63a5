//! Quality, measured through the runtime: E_rms, STED, projections.
//!
//! Path of data: compact package and sequence -> weights by encoder, feature projection, position projection -> runtime ->
//! positions -> [`score`] -> [`Evaluation`].

mod ball;
pub(crate) mod descent;
mod encoder;
mod erms;
mod evaluation;
mod feature_metric;
mod feature_projection;
mod player;
mod position_projection;
mod scores;
mod sted;

pub use encoder::{EncoderSettings, Encoding, MASK_FLOOR, Reading, StackEncoder};
pub use erms::NormalisedPair;
pub use evaluation::{
    ComponentCounts, Evaluation, EvaluationError, EvaluationInput, MaxPercentageError, Reconstructions, evaluate,
};
pub use feature_metric::{FeatureMetric, POSITION_WEIGHT};
pub use feature_projection::{FeatureDecoder, FeatureProjection};
pub use player::{PlayError, Player};
pub use position_projection::project_positions;
pub(crate) use position_projection::{gram_matrix, remove_directions, rigid_directions};
pub use scores::{ScoreError, Scores, score};
pub use sted::{Sted, sted};

#[cfg(test)]
mod fold_tests;
#[cfg(test)]
mod tests;
