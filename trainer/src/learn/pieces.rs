//! Loose pieces: eyes, teeth, buttons hang on bridges, and the solve leaves them where a bridge points. The last thing learned:
//! the basis is played at the weights of the training shapes, and what every piece lacks is [fitted](fit_offsets) to those weights.

use rayon::prelude::*;
use sinew_formats::package::{NO_PIECE, limits};
use sinew_runtime::Basis;

use super::draft::{PackageError, with_players};
use super::prepare::{Prepared, spread};
use super::trial::Trial;
use crate::components::extract::{LearnedBasis, Pieces};
use crate::components::offsets::fit_offsets;
use crate::features::align::{RigidMotion, widened};

/// Training shapes that the offsets are fitted to, at most.
const SHAPES_MAX: usize = 128;
/// Pieces that are placed, at most: the largest.
const PIECES_MAX: usize = 1024;
const _: () = assert!(PIECES_MAX <= limits::PIECES);

/// What a component is taken to move a piece at least, as a share of the mean over all components: a piece may follow what
/// the solve does not pass on to it.
const LEAST_REACH: f64 = 0.01;

/// Where loose pieces stand, linear in the weights of `basis`, of which `trial` is the draft; nothing where the mesh is one piece, or no piece gains on shapes
/// held out. The piece with most vertices is what the others are placed against.
pub fn place_pieces(
    prepared: &Prepared,
    trial: &Trial<'_>,
    basis: &LearnedBasis,
) -> Result<Option<Pieces>, PackageError> {
    let members = loose_pieces(prepared);
    let Some((main, loose)) = members.split_first() else {
        return Ok(None);
    };
    if loose.is_empty() {
        return Ok(None);
    }
    let played = Basis::open(trial.baked()?)?;
    let all: Vec<usize> = (0..prepared.network.len()).collect();
    let shapes: Vec<usize> = spread(&all, SHAPES_MAX).collect();
    let codes = trial.encoded(&shapes.iter().map(|&m| &prepared.network[m]).collect::<Vec<_>>())?;
    let numbers: Vec<usize> = (0..shapes.len()).collect();
    // Shape: `[N][P]`.
    let missing = with_players(&played, &numbers, |player, &n| {
        let posed = player.play(&codes[n])?;
        Ok(what_is_missing(main, loose, posed, &prepared.aligned[shapes[n]]))
    })?;
    let stops: Vec<f64> = basis.components().map(|c| f64::from(c.reach())).collect();
    // Shape: `[K][P]`.
    let reach = with_players(&played, &(0..stops.len()).collect::<Vec<_>>(), |player, &k| {
        let mut weights = vec![0.0; stops.len()];
        weights[k] = stops[k];
        let posed = player.play(&weights)?;
        let still = |v: &u32| squared_distance(posed[*v as usize], prepared.rest_positions[*v as usize]);
        let mean = |piece: &Vec<u32>| piece.iter().map(still).sum::<f64>() / piece.len() as f64;
        Ok(loose
            .iter()
            .map(|piece| mean(piece) / stops[k].powi(2).max(f64::MIN_POSITIVE))
            .collect::<Vec<_>>())
    })?;
    let offsets: Vec<Option<Vec<[f64; 3]>>> = (0..loose.len())
        .into_par_iter()
        .map(|p| {
            let missing: Vec<[f64; 3]> = missing.iter().map(|shape| shape[p]).collect();
            let reach: Vec<f64> = reach.iter().map(|component| component[p]).collect();
            let least = LEAST_REACH * reach.iter().sum::<f64>() / reach.len().max(1) as f64;
            fit_offsets(
                &codes,
                &missing,
                &reach.iter().map(|x| x.max(least)).collect::<Vec<_>>(),
            )
        })
        .collect();
    let placed: Vec<(&Vec<u32>, &Vec<[f64; 3]>)> = loose
        .iter()
        .zip(&offsets)
        .filter_map(|(piece, offsets)| Some((piece, offsets.as_ref()?)))
        .collect();
    if placed.is_empty() {
        return Ok(None);
    }
    let mut piece_of = vec![NO_PIECE; prepared.rest.len()];
    for (p, (piece, _)) in placed.iter().enumerate() {
        piece.iter().for_each(|&v| piece_of[v as usize] = p as u16);
    }
    let rows = (0..stops.len()).flat_map(|k| placed.iter().map(move |(_, offsets)| offsets[k].map(|x| x as f32)));
    Ok(Some(Pieces {
        piece_of,
        offsets: rows.collect(),
    }))
}

/// Vertices of every piece, the one with most vertices first, and no more than can be placed; of equals the first vertex decides.
fn loose_pieces(prepared: &Prepared) -> Vec<Vec<u32>> {
    let pieces = &prepared.topology.piece_of;
    let count = pieces.iter().flatten().max().map_or(0, |&last| last as usize + 1);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (v, piece) in pieces.iter().enumerate() {
        if let Some(piece) = piece {
            members[*piece as usize].push(v as u32);
        }
    }
    members.sort_by_key(|piece| core::cmp::Reverse(piece.len()));
    members.truncate(1 + PIECES_MAX);
    members
}

/// How far each loose piece is from its place in `wanted`, once that is laid onto what was played by the main piece. Shape: `[P]`.
fn what_is_missing(main: &[u32], loose: &[Vec<u32>], played: &[[f32; 3]], wanted: &[[f32; 3]]) -> Vec<[f64; 3]> {
    let of = |piece: &[u32], shape: &[[f32; 3]]| {
        let points: Vec<[f32; 3]> = piece.iter().map(|&v| shape[v as usize]).collect();
        widened(&points)
    };
    let motion = RigidMotion::onto(&of(main, played), &of(main, wanted));
    let missing = |piece: &Vec<u32>| {
        let mut sum = [0.0; 3];
        for (from, to) in of(piece, played).into_iter().zip(of(piece, wanted)) {
            let to = motion.apply(to);
            (0..3).for_each(|c| sum[c] += (to[c] - from[c]) / piece.len() as f64);
        }
        sum
    };
    loose.iter().map(missing).collect()
}

fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum()
}
