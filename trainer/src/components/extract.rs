//! From trained weights to the compact package: one record and one sparse row a component, redundant ones removed, the
//! rest ordered by what they move.

use serde::{Deserialize, Serialize};
use sinew_formats::package::{
    After, BlockRecord, CompactBasis, ComponentRecord, NONE, Prior, Provenance, Quality, Surface, ValueScales,
};
use sinew_interchange::RenderSurface;

use super::prior::WeightPrior;
use crate::evaluate::EncoderRecord;
use crate::network::attention::Attention;
use crate::network::weights::StackWeights;

/// When a component is kept, and which of its entries.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PruneSettings {
    /// A component is dropped when the mean feature change of the vertices it moves stays below this (paper:
    /// epsilon 2, 1e-2 on features that reach 0.95; ours reach 0.4, and stretch counts a tenth).
    pub least_strength: f32,
    /// A vertex counts as moved when its features change by more than this (paper: epsilon 1).
    pub moved: f32,
    /// Components that act on a vertex, on average: the entries that move least, at the stops of their controls,
    /// are cut until no more are left.
    pub entries_per_vertex: f64,
    /// Entries that stay in any case: a frame's cost goes with all of them, so a small mesh affords more on a vertex.
    pub entries_min: usize,
}

impl PruneSettings {
    /// Entries that may stay on a mesh of so many vertices.
    pub fn entry_budget(&self, vertex_count: usize) -> usize {
        let budget = (self.entries_per_vertex * vertex_count as f64) as usize;
        budget.max(self.entries_min)
    }
}

impl Default for PruneSettings {
    fn default() -> Self {
        Self {
            least_strength: 1e-3,
            moved: 1e-6,
            entries_per_vertex: 7.2,
            // What a mesh of 12,500 vertices has.
            entries_min: 90_000,
        }
    }
}

/// A component on its way into the package.
#[derive(Debug, Clone)]
pub struct LearnedComponent {
    /// Place in the tree: index at each level, for example `[3, 1]` for the second child of the fourth root component.
    pub path: Vec<usize>,
    /// Row of C after quantisation. Shape: `[V][9]`.
    pub row: Vec<[f32; 9]>,
    /// See [`ComponentRecord`].
    pub centre_vertex: u32,
    /// See [`ComponentRecord`].
    pub scale: f32,
    /// See [`ComponentRecord`].
    pub locality: f32,
    /// See [`ComponentRecord`].
    pub strength: f32,
    /// See [`ComponentRecord`].
    pub minimum: f32,
    /// See [`ComponentRecord`].
    pub maximum: f32,
    /// The name of a component that is kept from an older package: nothing of it is cut, and it stays.
    pub kept: Option<String>,
}

impl LearnedComponent {
    /// The farther stop of its control.
    pub fn reach(&self) -> f32 {
        self.maximum.max(-self.minimum)
    }
}

/// A block on its way into the package.
#[derive(Debug, Clone)]
pub struct LearnedBlock {
    /// Path of the component that feeds it; empty for the root.
    pub path: Vec<usize>,
    /// Its convolutions; indices are filled in when written.
    pub record: BlockRecord,
    /// In the order they will have.
    pub components: Vec<LearnedComponent>,
}

/// Loose pieces that move as a whole, P of them. See [`After`].
#[derive(Debug, Clone, PartialEq)]
pub struct Pieces {
    /// The piece of each vertex, or [`sinew_formats::package::NO_PIECE`]. Shape: `[V]`.
    pub piece_of: Vec<u16>,
    /// How far a piece moves a unit of weight, units of the source. Shape: `[K][P]`, K in the basis' order.
    pub offsets: Vec<[f32; 3]>,
}

/// Everything the compact package says about the network, owned and editable.
#[derive(Debug, Clone)]
pub struct LearnedBasis {
    /// Shape: `[V]`.
    pub rest_positions: Vec<[f32; 3]>,
    /// Shape: `[F]`.
    pub faces: Vec<[u32; 3]>,
    /// See [`CompactBasis`].
    pub bridges: Vec<[u32; 2]>,
    /// See [`CompactBasis`].
    pub anchor_vertex: u32,
    /// See [`CompactBasis`].
    pub rotation_scale: f32,
    /// See [`CompactBasis`].
    pub stretch_scale: f32,
    /// Texture coordinates, where the reference has some.
    pub render: Option<RenderSurface>,
    /// What the package keeps for its encoder; nothing where it is the paper's.
    pub encoder: Option<EncoderRecord>,
    /// Parents before children, level by level.
    pub blocks: Vec<LearnedBlock>,
    /// Where loose pieces stand; known last, when components no longer change.
    pub pieces: Option<Pieces>,
    /// What is known of the weights; known last, too.
    pub prior: Option<WeightPrior>,
}

/// The mesh and the scales behind a [`LearnedBasis`].
pub struct BasisFrame {
    /// Shape: `[V]`.
    pub rest_positions: Vec<[f32; 3]>,
    /// Shape: `[F]`.
    pub faces: Vec<[u32; 3]>,
    /// See [`CompactBasis`].
    pub bridges: Vec<[u32; 2]>,
    /// See [`CompactBasis`].
    pub anchor_vertex: u32,
    /// See [`CompactBasis`].
    pub rotation_scale: f32,
    /// See [`CompactBasis`].
    pub stretch_scale: f32,
    /// Texture coordinates, where the reference has some.
    pub render: Option<RenderSurface>,
    /// What the package keeps for its encoder; nothing where it is the paper's.
    pub encoder: Option<EncoderRecord>,
    /// Which of the root block's components are kept from older packages, and their names.
    pub kept: Vec<(usize, String)>,
}

impl LearnedBasis {
    /// Reads the weights, rounds to what is stored and measures centres and localities. `reach[l]` is
    /// the distance within which level l was asked to stay; `distances(v)` is normalised to the longest on the mesh.
    /// Ranges and strengths are not known yet: ±1 and 0.
    pub fn from_weights(
        weights: &StackWeights,
        frame: BasisFrame,
        reach: &[f32],
        distances: &dyn Fn(usize) -> Vec<f32>,
    ) -> Self {
        let mut blocks = Vec::new();
        let mut paths: Vec<Vec<usize>> = vec![Vec::new()];
        for (level, level_weights) in weights.levels.iter().enumerate() {
            let mut child_paths = Vec::new();
            for (path, block) in paths.iter().zip(&level_weights.blocks) {
                let width = weights.vertex_count * 9;
                let mut components = Vec::new();
                for (k, values) in block.components.chunks_exact(width).enumerate() {
                    let mut component_path = path.clone();
                    component_path.push(k);
                    child_paths.push(component_path.clone());
                    let mut row: Vec<[f32; 9]> =
                        values.chunks_exact(9).map(|x| core::array::from_fn(|c| x[c])).collect();
                    round_to_stored(&mut row);
                    let centre = strongest(&row);
                    let scale = reach.get(level).or(reach.last()).copied().unwrap_or(1.0);
                    let locality = energy_within(&row, &distances(centre), scale);
                    let kept = frame.kept.iter().find(|(root, _)| component_path == [*root]);
                    components.push(LearnedComponent {
                        path: component_path,
                        row,
                        centre_vertex: centre as u32,
                        scale,
                        locality,
                        strength: 0.0,
                        minimum: -1.0,
                        maximum: 1.0,
                        kept: kept.map(|(_, name)| name.clone()),
                    });
                }
                let record = BlockRecord {
                    level: level as u32,
                    parent_component: NONE,
                    first_component: 0,
                    component_count: 0,
                    encoder: block.encoder,
                    decoder: block.decoder,
                };
                blocks.push(LearnedBlock {
                    path: path.clone(),
                    record,
                    components,
                });
            }
            paths = child_paths;
        }
        Self {
            rest_positions: frame.rest_positions,
            faces: frame.faces,
            bridges: frame.bridges,
            anchor_vertex: frame.anchor_vertex,
            rotation_scale: frame.rotation_scale,
            stretch_scale: frame.stretch_scale,
            render: frame.render,
            pieces: None,
            prior: None,
            encoder: frame.encoder,
            blocks,
        }
    }

    /// Components in package order.
    pub fn components(&self) -> impl Iterator<Item = &LearnedComponent> {
        self.blocks.iter().flat_map(|block| &block.components)
    }

    /// Components in package order.
    pub fn components_mut(&mut self) -> impl Iterator<Item = &mut LearnedComponent> {
        self.blocks.iter_mut().flat_map(|block| &mut block.components)
    }

    /// Writes the rows, rounded and cut as they are here, back into the `weights` they were read from.
    pub fn put_rows_into(&self, weights: &mut StackWeights) {
        for (block, own) in weights.blocks_mut().zip(&self.blocks) {
            let rows = own.components.iter().flat_map(|component| component.row.as_flattened());
            block.components = rows.copied().collect();
        }
    }

    /// Cuts the faint parts of all components until as many are left as [`PruneSettings`] allow: those that
    /// change features least when their control stands at its farther stop, so that weak components lose more than
    /// strong ones. Ranges must be known; centres and localities are measured anew.
    pub fn cut_faint_parts(&mut self, settings: &PruneSettings, distances: &dyn Fn(usize) -> Vec<f32>) {
        let budget = settings.entry_budget(self.rest_positions.len());
        let effect = |component: &LearnedComponent, x: &[f32; 9]| energy(x) * f64::from(component.reach()).powi(2);
        let mut effects: Vec<f64> = self
            .components()
            .filter(|component| component.kept.is_none())
            .flat_map(|component| component.row.iter().map(move |x| effect(component, x)))
            .filter(|effect| *effect > 0.0)
            .collect();
        if effects.len() <= budget {
            return;
        }
        let first_kept = effects.len() - budget;
        let (_, &mut least, _) = effects.select_nth_unstable_by(first_kept, f64::total_cmp);
        for component in self.components_mut().filter(|component| component.kept.is_none()) {
            let reach = f64::from(component.reach()).powi(2);
            for x in component.row.iter_mut().filter(|x| energy(x) * reach < least) {
                *x = [0.0; 9];
            }
            component.locality = energy_within(
                &component.row,
                &distances(component.centre_vertex as usize),
                component.scale,
            );
        }
    }

    /// Removes redundant components: `feature_changes` (package order) is each one's mean feature change over the vertices
    /// it moves. A component stays while a child of its own stays, for its attention mask feeds that child; where shares
    /// are equal, every component of a block that feeds others stays, for each is a share. At least the strongest
    /// component stays. Returns how many went.
    pub fn prune(&mut self, feature_changes: &[f32], settings: &PruneSettings, attention: Attention) -> usize {
        let before = feature_changes.len();
        let strongest = feature_changes.iter().copied().fold(0.0, f32::max);
        let level_count = self
            .components()
            .map(|component| component.path.len())
            .max()
            .unwrap_or(0);
        let mut keep: Vec<(Vec<usize>, bool)> = self
            .components()
            .zip(feature_changes)
            .map(|(component, &change)| {
                let is_share = attention == Attention::Equal && component.path.len() < level_count;
                let stays = is_share || component.kept.is_some() || change >= settings.least_strength.min(strongest);
                (component.path.clone(), stays)
            })
            .collect();
        for i in (0..keep.len()).rev() {
            if keep[i].1 && keep[i].0.len() > 1 {
                let parent = keep[i].0[..keep[i].0.len() - 1].to_vec();
                if let Some(entry) = keep.iter_mut().find(|entry| entry.0 == parent) {
                    entry.1 = true;
                }
            }
        }
        let kept: Vec<Vec<usize>> = keep.into_iter().filter(|entry| entry.1).map(|entry| entry.0).collect();
        for block in &mut self.blocks {
            block.components.retain(|component| kept.contains(&component.path));
        }
        self.blocks.retain(|block| !block.components.is_empty());
        before - kept.len()
    }

    /// Orders the components of each block by strength, falling, and renumbers the tree, so that `c0` is what moves most.
    pub fn order_by_strength(&mut self) {
        let blocks = core::mem::take(&mut self.blocks);
        // New path of every old path, parents first because blocks are.
        let mut renamed: Vec<(Vec<usize>, Vec<usize>)> = vec![(Vec::new(), Vec::new())];
        let mut ordered = Vec::with_capacity(blocks.len());
        for mut block in blocks {
            block
                .components
                .sort_by(|a, b| b.strength.total_cmp(&a.strength).then_with(|| a.path.cmp(&b.path)));
            let Some(parent) = renamed
                .iter()
                .find(|pair| pair.0 == block.path)
                .map(|pair| pair.1.clone())
            else {
                continue;
            };
            for (i, component) in block.components.iter_mut().enumerate() {
                let mut path = parent.clone();
                path.push(i);
                renamed.push((core::mem::replace(&mut component.path, path.clone()), path));
            }
            block.path = parent;
            ordered.push(block);
        }
        ordered.sort_by(|a, b| (a.path.len(), &a.path).cmp(&(b.path.len(), &b.path)));
        self.blocks = ordered;
    }

    /// Hands the borrowed records of the package to `write`.
    pub fn with_records<T>(
        &self,
        provenance: Provenance<'_>,
        quality: Quality,
        write: impl FnOnce(&CompactBasis<'_>) -> T,
    ) -> T {
        let vertex_count = self.rest_positions.len();
        let words = vertex_count.div_ceil(32);
        let names: Vec<String> = self
            .components()
            .map(|component| component_name(&component.path))
            .collect();
        let index_of = |path: &[usize]| {
            self.components()
                .position(|c| c.path == path)
                .map_or(NONE, |k| k as u32)
        };
        let (mut blocks, mut components, mut bits, mut values) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (b, block) in self.blocks.iter().enumerate() {
            let mut record = block.record;
            record.parent_component = if block.path.is_empty() {
                NONE
            } else {
                index_of(&block.path)
            };
            record.first_component = components.len() as u32;
            record.component_count = block.components.len() as u32;
            blocks.push(record);
            for component in &block.components {
                let value_scales = ValueScales::for_values(&component.row);
                let mut support = vec![0_u32; words];
                for (v, x) in component
                    .row
                    .iter()
                    .enumerate()
                    .filter(|(_, x)| x.iter().any(|&x| x != 0.0))
                {
                    support[v / 32] |= 1 << (v % 32);
                    values.push(value_scales.round(x));
                }
                bits.extend_from_slice(&support);
                components.push(ComponentRecord {
                    name: &names[components.len()],
                    block: b as u32,
                    centre_vertex: component.centre_vertex,
                    scale: component.scale,
                    strength: component.strength,
                    locality: component.locality,
                    minimum: component.minimum,
                    maximum: component.maximum,
                    value_scales,
                });
            }
        }
        let encoder = self.encoder.map_or_else(Vec::new, |record| record.to_bytes().to_vec());
        write(&CompactBasis {
            rest_positions: &self.rest_positions,
            surface: match &self.render {
                Some(render) => Surface::textured(vertex_count, &render.faces, &render.vertices, &render.uvs),
                None => Surface::plain(vertex_count, &self.faces),
            },
            bridges: &self.bridges,
            anchor_vertex: self.anchor_vertex,
            rotation_scale: self.rotation_scale,
            stretch_scale: self.stretch_scale,
            blocks: &blocks,
            components: &components,
            support_bits: &bits,
            values: &values,
            after: match &self.pieces {
                Some(pieces) => After {
                    piece_of: &pieces.piece_of,
                    piece_offsets: &pieces.offsets,
                    ..After::NONE
                },
                None => After::NONE,
            },
            prior: match &self.prior {
                Some(prior) => Prior {
                    mean: &prior.mean,
                    factors: &prior.factors,
                    variances: &prior.variances,
                    strength: prior.strength,
                },
                None => Prior::NONE,
            },
            encoder: &encoder,
            provenance,
            quality,
        })
    }
}

/// Name of a component from its place in the tree: `c3`, its second child `c3.1`, and so on.
pub fn component_name(path: &[usize]) -> String {
    let numbers: Vec<String> = path.iter().map(usize::to_string).collect();
    format!("c{}", numbers.join("."))
}

fn energy(x: &[f32; 9]) -> f64 {
    x.iter().map(|x| f64::from(*x).powi(2)).sum()
}

/// `argmax_v |C_v|`, the lowest index among equals.
fn strongest(row: &[[f32; 9]]) -> usize {
    let mut best = (0.0, 0);
    for (v, x) in row.iter().enumerate() {
        if energy(x) > best.0 {
            best = (energy(x), v);
        }
    }
    best.1
}

/// Share of a row's energy at vertices nearer than `reach`; 1 for a row of zeros.
fn energy_within(row: &[[f32; 9]], distances: &[f32], reach: f32) -> f32 {
    let total: f64 = row.iter().map(energy).sum();
    let within: f64 = row
        .iter()
        .zip(distances)
        .filter(|(_, d)| **d <= reach)
        .map(|(x, _)| energy(x))
        .sum();
    if total > 0.0 { (within / total) as f32 } else { 1.0 }
}

/// Rounds to what the package will hold, so that everything measured later is measured on the shipped numbers.
fn round_to_stored(row: &mut [[f32; 9]]) {
    let scales = ValueScales::for_values(row);
    for x in row.iter_mut() {
        *x = scales.widen(&scales.round(x));
    }
}

#[cfg(test)]
mod tests;
