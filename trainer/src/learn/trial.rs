//! A basis on trial: written once as it would be packaged, then read and played as often as wanted. What holds out shapes, refines
//! and packages all judge a basis by this.

use core::cell::OnceCell;

use rayon::prelude::*;
use sinew_formats::package::AlignedBytes;
use sinew_runtime::Basis;

use super::draft::{Draft, PackageError, with_players};
use super::prepare::Prepared;
use crate::bake::bake;
use crate::components::extract::LearnedBasis;
use crate::config::TrainConfig;
use crate::evaluate::{Encoder, FeatureDecoder, FeatureProjection, NormalisedPair};

/// The basis, its decoder, and, once it is played, its baked package.
pub struct Trial<'p> {
    prepared: &'p Prepared,
    config: &'p TrainConfig,
    compact: Draft,
    decoder: FeatureDecoder,
    baked: OnceCell<AlignedBytes>,
}

impl<'p> Trial<'p> {
    /// Errors: what the format refuses.
    pub fn new(prepared: &'p Prepared, config: &'p TrainConfig, basis: &LearnedBasis) -> Result<Self, PackageError> {
        let compact = basis.write_draft()?;
        let decoder = FeatureDecoder::new(&compact.view()?, &prepared.topology);
        Ok(Self {
            prepared,
            config,
            compact,
            decoder,
            baked: OnceCell::new(),
        })
    }

    /// What the basis decodes with.
    pub fn decoder(&self) -> &FeatureDecoder {
        &self.decoder
    }

    /// Weights by the package's encoder. Shapes: each of `shapes` `[V]`, network units; the answer `[N][K]`.
    pub fn encoded(&self, shapes: &[&[[f32; 9]]]) -> Result<Vec<Vec<f64>>, PackageError> {
        let projection = FeatureProjection::new(&self.decoder, self.prepared.metric());
        let view = self.compact.view()?;
        let settings = self.config.encoder_settings();
        let encoder = Encoder::of_package(&view, &self.prepared.topology, &projection, settings)?;
        Ok(shapes.par_iter().map(|shape| encoder.weights(shape)).collect())
    }

    /// E_rms of `shapes` (network units) through encoder, decode and solve, against `truth`, or against the shapes' own
    /// positions by the solve alone.
    pub fn error(&self, shapes: &[&[[f32; 9]]], truth: Option<Vec<Vec<[f32; 3]>>>) -> Result<f32, PackageError> {
        let codes = self.encoded(shapes)?;
        let basis = Basis::open(self.baked()?)?;
        let played = with_players(&basis, &codes, |player, code| Ok(player.play(code)?.to_vec()))?;
        let truth = match truth {
            Some(truth) => truth,
            None => with_players(&basis, shapes, |player, shape| Ok(player.reconstruct(shape)?.to_vec()))?,
        };
        Ok(NormalisedPair::new(&truth, &played)?.e_rms() as f32)
    }

    /// The baked package; baked at the first call.
    pub fn baked(&self) -> Result<&AlignedBytes, PackageError> {
        match self.baked.get() {
            Some(baked) => Ok(baked),
            None => {
                let baked = bake(&self.compact.view()?)?;
                Ok(self.baked.get_or_init(|| baked))
            }
        }
    }
}
