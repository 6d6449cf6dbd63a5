//! What every later stage of training reads: the mesh, distances on it, and the training shapes as network values.

use core::sync::atomic::{AtomicUsize, Ordering};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use sinew_interchange::{MeshSequence, RenderSurface};

use super::{LearnError, Reporter};
use crate::components::bends::bend_distances;
use crate::components::extract::BasisFrame;
use crate::components::kept::{KeptResponse, claim, network_row};
use crate::components::mix::{MixSettings, Mixer};
use crate::components::painted::painted_labels;
use crate::components::start::Claims;
use crate::components::symmetry::{MirrorPlane, mirrored_features};
use crate::config::TrainConfig;
use crate::evaluate::{EncoderKind, EncoderRecord, LAYERS};
use crate::features::acap::features_of_shape;
use crate::features::align::{RigidMotion, widened};
use crate::features::gradient::GradientFit;
use crate::features::metric::FeatureMetric;
use crate::features::reconstruct::{PoissonSystem, choose_anchor};
use crate::features::scaler::{FeatureScaler, Greatest, deviation};
use crate::mesh::cotangent::EdgeWeights;
use crate::mesh::geodesic::HeatMethod;
use crate::mesh::hanging::hung_by_motion;
use crate::mesh::topology::Topology;
use sinew_interchange::{MAPPED_FROM_BYTES, ShapeStore};

/// Training shapes that say what pieces hang on, at most.
const HANGING_SHAPES_MAX: usize = 32;

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
    pub network: Arc<ShapeStore<9>>,
    /// The same shapes as aligned positions. Shape: `[M][V]`.
    pub aligned: ShapeStore<3>,
    /// What is mixed: the shapes, and behind them their mirror images where the reference has a mirror plane and the shapes are
    /// few. Shape: `[M or 2 M][V][9]`.
    pub poses: Arc<ShapeStore<9>>,
    /// Centres that mixes choose from, spread over the surface.
    pub centres: Vec<usize>,
    /// The same areas in double precision. Shape: `[V]`.
    pub wide_areas: Vec<f64>,
    /// w of the feature metric, of all training shapes together.
    pub position_weight: f64,
    /// What packages keep for their encoder; nothing where it is the paper's.
    pub encoder: Option<EncoderRecord>,
    /// Which vertices belong to painted regions and kept components.
    pub claims: Claims,
    /// Rows of the kept components in network units, of unit length, the last of `claims`. Shape: `[kept][V * 9]`.
    pub kept_rows: Vec<Vec<f32>>,
    kept_names: Vec<String>,
    heat: HeatMethod,
    cache: Mutex<BTreeMap<usize, Arc<Vec<f32>>>>,
}

impl Prepared {
    /// Reads features off the training shapes. `kept`: what [`crate::components::kept::read`] found.
    /// Errors: fewer than one shape besides the reference, shapes that do not move, a mesh that cannot be factored.
    pub fn new(
        sequence: &MeshSequence,
        train_shapes: &[usize],
        config: &TrainConfig,
        kept: &[KeptResponse],
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
        let rest_positions = sequence.shapes[0].to_vec();
        let rest = widened(&rest_positions);
        reporter.stage("features", shapes.len() as u64);
        let seen = spread(&shapes, HANGING_SHAPES_MAX).map(|m| {
            let shape = widened(&sequence.shapes[m]);
            let motion = RigidMotion::onto(&rest, &shape);
            shape.into_iter().map(|p| motion.apply(p)).collect()
        });
        let topology = hung_by_motion(&sequence.faces, &rest, &config.features, seen);
        let weights = EdgeWeights::new(&topology, &rest);
        let fit = GradientFit::new(&topology, &rest, &config.features);
        let read = read_shapes(sequence, &shapes, &rest, &topology, &fit, reporter)?;
        drop(fit);
        let scaler = FeatureScaler::of_greatest(
            read.greatest,
            config.scaling.rotation_reach,
            config.scaling.weight_of_stretch(),
        );
        let (aligned, mut network) = (read.aligned, read.deviations);
        let scales = scaler.scales();
        network
            .values_mut()
            .as_chunks_mut::<9>()
            .0
            .par_iter_mut()
            .for_each(|value| *value = core::array::from_fn(|c| (f64::from(value[c]) / scales[c]) as f32));
        let painted = &config.start.painted;
        let mut labels = painted_labels(painted, rest.len(), config.components[0])?;
        let rows = kept.iter().map(|kept| network_row(&kept.response, &scaler, rest.len()));
        let kept_rows: Vec<Vec<f32>> = rows.collect();
        claim(&mut labels, &kept_rows, painted.len());
        let claims = Claims {
            labels,
            count: painted.len() + kept.len(),
        };
        let anchor = choose_anchor(&rest, aligned.iter().map(widened));
        let system = PoissonSystem::new(&topology, &weights, &rest, anchor)?;
        let areas = topology.vertex_areas(&rest).into_iter().map(|a| a as f32).collect();

        let heat = HeatMethod::new(&topology, &rest)?;
        let centre_count = config.start.centres.min(topology.vertex_count);
        reporter.stage("distances", 1);
        let centres = heat.farthest_points(anchor, centre_count);
        reporter.advance(1, "");
        if reporter.stop_requested() {
            return Err(LearnError::Stopped);
        }
        let network = Arc::new(network);
        let wide_areas = topology.vertex_areas(&rest);
        let poses = with_mirror_images(&network, &rest, &wide_areas, &topology, reporter);
        let position_weight = FeatureMetric::new(&system, scales, &wide_areas).common_position_weight(network.iter());
        let encoder = (config.encoder == EncoderKind::Unrolled).then_some(EncoderRecord {
            layers: LAYERS,
            position_weight,
        });
        Ok(Self {
            encoder,
            poses,
            wide_areas,
            position_weight,
            aligned,
            rest,
            rest_positions,
            render: sequence.render.clone(),
            topology,
            system,
            areas,
            scaler,
            network,
            centres,
            claims,
            kept_rows,
            kept_names: kept.iter().map(|kept| kept.name.clone()).collect(),
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

    /// The metric that counts what features do to positions.
    pub fn metric(&self) -> FeatureMetric<'_> {
        FeatureMetric::new(&self.system, self.scaler.scales(), &self.wide_areas)
    }

    /// Draws mixes of the given shapes, and of their mirror images where there are some and they are wanted.
    pub fn mixer(&self, shapes: &[usize], settings: &MixSettings, seed: u64) -> Mixer {
        let mut shapes = shapes.to_vec();
        if settings.mirror && self.poses.len() > self.network.len() {
            shapes.extend(shapes.clone().iter().map(|m| m + self.network.len()));
        }
        let distances = bend_distances(
            &self.topology,
            &self.rest,
            &self.poses,
            &shapes,
            settings.bend,
            &self.centres,
        );
        Mixer::new(Arc::clone(&self.poses), shapes, distances, settings.clone(), seed)
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
            encoder: self.encoder,
            kept: self.kept_roots().zip(self.kept_names.iter().cloned()).collect(),
        }
    }

    /// Numbers of the root components that are kept.
    pub fn kept_roots(&self) -> core::ops::Range<usize> {
        self.claims.count - self.kept_rows.len()..self.claims.count
    }

    /// A number that tells runs on other data or settings apart.
    pub fn fingerprint(&self, config: &TrainConfig) -> String {
        let checksum = crc::Crc::<u64>::new(&crc::CRC_64_XZ);
        let mut digest = checksum.digest();
        digest.update(config.to_toml().as_bytes());
        digest.update(bytemuck::cast_slice(&self.rest_positions));
        digest.update(bytemuck::cast_slice(&self.topology.faces));
        for row in &self.kept_rows {
            digest.update(bytemuck::cast_slice(row));
        }
        for shape in self.network.iter() {
            digest.update(bytemuck::cast_slice(shape));
        }
        format!("{:016x}", digest.finalize())
    }
}

/// The training shapes, read off one by one: no more than a few are held in double precision.
struct ReadShapes {
    /// Shape: `[M][V]`.
    aligned: ShapeStore<3>,
    /// Features less the reference's, not scaled yet. Shape: `[M][V]`.
    deviations: ShapeStore<9>,
    greatest: Greatest,
}

fn read_shapes(
    sequence: &MeshSequence,
    shapes: &[usize],
    rest: &[[f64; 3]],
    topology: &Topology,
    fit: &GradientFit<'_>,
    reporter: &dyn Reporter,
) -> Result<ReadShapes, LearnError> {
    let vertex_count = rest.len();
    let full = |source| LearnError::Store { source };
    let mut aligned = ShapeStore::<3>::zeros(shapes.len(), vertex_count, MAPPED_FROM_BYTES).map_err(full)?;
    let mut deviations = ShapeStore::<9>::zeros(shapes.len(), vertex_count, MAPPED_FROM_BYTES).map_err(full)?;
    let mapped = aligned.mapped_bytes().unwrap_or(0) + deviations.mapped_bytes().unwrap_or(0);
    if mapped > 0 {
        reporter.notice(&format!(
            "features of {} shapes take {:.1} GB, in a file without a name in {} (TMPDIR names another folder)",
            shapes.len(),
            mapped as f64 * 1e-9,
            std::env::temp_dir().display()
        ));
    }
    let done = AtomicUsize::new(0);
    let places = aligned.values_mut().par_chunks_mut(3 * vertex_count);
    let places = places.zip(deviations.values_mut().par_chunks_mut(9 * vertex_count));
    let found: Vec<(bool, Greatest)> = shapes
        .par_iter()
        .zip(places)
        .map(|(&m, (positions, values))| {
            if reporter.stop_requested() {
                return (false, Greatest::default());
            }
            let shape = widened(&sequence.shapes[m]);
            let motion = RigidMotion::onto(rest, &shape);
            let shape: Vec<[f64; 3]> = shape.into_iter().map(|p| motion.apply(p)).collect();
            let features = features_of_shape(topology, fit, &shape);
            for (place, p) in positions.as_chunks_mut().0.iter_mut().zip(&shape) {
                *place = p.map(|x| x as f32);
            }
            for (place, feature) in values.as_chunks_mut().0.iter_mut().zip(&features) {
                *place = deviation(feature).map(|x| x as f32);
            }
            reporter.advance(done.fetch_add(1, Ordering::Relaxed) as u64 + 1, "");
            (moves(rest, &shape), Greatest::of(&features))
        })
        .collect();
    if reporter.stop_requested() {
        return Err(LearnError::Stopped);
    }
    if !found.iter().any(|(moves, _)| *moves) {
        return Err(LearnError::NothingMoves { shapes: shapes.len() });
    }
    let greatest = found.into_iter().map(|(_, greatest)| greatest);
    Ok(ReadShapes {
        aligned,
        deviations,
        greatest: greatest.fold(Greatest::default(), Greatest::or),
    })
}

/// Most shapes that mirror images are made of: more need none, and would need room.
const MIRRORED_MAX: usize = 64;

/// Rounds of averaging with the ring that smooth what a mirror image takes from the nearest vertices.
const MIRROR_SMOOTHING: usize = 1;

fn with_mirror_images(
    network: &Arc<ShapeStore<9>>,
    rest: &[[f64; 3]],
    areas: &[f64],
    topology: &Topology,
    reporter: &dyn Reporter,
) -> Arc<ShapeStore<9>> {
    if network.len() > MIRRORED_MAX {
        return Arc::clone(network);
    }
    let Some(plane) = MirrorPlane::find(rest, areas, topology) else {
        return Arc::clone(network);
    };
    let normal = plane.normal.into();
    let images = network.iter().map(|shape| {
        let mirrored = plane.mirrored.iter().map(|&other| {
            let x = shape[other as usize].map(f64::from);
            mirrored_features(&x, normal).map(|x| x as f32)
        });
        let mut image: Vec<[f32; 9]> = mirrored.collect();
        for _ in 0..MIRROR_SMOOTHING {
            image = (0..image.len())
                .map(|v| {
                    let ring = topology.ring_of(v);
                    let share = 1.0 / (1 + ring.len()) as f32;
                    core::array::from_fn(|c| {
                        (image[v][c] + ring.iter().map(|&j| image[j as usize][c]).sum::<f32>()) * share
                    })
                })
                .collect();
        }
        image
    });
    reporter.notice("the reference is its own mirror image, nearly: mirror images of the shapes are learned from, too");
    let all: Vec<Vec<[f32; 9]>> = network.iter().map(<[_]>::to_vec).chain(images).collect();
    Arc::new(ShapeStore::of_shapes(&all))
}

/// Up to `count` of `shapes`, spread evenly.
pub(super) fn spread(shapes: &[usize], count: usize) -> impl Iterator<Item = usize> {
    let count = count.min(shapes.len());
    (0..count).map(move |i| shapes[i * shapes.len() / count])
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
