//! The bone tier: a few affine maps, made of a few more decoded nodes, fitted to poses of the exact tier.
//!
//! Path of data: exact tier, played through the runtime on `poses` -> `cells` (which vertices a node stands for, and which
//! a bone) -> `nodes` (components averaged over the cells) -> `fit`, turn about: weights of the `skin`, the maps that
//! would be best under it (`maps`), the tables that make such maps of the nodes (`tables`) -> `axes` for engines
//! that scale joints along axes -> whole numbers, and the record.
//!
//! **What was measured on the way** (trained packages, slider poses, 128 bones of four influences, rms in % of the
//! diagonal). Nodes that are the bones, gradients decoded at their cells' averages: horse .094, a skinned figure .38; what
//! lacks are the places, whose error is that of the cells' gradients times the limbs behind them. Twice the nodes, cells by
//! shape *and* gradients: .060 and .15; the gradients of the bones mixtures of eight nodes by matrices instead of numbers:
//! .041 and .13. A start from the exact factor (the pull of each vertex) is no better than none once tables are fitted.
//! Poses like the training shapes' among those that are fitted halve the error on unseen shapes.
//!
//! Sources: skinning decomposition alternates weights and transforms (Le and Deng 2012); the weights of affine maps by
//! least squares under their sum (James and Twigg 2005); here the transforms have to be linear in what the network
//! decodes, so that any pose has them.

mod axes;
mod cells;
mod fit;
mod maps;
mod nodes;
mod poses;
mod skin;
mod tables;

use nalgebra::{Matrix3, Vector3};
use sinew_formats::package::{
    BakedBones, BakedSkin, BoneGroup, BonesError, GROUP_NODES, Patches, Prior, TURN_NODES, limits, nearest,
};
use sinew_runtime::Basis;

use crate::fold::FoldedComponent;
use crate::tier::Tier;
use crate::{BakeError, Surface};
use cells::Cells;
use fit::Fit;
use nodes::Nodes;
pub(crate) use poses::{shape_poses, slider_poses};

type Matrix = Matrix3<f64>;
type Vector = Vector3<f64>;

/// Bones a vertex follows at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Influences {
    /// What every engine skins with.
    #[default]
    Four,
    /// A second set, for engines that read it.
    Eight,
}

impl Influences {
    /// As a number.
    pub fn count(self) -> usize {
        match self {
            Self::Four => 4,
            Self::Eight => 8,
        }
    }
}

/// What bones to make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoneOptions {
    /// At most so many, 1 to [`limits::BONES`]; no more than vertices.
    pub count: u16,
    /// Bones a vertex follows.
    pub influences: Influences,
}

/// Nodes that are decoded for each bone.
const NODES_A_BONE: usize = 2;

/// The bones of a mesh, owned: fields are those of [`BakedBones`] and [`BakedSkin`], in the package's orders.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "fields are those of BakedBones and BakedSkin")]
pub struct Bones {
    pub patches: Patches,
    pub node_count: usize,
    pub rest_places: Vec<[f32; 3]>,
    pub axes: Vec<[f32; 4]>,
    pub turn_nodes: Vec<[u16; TURN_NODES]>,
    pub turns: Vec<[[f32; 9]; TURN_NODES]>,
    pub pulls: Vec<BoneGroup>,
    pub pull_scales: Vec<f32>,
    pub slides: Vec<BoneGroup>,
    pub slide_scales: Vec<f32>,
    pub influences: usize,
    pub bones: Vec<u8>,
    pub weights: Vec<u16>,
    pub rest_normals: Vec<[i16; 3]>,
    pub error: BonesError,
}

/// The mesh that bones are made for.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// The package with its exact tier.
    pub played: &'a Basis<'a>,
    /// Connectivity and rest shape, source order.
    pub surface: &'a Surface,
    /// The exact tier's orders.
    pub exact: &'a Tier,
    /// Its components, in its solver order. Shape: `[K]`.
    pub components: &'a [FoldedComponent],
    /// Shape: `[K]`.
    pub block_of_component: &'a [u32],
    /// What is known of the weights.
    pub prior: Prior<'a>,
}

impl Bones {
    /// Makes bones and fits them; their error is still to be measured. `decode` gives the gradients of the nodes for poses,
    /// `[poses][N]`, from a package with bones whose tables nobody looks at.
    /// Deterministic, whatever the thread count. Errors: those of [`crate::play::play`] and of `decode`.
    pub(crate) fn new(
        source: &Source<'_>,
        options: &BoneOptions,
        decode: impl Fn(&Bones, &[Vec<f32>]) -> Result<Vec<Vec<Matrix>>, BakeError>,
    ) -> Result<Self, BakeError> {
        let vertex_count = source.played.vertex_count();
        let bone_count = usize::from(options.count).clamp(1, limits::BONES.min(vertex_count));
        let samples = poses::Samples::play(source)?;
        let cells = Cells::of_motion(source, &samples, bone_count);
        let node_cells = Cells::of_gradients(source, &samples, NODES_A_BONE * bone_count);
        let nodes = Nodes::average(source, &node_cells);
        let mut bones = Self::at_rest(source, &cells, &nodes);
        let gradients = decode(&bones, &samples.weights)?;
        let fitted = Fit {
            source,
            samples: &samples,
            cells: &cells,
            nodes: &nodes,
            gradients: &gradients,
            influences: options.influences.count(),
        }
        .run();
        bones.take(source, &fitted, options.influences.count());
        Ok(bones)
    }

    /// Nodes and bones with tables of nothing: every bone stays, and all vertices follow the first.
    fn at_rest(source: &Source<'_>, cells: &Cells, nodes: &Nodes) -> Self {
        let (bone_count, vertex_count) = (cells.members.len(), source.played.vertex_count());
        let groups = bone_count.div_ceil(GROUP_NODES);
        Self {
            patches: nodes.patches.clone(),
            node_count: nodes.centres.len(),
            rest_places: cells.centres.iter().map(narrowed).collect(),
            axes: vec![[0.0, 0.0, 0.0, 1.0]; bone_count],
            turn_nodes: vec![[0; TURN_NODES]; bone_count],
            turns: vec![[[0.0; 9]; TURN_NODES]; bone_count],
            pulls: vec![BoneGroup::default(); groups * nodes.centres.len()],
            pull_scales: vec![0.0; groups * GROUP_NODES],
            slides: vec![BoneGroup::default(); groups * source.played.component_count()],
            slide_scales: vec![0.0; groups * GROUP_NODES],
            influences: 4,
            bones: vec![0; 4 * vertex_count],
            weights: [u16::MAX, 0, 0, 0].repeat(vertex_count),
            rest_normals: vec![[0; 3]; vertex_count],
            error: BonesError::default(),
        }
    }

    /// What was fitted, in whole numbers.
    fn take(&mut self, source: &Source<'_>, fitted: &fit::Fitted, influences: usize) {
        self.axes.clone_from(&fitted.axes);
        for (b, turn) in fitted.turns.iter().enumerate() {
            for (n, (&node, matrix)) in turn.nodes.iter().zip(&turn.matrices).enumerate() {
                self.turn_nodes[b][n] = node as u16;
                self.turns[b][n] = core::array::from_fn(|i| matrix[(i / 3, i % 3)] as f32);
            }
        }
        whole(&fitted.pulls, &mut self.pulls, &mut self.pull_scales);
        whole(&fitted.slides, &mut self.slides, &mut self.slide_scales);
        self.influences = influences;
        let vertices = || source.exact.node_from_slot.iter().map(|&v| v as usize);
        (self.bones, self.weights) = skin::whole_rows(vertices().map(|v| &fitted.skin[v]), influences);
        let normals = rest_normals(source);
        self.rest_normals = vertices().map(|v| normals[v]).collect();
    }

    /// Borrowed, ready to be written.
    pub fn record(&self) -> BakedBones<'_> {
        BakedBones {
            patches: self.patches.record(),
            node_count: self.node_count as u32,
            rest_places: &self.rest_places,
            axes: &self.axes,
            turn_nodes: &self.turn_nodes,
            turns: &self.turns,
            pulls: &self.pulls,
            pull_scales: &self.pull_scales,
            slides: &self.slides,
            slide_scales: &self.slide_scales,
            skin: BakedSkin {
                influences: self.influences as u32,
                bones: &self.bones,
                weights: &self.weights,
                rest_normals: &self.rest_normals,
            },
            error: self.error,
        }
    }
}

/// Rows of vectors, one a bone, to groups of sixteen bones in whole numbers, with a scale for each bone. Shape: `rows` `[B][columns]`,
/// `groups` `[H][columns]`.
fn whole(rows: &[Vec<Vector>], groups: &mut [BoneGroup], scales: &mut [f32]) {
    let columns = rows.first().map_or(0, Vec::len);
    for (b, row) in rows.iter().enumerate() {
        let greatest = row.iter().flatten().fold(0.0_f64, |greatest, x| greatest.max(x.abs()));
        let scale = (greatest / f64::from(i16::MAX)) as f32;
        if !scale.is_normal() {
            continue;
        }
        scales[b] = scale;
        let (h, lane) = (b / GROUP_NODES, b % GROUP_NODES);
        for (column, vector) in row.iter().enumerate() {
            for c in 0..3 {
                groups[h * columns + column][c][lane] = nearest(vector[c] / f64::from(scale));
            }
        }
    }
}

/// Area-weighted unit normals of the rest shape in whole numbers, source order; zero where there is no area.
fn rest_normals(source: &Source<'_>) -> Vec<[i16; 3]> {
    let mut sums = vec![Vector::zeros(); source.surface.rest.len()];
    let rest = |v: u32| Vector::from(source.surface.rest[v as usize]);
    for face in &source.surface.topology.faces {
        let [a, b, c] = face.map(rest);
        let normal = (b - a).cross(&(c - a));
        face.iter().for_each(|&v| sums[v as usize] += normal);
    }
    let whole = |sum: &Vector| {
        let unit = sum.try_normalize(0.0).unwrap_or_else(Vector::zeros);
        core::array::from_fn(|c| nearest(unit[c] * f64::from(i16::MAX)))
    };
    sums.iter().map(whole).collect()
}

/// `T` of `T - I` by rows.
pub(crate) fn from_rows(gradient: &crate::play::Gradient) -> Matrix {
    Matrix::from_row_slice(gradient) + Matrix::identity()
}

fn narrowed(v: &Vector) -> [f32; 3] {
    core::array::from_fn(|c| v[c] as f32)
}

#[cfg(test)]
mod tests;
