//! What every later stage of training reads: the mesh, distances on it, and the training shapes as network values.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use sinew_formats::interchange::{MeshSequence, RenderSurface};

use super::{LearnError, Reporter};
use crate::components::extract::BasisFrame;
use crate::config::TrainConfig;
use crate::features::acap::AcapFeatures;
use crate::features::align::{align_shapes, widened};
use crate::features::reconstruct::{PoissonSystem, choose_anchor};
use crate::features::scaler::FeatureScaler;
use crate::mesh::cotangent::EdgeWeights;
use crate::mesh::geodesic::HeatMethod;
use crate::mesh::topology::Topology;

/// Displacements below this share of the bounding box are no motion.
const STILL: f64 = 1e-7;

/// The mesh and the training shapes, ready for the network. M shapes besides the reference.
pub struct Prepared {
    /// Rest shape. Shape: `[V]`.
    pub rest: Vec<[f64; 3]>,
    /// The same as in the file.
    pub rest_positions: Vec<[f32; 3]>,
    /// Texture coordinates, where the reference has some: only passed on.
    pub render: Option<RenderSurface>,
    /// One-rings.
    pub topology: Topology,
    /// The solve behind the features.
    pub system: PoissonSystem,
    /// Vertex areas, mean 1. Shape: `[V]`.
    pub areas: Vec<f32>,
    /// Scales between features and network values.
    pub scaler: FeatureScaler,
    /// Training shapes in network units, reference excluded. Shape: `[M][V][9]`.
    pub network: Vec<Vec<[f32; 9]>>,
    /// The same shapes as aligned positions. Shape: `[M][V]`.
    pub aligned: Vec<Vec<[f32; 3]>>,
    /// Distances from the centres that mixes choose from, longest 1. Shape: `[centres][V]`.
    pub centre_distances: Vec<Vec<f32>>,
    heat: HeatMethod,
    cache: Mutex<BTreeMap<usize, Arc<Vec<f32>>>>,
}

impl Prepared {
    /// Reads features off the training shapes.
    /// Errors: fewer than one shape besides the reference, shapes that do not move, a mesh that cannot be factored.
    pub fn new(
        sequence: &MeshSequence,
        train_shapes: &[usize],
        config: &TrainConfig,
        reporter: &dyn Reporter,
    ) -> Result<Self, LearnError> {
        let shapes: Vec<usize> = train_shapes
            .iter()
            .copied()
            .filter(|&m| m != 0 && m < sequence.shape_count())
            .collect();
        if shapes.is_empty() {
            return Err(LearnError::TooFewShapes { found: 0, needed: 1 });
        }
        let rest_positions = sequence.shapes[0].clone();
        let rest = widened(&rest_positions);
        reporter.stage("features", shapes.len() as u64);
        let topology = Topology::new(&sequence.faces, &rest);
        let weights = EdgeWeights::new(&topology, &rest);
        let chosen: Vec<Vec<[f32; 3]>> = shapes.iter().map(|&m| sequence.shapes[m].clone()).collect();
        let aligned: Vec<Vec<[f64; 3]>> = align_shapes(&rest, &chosen)
            .into_iter()
            .map(|shape| shape.positions)
            .collect();
        if !aligned.iter().any(|shape| moves(&rest, shape)) {
            return Err(LearnError::NothingMoves { shapes: shapes.len() });
        }
        let features = AcapFeatures::compute(&topology, &rest, &aligned, &config.features, &|done| {
            reporter.advance(done as u64, "")
        });
        if reporter.stop_requested() {
            return Err(LearnError::Stopped);
        }
        let all: Vec<usize> = (0..shapes.len()).collect();
        let scaler = FeatureScaler::fit(
            &features,
            &all,
            config.scaling.rotation_reach,
            config.scaling.stretch_weight,
        );
        let network = features.shapes.iter().map(|shape| scaler.to_network(shape)).collect();
        let anchor = choose_anchor(&rest, &aligned);
        let system = PoissonSystem::new(&topology, &weights, &rest, anchor)?;
        let areas = topology.vertex_areas(&rest).into_iter().map(|a| a as f32).collect();

        let heat = HeatMethod::new(&topology, &rest)?;
        let centre_count = config.start.centres.min(topology.vertex_count);
        reporter.stage("distances", 1);
        let centre_distances = heat
            .farthest_points(anchor, centre_count)
            .into_iter()
            .map(|v| narrowed(heat.normalised_distances(v)))
            .collect();
        reporter.advance(1, "");
        if reporter.stop_requested() {
            return Err(LearnError::Stopped);
        }
        let rounded = |shape: &Vec<[f64; 3]>| shape.iter().map(|p| p.map(|x| x as f32)).collect();
        Ok(Self {
            aligned: aligned.iter().map(rounded).collect(),
            rest,
            rest_positions,
            render: sequence.render.clone(),
            topology,
            system,
            areas,
            scaler,
            network,
            centre_distances,
            heat,
            cache: Mutex::new(BTreeMap::new()),
        })
    }

    /// Distances from a vertex along the surface, as a share of the longest one known. Shape: `[V]`. Cached by vertex.
    pub fn distances(&self, v: usize) -> Vec<f32> {
        let cached = self
            .cache
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get(&v)
            .cloned();
        let found = cached.unwrap_or_else(|| {
            let found: Vec<f32> = narrowed(self.heat.normalised_distances(v));
            let found = Arc::new(found);
            self.cache
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .insert(v, Arc::clone(&found));
            found
        });
        found.as_ref().clone()
    }

    /// Up to `count` vertices spread over the surface, the anchor first.
    pub fn spread_vertices(&self, count: usize) -> Vec<usize> {
        self.heat.farthest_points(self.system.anchor(), count)
    }

    /// The mesh and scales as the package wants them.
    pub fn basis_frame(&self) -> BasisFrame {
        BasisFrame {
            rest_positions: self.rest_positions.clone(),
            faces: self.topology.faces.clone(),
            bridges: self.topology.bridges.clone(),
            anchor_vertex: self.system.anchor() as u32,
            rotation_scale: self.scaler.rotation_scale,
            stretch_scale: self.scaler.stretch_scale,
            render: self.render.clone(),
        }
    }

    /// A number that tells runs on other data or settings apart.
    pub fn fingerprint(&self, config: &TrainConfig) -> String {
        let checksum = crc::Crc::<u64>::new(&crc::CRC_64_XZ);
        let mut digest = checksum.digest();
        digest.update(config.to_toml().as_bytes());
        digest.update(bytemuck::cast_slice(&self.rest_positions));
        digest.update(bytemuck::cast_slice(&self.topology.faces));
        for shape in &self.network {
            digest.update(bytemuck::cast_slice(shape));
        }
        format!("{:016x}", digest.finalize())
    }
}

fn narrowed(values: Vec<f64>) -> Vec<f32> {
    values.into_iter().map(|x| x as f32).collect()
}

/// Whether an aligned shape differs from the reference.
pub(super) fn moves(rest: &[[f64; 3]], shape: &[[f64; 3]]) -> bool {
    let extent = (0..3)
        .map(|c| {
            let values = rest.iter().map(|p| p[c]);
            values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
        })
        .fold(0.0, f64::max);
    shape
        .iter()
        .zip(rest)
        .any(|(p, r)| (0..3).any(|c| (p[c] - r[c]).abs() > STILL * extent))
}
