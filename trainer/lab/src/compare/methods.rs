//! Every method in turn: train, fit unseen shapes, score.

use rayon::prelude::*;
use sinew_command::report::principal::PrincipalComponents;
use sinew_formats::package::CompactView;

use super::bench::{Bench, narrowed};
use super::control_points::{drag_held, move_by_handles};
use super::feature_fit::FeatureFit;
use super::fitting::{project_linear, project_positions};
use super::memory::{Cost, Meter};
use super::{
    CompareError, CompareInput, ComparedShapes, Comparison, HANDLE_COUNTS, Method, Projection, ProjectionKind,
    two_levels,
};
use crate::baselines::bernard::bernard;
use crate::baselines::gradient_field::FaceField;
use crate::baselines::huang::{face_features, huang};
use crate::baselines::length_angle::LengthAngleField;
use crate::baselines::linear::{LinearBasis, LinearProjection};
use crate::baselines::model::{GradientModel, Model, PositionModel};
use crate::baselines::splocs::{SplocsSettings, splocs};
use crate::baselines::tan::{TanSettings, train};
use crate::baselines::wang::{LengthAngleModel, wang};
use sinew_trainer::components::position_modes::keep_linear_algebra_serial;
use sinew_trainer::config::TrainConfig;
use sinew_trainer::evaluate::{
    EvaluationError, EvaluationInput, FeatureDecoder, FeatureProjection, Scores, evaluate, score,
};
use sinew_trainer::features::metric::FeatureMetric;
use sinew_trainer::features::scaler::FeatureScaler;
use sinew_trainer::learn::prepare::Prepared;
use sinew_trainer::learn::{LearnError, Reporter, RunOptions, learn};

/// First learning rate of the one-level autoencoder, as published.
const TAN_RATE: f32 = 1e-3;
/// Relative size below which a shape does not move: the missed share of its energy means nothing.
const STILL: f64 = 1e-12;

const SPLOCS_SOURCE: &str = "Neumann et al. 2013";

/// Compares. The same figures for any number of threads, times excepted.
/// Errors: a split that leaves nothing to learn from or to measure, a package of another mesh or split, a wish to stop.
pub fn compare(input: CompareInput<'_>, reporter: &dyn Reporter) -> Result<(Comparison, ComparedShapes), CompareError> {
    keep_linear_algebra_serial();
    let bench = Bench::new(input, reporter)?;
    let settings = input.settings;
    let vertices = bench.prepared.rest.len();
    let count = settings.component_count;
    let handles = if settings.quick {
        Vec::new()
    } else {
        bench.prepared.spread_vertices(HANDLE_COUNTS[HANDLE_COUNTS.len() - 1])
    };
    let mut run = Run {
        control_points: HANDLE_COUNTS
            .iter()
            .copied()
            .filter(|&count| count <= handles.len())
            .collect(),
        handles,
        methods: Vec::new(),
        reconstructions: Vec::new(),
        round_trip: None,
        bench: &bench,
        reporter,
    };
    let distances = |v: usize| bench.prepared.distances(v);

    run.positions("PCA on positions", "Alexa and Müller 2000", || {
        let flat: Vec<Vec<f64>> = bench.train.iter().map(|shape| shape.as_flattened().to_vec()).collect();
        LinearBasis::of(PrincipalComponents::fit(&flat, count), 3)
    })?;
    run.positions("SPLOCS on positions", SPLOCS_SOURCE, || {
        let flat: Vec<Vec<f64>> = bench.train.iter().map(|shape| shape.as_flattened().to_vec()).collect();
        splocs(&flat, 3, &distances, &SplocsSettings::published(count))
    })?;

    run.positions("Local factors", "Bernard et al. 2016", || {
        let flat: Vec<Vec<f64>> = bench.train.iter().map(|shape| shape.as_flattened().to_vec()).collect();
        let (topology, rest) = (&bench.prepared.topology, &bench.prepared.rest);
        bernard(&flat, topology, rest, &distances, count)
    })?;

    let own = Features {
        weights: &bench.areas,
        train: &bench.train_features,
        test: &bench.test_features,
        model: &|basis| {
            Box::new(GradientModel {
                decoder: Box::new(basis),
                field: &bench.prepared.system,
                scales: bench.prepared.scaler.scales(),
            })
        },
    };
    run.features("PCA on features", "Alexa and Müller 2000", &own, |train| {
        LinearBasis::of(PrincipalComponents::fit(train, count), 9)
    })?;
    run.features("SPLOCS on features", SPLOCS_SOURCE, &own, |train| {
        splocs(train, 9, &distances, &SplocsSettings::published(count))
    })?;

    let field = FaceField::new(&bench.prepared.topology, &bench.prepared.rest)?;
    let read = |shapes: &[Vec<[f64; 3]>], of: &(dyn Fn(&[[f64; 3]]) -> Vec<f64> + Sync)| -> Vec<Vec<f64>> {
        shapes.par_iter().map(|shape| of(shape)).collect()
    };
    let of_faces = |shape: &[[f64; 3]]| face_features(&field, shape);
    let faces = Features {
        weights: &field.areas(),
        train: &read(&bench.train, &of_faces),
        test: &read(&bench.test, &of_faces),
        model: &|basis| {
            Box::new(GradientModel {
                decoder: Box::new(basis),
                field: &field,
                scales: [1.0; 9],
            })
        },
    };
    run.features("Deformation gradients", "Huang et al. 2014", &faces, |train| {
        huang(&field, train, &distances, count)
    })?;

    let lengths = LengthAngleField::new(&field)?;
    let of_edges = |shape: &[[f64; 3]]| lengths.features(shape);
    let edges = Features {
        weights: &lengths.areas(),
        train: &read(&bench.train, &of_edges),
        test: &read(&bench.test, &of_edges),
        model: &|basis| {
            Box::new(LengthAngleModel {
                basis,
                field: &lengths,
                vertex_count: vertices,
            })
        },
    };
    run.features("Lengths and angles", "Wang et al. 2017", &edges, |train| {
        wang(&lengths, train, &distances, count)
    })?;

    run.one_level_autoencoder()?;
    run.ours()?;

    let round_trip = run
        .round_trip
        .ok_or(EvaluationError::Score(sinew_trainer::evaluate::ScoreError::Nothing))?;
    let shapes = ComparedShapes {
        shapes: bench.test_shapes.clone(),
        truth: bench.test.iter().map(|shape| narrowed(shape)).collect(),
        reconstructions: run.reconstructions,
    };
    let comparison = Comparison {
        sequence: input.sequence.name.clone(),
        vertices,
        train_shapes: bench.train.len(),
        test_shapes: bench.test_shapes.len(),
        components: count,
        seed: settings.config.seed,
        control_points: run.control_points,
        round_trip,
        methods: run.methods,
    };
    Ok((comparison, shapes))
}

/// Features of one kind, with the way from them to positions.
struct Features<'g> {
    /// Of elements.
    weights: &'g [f64],
    train: &'g [Vec<f64>],
    test: &'g [Vec<f64>],
    model: &'g (dyn Fn(LinearBasis) -> Box<dyn Model + 'g> + Sync),
}

/// What a method found for the measured shapes, one way to find weights.
struct Found {
    kind: ProjectionKind,
    shapes: Vec<Vec<[f32; 3]>>,
    max_percentage_error: Option<f64>,
}

struct Trained<'m> {
    name: &'m str,
    source: &'m str,
    cost: Cost,
    note: Option<String>,
    /// Of this project's own methods: the compact package.
    package: Option<&'m [u8]>,
    /// Weights of the training shapes. Shape: `[1 + M][K]`.
    train_weights: Vec<Vec<f64>>,
}

struct Run<'r, 'a> {
    bench: &'r Bench<'a>,
    reporter: &'r dyn Reporter,
    handles: Vec<usize>,
    control_points: Vec<usize>,
    methods: Vec<Method>,
    reconstructions: Vec<Vec<Vec<Vec<[f32; 3]>>>>,
    round_trip: Option<Scores>,
}

impl Run<'_, '_> {
    fn begin(&self, name: &str) -> Result<Meter, CompareError> {
        if self.reporter.stop_requested() {
            return Err(LearnError::Stopped.into());
        }
        self.reporter.stage(name, 1);
        Ok(Meter::begin())
    }

    fn positions(
        &mut self,
        name: &str,
        source: &str,
        factor: impl FnOnce() -> LinearBasis,
    ) -> Result<(), CompareError> {
        let meter = self.begin(name)?;
        let basis = factor();
        let cost = meter.cost();
        let projection = LinearProjection::new(&basis, &vec![1.0; self.bench.prepared.rest.len()]);
        let weights_of = |shapes: &[Vec<[f64; 3]>]| -> Vec<Vec<f64>> {
            let shapes = shapes.par_iter();
            shapes.map(|shape| project_linear(&basis, &projection, shape)).collect()
        };
        let model = PositionModel(basis.clone());
        let posed = weights_of(&self.bench.test)
            .par_iter()
            .map(|w| narrowed(&model.pose(w)))
            .collect();
        let trained = Trained {
            name,
            source,
            cost,
            note: None,
            package: None,
            train_weights: weights_of(&self.bench.train),
        };
        let found = Found {
            kind: ProjectionKind::Positions,
            shapes: posed,
            max_percentage_error: None,
        };
        self.finish(trained, &model, vec![found])
    }

    fn features(
        &mut self,
        name: &str,
        source: &str,
        features: &Features<'_>,
        factor: impl FnOnce(&[Vec<f64>]) -> LinearBasis,
    ) -> Result<(), CompareError> {
        let meter = self.begin(name)?;
        let basis = factor(features.train);
        let cost = meter.cost();
        let rest = &self.bench.prepared.rest;
        let fit = FeatureFit::new(&basis, features.weights, &features.train[0], rest, features.model);
        let weights = fit.weights(features.test);
        let missed = features.test.par_iter().zip(&weights).map(|(x, weights)| {
            let nearest = basis.compose(weights);
            let energy: f64 = x.iter().map(|x| x * x).sum();
            let error: f64 = x.iter().zip(&nearest).map(|(x, y)| (x - y).powi(2)).sum();
            if energy > STILL { error / energy } else { 0.0 }
        });
        let missed: Vec<f64> = missed.collect();
        let model = (features.model)(basis.clone());
        let mut found = vec![Found {
            kind: ProjectionKind::Features,
            shapes: weights
                .par_iter()
                .map(|weights| narrowed(&model.pose(weights)))
                .collect(),
            max_percentage_error: Some(missed.into_iter().fold(0.0, f64::max)),
        }];
        if !self.bench.input.settings.quick {
            let shapes = self.bench.test.par_iter().zip(weights);
            let posed = shapes.map(|(shape, start)| {
                let weights = project_positions(&*model, shape, start);
                narrowed(&model.pose(&weights))
            });
            found.push(Found {
                kind: ProjectionKind::Positions,
                shapes: posed.collect(),
                max_percentage_error: None,
            });
        }
        let trained = Trained {
            name,
            source,
            cost,
            note: None,
            package: None,
            train_weights: fit.weights(features.train),
        };
        self.finish(trained, &*model, found)
    }

    fn one_level_autoencoder(&mut self) -> Result<(), CompareError> {
        let CompareInput {
            sequence,
            train_shapes,
            settings,
            ..
        } = self.bench.input;
        let tan = TanSettings {
            component_count: settings.component_count,
            epochs: settings.epochs,
            rate: TAN_RATE,
            seed: settings.config.seed,
        };
        let config = tan.config(&settings.config);
        let prepared = Prepared::new(sequence, train_shapes, &config, &[], self.reporter)?;
        let name = "One-level autoencoder";
        self.begin(name)?;
        self.reporter.stage(name, settings.epochs as u64);
        let meter = Meter::begin();
        let (package, training) = train(
            &prepared,
            &config,
            &tan,
            &sequence.name,
            train_shapes,
            sequence.shape_count(),
            self.reporter,
        )?;
        self.package(
            name,
            "Tan et al. 2018",
            &package,
            meter.cost(),
            Some(training.to_string()),
        )
    }

    fn ours(&mut self) -> Result<(), CompareError> {
        let CompareInput {
            sequence,
            train_shapes,
            settings,
            ours,
        } = self.bench.input;
        let (name, source) = ("Sinew", "two levels, this project");
        if !ours.is_empty() {
            for own in ours {
                self.package(own.name, source, own.bytes, Cost::default(), None)?;
            }
            return Ok(());
        }
        self.begin(name)?;
        let mut config = settings.config.clone();
        config.components = two_levels(settings.component_count);
        let meter = Meter::begin();
        let learned = learn(sequence, train_shapes, &config, &RunOptions::default(), self.reporter)?;
        self.package(name, source, &learned.package, meter.cost(), None)
    }

    fn package(
        &mut self,
        name: &str,
        source: &str,
        package: &[u8],
        cost: Cost,
        note: Option<String>,
    ) -> Result<(), CompareError> {
        let bench = self.bench;
        let view = CompactView::open(package).map_err(EvaluationError::from)?;
        self.reporter.stage(name, bench.test_shapes.len() as u64);
        // As the package was trained, which may be elsewhere and with other features.
        let config =
            TrainConfig::from_toml(view.provenance().config).unwrap_or_else(|_| bench.input.settings.config.clone());
        let input = EvaluationInput {
            package,
            sequence: bench.input.sequence,
            test_shapes: &bench.test_shapes,
            trained_shapes: &[],
            settings: config.features,
            encoder: config.encoder_settings(),
        };
        let (evaluation, shapes) = evaluate(&input, &|done| self.reporter.advance(done as u64, ""))?;
        self.round_trip = Some(evaluation.round_trip);
        let decoder = FeatureDecoder::new(&view, &bench.prepared.topology);
        let scaler = FeatureScaler {
            rotation_scale: view.rotation_scale(),
            stretch_scale: view.stretch_scale(),
        };
        let own = &bench.prepared.scaler;
        let metric = FeatureMetric::new(&bench.prepared.system, scaler.scales(), &bench.areas);
        let projection = FeatureProjection::new(&decoder, metric);
        let mut train_weights = vec![vec![0.0; decoder.component_count()]];
        train_weights.par_extend((0..bench.prepared.network.len()).into_par_iter().map(|m| {
            let shape = &bench.prepared.network[m];
            let features = scaler.to_network(&own.from_network(shape));
            projection.weights(&features, vec![0.0; decoder.component_count()])
        }));
        let model = GradientModel {
            decoder: Box::new(decoder),
            field: &bench.prepared.system,
            scales: scaler.scales(),
        };
        let found = [
            (
                ProjectionKind::Encoder,
                shapes.encoder,
                Some(evaluation.max_percentage_error.two_level),
            ),
            (ProjectionKind::Features, shapes.feature_projection, None),
            (ProjectionKind::Positions, shapes.position_projection, None),
        ];
        let found = found.map(|(kind, shapes, max_percentage_error)| Found {
            kind,
            shapes,
            max_percentage_error,
        });
        let trained = Trained {
            name,
            source,
            cost,
            note,
            package: Some(package),
            train_weights,
        };
        self.finish(trained, &model, found.into())
    }

    /// Scores what was found, moves shapes by control points, and keeps it all.
    fn finish(&mut self, trained: Trained<'_>, model: &dyn Model, found: Vec<Found>) -> Result<(), CompareError> {
        let bench = self.bench;
        let fail = |source| CompareError::Score {
            method: trained.name.to_owned(),
            source,
        };
        let mut projections = Vec::new();
        for found in &found {
            projections.push(Projection {
                kind: found.kind,
                scores: score(&bench.truth, &found.shapes, &bench.input.sequence.faces).map_err(fail)?,
                max_percentage_error: found.max_percentage_error,
            });
        }
        let control_point_e_rms = match trained.package {
            Some(package) => drag_held(bench, &self.handles, &self.control_points, package, trained.name)?,
            None => {
                let (handles, counts) = (&self.handles, &self.control_points);
                move_by_handles(bench, handles, counts, model, &trained.train_weights).map_err(fail)?
            }
        };
        let energies = model.energies();
        let (elements, width) = model.stored();
        let used = elements.iter().filter(|&&count| count > 0).count();
        let all = energies.len() * elements.iter().copied().max().unwrap_or(0);
        // Sparse rows name their elements by four bytes each.
        let bytes = |number: usize| {
            let sparse: usize = elements.iter().map(|count| count * (width * number + 4)).sum();
            sparse.min(all * width * number)
        };
        self.methods.push(Method {
            name: trained.name.to_owned(),
            source: trained.source.to_owned(),
            components: used,
            training_seconds: trained.cost.seconds,
            peak_bytes: trained.cost.peak_bytes,
            note: trained.note.clone(),
            locality: bench.locality(&energies),
            basis_bytes_f32: bytes(4),
            basis_bytes_f16: bytes(2),
            package_bytes: trained.package.map(<[u8]>::len),
            projections,
            control_point_e_rms,
        });
        self.reconstructions
            .push(found.into_iter().map(|found| found.shapes).collect());
        self.reporter.advance(1, "");
        Ok(())
    }
}
