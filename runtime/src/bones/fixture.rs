//! Random bones on a small mesh, owned, for unit tests.

use std::vec;
use std::vec::Vec;

use sinew_formats::package::{
    BakedBones, BakedSkin, BoneGroup, BonesError, GROUP_NODES, Patches, PoseError, SKIN_WEIGHT_SUM, TURN_NODES,
};

use crate::simd::tests::naive::Noise;

/// More than a group of them, and the last group short.
pub(crate) const BONES: usize = 19;

/// Owns what a [`BakedBones`] borrows. The nodes are the vertices.
pub(crate) struct OwnBones {
    patches: Patches,
    node_count: u32,
    rest_places: Vec<[f32; 3]>,
    axes: Vec<[f32; 4]>,
    turn_nodes: Vec<[u16; TURN_NODES]>,
    turns: Vec<[[f32; 9]; TURN_NODES]>,
    pulls: Vec<BoneGroup>,
    slides: Vec<BoneGroup>,
    scales: Vec<f32>,
    influences: u32,
    bones: Vec<u8>,
    weights: Vec<u16>,
    rest_normals: Vec<[i16; 3]>,
}

impl OwnBones {
    /// Shape: `rest` `[V]`, slots; `patches` those of the exact tier.
    pub(crate) fn random(rest: &[[f32; 3]], components: usize, patches: &Patches, influences: u32) -> Self {
        let (mut noise, nodes) = (Noise::new(77), rest.len());
        let mut table = |columns: usize| -> Vec<BoneGroup> {
            let groups = BONES.div_ceil(GROUP_NODES) * columns;
            let mut group = |h: usize| {
                let mut whole = BoneGroup::default();
                for c in 0..3 {
                    for lane in 0..GROUP_NODES {
                        if h / columns * GROUP_NODES + lane < BONES {
                            whole[c][lane] = (32_767.0 * noise.next()) as i16;
                        }
                    }
                }
                whole
            };
            (0..groups).map(&mut group).collect()
        };
        let (pulls, slides) = (table(nodes), table(components));
        let mut scales = vec![0.0; GROUP_NODES * BONES.div_ceil(GROUP_NODES)];
        for (b, scale) in scales[..BONES].iter_mut().enumerate() {
            *scale = 1e-6 * (1.0 + b as f32);
        }
        let mut axis = || {
            let q = [noise.next(), noise.next(), noise.next(), 1.0];
            let length = q.iter().map(|x| x * x).sum::<f32>().sqrt();
            q.map(|x| x / length)
        };
        let axes = (0..BONES).map(|_| axis()).collect();
        let turn_nodes = |b: usize| core::array::from_fn(|n| ((7 * b + 3 * n) % nodes) as u16);
        let turns = (0..BONES)
            .map(|_| core::array::from_fn(|n| core::array::from_fn(|_| noise.next() / (1.0 + n as f32))))
            .collect();
        let mut skin = (Vec::new(), Vec::new());
        for slot in 0..nodes {
            // Two bones of three and one quarter, and none besides.
            let heavy = (SKIN_WEIGHT_SUM * 3 / 4) as u16;
            for n in 0..influences as usize {
                let row = [
                    ((slot % BONES) as u8, heavy),
                    (((slot + 5) % BONES) as u8, u16::MAX - heavy),
                ];
                let (bone, weight) = row.get(n).copied().unwrap_or_default();
                skin.0.push(bone);
                skin.1.push(weight);
            }
        }
        let mut normal = || noise.point().map(|x| (20_000.0 * x) as i16);
        Self {
            patches: patches.clone(),
            node_count: nodes as u32,
            rest_places: (0..BONES).map(|b| rest[b % nodes].map(|x| x + 0.125)).collect(),
            axes,
            turn_nodes: (0..BONES).map(turn_nodes).collect(),
            turns,
            pulls,
            slides,
            scales,
            influences,
            bones: skin.0,
            weights: skin.1,
            rest_normals: (0..nodes).map(|_| normal()).collect(),
        }
    }

    pub(crate) fn record(&self) -> BakedBones<'_> {
        let figures = PoseError {
            rms: 1e-3,
            p99: 2e-3,
            max: 4e-3,
            normal_rms: 1e-2,
            poses: 60,
        };
        BakedBones {
            patches: self.patches.record(),
            node_count: self.node_count,
            rest_places: &self.rest_places,
            axes: &self.axes,
            turn_nodes: &self.turn_nodes,
            turns: &self.turns,
            pulls: &self.pulls,
            pull_scales: &self.scales,
            slides: &self.slides,
            slide_scales: &self.scales,
            skin: BakedSkin {
                influences: self.influences,
                bones: &self.bones,
                weights: &self.weights,
                rest_normals: &self.rest_normals,
            },
            error: BonesError {
                sliders: figures,
                sliders_scaled: figures,
                ..BonesError::default()
            },
        }
    }
}
