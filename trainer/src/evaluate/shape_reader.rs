//! A compact package opened for reading shapes: its mesh, what its features are measured in, its decoder.

use sinew_formats::package::{CompactView, FEATURE_COUNT};

use super::encoder::{Encoder, UnknownEncoder};
use super::feature_projection::{FeatureDecoder, FeatureProjection};
use super::stack_encoder::EncoderSettings;
use crate::bake::Surface;
use crate::features::acap::features_of_shape;
use crate::features::align::{RigidMotion, widened};
use crate::features::gradient::{FeatureSettings, GradientFit};
use crate::features::metric::FeatureMetric;
use crate::features::reconstruct::PoissonSystem;
use crate::features::scaler::FeatureScaler;
use crate::mesh::sparse_factor::FactorError;

/// What all shapes share.
pub(super) struct ShapeReader<'p> {
    package: &'p CompactView<'p>,
    surface: Surface,
    areas: Vec<f64>,
    scaler: FeatureScaler,
    system: PoissonSystem,
    decoder: FeatureDecoder,
}

impl<'p> ShapeReader<'p> {
    /// Errors: a mesh that has no factor.
    pub(super) fn new(package: &'p CompactView<'p>) -> Result<Self, FactorError> {
        let surface = Surface::of_package(package);
        let anchor = package.anchor_vertex() as usize;
        Ok(Self {
            areas: surface.topology.vertex_areas(&surface.rest),
            scaler: FeatureScaler {
                rotation_scale: package.rotation_scale(),
                stretch_scale: package.stretch_scale(),
            },
            system: PoissonSystem::new(&surface.topology, &surface.weights, &surface.rest, anchor)?,
            decoder: FeatureDecoder::new(package, &surface.topology),
            package,
            surface,
        })
    }

    /// K solves.
    pub(super) fn projection(&self) -> FeatureProjection<'_> {
        let metric = FeatureMetric::new(&self.system, self.scaler.scales(), &self.areas);
        FeatureProjection::new(&self.decoder, metric)
    }

    /// The package's encoder. Errors: one of an unknown form.
    pub(super) fn encoder<'e>(
        &'e self,
        projection: &'e FeatureProjection<'e>,
        settings: EncoderSettings,
    ) -> Result<Encoder<'e>, UnknownEncoder> {
        Encoder::of_package(self.package, &self.surface.topology, projection, settings)
    }

    /// How deformation gradients are fitted on this mesh.
    pub(super) fn gradients(&self, settings: &FeatureSettings) -> GradientFit<'_> {
        GradientFit::new(&self.surface.topology, &self.surface.rest, settings)
    }

    /// Features of a shape brought near the reference, network units. Shape: `[V]`.
    pub(super) fn features(&self, fit: &GradientFit<'_>, positions: &[[f32; 3]]) -> Vec<[f32; FEATURE_COUNT]> {
        let wide = widened(positions);
        let motion = RigidMotion::onto(&self.surface.rest, &wide);
        let aligned: Vec<[f64; 3]> = wide.iter().map(|&p| motion.apply(p)).collect();
        self.scaler
            .to_network(&features_of_shape(&self.surface.topology, fit, &aligned))
    }
}
