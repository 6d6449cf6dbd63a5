//! Weights of the vertices: those that bring each nearest to where the exact tier has it, not negative and of sum one, by least
//! squares; the weakest candidate goes until few enough are left.

use nalgebra::DMatrix;
use rayon::prelude::*;
use sinew_formats::package::SKIN_WEIGHT_SUM;

use super::cells::Cells;
use super::maps::SkinRow;
use super::poses::Samples;
use super::{Matrix, Source, Vector};

/// Bones that a vertex chooses among: half are the nearest, the others those whose maps fit it best.
const CANDIDATES: usize = 16;
/// Bones that are looked at for these.
const LOOKED_AT: usize = 48;
/// Poses that the weights are fitted to at most, and those that candidates are chosen by.
const FITTED: usize = 160;
const CHOSEN_BY: usize = 24;
/// Pull towards weights by distance, as a share of the mean square error of a candidate.
const DISTANCE_PULL: f64 = 1e-4;
/// Weights by distance: so many bones, falling to zero at the next.
const BY_DISTANCE: usize = 4;

/// The bones in the poses they are fitted to.
pub(super) struct SkinFit<'a> {
    pub(super) source: &'a Source<'a>,
    pub(super) samples: &'a Samples,
    pub(super) cells: &'a Cells,
    /// `T`. Shape: `[M][B]`.
    pub(super) gradients: &'a [Vec<Matrix>],
    /// Displacements. Shape: `[M][B]`.
    pub(super) places: &'a [Vec<Vector>],
}

impl SkinFit<'_> {
    /// Weights of all vertices, of so many influences at most. Shape: `[V]`, source order.
    pub(super) fn run(&self, influences: usize) -> Vec<SkinRow> {
        let count = self.samples.count();
        let strided = |wanted: usize| {
            (0..count)
                .step_by(count.div_ceil(wanted).max(1))
                .collect::<Vec<usize>>()
        };
        let (poses, choosing) = (strided(FITTED), strided(CHOSEN_BY));
        let vertices = 0..self.source.surface.rest.len();
        let row = |v: usize| self.row(v, influences, &poses, &choosing);
        vertices.into_par_iter().map(row).collect()
    }

    /// How far a bone's map carries a vertex from where it belongs.
    fn misfit(&self, v: usize, bone: usize, pose: usize) -> Vector {
        let centre = self.cells.centres[bone];
        let arm = Vector::from(self.source.surface.rest[v]) - centre;
        let moved = centre + self.places[pose][bone] + self.gradients[pose][bone] * arm;
        moved - self.samples.position(pose, v)
    }

    fn row(&self, v: usize, influences: usize, poses: &[usize], choosing: &[usize]) -> SkinRow {
        let rest = Vector::from(self.source.surface.rest[v]);
        let mut near: Vec<(f64, usize)> = self.cells.centres.iter().map(|c| (c - rest).norm()).zip(0..).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(LOOKED_AT);
        let error = |bone: usize| {
            choosing
                .iter()
                .map(|&m| self.misfit(v, bone, m).norm_squared())
                .sum::<f64>()
        };
        let mut fitting: Vec<(f64, usize)> = near
            .iter()
            .enumerate()
            .map(|(n, &(_, bone))| (error(bone), n))
            .collect();
        fitting.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut chosen: Vec<usize> = (0..near.len().min(CANDIDATES / 2)).collect();
        for (_, n) in fitting {
            if chosen.len() < CANDIDATES && !chosen.contains(&n) {
                chosen.push(n);
            }
        }
        let by_distance = by_distance(&near);
        let prior: Vec<f64> = chosen.iter().map(|&n| by_distance[n]).collect();
        let mut gram = DMatrix::<f64>::zeros(chosen.len(), chosen.len());
        for &pose in poses {
            let misfits: Vec<Vector> = chosen.iter().map(|&n| self.misfit(v, near[n].1, pose)).collect();
            for i in 0..misfits.len() {
                (0..=i).for_each(|j| gram[(i, j)] += misfits[i].dot(&misfits[j]));
            }
        }
        gram.fill_upper_triangle_with_lower_triangle();
        let fitted = fitted(&gram, &prior, influences);
        fitted
            .into_iter()
            .map(|(n, weight)| (near[chosen[n]].1, weight))
            .collect()
    }
}

/// Weights of a few nearest, falling to zero at the next; nearest first. Shape: that of `near`.
fn by_distance(near: &[(f64, usize)]) -> Vec<f64> {
    let own = near.len().min(BY_DISTANCE);
    // Where there is no next one: a little beyond the last.
    let beyond = near.get(BY_DISTANCE).map_or(1.25 * near[own - 1].0, |next| next.0);
    let falling = |distance: f64| {
        if beyond > 0.0 {
            (1.0 - distance / beyond).max(0.0).powi(2)
        } else {
            1.0
        }
    };
    let mut weights: Vec<f64> = near.iter().take(own).map(|&(distance, _)| falling(distance)).collect();
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        weights.iter_mut().for_each(|weight| *weight /= sum);
    } else {
        weights.fill(1.0 / own as f64);
    }
    weights.resize(near.len(), 0.0);
    weights
}

/// Minimises `w^T G w + pull |w - prior|^2` over weights that are not negative and sum to one, leaving the weakest candidate
/// out until no more than `count` are left. Gives candidates and their weights.
fn fitted(gram: &DMatrix<f64>, prior: &[f64], count: usize) -> Vec<(usize, f64)> {
    let mean_square = gram.trace() / prior.len() as f64;
    let mut left: Vec<usize> = (0..prior.len()).collect();
    if mean_square <= f64::MIN_POSITIVE {
        // Nothing moves it, or all bones carry it right.
        left.retain(|&i| prior[i] > 0.0);
        return left.into_iter().map(|i| (i, prior[i])).collect();
    }
    let pull = DISTANCE_PULL * mean_square;
    loop {
        let weights = minimum(gram, &left, prior, pull);
        let weakest = (0..left.len()).min_by(|&a, &b| weights[a].total_cmp(&weights[b]));
        match weakest {
            Some(place) if left.len() > 1 && (weights[place] <= 0.0 || left.len() > count) => {
                left.remove(place);
            }
            _ => return left.into_iter().zip(weights).collect(),
        }
    }
}

/// The minimum over weights of sum one, of either sign: `(G + pull) w = pull prior + mu`.
fn minimum(gram: &DMatrix<f64>, left: &[usize], prior: &[f64], pull: f64) -> Vec<f64> {
    let n = left.len();
    let matrix = DMatrix::from_fn(n, n, |i, j| gram[(left[i], left[j])] + if i == j { pull } else { 0.0 });
    let sides = DMatrix::from_fn(n, 2, |i, side| if side == 0 { pull * prior[left[i]] } else { 1.0 });
    // Definite: a sum of squares and a positive diagonal.
    let Some(factor) = matrix.cholesky() else {
        return vec![1.0 / n as f64; n];
    };
    let solved = factor.solve(&sides);
    let mu = (1.0 - solved.column(0).sum()) / solved.column(1).sum();
    (0..n).map(|i| solved[(i, 0)] + mu * solved[(i, 1)]).collect()
}

/// Rows as a package holds them: greatest weight first, units that sum to one, bone 0 where there is no weight.
pub(super) fn whole_rows<'a>(rows: impl Iterator<Item = &'a SkinRow>, influences: usize) -> (Vec<u8>, Vec<u16>) {
    let (mut bones, mut weights) = (Vec::new(), Vec::new());
    for row in rows {
        for (bone, units) in whole_row(row, influences) {
            bones.push(bone);
            weights.push(units);
        }
    }
    (bones, weights)
}

/// Rounds down, then gives what is missing to the largest remainders.
fn whole_row(row: &SkinRow, influences: usize) -> Vec<(u8, u16)> {
    let total: f64 = row.iter().map(|&(_, weight)| weight).sum();
    let exact: Vec<f64> = row
        .iter()
        .map(|&(_, weight)| weight / total * f64::from(SKIN_WEIGHT_SUM))
        .collect();
    let mut units: Vec<u32> = exact.iter().map(|units| units.floor() as u32).collect();
    let mut order: Vec<usize> = (0..row.len()).collect();
    order.sort_by(|&a, &b| (exact[b] - exact[b].floor()).total_cmp(&(exact[a] - exact[a].floor())));
    let missing = SKIN_WEIGHT_SUM.saturating_sub(units.iter().sum());
    order.iter().cycle().take(missing as usize).for_each(|&n| units[n] += 1);
    // Of shares that sum to one but for a last digit, the floors can be one too many.
    let too_many = units.iter().sum::<u32>() - SKIN_WEIGHT_SUM;
    if let Some(greatest) = (0..units.len()).max_by_key(|&n| units[n]) {
        units[greatest] -= too_many;
    }
    let mut whole: Vec<(u8, u16)> = row
        .iter()
        .zip(units)
        .map(|(&(bone, _), units)| (bone as u8, units as u16))
        .collect();
    whole.retain(|&(_, units)| units > 0);
    whole.sort_by_key(|&(bone, units)| (core::cmp::Reverse(units), bone));
    whole.resize(influences, (0, 0));
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_rows_sum_to_one_and_fall() {
        assert_eq!(whole_row(&vec![(7, 1.0)], 4), [(7, 65_535), (0, 0), (0, 0), (0, 0)]);
        let quarters = vec![(3, 0.25), (1, 0.25), (2, 0.25), (9, 0.25)];
        assert_eq!(
            whole_row(&quarters, 4),
            [(1, 16_384), (2, 16_384), (3, 16_384), (9, 16_383)]
        );
        for row in [
            vec![(0, 0.1), (5, 0.2), (250, 0.7)],
            vec![(4, 1.0 / 3.0); 3],
            vec![(1, 1.0), (2, 1e-9)],
        ] {
            let whole = whole_row(&row, 8);
            assert_eq!(whole.len(), 8);
            assert_eq!(whole.iter().map(|w| u32::from(w.1)).sum::<u32>(), SKIN_WEIGHT_SUM);
            assert!(whole.windows(2).all(|pair| pair[1].1 <= pair[0].1));
            assert!(whole.iter().all(|&(bone, units)| units > 0 || bone == 0));
        }
    }

    #[test]
    fn the_fit_finds_the_mixture_that_poses_were_made_of() {
        // Six candidates with errors whose mixture 0.5, 0.3, 0.2 of the second, fourth and fifth cancels.
        let mixture = [0.0, 0.5, 0.0, 0.3, 0.2, 0.0];
        let mut gram = DMatrix::zeros(6, 6);
        let mut state = 1_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / (1 << 23) as f64 - 1.0
        };
        for _ in 0..150 {
            let mut errors: [f64; 6] = core::array::from_fn(|_| noise());
            errors[4] = -(0..4).map(|i| mixture[i] * errors[i]).sum::<f64>() / mixture[4];
            for i in 0..6 {
                (0..6).for_each(|j| gram[(i, j)] += errors[i] * errors[j]);
            }
        }
        let near: Vec<(f64, usize)> = [1.0, 1.1, 1.2, 1.3, 1.4, 1.5].into_iter().zip(0..).collect();
        for count in [4, 8] {
            let found = fitted(&gram, &by_distance(&near), count);
            let dense: [f64; 6] = core::array::from_fn(|i| found.iter().find(|f| f.0 == i).map_or(0.0, |f| f.1));
            for (weight, expected) in dense.iter().zip(mixture) {
                assert!((weight - expected).abs() < 0.02, "{dense:?}");
            }
            assert!((dense.iter().sum::<f64>() - 1.0).abs() < 1e-9 && found.len() <= count);
        }
    }

    #[test]
    fn without_evidence_the_distance_decides() {
        let near: Vec<(f64, usize)> = [1.0, 1.0, 2.0, 3.0, 4.0, 5.0].into_iter().zip(0..).collect();
        let found = fitted(&DMatrix::zeros(6, 6), &by_distance(&near), 4);
        assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), [0, 1, 2, 3]);
        assert!(found[0].1 == found[1].1 && found[1].1 > found[2].1);
        assert_eq!(by_distance(&[(0.0, 3)]), [1.0]);
        assert_eq!(by_distance(&[(0.0, 3), (0.0, 4)]), [0.5, 0.5]);
    }
}
