//! The illustrated report of one training run: what was learned from, what was learned, how well it does. Stands at the
//! end of the path of data; every figure in it was measured through the runtime.

use sinew_formats::package::{CompactView, NONE};
use sinew_interchange::MeshSequence;
use sinew_runtime::Basis;

use super::html::{Comparison, ComponentPicture, CurvePoint, ErrorRow, Picture, Report};
use super::pictures::{Studio, distances, quantile};
use super::principal::{reconstruct_features, reconstruct_positions};
use super::raster::Style;
use sinew_trainer::components::anatomy::Anatomy;
use sinew_trainer::components::labels::Axes;
use sinew_trainer::evaluate::{Evaluation, NormalisedPair, Reconstructions, ScoreError, Scores, score};
use sinew_trainer::features::acap::AcapFeatures;
use sinew_trainer::features::align::align_shapes;
use sinew_trainer::learn::draft::{PackageError, with_players};
use sinew_trainer::learn::prepare::Prepared;
use sinew_trainer::learn::{Learned, Reporter};

/// Shapes shown as samples, and compared with their reconstruction.
const SAMPLE_COUNT: usize = 6;
/// See [`SAMPLE_COUNT`].
const COMPARISON_COUNT: usize = 3;

/// All that a report tells of.
pub struct Subject<'a> {
    /// The shapes.
    pub sequence: &'a MeshSequence,
    /// What training read.
    pub prepared: &'a Prepared,
    /// What training gave.
    pub learned: &'a Learned,
    /// The baked package.
    pub baked: &'a [u8],
    /// Shapes not trained on, ascending.
    pub test_shapes: &'a [usize],
    /// Figures on them.
    pub evaluation: &'a Evaluation,
    /// The shapes behind the figures.
    pub shapes: &'a Reconstructions,
    /// Facts that only the caller knows, such as times: name and value.
    pub facts: Vec<(String, String)>,
}

/// Draws and writes everything.
pub fn illustrate(
    subject: Subject<'_>,
    title: &str,
    intro: &str,
    reporter: &dyn Reporter,
) -> Result<Report, PackageError> {
    let Subject {
        sequence,
        prepared,
        learned,
        baked,
        test_shapes,
        evaluation,
        shapes,
        facts,
    } = subject;
    let view = CompactView::open(&learned.package)?;
    let basis = Basis::open(baked)?;
    let aligned: Vec<Vec<[f32; 3]>> = align_shapes(&prepared.rest, &sequence.shapes.iter().collect::<Vec<_>>())
        .into_iter()
        .map(|shape| shape.positions.iter().map(|p| p.map(|x| x as f32)).collect())
        .collect();
    let all: Vec<&[[f32; 3]]> = aligned.iter().map(Vec::as_slice).collect();
    let studio = Studio::new(&prepared.rest_positions, &sequence.faces, &all, Style::new(420, 320));

    reporter.stage("drawing", (view.component_count() + COMPARISON_COUNT) as u64);
    let sample_shapes = spread(aligned.len(), SAMPLE_COUNT)
        .into_iter()
        .map(|m| Picture {
            image: studio.shape(&aligned[m]),
            caption: sample_caption(m, &view),
        })
        .collect();
    let (tree, most) = component_pictures(&view, &basis, &studio, prepared, reporter)?;
    let (comparisons, error_most) = comparisons(sequence, &studio, test_shapes, shapes, &aligned)?;
    reporter.advance((view.component_count() + COMPARISON_COUNT) as u64, "");
    let diagonal = sinew_trainer::learn::draft::bounding_diagonal(&prepared.rest_positions);
    let percent = |length: f32| format!("{:.1} % of the bounding box", 100.0 * length / diagonal);

    let mut all_facts = vec![
        (
            "Shapes".to_owned(),
            format!(
                "{}, {} of them for training",
                sequence.shape_count(),
                view.provenance().train_shapes.len()
            ),
        ),
        (
            "Mesh".to_owned(),
            format!("{} vertices, {} faces", sequence.vertex_count(), sequence.faces.len()),
        ),
        (
            "Components".to_owned(),
            format!(
                "{} coarse, {} fine; {} redundant ones removed",
                evaluation.components.coarse, evaluation.components.fine, learned.removed_count
            ),
        ),
        (
            "Compact package".to_owned(),
            format!("{:.2} MB", learned.package.len() as f64 / 1e6),
        ),
        (
            "Baked package".to_owned(),
            format!("{:.2} MB", baked.len() as f64 / 1e6),
        ),
        (
            "Training".to_owned(),
            format!("{} steps; {}", learned.steps_run, learned.stop_reason),
        ),
    ];
    all_facts.extend(facts);
    Ok(Report {
        title: title.to_owned(),
        intro: intro.to_owned(),
        facts: all_facts,
        sample_shapes,
        tree,
        component_scale: percent(most),
        comparisons,
        error_scale: percent(error_most),
        error_table: error_table(prepared, learned, evaluation, shapes, sequence, test_shapes)?,
        curve: learned
            .history
            .iter()
            .map(|point| CurvePoint {
                step: point.step as u64,
                loss: f64::from(point.loss.sum()),
                validation: point.validation.map(f64::from),
            })
            .collect(),
        provenance: learned.config.to_toml(),
        notes: Vec::new(),
    })
}

/// `count` numbers spread over `0 .. total`, the first and the last included.
fn spread(total: usize, count: usize) -> Vec<usize> {
    let count = count.min(total);
    (0..count)
        .map(|i| if count > 1 { i * (total - 1) / (count - 1) } else { 0 })
        .collect()
}

fn sample_caption(m: usize, view: &CompactView<'_>) -> String {
    match m {
        0 => "shape 0: the reference, from which all deformation is measured".to_owned(),
        _ if view.provenance().train_shapes.contains(&(m as u32)) => format!("shape {m}: trained on"),
        _ => format!("shape {m}: never seen in training"),
    }
}

/// Each component alone at both of its stops. Returns the warm end of their common scale too.
fn component_pictures(
    view: &CompactView<'_>,
    basis: &Basis<'_>,
    studio: &Studio<'_>,
    prepared: &Prepared,
    reporter: &dyn Reporter,
) -> Result<(Vec<ComponentPicture>, f32), PackageError> {
    let tiles = studio.with_style(Style::new(260, 200));
    let component_count = view.component_count();
    let poses: Vec<(usize, f32)> = view
        .components()
        .enumerate()
        .flat_map(|(k, c)| [(k, c.maximum), (k, c.minimum)])
        .collect();
    let played = with_players(basis, &poses, |player, &(k, weight)| {
        let mut weights = vec![0.0; component_count];
        weights[k] = f64::from(weight);
        Ok(player.play(&weights)?.to_vec())
    })?;
    let rest = &prepared.rest_positions;
    let reach: Vec<f32> = played
        .iter()
        .map(|shape| quantile(&distances(rest, shape), 0.99))
        .collect();
    // One scale for all, so that strong and weak can be told apart; the strongest few may run over it.
    let most = quantile(&reach, 0.9);
    let blocks: Vec<_> = view.blocks().collect();
    let anatomy = Anatomy::of(view, Axes::default());
    let mut pictures = Vec::with_capacity(component_count);
    for (k, component) in view.components().enumerate() {
        let block = &blocks[component.block as usize];
        // A stop at 0 shows nothing: the other one is the picture.
        let (main, other) = if component.maximum >= -component.minimum {
            (2 * k, 2 * k + 1)
        } else {
            (2 * k + 1, 2 * k)
        };
        pictures.push(ComponentPicture {
            name: component.name.to_owned(),
            level: block.level as usize,
            parent: (block.parent_component != NONE).then_some(block.parent_component as usize),
            positive: tiles.component(rest, &played[main], most),
            negative: (poses[other].1 != 0.0).then(|| tiles.component(rest, &played[other], most)),
            strength: f64::from(component.strength),
            locality: f64::from(component.locality),
            range: [f64::from(component.minimum), f64::from(component.maximum)],
            label: anatomy.labels[k].clone(),
            mirror: anatomy.images[k]
                .filter(|image| image.component != k)
                .map(|image| view.component(image.component).name.to_owned()),
        });
        reporter.advance(k as u64 + 1, component.name);
    }
    Ok((pictures, most))
}

/// Truth beside the position projection for shapes from best to worst.
fn comparisons(
    sequence: &MeshSequence,
    studio: &Studio<'_>,
    test_shapes: &[usize],
    shapes: &Reconstructions,
    aligned: &[Vec<[f32; 3]>],
) -> Result<(Vec<Comparison>, f32), ScoreError> {
    let errors = NormalisedPair::new(&shapes.truth, &shapes.position_projection)?.e_rms_of_shapes();
    let mut order: Vec<usize> = (0..errors.len()).collect();
    order.sort_by(|&a, &b| errors[a].total_cmp(&errors[b]));
    let chosen: Vec<usize> = spread(order.len(), COMPARISON_COUNT)
        .into_iter()
        .map(|i| order[i])
        .collect();
    let most = chosen
        .iter()
        .map(|&i| {
            quantile(
                &distances(&aligned[test_shapes[i]], &shapes.position_projection[i]),
                0.99,
            )
        })
        .fold(0.0, f32::max);
    let compared = chosen
        .iter()
        .map(|&i| {
            let m = test_shapes[i];
            let drawn = studio.comparison(&aligned[m], &shapes.position_projection[i], most);
            Comparison {
                shape_name: sequence.shape_names[m].clone(),
                truth: drawn.truth,
                reconstruction: drawn.reconstruction,
                error: drawn.error,
                e_rms: errors[i],
            }
        })
        .collect();
    Ok((compared, most))
}

/// Ours three ways, principal components with as many components, and features alone.
fn error_table(
    prepared: &Prepared,
    learned: &Learned,
    evaluation: &Evaluation,
    shapes: &Reconstructions,
    sequence: &MeshSequence,
    test_shapes: &[usize],
) -> Result<Vec<ErrorRow>, ScoreError> {
    let wide = |shapes: &[Vec<[f32; 3]>]| -> Vec<Vec<[f64; 3]>> {
        align_shapes(&prepared.rest, shapes)
            .into_iter()
            .map(|shape| shape.positions)
            .collect()
    };
    let test: Vec<Vec<[f32; 3]>> = test_shapes.iter().map(|&m| sequence.shapes[m].to_vec()).collect();
    let test = wide(&test);
    // The reference is a training shape for everybody.
    let mut train = vec![prepared.rest.clone()];
    let trained: Vec<Vec<[f32; 3]>> = prepared.aligned.iter().map(<[_]>::to_vec).collect();
    train.extend(wide(&trained));
    let count = learned.component_count;
    let by_positions = reconstruct_positions(&train, &test, count);
    let features_of = |shapes: &[Vec<[f64; 3]>]| {
        AcapFeatures::compute(
            &prepared.topology,
            &prepared.rest,
            shapes,
            &learned.config.features,
            &|_| {},
        )
        .shapes
    };
    let by_features = reconstruct_features(&prepared.system, &features_of(&train), &features_of(&test), count);
    let used = count.min(train.len() - 1);
    let ours = format!("{} + {}", evaluation.components.coarse, evaluation.components.fine);
    let row = |method: &str, components: &str, scores: &Scores, note: &str, is_main: bool| ErrorRow {
        method: method.to_owned(),
        components: components.to_owned(),
        e_rms: Some(scores.e_rms),
        sted: Some(scores.sted),
        sted_spatial: Some(scores.sted_s),
        sted_temporal: Some(scores.sted_t),
        note: note.to_owned(),
        is_main,
    };
    let few = format!("{used} of {count}: the training shapes span no more");
    let note = if used < count { few.as_str() } else { "least squares" };
    Ok(vec![
        row(
            "Sinew, position projection",
            &ours,
            &evaluation.position_projection,
            "weights fitted to positions through the runtime",
            true,
        ),
        row(
            "Sinew, feature projection",
            &ours,
            &evaluation.feature_projection,
            "weights fitted to features",
            false,
        ),
        row(
            "Sinew, encoder",
            &ours,
            &evaluation.encoder,
            "weights in one pass, without a search",
            false,
        ),
        row(
            "PCA on positions",
            &used.to_string(),
            &score(&shapes.truth, &by_positions, &sequence.faces)?,
            note,
            false,
        ),
        row(
            "PCA on features",
            &used.to_string(),
            &score(&shapes.truth, &by_features, &sequence.faces)?,
            note,
            false,
        ),
        row(
            "No components: features alone",
            "–",
            &evaluation.round_trip,
            "positions to features and back",
            false,
        ),
    ])
}
