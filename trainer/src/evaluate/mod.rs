//! Quality, measured through the runtime: E_rms, STED, projections.

mod ball;
mod descent;
mod encoder;
mod erms;
mod feature_projection;
mod player;
mod position_projection;
mod scores;
mod sted;

pub use encoder::{Encoding, MASK_FLOOR, StackEncoder};
pub use erms::NormalisedPair;
pub use feature_projection::FeatureDecoder;
pub use player::{PlayError, Player};
pub use position_projection::project_positions;
pub use scores::{ScoreError, Scores, score};
pub use sted::{Sted, sted};
