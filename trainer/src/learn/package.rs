//! From trained weights to the compact package: extraction, ranges from the training shapes, redundancy and strength
//! measured through the runtime, then the bytes.

use sinew_formats::package::{AlignedBytes, CompactView, Provenance, Quality, write_compact};
use sinew_runtime::Basis;

use super::draft::{PackageError, bounding_diagonal, with_players};
use super::pieces::place_pieces;
use super::prepare::{Prepared, spread};
use super::prior::weight_prior;
use super::trial::Trial;
use crate::components::extract::LearnedBasis;
use crate::components::painted::{painted_names, with_those_below};
use crate::components::rename::{new_names, places, renamed};
use crate::config::TrainConfig;
use crate::network::weights::StackWeights;

/// The basis of `weights` as it would be packaged, before redundant components are removed: ranges known, faint parts cut.
/// Ranges are those of the given `shapes` of `prepared` and of their mixes.
pub fn draft(
    prepared: &Prepared,
    config: &TrainConfig,
    weights: &StackWeights,
    shapes: &[usize],
) -> Result<LearnedBasis, PackageError> {
    let reach = &config.fit.loss.sparsity_distances;
    let distances = |v| prepared.distances(v);
    let mut basis = LearnedBasis::from_weights(weights, prepared.basis_frame(), reach, &distances);
    measure_ranges(&mut basis, prepared, config, shapes)?;
    basis.cut_faint_parts(&config.prune, &distances);
    Ok(basis)
}

/// Extracts, measures, prunes and writes. Returns the package, its K, and how many components were redundant.
pub fn package(
    prepared: &Prepared,
    config: &TrainConfig,
    sequence_name: &str,
    train_shapes: &[usize],
    shape_count: usize,
    weights: &StackWeights,
    quality: Quality,
) -> Result<(AlignedBytes, usize, usize), PackageError> {
    let all: Vec<usize> = (0..prepared.network.len()).collect();
    let mut basis = draft(prepared, config, weights, &all)?;
    let changes = measure_strengths(&mut basis, prepared, config)?;
    let removed_count = basis.prune(&changes, &config.prune, config.fit.attention);
    basis.order_by_strength();
    // Without the redundant ones the weights of the rest have moved a little.
    measure_ranges(&mut basis, prepared, config, &all)?;
    let trial = Trial::new(prepared, config, &basis)?;
    let (pieces, prior) = (
        place_pieces(prepared, &trial, &basis)?,
        weight_prior(prepared, &trial, &basis)?,
    );
    (basis.pieces, basis.prior) = (pieces, prior);
    let component_count = basis.components().count();
    let numbers: Vec<u32> = train_shapes.iter().map(|&m| m as u32).collect();
    let config_text = config.to_toml();
    let provenance = Provenance {
        tool: concat!("sinew ", env!("CARGO_PKG_VERSION")),
        sequence: sequence_name,
        config: &config_text,
        seed: config.seed,
        shape_count: shape_count as u32,
        train_shapes: &numbers,
    };
    let bytes = basis.with_records(provenance, quality, write_compact)?;
    let view = CompactView::open(&bytes)?;
    let kept: Vec<(usize, &String)> = basis
        .components()
        .enumerate()
        .filter_map(|(root, component)| Some((root, component.kept.as_ref()?)))
        .collect();
    let taken: Vec<usize> = kept.iter().map(|(root, _)| *root).collect();
    let mut names = painted_names(&view, &config.start.painted, &taken);
    let places = places(&view);
    for (root, name) in kept {
        names.extend(with_those_below(&places, root, name));
    }
    let bytes = if names.is_empty() {
        bytes
    } else {
        renamed(&view, &new_names(&view, &names)?)?
    };
    Ok((bytes, component_count, removed_count))
}

/// Number of the first such mix, far from those that batches and the start see.
const NUMBER_OF_RANGE_MIXES: u64 = 1 << 41;
/// Mixes whose weights count for the stops of the controls.
const RANGE_MIXES: usize = 32;

/// The stops of every control: the least and greatest weight, by the package's encoder, of the training shapes (of 256, where there
/// are more) and of mixes of them, 0 included. A handful of poses alone would leave most controls one-sided.
fn measure_ranges(
    basis: &mut LearnedBasis,
    prepared: &Prepared,
    config: &TrainConfig,
    shapes: &[usize],
) -> Result<(), PackageError> {
    let mixes = range_mixes(prepared, config, shapes);
    let codes = Trial::new(prepared, config, basis)?.encoded(&range_shapes(prepared, shapes, &mixes))?;
    for (k, component) in basis.components_mut().enumerate() {
        component.minimum = codes.iter().map(|code| code[k] as f32).fold(0.0, f32::min);
        component.maximum = codes.iter().map(|code| code[k] as f32).fold(0.0, f32::max);
    }
    Ok(())
}

/// Mixes whose weights count for the stops of the controls. Shape: flat `[n][V][9]`.
fn range_mixes(prepared: &Prepared, config: &TrainConfig, shapes: &[usize]) -> Vec<f32> {
    match config.mixes.per_step {
        0 => Vec::new(),
        _ => prepared
            .mixer(shapes, &config.mixes, config.seed)
            .mixes(NUMBER_OF_RANGE_MIXES, RANGE_MIXES),
    }
}

/// Most training shapes whose weights count for the stops.
const RANGE_SHAPES_MAX: usize = 256;

/// The given training shapes, or some of them where they are many; then the mixes of them.
fn range_shapes<'a>(prepared: &'a Prepared, shapes: &[usize], mixes: &'a [f32]) -> Vec<&'a [[f32; 9]]> {
    let mixes = mixes.as_chunks::<9>().0.chunks(prepared.rest.len());
    let posed = spread(shapes, RANGE_SHAPES_MAX).map(|m| &prepared.network[m]);
    posed.chain(mixes).collect()
}

/// Plays every component alone at its farther stop. Sets its strength (mean displacement of what it moves, as a share of
/// the bounding box) and returns the mean change of features that decides on redundancy (paper: I).
fn measure_strengths(
    basis: &mut LearnedBasis,
    prepared: &Prepared,
    config: &TrainConfig,
) -> Result<Vec<f32>, PackageError> {
    let trial = Trial::new(prepared, config, basis)?;
    let opened = Basis::open(trial.baked()?)?;
    let stops: Vec<f64> = basis
        .components()
        .map(|c| f64::from(if c.maximum >= -c.minimum { c.maximum } else { c.minimum }))
        .collect();
    let diagonal = bounding_diagonal(&basis.rest_positions);
    let numbers: Vec<usize> = (0..stops.len()).collect();
    let rest = &basis.rest_positions;
    let moved = config.prune.moved;
    let measured = with_players(&opened, &numbers, |player, &k| {
        let mut weights = vec![0.0; stops.len()];
        weights[k] = stops[k];
        let positions = player.play(&weights)?.to_vec();
        let change = mean_above(player.features()?.iter().map(|x| norm(x)), moved);
        let displaced = positions
            .iter()
            .zip(rest)
            .map(|(p, r)| norm(&[p[0] - r[0], p[1] - r[1], p[2] - r[2]]) / diagonal);
        Ok((change, mean_above(displaced, moved)))
    })?;
    for (component, (_, strength)) in basis.components_mut().zip(&measured) {
        component.strength = *strength;
    }
    Ok(measured.into_iter().map(|(change, _)| change).collect())
}

/// Mean of the values above `least`; 0 where there is none.
fn mean_above(values: impl Iterator<Item = f32>, least: f32) -> f32 {
    let (sum, count) = values
        .filter(|&x| x > least)
        .fold((0.0_f64, 0_usize), |(s, n), x| (s + f64::from(x), n + 1));
    if count > 0 { (sum / count as f64) as f32 } else { 0.0 }
}

fn norm(x: &[f32]) -> f32 {
    x.iter().map(|x| x * x).sum::<f32>().sqrt()
}
