//! The one encoder of a package: what `sinew encode` reads weights with, what every figure of an encoder is measured with, and
//! what validation goes by.

use serde::{Deserialize, Serialize};
use sinew_formats::package::{CompactView, FEATURE_COUNT};

use super::feature_projection::FeatureProjection;
use super::stack_encoder::{EncoderSettings, Encoding, StackEncoder};
use super::unrolled_encoder::{EncoderRecord, UnrolledEncoder};
use crate::mesh::topology::Topology;

/// How weights are read off a shape in one pass.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EncoderKind {
    /// By a few layers, each of which reads what those before it left by one fixed matrix that follows from the components.
    #[default]
    Unrolled,
    /// As the paper does: block by block, by the rows that decode.
    Paper,
}

/// The encoder that a package was trained for.
pub enum Encoder<'e> {
    /// Of layers, each of which reads what is left by one fixed matrix.
    Unrolled(UnrolledEncoder<'e>),
    /// The paper's, of a package that keeps no record of another.
    Paper(StackEncoder<'e>),
}

/// What a package keeps for its encoder is of a form that this version does not know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the package's encoder is of another version: read its weights with the version of sinew that trained it")]
pub struct UnknownEncoder;

impl<'e> Encoder<'e> {
    /// `projection` and `topology` are the package's, `settings` those of its training.
    /// Errors: a record of an unknown form.
    pub fn of_package(
        package: &CompactView<'_>,
        topology: &'e Topology,
        projection: &'e FeatureProjection<'e>,
        settings: EncoderSettings,
    ) -> Result<Self, UnknownEncoder> {
        if package.encoder().is_empty() {
            return Ok(Self::Paper(StackEncoder::new(package, topology, settings)));
        }
        let record = EncoderRecord::from_bytes(package.encoder()).ok_or(UnknownEncoder)?;
        let roots = package.components().filter(|component| component.block == 0).count();
        Ok(Self::Unrolled(UnrolledEncoder::new(projection, record, roots)))
    }

    /// Weights of one shape. Shapes: `features` `[V]`, source order, network units; the answer `[K]`.
    pub fn weights(&self, features: &[[f32; FEATURE_COUNT]]) -> Vec<f64> {
        match self {
            Self::Unrolled(encoder) => encoder.weights(features),
            Self::Paper(encoder) => encoder.encode(features).weights,
        }
    }

    /// Where a search for better weights starts: at the encoder's `weights`, or at rest where they are the paper's, which need not
    /// be nearer.
    pub fn start_of_projection(&self, weights: &[f64]) -> Vec<f64> {
        match self {
            Self::Unrolled(_) => weights.to_vec(),
            Self::Paper(_) => vec![0.0; weights.len()],
        }
    }

    /// Weights of one shape, and what the root block and all blocks leave of its features.
    pub fn encode(&self, features: &[[f32; FEATURE_COUNT]]) -> Encoding {
        match self {
            Self::Unrolled(encoder) => {
                let weights = encoder.weights(features);
                Encoding {
                    root_residual_energy: encoder.left_by(&encoder.root_weights(features), features),
                    residual_energy: encoder.left_by(&weights, features),
                    energy: features.as_flattened().iter().map(|&x| f64::from(x).powi(2)).sum(),
                    weights,
                }
            }
            Self::Paper(encoder) => encoder.encode(features),
        }
    }
}
