//! Quality, measured through the runtime: E_rms, STED, projections.
//!
//! Path of data: compact package and sequence -> weights by [`Encoder`], feature projection, position projection -> runtime ->
//! positions -> [`score`] -> [`Evaluation`].

mod ball;
pub mod descent;
mod encode;
mod encoder;
mod erms;
mod evaluation;
mod feature_projection;
mod held_vertices;
mod player;
mod position_projection;
mod scores;
mod shape_reader;
mod stack_encoder;
mod sted;
mod unrolled_encoder;

pub use encode::{EncodeInput, WeightFit, encode};
pub use encoder::{Encoder, EncoderKind, UnknownEncoder};
pub use erms::NormalisedPair;
pub use evaluation::{
    ComponentCounts, Evaluation, EvaluationError, EvaluationInput, MaxPercentageError, Reconstructions, evaluate,
};
pub use feature_projection::{FeatureDecoder, FeatureProjection};
pub use held_vertices::{HoldError, drag_to};
pub use player::{PlayError, Player};
pub use position_projection::{gram_matrix, project_positions};
pub use scores::{ScoreError, Scores, score};
pub use stack_encoder::{EncoderSettings, Encoding, MASK_FLOOR, StackEncoder};
pub use sted::{Sted, sted};
pub use unrolled_encoder::{EncoderRecord, LAYERS, UnrolledEncoder};

#[cfg(test)]
mod fold_tests;
#[cfg(test)]
mod tests;
