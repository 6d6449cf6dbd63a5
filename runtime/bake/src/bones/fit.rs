//! The fit, turn about: the weights of the vertices for the maps as they are, the maps that would be best under these weights,
//! and the tables that make such maps, as nearly as they can, of the nodes in any pose.

use rayon::prelude::*;

use super::axes::axes;
use super::cells::Cells;
use super::maps::{SkinRow, Skinned};
use super::nodes::Nodes;
use super::poses::Samples;
use super::skin::SkinFit;
use super::tables::{PlaceFit, Places, Turn, fit_turns};
use super::{Matrix, Source, Vector};

/// Rounds; each of the last ones still gains a few per cent.
const ROUNDS: usize = 6;
/// Poses that turns are fitted to at most.
const TURNED: usize = 400;

/// What the fit reads.
pub(super) struct Fit<'a> {
    pub(super) source: &'a Source<'a>,
    pub(super) samples: &'a Samples,
    pub(super) cells: &'a Cells,
    pub(super) nodes: &'a Nodes,
    /// `T` of the nodes, as the runtime decodes them. Shape: `[M][N]`.
    pub(super) gradients: &'a [Vec<Matrix>],
    pub(super) influences: usize,
}

/// What it finds.
pub(super) struct Fitted {
    /// Shape: `[B]`.
    pub(super) turns: Vec<Turn>,
    /// Shape: `[B][N]`.
    pub(super) pulls: Vec<Vec<Vector>>,
    /// Shape: `[B][K]`.
    pub(super) slides: Vec<Vec<Vector>>,
    /// Shape: `[V]`, source order.
    pub(super) skin: Vec<SkinRow>,
    /// Shape: `[B]`.
    pub(super) axes: Vec<[f32; 4]>,
}

impl Fit<'_> {
    pub(super) fn run(&self) -> Fitted {
        let weights = &self.samples.weights;
        let place_fit = PlaceFit::new(self.gradients, weights);
        let stride = self.samples.count().div_ceil(TURNED).max(1);
        let turned: Vec<usize> = (0..self.samples.count()).step_by(stride).collect();
        let at_turned: Vec<&Vec<Matrix>> = turned.iter().map(|&pose| &self.gradients[pose]).collect();

        let mut turns = Turn::start(self.cells, self.nodes);
        let mut gradients = self.turned(&turns);
        let mut places = place_fit.fit(&self.middles());
        let mut skin = self.skin(&gradients, &place_fit.play(&places, weights));
        for _ in 0..ROUNDS {
            let skinned = Skinned {
                source: self.source,
                samples: self.samples,
                cells: self.cells,
                skin: &skin,
            };
            let near: Vec<Vec<Matrix>> = turned.iter().map(|&pose| gradients[pose].clone()).collect();
            turns = fit_turns(&turns, &at_turned, &skinned.best_gradients(&turned, &near));
            gradients = self.turned(&turns);
            places = place_fit.fit(&skinned.best_places(&gradients));
            skin = self.skin(&gradients, &place_fit.play(&places, weights));
        }
        let of_bone = |b: usize| axes(&gradients.iter().map(|pose| pose[b]).collect::<Vec<Matrix>>());
        let Places { pulls, slides } = places;
        Fitted {
            axes: (0..turns.len()).into_par_iter().map(of_bone).collect(),
            turns,
            pulls,
            slides,
            skin,
        }
    }

    /// Gradients of the bones. Shape: `[M][B]`.
    fn turned(&self, turns: &[Turn]) -> Vec<Vec<Matrix>> {
        let of_pose = |nodes: &Vec<Matrix>| turns.iter().map(|turn| turn.gradient(nodes)).collect();
        self.gradients.par_iter().map(of_pose).collect()
    }

    /// How far the middles of the bones' cells move: a first guess of the bones' own displacements. Shape: `[M][B]`.
    fn middles(&self) -> Vec<Vec<Vector>> {
        let areas = &self.cells.areas;
        let of_pose = |pose: usize| {
            let pairs = self.cells.members.iter().zip(&self.cells.centres);
            let moved = |(members, centre): (&Vec<usize>, &Vector)| {
                let area: f64 = members.iter().map(|&v| areas[v]).sum();
                let sum: Vector = members.iter().map(|&v| self.samples.position(pose, v) * areas[v]).sum();
                sum / area - centre
            };
            pairs.map(moved).collect()
        };
        (0..self.samples.count()).into_par_iter().map(of_pose).collect()
    }

    fn skin(&self, gradients: &[Vec<Matrix>], places: &[Vec<Vector>]) -> Vec<SkinRow> {
        let fit = SkinFit {
            source: self.source,
            samples: self.samples,
            cells: self.cells,
            gradients,
            places,
        };
        fit.run(self.influences)
    }
}
